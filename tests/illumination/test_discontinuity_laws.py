"""Discontinuities against irradiance itself: nothing is missed, and each is as strong as is claimed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.polynomial.chebyshev import Chebyshev
from scipy.spatial import cKDTree

from solver.geometry.scene import Mesh, SceneObject
from solver.geometry.transform import Transform
from solver.illumination.discontinuity.discontinuities import Discontinuities, find_discontinuities
from solver.illumination.discontinuity.outlines import find_outlines
from solver.illumination.discontinuity.segments import EV, GRAZE, SHORTEST, VE, polygons_of, receiver_planes
from solver.illumination.discontinuity.sets import ActiveEdges, group_discontinuities
from solver.illumination.discontinuity.shadow_sight import free_parts, gather_spheres
from solver.illumination.discontinuity.wedges import meet_receiver, wedge_normal
from solver.types import FloatArray
from solver.visibility.brute_force import blocking_margin
from tests.illumination.shadow_scenes import (
    FLOOR,
    HEIGHT,
    LAMP,
    LIGHT,
    Shadows,
    box,
    find,
    hierarchy_of,
    polygon,
    shadows,
    solid,
    square,
    surfaces_of,
)
from tests.visibility.soups import Soup, soups

STEPS = 700


def crossings(found: Discontinuities, start: FloatArray, step: FloatArray) -> FloatArray:
    """Where the line start + t step on the floor crosses each discontinuity; nan where it does not."""
    a, along = found.ends[:, 0] - start, found.ends[:, 1] - found.ends[:, 0]
    across = step[0] * along[:, 1] - step[1] * along[:, 0]
    t = (a[:, 0] * along[:, 1] - a[:, 1] * along[:, 0]) / across
    place = (a[:, 0] * step[1] - a[:, 1] * step[0]) / across
    return np.where((place >= -1e-9) & (place <= 1.0 + 1e-9), t, np.nan)


@settings(max_examples=10)
@given(shadows(), st.integers(0, 2**32 - 1))
def test_irradiance_is_smooth_between_discontinuities(scene: Shadows, seed: int) -> None:
    """Fourth differences along a line over the floor, through a shadow, peak at crossings only."""
    middle, lamp = scene.blockers[0].mean(axis=0), scene.lamp.mean(axis=0)
    shaded = lamp + (middle - lamp) * HEIGHT / (HEIGHT - middle[2])
    angle, reach = np.random.default_rng(seed).uniform([0.0, 0.3], [2.0 * np.pi, 2.0])
    start, end = (shaded + s * reach * np.array([np.cos(angle), np.sin(angle), 0.0]) for s in (-1.0, 0.9))
    places = (np.arange(STEPS) + 0.5) / STEPS
    irradiance = scene.along(start, end - start, places)
    rough = np.abs(np.diff(irradiance, 4))
    around = np.array([np.median(rough[max(0, i - 12) : i + 13]) for i in range(len(rough))])
    peaks = np.flatnonzero(rough > np.maximum(20.0 * around, 1e-10 * irradiance.max()))
    known = crossings(find(scene.surfaces, [0]), start, end - start)
    assert len(peaks) > 0
    for peak in peaks:
        assert np.nanmin(np.abs(known - places[peak + 2]), initial=np.inf) < 4.0 / STEPS


@settings(max_examples=7)
@given(shadows())
def test_derivatives_jump_by_what_is_told(scene: Shadows) -> None:
    """Across the middle of each discontinuity: the second derivative by its bend; the first, where a blocker
    is seen edge-on, by form factor over width."""
    found = find(scene.surfaces, [0])
    middle = found.ends.mean(axis=1)
    nodes = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, 10))
    for k in range(len(found)):
        near = 0.9 * min(distance_to_others(found, k, middle[k]), 0.05)
        along = found.ends[k, 1] - found.ends[k, 0]
        if near < 0.005:
            continue
        across = np.array([-along[1], along[0], 0.0]) / np.linalg.norm(along)
        jump = np.zeros(3)
        for side in (-1.0, 1.0):
            fit = Chebyshev.fit(side * near * nodes, scene.along(middle[k], across, side * near * nodes), 8)
            jump += side * np.array([fit(0.0), fit.deriv(1)(0.0), fit.deriv(2)(0.0)])
        assert abs(jump[0]) < 1e-9
        if found.kind[k] in (VE, EV):
            np.testing.assert_allclose(abs(jump[2]), found.bend[k, 1], rtol=0.01, atol=1e-6)
        else:
            assert found.kind[k] == GRAZE
            expected = found.form_factor[k, 1] / found.width[k, 1]
            np.testing.assert_allclose(abs(jump[1]), expected, rtol=0.15, atol=1e-6)


@settings(max_examples=6)
@given(shadows())
def test_weights_bound_what_interpolation_misses(scene: Shadows) -> None:
    """Of a quadratic across a cell with the line anywhere in it, on top of what it misses in cells without;
    and not by much, where the line is sharp."""
    found = find(scene.surfaces, [0])
    middle = found.ends.mean(axis=1)
    near = np.array([min(0.4 * distance_to_others(found, k, middle[k]), 0.05) for k in range(len(found))])
    # The weight of what is as strong all along as in its middle, per W/m2 of the source.
    even = replace(
        found,
        form_factor=np.repeat(found.form_factor[:, 1:2], 3, axis=1),
        width=np.repeat(found.width[:, 1:2], 3, axis=1),
        bend=np.repeat(found.bend[:, 1:2], 3, axis=1),
    )
    weight = even.weights(np.ones(scene.surfaces.patch_count), near)
    for k in np.argsort(-weight)[:5]:
        along = found.ends[k, 1] - found.ends[k, 0]
        across = np.array([-along[1], along[0], 0.0]) / np.linalg.norm(along)
        missed = {
            shift: missed_by_parabola(scene, middle[k] + shift * near[k] * across, near[k] * across)
            for shift in (-1.0, -0.79, -0.6, -0.5, -0.4, 0.0)
        }
        smooth = 2.0 * max(missed.pop(-1.0), missed.pop(0.0))
        assert max(missed.values()) <= 1.15 * weight[k] + smooth
        if found.kind[k] != GRAZE and smooth < 0.05 * weight[k]:
            assert max(missed.values()) >= 0.25 * weight[k]


def missed_by_parabola(scene: Shadows, start: FloatArray, step: FloatArray) -> float:
    """Greatest error of the parabola through ends and middle of a cell from start to start + step."""
    x = np.linspace(0.0, 1.0, 21)
    values = scene.along(start, step, x)
    parabola = values[0] * (1 - x) * (1 - 2 * x) + values[10] * 4 * x * (1 - x) + values[20] * x * (2 * x - 1)
    return float(np.abs(parabola - values).max())


def distance_to_others(found: Discontinuities, k: int, point: FloatArray) -> float:
    """Distance of a point from all discontinuities but the k-th, m."""
    a, along = found.ends[:, 0], found.ends[:, 1] - found.ends[:, 0]
    t = np.clip(np.einsum("ij,ij->i", point - a, along) / np.einsum("ij,ij->i", along, along), 0.0, 1.0)
    distance = np.linalg.norm(a + t[:, None] * along - point, axis=1)
    distance[k] = np.inf
    return float(distance.min())


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1), st.booleans())
def test_free_parts_of_a_wedge_are_those_that_nothing_crosses(seed: int, is_ev: bool) -> None:
    """Sight lines from a source's vertex past an edge, or from an edge of it past a vertex, one by one."""
    random = np.random.default_rng(seed)
    sheets = [
        random.uniform([-0.7, -0.7, 0.2], [0.7, 0.7, 1.8])
        + random.uniform(0.2, 0.5) * square(1.0, 0.0) @ np.linalg.qr(random.normal(size=(3, 3)))[0]
        for _ in range(6)
    ]
    loose = [polygon(f"sheet{k}", corners) for k, corners in enumerate(sheets)]
    surfaces = surfaces_of(FLOOR, LAMP, *loose)
    polygons = polygons_of(surfaces)
    wedge = random.uniform([-0.6, -0.6, 0.8], [0.6, 0.6, 1.2], (3, 3))
    wedge[(1, 2) if is_ev else 0, 2] = HEIGHT
    normal, planes, parts = np.empty(3), np.empty((5, 4)), np.empty((20, 2))
    assert wedge_normal(wedge, normal)
    receiver_planes(polygons, 0, planes)
    pool = np.arange(2, surfaces.patch_count, dtype=np.int32)
    spheres = np.empty((4, len(pool)))
    gather_spheres(polygons, pool, 0, len(pool), spheres)
    count = free_parts(
        polygons, find_outlines(surfaces), wedge, normal, is_ev, -1, 0, 1, pool, 0, len(pool), spheres,
        1e-9, np.empty(20), np.empty((20, 2)), parts,
    )  # fmt: skip
    places = np.linspace(0.01, 0.99, 200)
    met, origin = np.empty((200, 3)), surfaces.corners[0, 0]
    for k, place in enumerate(places):
        meet_receiver(wedge, place, planes, origin, is_ev, met[k])
    base = wedge[1] + places[:, None] * (wedge[2] - wedge[1])
    start = base if is_ev else np.broadcast_to(wedge[0], base.shape)
    loose_ones = np.isin(surfaces.triangle_patch[:, 0], pool)
    margin = blocking_margin(start, met + origin, surfaces.triangles[loose_ones])
    is_free = np.zeros(200, dtype=np.bool_)
    for low, high in parts[:count]:
        is_free |= (places > low) & (places < high)
    sure = np.abs(margin) > 1e-6
    np.testing.assert_array_equal(is_free[sure], margin[sure] < 0.0)


@settings(max_examples=12)
@given(st.sampled_from([1e-3, 1.0, 1e3]), st.integers(0, 2**32 - 1), st.booleans())
def test_finding_does_not_depend_on_place_turn_or_scale(scale: float, seed: int, far: bool) -> None:
    """The same lines on the same patches, although rounding is another one and nothing is axis-parallel."""
    random = np.random.default_rng(seed)
    shift = (100.0 if far else 1.0) * random.normal(size=3)
    place = Transform.from_parts(scale * shift, random.normal(size=4), np.full(3, scale))
    objects = furnished()
    before = find(surfaces_of(*objects))
    after = find(surfaces_of(*(replace(o, transform=place) for o in objects)))
    assert len(before) > 100 and len(after) == len(before)
    # In the same order: that of the hierarchy is another one.
    back = np.linalg.inv(place.matrix)
    after_ends = after.ends @ back[:3, :3].T + back[:3, 3]
    one, other = marks(before, before.ends), marks(after, after_ends)
    assert cKDTree(one).query(other)[0].max() < 1e-7
    distance, match = cKDTree(other).query(one)
    assert distance.max() < 1e-7
    # Blockers in a row may graze the same line, with other strengths.
    unlike = before.kind != GRAZE
    before, after = before.take(unlike), after.take(match[unlike])
    np.testing.assert_allclose(after.form_factor, before.form_factor, atol=1e-7)
    # Where a blocker touches the receiver, its distance is within rounding of 0.
    np.testing.assert_allclose(np.minimum(after.ratio, 1e4), np.minimum(before.ratio, 1e4), rtol=1e-5)
    bend = np.minimum(before.bend, 1e4)
    np.testing.assert_allclose(np.minimum(after.bend * scale**2, 1e4), bend, rtol=1e-4, atol=1e-6)


def marks(found: Discontinuities, ends: FloatArray) -> FloatArray:
    """What tells discontinuities apart, whichever way they run: (d, 9), much closer for equal ones."""
    along = ends[:, 1] - ends[:, 0]
    along = along * np.where(along @ np.array([1.0, 0.618, 0.357]) < 0.0, -1.0, 1.0)[:, None]
    return np.column_stack([found.receiver, found.source, found.kind, ends.mean(axis=1), along])


def furnished() -> list[SceneObject]:
    """A table that stands on the floor with a box on it, a sheet that leans through the floor, a lamp."""
    legs = [
        solid(f"leg{x}{y}", box([x, y, 0.0], [x + 0.1, y + 0.1, 0.7]))
        for x in (-0.6, 0.5)
        for y in (-0.4, 0.3)
    ]
    leaning = np.array([[1.0, -0.5, -0.2], [1.0, 0.5, -0.2], [1.6, 0.5, 1.0], [1.6, -0.5, 1.0]])
    return [
        FLOOR,
        LAMP,
        *legs,
        solid("top", box([-0.7, -0.5, 0.7], [0.7, 0.5, 0.75])),
        solid("box", box([-0.2, -0.2, 0.75], [0.1, 0.2, 1.0])),
        polygon("leaning", leaning),
    ]


@settings(max_examples=8)
@given(shadows(sheets=False))
def test_cutting_faces_in_pieces_changes_no_line(scene: Shadows) -> None:
    """A blocker and a lamp made of triangles make the same edges as those made of quadrilaterals."""
    whole = [FLOOR, polygon("lamp", scene.lamp, LIGHT), solid("box", scene.blockers[0])]
    cut = [
        FLOOR,
        SceneObject("lamp", Mesh(scene.lamp, ((0, 1, 2), (0, 2, 3))), LIGHT),
        solid("box", scene.blockers[0], triangulated=True),
    ]
    edges = []
    for objects in (whole, cut):
        surfaces = surfaces_of(*objects)
        found = find(surfaces, [0])
        sets = group_discontinuities(surfaces, found)
        edges.append(sets.edges(np.ones(len(found), dtype=np.bool_)))
    assert len(edges[0]) > 0
    assert covers(edges[0], edges[1]) and covers(edges[1], edges[0])


def covers(edges: ActiveEdges, others: ActiveEdges) -> bool:
    """Whether each of `others` lies on `edges`, to 1e-6 m."""
    lines = shapely.MultiLineString([segment[:, :2].tolist() for segment in edges.ends]).buffer(2e-6)
    return all(lines.covers(shapely.LineString(segment[:, :2])) for segment in others.ends)


@settings(max_examples=25)
@given(soups(most=8, anywhere=True))
def test_any_soup_of_polygons(soup: Soup) -> None:
    """Every patch is lit by every other: all is finite, in the receiver's plane, and long enough."""
    surfaces = soup.surfaces
    everyone = np.arange(surfaces.patch_count, dtype=np.int32)
    found = find_discontinuities(surfaces, hierarchy_of(surfaces), everyone)
    assert np.all(np.isfinite(found.ends)) and not np.isnan(found.ratio).any()
    for array in (found.form_factor, found.width, found.bend):
        assert np.all(array >= 0.0)
    assert np.all(found.form_factor <= 1.0 + 1e-9)
    local = found.ends - surfaces.corners[found.receiver, 0][:, None]
    height = np.einsum("dek,dk->de", local, surfaces.normal[found.receiver])
    assert np.abs(height).max(initial=0.0) <= 1e-8 * surfaces.size
    apart = surfaces.corners[:, :, None] - surfaces.corners[:, None]
    size = np.linalg.norm(apart, axis=-1).max(axis=(1, 2))[found.receiver]
    assert np.all(np.linalg.norm(found.ends[:, 1] - found.ends[:, 0], axis=1) > 0.999 * SHORTEST * size)
    weight = found.weights(np.ones(surfaces.patch_count), 0.1 * size)
    assert not np.isnan(weight).any() and np.all(weight[~found.jump] <= 1.0 + 1e-9)
    sets = group_discontinuities(surfaces, found)
    np.testing.assert_array_equal(sets.patch[sets.member], found.receiver)

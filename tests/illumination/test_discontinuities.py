"""Discontinuities by hand: known lines, penumbras, contacts, horizons and weights."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from solver.document.samples import load_sample
from solver.engine.world import World
from solver.geometry.scene import Material, Mesh, SceneObject
from solver.illumination.discontinuity.discontinuities import (
    BEND,
    KINK,
    Discontinuities,
    find_discontinuities,
    find_shadow_lines,
)
from solver.illumination.discontinuity.outlines import find_outlines
from solver.illumination.discontinuity.segments import CONTACT, EV, GRAZE, HORIZON, SHORTEST, VE
from solver.illumination.discontinuity.silhouettes import is_silhouette
from solver.transport.lambert import points_to_polygon
from solver.types import FloatArray
from tests.illumination.shadow_scenes import (
    FLOOR,
    GREY,
    HEIGHT,
    LAMP,
    LIGHT,
    box,
    emitters,
    find,
    hierarchy_of,
    polygon,
    solid,
    square,
    surfaces_of,
    unordered,
)


def of_kind(found: Discontinuities, kind: int) -> Discontinuities:
    return found.take(found.kind == kind)


# --- shadows ---


def test_a_square_under_a_square_lamp() -> None:
    """Lamp of half side 0.5 at 2, screen of half side 0.2 at 0.5: outer lines at 4/3 0.2 + 1/3 0.5."""
    found = find(surfaces_of(FLOOR, LAMP, polygon("screen", square(0.2, 0.5))), [0])
    assert found.counts() == {"VE": 16, "EV": 16, "horizon": 0, "contact": 0, "graze": 0}

    def shadow(b: float, s: float) -> float:
        return (HEIGHT * b - 0.5 * s) / (HEIGHT - 0.5)

    ve, ev = set(), set()
    for a in (-0.5, 0.5):
        for b in (-0.2, 0.2):
            for other in (-0.5, 0.5):
                line = [(shadow(b, a), shadow(c, other), 0.0) for c in (-0.2, 0.2)]
                ve |= {tuple(line), tuple((y, x, z) for x, y, z in line)}
            for other in (-0.2, 0.2):
                line = [(shadow(b, a), shadow(other, c), 0.0) for c in (0.5, -0.5)]
                ev |= {tuple(line), tuple((y, x, z) for x, y, z in line)}
    for kind, expected in ((VE, ve), (EV, ev)):
        lines = np.array(sorted(expected))
        assert unordered(of_kind(found, kind).ends) == unordered(lines)
    # Edges are parallel: the first derivative jumps, over penumbras of 1.0 . 0.5 / 1.5.
    np.testing.assert_allclose(found.width, 1.0 * 0.5 / 1.5)
    assert np.all(np.isinf(found.bend))
    np.testing.assert_allclose(found.ratio, 1.5 / 0.5)
    np.testing.assert_array_equal(found.source, 1)
    np.testing.assert_array_equal(found.blocker, 2)
    assert not found.jump.any()


def test_vertices_on_straight_outlines_cast_nothing() -> None:
    """A screen or a lamp of 2 x 2 squares has cut edges, but no more corners than a whole one."""
    whole, lamp = polygon("screen", square(0.2, 0.5)), grid("lamp", 0.5, HEIGHT, LIGHT)
    in_pieces = find(surfaces_of(FLOOR, LAMP, grid("screen", 0.2, 0.5, GREY)), [0]).counts()
    assert (in_pieces["VE"], in_pieces["EV"]) == (4 * 8, 4 * 4)
    surfaces = surfaces_of(FLOOR, lamp, whole)
    assert np.all(surfaces.normal[1:5, 2] == -1.0)
    of_pieces = find(surfaces, [0]).counts()
    assert (of_pieces["VE"], of_pieces["EV"]) == (4 * 4, 8 * 4)


def grid(name: str, half: float, z: float, material: Material) -> SceneObject:
    """2 x 2 squares that share vertices; a lamp's face down."""
    vertices = np.array([[x, y, z] for y in (-half, 0.0, half) for x in (-half, 0.0, half)])
    faces = [(a, a + 1, a + 4, a + 3) for a in (0, 1, 3, 4)]
    turned = tuple(face[::-1] if material is LIGHT else face for face in faces)
    return SceneObject(name, Mesh(vertices, turned), material)


def test_a_turned_screen_bends_the_second_derivative_only() -> None:
    """Turned by 45 degrees: an edge passes a corner of the lamp with cotangents 1 and -1."""
    turned = square(0.2, 0.5) @ np.array([[1, 1, 0], [-1, 1, 0], [0, 0, np.sqrt(2)]]) / np.sqrt(2)
    found = find(surfaces_of(FLOOR, LAMP, polygon("screen", turned)), [0])
    assert np.all(np.isfinite(found.bend))
    ve = of_kind(found, VE)
    assert len(ve) == 16
    apart = LAMP.mesh.vertices[:, None] - ve.ends.mean(axis=1)
    density = HEIGHT**2 / (np.pi * (apart**2).sum(axis=-1) ** 2)
    expected = 2.0 * (1.5 / 0.5) ** 2 * density
    assert np.all(np.isclose(ve.bend[:, 1], expected, rtol=1e-9).any(axis=0)), "for one of the corners"


def test_what_is_above_the_lamp_or_outside_of_the_shaft_casts_nothing() -> None:
    above = polygon("above", square(0.2, 2.5))
    aside = polygon("aside", square(0.1, 1.9, x=1.95, y=1.95))
    assert len(find(surfaces_of(FLOOR, LAMP, above, aside), [0])) == 0


def test_a_screen_that_hides_all_leaves_no_line() -> None:
    screen = polygon("screen", square(3.0, 1.0))
    assert len(find(surfaces_of(FLOOR, LAMP, screen), [0])) == 0


def test_lines_are_cut_where_the_source_is_hidden() -> None:
    """A large plate under half of a small one takes away what the small one casts there."""
    small, plate = polygon("small", square(0.2, 1.0)), polygon("plate", square(1.5, 0.5, x=1.5))
    whole = find(surfaces_of(FLOOR, LAMP, small, plate), [0], keep_hidden=True)
    free = find(surfaces_of(FLOOR, LAMP, small, plate), [0])
    by_small = [found.take(found.blocker == 2) for found in (whole, free)]
    assert by_small[0].ends[:, :, 0].max() > 0.3
    assert len(by_small[1]) < len(by_small[0])
    # From the lamp's far edge light comes under the plate as far as 0 + 0.5 / 1.5 . 0.5.
    assert 0.0 < by_small[1].ends[:, :, 0].max() < 0.17
    # The small one takes nothing from the plate's own but what is seen through it.
    by_plate = [found.take(found.blocker == 3) for found in (whole, free)]
    assert 0.5 * total_length(by_plate[0]) < total_length(by_plate[1]) < total_length(by_plate[0])


def total_length(found: Discontinuities) -> float:
    return float(np.linalg.norm(found.ends[:, 1] - found.ends[:, 0], axis=1).sum())


# --- silhouettes ---


@pytest.mark.parametrize(
    ("eye", "count"),
    [((0.5, 0.5, 5.0), 4), ((3.0, 0.5, 3.0), 6), ((3.0, 4.0, 5.0), 6), ((-4.0, -3.0, -2.0), 6)],
    ids=["above", "across-an-edge", "across-a-corner", "below"],
)
@pytest.mark.parametrize("triangulated", [False, True], ids=["faces", "triangles"])
def test_silhouettes_of_a_box(eye: tuple[float, float, float], count: int, triangulated: bool) -> None:
    surfaces = surfaces_of(solid("box", box((0, 0, 0), (1, 1, 1)), triangulated=triangulated))
    outlines = find_outlines(surfaces)
    assert len(outlines.point) == 8
    assert len(outlines.ends) == (18 if triangulated else 12)
    assert outlines.is_flat.sum() == outlines.is_inner.sum() == (6 if triangulated else 0)
    assert outlines.is_corner.sum() == surfaces.corner_count.sum()
    seen = [is_silhouette(outlines, e, *eye, 1e-9) for e in range(len(outlines.ends))]
    assert sum(seen) == count


def test_outlines_of_a_flat_face_in_pieces() -> None:
    """Of a 2 x 2 grid of squares only the outer edges bound anything, and only its four corners turn."""
    outlines = find_outlines(surfaces_of(grid("grid", 1.0, 0.0, GREY)))
    assert len(outlines.ends) == 12 and outlines.is_flat.sum() == 4
    assert sum(is_silhouette(outlines, e, 0.3, 0.4, 3.0, 1e-9) for e in range(12)) == 8
    assert outlines.is_corner.sum() == 4


def test_edges_of_rooms_and_of_three_sheets_cast_nothing_inside() -> None:
    """Walls that meet hide nothing from each other; a sheet on the joint of two bounds no shadow there."""
    wall = polygon("wall", np.array([[-2.0, -2, 0], [-2, 2, 0], [-2, 2, 2], [-2, -2, 2]]))
    left = polygon("left", np.array([[-1.0, -1, 0], [0, -1, 0], [0, 1, 0], [-1, 1, 0]]))
    right = polygon("right", np.array([[0.0, -1, 0], [1, -1, 0], [1, 1, 0], [0, 1, 0]]))
    fin = polygon("fin", np.array([[0.0, -1, 0], [0, 1, 0], [0, 1, 1], [0, -1, 1]]))
    for objects in ((FLOOR, wall), (left, right, fin)):
        outlines = find_outlines(surfaces_of(*objects))
        shared = np.flatnonzero(np.diff(outlines.sheet_start) > 1)
        assert len(shared) == 1
        assert not is_silhouette(outlines, int(shared[0]), 0.5, 0.3, 1.5, 1e-9)


def test_corners_of_different_objects_are_welded() -> None:
    left = polygon("left", np.array([[-1.0, -1, 0], [0, -1, 0], [0, 1, 0], [-1, 1, 0]]))
    for gap, edges in ((1e-9, 7), (1e-4, 8)):
        right = polygon("right", np.array([[gap, -1, 0], [1, -1, 0], [1, 1, 0], [gap, 1, 0]]))
        assert len(find_outlines(surfaces_of(left, right)).ends) == edges


# --- contacts ---

OUTLINE = unordered(
    np.array([[[x, y, 0.0], [v, w, 0.0]] for x, y, v, w in [(-0.5, -0.4, 0.5, -0.4), (0.5, -0.4, 0.5, 0.4),
                                                          (0.5, 0.4, -0.5, 0.4), (-0.5, 0.4, -0.5, -0.4)]])
)  # fmt: skip


@pytest.mark.parametrize(
    "standing",
    [
        solid("box", box((-0.5, -0.4, 0.0), (0.5, 0.4, 1.0))),
        solid("box", box((-0.5, -0.4, 0.0), (0.5, 0.4, 1.0)), without=[0]),
        solid("box", box((-0.5, -0.4, 0.0), (0.5, 0.4, 1.0)), triangulated=True),
        polygon("rug", np.array([[-0.5, -0.4, 0], [-0.5, 0.4, 0], [0.5, 0.4, 0], [0.5, -0.4, 0]])),
    ],
    ids=["standing", "without-bottom", "of-triangles", "rug-face-down"],
)
def test_contacts_are_the_outline_of_what_stands_there(standing: SceneObject) -> None:
    surfaces = surfaces_of(FLOOR, standing)
    found = find(surfaces, [0])
    assert unordered(found.ends) == OUTLINE and len(found) == 4
    assert found.jump.all() and np.all(found.kind == CONTACT) and np.all(found.source == -1)
    assert np.all(np.isinf(found.weights(np.zeros(surfaces.patch_count), np.ones(4))))
    assert np.all(np.isinf(found.hardt_weights(np.zeros(surfaces.patch_count))))


def test_a_sunk_box_crosses_the_floor_in_its_outline() -> None:
    found = find(surfaces_of(FLOOR, solid("box", box((-0.5, -0.4, -0.3), (0.5, 0.4, 1.0)))), [0])
    assert unordered(found.ends) == OUTLINE


def test_a_leaning_sheet_crosses_the_floor_in_a_line_clipped_to_it() -> None:
    sheet = np.array([[0.0, -3, -1], [0, 3, -1], [1, 3, 1], [1, -3, 1]])
    found = find(surfaces_of(FLOOR, polygon("sheet", sheet)), [0])
    assert unordered(found.ends) == unordered(np.array([[[0.5, -2, 0], [0.5, 2, 0]]]))


@pytest.mark.parametrize(
    "other",
    [
        solid("under", box((-0.5, -0.4, -1.0), (0.5, 0.4, 0.0))),
        solid("above", box((-0.5, -0.4, 0.1), (0.5, 0.4, 1.0))),
        polygon("wall", np.array([[2.0, -2, 0], [2, 2, 0], [2, 2, 2], [2, -2, 2]])),
        polygon("beside", square(1.0, 0.0, x=3.0)),
        polygon("corner", np.array([[0.0, 0, 0], [1, 1, 1], [-1, 1, 1]])),
    ],
    ids=["flush-from-behind", "above", "on-the-border", "beside", "in-a-point"],
)
def test_no_contact(other: SceneObject) -> None:
    assert len(find(surfaces_of(FLOOR, other), [0])) == 0


def test_a_leg_touches_the_underside_of_a_table() -> None:
    top = polygon("underside", square(1.0, 1.0, down=True))
    found = find(surfaces_of(top, solid("leg", box((-0.1, -0.1, 0.0), (0.1, 0.1, 1.0)))), [0])
    assert len(found) == 4
    np.testing.assert_allclose(np.abs(found.ends[:, :, :2]), 0.1)


# --- horizons ---


def tilted(z: float = 1.0) -> FloatArray:
    """A source whose plane meets the floor at x = z / 2; its front is on the side of greater x."""
    return np.array([[0.0, -1.0, z], [0.0, 1.0, z], [-0.5, 1.0, z + 1.0], [-0.5, -1.0, z + 1.0]])


def test_the_plane_of_a_leaning_lamp_splits_the_floor() -> None:
    surfaces = surfaces_of(FLOOR, polygon("lamp", tilted(), LIGHT))
    assert surfaces.normal[1, 0] > 0.0
    found = find(surfaces, [0])
    assert unordered(found.ends) == unordered(np.array([[[0.5, -2, 0], [0.5, 2, 0]]]))
    assert found.kind[0] == HORIZON and found.blocker[0] == -1 and found.ratio[0] == 1.0
    assert not found.jump[0]
    # The slope in front of the line is form factor / width.
    steps = np.array([1e-5, 2e-5])
    points = np.column_stack([0.5 + steps, np.zeros(2), np.zeros(2)])
    factors = points_to_polygon(points, np.tile([0.0, 0, 1], (2, 1)), tilted())
    slope = float(np.diff(factors)[0] / 1e-5)
    np.testing.assert_allclose(found.form_factor[0, 1] / found.width[0, 1], slope, rtol=1e-3)


def test_no_horizon_where_nothing_is_exchanged() -> None:
    """The lamp's plane splits the floor, but a screen hides all, or the lamp is under the floor."""
    lamp = polygon("lamp", tilted(), LIGHT)
    screen = polygon("screen", square(3.0, 0.5))
    assert not np.any(find(surfaces_of(FLOOR, lamp, screen), [0]).kind == HORIZON)
    sunk = polygon("lamp", tilted() - np.array([0, 0, 3.0]), LIGHT)
    assert not np.any(find(surfaces_of(FLOOR, sunk), [0]).kind == HORIZON)


@pytest.mark.parametrize(("top", "far"), [(1.0, 0.2 + 0.7), (1.6, 2.0)], ids=["within", "to-the-border"])
def test_a_sheet_seen_edge_on(top: float, far: float) -> None:
    """A standing sheet's plane x = 0.1 under a lamp: shaded as far as lines over its top lead."""
    sheet = np.array([[0.1, -0.2, 0.5], [0.1, 0.2, 0.5], [0.1, 0.2, top], [0.1, -0.2, top]])
    found = of_kind(find(surfaces_of(FLOOR, LAMP, polygon("sheet", sheet)), [0]), GRAZE)
    assert unordered(found.ends) == unordered(np.array([[[0.1, -far, 0], [0.1, far, 0]]]))


# --- weights ---


@pytest.mark.parametrize(
    ("shape", "constant"),
    [(lambda x: np.maximum(0.0, x), KINK), (lambda x: 0.5 * np.maximum(0.0, x) ** 2, BEND)],
    ids=["kink", "bend"],
)
def test_constants_bound_quadratic_interpolation(
    shape: Callable[[FloatArray], FloatArray], constant: float
) -> None:
    x = np.linspace(0.0, 1.0, 1001)
    worst = 0.0
    for c in np.linspace(0.0, 1.0, 501):
        left, middle, right = shape(np.array([0.0, 0.5, 1.0]) - c)
        parabola = left * (1 - x) * (1 - 2 * x) + middle * 4 * x * (1 - x) + right * x * (2 * x - 1)
        worst = max(worst, float(np.abs(parabola - shape(x - c)).max()))
    assert 0.99 * constant < worst <= constant


def test_weights() -> None:
    """In proportion to the source, more for larger cells, never more than all that the source gives."""
    screen = solid("screen", box((-0.2, -0.1, 0.4), (0.3, 0.2, 0.5)))
    surfaces = surfaces_of(FLOOR, LAMP, screen, polygon("leaning", tilted(0.9), LIGHT))
    found = find(surfaces, [0])
    assert {VE, EV, HORIZON, GRAZE} <= set(found.kind.tolist())
    radiosity = np.linspace(1.0, 2.0, surfaces.patch_count)
    sizes = np.array([0.0, 1e-4, 1e-3, 1e-2, 0.1, 1.0, 100.0])
    weights = np.array([found.weights(radiosity, np.full(len(found), h)) for h in sizes])
    assert np.all(weights[0] == 0.0) and np.all(weights[1:] > 0.0)
    assert np.all(np.diff(weights, axis=0) >= 0.0)
    assert np.all(weights[-1] <= radiosity[found.source] * found.form_factor.max(axis=1) * (1.0 + 1e-12))
    np.testing.assert_allclose(
        found.weights(3.0 * radiosity, np.full(len(found), 0.1)), 3.0 * weights[4], rtol=1e-12
    )
    # Small cells: in proportion to h where the first derivative jumps, to h^2 where the second does.
    grows = np.log(weights[2] / weights[1]) / np.log(10.0)
    sharp = np.isinf(found.bend).any(axis=1)
    np.testing.assert_allclose(grows[sharp], 1.0, atol=1e-6)
    assert np.all(grows[~sharp] > 1.5)
    np.testing.assert_allclose(found.hardt_weights(radiosity), found.ratio * radiosity[found.source])


# --- bulk ---


def test_more_sources_add_to_what_is_known() -> None:
    """Finding for two sources at once is finding for each, contacts once."""
    surfaces = World.of(load_sample("cube_room")).surfaces
    tree, lamps = hierarchy_of(surfaces), emitters(surfaces)
    more = np.array([0, 3], dtype=np.int32)
    both = find_discontinuities(surfaces, tree, np.concatenate([lamps, more]))
    parts = Discontinuities.joined(
        [find_discontinuities(surfaces, tree, lamps), find_shadow_lines(surfaces, tree, more)]
    )
    assert len(both) == len(parts) > 300

    def rows(found: Discontinuities) -> FloatArray:
        key = np.column_stack([found.receiver, found.source, found.blocker, found.kind])
        table = np.column_stack([key, found.ends.reshape(-1, 6), found.form_factor])
        return table[np.lexsort(table.T[::-1])]

    np.testing.assert_array_equal(rows(both), rows(parts))


@pytest.mark.parametrize("name", ["cornell", "office"])
def test_all_lie_in_their_receiver_and_are_in_proper_numbers(name: str) -> None:
    surfaces = World.of(load_sample(name)).surfaces
    found = find(surfaces)
    assert all(count > 0 for count in found.counts().values())
    origin, normal = surfaces.corners[found.receiver, 0], surfaces.normal[found.receiver]
    height = np.einsum("dek,dk->de", found.ends - origin[:, None], normal)
    np.testing.assert_allclose(height, 0.0, atol=1e-9 * surfaces.size)
    for k in range(4):
        count = surfaces.corner_count[found.receiver]
        a = surfaces.corners[found.receiver, k % count]
        b = surfaces.corners[found.receiver, (k + 1) % count]
        inward = np.cross(normal, b - a)
        assert np.all(np.einsum("dek,dk->de", found.ends - a[:, None], inward) >= -1e-9 * surfaces.size)
    length = np.linalg.norm(found.ends[:, 1] - found.ends[:, 0], axis=1)
    apart = surfaces.corners[:, :, None] - surfaces.corners[:, None]
    size = np.linalg.norm(apart, axis=-1).max(axis=(1, 2))
    assert np.all(length > 0.999 * SHORTEST * size[found.receiver])
    lit = ~found.jump
    assert np.all(found.form_factor[lit] >= 0.0) and np.all(found.form_factor <= 1.0)
    assert np.all(found.width[lit] >= 0.0) and not np.isnan(found.bend).any()
    assert np.all(found.ratio > 0.0)


def test_nothing_to_find() -> None:
    surfaces = surfaces_of(FLOOR, LAMP)
    assert len(find(surfaces)) == 0
    none = np.empty(0, dtype=np.int32)
    assert len(find_discontinuities(surfaces, hierarchy_of(surfaces), none, none)) == 0
    empty = surfaces_of()
    assert len(find(empty)) == 0

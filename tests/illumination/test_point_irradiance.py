"""Point irradiance against tables, the path tracer, known solutions and itself."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings

from solver.document.samples import load_sample
from solver.engine.world import World
from solver.geometry.obstacles import ALONE, BOUNDS, Obstacles
from solver.geometry.scene import Mesh, Scene, SceneObject
from solver.illumination.points.gather_anywhere import MOST_AROUND
from solver.illumination.points.point_irradiance import PointIrradiance
from solver.pathtracing import PathTracer
from solver.transport.solve import RadiositySolver
from solver.types import FloatArray, IntArray, Points
from tests.accuracy.test_cube import points as tabled_points
from tests.illumination.field_rays import reflected_irradiance
from tests.pathtracing.worlds import CUBE, OUTWARD, material, polygon, square, world
from tests.transport.polygons import SEEDS, cases, rotation
from tests.transport.solving import furnace, lit_cube, shelf, solved

OVER_LINKS = 0
"""So few patches are asked all at once: none."""


def point_irradiance(
    solver: RadiositySolver, accuracy: float = 1e-3, few: int | None = None
) -> PointIrradiance:
    if few is None:
        return PointIrradiance.of(solver.state, solver.hierarchy, accuracy)
    return PointIrradiance.of(solver.state, solver.hierarchy, accuracy, few)


@cache
def sample(name: str, tolerance: float = 0.05) -> RadiositySolver:
    return solved(World.of(load_sample(name)), tolerance)


def spread(solver: RadiositySolver, count: int, seed: int = 1) -> tuple[Points, IntArray]:
    """Points on leaves, as many to each area, and their leaves."""
    random, tree = np.random.default_rng(seed), solver.state.tree
    leaves = tree.leaves
    chosen = random.choice(leaves, count, p=tree.area[leaves] / tree.area[leaves].sum()).astype(np.int32)
    share = random.dirichlet(np.ones(4), count)
    return np.einsum("nk,nka->na", share, tree.corners[chosen]), chosen


def luminance(point: PointIrradiance, positions: Points, leaves: IntArray) -> FloatArray:
    return np.asarray(point.at(positions, leaves) @ point.weights)


def rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))


# --- lamps alone: no error of a solution enters ---


def panels(kinks: list[float], width: float) -> tuple[FloatArray, FloatArray]:
    """Gauss points and weights over [0, 1/2], finer towards the border and where the integrand bends."""
    near = width * 6.0 ** np.arange(6)
    around = [np.stack([at - near, at + near]).ravel() for at in (0.0, *kinks)]
    marks = np.unique(np.clip(np.concatenate([[0.0, 0.5], kinks, *around]), 0.0, 0.5))
    nodes, weights = np.polynomial.legendre.leggauss(8)
    middle, half = 0.5 * (marks[1:] + marks[:-1]), 0.5 * np.diff(marks)
    at = (middle[:, None] + half[:, None] * nodes).ravel()
    return at, 2.0 * (half[:, None] * weights).ravel()


@pytest.mark.parametrize("case", cases("polygon-polygon-occluded"), ids=lambda case: str(case["id"]))
def test_tabled_form_factors_past_a_blocker(case: dict[str, Any]) -> None:
    """The mean over the receiver: a quarter of it will do, and shadows' edges are where they must be."""
    gap, height = float(case["emitter"]["z"]), float(case["blocker"]["z"])
    source, board = case["emitter"]["rect_xxyy"], case["blocker"]["rect_xxyy"]
    built = world(
        square("lamp", material(0.0, 1.0), gap, down=True, low=source[0], high=source[1]),
        square("board", material(0.0), height, low=board[0], high=board[1]),
        square("floor", material(0.0), 0.0),
    )
    edges = [(board[a] * gap - source[b] * height) / (gap - height) for a in (0, 1) for b in (0, 1)]
    at, weight = panels(sorted({edge for edge in (*edges, board[0]) if 0.0 < edge < 0.5}), min(gap, 0.1))
    x, y = (axis.ravel() for axis in np.meshgrid(at, at))
    positions = np.stack([x, y, 0.0 * x], axis=1)
    found = point_irradiance(solved(built)).anywhere(positions, np.tile([0.0, 0.0, 1.0], (len(x), 1)))
    mean = float(found[:, 0] @ np.outer(weight, weight).ravel())
    assert mean == pytest.approx(float(case["F_receiver_to_emitter"]), abs=1e-6)


def test_all_that_is_seen_in_a_closed_room_of_lamps_is_lamp() -> None:
    """Visible form factors of all sources sum up to 1, past a block in the middle as elsewhere."""
    solver = solved(furnace(0.0, 2.0))
    positions, leaves = spread(solver, 1000)
    for few in (None, OVER_LINKS):
        found = point_irradiance(solver, few=few).at(positions, leaves)
        np.testing.assert_allclose(found, 2.0, rtol=1e-9)
    random = np.random.default_rng(2)
    normals = random.normal(size=(500, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    loose = random.uniform(0.01, 0.99, (500, 3))
    inside = np.all((loose > [0.3, 0.25, 0.35]) & (loose < [0.6, 0.7, 0.65]), axis=1)
    found = point_irradiance(solver).anywhere(loose, normals)
    np.testing.assert_allclose(found[~inside], 2.0, rtol=1e-9)
    # The block's faces have their backs to what is within.
    np.testing.assert_array_equal(found[inside], 0.0)


def lamp_soup(random: np.random.Generator, count: int) -> World:
    """A room of lamps with boards in it, lamps on either side in colours of their own."""
    objects = [
        o
        for k, o in enumerate(lit_cube(0.0).scene)
        if not o.id.startswith("face5")  # open, so that there is darkness too
        for o in [replace(o, material=material(0.0, (0.1 * k, 0.5, 1.0 - 0.1 * k)))]
    ]
    for k in range(count):
        corners = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])[: random.integers(3, 5)]
        flat = corners * random.uniform(0.03, 0.3, 2)
        turned = flat @ rotation(int(random.integers(1 << 30)))[:2] + random.uniform(0.3, 0.7, 3)
        objects.append(
            polygon(f"board{k}", turned, material(0.0, random.uniform(0.0, 2.0, 3).tolist(), True))
        )
    return World.of(Scene(objects={o.id: o for o in objects}))


def deviations(seed: int, points: int, rays: int) -> FloatArray:
    """From the path tracer's means, in its standard errors."""
    random = np.random.default_rng(seed)
    built = lamp_soup(random, 8)
    solver = solved(built, 0.5)
    on, leaves = spread(solver, points - points // 2, seed)
    tree = solver.state.tree
    on_normals = built.surfaces.normal[tree.patch[leaves]]
    off = random.uniform(0.1, 0.9, (points // 2, 3))
    off_normals = random.normal(size=off.shape)
    off_normals /= np.linalg.norm(off_normals, axis=1, keepdims=True)
    positions, normals = np.concatenate([on, off]), np.concatenate([on_normals, off_normals])
    truth, error = PathTracer(built.surfaces, built.rays, seed).irradiance(positions, normals, rays)
    point = point_irradiance(solver)
    np.testing.assert_allclose(point.at(on, leaves), point.anywhere(on, on_normals), rtol=1e-9, atol=1e-9)
    over_links = point_irradiance(solver, 1e-9, OVER_LINKS).at(on, leaves)
    np.testing.assert_allclose(over_links, point.at(on, leaves), rtol=1e-6, atol=1e-9)
    return np.asarray((point.anywhere(positions, normals) - truth) / np.maximum(error, 1e-6))


def test_random_rooms_of_lamps_are_as_the_path_tracer_sees_them() -> None:
    """A million rays in all. Channels share their rays, so that three deviations go together."""
    found = np.stack([deviations(seed, 16, 1 << 14) for seed in range(4)])
    assert np.abs(found).max() < 4.0
    assert rms(found) < 1.25
    assert np.mean(np.abs(found) < 3.0) > 0.98


@pytest.mark.slow
def test_random_rooms_of_lamps_ray_by_ray() -> None:
    found = np.stack([deviations(seed, 16, 1 << 20) for seed in range(10, 14)])
    assert np.abs(found).max() < 4.5
    assert np.mean(np.abs(found) < 3.0) > 0.98


# --- solutions ---


def test_light_is_that_of_rays_into_the_field() -> None:
    """Gradients on leaves close by among it: one place that stands for a leaf is not enough there."""
    errors = field_errors("cornell", 1e-4, 30, 120)
    assert rms(errors) < 2e-3
    assert np.abs(errors).max() < 1e-2


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cornell", "office", "cube_room"])
def test_light_is_that_of_many_rays_into_the_field(name: str) -> None:
    """Rays err by 5e-4 here; the gather adds 1e-4 at this accuracy, where elements are few and large."""
    assert rms(field_errors(name, 1e-6, 40, 300)) < 6e-4


def field_errors(name: str, accuracy: float, points: int, per_side: int) -> FloatArray:
    """Errors of reflected light over its RMS, by both ways, against rays."""
    built, solver = World.of(load_sample(name)), sample(name)
    positions, leaves = spread(solver, points, 5)
    normals = built.surfaces.normal[solver.state.tree.patch[leaves]]
    truth = reflected_irradiance(solver, built.rays, positions, normals, per_side, 1)
    ways = [point_irradiance(solver, accuracy, few).of_reflected() for few in (None, OVER_LINKS)]
    return np.stack([way.at(positions, leaves) - truth for way in ways]) / rms(truth)


def cube_errors(tolerance: float) -> FloatArray:
    """Relative errors at the tabled points of the unit cube."""
    positions, normals, truth = tabled_points()
    point = point_irradiance(solved(lit_cube(), tolerance), 1e-4)
    return np.asarray(point.anywhere(positions, normals)[:, 0] / truth - 1.0)


def test_points_of_the_unit_cube() -> None:
    errors = [rms(cube_errors(tolerance)) for tolerance in (0.08, 0.02)]
    assert errors[1] < 3e-3
    assert errors[1] < 0.5 * errors[0]


@pytest.mark.slow
def test_points_of_the_unit_cube_solved_finely() -> None:
    errors = [rms(cube_errors(tolerance)) for tolerance in (0.02, 0.01, 0.005)]
    assert errors[2] < 3e-4
    assert errors[2] < errors[1] < errors[0]


@pytest.mark.parametrize("few", [None, OVER_LINKS])
def test_error_falls_with_accuracy(few: int | None) -> None:
    solver = sample("cornell")
    positions, leaves = spread(solver, 300)
    truth = luminance(point_irradiance(solver, 1e-6), positions, leaves)
    accuracies = np.array([1e-1, 1e-2, 1e-3, 1e-4])
    errors = [
        rms(luminance(point_irradiance(solver, float(a), few), positions, leaves) - truth) / rms(truth)
        for a in accuracies
    ]
    assert all(error < 4.0 * accuracy for error, accuracy in zip(errors, accuracies, strict=True))
    slope = np.polyfit(np.log(accuracies), np.log(errors), 1)[0]
    assert slope > 0.6


@pytest.mark.parametrize("name", ["cornell", "cube_room"])
def test_links_bring_the_light_of_all_patches(name: str) -> None:
    solver = sample(name)
    positions, leaves = spread(solver, 300)
    found = [luminance(point_irradiance(solver, 1e-4, few), positions, leaves) for few in (None, OVER_LINKS)]
    assert rms(found[0] - found[1]) < 3e-4 * rms(found[0])


def test_light_is_linear_in_its_sources() -> None:
    """Twice the functions are twice the light; emitted and reflected light add up."""
    solver = sample("cornell")
    positions, leaves = spread(solver, 200)
    for few in (None, OVER_LINKS):
        point = point_irradiance(solver, 1e-4, few)
        found = point.at(positions, leaves)
        reflected = point.of_reflected().at(positions, leaves)
        direct = found - reflected
        lamps = np.flatnonzero(point.surfaces.emission.any(axis=1))
        assert len(lamps) == 1
        assert np.all(direct > -2e-4 * found.max())
        # A lamp's light does not go back to its own plane.
        on_ceiling = positions[:, 1] > point.surfaces.corners[lamps[0], 0, 1] - 1e-9
        assert np.all(np.abs(direct[on_ceiling]) < 2e-4 * found.max())


def test_solved_is_the_field_of_the_solution() -> None:
    solver = sample("cornell")
    point = point_irradiance(solver)
    tree = solver.state.tree
    middle = np.ascontiguousarray(tree.centroid[tree.leaves])
    np.testing.assert_allclose(point.solved(middle, tree.leaves), solver.state.received[tree.leaves, 0])
    exact, told = (
        point.at(middle, tree.leaves) @ point.weights,
        point.solved(middle, tree.leaves) @ point.weights,
    )
    area = tree.area[tree.leaves]
    assert np.sqrt(area @ (exact - told) ** 2 / (area @ exact**2)) < 0.15


# --- wherever a point may be ---


def awkward(solver: RadiositySolver, count: int, seed: int) -> tuple[Points, IntArray]:
    """Points on leaves: a third within, the others at corners, on edges, and on lines through the corners of
    other patches, where things touch."""
    random, tree = np.random.default_rng(seed), solver.state.tree
    positions, leaves = spread(solver, count, seed)
    corner = random.integers(0, 4, count)
    ends = tree.corners[leaves, corner], tree.corners[leaves, (corner + 1) % 4]
    along = random.choice([0.0, 0.5, 1.0, 0.3], count)[:, None]
    kind = random.integers(0, 3, count)[:, None]
    on_edges = (1.0 - along) * ends[0] + along * ends[1]
    # On the planes of other patches, as far as they cross the leaf: contact lines among them.
    other = random.integers(0, tree.patch_count, count)
    normal, through = tree.patch_normal[other], tree.corners[other, 0]
    heights = [np.einsum("na,na->n", normal, end - through) for end in ends]
    fall = heights[0] - heights[1]
    share = np.clip(heights[0] / np.where(fall == 0.0, 1.0, fall), 0.0, 1.0)[:, None]
    on_planes = (1.0 - share) * ends[0] + share * ends[1]
    return np.ascontiguousarray(np.choose(kind, [positions, on_edges, on_planes])), leaves


@pytest.mark.parametrize("name", ["cornell", "office"])
@pytest.mark.parametrize("few", [None, OVER_LINKS])
def test_everywhere_is_light_or_darkness(name: str, few: int | None) -> None:
    assert_light_or_darkness(sample(name), few, 5000, 1)


@pytest.mark.slow
@pytest.mark.parametrize("few", [None, OVER_LINKS])
def test_at_a_million_points_is_light_or_darkness(few: int | None) -> None:
    for part, name in enumerate(("cornell", "office", "cube_room", "cornell", "office")):
        assert_light_or_darkness(sample(name), few, 100_000, part)


def assert_light_or_darkness(solver: RadiositySolver, few: int | None, count: int, seed: int) -> None:
    point = point_irradiance(solver, 1e-2, few)
    found = point.at(*awkward(solver, count, seed))
    brightest = point.light.functions[:, 0].max()
    assert np.isfinite(found).all()
    assert found.min() >= 0.0
    assert found.max() <= 1.5 * brightest


def test_points_off_surfaces_and_outside() -> None:
    solver = solved(shelf(), 0.05)
    random = np.random.default_rng(1)
    positions = random.uniform(-1.0, 2.0, (3000, 3))
    normals = random.normal(size=positions.shape)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    found = point_irradiance(solver).anywhere(positions, normals)
    assert np.isfinite(found).all()
    assert found.min() >= 0.0
    # The walls have their backs to what is outside.
    outside = np.any((positions < 0.0) | (positions > 1.0), axis=1)
    assert np.all(found[outside] == 0.0)
    assert np.all(found[~outside] > 0.0)


@settings(max_examples=20)
@given(seed=SEEDS)
def test_a_point_close_to_a_wall_is_as_one_on_it(seed: int) -> None:
    """What a client gives with seven digits is on the surface that it means."""
    solver = sample("cornell")
    random = np.random.default_rng(seed)
    positions, leaves = spread(solver, 10, seed)
    normals = solver.surfaces.normal[solver.state.tree.patch[leaves]]
    point = point_irradiance(solver, 1e-5)
    away = random.uniform(-3e-8, 3e-8, (10, 1)) * solver.surfaces.size * normals
    there = point.anywhere(positions + away, normals)
    np.testing.assert_allclose(there, point.at(positions, leaves), rtol=2e-3, atol=1e-4 * there.max())


def test_what_lies_on_something_sees_none_of_it() -> None:
    """A source on whose plane the point is, facing it, is seen edge-on however rounding has it."""
    built = world(
        square("floor", material(0.0, 1.0), 0.73),
        square("sheet", material(0.0), 0.73, down=True, low=0.2, high=0.8),
    )
    solver = solved(built, 0.5)
    positions = np.random.default_rng(1).uniform(0.25, 0.75, (1000, 3))
    positions[:, 2] = np.nextafter(0.73, np.random.default_rng(2).choice([0.0, 0.73, 1.0], 1000))
    found = point_irradiance(solver).anywhere(positions, np.tile([0.0, 0.0, -1.0], (1000, 1)))
    np.testing.assert_array_equal(found, 0.0)


def test_no_points_and_no_light() -> None:
    dark = solved(world(square("floor", material(0.5), 0.0), square("roof", material(0.5), 1.0, down=True)))
    for few in (None, OVER_LINKS):
        point = point_irradiance(dark, few=few)
        assert point.at(np.empty((0, 3)), np.empty(0, dtype=np.int32)).shape == (0, 1)
        np.testing.assert_array_equal(point.at(*spread(dark, 10)), 0.0)


# --- what need not be asked ---


def boxes(random: np.random.Generator, count: int) -> list[SceneObject]:
    """Boxes that may stand on the floor, overlap and stick out of the unit cube."""
    built = []
    for k in range(count):
        size = random.uniform(0.05, 0.5, 3)
        low = random.uniform(0.0, 0.8, 3) * [1, 1, random.integers(0, 2)]
        corners = low + CUBE * size
        if k % 2:
            corners = (corners - 0.5) @ rotation(int(random.integers(1 << 30))).T + 0.5
        of = material(0.5, random.choice([0.0, 0.3]))
        built.append(SceneObject(f"box{k}", Mesh(corners, OUTWARD), of))
    return built


@settings(max_examples=8)
@given(seed=SEEDS)
def test_faces_that_look_away_and_walls_hide_nothing_more(seed: int) -> None:
    random = np.random.default_rng(seed)
    built = World.of(Scene(objects={o.id: o for o in [*lit_cube(0.3).scene, *boxes(random, 4)]}))
    solver = solved(built, 0.3)
    point = point_irradiance(solver, 1e-9)
    asked = Obstacles(np.full(built.surfaces.patch_count, ALONE, dtype=np.int32), np.empty((0, BOUNDS)))
    assert (point.obstacles.solid != ALONE).any()
    of_all = replace(point, obstacles=asked)
    positions, leaves = spread(solver, 60, seed)
    np.testing.assert_allclose(
        point.at(positions, leaves), of_all.at(positions, leaves), rtol=1e-6, atol=1e-9
    )
    loose, normals = random.uniform(-0.2, 1.2, (60, 3)), random.normal(size=(60, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    np.testing.assert_allclose(
        point.anywhere(loose, normals), of_all.anywhere(loose, normals), rtol=1e-6, atol=1e-9
    )


def test_what_is_beyond_the_walls_changes_nothing() -> None:
    """With a heap of polygons there, blockers are found in the hierarchy, and a wall is none that has all of
    the scene before it."""
    lamps = [
        replace(o, material=material(0.0, 1.0))
        for o in [*lit_cube().scene, *boxes(np.random.default_rng(8), 3)]
    ]
    heap = [square(f"beyond{k}", material(0.5), 3.0 + 0.01 * k, down=bool(k % 2)) for k in range(MOST_AROUND)]
    few, many = (
        solved(World.of(Scene(objects={o.id: o for o in objects})), 0.9) for objects in (lamps, lamps + heap)
    )
    positions, leaves = spread(few, 100)
    normals = few.surfaces.normal[few.state.tree.patch[leaves]]
    alone, among = (point_irradiance(s).anywhere(positions, normals) for s in (few, many))
    np.testing.assert_allclose(among, alone, rtol=1e-9, atol=1e-12)

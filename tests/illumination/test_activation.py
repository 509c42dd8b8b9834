"""Activation: the strongest first, no leaf over its limit, active everywhere or nowhere."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from solver.document.samples import load_sample
from solver.engine.world import World
from solver.geometry.surfaces import Surfaces
from solver.illumination.discontinuity.activation import activate
from solver.illumination.discontinuity.leaf_crossings import LeafCrossings, find_crossings
from solver.illumination.discontinuity.sets import DiscontinuitySets, group_discontinuities
from solver.transport.elements import ElementTree
from solver.types import Corners, FloatArray, IntArray
from tests.illumination.shadow_scenes import FLOOR, find, polygon, square, surfaces_of
from tests.illumination.test_sets import segments


@dataclass(frozen=True, eq=False)
class Cells:
    """Leaves of an element tree."""

    corners: Corners
    corner_count: IntArray
    patch: IntArray


def leaves_of(surfaces: Surfaces, depth: int, random: np.random.Generator | None = None) -> Cells:
    """All leaves at `depth`, or at random depths up to it."""
    tree = ElementTree(surfaces)
    for _ in range(depth):
        leaves = tree.leaves
        tree.split(leaves if random is None else leaves[random.random(len(leaves)) < 0.6])
    leaves = tree.leaves
    return Cells(tree.corners[leaves], tree.corner_count[leaves], tree.patch[leaves])


def crossed(
    ends: FloatArray, depth: int, random: np.random.Generator | None = None
) -> tuple[DiscontinuitySets, Cells, LeafCrossings]:
    """Segments on the floor, its leaves, and which cross which."""
    surfaces = surfaces_of(FLOOR)
    found = segments(ends, np.zeros(len(ends)), np.zeros(len(ends), dtype=np.bool_))
    sets, cells = group_discontinuities(surfaces, found), leaves_of(surfaces, depth, random)
    return sets, cells, find_crossings(surfaces, sets, cells)


def listed(crossings: LeafCrossings, k: int | np.integer) -> IntArray:
    return np.sort(crossings.leaf[crossings.start[k] : crossings.start[k + 1]])


def test_a_line_crosses_the_leaves_it_runs_through() -> None:
    """A 4 x 4 grid of leaves of size 1; borders and corners that are only touched do not count."""
    line = np.array(
        [
            [[-1.9, 0.5, 0], [1.9, 0.5, 0]],
            [[-1.9, 0.0, 0], [1.9, 0.0, 0]],
            [[-1.0, -1.0, 0], [1.0, 1.0, 0]],
            [[0.2, 0.3, 0], [0.6, 0.4, 0]],
            [[0.2, 0.3, 0], [1.0, 0.3, 0]],
        ]
    )
    _, _, crossings = crossed(line, 2)
    np.testing.assert_array_equal(np.diff(crossings.start), [4, 0, 2, 1, 1])
    np.testing.assert_allclose(crossings.size[[0, 1, 2, 4]], [1.0, 0.0, np.sqrt(2.0), 1.0])


@settings(max_examples=40)
@given(st.integers(0, 2**32 - 1))
def test_crossings_are_those_of_brute_force(seed: int) -> None:
    random = np.random.default_rng(seed)
    flat = random.uniform(-2.0, 2.0, (12, 2, 2))
    flat[0] = np.round(flat[0])
    flat[1, :, 0] = 0.25
    flat = flat[np.linalg.norm(flat[:, 1] - flat[:, 0], axis=1) > 0.01]
    ends = np.concatenate([flat, np.zeros((len(flat), 2, 1))], axis=2)
    sets, cells, crossings = crossed(ends, 5, random)
    boxes = shapely.polygons(cells.corners[:, :, :2])
    for k, segment in enumerate(sets.ends):
        inside = shapely.length(
            shapely.intersection(shapely.buffer(boxes, -1e-5), shapely.LineString(segment))
        )
        outside = shapely.length(
            shapely.intersection(shapely.buffer(boxes, -1e-8), shapely.LineString(segment))
        )
        told = np.zeros(len(boxes), dtype=np.bool_)
        told[listed(crossings, k)] = True
        assert np.all(told[inside > 1e-4]), "what it runs through is listed"
        assert not np.any(told[outside <= 0.0]), "what it does not is not"
        normal = np.array([-1.0, 1.0]) * (segment[1, :2] - segment[0, :2])[::-1]
        across = cells.corners[told][:, :, :2] @ (normal / np.linalg.norm(normal))
        if told.any():
            np.testing.assert_allclose(crossings.size[k], np.ptp(across, axis=1).max())


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1), st.integers(0, 6), st.sampled_from([0.0, 0.4]))
def test_the_law_of_activation(seed: int, limit: int, minimum: float) -> None:
    random = np.random.default_rng(seed)
    # Many segments on few lines, and loose ones.
    lines = random.uniform(-1.9, 1.9, (8, 2, 2))
    owner, place = random.integers(0, 8, 40), np.sort(random.uniform(0.0, 1.0, (40, 2)), axis=1)
    place[:, 1] += 0.02
    flat = lines[owner, :1] + place[:, :, None] * (lines[owner, 1:] - lines[owner, :1])
    flat = np.concatenate([flat, random.uniform(-1.9, 1.9, (10, 2, 2))])
    ends = np.concatenate([flat, np.zeros((len(flat), 2, 1))], axis=2)
    sets, cells, crossings = crossed(ends, 3, random)
    weight = random.uniform(0.0, 1.0, len(ends))
    weight[random.random(len(ends)) < 0.1] = np.inf
    done = activate(sets, crossings, weight, minimum, limit)

    # No leaf holds more sets than it may.
    held: list[set[int]] = [set() for _ in cells.patch]
    for k in np.flatnonzero(done.active):
        for leaf in listed(crossings, k):
            held[leaf].add(int(sets.member[k]))
    assert max(len(lines_) for lines_ in held) <= limit
    # What is left out is too weak, or a leaf on its way is full of stronger ones.
    assert np.all(weight[done.active] >= minimum)
    for k in np.flatnonzero(~done.active & (weight >= minimum)):
        stronger = [j for j in np.flatnonzero(done.active) if weight[j] >= weight[k]]
        full = False
        for leaf in listed(crossings, k):
            there = {int(sets.member[j]) for j in stronger if leaf in listed(crossings, j)}
            full = full or (len(there) == limit and int(sets.member[k]) not in there)
        assert full
    # Everywhere or nowhere: the edges cover the active segments and nothing else.
    edges = shapely.union_all([shapely.LineString(e) for e in done.edges.ends[:, :, :2]])
    wanted = shapely.union_all([shapely.LineString(e) for e in sets.ends[done.active][:, :, :2]])
    assert shapely.hausdorff_distance(edges, wanted) < 1e-5 if done.active.any() else len(done.edges) == 0
    told = done.statistics
    assert told.found == len(ends) and told.active == done.active.sum()
    assert told.dropped_by_weight == np.count_nonzero(weight < minimum)
    assert told.active + told.dropped_by_weight + told.dropped_by_limit == told.found


def test_collinear_ones_count_once() -> None:
    """Three on a line take one place; a weaker one on another line finds the leaf full."""
    ends = np.array(
        [
            [[-1.0, 0.1, 0], [0, 0.1, 0]],
            [[0.0, 0.1, 0], [1, 0.1, 0]],
            [[-1, 0.1, 0], [1, 0.1, 0]],
            [[-1, 0.3, 0], [1, 0.4, 0]],
        ]
    )
    sets, _, crossings = crossed(ends, 0)
    done = activate(sets, crossings, np.array([4.0, 3.0, 1.0, 2.0]), 0.5, 1)
    np.testing.assert_array_equal(done.active, [True, True, True, False])
    assert len(done.edges) == 1
    assert (done.statistics.dropped_by_limit, done.statistics.dropped_by_weight) == (1, 0)


def test_what_is_full_in_one_leaf_is_left_out_of_all() -> None:
    """The weaker line shares one leaf of four with the stronger one: it goes, wherever it runs."""
    ends = np.array([[[0.5, 0.5, 0], [0.9, 0.6, 0]], [[-1.9, 0.7, 0], [1.9, 0.8, 0]]])
    sets, _, crossings = crossed(ends, 1)
    assert len(listed(crossings, 1)) == 2
    done = activate(sets, crossings, np.array([2.0, 1.0]), 0.0, 1)
    np.testing.assert_array_equal(done.active, [True, False])


@pytest.mark.parametrize("name", ["cornell", "office"])
def test_samples(name: str) -> None:
    """With real discontinuities, on leaves of all patches, some of which are triangles."""
    surfaces = World.of(load_sample(name)).surfaces
    found = find(surfaces)
    sets = group_discontinuities(surfaces, found)
    cells = leaves_of(surfaces, 4, np.random.default_rng(1))
    crossings = find_crossings(surfaces, sets, cells)
    np.testing.assert_array_equal(
        cells.patch[crossings.leaf], np.repeat(found.receiver, np.diff(crossings.start))
    )
    light = surfaces.emission.mean(axis=1)
    weight = found.weights(light, crossings.size)
    few, many = (activate(sets, crossings, weight, 1e-3 * light.max(), limit) for limit in (3, 30))
    assert np.all(many.active[found.jump])
    assert 0 < few.statistics.active < many.statistics.active
    assert few.statistics.dropped_by_limit > 0 and many.statistics.dropped_by_weight > 0
    held = np.unique(
        np.column_stack(
            [crossings.leaf, np.repeat(np.where(few.active, sets.member, -1), np.diff(crossings.start))]
        ),
        axis=0,
    )
    assert np.bincount(held[held[:, 1] >= 0, 0]).max() == 3
    assert np.all(np.isin(few.edges.patch, found.receiver)) and len(few.edges) <= few.statistics.active


def test_a_triangle_and_a_patch_without_leaves() -> None:
    surfaces = surfaces_of(polygon("floor", square(2.0, 0.0)[:3]), polygon("shelf", square(1.0, 1.0)))
    ends = np.array([[[-0.5, -1.0, 0], [1.5, 1.0, 0]], [[0.5, 0.5, 1], [0.9, 0.5, 1]]])
    found = segments(ends, np.array([0, 1]), np.zeros(2, dtype=np.bool_))
    sets, cells = group_discontinuities(surfaces, found), leaves_of(surfaces, 1)
    floor = cells.patch == 0
    kept = Cells(cells.corners[floor], cells.corner_count[floor], cells.patch[floor])
    crossings = find_crossings(surfaces, sets, kept)
    assert np.diff(crossings.start).tolist() == [3, 0]

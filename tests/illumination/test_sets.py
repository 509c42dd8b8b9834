"""Discontinuity sets: what is collinear is one, and its edges are where its active members are."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from solver.document.samples import load_sample
from solver.engine.world import World
from solver.geometry.surfaces import Surfaces
from solver.illumination.discontinuity.discontinuities import Discontinuities
from solver.illumination.discontinuity.segments import CONTACT, SAMPLES, VE
from solver.illumination.discontinuity.sets import ActiveEdges, DiscontinuitySets, group_discontinuities
from solver.types import BoolArray, FloatArray, IntArray
from tests.illumination.shadow_scenes import FLOOR, find, polygon, square, surfaces_of


def segments(ends: FloatArray, receiver: IntArray | FloatArray, jump: BoolArray) -> Discontinuities:
    """Discontinuities of which nothing matters but where they are."""
    d = len(ends)
    return Discontinuities(
        receiver=receiver.astype(np.int32),
        source=np.where(jump, -1, 0).astype(np.int32),
        blocker=np.zeros(d, dtype=np.int32),
        kind=np.where(jump, CONTACT, VE).astype(np.int32),
        ends=ends,
        ratio=np.ones(d),
        form_factor=np.ones((d, SAMPLES)),
        width=np.ones((d, SAMPLES)),
        bend=np.ones((d, SAMPLES)),
    )


def on_line(y: float, *spans: tuple[float, float], slope: float = 0.0) -> FloatArray:
    """Segments (d, 2, 3) on the floor's line y + slope x, from x to x."""
    return np.array([[[x, y + slope * x, 0.0] for x in span] for span in spans])


def grouped(ends: FloatArray, jump: tuple[int, ...] = ()) -> tuple[DiscontinuitySets, Surfaces]:
    surfaces = surfaces_of(FLOOR)
    jumps = np.isin(np.arange(len(ends)), jump)
    return group_discontinuities(surfaces, segments(ends, np.zeros(len(ends)), jumps)), surfaces


def spans(edges: ActiveEdges) -> list[tuple[float, float, bool]]:
    """From x to x, rounded, and whether it jumps."""
    return sorted(
        (round(float(x.min()), 9), round(float(x.max()), 9), bool(jump))
        for x, jump in zip(edges.ends[:, :, 0], edges.jump, strict=True)
    )


ALL = np.ones(20, dtype=np.bool_)


def test_segments_on_a_line_are_one_set_of_disjoint_edges() -> None:
    sets, _ = grouped(on_line(0.3, (-1, 0), (-0.5, 0.2), (1.5, 1), (0.2, 0.4)))
    assert len(sets) == 1
    edges = sets.edges(ALL[:4])
    assert spans(edges) == [(-1.0, 0.4, False), (1.0, 1.5, False)]
    np.testing.assert_allclose(edges.ends[:, :, 1:], np.broadcast_to([0.3, 0.0], (2, 2, 2)))
    assert spans(sets.edges(np.array([True, False, False, True]))) == [(-1.0, 0.0, False), (0.2, 0.4, False)]
    assert len(sets.edges(~ALL[:4])) == 0


def test_edges_are_cut_where_a_jump_begins_and_ends() -> None:
    sets, _ = grouped(on_line(0.0, (-1, 1), (-0.5, 0.5), (0.2, 1.5)), jump=(1,))
    expected = [(-1.0, -0.5, False), (-0.5, 0.5, True), (0.5, 1.5, False)]
    assert spans(sets.edges(ALL[:3])) == expected
    assert spans(sets.edges(np.array([False, True, False]))) == [(-0.5, 0.5, True)]


def test_lines_apart_are_sets_apart() -> None:
    ends = np.concatenate(
        [
            on_line(0.3, (-1, 0)),
            on_line(0.3001, (-1, 0)),
            on_line(0.3, (0, 1), slope=1e-4),
            on_line(-0.3, (0, 1)),
        ]
    )
    sets, _ = grouped(ends)
    assert len(sets) == 4 and len(np.unique(sets.member)) == 4


def test_short_segments_join_the_line_they_lie_on() -> None:
    """Although their own directions are known to few digits."""
    random = np.random.default_rng(3)
    starts = random.uniform(-1.4, 1.4, 200)
    ends = np.concatenate(
        [on_line(0.1, (-1.5, 1.5), slope=0.77), on_line(0.1, *((x, x + 6e-4) for x in starts), slope=0.77)]
    )
    sets, _ = grouped(ends + random.normal(scale=1e-13, size=ends.shape))
    assert len(sets) == 1


def test_a_chain_of_nearly_equal_lines_is_cut() -> None:
    """Each differs from the next by less than the tolerance: no set is wider than that."""
    ends = np.concatenate([on_line(0.1 + k * 2e-6, (-1, 1)) for k in range(40)])
    sets, surfaces = grouped(ends)
    assert 10 <= len(sets) <= 20
    moved = np.abs(sets.ends[:, :, 1] - ends[:, :, 1]).max()
    assert moved <= 1.01e-6 * np.linalg.norm(surfaces.corners[0, 2] - surfaces.corners[0, 0])


def test_patches_share_no_set() -> None:
    surfaces = surfaces_of(FLOOR, polygon("under", square(2.0, 0.0, down=True)))
    found = segments(on_line(0.3, (-1, 0), (-1, 0)), np.array([0, 1]), ALL[:2])
    sets = group_discontinuities(surfaces, found)
    np.testing.assert_array_equal(sets.patch, [0, 1])


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1))
def test_sets_do_not_depend_on_order_or_sense(seed: int) -> None:
    """Nor on rounding: few lines, many segments on each, shuffled, turned round, moved a little."""
    random = np.random.default_rng(seed)
    lines = random.uniform(-1.0, 1.0, (6, 2, 2))
    lines[0, :, 1] = lines[1, 0]
    owner = random.integers(0, len(lines), 40)
    place = random.uniform(0.0, 1.0, (40, 2))
    place[:, 1] = place[:, 0] + np.where(place[:, 0] > 0.5, -1.0, 1.0) * random.uniform(0.05, 0.4, 40)
    line = lines[owner]
    flat = line[:, :1] + place[:, :, None] * (line[:, 1:] - line[:, :1])
    ends = np.concatenate([flat, np.zeros((40, 2, 1))], axis=2)
    order = random.permutation(40)
    other = ends[order] + random.normal(scale=1e-14, size=ends.shape) * np.array([1.0, 1.0, 0.0])
    turned = random.integers(0, 2, 40).astype(np.bool_)
    other[turned] = other[turned, ::-1]
    jumps = random.integers(0, 2, 40).astype(np.bool_)
    active = random.integers(0, 3, 40) > 0
    surfaces = surfaces_of(FLOOR)
    first = group_discontinuities(surfaces, segments(ends, np.zeros(40), jumps))
    second = group_discontinuities(surfaces, segments(other, np.zeros(40), jumps[order]))
    assert len(first) == len(second) == len(np.unique(owner))
    np.testing.assert_array_equal(first.member[order], second.member)
    for k in range(len(first)):
        assert len(np.unique(owner[first.member == k])) == 1
    np.testing.assert_allclose(np.sort(first.ends, axis=1), np.sort(ends, axis=1), atol=1e-9 * surfaces.size)
    one, two = first.edges(active), second.edges(active[order])
    np.testing.assert_array_equal(one.set, two.set)
    np.testing.assert_array_equal(one.jump, two.jump)
    np.testing.assert_allclose(np.sort(one.ends, axis=1), np.sort(two.ends, axis=1), atol=1e-9)
    check_union(first, active, one)


def check_union(sets: DiscontinuitySets, active: BoolArray, edges: ActiveEdges) -> None:
    """A place on a line is on an edge just if it is on an active member, and jumps if on one that jumps."""
    for k in range(len(sets)):
        members = np.flatnonzero(active & (sets.member == k))
        own = np.einsum("esk,k->es", edges.ends[edges.set == k] - sets.origin[k], sets.direction[k])
        jump = edges.jump[edges.set == k]
        assert np.all(np.diff(own, axis=1) > 0.0) and np.all(np.diff(np.sort(own.ravel())) >= 0.0)
        for place in np.linspace(-1.5, 1.5, 301):
            span = sets.span[members]
            if np.abs(span - place).min(initial=1.0) < 1e-4:
                continue
            on_member = (span[:, 0] < place) & (place < span[:, 1])
            on_edge = (own[:, 0] < place) & (place < own[:, 1])
            assert on_edge.sum() == (1 if on_member.any() else 0)
            assert np.any(jump[on_edge]) == np.any(sets.jump[members[on_member]])


def test_sets_of_an_office() -> None:
    """Axis-parallel boxes in a room give many discontinuities on few lines."""
    surfaces = World.of(load_sample("office")).surfaces
    found = find(surfaces)
    sets = group_discontinuities(surfaces, found)
    assert len(sets) < 0.6 * len(found)
    np.testing.assert_array_equal(sets.patch[sets.member], found.receiver)
    moved = np.minimum(
        np.abs(sets.ends - found.ends).max(axis=(1, 2)),
        np.abs(sets.ends - found.ends[:, ::-1]).max(axis=(1, 2)),
    )
    assert moved.max() < 1e-9 * surfaces.size


def test_no_discontinuities_no_sets() -> None:
    sets, _ = grouped(np.empty((0, 2, 3)))
    assert len(sets) == 0 and len(sets.edges(ALL[:0])) == 0

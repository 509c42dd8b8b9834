"""Visible parts of sources against tables, a twin by projection, and the laws of hiding."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from solver.transport.lambert import points_to_polygon
from solver.types import Points, Vector
from tests.illumination.views import as_seen, random_view
from tests.illumination.visible_twin import View, normal_of, source_region, visible_region
from tests.transport.polygons import SEEDS, array, cases, cut, rotation

EXACT = 1e-9
"""What form factors may differ by: it is the views that are badly conditioned then, not the method."""

UP = np.array([0.0, 0.0, 1.0])
ORIGIN = np.zeros(3)
LAMP = np.array([[-1.0, -1.0, 1.0], [-1.0, 1.0, 1.0], [1.0, 1.0, 1.0], [1.0, -1.0, 1.0]])
"""Shows its front to the origin."""


def at(polygon: Points, height: float, low: float = -1.0, high: float = 1.0) -> Points:
    """LAMP's square at another height, and narrowed in x."""
    x = np.where(polygon[:, 0] < 0.0, low, high)
    return np.stack([x, polygon[:, 1], np.full(len(polygon), height)], axis=1)


def seen(source: Points, *blockers: Points, x: Vector = ORIGIN, normal: Vector = UP) -> float:
    return as_seen(View(np.asarray(x, dtype=float), normal, source, blockers))[0]


def whole(source: Points, x: Vector = ORIGIN, normal: Vector = UP) -> float:
    return float(points_to_polygon(np.array(x)[None], np.array(normal)[None], source)[0])


def view_of(seed: int, most: int = 6) -> View:
    return random_view(np.random.default_rng(seed), most)


def factor_of(view: View) -> float:
    return as_seen(view)[0]


# --- against tables and the twin ---


@pytest.mark.parametrize("case", cases("point-polygon"), ids=lambda case: str(case["id"]))
def test_tabled_form_factors(case: dict[str, Any]) -> None:
    x, normal, source = array(case["point"]), array(case["normal"]), array(case["P2"])
    beyond = source - 3.0 * np.ptp(source, axis=0).max() * normal_of(source)
    expected = float(case["F"])
    assert seen(source, x=x, normal=normal) == pytest.approx(expected, rel=1e-12)
    assert seen(source, beyond, x=x, normal=normal) == pytest.approx(expected, rel=1e-12)


def largest_difference(views: int, seed: int) -> tuple[float, int]:
    """From the twin, over random views; and how many of these see the source in part."""
    differences, partial = [], 0
    for k in range(views):
        view = view_of(1_000_003 * seed + k)
        found, expected = factor_of(view), visible_region(view).factor(view.x, view.normal)
        above = source_region(view).factor(view.x, view.normal)
        partial += EXACT < expected < above - EXACT
        differences.append(abs(found - expected))
    return max(differences), partial


def test_random_views_are_as_the_twin_has_them() -> None:
    difference, partial = largest_difference(1000, 1)
    assert partial > 200
    assert difference < EXACT


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2, 6))
def test_many_random_views_are_as_the_twin_has_them(seed: int) -> None:
    assert largest_difference(10_000, seed)[0] < EXACT


def test_pieces_tile_what_is_visible() -> None:
    cut_up = 0
    for k in range(200):
        view = view_of(k)
        factor, pieces = as_seen(view)
        region = visible_region(view)
        flat = [shapely.MultiPoint(region.flat(piece)).convex_hull for piece in pieces]
        scale = 1e-12 * view.size**2
        assert shapely.union_all(flat).symmetric_difference(region.shape).area < scale
        assert sum(piece.area for piece in flat) == pytest.approx(region.shape.area, abs=scale)
        factors = [whole(piece, view.x, view.normal) for piece in pieces]
        assert sum(factors) == pytest.approx(factor, abs=EXACT)
        heights = [(piece - view.source[0]) @ normal_of(view.source) for piece in pieces]
        assert all(np.abs(height).max() < 1e-12 * view.size for height in heights)
        cut_up += len(pieces) > 1
    assert cut_up > 30


# --- laws ---


@given(seed=SEEDS)
def test_another_blocker_never_shows_more(seed: int) -> None:
    view = view_of(seed)
    before = view.blockers[:-1]
    assert factor_of(view) <= factor_of(replace(view, blockers=before)) + EXACT


@given(seed=SEEDS, share=st.floats(0.05, 0.95), which=st.integers(0, 5))
def test_a_blocker_cut_in_two_hides_the_same(seed: int, share: float, which: int) -> None:
    view = view_of(seed)
    which %= len(view.blockers)
    halves = cut(view.blockers[which], share)
    others = (*view.blockers[:which], *halves, *view.blockers[which + 1 :])
    assert factor_of(replace(view, blockers=others)) == pytest.approx(factor_of(view), abs=EXACT)


@given(seed=SEEDS, share=st.floats(0.05, 0.95))
def test_a_source_cut_in_two_shows_the_same(seed: int, share: float) -> None:
    view = view_of(seed)
    parts = [factor_of(replace(view, source=part)) for part in cut(view.source, share)]
    assert sum(parts) == pytest.approx(factor_of(view), abs=EXACT)


@given(seed=SEEDS, data=st.data())
def test_order_and_sides_of_blockers_do_not_matter(seed: int, data: st.DataObject) -> None:
    view = view_of(seed)
    order = data.draw(st.permutations(range(len(view.blockers))))
    turned = tuple(
        np.roll(view.blockers[k], k, axis=0)[:: data.draw(st.sampled_from([-1, 1]))] for k in order
    )
    assert factor_of(replace(view, blockers=turned)) == pytest.approx(factor_of(view), abs=EXACT)


@given(seed=SEEDS, turn=SEEDS, scale=st.sampled_from([1e-3, 1.0, 1e4]), shift=st.sampled_from([0.0, 10.0]))
def test_rigid_motion_and_scale_change_nothing(seed: int, turn: int, scale: float, shift: float) -> None:
    view, frame = view_of(seed), rotation(turn)

    def moved(points: Points) -> Points:
        return np.asarray(scale * (points @ frame.T + shift * frame[1]))

    blockers = tuple(moved(blocker) for blocker in view.blockers)
    other = View(moved(view.x), frame @ view.normal, moved(view.source), blockers)
    assert factor_of(other) == pytest.approx(factor_of(view), abs=EXACT)


@given(seed=SEEDS, scale=st.floats(0.05, 0.9), near=st.floats(1e-6, 0.9))
def test_visible_and_hidden_make_the_whole(seed: int, scale: float, near: float) -> None:
    """A blocker within the pyramid over the source hides what would be its own form factor."""
    view = view_of(seed)
    random = np.random.default_rng(seed)
    middle = random.dirichlet(np.full(len(view.source), 4.0)) @ view.source
    ways = middle + scale * (view.source - middle) - view.x
    # Cut by a plane that need not be the source's.
    tilted = normal_of(view.source) + random.uniform(-0.3, 0.3, 3)
    falls = ways @ tilted
    if np.abs(falls).min() < 0.1 * np.abs(falls).max() or np.ptp(np.sign(falls)) > 0.0:
        tilted = normal_of(view.source)
        falls = ways @ tilted
    blocker = view.x + near * np.abs(falls).min() / np.abs(falls)[:, None] * ways
    visible = seen(view.source, blocker, x=view.x, normal=view.normal)
    hidden = whole(blocker, view.x, view.normal)
    assert visible + hidden == pytest.approx(whole(view.source, view.x, view.normal), abs=EXACT)


# --- close to the limits ---


@pytest.mark.parametrize("apart", [1e-2, 1e-5, 1e-8])
def test_a_point_at_the_foot_of_a_wall_sees_its_own_side(apart: float) -> None:
    """[H 6.3]: on the foot itself the wall is seen edge-on; a point moved a little to one side is there."""
    wall = np.array([[0.0, -5.0, 0.0], [0.0, 5.0, 0.0], [0.0, 5.0, 5.0], [0.0, -5.0, 5.0]])
    left, right = at(LAMP, 1.0, high=0.0), at(LAMP, 1.0, low=0.0)
    for x, sees, misses in ((-apart, left, right), (apart, right, left)):
        foot = np.array([x, 0.0, 0.0])
        assert seen(sees, wall, x=foot) == pytest.approx(whole(sees, foot), rel=1e-12)
        assert seen(misses, wall, x=foot) == 0.0
        # The wall hides the half beyond it.
        assert seen(LAMP, wall, x=foot) == pytest.approx(whole(sees, foot), rel=1e-12)
    assert seen(LAMP, wall) == pytest.approx(whole(LAMP), rel=1e-12)


@pytest.mark.parametrize(
    "x", [(0.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.5, 0.0), (0.0, 0.2, 0.3), (0.0, 7.0, -3.0)]
)
def test_a_point_on_a_blockers_plane_sees_past_it(x: Vector) -> None:
    """At its corners, on its edges, within, and beside it."""
    board = np.array([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1.0, 0.8], [0.0, 0.0, 0.8]])
    assert seen(LAMP, board, x=x) == pytest.approx(whole(LAMP, x), rel=1e-12)


@pytest.mark.parametrize("height", [1e-6, 1e-3, 0.5, 1.0 - 1e-6])
def test_blockers_close_to_the_point_and_to_the_source(height: float) -> None:
    across = 2.0 if height < 0.5 else 1.0
    cover = np.array([across, across, 1.0]) * at(LAMP, height)
    assert seen(LAMP, cover) == pytest.approx(0.0, abs=1e-12)
    half = np.array([across, across, 1.0]) * at(LAMP, height, low=0.0)
    assert seen(LAMP, half) == pytest.approx(0.5 * whole(LAMP), rel=1e-9)


def test_edges_through_corners_of_the_source() -> None:
    triangle = 0.5 * LAMP[:3]
    assert seen(LAMP, triangle) == pytest.approx(whole(LAMP[[0, 2, 3]]), rel=1e-12)
    assert seen(LAMP, triangle, 0.3 * LAMP[[0, 2, 3]]) == pytest.approx(0.0, abs=1e-12)
    # A fan of triangles that meet in a corner of the source and in one another's edges.
    fan = [0.5 * LAMP[0] + 0.5 * np.array([[0, 0, 0], [2, k + 1, 0], [2, k, 0]]) for k in range(2)]
    assert seen(LAMP, *fan) == pytest.approx(whole(LAMP) - sum(map(whole, fan)), rel=1e-12)


@pytest.mark.parametrize("width", [1e-4, 1e-8])
def test_slits_and_needles(width: float) -> None:
    left, right = at(LAMP, 0.5, high=0.1), at(LAMP, 0.5, low=0.1 + width)
    strip = at(LAMP, 1.0, low=0.2, high=0.2 + 2.0 * width)
    assert seen(LAMP, left, right) == pytest.approx(whole(strip), rel=1e-15 / width, abs=1e-15)
    needle = at(LAMP, 0.5, low=0.1, high=0.1 + width)
    assert seen(LAMP, needle) == pytest.approx(whole(LAMP) - whole(strip), rel=1e-12)
    assert seen(strip, 0.7 * strip) == pytest.approx(0.0, abs=1e-15)


def test_blockers_that_are_not_between() -> None:
    behind_source, behind_point = at(LAMP, 1.5), at(LAMP, -0.5)
    in_its_plane = LAMP + 0.5 * (LAMP[1] - LAMP[0])
    seen_past = seen(LAMP, behind_source, behind_point, in_its_plane, LAMP, LAMP[::-1])
    assert seen_past == pytest.approx(whole(LAMP), rel=1e-12)
    # One through the source's plane hides with what is before it.
    through = np.array([[0.5, -5.0, 0.5], [0.5, 5.0, 0.5], [0.5, 5.0, 1.5], [0.5, -5.0, 1.5]])
    assert seen(LAMP, through) == pytest.approx(whole(at(LAMP, 1.0, high=0.5)), rel=1e-12)


def test_a_point_behind_the_source_sees_none_of_it() -> None:
    assert as_seen(View(ORIGIN, UP, LAMP[::-1], (0.5 * LAMP,))) == (0.0, [])
    assert as_seen(View(np.array([0.3, 0.2, 1.0]), UP, LAMP, (0.5 * LAMP,))) == (0.0, [])


# --- room ---


def test_many_corners() -> None:
    """Blockers that leave a disc leave a piece of ever more corners: it is cut, and nothing is lost."""
    angle = 2.0 * np.pi * np.arange(40) / 40
    tangent = np.stack([-np.sin(angle), np.cos(angle), 0.0 * angle], axis=1)
    middle = 0.3 * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1) + 0.5 * UP
    away = middle - 0.5 * UP
    blockers = np.stack([middle + 2 * tangent, middle - 2 * tangent, middle - 2 * tangent + 5 * away], axis=1)
    wide = np.stack([*blockers.swapaxes(0, 1), middle + 2 * tangent + 5 * away], axis=1)
    factor, pieces = as_seen(View(ORIGIN, UP, LAMP, tuple(wide)))
    corner = 0.6 / np.cos(np.pi / 40) * np.stack([np.cos(angle - np.pi / 40), np.sin(angle - np.pi / 40)])
    disc = np.stack([*corner, 0.0 * angle + 1.0], axis=1)
    assert factor == pytest.approx(whole(disc[::-1]), rel=1e-12)
    assert len(pieces) > 1


@settings(max_examples=30)
@given(seed=SEEDS, noise=st.sampled_from([0.0, 1e-16, 1e-14, 1e-12, 1e-9]), alike=st.integers(5, 40))
def test_blockers_that_nearly_coincide_need_no_more_room(seed: int, noise: float, alike: int) -> None:
    """`as_seen` holds the kernel to the room that it asks for."""
    view, random = view_of(seed, 2), np.random.default_rng(seed)
    copies = tuple(
        blocker + noise * random.normal(size=blocker.shape) for blocker in view.blockers for _ in range(alike)
    )
    found, _ = as_seen(replace(view, blockers=copies), parts=10_000)
    once = factor_of(view)
    assert found <= once + 1e-6
    if noise == 0.0:
        assert found == pytest.approx(once, abs=EXACT)


def test_a_thicket_needs_no_more_room() -> None:
    """Crossing needles, all of which cut all: thousands of pieces."""
    random = np.random.default_rng(3)
    needles = []
    for angle in random.uniform(0.0, np.pi, 24):
        along, across = (
            np.array([np.cos(angle), np.sin(angle), 0.0]),
            np.array([-np.sin(angle), np.cos(angle), 0.0]),
        )
        middle = random.uniform(-0.2, 0.2) * across + random.uniform(0.3, 0.9) * UP
        needles.append(
            np.array(
                [middle + s * 5 * along + w * 0.005 * across for s, w in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
            )
        )
    view = View(ORIGIN, UP, LAMP, tuple(needles))
    factor, pieces = as_seen(view, parts=20_000)
    assert factor == pytest.approx(visible_region(view).factor(view.x, view.normal), abs=EXACT)
    assert len(pieces) > 100

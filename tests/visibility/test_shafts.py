"""Shafts against brute force: classes that claim to be exact are, and no blocker is missed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from solver import tolerances
from solver.types import FloatArray, IntArray, Points
from solver.visibility.blockers import first_blockers, inherited_blockers
from solver.visibility.brute_force import blocks, visible_fraction
from solver.visibility.bvh import build_hierarchy
from solver.visibility.culling import BLOCK, LANES, gather_blocks
from solver.visibility.shafts import (
    FULL,
    MAX_PLANES,
    NONE,
    PARTIAL,
    shaft_planes,
)
from tests.visibility.soups import Soup, polygons, soup_of, soups

SQUARE = np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
DOWN = SQUARE[::-1]


@dataclass(frozen=True, eq=False)
class Classified:
    """What shafts say of all pairs of patches that face each other."""

    pairs: list[tuple[int, int]]
    kind: IntArray
    blockers: list[set[int]]


def side_tolerance(soup: Soup) -> float:
    return tolerances.SIDE * soup.surfaces.size


def margin(soup: Soup) -> float:
    """By how much a witness must block: both sides compute in float64."""
    return 10.0 * side_tolerance(soup)


def is_facing(soup: Soup, p: int, q: int) -> bool:
    """Whether a part of each is in front of the other."""
    normal, corners = soup.surfaces.normal, soup.surfaces.corners
    tolerance = side_tolerance(soup)
    in_front = ((corners[b] - corners[a][0]) @ normal[a] for a, b in ((p, q), (q, p)))
    return all(heights.max() > tolerance for heights in in_front)


def classify(soup: Soup, pool_size: int | None = None) -> Classified:
    s = soup.surfaces
    tree = build_hierarchy(s.corners, np.arange(s.patch_count, dtype=np.int32))
    pairs = [(p, q) for p in range(s.patch_count) for q in range(p) if is_facing(soup, p, q)]
    p, q = np.array(pairs, dtype=np.int32).reshape(-1, 2).T.copy()
    kind, count = np.full(len(p), -1, dtype=np.int32), np.zeros(len(p), dtype=np.int32)
    lists: list[set[int]] = []
    patch = np.arange(s.patch_count, dtype=np.int32)
    at = 0
    while at < len(p):
        pool = np.empty(pool_size or len(p) * s.patch_count, dtype=np.int32)
        used = first_blockers(
            p, q, s.corners, s.corner_count, patch, s.corners, s.corner_count, s.normal, tree.low, tree.high,
            tree.skip, tree.first, tree.count, tree.order, side_tolerance(soup), at, len(p), kind, count,
            pool,
        )  # fmt: skip
        done = len(p) - at if used >= 0 else -1 - used
        assert done > 0
        ends = np.cumsum(count[at : at + done])
        lists += [
            set(pool[end - n : end].tolist()) for end, n in zip(ends, count[at : at + done], strict=True)
        ]
        at += done
    return Classified(pairs, kind, lists)


def fraction(soup: Soup, first: Points, second: Points, blockers: set[int], per_side: int = 6) -> float:
    triangles = soup.surfaces.triangles[np.isin(soup.surfaces.triangle_patch[:, 0], sorted(blockers))]
    return visible_fraction(first, second, triangles, per_side, margin(soup))


def others(soup: Soup, p: int, q: int) -> set[int]:
    return set(range(soup.surfaces.patch_count)) - {p, q}


def reaches_into_hull(first: Points, second: Points, polygon: Points) -> bool:
    """Whether a polygon meets the convex hull of two others: a linear program of the corners' weights."""
    hull = np.concatenate([first, second])
    equal = np.zeros((5, len(hull) + len(polygon)))
    equal[:3] = np.concatenate([hull, -polygon]).T
    equal[3, : len(hull)] = 1.0
    equal[4, len(hull) :] = 1.0
    found = linprog(np.zeros(equal.shape[1]), A_eq=equal, b_eq=[0, 0, 0, 1, 1])
    return bool(found.status == 0)


@settings(max_examples=100)
@given(soups(anywhere=True))
def test_classes_and_blockers_of_patches(soup: Soup) -> None:
    found = classify(soup)
    for (p, q), kind, blockers in zip(found.pairs, found.kind, found.blockers, strict=True):
        first, second = soup.polygon(p), soup.polygon(q)
        rest = others(soup, p, q)
        seen = fraction(soup, first, second, rest, 4)
        assert blockers <= rest
        if kind == FULL:
            assert not blockers
            assert np.isnan(seen) or seen == 1.0
        elif kind == NONE:
            assert len(blockers) == 1
            assert np.isnan(seen) or seen == 0.0
            assert np.isnan(seen) or fraction(soup, first, second, blockers) == 0.0, "that one hides all"
        else:
            assert kind == PARTIAL
            assert blockers
            for other in rest - blockers:
                assert not blocks(first, second, soup.polygon(other), 6, margin(soup))


@settings(max_examples=60)
@given(soups(most=8, anywhere=True), st.integers(0, 2**32 - 1))
def test_inherited_classes_and_blockers(soup: Soup, seed: int) -> None:
    """Of parts of elements, by the blockers of the whole: nothing is lost, and classes are exact too."""
    s = soup.surfaces
    random = np.random.default_rng(seed)
    found = classify(soup)
    for (p, q), kind, blockers in zip(found.pairs, found.kind, found.blockers, strict=True):
        if kind != PARTIAL:
            continue
        first, second = (_part(soup.polygon(k), random) for k in (p, q))
        parents = np.array(sorted(blockers), dtype=np.int32)
        out, planes = np.empty(len(parents), dtype=np.int32), np.empty((MAX_PLANES, 4))
        lanes = np.empty(-(-len(parents) // LANES) * BLOCK)
        gather_blocks(s.corners, s.normal, parents, 0, len(parents), lanes)
        part_kind, kept = inherited_blockers(
            _padded(first), len(first), s.normal[p], _padded(second), len(second), s.normal[q],
            s.corners, s.corner_count, s.normal, parents, 0, len(parents), lanes, side_tolerance(soup),
            planes, np.empty(5 * LANES), np.empty(LANES, dtype=np.uint8), out, 0,
        )  # fmt: skip
        remaining = set(out[:kept].tolist())
        assert remaining <= blockers
        seen = fraction(soup, first, second, others(soup, p, q), 4)
        if part_kind == FULL:
            assert kept == 0 and (np.isnan(seen) or seen == 1.0)
        elif part_kind == NONE:
            assert kept == 1 and (np.isnan(seen) or seen == 0.0)
        else:
            for other in others(soup, p, q) - remaining:
                assert not blocks(first, second, soup.polygon(other), 6, margin(soup))


@settings(max_examples=100)
@given(polygons(), polygons(), st.integers(0, 2**32 - 1))
def test_planes_bound_the_hull(first: Points, second: Points, seed: int) -> None:
    """Both polygons, and so their hull, lie inside of the planes that are not the polygons' own; and where
    the two lie in front of each other, inside of those too."""
    soup = soup_of([first, second])
    if soup.surfaces.patch_count != 2 or not is_facing(soup, 0, 1):
        return
    planes = np.empty((MAX_PLANES, 4))
    s = soup.surfaces
    count = shaft_planes(
        s.corners[0], s.corner_count[0], s.normal[0], s.corners[1], s.corner_count[1], s.normal[1], planes
    )
    assert 2 <= count <= MAX_PLANES
    used = planes[:count]
    np.testing.assert_allclose(np.linalg.norm(used[:, :3], axis=1), 1.0)
    hull = np.random.default_rng(seed).dirichlet(np.ones(8), 50) @ s.corners.reshape(8, 3)
    assert np.all(hull @ used[2:, :3].T >= used[2:, 3] - 1e-8 * s.size)


def test_planes_leave_little_around_the_hull() -> None:
    """Of polygons that miss the hull of a pair, few are taken for blockers."""
    random = np.random.default_rng(4)
    tried = wrong = right = 0
    for _ in range(40):
        loose = [
            random.uniform(-1, 1, 3) + 0.2 * SQUARE @ np.linalg.qr(random.normal(size=(3, 3)))[0]
            for _ in range(20)
        ]
        soup = soup_of([SQUARE * 0.7 - np.array([0, 0, 1.5]), DOWN * 0.4 + np.array([0, 0, 1.5]), *loose])
        found = classify(soup)
        at = found.pairs.index((1, 0))
        for other in others(soup, 0, 1):
            meets = reaches_into_hull(soup.polygon(0), soup.polygon(1), soup.polygon(other))
            listed = other in found.blockers[at]
            tried += not meets
            wrong += listed and not meets
            right += listed and meets
            assert listed or not meets
    assert right > 100 and tried > 200
    assert wrong < 0.06 * tried


# --- cases by hand ---


def single(soup: Soup) -> tuple[int, set[int]]:
    """Class and blockers of patches 1 and 0."""
    found = classify(soup)
    at = found.pairs.index((1, 0))
    return int(found.kind[at]), found.blockers[at]


@pytest.mark.parametrize(
    ("screen", "expected"),
    [
        (SQUARE * 3.0 + np.array([0, 0, 1]), (NONE, {2})),
        (SQUARE * 1.001 + np.array([0, 0, 1]), (NONE, {2})),
        (SQUARE * 0.9 + np.array([0, 0, 1]), (PARTIAL, {2})),
        (SQUARE + np.array([2.1, 0, 1]), (FULL, set())),
        (SQUARE + np.array([1.9, 0, 1]), (PARTIAL, {2})),
        (SQUARE * 3.0 + np.array([0, 0, -0.5]), (FULL, set())),
        (SQUARE * 3.0 + np.array([0, 0, 2.5]), (FULL, set())),
        (SQUARE * 3.0, (FULL, set())),
        (SQUARE * 3.0 + np.array([0, 0, 2]), (FULL, set())),
    ],
    ids=[
        "large",
        "just-large",
        "small",
        "beside",
        "reaching-in",
        "behind",
        "beyond",
        "coplanar",
        "coplanar-2",
    ],
)
def test_a_screen_between_two_squares(screen: FloatArray, expected: tuple[int, set[int]]) -> None:
    for turned in (screen, screen[::-1]):
        assert single(soup_of([SQUARE, DOWN + np.array([0, 0, 2]), turned])) == expected


def test_two_halves_of_a_screen_hide_all_and_are_both_listed() -> None:
    """NONE is claimed for one polygon that hides all; two together are PARTIAL, and rays tell."""
    left = np.array([[-3.0, -3, 1], [0.01, -3, 1], [0.01, 3, 1], [-3, 3, 1]])
    soup = soup_of([SQUARE, DOWN + np.array([0, 0, 2]), left, left + np.array([3.0, 0, 0.01])])
    assert single(soup) == (PARTIAL, {2, 3})
    assert fraction(soup, soup.polygon(0), soup.polygon(1), {2, 3}) == 0.0


def test_a_small_pool_is_told_and_gone_on_from() -> None:
    random = np.random.default_rng(0)
    loose = [
        random.uniform(-1, 1, 3) + 0.5 * SQUARE @ np.linalg.qr(random.normal(size=(3, 3)))[0]
        for _ in range(12)
    ]
    soup = soup_of(loose)
    whole, pieces = classify(soup), classify(soup, pool_size=14)
    np.testing.assert_array_equal(whole.kind, pieces.kind)
    assert whole.blockers == pieces.blockers


def _part(polygon: Points, random: np.random.Generator) -> Points:
    """A smaller copy of a polygon inside of it."""
    inner = random.dirichlet(np.ones(len(polygon))) @ polygon
    return np.asarray(inner + random.choice([0.5, 0.25]) * (polygon - inner))


def _padded(polygon: Points) -> FloatArray:
    return polygon[[0, 1, 2, 2]] if len(polygon) == 3 else polygon

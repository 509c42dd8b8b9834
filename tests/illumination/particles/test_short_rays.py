"""Short rays: how they are spread, what they come upon, and that it is the same by mirrors' way."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from solver.illumination.particles.hemisphere import tangent_frames
from solver.illumination.particles.short_rays import Met, ShortRays
from solver.types import FloatArray, Int64Array, IntArray
from tests.illumination.particles.rooms import Room, cube, material, polygon, room, square
from tests.illumination.particles.shining import spread


def crowded() -> Room:
    """A room with a lamp, a black wall, a two-sided screen and a panel that is black behind."""
    grey, lamp, black = material(0.5), material(0.0, 2.0, emission_exponent=1.0), material()
    walls = cube(grey, lamp, grey, black, grey, grey).surfaces
    objects = [polygon(f"wall{k}", walls.corners[k], m) for k, m in enumerate((grey, lamp, grey, black))]
    screen = material(0.4, two_sided=True)
    return room(
        *objects,
        polygon("screen", [[0.3, 0.2, 0], [0.5, 0.8, 0], [0.5, 0.8, 0.6], [0.3, 0.2, 0.6]], screen),
        square("panel", grey, z=0.7, low=0.2, high=0.7),
    )


def sent(of: Room, bound: float, has_mirrors: bool, least: float, count: int = 5000) -> Met:
    positions, patch = spread(of, count)
    stream: Int64Array = np.arange(count, dtype=np.int64)
    short = ShortRays(of.surfaces, of.rays, bound, has_mirrors)
    met = short.send(positions, patch, stream, 3, 0, np.full(of.surfaces.patch_count, least))
    order = np.argsort(met.ends.row)
    return Met(met.directions, met.ends.take(order), met.share[order], met.emitted[order])


@pytest.mark.parametrize(("bound", "least"), [(1.0, 0.0), (25.0, 0.0), (25.0, 60.0), (400.0, 500.0)])
def test_rays_find_the_same_by_the_way_of_mirrors(bound: float, least: float) -> None:
    """That traces rays of one length, and weighs them by the distances that Embree tells."""
    of = crowded()
    fast, slow = sent(of, bound, False, least), sent(of, bound, True, least)
    np.testing.assert_array_equal(fast.directions, slow.directions)
    # What gives nothing is left out, and at the bound itself nothing is sure.
    s = of.surfaces
    gives = s.reflectance[slow.ends.patch].any(axis=1)
    gives |= s.emission[slow.ends.patch].any(axis=1) & (slow.emitted > 0.0)
    expected = np.flatnonzero(gives & (slow.share > 1e-4))
    found = np.flatnonzero(np.isin(fast.ends.row, slow.ends.row[expected]))
    assert len(expected) > 20
    assert len(fast.ends.row) - len(found) <= 0.01 * len(found) + 2
    for name in ("row", "patch", "along"):
        np.testing.assert_array_equal(
            getattr(fast.ends, name)[found], getattr(slow.ends, name)[expected], name
        )
    for name in ("position", "distance"):
        a, b = getattr(fast.ends, name)[found], getattr(slow.ends, name)[expected]
        np.testing.assert_allclose(a, b, atol=2e-6)
    for name in ("share", "emitted"):
        np.testing.assert_allclose(
            getattr(fast, name)[found], getattr(slow, name)[expected], atol=1e-3, err_msg=name
        )


def test_nothing_is_asked_of_no_points() -> None:
    met = sent(crowded(), 10.0, False, 0.0, count=0)
    assert met.directions.shape == (0, 3)
    assert len(met.ends.row) == len(met.share) == len(met.emitted) == 0


def test_ends_come_patch_by_patch() -> None:
    of = crowded()
    positions, patch = spread(of, 30000)
    stream: Int64Array = np.arange(len(patch), dtype=np.int64)
    short = ShortRays(of.surfaces, of.rays, 5.0, has_mirrors=False)
    ends = short.send(positions, patch, stream, 0, 0, np.zeros(of.surfaces.patch_count)).ends
    assert len(ends.row) > 1000
    assert np.all(np.diff(ends.patch) >= 0)
    assert np.all(np.diff(ends.row)[np.diff(ends.patch) == 0] > 0), "those of one in the order of their rays"


def directions(patch: IntArray, turns: int, bounce: int, stream: int) -> FloatArray:
    """Those of one stream (turns, 3) about the axis z."""
    of = room(square("floor", material(0.5), z=0.0))
    short = ShortRays(of.surfaces, of.rays, 1.0, has_mirrors=False)
    at, streams = np.full((1, 3), 0.5), np.array([stream], dtype=np.int64)
    least = np.zeros(of.surfaces.patch_count)
    found = [short.send(at, patch, streams, turn, bounce, least).directions[0] for turn in range(turns)]
    normal = of.surfaces.normal[:1]
    frame = np.concatenate([*tangent_frames(normal), normal])
    return np.asarray(np.array(found) @ frame.T)


FLOOR: IntArray = np.zeros(1, dtype=np.int32)


@pytest.mark.parametrize("bounce", range(4))
def test_each_ray_of_a_stream_is_spread_by_the_cosine(bounce: int) -> None:
    found = directions(FLOOR, 2000, bounce, 7)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, atol=1e-12)
    np.testing.assert_allclose(found.mean(axis=0), [0.0, 0.0, 2.0 / 3.0], atol=0.03)
    np.testing.assert_allclose((found**2).mean(axis=0), [0.25, 0.25, 0.5], atol=0.03)


@pytest.mark.parametrize("stream", [0, 1, 12345])
def test_rays_one_after_the_other_have_nothing_to_do_with_each_other(stream: int) -> None:
    """Over the turns of one stream all pairs of directions come up: their products have no mean."""
    found = [directions(FLOOR, 2000, bounce, stream) - [0.0, 0.0, 2.0 / 3.0] for bounce in range(4)]
    for first, second in combinations(found, 2):
        np.testing.assert_allclose(first.T @ second / len(first), 0.0, atol=0.03)


def test_pairs_of_rays_err_less_than_random_ones() -> None:
    """Means over 64 turns of what two rays in a row decide together, for each of 400 points."""
    of = room(square("floor", material(0.5), z=0.0))
    short, turns, count = ShortRays(of.surfaces, of.rays, 1.0, has_mirrors=False), 64, 400
    at, patch = np.full((count, 3), 0.5), np.zeros(count, dtype=np.int32)
    stream: Int64Array = np.arange(count, dtype=np.int64)
    least = np.zeros(of.surfaces.patch_count)
    values = np.empty((turns, count))
    for turn in range(turns):
        one, two = (short.send(at, patch, stream, turn, bounce, least).directions for bounce in (0, 1))
        # Squares of components have means of 1/4 and 1/2, and of their products 1/8.
        values[turn] = one[:, 0] ** 2 * two[:, 2] ** 2
    error = np.sqrt(np.mean((values.mean(axis=0) - 0.125) ** 2))
    assert abs(values.mean() - 0.125) < 0.002
    assert error < 0.6 * values.std() / np.sqrt(turns)

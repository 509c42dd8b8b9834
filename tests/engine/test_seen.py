"""The error estimates of what is shown: against the path tracer, and as the tolerance is turned down."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.calibration.measure import Case, Effort, Told, measure_scene
from solver.engine.seen import SeenPoints, darkness
from solver.engine.world import World
from solver.visibility.rays import RayScene
from tests.engine.scenes import box

EFFORT = Effort(field=40_000, pixel=32, probe=1024, probes=32, tolerances=(0.16, 0.04))


@pytest.fixture(scope="module")
def cases() -> list[Case]:
    """A room with a low lamp, at two tolerances and after an edit."""
    return [case for case in measure_scene("room 11", EFFORT).cases if case.told < 1.0]


def test_estimates_hold_in_19_of_20_cases(cases: list[Case]) -> None:
    assert len(cases) > 80
    assert np.mean([case.holds for case in cases]) >= 0.95


def test_estimates_are_no_more_than_5_times_the_error_in_the_median(cases: list[Case]) -> None:
    assert np.median([case.ratio for case in cases if case.true > 3.0 * case.noise]) <= 5.0


@pytest.mark.parametrize("told_by", [told for told in Told if told is not Told.PROBE])
def test_what_is_told_and_what_is_true_fall_with_the_tolerance(cases: list[Case], told_by: Told) -> None:
    coarse, fine = (
        next(c for c in cases if c.told_by is told_by and c.stage == f"{tolerance:g}, at rest")
        for tolerance in EFFORT.tolerances
    )
    assert fine.told < 0.7 * coarse.told
    assert fine.true < max(0.8 * coarse.true, 2.0 * fine.noise)


def test_a_picture_of_constant_elements_errs_by_what_they_vary_within(cases: list[Case]) -> None:
    at_rest = [case for case in cases if case.stage == "0.04, at rest"]
    flat, status = (
        next(case for case in at_rest if case.told_by is told_by) for told_by in (Told.FLAT, Told.STATUS)
    )
    assert flat.true > 2.0 * status.true, "else there is nothing to be told"
    assert flat.true <= flat.told <= 2.0 * flat.true


def test_points_of_a_frame_are_where_its_pixels_are() -> None:
    scene = box()
    world = World.of(scene)
    camera = scene.cameras["main"]
    seen = SeenPoints.of(camera, world)
    surfaces = world.surfaces
    assert len(seen.patch) > 0.5 * 48 * 48
    # Each lies in the plane of its patch, before it, and nothing hides it.
    offset = np.einsum(
        "ka,ka->k", seen.positions - surfaces.corners[seen.patch, 0], surfaces.normal[seen.patch]
    )
    assert np.abs(offset).max() < 1e-5 * surfaces.size
    before = np.einsum("ka,ka->k", camera.eye - seen.positions, surfaces.normal[seen.patch])
    assert (before > 0.0).all()
    rays = RayScene(surfaces.triangles, surfaces.center, surfaces.size)
    nearer = seen.positions + 1e-4 * (camera.eye - seen.positions)
    assert not rays.occluded(np.broadcast_to(camera.eye, nearer.shape), nearer).any()


def test_dark_places_err_more_in_proportion() -> None:
    levels = np.array([4.0, 1.0, 0.7, 0.1, 0.01])
    factors = darkness(levels)
    assert factors[:3].tolist() == [1.0, 1.0, 1.0]
    assert (np.diff(factors[2:]) > 0.0).all()
    assert (np.diff(factors * levels) < 0.0).all(), "but less in all"

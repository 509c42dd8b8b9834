"""Frames: against the reference pictures, and what can be told without any."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from solver.document.samples import load_sample
from solver.engine.world import World
from solver.geometry.scene import Camera
from solver.pathtracing import PathTracer
from solver.types import LUMINANCE_WEIGHTS, FloatArray
from tests.pathtracing.agreement import assert_agrees, disagreements
from tests.pathtracing.worlds import cube, material, square, tracer

REFERENCE = Path(__file__).parent.parent / "data" / "reference"


def looking_down(width: int = 8, height: int = 6) -> Camera:
    """From z = 1 at the unit square; x to the right, y up in the picture; 1 m high at z = 0."""
    return Camera(
        eye=np.array([0.5, 0.5, 1.0]),
        target=np.array([0.5, 0.5, 0.0]),
        up=np.array([0.0, 1.0, 0.0]),
        vertical_fov=2.0 * np.degrees(np.arctan(0.5)),
        width=width,
        height=height,
    )


@pytest.mark.parametrize(
    ("sample", "camera", "removed", "passes"),
    [
        ("cornell", "main", None, 24),
        ("cube_room", "main", None, 48),
        ("cube_room", "main", "cube", 48),
        ("office", "main", None, 160),
        ("office", "birds_eye", None, 160),
        ("robot_cell", "main", None, 64),
    ],
)
def test_reference_frames(sample: str, camera: str, removed: str | None, passes: int) -> None:
    """Every pixel, and the picture as a whole, within what the noise of both allows."""
    suffix = "" if removed is None else f"_without_{removed}"
    with np.load(REFERENCE / f"{sample}{suffix}.{camera}.npz") as data:
        truth, truth_error = data["radiance"].astype(float), data["standard_error"].astype(float)
    scene = load_sample(sample)
    if removed is not None:
        scene = scene.without_object(removed)
    world = World.of(scene)
    height, width = truth.shape[:2]
    view = replace(scene.cameras[camera], width=width, height=height)
    frame = PathTracer(world.surfaces, world.rays, seed=7).frame(view, 32, passes)
    frame.run()
    assert frame.samples == 32 * passes
    assert_agrees(frame.radiance, frame.standard_error, truth, truth_error, passes)
    assert frame.error_estimate < 0.03

    # Over the whole picture errors average out, and small ones show.
    mean, expected = frame.radiance.mean(axis=(0, 1)), truth.mean(axis=(0, 1))
    noise = [
        np.sqrt((error**2).sum(axis=(0, 1))) / (height * width)
        for error in (frame.standard_error, truth_error)
    ]
    assert_agrees(mean, noise[0], expected, noise[1], passes)
    assert (np.hypot(*noise) / expected).max() < 3e-3


def test_a_picture_of_another_scene_is_told_apart() -> None:
    """The comparison has teeth: the same room with its cube moved by a hand's breadth disagrees."""
    with np.load(REFERENCE / "cube_room.main.npz") as data:
        truth, truth_error = data["radiance"].astype(float), data["standard_error"].astype(float)
    scene = load_sample("cube_room")
    moved = scene.object("cube")
    vertices = moved.mesh.vertices + np.array([0.1, 0.0, 0.0])
    world = World.of(scene.with_replaced(replace(moved, mesh=replace(moved.mesh, vertices=vertices))))
    view = replace(scene.cameras["main"], width=truth.shape[1], height=truth.shape[0])
    frame = PathTracer(world.surfaces, world.rays).frame(view, 32, 16)
    frame.run()
    assert disagreements(frame.radiance, frame.standard_error, truth, truth_error, 16).sum() >= 10


def test_lamp_seen_directly_has_its_exact_radiance() -> None:
    of = tracer(square("lamp", material(emission=(3.0, 2.0, 1.0)), z=0.0, low=-9.0, high=9.0))
    frame = of.frame(looking_down(), 4, 2)
    frame.run()
    np.testing.assert_allclose(frame.radiance, np.broadcast_to(np.array([3.0, 2.0, 1.0]) / np.pi, (6, 8, 3)))
    assert frame.error_estimate < 1e-12


def test_rows_run_down_and_columns_to_the_right() -> None:
    """A lamp in the corner of large x and large y is in the picture's upper right."""
    of = tracer(square("lamp", material(emission=1.0), z=0.0, low=0.75, high=0.99))
    frame = of.frame(looking_down(8, 8), 4, 4)
    frame.run()
    rows, columns = np.nonzero(frame.radiance.sum(axis=-1))
    assert rows.max() <= 1 and columns.min() >= 6


def test_box_filter_gives_an_edge_pixel_its_share() -> None:
    of = tracer(square("lamp", material(emission=np.pi), z=0.0, low=0.0, high=0.3125))
    frame = of.frame(looking_down(8, 8), 64, 32)
    frame.run()
    np.testing.assert_allclose(frame.radiance[7, :2], 1.0)
    assert_agrees(frame.radiance[7, 2], frame.standard_error[7, 2], 0.5)
    assert frame.radiance[7, 3:].max() == 0.0


def test_black_back_of_a_lamp_is_seen_black() -> None:
    of = tracer(square("lamp", material(emission=1.0), z=0.0, down=True))
    frame = of.frame(looking_down(), 1, 2)
    frame.run()
    assert not frame.radiance.any()


def test_frame_improves_and_knows_how_far_it_is() -> None:
    frame = cube([0.5] * 6, [0.0, 1.0, 0.0, 0.0, 0.0, 0.0]).frame(
        replace(looking_down(16, 16), eye=np.array([0.5, 0.5, 0.9]))
    )
    assert frame.passes == 0 and frame.samples == 0 and frame.error_estimate == float("inf")
    errors: list[float] = []
    for passes in (4, 64):
        while frame.passes < passes:
            assert frame.step(0.0), "without a number of passes it never ends"
        errors.append(frame.error_estimate)
    assert frame.samples == 4 * frame.passes
    assert frame.ray_count > frame.vertex_count > 16 * 16 * frame.samples
    # Sixteen times the passes, a quarter of the noise.
    assert errors[1] == pytest.approx(errors[0] / 4.0, rel=0.3)


def test_error_estimate_is_the_error() -> None:
    """Relative RMS luminance error of short frames against a long one."""
    of = cube([0.5] * 6, [0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
    view = replace(looking_down(16, 16), eye=np.array([0.5, 0.5, 0.9]))
    long = of.frame(view, 64, 128)
    long.run()
    short = cube([0.5] * 6, [0.0, 1.0, 0.0, 0.0, 0.0, 0.0], seed=5).frame(view, 4, 16)
    short.run()

    def luminance(radiance: FloatArray) -> FloatArray:
        return np.asarray(radiance @ LUMINANCE_WEIGHTS)

    truth = luminance(long.radiance)
    measured = np.sqrt(((luminance(short.radiance) - truth) ** 2).sum() / (truth**2).sum())
    assert short.error_estimate == pytest.approx(measured, rel=0.2)

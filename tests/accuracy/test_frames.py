"""The gather at what pixels show, against reference frames that the project did not compute."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from solver.document.samples import load_sample
from solver.engine.world import World
from solver.types import LUMINANCE_WEIGHTS
from tests.transport.solving import corrected_irradiance_at, solved

REFERENCE = Path(__file__).parents[1] / "data" / "reference"

GRID = 4
"""Samples of a pixel along either side; the frames are box filtered."""


@pytest.mark.parametrize(
    ("sample", "camera"), [("cornell", "main"), ("cube_room", "main"), ("office", "main")]
)
def test_gathered_pixels(sample: str, camera: str) -> None:
    """Over pixels whose whole footprint lies on one patch that emits nothing."""
    scene = load_sample(sample)
    world = World.of(scene)
    with np.load(REFERENCE / f"{sample}.{camera}.npz") as file:
        truth, noise = file["radiance"] @ LUMINANCE_WEIGHTS, file["standard_error"] @ LUMINANCE_WEIGHTS
    height, width = truth.shape
    view = scene.cameras[camera]
    right, up, forward = view.basis()
    tangent = np.tan(np.radians(view.vertical_fov) / 2.0)
    x = (np.arange(GRID * width) + 0.5) / (GRID * width) * 2.0 - 1.0
    y = 1.0 - (np.arange(GRID * height) + 0.5) / (GRID * height) * 2.0
    across, down = np.meshgrid(x * tangent * width / height, y * tangent)
    directions = (forward + across[..., None] * right + down[..., None] * up).reshape(-1, 3)
    origins = np.tile(view.eye, (len(directions), 1))
    hits = world.rays.intersect(origins, directions)
    triangle = np.maximum(hits.triangle, 0)
    facing = world.surfaces.triangle_patch[triangle]
    normal = world.surfaces.normal[facing[:, 0]]
    front = (normal * directions).sum(axis=1) < 0.0
    patch = np.where(hits.triangle < 0, -1, np.where(front, facing[:, 0], facing[:, 1]))
    dark = (patch >= 0) & ~world.surfaces.emission[patch].any(axis=1)

    # A pixel's own samples, and those all around it, lie on the same patch.
    seen = np.pad(np.where(dark, patch, -1).reshape(GRID * height, GRID * width), 1, constant_values=-1)
    windows = np.lib.stride_tricks.sliding_window_view(seen, (GRID + 2, GRID + 2))[::GRID, ::GRID]
    windows = windows.reshape(height * width, -1)
    whole = np.flatnonzero((windows[:, :1] == windows).all(axis=1) & (windows[:, 0] >= 0))
    assert len(whole) > 0.3 * height * width
    index = np.arange(len(patch)).reshape(height, GRID, width, GRID).transpose(0, 2, 1, 3)
    chosen = index.reshape(height * width, -1)[whole]
    at = chosen.ravel()
    position = origins[at] + hits.distance[at, None] * directions[at]
    # Rays have the digits of float32 only.
    plane = world.surfaces.normal[patch[at]]
    position -= ((position - world.surfaces.corners[patch[at], 0]) * plane).sum(axis=1, keepdims=True) * plane
    solver = solved(world)
    found = corrected_irradiance_at(solver, position, plane)
    radiance = (found * world.surfaces.reflectance[patch[at]] / np.pi) @ LUMINANCE_WEIGHTS
    pixels = radiance.reshape(chosen.shape).mean(axis=1)
    expected, scatter = truth.ravel()[whole], noise.ravel()[whole]
    squared = ((pixels - expected) ** 2 - scatter**2) / np.sum(expected**2)
    # One pixel may hold a sliver of a lamp's edge that no ray of the grid sees.
    assert float(squared.sum() - squared.max()) < 0.01**2
    assert float(squared.sum()) < 0.025**2

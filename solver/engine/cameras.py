"""Cameras as keys."""

from __future__ import annotations

from solver.geometry.scene import Camera


def camera_key(camera: Camera) -> tuple[float, ...]:
    """Equal for cameras that see the same."""
    vectors = (camera.eye, camera.target, camera.up)
    numbers = tuple(float(part) for vector in vectors for part in vector)
    return (*numbers, camera.vertical_fov, camera.width, camera.height)

"""Maps of hemispheres: what their texels look at, and the frames that they are looked at in."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from solver.illumination.particles.hemisphere import tangent_frames, texel_directions
from solver.types import FloatArray


def solid_angles(resolution: int) -> FloatArray:
    """Of the texels (r, r): a square of side a has 4 a^2 of the map, whose Jacobian is 1 / 2 and 1 / d^3."""
    middle = (np.arange(resolution) + 0.5) / resolution * 2.0 - 1.0
    u, v = np.meshgrid(middle, middle)
    x, y = 0.5 * (u + v), 0.5 * (u - v)
    far = np.sqrt(x**2 + y**2 + (1.0 - np.abs(x) - np.abs(y)) ** 2)
    return 0.5 * (2.0 / resolution) ** 2 / far**3


@pytest.mark.parametrize("resolution", [2, 3, 64, 255])
def test_texels_look_upwards(resolution: int) -> None:
    directions = texel_directions(resolution)
    assert directions.shape == (resolution**2, 3)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0, atol=1e-6)
    assert directions[:, 2].min() > 0.0


def test_texels_cover_the_hemisphere_about_evenly() -> None:
    """The mean of cos over it is 1 / 2, of cos^2 1 / 3, and of directions aside 0."""
    weight, directions = solid_angles(128).ravel(), texel_directions(128).astype(float)
    assert weight.sum() == pytest.approx(2.0 * np.pi, rel=1e-3)
    assert weight.max() < 3.0**1.5 * weight.min(), "1 / d^3, with d from 1 / sqrt(3) to 1"
    share = weight / weight.sum()
    np.testing.assert_allclose(share @ directions, [0.0, 0.0, 0.5], atol=1e-3)
    second = np.einsum("n,na,nb->ab", share, directions, directions)
    np.testing.assert_allclose(second, np.eye(3) / 3.0, atol=1e-3)


def test_neighbours_in_the_map_are_neighbours_in_space() -> None:
    resolution = 64
    directions = texel_directions(resolution).reshape(resolution, resolution, 3).astype(float)
    for one, other in ((directions[1:], directions[:-1]), (directions[:, 1:], directions[:, :-1])):
        angle = np.arccos(np.einsum("ija,ija->ij", one, other))
        assert angle.max() < 1.75 * np.sqrt(2.0 * np.pi) / resolution, "of the side of a texel in the mean"


@given(st.floats(-1.0, 1.0), st.floats(0.0, 2.0 * np.pi))
def test_frames_are_right_handed(height: float, azimuth: float) -> None:
    radius = np.sqrt(1.0 - height**2)
    normal = np.array([[radius * np.cos(azimuth), radius * np.sin(azimuth), height]])
    tangent, other = tangent_frames(normal)
    frame = np.concatenate([tangent, other, normal])
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-9)
    assert np.linalg.det(frame) == pytest.approx(1.0)

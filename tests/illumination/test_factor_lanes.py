"""Form factors in lanes against those one by one."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings

from solver.illumination.points.factor_lanes import (
    BLOCK,
    FACTOR,
    HIGHEST,
    LANES,
    LOWEST,
    PLACE,
    WEIGHT,
    angle_of,
    fill_lane,
    find_factors,
)
from solver.transport.lambert import points_to_polygon
from solver.types import FloatArray, Points, Vector
from tests.illumination.visible_twin import normal_of
from tests.transport.polygons import SEEDS

UP = np.array([0.0, 0.0, 1.0])


def test_angles_are_atan2_but_for_the_last_places() -> None:
    random = np.random.default_rng(1)
    y = np.abs(random.normal(size=20_000)) * 10.0 ** random.uniform(-9.0, 9.0, 20_000)
    x = random.normal(size=20_000) * 10.0 ** random.uniform(-9.0, 9.0, 20_000)
    found = np.array([angle_of(a, b) for a, b in zip(y.tolist(), x.tolist(), strict=True)])
    assert np.max(np.abs(found - np.arctan2(y, x)) / np.spacing(np.arctan2(y, x))) <= 3.0


@pytest.mark.parametrize(("y", "x"), [(0, 1), (0, -1), (1, 0), (1, 1), (1, -1), (5e-324, 1), (1e300, 1e300)])
def test_angles_on_axes_and_diagonals(y: float, x: float) -> None:
    assert angle_of(float(y), float(x)) == np.arctan2(y, x)


def test_angle_of_nothing_is_none() -> None:
    assert np.isnan(angle_of(0.0, 0.0))


def block_of(x: Vector, normal: Vector, polygons: list[Points]) -> FloatArray:
    """A block with polygons (3 or 4, 3) in its first lanes."""
    corners = np.array([polygon[[0, 1, 2, -1]] for polygon in polygons])
    normals = np.array([normal_of(polygon) for polygon in polygons])
    block = np.zeros(BLOCK)
    for lane, polygon in enumerate(polygons):
        fill_lane(block, lane, x, corners, lane, len(polygon), normals, lane)
    find_factors(block, *normal.tolist())
    return block


@settings(max_examples=50)
@given(seed=SEEDS)
def test_factors_are_those_of_one_polygon_at_a_time(seed: int) -> None:
    random = np.random.default_rng(seed)
    polygons = []
    for _ in range(LANES):
        # Above the horizon, showing the origin their fronts.
        middle = np.array([*random.uniform(-3.0, 3.0, 2), random.uniform(0.5, 3.0)])
        frame = np.linalg.qr(np.column_stack([-middle, random.normal(size=(3, 2))]))[0]
        frame *= np.sign(np.linalg.det(frame) * (frame[:, 0] @ -middle))
        angle = np.sort(random.uniform(0.0, 2.0 * np.pi, random.integers(3, 5)))
        flat = np.stack([np.cos(angle), np.sin(angle)]) * 10.0 ** random.uniform(-6.0, -0.7)
        polygons.append(middle + (frame[:, 1:] @ flat).T)
    block = block_of(np.zeros(3), UP, polygons)
    for lane, polygon in enumerate(polygons):
        expected = points_to_polygon(np.zeros((1, 3)), UP[None], polygon)[0]
        facing = normal_of(polygon) @ -polygon[0] > 0.0
        if facing:
            assert block[FACTOR + lane] == pytest.approx(expected, rel=1e-9, abs=1e-15)
        assert block[LOWEST + lane] == pytest.approx(polygon[:, 2].min(), rel=1e-12)
        assert block[HIGHEST + lane] == pytest.approx(polygon[:, 2].max(), rel=1e-12)


def test_light_comes_from_where_it_counts_most() -> None:
    """Of a small source, its middle; of a strip that runs away from the point, its near end."""
    small = np.array([[-1.0, -1.0, 0.0], [-1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [1.0, -1.0, 0.0]]) * 1e-3
    strip = np.array([[0.0, -0.1, 0.5], [0.0, 0.1, 0.5], [4.0, 0.1, 0.5], [4.0, -0.1, 0.5]])
    block = block_of(np.zeros(3), UP, [small + UP, strip, (small + UP)[:3]])
    places = (
        block[PLACE : PLACE + 3 * LANES].reshape(3, LANES).T
        / np.maximum(block[WEIGHT:PLACE], 1e-300)[:, None]
    )
    np.testing.assert_allclose(places[0], UP, atol=1e-8)
    np.testing.assert_allclose(places[2], (small + UP)[:3].mean(axis=0), atol=1e-8)
    # The mean over the strip with weight 1 / r^4, by the same rule in x alone.
    x = 2.0 + np.array([-2.0, 2.0]) / np.sqrt(3.0)
    weight = (x**2 + 0.25 + 0.01 / 3.0) ** -2.0
    assert places[1, 0] == pytest.approx((weight * x).sum() / weight.sum(), rel=1e-12)
    assert places[1, 0] < 1.0


def test_repeated_corners_and_unused_lanes_do_no_harm() -> None:
    triangle = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 1.0], [1.0, 0.0, 1.0]])
    block = block_of(np.zeros(3), UP, [triangle])
    expected = points_to_polygon(np.zeros((1, 3)), UP[None], triangle)[0]
    assert block[FACTOR] == pytest.approx(expected, rel=1e-14)
    assert np.isfinite(block).all()

"""Quadratics through six samples."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from solver.illumination.interpolation.fit import fit_interpolants
from solver.types import FloatArray, IntArray

PLACES = np.array([[0, 0], [0.5, 0], [1, 0], [0.5, 0.5], [0, 1], [0, 0.5]])


def powers(s: FloatArray, t: FloatArray) -> FloatArray:
    return np.stack([s * s, s * t, s, t * t, t, np.ones_like(s)], axis=-1)


@settings(max_examples=50)
@given(st.lists(st.floats(-1e3, 1e3), min_size=6, max_size=6), st.sampled_from([1, 3]))
def test_quadratics_are_reproduced(coefficients: list[float], channels: int) -> None:
    wanted = np.array(coefficients)
    values = np.repeat((powers(*PLACES.T) @ wanted)[:, None], channels, axis=1)
    node: IntArray = np.arange(6, dtype=np.int32)[None]
    found = fit_interpolants(node, values)
    assert found.shape == (1, 6, 3)
    np.testing.assert_allclose(found[0], np.repeat(wanted[:, None], 3, axis=1), atol=1e-3)


def test_samples_are_met_exactly_by_any_values() -> None:
    random = np.random.default_rng(2)
    values = random.uniform(0.0, 9.0, (40, 3))
    node = random.integers(0, 40, (300, 6)).astype(np.int32)
    found = fit_interpolants(node, values)
    np.testing.assert_allclose(
        np.einsum("kp,npc->nkc", powers(*PLACES.T), found), values[node], rtol=1e-4, atol=1e-4
    )


@pytest.mark.parametrize("order", [2, 3])
def test_error_of_smooth_functions_falls_by_the_third_power_of_size(order: int) -> None:
    """Over triangles of half the size; a quadratic has none."""

    def error(size: float) -> float:
        corners = np.array([0.3, 0.1]) + size * np.array([[0.0, 0.0], [1.0, 0.2], [0.1, 0.9]])

        def function(s: FloatArray, t: FloatArray) -> FloatArray:
            x = corners[0] + np.multiply.outer(s, corners[1] - corners[0])
            x = x + np.multiply.outer(t, corners[2] - corners[0])
            return np.asarray((x[..., 0] + 0.5 * x[..., 1]) ** order + 1.0)

        found = fit_interpolants(np.arange(6, dtype=np.int32)[None], function(*PLACES.T)[:, None])
        s, t = np.random.default_rng(0).dirichlet(np.ones(3), 200)[:, :2].T
        return float(np.abs(powers(s, t) @ found[0, :, 0].astype(np.float64) - function(s, t)).max())

    if order == 2:
        assert error(1.0) < 1e-6
    else:
        assert error(0.5) < error(1.0) / 7.0

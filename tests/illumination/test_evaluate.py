"""Quadratics evaluated at points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from solver.document.samples import load_sample
from solver.geometry.surfaces import flatten
from solver.illumination.interpolation.evaluate import evaluate_interpolants
from solver.illumination.interpolation.mesh import InterpolantMesh
from solver.types import Float32Array

SURFACES = flatten(load_sample("cornell"))


def mesh_of(coefficients: Float32Array) -> InterpolantMesh:
    """The same triangle over and over, with `coefficients` (t, 6, 3)."""
    count = len(coefficients)
    return InterpolantMesh(
        surfaces=SURFACES,
        position=SURFACES.corners[0, :3].copy(),
        patch=np.zeros(3, dtype=np.int32),
        triangles=np.tile(np.arange(3, dtype=np.int32), (count, 1)),
        leaf=np.zeros(count, dtype=np.int32),
        coefficients=coefficients,
        error=np.zeros(count, dtype=np.float32),
        is_fine=np.ones(count, dtype=np.bool_),
        leaf_irradiance=np.ones((1, 3)),
    )


@given(st.integers(0, 2**32 - 1))
def test_values_are_those_of_the_polynomial(seed: int) -> None:
    random = np.random.default_rng(seed)
    mesh = mesh_of(random.uniform(-1.0, 1.0, (5, 6, 3)).astype(np.float32))
    triangle = random.integers(-1, 5, 50).astype(np.int32)
    s, t = (points := random.uniform(0.0, 1.0, (50, 2))).T
    terms = np.stack([s * s, s * t, s, t * t, t, np.ones(50)], axis=-1)
    expected = np.einsum("nk,nkc->nc", terms, mesh.coefficients[triangle].astype(np.float64))
    expected[triangle < 0] = 0.0
    found = evaluate_interpolants(mesh, triangle, points)
    assert found.dtype == np.float64
    np.testing.assert_allclose(found, np.maximum(expected, 0.0), atol=1e-14)


def test_interpolants_go_through_their_samples() -> None:
    """[H 3.3]: the coefficients of six samples give these back."""
    r = np.random.default_rng(2).uniform(1.0, 2.0, (6, 3))
    quadratic = np.stack(
        [
            2.0 * r[0] - 4.0 * r[1] + 2.0 * r[2],
            4.0 * (r[0] - r[1] + r[3] - r[5]),
            -3.0 * r[0] + 4.0 * r[1] - r[2],
            2.0 * r[0] + 2.0 * r[4] - 4.0 * r[5],
            -3.0 * r[0] - r[4] + 4.0 * r[5],
            r[0],
        ]
    )
    points = np.array([(0.0, 0.0), (0.5, 0.0), (1.0, 0.0), (0.5, 0.5), (0.0, 1.0), (0.0, 0.5)])
    mesh = mesh_of(quadratic[None].astype(np.float32))
    found = evaluate_interpolants(mesh, np.zeros(6, dtype=np.int32), points)
    np.testing.assert_allclose(found, r, rtol=2e-6)


@pytest.mark.parametrize("triangle", [-2, 3])
def test_triangles_that_are_not_there_are_refused(triangle: int) -> None:
    mesh = mesh_of(np.ones((3, 6, 3), dtype=np.float32))
    with pytest.raises(IndexError):
        evaluate_interpolants(mesh, np.array([0, triangle], dtype=np.int32), np.zeros((2, 2)))


def test_nothing_and_no_points_give_nothing() -> None:
    mesh = mesh_of(np.ones((1, 6, 3), dtype=np.float32))
    assert evaluate_interpolants(mesh, np.empty(0, dtype=np.int32), np.empty((0, 2))).shape == (0, 3)
    empty = replace(mesh, coefficients=mesh.coefficients[:0])
    found = evaluate_interpolants(empty, np.full(4, -1, dtype=np.int32), np.zeros((4, 2)))
    np.testing.assert_array_equal(found, np.zeros((4, 3)))

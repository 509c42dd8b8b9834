"""Irradiance at corners: exact where it can be, of the order that it claims, never beyond what is there."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from solver.geometry.surfaces import Surfaces
from solver.illumination.meshing.topology import Topology, connect
from solver.rendering.plane_points import plane_points
from solver.rendering.reconstruction import vertex_irradiance
from solver.rendering.tessellation import Tessellator
from solver.transport.field import RadiosityField
from solver.types import BoolArray, FloatArray, Points
from tests.rendering.fields import SQUARE, Function, build_field, even, linear, polygons, surfaces_of, uneven

SHAPES = {
    "square": SQUARE,
    "triangle": [(0.0, 0.0, 0.0), (1.3, 0.1, 0.4), (0.2, 0.9, 0.1)],
    "parallelogram": [(0.0, 0.0, 0.0), (1.0, 0.2, 0.5), (1.3, 1.1, 0.6), (0.3, 0.9, 0.1)],
}


def spot_light(points: Points) -> FloatArray:
    """Irradiance from a small Lambertian source a height h over (0.4, 0.3), facing down: (h / r)^4."""
    height = 0.6
    squared = (points[:, 0] - 0.4) ** 2 + (points[:, 1] - 0.3) ** 2 + height**2
    return np.repeat((height**4 / squared**2)[:, None], 3, axis=1)


def with_means(surfaces: Surfaces, depth: int, function: Function) -> FloatArray:
    """Largest error at the vertices when leaves have the means of `function`, by 3 x 3 Gauss points."""
    field = build_field(surfaces, even(depth), function)
    nodes, weights = np.polynomial.legendre.leggauss(3)
    low, across = field.corners[:, 0], field.corners[:, 2] - field.corners[:, 0]
    mean = np.zeros((len(low), 3))
    for x, wx in zip(nodes, weights, strict=True):
        for y, wy in zip(nodes, weights, strict=True):
            mean += 0.25 * wx * wy * function(low + across * np.array([x + 1, y + 1, 0.0]) / 2)
    topology = connect(field)
    values = vertex_irradiance(mean, plane_points(field, surfaces, topology))
    return np.asarray(np.abs(values - function(topology.position)).max(axis=1))


def inside_patch(field: RadiosityField, topology: Topology) -> BoolArray:
    """Whether each vertex is off the border of its patch."""
    inside = np.ones(len(topology.position), dtype=np.bool_)
    leaf, slot = topology.border >> 2, topology.border & 3
    inside[topology.vertex[leaf, slot]] = False
    inside[topology.vertex[leaf, (slot + 1) % field.corner_count[leaf]]] = False
    return inside


@given(
    name=st.sampled_from(sorted(SHAPES)),
    seed=st.integers(0, 10_000),
    depth=st.integers(2, 5),
    slope=st.tuples(*[st.floats(-1.0, 1.0)] * 3),
)
@settings(max_examples=40)
def test_linear_fields_are_exact_inside_a_patch(
    name: str, seed: int, depth: int, slope: tuple[float, float, float]
) -> None:
    surfaces = surfaces_of(polygons(SHAPES[name]))
    function = linear(slope, 5.0)
    field = build_field(surfaces, uneven(seed, depth), function)
    topology = connect(field)
    error = np.abs(
        vertex_irradiance(field.irradiance, plane_points(field, surfaces, topology))
        - function(topology.position)
    ).max(axis=1)
    # At the border, extrapolation is bounded by what the leaves around differ: the inside is exact.
    assert error[inside_patch(field, topology)].max(initial=0.0) < 1e-9


@pytest.mark.parametrize("name", sorted(SHAPES))
def test_linear_fields_are_exact_to_the_border_on_even_meshes(name: str) -> None:
    surfaces = surfaces_of(polygons(SHAPES[name]))
    function = linear((0.7, -0.4, 0.2), 5.0)
    field = build_field(surfaces, even(3), function)
    topology = connect(field)
    values = vertex_irradiance(field.irradiance, plane_points(field, surfaces, topology))
    np.testing.assert_allclose(values, function(topology.position), rtol=1e-10)


def test_error_falls_with_the_order_of_the_method() -> None:
    """Fitted order over the whole square, its border included, at least 1.8; of the average at least 2.5."""
    surfaces = surfaces_of(polygons(SQUARE))
    errors = [with_means(surfaces, depth, spot_light) for depth in (3, 4, 5, 6)]
    sizes = np.log2([2.0**-depth for depth in (3, 4, 5, 6)])
    largest = np.polyfit(sizes, np.log2([e.max() for e in errors]), 1)[0]
    average = np.polyfit(sizes, np.log2([e.mean() for e in errors]), 1)[0]
    assert largest > 1.8
    assert average > 2.5


@given(seed=st.integers(0, 10_000), depth=st.integers(1, 4))
@settings(max_examples=30)
def test_values_stay_between_the_darkest_and_the_brightest_around_a_step(seed: int, depth: int) -> None:
    """A shadow edge: no ringing, and nothing negative."""
    surfaces = surfaces_of(polygons(SQUARE))
    field = build_field(
        surfaces, uneven(seed, depth), lambda p: np.repeat((p[:, :1] > 0.37).astype(float), 3, axis=1)
    )
    topology = connect(field)
    values = vertex_irradiance(field.irradiance, plane_points(field, surfaces, topology))
    inside = values[inside_patch(field, topology)]
    assert inside.max(initial=0.0) <= 1.0
    # On the border a value may leave the range upwards, by what the leaves around differ.
    assert values.min() >= 0.0
    assert values.max() <= 2.0
    drawn = Tessellator(surfaces).mesh(field).irradiance
    assert drawn.min() >= 0.0
    assert drawn.max() <= np.float32(values.max())

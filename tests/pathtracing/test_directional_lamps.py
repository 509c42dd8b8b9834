"""Lamps whose radiance goes with a power of the cosine: what they light, what they look like."""

from __future__ import annotations

import math

import numpy as np
import pytest

from solver.geometry.scene import Mesh, SceneObject
from tests.pathtracing.agreement import assert_agrees
from tests.pathtracing.test_known_answers import UP, patch_irradiance
from tests.pathtracing.views import looking, radiance, square_nodes
from tests.pathtracing.worlds import CUBE, INWARD, material, square, tracer

COLOURS = np.array([0.8, 0.5, 0.1])


@pytest.mark.parametrize("exponent", [0.5, 1.0, 7.0, 200.0])
@pytest.mark.parametrize("angle", [0.0, 0.4])
def test_small_directional_lamp_lights_as_its_cosine_says(exponent: float, angle: float) -> None:
    """E A (d + 2) / (2 pi) cos^(d + 1) / r^2 on a receiver that faces it."""
    lamp = square("lamp", material(emission=COLOURS, emission_exponent=exponent), 0.0, low=-0.005, high=0.005)
    of = tracer(lamp, square("ground", material(), -1.0, low=-2.0, high=2.0))
    towards = np.array([math.sin(angle), 0.0, math.cos(angle)])
    mean, error = of.irradiance(2.0 * towards[None], -towards[None], 4096)
    cosine = math.cos(angle)
    truth = COLOURS * 1e-4 * (exponent + 2.0) / (2.0 * np.pi) * cosine ** (exponent + 1.0) / 4.0
    assert_agrees(mean[0], error[0], truth, 1e-2 * truth)


@pytest.mark.parametrize("exponent", [1.0, 7.0, 50.0])
def test_large_directional_lamp(exponent: float) -> None:
    of = tracer(square("lamp", material(emission=1.0, emission_exponent=exponent), 1.0, True, -1.0, 2.0))
    mean, error = of.irradiance(np.zeros((1, 3)), UP[None], 1 << 15)
    points, area = square_nodes(-1.0, 2.0, 1.0)
    squared = np.sum(points**2, axis=1)
    lobe = 0.5 * (exponent + 2.0) / np.pi * squared ** (-0.5 * exponent)
    assert_agrees(mean, error, float(np.sum(area * lobe / squared**2)))
    assert (error / mean).max() < 0.05


@pytest.mark.parametrize("exponent", [0.5, 20.0])
def test_all_that_a_directional_lamp_emits_arrives(exponent: float) -> None:
    """In a black box, one wall of which it is."""
    lamp = SceneObject("face5", Mesh(CUBE, (INWARD[5],)), material(emission=3.0, emission_exponent=exponent))
    walls = [SceneObject(f"face{k}", Mesh(CUBE, (INWARD[k],)), material()) for k in range(5)]
    mean, error = patch_irradiance(tracer(*walls, lamp), 1 << 13)
    assert_agrees(mean[:, 0].sum(), np.sqrt((error[:, 0] ** 2).sum()), 3.0)


def test_a_directional_lamp_seen_straight_and_slanted() -> None:
    of = tracer(square("lamp", material(emission=COLOURS, emission_exponent=9.0), 0.0, low=-9.0, high=9.0))
    for across in (0.0, 1.0):
        seen, _ = radiance(of, looking((0.0, 0.0, 1.0), (across, 0.0, 0.0), 1e-4))
        expected = COLOURS * 11.0 / (2.0 * np.pi) * (1.0 + across**2) ** -4.5
        np.testing.assert_allclose(seen, expected, rtol=1e-4)

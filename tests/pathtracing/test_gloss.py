"""Gloss: highlights of lamps in closed form, samples that are bounded, light that goes both ways."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from solver.types import FloatArray
from tests.pathtracing.agreement import assert_agrees
from tests.pathtracing.views import looking, radiance, square_nodes
from tests.pathtracing.worlds import material, polygon, square, tracer

COLOURS = np.array([0.8, 0.5, 0.1])


def highlight(to: FloatArray, exponent: float, low: float, high: float) -> tuple[float, float]:
    """Radiance that leaves the origin of a floor, of a lamp of exitance 1 at height 1: by a lobe of specular
    reflectance 1, and by a diffuse reflectance of 1."""
    points, area = square_nodes(low, high, 1.0)
    distance = np.linalg.norm(points, axis=1)
    incident = points / distance[:, None]
    arriving = area * incident[:, 2] ** 2 / distance**2 / np.pi
    along = np.maximum(incident @ (to * [-1.0, -1.0, 1.0]), 0.0)
    lobe = (exponent + 2.0) / (2.0 * np.pi) * np.where(along > 0.0, along**exponent, 0.0)
    return float(np.sum(arriving * lobe)), float(np.sum(arriving) / np.pi)


@pytest.mark.parametrize("exponent", [0.0, 1.0, 30.0, 1000.0])
@pytest.mark.parametrize(("low", "high"), [(0.69, 0.72), (0.4, 0.9), (-4.0, 4.0)])
def test_highlight_of_a_lamp(exponent: float, low: float, high: float) -> None:
    """Small lamps and large, wide lobes and narrow: little noise in any, by ray or by shadow ray."""
    eye = np.array([-0.7, -0.7, 1.0])
    lamp = square("lamp", material(emission=4.0), 1.0, True, low, high)
    floor = square("floor", material(0.1, specular=COLOURS, exponent=exponent), 0.0, low=-0.1, high=0.1)
    seen, error = radiance(tracer(lamp, floor), looking((-0.35, -0.35, 0.5), (0.0, 0.0, 0.0), 1e-4), 256, 32)
    lobe, diffuse = highlight(eye / np.linalg.norm(eye), exponent, low, high)
    expected = 4.0 * (COLOURS * lobe + 0.1 * diffuse)
    assert_agrees(seen, error, expected, 1e-4 * expected)
    assert (error / expected).max() < 0.02


@pytest.mark.parametrize("exponent", [5.0, 1000.0])
def test_no_sample_of_gloss_is_brighter_than_half_as_bright_again_as_the_lamp(exponent: float) -> None:
    """Single samples, of a lamp that is small, and of one that touches the floor."""
    small = square("small", material(emission=np.pi), 0.05, True, 0.2, 0.201)
    tall = polygon("tall", [[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]][::-1], material(emission=np.pi))
    floor = square("floor", material(0.0, specular=0.99, exponent=exponent), 0.0)
    frame = tracer(small, tall, floor).frame(
        replace(looking((0.3, 1.5, 0.6), (0.5, 0.3, 0.0), 30.0), width=96, height=96), 1, 1
    )
    frame.run()
    # A ray and a shadow ray, each within 1.5 rho, and their weights add up to 1 for the same point.
    assert np.quantile(frame.radiance, 0.8) > 0.5 and frame.radiance.max() <= 2.0 * 1.5


@pytest.mark.parametrize("exponent", [2.0, 60.0, math.inf])
def test_light_by_way_of_gloss_is_the_same_both_ways(exponent: float) -> None:
    """Power that one panel sends to the other over the floor, with a wall between them, and the other way."""
    low, high = (-1.2, 0.0), (0.2, 1.4)
    floor = square("floor", material(0.2, specular=0.6, exponent=exponent), 0.0, low=-3.0, high=3.0)
    screen = polygon(
        "screen", [[0.1, -9, 0.4], [0.1, 9, 0.4], [0.1, 9, 9], [0.1, -9, 9]], material(two_sided=True)
    )
    power = []
    for lit in (0, 1):
        panels = [
            square(name, material(emission=float(k == lit)), z, True, *span)
            for k, (name, z, span) in enumerate([("a", 0.5, low), ("b", 1.5, high)])
        ]
        of = tracer(*panels, floor, screen, seed=3 + lit)
        s, target = of.surfaces, 1 - lit
        mean, error = of.mean_irradiance(
            s.corners[[target]], s.corner_count[[target]], np.array([target], "i4"), 1 << 17
        )
        power.append((mean[0, 0] * s.area[target], error[0, 0] * s.area[target]))
    (there, noise), (back, other) = power
    assert abs(there - back) < 4.0 * math.hypot(noise, other)
    assert noise < 0.025 * there

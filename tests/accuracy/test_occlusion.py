"""Form factors with something in between: a solve, against the tables."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from solver.engine.world import World
from solver.pathtracing import PathTracer
from solver.types import FloatArray
from tests.pathtracing.worlds import material, polygon, world
from tests.transport.polygons import array, cases
from tests.transport.solving import solved


def rectangle(of: dict[str, Any], up: bool) -> FloatArray:
    x0, x1, y0, y1 = array(of["rect_xxyy"])
    z = float(of["z"])
    corners = np.array([[x0, y0, z], [x1, y0, z], [x1, y1, z], [x0, y1, z]])
    return corners if up else corners[::-1]


def scene(case: dict[str, Any]) -> World:
    """A receiver that the solver cares for, below a lamp and a black blocker; nothing comes back."""
    return world(
        polygon("receiver", rectangle(case["receiver"], up=True), material(0.5)),
        polygon("lamp", rectangle(case["emitter"], up=False), material(0.0, 1.0)),
        polygon("blocker", rectangle(case["blocker"], up=True), material(0.0)),
    )


@pytest.mark.parametrize("case", cases("polygon-polygon-occluded"), ids=lambda case: str(case["id"]))
def test_mean_irradiance_is_the_form_factor(case: dict[str, Any]) -> None:
    expected = float(case["F_receiver_to_emitter"])
    solver = solved(scene(case))
    field = solver.field()
    receiver = field.patch == 0
    found = float(field.irradiance[receiver, 0] @ field.area[receiver]) / field.area[receiver].sum()
    if expected == 0.0:
        assert found == 0.0
        return
    assert found == pytest.approx(expected, rel=0.01)
    assert abs(found / expected - 1.0) < solver.error_estimate
    # Leaf by leaf; where nothing but a half-shadow is lit unevenly, the solver's estimate is a little short.
    truth, noise = PathTracer(solver.surfaces, solver._rays, 1).mean_irradiance(
        field.corners, field.corner_count, field.patch, max(1, 100_000 // (32 * len(field.area))) * 32
    )
    area = field.area[receiver]
    off, spread = (field.irradiance - truth)[receiver, 0], noise[receiver, 0]
    squared = area @ (off**2 - spread**2) / (area @ truth[receiver, 0] ** 2)
    assert squared < (1.25 * 0.02) ** 2

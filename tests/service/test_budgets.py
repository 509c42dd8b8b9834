"""Frames within a budget of time, by whichever renderer is best."""

from __future__ import annotations

import time

import pytest
from fastapi.testclient import TestClient

ASKED = {"width": 32, "height": 24, "format": "npy"}


def test_a_budget_lets_the_service_choose_the_renderer(client: TestClient, settled: str) -> None:
    answer = client.get(f"{settled}/frame", params={**ASKED, "budget_ms": 5000})
    assert answer.status_code == 200
    assert answer.headers["X-Renderer"] == "interpolant"
    assert answer.headers["X-Converged"] == "true"
    named = client.get(f"{settled}/frame", params={**ASKED, "budget_ms": 5000, "renderer": "vpl"})
    assert named.headers["X-Renderer"] == "vpl"


def test_the_best_renderer_may_be_asked_for_by_name(client: TestClient, settled: str) -> None:
    answer = client.get(f"{settled}/frame", params={**ASKED, "renderer": "auto", "wait": "max_error=0.1"})
    assert answer.headers["X-Renderer"] in ("interpolant", "vpl")
    assert float(answer.headers["X-Error-Estimate"]) <= 0.1


@pytest.mark.parametrize("layer", ["depth", "element", "false_colour"])
def test_every_layer_can_be_left_to_the_service(client: TestClient, settled: str, layer: str) -> None:
    answer = client.get(
        f"{settled}/frame", params={**ASKED, "format": "png", "renderer": "auto", "layer": layer}
    )
    assert answer.status_code == 200


def test_a_budget_holds(client: TestClient, settled: str) -> None:
    """Of a frame that can never be as good as asked for; drawing and encoding are in the time."""
    asked = {**ASKED, "renderer": "path", "wait": "max_error=1e-6"}
    client.get(f"{settled}/frame", params={**asked, "budget_ms": 300})
    start = time.monotonic()
    answer = client.get(f"{settled}/frame", params={**asked, "budget_ms": 300})
    assert 0.2 < time.monotonic() - start < 3.0
    assert answer.headers["X-Converged"] in ("true", "false")

"""Picks over HTTP: what a pixel shows."""

from __future__ import annotations

import io
import math
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient

from service.schemas import PickAnswer
from solver.types import AnyArray
from tests.service.problem import fields_at_fault, problem_of


def pick(client: TestClient, path: str, **query: Any) -> dict[str, Any]:
    answer = client.get(f"{path}/pick", params=query)
    assert answer.status_code == 200, answer.text
    PickAnswer.model_validate_json(answer.content, strict=True)
    result: dict[str, Any] = answer.json()
    return result


def layer(client: TestClient, path: str, name: str, **query: Any) -> AnyArray:
    answer = client.get(f"{path}/frame", params={"layer": name, "format": "npy", **query})
    image: AnyArray = np.load(io.BytesIO(answer.content))
    return image


def test_a_pick_is_what_the_frame_shows(client: TestClient, settled: str) -> None:
    client.get(f"{settled}/overlays/triangulation", params={"wait": "converged"})
    names = [o["id"] for o in client.get(f"{settled}/scene").json()["scene"]["objects"]]
    shown = {
        name: layer(client, settled, name)
        for name in (
            "object",
            "element",
            "triangle",
            "barycentric",
            "position",
            "normal",
            "depth",
            "radiance",
        )
    }
    irradiance, lux = layer(client, settled, "irradiance"), layer(client, settled, "illuminance")
    for x, y in ((4, 44), (36, 12), (24, 24), (10, 5)):
        found = pick(client, settled, x=x, y=y)
        assert (found["revision"], found["hit"], found["front"]) == (1, True, True)
        assert found["object"] == names[int(shown["object"][y, x, 0])]
        assert found["leaf"] == shown["element"][y, x, 0]
        assert found["triangle"] == shown["triangle"][y, x, 0]
        assert found["barycentric"] == pytest.approx(shown["barycentric"][y, x], abs=1e-5)
        assert found["point"] == pytest.approx(shown["position"][y, x], abs=1e-6)
        assert found["normal"] == pytest.approx(shown["normal"][y, x], abs=1e-6)
        assert found["depth"] == pytest.approx(shown["depth"][y, x, 0], rel=1e-6)
        assert found["irradiance"] == pytest.approx(irradiance[y, x], rel=1e-4, abs=1e-5)
        assert found["illuminance"] == pytest.approx(lux[y, x, 0], rel=1e-4)
        assert np.array(found["radiosity"]) / math.pi == pytest.approx(
            shown["radiance"][y, x], rel=1e-4, abs=1e-5
        )
        assert found["face"] == 0
    assert {pick(client, settled, x=x, y=y)["object"] for x, y in ((4, 44), (36, 12))} == {"floor", "crate"}


def test_backs_are_dark_and_the_background_is_nothing(client: TestClient, settled: str) -> None:
    below = {"eye": "0.9,0.9,-2", "target": "0.9,0.9,0", "up": "0,1,0", "width": 20, "height": 10}
    back = pick(client, settled, x=10, y=5, **below)
    assert (back["object"], back["front"]) == ("floor", False)
    assert back["irradiance"] == back["radiosity"] == [0.0, 0.0, 0.0]
    assert back["normal"] == [0.0, 0.0, 1.0]
    nothing = pick(client, settled, x=0, y=0, camera="side")
    assert nothing["hit"] is False
    assert {value for name, value in nothing.items() if name not in {"revision", "hit"}} == {None}


@pytest.mark.parametrize(
    ("query", "field"),
    [
        ({"y": 0}, "x"),
        ({"x": 0}, "y"),
        ({"x": -1, "y": 0}, "x"),
        ({"x": 48, "y": 0}, "x"),
        ({"x": 0, "y": 48}, "y"),
        ({"x": 0, "y": 1.5}, "y"),
        ({"x": 2**31, "y": 0}, "x"),
        ({"x": 20, "y": 0, "width": 20}, "x"),
        ({"x": 0, "y": 0, "camera": "nope"}, "camera"),
        ({"x": 0, "y": 0, "eye": "1,2"}, "eye"),
        ({"x": 0, "y": 0, "z": 0}, "z"),
    ],
)
def test_the_parameter_at_fault_is_named(
    client: TestClient, settled: str, query: dict[str, Any], field: str
) -> None:
    assert fields_at_fault(client.get(f"{settled}/pick", params=query)) == [["query", field]]


def test_frames_to_pick_from_have_limits(client: TestClient, settled: str) -> None:
    problem_of(client.get(f"{settled}/pick", params={"x": 0, "y": 0, "width": 5000}), 413)

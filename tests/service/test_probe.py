"""Probes over HTTP."""

from __future__ import annotations

from typing import Any

import pytest
from fastapi.testclient import TestClient

from tests.service.problem import fields_at_fault


def test_a_probe_measures_each_point(client: TestClient, settled: str) -> None:
    points = [
        {"position": [0, 0, 0], "normal": [0, 0, 1]},
        {"position": [0, 0, 0], "normal": [0, 0, 25]},
        {"position": [0, 0, 3], "normal": [0, 0, 1]},
    ]
    answer = client.post(f"{settled}/probe", json={"points": points})
    assert answer.status_code == 200
    result = answer.json()
    assert result["revision"] == 1
    lit, same, dark = result["irradiance"]
    assert lit == pytest.approx(same, rel=0.01), "a normal of any length is a direction"
    assert dark == [0, 0, 0], "nothing is above"
    # The lamp, a square of 1 m2 of E = (10, 10, 8), is 2 m above: its form factor is 0.0735.
    assert lit == pytest.approx([0.735, 0.735, 0.588], rel=0.05)
    luminance = 0.2126 * lit[0] + 0.7152 * lit[1] + 0.0722 * lit[2]
    assert result["illuminance"][0] == pytest.approx(179 * luminance, rel=1e-9)
    assert len(result["error_estimate"]) == 3
    assert all(error >= 0.0 for error in result["error_estimate"])


def test_a_probe_of_no_points_is_empty(client: TestClient, settled: str) -> None:
    result = client.post(f"{settled}/probe", json={"points": []}).json()
    assert (result["irradiance"], result["illuminance"], result["error_estimate"]) == ([], [], [])


@pytest.mark.parametrize(
    ("point", "location"),
    [
        ({"position": [0, 0, 0]}, ["normal"]),
        ({"position": [0, 0], "normal": [0, 0, 1]}, ["position"]),
        ({"position": [0, 0, "0"], "normal": [0, 0, 1]}, ["position", 2]),
        ({"position": [0, 0, 0], "normal": [0, 0, 0]}, ["normal"]),
        ({"position": [0, 0, 0], "normal": [0, 0, 5e-324]}, ["normal"]),
        ({"position": [0, 0, 1e300], "normal": [0, 0, 1]}, ["position", 2]),
        ({"position": [0, 0, 0], "normal": [0, 0, 1], "size": 1}, ["size"]),
    ],
)
def test_bad_points_are_named(
    client: TestClient, settled: str, point: dict[str, Any], location: list[str | int]
) -> None:
    good = {"position": [0, 0, 0], "normal": [0, 0, 1]}
    answer = client.post(f"{settled}/probe", json={"points": [good, point]})
    assert fields_at_fault(answer) == [["body", "points", 1, *location]]

"""Bodies that are not what they should be: each gets its 4xx, and leaves the service as it was."""

from __future__ import annotations

import json
from collections.abc import Iterator

import pytest
from fastapi.testclient import TestClient

from service.json_body import parse_json
from tests.engine.scenes import box_document
from tests.service.problem import fields_at_fault, problem_of

JSON = {"Content-Type": "application/json"}


@pytest.mark.parametrize(
    "body",
    [
        b"{",
        b'{"scene": }',
        b"\xff\xfe{}",
        b'{"scene": {"name": "\xc3\x28"}}',
        b'{"scene": {"name": "\\ud800"}}',
        b'{"\\udfff": 1}',
        b'{"scene": {}, "scene": {}}',
        b'{"scene": {"name": "a", "name": "b"}}',
        b"[" * 100_000,
        b'{"a":' * 50_000 + b"1" + b"}" * 50_000,
        b"nul",
        b"{} {}",
    ],
)
def test_what_is_not_json_is_bad_input(client: TestClient, body: bytes) -> None:
    assert fields_at_fault(client.post("/v1/sessions", content=body, headers=JSON)) == [["body"]]


@pytest.mark.parametrize(
    ("text", "location"),
    [
        ("NaN", ["luminous_efficacy"]),
        ("Infinity", ["luminous_efficacy"]),
        ("-Infinity", ["luminous_efficacy"]),
        ("1e999", ["luminous_efficacy"]),
        ("9" * 5000, ["luminous_efficacy"]),
        ("-" + "9" * 400, ["luminous_efficacy"]),
        ("true", ["luminous_efficacy"]),
        ('"179"', ["luminous_efficacy"]),
        ("null", ["luminous_efficacy"]),
    ],
)
def test_numbers_are_finite_numbers(client: TestClient, text: str, location: list[str]) -> None:
    body = b'{"scene": {"luminous_efficacy": ' + text.encode() + b"}}"
    answer = client.post("/v1/sessions", content=body, headers=JSON)
    assert fields_at_fault(answer) == [["body", "scene", *location]]


def test_every_bad_field_is_named_up_to_a_bound(client: TestClient) -> None:
    objects = [{"id": str(n), "mesh": {"vertices": [], "faces": [[]]}} for n in range(100)]
    found = fields_at_fault(client.post("/v1/sessions", json={"scene": {"objects": objects}}))
    assert found[:2] == [["body", "scene", "objects", n, "mesh", "faces", 0] for n in range(2)]
    assert 1 < len(found) < 100


@pytest.mark.parametrize(
    ("field", "values"),
    [
        ("objects", [{"a": 1}, [[]], [7], 7, "x", None, True]),
        ("cameras", [[{}], {"a": []}, {"a": 7}, {"": {}}, 7, "x", None, True]),
        ("name", [[], {}, 7, None, True, "x" * 201]),
        ("luminous_efficacy", [[], {}, "x", None, True]),
    ],
)
def test_a_field_of_another_type_is_named(client: TestClient, field: str, values: list[object]) -> None:
    for value in values:
        locations = fields_at_fault(client.post("/v1/sessions", json={"scene": {field: value}}))
        assert locations
        assert all(location[:3] == ["body", "scene", field] for location in locations)


@pytest.mark.parametrize(
    "media", ["text/plain", "application/x-www-form-urlencoded", "", "application/jsonx"]
)
def test_bodies_are_sent_as_json(client: TestClient, media: str) -> None:
    body = json.dumps({"scene": {}}).encode()
    answer = client.post("/v1/sessions", content=body, headers={"Content-Type": media})
    assert problem_of(answer, 415)["type"] == "urn:halflight:unsupported-media-type"


def test_a_body_is_needed(client: TestClient, settled: str) -> None:
    for path in ("/v1/sessions", f"{settled}/edits", f"{settled}/probe"):
        assert fields_at_fault(client.post(path)) == [["body"]]


def test_large_bodies_are_refused_declared_or_not(client: TestClient) -> None:
    body = b" " * (2**20 + 1)
    problem_of(client.post("/v1/sessions", content=body, headers=JSON), 413)

    def pieces() -> Iterator[bytes]:
        for _ in range(17):
            yield b" " * 2**16

    problem_of(client.post("/v1/sessions", content=pieces(), headers=JSON), 413)
    filling = b" " * (2**20 - 2)
    assert fields_at_fault(client.post("/v1/sessions", content=b"{" + filling + b"}", headers=JSON)) == [
        ["body", "scene"]
    ]


def test_nothing_is_left_of_refused_sessions(client: TestClient, settled: str) -> None:
    before = client.get("/v1/sessions").json()
    scene = box_document()
    scene["objects"][2]["mesh"]["faces"] = [[0, 1, 9]]
    location = ["body", "scene", "objects", 2, "mesh", "faces", 0, 2]
    assert fields_at_fault(client.post("/v1/sessions", json={"scene": scene})) == [location]
    assert client.get("/v1/sessions").json() == before


@pytest.mark.parametrize("method", ["GET", "POST", "PATCH", "DELETE", "PUT"])
@pytest.mark.parametrize("path", ["/nowhere", "/v1/nowhere", "/v1/sessions/x/nowhere", "/v2/sessions"])
def test_there_is_nothing_elsewhere(client: TestClient, method: str, path: str) -> None:
    problem_of(client.request(method, path), 404)


def test_other_methods_are_not_allowed(client: TestClient, settled: str) -> None:
    for method, path in (("PUT", "/v1/sessions"), ("POST", settled), ("GET", f"{settled}/edits")):
        answer = client.request(method, path)
        problem_of(answer, 405)
        assert answer.headers["allow"]


CALLS = [
    ("GET", ""),
    ("DELETE", ""),
    ("GET", "/scene"),
    ("PATCH", "/settings"),
    ("POST", "/edits"),
    ("GET", "/frame"),
    ("POST", "/probe"),
    ("GET", "/events"),
    ("GET", "/pick?x=0&y=0"),
    ("GET", "/overlays"),
    ("GET", "/overlays/mesh"),
    ("POST", "/undo"),
    ("POST", "/redo"),
    ("GET", "/log"),
    ("GET", "/stream"),
]


@pytest.mark.parametrize(("method", "call"), CALLS)
@pytest.mark.parametrize("session", ["none", "..", "%2e%2e", "%00", "é"])
def test_unknown_sessions_are_not_found(client: TestClient, method: str, call: str, session: str) -> None:
    body = {"/edits": {"edits": [{"op": "remove", "id": "a"}]}, "/probe": {"points": []}, "/settings": {}}
    path = f"/v1/sessions/{session}{call}"
    answer = client.request(method, path, json=body.get(call))
    if session == "..":
        assert answer.status_code in {404, 405}, "the client itself has taken the dots away"
    else:
        problem_of(answer, 404)


# --- the parser by itself ---


def test_json_is_read_as_it_says() -> None:
    text = b'{"a": [1, -2.5, 1e3, true, null, "\\ud83d\\ude00 \xc3\xa9"], "b": 12345678901234567890123}'
    value = parse_json(text)
    assert value == {"a": [1, -2.5, 1000.0, True, None, "\U0001f600 é"], "b": 12345678901234567890123.0}
    assert type(value["a"][0]) is int


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b'{"a": 1, "b": 2, "a": 3}', "'a' occurs twice"),
        (b"[" * 10**6, "nested too deeply"),
        (b"\x80", "UTF-8"),
        (b'"\\udc00"', "half a character"),
    ],
)
def test_refusals_say_why(text: bytes, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        parse_json(text)

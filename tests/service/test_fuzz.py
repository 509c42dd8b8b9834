"""Random requests, made from the interface's own description: whatever comes, the answer is one it names."""

from __future__ import annotations

import json
from collections.abc import Iterator
from itertools import chain
from typing import Any, Final

import httpx
import pytest
import schemathesis
from fastapi.testclient import TestClient
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from schemathesis import GenerationMode

from service.app import create_app
from tests.service.apps import app_client
from tests.service.conftest import open_box

DESCRIPTION: Final[dict[str, Any]] = create_app().openapi()
SCHEMA: Final = schemathesis.openapi.from_dict(DESCRIPTION)

OPERATIONS: Final = [
    ("POST", "/v1/sessions"),
    ("POST", "/v1/convert"),
    ("GET", "/v1/sessions/{id}"),
    ("DELETE", "/v1/sessions/{id}"),
    ("PATCH", "/v1/sessions/{id}/settings"),
    ("POST", "/v1/sessions/{id}/edits"),
    ("GET", "/v1/sessions/{id}/frame"),
    ("POST", "/v1/sessions/{id}/probe"),
    ("GET", "/v1/sessions/{id}/pick"),
    ("GET", "/v1/sessions/{id}/lightmap"),
    ("GET", "/v1/sessions/{id}/export"),
    ("GET", "/v1/sessions/{id}/grid"),
    *(
        ("GET", f"/v1/sessions/{{id}}/overlays/{name}")
        for name in (
            "mesh",
            "links",
            "blockers",
            "discontinuities",
            "triangulation",
            "samples",
            "graph",
            "probe",
            "backprojection",
        )
    ),
]

QUICK: Final = settings(
    max_examples=15, deadline=None, derandomize=True, database=None, suppress_health_check=list(HealthCheck)
)

_LONGEST: Final = 10_000
"""Characters of a query; what is much longer is refused by the client already."""


@pytest.fixture(scope="module")
def fuzzed() -> Iterator[tuple[TestClient, str]]:
    """A service with room for one session, which is there, and small frames."""
    with app_client(
        pool_size=0,
        max_sessions=1,
        max_frame_width=64,
        max_frame_height=64,
        max_samples=4,
        max_wait_ms=20,
        max_elements=20_000,
    ) as client:
        path = open_box(client)
        yield client, path
        assert client.get(path).status_code == 200, "the session has come through"


def check(method: str, template: str, answer: httpx.Response) -> None:
    """The answer is one that the description names, and every refusal is a problem."""
    named = DESCRIPTION["paths"][template][method.lower()]["responses"]
    assert str(answer.status_code) in named, f"{answer.status_code}: {answer.text[:500]}"
    assert answer.status_code < 500 or answer.status_code == 501
    if answer.status_code >= 400:
        assert answer.headers["content-type"] == "application/problem+json"
        assert answer.json()["detail"]
        if answer.status_code == 422:
            assert answer.json()["errors"]


@pytest.mark.parametrize("mode", list(GenerationMode), ids=lambda mode: mode.value)
@pytest.mark.parametrize(("method", "template"), OPERATIONS)
def test_requests_of_the_description(
    fuzzed: tuple[TestClient, str], method: str, template: str, mode: GenerationMode
) -> None:
    client, path = fuzzed

    @QUICK
    @given(case=SCHEMA[template][method].as_strategy(generation_mode=mode))
    def run(case: schemathesis.Case[Any]) -> None:
        place = case.formatted_path if method == "DELETE" else template.replace("/v1/sessions/{id}", path)
        sent: dict[str, Any] = {}
        if isinstance(case.body, bytes):
            sent = {"content": case.body, "headers": {"Content-Type": case.media_type or "application/json"}}
        elif case.media_type is not None:
            sent = {"content": json.dumps(case.body), "headers": {"Content-Type": "application/json"}}
        query = _texts(case.query)
        assume(sum(map(len, chain(*query))) < _LONGEST)
        answer = client.request(method, place, params=query, **sent)
        if answer.status_code != 404 or "/v1/sessions" not in place:
            check(method, template, answer)

    run()


def _texts(query: Any) -> list[tuple[str, str]]:
    """The parameters as text, each as often as it is given."""
    pairs = [
        (name, value if isinstance(value, list) else [value]) for name, value in dict(query or {}).items()
    ]
    return [
        (str(name), str(part).encode("utf-8", "replace").decode()) for name, parts in pairs for part in parts
    ]


numbers = st.integers() | st.floats() | st.sampled_from([0, -1, 1e308, -1e308, 2**63, 10**40, 5e-324])
names = st.sampled_from(
    ["scene", "settings", "objects", "id", "mesh", "vertices", "faces", "material", "transform", "matrix"]
) | st.text(max_size=4)
values = st.recursive(
    st.none() | st.booleans() | numbers | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=5) | st.dictionaries(names, inner, max_size=5),
    max_leaves=20,
)


@pytest.mark.parametrize(
    ("method", "template"), [operation for operation in OPERATIONS if operation[0] in {"POST", "PATCH"}]
)
def test_any_json(fuzzed: tuple[TestClient, str], method: str, template: str) -> None:
    client, path = fuzzed

    @QUICK
    @given(value=values | st.fixed_dictionaries({"scene": values}) | st.fixed_dictionaries({"edits": values}))
    def run(value: object) -> None:
        place = template.replace("/v1/sessions/{id}", path)
        answer = client.request(
            method, place, content=json.dumps(value), headers={"Content-Type": "application/json"}
        )
        check(method, template, answer)

    run()


coordinates = st.floats(-1e9, 1e9, allow_nan=False) | st.sampled_from([0.0, 1.0, -1.0, 1e-9, 1e9])


@st.composite
def meshes(draw: st.DrawFn) -> dict[str, Any]:
    count = draw(st.integers(0, 6))
    vertices = draw(st.lists(st.lists(coordinates, min_size=3, max_size=3), min_size=count, max_size=count))
    index = st.integers(0, max(0, count - 1))
    faces = draw(st.lists(st.lists(index, min_size=3, max_size=5), max_size=4)) if count else []
    return {"vertices": vertices, "faces": faces}


def test_any_shape_can_be_solved_and_drawn(fuzzed: tuple[TestClient, str]) -> None:
    """Faces of no area, crossing themselves, of any size, anywhere: an edit that is taken can be drawn."""
    client, path = fuzzed

    @QUICK
    @given(mesh=meshes())
    def run(mesh: dict[str, Any]) -> None:
        edits = {"edits": [{"op": "set_mesh", "id": "crate", "mesh": mesh}]}
        answer = client.post(f"{path}/edits", json=edits)
        check("POST", "/v1/sessions/{id}/edits", answer)
        frame = client.get(f"{path}/frame", params={"wait": "converged", "width": 16, "height": 16})
        assert frame.status_code == 200, frame.text
        assert client.get(path).json()["state"] != "failed"

    run()

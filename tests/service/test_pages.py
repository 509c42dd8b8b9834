"""Health, metrics, the description of the interface, and the page."""

from __future__ import annotations

import re

import pytest
from fastapi.testclient import TestClient
from prometheus_client.parser import text_string_to_metric_families

from service import openapi
from service.app import create_app

OVERLAYS = (
    "mesh", "links", "blockers", "discontinuities", "triangulation", "samples", "graph", "probe",
    "backprojection",
)  # fmt: skip


def test_health(client: TestClient) -> None:
    answer = client.get("/healthz")
    assert answer.status_code == 200
    assert answer.json()["status"] == "ok"


def test_metrics_count_what_happens(client: TestClient, settled: str) -> None:
    def sample(name: str, **labels: str) -> float:
        answer = client.get("/metrics")
        assert answer.headers["content-type"].startswith("text/plain")
        return sum(
            sample.value
            for family in text_string_to_metric_families(answer.text)
            for sample in family.samples
            if sample.name == name and labels.items() <= sample.labels.items()
        )

    frames = sample("halflight_frame_draw_seconds_count", renderer="flat")
    refused = sample("halflight_request_seconds_count", status="422")
    assert sample("halflight_sessions") >= 1
    client.get(f"{settled}/frame", params={"renderer": "flat"})
    client.get(f"{settled}/frame", params={"renderer": "nothing"})
    assert sample("halflight_frame_draw_seconds_count", renderer="flat") == frames + 1
    assert sample("halflight_request_seconds_count", status="422") == refused + 1
    # Ids make no series of their own.
    assert settled.rpartition("/")[2] not in client.get("/metrics").text
    assert sample("halflight_request_seconds_count", route="/v1/sessions/{id}/frame", method="GET") > 0


def test_the_written_description_is_that_of_the_code() -> None:
    assert openapi.main(["--check"]) == 0, "run `make openapi`"


def test_the_description_names_every_call_and_its_problems() -> None:
    schema = create_app().openapi()
    calls = {(method, path) for path, methods in schema["paths"].items() for method in methods}
    assert calls == {
        ("get", "/healthz"),
        ("get", "/metrics"),
        ("get", "/v1/scenes"),
        ("post", "/v1/sessions"),
        ("get", "/v1/sessions"),
        ("get", "/v1/sessions/{id}"),
        ("delete", "/v1/sessions/{id}"),
        ("get", "/v1/sessions/{id}/scene"),
        ("patch", "/v1/sessions/{id}/settings"),
        ("post", "/v1/sessions/{id}/edits"),
        ("post", "/v1/sessions/{id}/undo"),
        ("post", "/v1/sessions/{id}/redo"),
        ("post", "/v1/convert"),
        ("get", "/v1/sessions/{id}/export"),
        ("get", "/v1/sessions/{id}/grid"),
        ("get", "/v1/sessions/{id}/log"),
        ("get", "/v1/sessions/{id}/snapshot"),
        ("post", "/v1/sessions/{id}/snapshot"),
        ("get", "/v1/sessions/{id}/lightmap"),
        ("get", "/v1/sessions/{id}/frame"),
        ("post", "/v1/sessions/{id}/probe"),
        ("get", "/v1/sessions/{id}/events"),
        ("get", "/v1/sessions/{id}/pick"),
        ("get", "/v1/sessions/{id}/overlays"),
        *(("get", f"/v1/sessions/{{id}}/overlays/{name}") for name in OVERLAYS),
    }
    for methods in schema["paths"].values():
        for operation in methods.values():
            for status, response in operation["responses"].items():
                if int(status) >= 400:
                    assert list(response["content"]) == ["application/problem+json"]
    assert "HTTPValidationError" not in schema["components"]["schemas"]


def test_the_description_is_served(client: TestClient) -> None:
    assert client.get("/openapi.json").json()["info"]["title"] == "halflight"
    assert "text/html" in client.get("/docs").headers["content-type"]


def test_the_page_holds_together(client: TestClient) -> None:
    page = client.get("/")
    assert page.headers["content-type"] == "text/html; charset=utf-8"
    policy = page.headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    assert client.get("/page/page.css").headers["content-type"].startswith("text/css")
    # What the page needs is served here, nothing of it is inline, and the scripts find its elements.
    assert set(re.findall(r'(?:src|href)="(/[^"]*)"', page.text)) == {
        "/page/page.css",
        "/page/main.js",
        "/page/icon.svg",
        "/docs",
    }
    assert not re.search(r"<style|<script[^>]*>[^<]|\sstyle=|\son\w+=", page.text)
    scripts = scripts_from(client, "main.js")
    assert {"stream.js", "gizmo.js", "overlays.js"} <= set(scripts)
    ids = set(re.findall(r'\bid="([\w-]+)"', page.text))
    for script in scripts.values():
        assert set(re.findall(r'\bfind\("([\w-]+)"\)', script)) <= ids
        assert not re.search(r"https?://(?!www\.w3\.org/)|\beval\(|innerHTML", script)


def scripts_from(client: TestClient, first: str) -> dict[str, str]:
    """A script and all that it imports, by their names."""
    found: dict[str, str] = {}
    wanted = [first]
    while wanted:
        name = wanted.pop()
        if name not in found:
            answer = client.get(f"/page/{name}")
            assert answer.headers["content-type"].startswith("text/javascript"), name
            found[name] = answer.text
            wanted += re.findall(r'from "\./([\w-]+\.js)"', answer.text)
    return found


@pytest.mark.parametrize("name", ["none.js", "..%2fapp.py", "%2e%2e", "page.css%00", "__init__.py"])
def test_nothing_but_the_page_is_served(client: TestClient, name: str) -> None:
    assert client.get(f"/page/{name}").status_code == 404

"""The stream: frames that follow the view, edits and their answers, and what ends it."""

from __future__ import annotations

import base64
import io
import os
import signal
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient
from prometheus_client.parser import text_string_to_metric_families
from starlette.testclient import WebSocketDenialResponse
from starlette.websockets import WebSocketDisconnect

from tests.service.apps import app_client
from tests.service.conftest import context_of, open_box
from tests.service.problem import problem_of
from tests.service.streams import Received, Viewer, viewing

SIZE = {"width": 64, "height": 48}
REMOVE = {"op": "remove", "id": "crate"}


def move(height: float) -> dict[str, Any]:
    return {"op": "move", "id": "crate", "transform": {"translation": [0.5, 0.5, height]}}


@pytest.fixture
def viewer(client: TestClient, session: str) -> Iterator[Viewer]:
    with viewing(client, session) as viewer:
        yield viewer


# --- frames ---


def test_the_status_comes_first_and_then_frames_until_one_is_converged(
    client: TestClient, session: str, viewer: Viewer
) -> None:
    viewer.say("camera", id="look", format="png", **SIZE)
    frames = viewer.see_until_converged()
    assert viewer.statuses[0]["id"] == session.rpartition("/")[2]
    assert [frame.header["number"] for frame in frames] == list(range(1, len(frames) + 1))
    for frame in frames:
        assert frame.pixels.shape == (48, 64, 3)
        expected = {"id": "look", "revision": 1, "quality": "rest", "media_type": "image/png"}
        assert expected.items() <= frame.header.items()
    assert viewer.nothing_more()


def test_the_frame_at_rest_is_the_one_that_http_gives(client: TestClient, settled: str) -> None:
    for format in ("png", "webp"):
        with viewing(client, settled) as viewer:
            viewer.say("camera", format=format, **SIZE)
            *_, frame = viewer.see_until_converged()
        answer = client.get(f"{settled}/frame", params={"format": "png", "wait": "converged", **SIZE})
        # webp is without loss at rest
        np.testing.assert_array_equal(frame.pixels, Received({}, answer.content).pixels)


def test_a_moving_camera_gets_coarse_frames_of_its_newest_views_and_a_full_one_at_rest(
    client: TestClient, settled: str
) -> None:
    with viewing(client, settled) as viewer:
        seen: list[Received] = []
        for step in range(40):
            viewer.say("camera", id=str(step), eye=[0.01 * step, 0, 1.9], format="jpeg", **SIZE)
            time.sleep(0.01)
            if step % 8 == 7:
                seen.append(viewer.see())
        while seen[-1].header["id"] != "39" or not seen[-1].header["converged"]:
            seen.append(viewer.see())
        moving = [frame.header for frame in seen if frame.header["quality"] == "moving"]
        assert len(moving) >= 2
        assert all(header["width"] <= 64 for header in moving)
        assert any(header["width"] < 64 for header in moving)
        views = [int(frame.header["id"]) for frame in seen]
        assert views == sorted(views)
        assert seen[-1].header["width"] == 64
        assert viewer.nothing_more()


def test_at_most_two_frames_are_on_their_way_and_the_next_is_of_the_newest_view(
    client: TestClient, settled: str
) -> None:
    with viewing(client, settled) as viewer:
        for step in range(2):
            viewer.say("camera", id=str(step), eye=[0.1 * step, 0, 1.9], **SIZE)
            kept = viewer.see(acknowledged=False)
            time.sleep(0.2)  # longer than what is called motion
        for step in range(2, 6):
            viewer.say("camera", id=str(step), eye=[0.1 * step, 0, 1.9], **SIZE)
            assert viewer.nothing_more()
            time.sleep(0.2)
        viewer.acknowledge(kept)
        assert viewer.see().header["id"] == "5"


def test_viewers_have_their_own_cameras(client: TestClient, settled: str) -> None:
    with viewing(client, settled) as one, viewing(client, settled) as other:
        one.say("camera", format="png", **SIZE)
        other.say("camera", camera="side", format="png")
        assert one.see().pixels.shape == (48, 64, 3)
        assert other.see().pixels.shape == (24, 32, 3)


def test_a_client_that_takes_nothing_holds_nobody_up(client: TestClient, session: str) -> None:
    with viewing(client, session) as idle, viewing(client, session) as keen:
        idle.say("camera", **SIZE)
        keen.say("camera", **SIZE)
        for revision in range(2, 12):
            keen.say("edits", edits=[move(0.05 * revision)])
            assert keen.hear("edited")["revision"] == revision
        assert keen.see_until_converged()[-1].header["revision"] == 11
        # The one that took nothing was sent two, and catches up when it wants to.
        assert [idle.see(acknowledged=False).header["number"] for _ in range(2)] == [1, 2]
        assert idle.nothing_more()
        idle.say("ack", number=2)
        assert idle.see().header["revision"] == 11


def test_false_colours_come_with_their_scale(client: TestClient, settled: str) -> None:
    lux = client.get(f"{settled}/frame", params={"layer": "illuminance", "format": "npy", **SIZE})
    brightest = float(np.load(io.BytesIO(lux.content)).max())
    with viewing(client, settled) as viewer:
        viewer.say("camera", layer="false_colour", format="png", **SIZE)
        own = viewer.see()
        assert 0.5 * brightest < own.header["scale_maximum"] <= brightest
        viewer.say("camera", layer="false_colour", scale_maximum=10 * brightest, format="png", **SIZE)
        given = viewer.see()
        assert given.header["scale_maximum"] == pytest.approx(10 * brightest)
        assert given.pixels.mean() < own.pixels.mean()
        viewer.say("camera", format="png", **SIZE)
        assert viewer.see().header["scale_maximum"] is None


@pytest.mark.parametrize("renderer", ["flat", "gouraud", "vpl", "path", "gather"])
def test_every_renderer_streams(client: TestClient, settled: str, renderer: str) -> None:
    with viewing(client, settled) as viewer:
        viewer.say("camera", renderer=renderer, width=16, height=12)
        frame = viewer.see()
        if renderer in {"path", "gather"}:
            # Slow ones are announced by a coarse frame.
            assert (frame.header["quality"], frame.header["width"] < 16) == ("moving", True)
        while frame.header["quality"] == "moving":
            frame = viewer.see()
        assert (frame.header["renderer"], frame.header["width"]) == (renderer, 16)
        assert frame.pixels.max() > 50


# --- edits ---


def test_edits_are_answered_and_everybody_sees_them(client: TestClient, session: str, viewer: Viewer) -> None:
    with viewing(client, session) as other:
        other.say("camera", **SIZE)
        other.see_until_converged()
        viewer.say("edits", id="lift", edits=[move(1.0)], if_revision=1)
        answer = viewer.hear("edited")
        assert (answer["id"], answer["revision"]) == ("lift", 2)
        assert [change["op"] for change in answer["changes"]] == ["move"]
        frame = other.see()
        assert frame.header["revision"] == 2
    viewer.say("undo", id="back")
    assert (answer := viewer.hear("edited"))["revision"] == 3
    assert answer["id"] == "back"
    viewer.say("redo")
    assert viewer.hear("edited")["revision"] == 4
    assert client.get(session).json()["revision"] == 4


@pytest.mark.parametrize(
    ("text", "location"),
    [
        ("no json", ["message"]),
        ("[1]", ["message"]),
        ('{"id": "x"}', ["message", "type"]),
        ('{"type": "fly"}', ["message", "type"]),
        ('{"type": "camera", "eye": [0, 0]}', ["message", "eye"]),
        ('{"type": "camera", "eye": [0, 0, NaN]}', ["message", "eye", 2]),
        ('{"type": "camera", "zoom": 2}', ["message", "zoom"]),
        ('{"type": "camera", "format": "exr"}', ["message", "format"]),
        ('{"type": "camera", "camera": "nowhere"}', ["message", "camera"]),
        ('{"type": "ack", "number": 99}', ["message", "number"]),
        ('{"type": "edits", "edits": []}', ["message", "edits"]),
        ('{"type": "edits", "edits": [{"op": "turn"}]}', ["message", "edits", 0, "op"]),
        ('{"type": "edits", "edits": [{"op": "remove"}]}', ["message", "edits", 0, "id"]),
        ('{"type": "edits", "edits": [{"op": "remove", "id": "ghost"}]}', ["message", "edits", 0, "id"]),
    ],
)
def test_a_bad_message_names_its_field_and_changes_nothing(
    client: TestClient, settled: str, text: str, location: list[str | int]
) -> None:
    with viewing(client, settled) as viewer:
        viewer.say_text(text)
        problem = viewer.hear("error")["problem"]
        assert problem["status"] == 422
        assert location in [error["loc"] for error in problem["errors"]]
        viewer.say("ping", id="still there")
        assert viewer.hear("pong")["id"] == "still there"


def test_refusals_of_state_come_as_problems(client: TestClient, session: str, viewer: Viewer) -> None:
    viewer.say("undo", id="u")
    answer = viewer.hear("error")
    assert (answer["id"], answer["problem"]["status"]) == ("u", 409)
    viewer.say("edits", id="e", edits=[REMOVE], if_revision=7)
    answer = viewer.hear("error")
    assert answer["id"] == "e"
    assert answer["problem"]["type"] == "urn:halflight:revision-conflict"
    viewer.say("camera", id="c", width=100_000, height=10)
    answer = viewer.hear("error")
    assert (answer["id"], answer["problem"]["status"]) == ("c", 413)
    assert client.get(session).json()["revision"] == 1


def test_binary_messages_are_refused(client: TestClient, settled: str) -> None:
    with client.websocket_connect(f"{settled}/stream") as socket:
        socket.send_bytes(b"\x00")
        while (message := socket.receive_json())["type"] == "status":
            pass
        assert message["problem"]["status"] == 422


# --- who may, and what ends it ---


def test_a_plain_request_is_told_to_upgrade(client: TestClient, settled: str) -> None:
    answer = client.get(f"{settled}/stream")
    assert problem_of(answer, 426)["type"] == "urn:halflight:upgrade-required"
    assert answer.headers["upgrade"] == "websocket"


def denied(client: TestClient, path: str, **headers: str) -> WebSocketDenialResponse:
    with pytest.raises(WebSocketDenialResponse) as refusal, viewing(client, path, **headers):
        pass
    return refusal.value


def test_no_stream_of_no_session_or_for_other_pages(client: TestClient, settled: str) -> None:
    answer = denied(client, "/v1/sessions/none")
    assert answer.status_code == 404
    assert answer.headers["content-type"] == "application/problem+json"
    assert denied(client, settled, origin="https://elsewhere.example").status_code == 403
    with viewing(client, settled, origin="http://testserver"):
        pass


def test_a_stream_ends_with_its_session(client: TestClient) -> None:
    path = open_box(client)
    with viewing(client, path) as viewer:
        viewer.say("camera", **SIZE)
        viewer.see()
        assert client.delete(path).status_code == 204
        with pytest.raises(WebSocketDisconnect) as end:
            while True:
                viewer.see()
    assert end.value.code == 4410


def test_a_stream_outlasts_a_worker(client: TestClient) -> None:
    path = open_box(client)
    worker = context_of(client).sessions.find(path.rpartition("/")[2]).worker
    with viewing(client, path) as viewer:
        viewer.say("camera", **SIZE)
        viewer.see()
        os.kill(worker.pid, signal.SIGKILL)
        viewer.say("edits", id="e", edits=[{"op": "remove", "id": "crate"}])
        assert viewer.hear("edited")["revision"] == 2
        viewer.say("camera", id="after", **SIZE)
        while (seen := viewer.see()).header["id"] != "after":
            pass
        assert seen.header["revision"] == 2
    assert client.delete(path).status_code == 204


@pytest.fixture(scope="module")
def strict() -> Iterator[tuple[TestClient, str]]:
    """A service that asks for a token, and has little patience."""
    limits = {"max_message_bytes": 1000, "stream_idle_seconds": 0.5}
    with app_client(token="sesame", pool_size=0, **limits) as client:
        client.headers["Authorization"] = "Bearer sesame"
        path = open_box(client)
        del client.headers["Authorization"]
        yield client, path


def test_a_token_comes_in_a_header_or_as_a_subprotocol(strict: tuple[TestClient, str]) -> None:
    client, path = strict
    wrong = base64.urlsafe_b64encode(b"wrong").decode()
    for headers in (
        {},
        {"authorization": "Bearer wrong"},
        {"sec-websocket-protocol": "bearer.%%"},
        {"sec-websocket-protocol": f"halflight.v1, bearer.{wrong}"},
    ):
        assert denied(client, path, **headers).status_code == 401
    with viewing(client, path, authorization="Bearer sesame") as viewer:
        assert viewer.nothing_more()
    token = base64.urlsafe_b64encode(b"sesame").decode().rstrip("=")
    protocols = ["halflight.v1", f"bearer.{token}"]
    with client.websocket_connect(f"{path}/stream", subprotocols=protocols) as socket:
        assert socket.accepted_subprotocol == "halflight.v1"


@pytest.mark.parametrize(("text", "code"), [("x" * 1001, 1009), (None, 4408)])
def test_large_messages_and_long_silence_end_a_stream(
    strict: tuple[TestClient, str], text: str | None, code: int
) -> None:
    client, path = strict
    with viewing(client, path, authorization="Bearer sesame") as viewer:
        if text is not None:
            viewer.say_text(text)
        with pytest.raises(WebSocketDisconnect) as end:
            while True:
                viewer.see()
    assert end.value.code == code


def test_metrics_tell_of_streams(client: TestClient, settled: str) -> None:
    def sample(name: str, **labels: str) -> float:
        return sum(
            sample.value
            for family in text_string_to_metric_families(client.get("/metrics").text)
            for sample in family.samples
            if sample.name == name and labels.items() <= sample.labels.items()
        )

    names = (
        "halflight_stream_frames_total",
        "halflight_stream_bytes_total",
        "halflight_stream_latency_seconds_count",
        "halflight_stream_round_trip_seconds_count",
    )
    before = [sample(name) for name in names]
    clients = sample("halflight_stream_clients")
    with viewing(client, settled) as viewer:
        viewer.say("camera", **SIZE)
        frame = viewer.see()
        assert viewer.nothing_more()
        assert sample("halflight_stream_clients") == clients + 1
        grown = [sample(name) - old for name, old in zip(names, before, strict=True)]
    assert grown == [1.0, len(frame.content), 1.0, 1.0]

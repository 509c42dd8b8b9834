"""A service in its own process: events as they come, several sessions at once, workers that die, the end."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import pytest

from tests.service.apps import Served
from tests.service.problem import problem_of
from tests.service.processes import PATIENCE, children_of, eventually, is_running

LOOSE = {"error_tolerance": 0.05}
ENDLESS = {"error_tolerance": 1e-6, "max_elements": 2_000_000}


@dataclass(frozen=True)
class Service(Served):
    """A service in a process of its own."""

    process: subprocess.Popen[str]

    def workers(self) -> set[int]:
        """Process ids of its workers."""
        return {worker for nursery in self.nurseries() for worker in children_of(nursery)}

    def nurseries(self) -> set[int]:
        """Process ids of what its workers are forked from: one, or none."""
        return children_of(self.process.pid)


@contextmanager
def running(**environment: str) -> Iterator[Service]:
    process = subprocess.Popen(
        [sys.executable, "-m", "service.server"],
        env={**os.environ, "HALFLIGHT_PORT": "0", "HALFLIGHT_POOL_SIZE": "1", **environment},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stdout is not None
        told = process.stdout.readline()
        address = re.search(r"http://127\.0\.0\.1:\d+", told)
        assert address is not None, f"told {told!r}, and {process.communicate()[1]}"
        with httpx.Client(base_url=address[0], timeout=PATIENCE) as http:
            yield Service(http, process)
    finally:
        process.kill()
        process.communicate()


@pytest.fixture(scope="module")
def service() -> Iterator[Service]:
    with running() as service:
        yield service


def events(lines: Iterator[str]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Names and data of Server-Sent Events."""
    name = ""
    for line in lines:
        field, _, value = line.partition(": ")
        if field == "event":
            name = value
        elif field == "data":
            yield name, json.loads(value)


def test_it_is_healthy_once_it_has_told_its_address(service: Service) -> None:
    assert service.http.get("/healthz").status_code == 200


def test_events_tell_every_change_of_status_until_the_end(service: Service) -> None:
    path = service.open(LOOSE | {"error_tolerance": 0.01})
    with service.http.stream("GET", f"{path}/events") as stream:
        assert stream.headers["content-type"].startswith("text/event-stream")
        told = events(stream.iter_lines())
        statuses = []
        for name, status in told:
            assert name == "status"
            statuses.append(status)
            if status["state"] == "converged":
                break
        assert all(status["id"] == path.rpartition("/")[2] for status in statuses)
        progress = [status["progress"] for status in statuses]
        assert progress == sorted(progress)
        assert progress[-1] == 1.0
        edits = {"edits": [{"op": "remove", "id": "crate"}]}
        assert service.http.post(f"{path}/edits", json=edits).json()["revision"] == 2
        name, status = next(told)
        assert (name, status["revision"], status["state"]) == ("status", 2, "solving")
        assert service.http.delete(path).status_code == 204
        *_, last = told
        assert last == ("end", {})


def test_a_listener_that_comes_late_gets_the_status_at_once(service: Service) -> None:
    path = service.open(LOOSE)
    service.http.get(f"{path}/frame", params={"wait": "converged"})
    with service.http.stream("GET", f"{path}/events") as stream:
        name, status = next(events(stream.iter_lines()))
    assert (name, status["state"]) == ("status", "converged")
    assert service.http.delete(path).status_code == 204


@pytest.mark.slow
def test_sessions_are_solved_side_by_side(service: Service) -> None:
    answers: dict[int, httpx.Response] = {}

    def client(number: int) -> None:
        path = service.open(LOOSE)
        edit = {"op": "set_material", "id": "lamp", "material": {"emission": [number, 0, 0]}}
        service.http.post(f"{path}/edits", json={"edits": [edit]})
        answers[number] = service.http.get(f"{path}/frame", params={"wait": "converged", "format": "npy"})
        service.http.delete(path)

    clients = [threading.Thread(target=client, args=(number,)) for number in (1, 2, 4)]
    for thread in clients:
        thread.start()
    for thread in clients:
        thread.join(PATIENCE)
    assert {number: answer.status_code for number, answer in answers.items()} == {1: 200, 2: 200, 4: 200}
    assert all(answer.headers["x-converged"] == "true" for answer in answers.values())
    assert len({answer.content for answer in answers.values()}) == 3


def test_an_edit_is_answered_while_a_frame_waits_for_the_solve(service: Service) -> None:
    path = service.open(ENDLESS)
    frames: list[httpx.Response] = []
    query: dict[str, str | int] = {"wait": "converged", "timeout_ms": 1500}
    waiting = threading.Thread(target=lambda: frames.append(service.http.get(f"{path}/frame", params=query)))
    waiting.start()
    for revision in range(2, 7):
        edits = {
            "edits": [{"op": "move", "id": "crate", "transform": {"translation": [0, 0, 0.1 * revision]}}]
        }
        assert service.http.post(f"{path}/edits", json=edits).json()["revision"] == revision
        assert waiting.is_alive()
    waiting.join(PATIENCE)
    assert frames[0].status_code == 200
    assert frames[0].headers["x-revision"] == "6"
    assert frames[0].headers["x-converged"] == "false"
    assert service.http.delete(path).status_code == 204


def test_a_client_that_hangs_up_leaves_nothing_behind(service: Service) -> None:
    path = service.open(ENDLESS)
    with pytest.raises(httpx.ReadTimeout):
        service.http.get(f"{path}/frame", params={"wait": "converged"}, timeout=0.3)
    gone = re.compile(r'halflight_request_seconds_count.*status="499"} 1')
    assert eventually(lambda: gone.search(service.http.get("/metrics").text) is not None)
    assert service.http.get(f"{path}/frame").status_code == 200
    assert service.http.delete(path).status_code == 204


def test_a_session_outlasts_its_worker(service: Service) -> None:
    assert eventually(lambda: "halflight_warm_workers 1.0" in service.http.get("/metrics").text)
    assert eventually(lambda: len(service.workers()) == 1)
    (worker,) = service.workers()
    lost = service.open(ENDLESS)
    kept = service.open(LOOSE)
    answers: list[httpx.Response] = []
    query: dict[str, str | int] = {"wait": "converged", "timeout_ms": 8000}
    waiting = threading.Thread(target=lambda: answers.append(service.http.get(f"{lost}/frame", params=query)))
    waiting.start()
    with service.http.stream("GET", f"{lost}/events") as stream:
        told = events(stream.iter_lines())
        assert next(told)[0] == "status"
        os.kill(worker, signal.SIGKILL)
        edits = {"edits": [{"op": "remove", "id": "crate"}]}
        assert service.http.post(f"{lost}/edits", json=edits).json()["revision"] == 2
        assert any(status["revision"] == 2 for _, status in told), "the stream of events goes on"
    waiting.join(PATIENCE)
    assert [answer.status_code for answer in answers] == [200]
    assert answers[0].headers["x-converged"] == "false"
    listed = {s["id"]: s["revision"] for s in service.http.get("/v1/sessions").json()["sessions"]}
    assert listed == {lost.rpartition("/")[2]: 2, kept.rpartition("/")[2]: 1}
    assert "halflight_workers_lost_total 1.0" in service.http.get("/metrics").text
    for path in (lost, kept):
        assert service.http.delete(path).status_code == 204
        assert service.http.get(path).status_code == 404


def test_workers_end_when_the_service_is_killed() -> None:
    with running() as service:
        service.open(ENDLESS)
        assert eventually(lambda: len(service.workers()) == 2)
        workers = service.workers()
        service.process.kill()
        service.process.wait(PATIENCE)
        assert eventually(lambda: not any(map(is_running, workers)))


@pytest.mark.parametrize("number", [signal.SIGTERM, pytest.param(signal.SIGINT, marks=pytest.mark.slow)])
def test_it_ends_at_a_signal_without_a_word(number: signal.Signals) -> None:
    with running() as service:
        path = service.open(ENDLESS)
        workers = service.workers()
        with service.http.stream("GET", f"{path}/events") as stream:
            told = events(stream.iter_lines())
            assert next(told)[0] == "status"
            # A terminal's interrupt goes to every process of the group.
            for pid in (service.process.pid, *workers):
                os.kill(pid, number)
            *_, last = told
        assert last[0] == "end"
        service.process.wait(PATIENCE)
        assert service.process.stderr is not None
        assert service.process.stderr.read() == ""
        assert not any(map(is_running, workers))


def test_without_opengl_all_but_frames_work(tmp_path: Path) -> None:
    # No driver is found where none is listed.
    with running(__EGL_VENDOR_LIBRARY_FILENAMES=str(tmp_path / "none.json")) as service:
        path = service.open(LOOSE)
        problem = problem_of(service.http.get(f"{path}/frame"), 503)
        assert problem["type"] == "urn:halflight:no-rendering"
        assert "OpenGL" in problem["detail"]
        assert "\n" not in problem["detail"]
        traced = service.http.get(f"{path}/frame", params={"renderer": "path", "wait": "converged"})
        assert traced.status_code == 200
        assert service.http.get(f"{path}/overlays/mesh?wait=converged").status_code == 200
        for drawn in ("frame", "pick?x=0&y=0", "overlays/triangulation"):
            problem_of(service.http.get(f"{path}/{drawn}"), 503)
        assert service.http.get(path).status_code == 200
        assert service.http.get(f"{path}/scene").status_code == 200
        assert service.http.delete(path).status_code == 204

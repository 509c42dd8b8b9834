"""Sessions survive what ends their processes: every edit that was acknowledged is there afterwards."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import threading
import time
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import httpx
import pytest

from tests.service.problem import problem_of
from tests.service.processes import PATIENCE, eventually
from tests.service.test_server import LOOSE, Service, running


def move(x: float) -> dict[str, Any]:
    return {"op": "move", "id": "crate", "transform": {"translation": [x, 0.5, 0.5]}}


def paint(grey: float) -> dict[str, Any]:
    return {"op": "set_material", "id": "floor", "material": {"reflectance": [grey] * 3}}


def everything_of(service: Service, path: str) -> dict[str, Any]:
    """What must be the same afterwards."""
    scene = service.http.get(f"{path}/scene").json()
    log = service.http.get(f"{path}/log").json()
    entries = [[entry[name] for name in ("entry", "revision", "op", "id")] for entry in log["entries"]]
    settings = service.http.get(path).json()["settings"]
    return {"scene": scene, "log": entries, "settings": settings}


def edit(service: Service, path: str, *edits: dict[str, Any]) -> int:
    answer = service.http.post(f"{path}/edits", json={"edits": list(edits)})
    assert answer.status_code == 200, answer.text
    return int(answer.json()["revision"])


@pytest.fixture
def directory(tmp_path: Path) -> Path:
    return tmp_path / "state" / "halflight"


def keeping(directory: Path) -> AbstractContextManager[Service]:
    """A service that keeps its sessions there, and is patient where the machine is busy."""
    return running(HALFLIGHT_DATA_DIR=str(directory), HALFLIGHT_WAKE_SECONDS=str(PATIENCE))


def lead_a_life(service: Service) -> str:
    """The path of a session with a history."""
    path = service.open(LOOSE)
    edit(service, path, paint(0.2), move(0.1))
    edit(service, path, move(0.2))
    edit(service, path, {"op": "remove", "id": "crate"})
    assert service.http.post(f"{path}/undo").json()["revision"] == 5
    assert service.http.post(f"{path}/undo").json()["revision"] == 6
    assert service.http.post(f"{path}/redo").json()["revision"] == 7
    assert service.http.patch(f"{path}/settings", json={"error_tolerance": 0.04}).status_code == 200
    problem_of(service.http.post(f"{path}/edits", json={"edits": [{"op": "remove", "id": "nobody"}]}), 422)
    problem_of(service.http.post(f"{path}/edits", json={"if_revision": 3, "edits": [move(1)]}), 409)
    return path


@pytest.mark.slow
def test_all_of_it_is_there_after_a_kill_of_the_worker_and_of_the_service(directory: Path) -> None:
    with keeping(directory) as service:
        (warm,) = service.workers()
        path = lead_a_life(service)
        before = everything_of(service, path)
        frame = service.http.get(f"{path}/frame", params={"wait": "converged"})
        os.kill(warm, signal.SIGKILL)
        assert everything_of(service, path) == before
        again = service.http.get(
            f"{path}/frame", params={"wait": "converged"}, headers={"If-None-Match": frame.headers["etag"]}
        )
        assert again.status_code == 200, "a picture of another process is another picture"
        gone = service.open(LOOSE)
        assert service.http.delete(gone).status_code == 204
        service.process.kill()
        service.process.wait(PATIENCE)
    with keeping(directory) as service:
        (listed,) = service.http.get("/v1/sessions").json()["sessions"]
        assert (listed["id"], listed["revision"], listed["awake"]) == (path.rpartition("/")[2], 7, False)
        assert listed["settings"]["error_tolerance"] == 0.04
        assert everything_of(service, path) == before
        assert service.http.post(f"{path}/redo").json()["revision"] == 8
        for revision in (9, 10, 11):
            assert service.http.post(f"{path}/undo").json()["revision"] == revision
        problem_of(service.http.post(f"{path}/undo"), 409)
        problem_of(service.http.get(gone), 404)
        last = everything_of(service, path)
        service.process.send_signal(signal.SIGTERM)
        service.process.wait(PATIENCE)
    with keeping(directory) as service:
        assert everything_of(service, path) == last
        assert service.http.delete(path).status_code == 204
        service.process.kill()
        service.process.wait(PATIENCE)
    with keeping(directory) as service:
        assert service.http.get("/v1/sessions").json() == {"sessions": []}


@pytest.mark.slow
def test_two_services_do_not_share_a_directory(directory: Path) -> None:
    with keeping(directory):
        second = subprocess.run(
            [sys.executable, "-m", "halflight", "serve", "--port", "0"],
            env={**os.environ, "HALFLIGHT_DATA_DIR": str(directory)},
            capture_output=True,
            text=True,
            timeout=PATIENCE,
        )
    assert second.returncode != 0
    assert "another service" in second.stderr
    assert "Traceback" not in second.stderr


class Editor(threading.Thread):
    """A client that edits one session, and remembers what was acknowledged."""

    def __init__(self, service: Service, seed: int) -> None:
        super().__init__()
        self.path = service.open(LOOSE)
        self.acknowledged: dict[str, float] = {}
        self.unsure: dict[str, float] = {}
        self.answers: dict[int, int] = {}
        self.revision = 1
        self.refusal = ""
        self.stop = threading.Event()
        self._service = service
        self._chance = random.Random(seed)

    def run(self) -> None:
        number = 0
        with httpx.Client(base_url=self._service.http.base_url, timeout=PATIENCE) as http:
            while not self.stop.is_set():
                number += 1
                what = self._chance.choice(["floor", "crate"])
                grey = round(self._chance.uniform(0.1, 0.9), 6)
                change = {"op": "set_material", "id": what, "material": {"reflectance": [grey] * 3}}
                try:
                    answer = http.post(f"{self.path}/edits", json={"edits": [change]})
                except httpx.TransportError:  # the service itself was killed
                    self.unsure = {what: grey}
                    return
                if answer.status_code == 200:
                    self.acknowledged[what] = grey
                    self.revision = answer.json()["revision"]
                self.answers[answer.status_code] = self.answers.get(answer.status_code, 0) + 1
                if answer.status_code != 200:
                    self.refusal = answer.text

    def check(self, service: Service) -> None:
        """Every acknowledged edit is there, and at most the one more whose answer was lost."""
        answer = service.http.get(f"{self.path}/scene").json()
        found = {o["id"]: o["material"]["reflectance"][0] for o in answer["scene"]["objects"]}
        more = answer["revision"] - self.revision
        assert 0 <= more <= len(self.unsure)
        expected = {**self.acknowledged, **self.unsure} if more else self.acknowledged
        assert {what: found[what] for what in expected} == expected


@pytest.mark.slow
def test_no_acknowledged_edit_is_lost_under_load(directory: Path) -> None:
    chance = random.Random(7)
    with keeping(directory) as service:
        editors = [Editor(service, seed) for seed in range(3)]
        for editor in editors:
            editor.start()
        for _ in range(4):
            time.sleep(0.7)
            lost = chance.choice(sorted(service.workers()))
            os.kill(lost, signal.SIGKILL)
        time.sleep(1.0)
        service.process.kill()
        service.process.wait(PATIENCE)
        for editor in editors:
            editor.join(PATIENCE)
    for editor in editors:
        assert set(editor.answers) == {200}, editor.refusal
        assert editor.answers[200] > 5
    with keeping(directory) as service:
        assert eventually(lambda: len(service.http.get("/v1/sessions").json()["sessions"]) == 3)
        for editor in editors:
            editor.check(service)

"""Light is kept beside the journal: it need not be solved anew, and takes no more than its room."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from service.hosting.light_keeping import LightKeeper, LightPlace
from service.journal.lights import Lights
from tests.service.apps import app_client
from tests.service.conftest import context_of, open_box
from tests.service.processes import eventually

VIEW: dict[str, Any] = {"width": 48, "height": 32, "format": "npy", "renderer": "flat"}


def light_of(directory: Path, path: str) -> Path:
    return directory / "light" / f"{path.rpartition('/')[2]}.light"


def kill_worker(client: TestClient, path: str) -> None:
    os.kill(context_of(client).sessions.find(path.rpartition("/")[2]).worker.pid, signal.SIGKILL)


def settle(client: TestClient, path: str) -> bytes:
    return bytes(client.get(f"{path}/frame", params={**VIEW, "wait": "converged"}).content)


@pytest.fixture
def client(tmp_path: Path) -> Iterator[TestClient]:
    with app_client(data_dir=tmp_path, pool_size=1) as client:
        yield client


def test_a_session_that_lost_its_worker_need_not_solve_anew(client: TestClient, tmp_path: Path) -> None:
    path = open_box(client)
    before, light = settle(client, path), light_of(tmp_path, path)
    assert eventually(light.exists)
    kill_worker(client, path)
    # No step was taken: what was kept was solved.
    status = client.get(path).json()
    assert (status["state"], status["statistics"]["gathers"] > 0) == ("converged", True)
    assert status["statistics"]["seconds"] < 0.01
    assert settle(client, path) == before
    # What follows is kept in its place.
    written = light.stat().st_mtime_ns
    moved = [{"op": "move", "id": "crate", "transform": {"translation": [0.5, 0.4, 0.5]}}]
    assert client.post(f"{path}/edits", json={"edits": moved}).status_code == 200
    after = settle(client, path)
    assert after != before
    assert eventually(lambda: light.stat().st_mtime_ns > written)
    kill_worker(client, path)
    assert client.get(path).json()["state"] == "converged"
    assert settle(client, path) == after
    assert client.delete(path).status_code == 204
    assert not light.exists()


def test_it_is_there_for_the_next_service(tmp_path: Path) -> None:
    with app_client(data_dir=tmp_path, pool_size=0) as client:
        path = open_box(client)
        before = settle(client, path)
        assert eventually(light_of(tmp_path, path).exists)
    stray = tmp_path / "light" / "0123456789abcdef.light"
    stray.write_bytes(b"of a session that is no more")
    with app_client(data_dir=tmp_path, pool_size=0) as client:
        assert not stray.exists()
        assert client.get(path).json()["state"] == "converged"
        assert settle(client, path) == before


def test_a_damaged_file_is_told_and_solved_anew(
    client: TestClient, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = open_box(client)
    before, light = settle(client, path), light_of(tmp_path, path)
    assert eventually(light.exists)
    light.write_bytes(light.read_bytes()[:-1])
    kill_worker(client, path)
    assert settle(client, path) == before
    light.write_bytes(b"")
    assert LightKeeper(LightPlace(light, 10**9)).read() is None
    assert "solved anew: it is no checkpoint" in caplog.text


def test_what_takes_too_much_room_is_not_kept(tmp_path: Path) -> None:
    with app_client(data_dir=tmp_path, pool_size=0, max_light_bytes=1000) as client:
        path = open_box(client)
        before = settle(client, path)
        kill_worker(client, path)
        assert settle(client, path) == before
        assert not (tmp_path / "light").exists()


def test_of_many_the_newest_are_kept(tmp_path: Path) -> None:
    lights = Lights(tmp_path, 1000, 2500)
    places = [lights.place(name) for name in "abcd"]
    for age, place in enumerate(places):
        assert place is not None
        place.file.parent.mkdir(exist_ok=True)
        place.file.write_bytes(bytes(1000))
        os.utime(place.file, (1e9 - age, 1e9 - age))
    lights.tidy({"a", "c", "d"})
    assert sorted(file.stem for file in (tmp_path / "light").iterdir()) == ["a", "c"]

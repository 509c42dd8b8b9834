"""The nursery: workers that it forks are processes of their own, and it may be lost like any of them."""

from __future__ import annotations

import os
import signal
import socket
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from service.hosting.board import Board
from service.hosting.nursery import DistantProcess, Nursery
from tests.service.apps import NURSERY
from tests.service.processes import children_of, eventually, is_running

BOARD = Board(1)

SWIFT = 1.0
"""Seconds in which a worker is there; a fork takes some hundredths."""


@pytest.fixture(scope="module")
def nursery() -> Iterator[Nursery]:
    """One that may be killed."""
    nursery = Nursery()
    yield nursery
    nursery.close()


def worker_of(nursery: Nursery) -> tuple[DistantProcess, socket.socket]:
    ours, theirs = socket.socketpair()
    with theirs:
        return nursery.worker(theirs, BOARD.descriptor), ours


def sockets_of(pid: int) -> set[str]:
    open_files = {str(file.readlink()) for file in Path(f"/proc/{pid}/fd").iterdir()}
    return {name for name in open_files if name.startswith("socket:")}


def has_left_nothing(worker: DistantProcess) -> bool:
    return eventually(lambda: not Path(f"/proc/{worker.pid}").exists())


def test_workers_share_nothing_that_is_open_and_leave_nothing_behind() -> None:
    first, of_first = worker_of(NURSERY)
    second, of_second = worker_of(NURSERY)
    assert NURSERY.pid is not None
    assert {first.pid, second.pid} <= children_of(NURSERY.pid)
    of_nursery = sockets_of(NURSERY.pid)
    assert len(of_nursery) == 1, "it keeps its own line alone"
    with of_first, of_second:
        # They have told that they are ready, so that all that is to be open is.
        assert of_first.recv(1) and of_second.recv(1)
        assert len(sockets_of(first.pid)) == len(sockets_of(second.pid)) == 1
        assert not sockets_of(first.pid) & (sockets_of(second.pid) | of_nursery)
        os.kill(first.pid, signal.SIGKILL)
        while of_first.recv(65536):
            pass
        assert is_running(second.pid)
    for worker in (first, second):
        worker.end()
        assert has_left_nothing(worker), "nobody has to wait for it"


def test_a_worker_is_there_at_once() -> None:
    worker, ours = worker_of(NURSERY)
    ours.close()
    worker.end()
    start = time.monotonic()
    worker, ours = worker_of(NURSERY)
    assert time.monotonic() - start < SWIFT
    ours.close()
    worker.end()


def test_one_that_is_lost_is_followed_by_another(nursery: Nursery, caplog: pytest.LogCaptureFixture) -> None:
    before, of_before = worker_of(nursery)
    lost = nursery.pid
    assert lost is not None
    os.kill(lost, signal.SIGKILL)
    after, of_after = worker_of(nursery)
    found = nursery.pid
    assert found is not None and found != lost
    assert "begins anew" in caplog.text
    assert is_running(before.pid), "workers outlast it"
    assert not is_running(lost)
    nursery.close()
    assert not is_running(found)
    for worker, ours in ((before, of_before), (after, of_after)):
        assert is_running(worker.pid)
        ours.close()
        worker.end()
        assert not is_running(worker.pid)

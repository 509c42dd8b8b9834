"""Work on light gives way to what is asked, and takes turns."""

from __future__ import annotations

import asyncio
import subprocess
import sys
import time
from collections.abc import Iterator

import pytest

from service.hosting.board import Board, Turn
from tests.service.processes import eventually

HOLDER = """
import sys
from service.hosting.board import Turn
turn = Turn(int(sys.argv[1]))
print(turn.delay(), flush=True)
sys.stdin.read()
"""


@pytest.fixture
def board() -> Iterator[Board]:
    board = Board(2)
    yield board
    board.close()


def holder(board: Board) -> subprocess.Popen[str]:
    """A process that has a place, if there is one. Locks are of processes."""
    process = subprocess.Popen(
        [sys.executable, "-c", HOLDER, str(board.descriptor)],
        pass_fds=[board.descriptor],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    assert float(process.stdout.readline()) == 0.0
    return process


def test_there_are_so_many_places_and_who_is_killed_leaves_its(board: Board) -> None:
    turn = Turn(board.descriptor)
    assert turn.delay() == 0.0
    turn.worked(more=False)
    holders = [holder(board), holder(board)]
    assert turn.delay() > 0.0
    holders[0].kill()
    assert eventually(lambda: turn.delay() == 0.0)
    assert turn.delay() == 0.0, "it has a place now"
    for process in holders:
        process.kill()
        process.communicate()


def test_a_place_is_left_now_and_then(board: Board) -> None:
    turn = Turn(board.descriptor)
    assert turn.delay() == 0.0
    start = time.monotonic()
    while turn.delay() == 0.0:
        turn.worked(more=True)
    assert 0.05 < time.monotonic() - start < 5.0
    assert eventually(lambda: turn.delay() == 0.0)


def test_work_gives_way_to_what_is_asked_but_gets_on(board: Board) -> None:
    async def ask() -> None:
        turn = Turn(board.descriptor)
        leave = board.urgent()
        assert turn.delay() == 0.0, "who has not worked yet need not give way"
        turn.worked(more=True)
        assert turn.delay() > 0.0
        leave()
        leave()
        assert turn.delay() == 0.0
        turn.worked(more=True)
        leave = board.urgent()
        start = time.monotonic()
        while turn.delay() > 0.0:
            await asyncio.sleep(0.001)
        assert time.monotonic() - start < 1.0
        # What takes long is not urgent any more.
        await asyncio.sleep(0.15)
        turn.worked(more=False)
        await asyncio.sleep(0.01)
        assert turn.delay() == 0.0
        leave()

    asyncio.run(ask())

"""Where worker processes come from: the nursery, as it is seen from outside.

See `service.hosting.forking` for what goes on inside.
"""

from __future__ import annotations

import contextlib
import logging
import os
import select
import signal
import socket
import sys
import threading
from typing import Final

from service.hosting.forking_protocol import FORK, PID, READY

_log = logging.getLogger(__name__)

_FAREWELL: Final = 2.0
"""Seconds in which a process whose line was hung up must have ended by itself."""

_LINE: Final = 3
"""File descriptor of a nursery's own end of its line, where it begins as a program"""


class DistantProcess:
    """A process that need not be a child of this one."""

    def __init__(self, pid: int, descriptor: int) -> None:
        """`descriptor` is the process's, and is closed by `end`."""
        self.pid = pid
        self._descriptor = descriptor

    def end(self, patience: float = _FAREWELL) -> None:
        """Return when it has ended, by itself if it does so soon. Its line must have been hung up."""
        descriptor, self._descriptor = self._descriptor, -1
        if descriptor < 0:
            return
        if not select.select([descriptor], [], [], patience)[0]:
            with contextlib.suppress(ProcessLookupError):
                signal.pidfd_send_signal(descriptor, signal.SIGKILL)
            select.select([descriptor], [], [])
        os.close(descriptor)
        # A child is to be waited for; the first process of a container is given the nursery's if that ends.
        with contextlib.suppress(ChildProcessError):
            os.waitpid(self.pid, os.WNOHANG)


class Nursery:
    """A process that forks workers: begun when it is needed, and again where it was lost.

    It may be shared by several apps of a process, and asked from any thread.
    """

    def __init__(self) -> None:
        self._turn = threading.Lock()
        self._process: DistantProcess | None = None
        self._link: socket.socket | None = None
        self._ready = False

    @property
    def pid(self) -> int | None:
        """Process id; None while there is none."""
        return None if self._process is None else self._process.pid

    def fork(self) -> None:
        """Begin it as a fork of this process: what this has imported need not be imported again.

        This process must have no other threads yet, and nothing open that is not for workers.
        """
        from service.hosting import forking  # the solver and all: for this process alone

        self._link, theirs = socket.socketpair()
        with theirs:
            pid = forking.fork()
            if pid == 0:
                self._link.close()
                forking.serve(theirs)
            self._process = DistantProcess(pid, os.pidfd_open(pid))

    def worker(self, theirs: socket.socket, board: int) -> DistantProcess:
        """A new worker that serves `theirs` and takes turns by `board`.

        Blocks for a moment; for seconds while the nursery begins.

        Raises OSError where there is none.
        """
        with self._turn:
            if self._link is not None:
                with contextlib.suppress(OSError):
                    return self._ask(self._link, theirs, board)
                _log.error("the process that workers are forked from has ended unexpectedly; it begins anew")
            self._end()
            return self._ask(self._begin(), theirs, board)

    def close(self) -> None:
        """End it. Workers go on."""
        with self._turn:
            self._end()

    def _begin(self) -> socket.socket:
        self._link, theirs = socket.socketpair()
        with theirs:
            command = [sys.executable, "-m", "service.hosting.forking", str(_LINE)]
            files = [
                (os.POSIX_SPAWN_OPEN, 0, os.devnull, os.O_RDONLY, 0),
                (os.POSIX_SPAWN_DUP2, theirs.fileno(), _LINE),
            ]
            pid = os.posix_spawn(sys.executable, command, os.environ, file_actions=files)
        self._process = DistantProcess(pid, os.pidfd_open(pid))
        return self._link

    def _ask(self, link: socket.socket, theirs: socket.socket, board: int) -> DistantProcess:
        if not self._ready:
            self._ready = link.recv(len(READY)) == READY
        socket.send_fds(link, [FORK], [theirs.fileno(), board])
        told, descriptors, _, _ = socket.recv_fds(link, PID.size, 1)
        if len(told) < PID.size or not descriptors:
            raise ConnectionError("the process that workers are forked from has ended")
        return DistantProcess(PID.unpack(told)[0], descriptors[0])

    def _end(self) -> None:
        link, process = self._link, self._process
        self._link, self._process, self._ready = None, None, False
        if link is not None:
            link.close()
        if process is not None:
            process.end(patience=0.0)  # it holds nothing that could be lost

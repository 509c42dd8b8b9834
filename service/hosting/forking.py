"""The process that workers are forked from: all is imported and all kernels are loaded, once for all.

A fork takes with it nothing but the thread that forks, whatever locks the others hold. So this process has
one thread, no OpenGL, no rays and no asyncio: what starts threads is for the workers to begin. (BLAS has
threads, and brings them back after a fork by itself.) A worker shares with the others the pages that none
of them writes to, which are most of what a process of its own would need.

It reads requests from a socket, one for each worker that is wanted: a byte, with the socket that the worker
is to serve and the board that it takes turns by. The answer is the worker's process id, with a descriptor
of the process, by which whoever asked can wait for it and kill it, though it is no child of theirs. Where
the other end hangs up, this process ends; workers end with their own sockets.
"""

from __future__ import annotations

import gc
import os
import signal
import socket
import sys
import traceback
import warnings
from typing import NoReturn

from service.hosting import worker
from service.hosting.forking_protocol import FORK, PID, READY
from solver.engine.drawing import Drawing
from solver.engine.kept_kernels import load_kept_kernels
from solver.engine.warm import warm_up


def serve(link: socket.socket) -> NoReturn:
    """Be the nursery that serves `link`, until the other end hangs up."""
    # Terminals and supervisors signal all processes; the web process decides what to make of it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    _get_warm()
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # workers that have ended leave nothing to be waited for
    try:
        link.sendall(READY)
        while True:
            asked, descriptors, _, _ = socket.recv_fds(link, len(FORK), 2)
            if not asked:
                break
            _fork(link, *descriptors)
    except OSError:
        pass
    os._exit(0)


def fork() -> int:
    """Fork this process: 0 in the child, its process id in the parent."""
    with warnings.catch_warnings():
        # Told of any process with threads; those of BLAS come back.
        warnings.simplefilter("ignore", DeprecationWarning)
        return os.fork()


def _get_warm() -> None:
    if load_kept_kernels():
        # Some were never compiled: what needs threads for that is done by a process that ends.
        scout = fork()
        if scout == 0:
            warm_up(Drawing())
            os._exit(0)
        os.waitpid(scout, 0)
        load_kept_kernels()
    gc.collect()
    gc.freeze()  # the collector of a worker would write to what it shares with the others
    gc.collect()  # of nothing: a full collection is due after a quarter more than the last one has left


def _fork(link: socket.socket, *descriptors: int) -> None:
    """Fork a worker that is given those descriptors, and tell of it."""
    pid = fork()
    if pid == 0:
        link.close()
        _work(*descriptors)
    for descriptor in descriptors:
        os.close(descriptor)
    process = os.pidfd_open(pid)
    socket.send_fds(link, [PID.pack(pid)], [process])
    os.close(process)


def _work(*descriptors: int) -> NoReturn:
    """Be a worker."""
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    try:
        worker.main(*descriptors)
    except Exception as failure:
        # Not told by the interpreter's end, which would begin with what the nursery has left open.
        traceback.print_exception(failure)
        raise
    finally:
        os._exit(1)


if __name__ == "__main__":
    serve(socket.socket(fileno=int(sys.argv[1])))

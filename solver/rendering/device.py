"""An OpenGL context without a screen, bound to the thread that made it.

EGL lists the machine's devices, a GPU or Mesa's software rasteriser; the first that gives a context of
the version that the shaders need is taken. Everything that is made with a context lives and dies in its
owner thread: a call from another would draw into nothing, or into somebody else's context.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Final

import moderngl

from solver.errors import RenderingUnavailableError, SolverError
from solver.rendering.entry_points import EntryPoints

VERSION: Final = 430
"""OpenGL 4.3: shader storage buffers."""

_CHOSEN_DEVICE: Final = "GLCONTEXT_DEVICE_INDEX"
"""The environment variable by which a user names a device: then no other is tried."""

_MOST_DEVICES: Final = 16


class DeviceUseError(SolverError):
    """A device is used where it cannot be: in another thread, or after its release."""


@dataclass(frozen=True)
class DeviceInfo:
    """What the driver says of itself."""

    vendor: str
    renderer: str
    version: str


class GlDevice:
    """One OpenGL context. `with device.current():` makes it the thread's own while something is drawn."""

    def __init__(self) -> None:
        """Make a context. Raises RenderingUnavailableError where this machine cannot."""
        self._owner = threading.get_ident()
        self._released = False
        self.context = _create_context()
        """Only to be used inside `current`."""
        try:
            self.entry_points = EntryPoints(self.context)
        except RenderingUnavailableError:
            self.context.release()
            raise
        told = self.context.info
        self.info = DeviceInfo(told["GL_VENDOR"], told["GL_RENDERER"], told["GL_VERSION"])
        widest, highest = told["GL_MAX_VIEWPORT_DIMS"]
        most = told["GL_MAX_RENDERBUFFER_SIZE"]
        self.largest_frame = (min(widest, most), min(highest, most))
        """Width and height in pixels"""

    @contextmanager
    def current(self) -> Iterator[moderngl.Context]:
        """The context, for as long as the block lasts. Raises DeviceUseError."""
        self._require_usable()
        with self.context:
            yield self.context

    def release(self) -> None:
        """Give the context and all that it holds back; a second call does nothing. Raises DeviceUseError."""
        if self._released:
            return
        self._require_usable()
        self._released = True
        self.context.release()

    def _require_usable(self) -> None:
        if threading.get_ident() != self._owner:
            raise DeviceUseError("An OpenGL device can only be used by the thread that made it")
        if self._released:
            raise DeviceUseError("The OpenGL device has been released")


def _create_context() -> moderngl.Context:
    """A context of the first device that gives one."""
    if _CHOSEN_DEVICE in os.environ:
        return _create_context_of(None)
    first: RenderingUnavailableError | None = None
    for index in range(_MOST_DEVICES):
        try:
            return _create_context_of(index)
        except RenderingUnavailableError as failure:
            first = first or failure
            if failure.reason.startswith("requested device index"):
                break  # there are no more
    raise first or RenderingUnavailableError("no EGL device was tried")


def _create_context_of(device: int | None) -> moderngl.Context:
    settings: dict[str, Any] = {"backend": "egl"}
    if device is not None:
        settings["device_index"] = device
    try:
        return moderngl.create_context(require=VERSION, standalone=True, **settings)
    except Exception as failure:
        # The binding raises bare exceptions: nothing narrower tells its failures from others.
        raise RenderingUnavailableError(str(failure)) from failure

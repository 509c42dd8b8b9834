"""Two OpenGL calls that the binding lacks, both for depth that keeps its digits.

A depth of near / distance, 1 at the near plane and 0 at infinity, has the same relative precision at
every distance when it is stored as a float, however near the near plane: floats are densest at 0, where
1 / distance is flattest. The classic mapping onto [-1, 1] destroys that by adding and halving; with
glClipControl what the shader says is what is stored. (Reed 2015, "Depth precision visualized".)
"""

from __future__ import annotations

import ctypes
from ctypes.util import find_library
from typing import Final

import moderngl

from solver.errors import RenderingUnavailableError

_LOWER_LEFT: Final = 0x8CA1
_ZERO_TO_ONE: Final = 0x935F
_RENDERBUFFER: Final = 0x8D41
_DEPTH_COMPONENT32F: Final = 0x8CAC


class EntryPoints:
    """The calls, for contexts of one driver."""

    def __init__(self, context: moderngl.Context) -> None:
        """Find the calls. Raises RenderingUnavailableError where the driver has no clip control."""
        if context.version_code < 450 and "GL_ARB_clip_control" not in context.extensions:
            raise RenderingUnavailableError("the driver has no GL_ARB_clip_control")
        library = ctypes.CDLL(find_library("EGL") or "libEGL.so.1")
        library.eglGetProcAddress.restype = ctypes.c_void_p
        library.eglGetProcAddress.argtypes = [ctypes.c_char_p]
        word = ctypes.c_uint
        self._clip_control = ctypes.CFUNCTYPE(None, word, word)(library.eglGetProcAddress(b"glClipControl"))
        self._bind = ctypes.CFUNCTYPE(None, word, word)(library.eglGetProcAddress(b"glBindRenderbuffer"))
        self._store = ctypes.CFUNCTYPE(None, word, word, ctypes.c_int, ctypes.c_int)(
            library.eglGetProcAddress(b"glRenderbufferStorage")
        )

    def keep_depth(self) -> None:
        """From now on clip space has 0 <= z <= w, and z / w is stored as it is."""
        self._clip_control(_LOWER_LEFT, _ZERO_TO_ONE)

    def make_float_depth(self, buffer: moderngl.Renderbuffer) -> None:
        """Give a depth buffer a storage of 32-bit floats."""
        self._bind(_RENDERBUFFER, buffer.glo)
        self._store(_RENDERBUFFER, _DEPTH_COMPONENT32F, buffer.width, buffer.height)
        self._bind(_RENDERBUFFER, 0)

"""OpenGL calls that the binding lacks: for depth that keeps its digits, for texel buffers, and to flush.

A depth of near / distance, 1 at the near plane and 0 at infinity, has the same relative precision at
every distance when it is stored as a float, however near the near plane: floats are densest at 0, where
1 / distance is flattest. The classic mapping onto [-1, 1] destroys that by adding and halving; with
glClipControl what the shader says is what is stored. (Reed 2015, "Depth precision visualized".)

A texel buffer is a buffer that a shader reads four words at a time. Software OpenGL reads storage buffers
word by word, and computes addresses in two dimensions for textures: both take several times as long.
"""

from __future__ import annotations

import ctypes
from ctypes.util import find_library
from enum import IntEnum
from typing import Any, Final

import moderngl

from solver.errors import RenderingUnavailableError

_LOWER_LEFT: Final = 0x8CA1
_ZERO_TO_ONE: Final = 0x935F
_RENDERBUFFER: Final = 0x8D41
_DEPTH_COMPONENT32F: Final = 0x8CAC
_TEXTURE_BUFFER: Final = 0x8C2A
_FIRST_UNIT: Final = 0x84C0

_Word: Final = ctypes.c_uint
_Count: Final = ctypes.c_int
_Address: Final = ctypes.c_void_p


class Texel(IntEnum):
    """What a shader reads at once."""

    FLOATS = 0x8814
    """Four float32"""
    WORDS = 0x8D70
    """Four uint32"""


class EntryPoints:
    """The calls, for contexts of one driver."""

    def __init__(self, context: moderngl.Context) -> None:
        """Find the calls. Raises RenderingUnavailableError where the driver has no clip control."""
        if context.version_code < 450 and "GL_ARB_clip_control" not in context.extensions:
            raise RenderingUnavailableError("the driver has no GL_ARB_clip_control")
        library = ctypes.CDLL(find_library("EGL") or "libEGL.so.1")
        library.eglGetProcAddress.restype = _Address
        library.eglGetProcAddress.argtypes = [ctypes.c_char_p]

        def find(name: bytes, *arguments: Any) -> Any:
            return ctypes.CFUNCTYPE(None, *arguments)(library.eglGetProcAddress(name))

        self._clip_control = find(b"glClipControl", _Word, _Word)
        self._flush = find(b"glFlush")
        self._bind_renderbuffer = find(b"glBindRenderbuffer", _Word, _Word)
        self._store = find(b"glRenderbufferStorage", _Word, _Word, _Count, _Count)
        self._make_textures = find(b"glGenTextures", _Count, _Address)
        self._delete_textures = find(b"glDeleteTextures", _Count, _Address)
        self._choose_unit = find(b"glActiveTexture", _Word)
        self._bind_texture = find(b"glBindTexture", _Word, _Word)
        self._attach = find(b"glTexBuffer", _Word, _Word, _Word)
        self.most_texels = int(context.info["GL_MAX_TEXTURE_BUFFER_SIZE"])
        """Of a texel buffer"""

    def keep_depth(self) -> None:
        """From now on clip space has 0 <= z <= w, and z / w is stored as it is."""
        self._clip_control(_LOWER_LEFT, _ZERO_TO_ONE)

    def begin(self) -> None:
        """Have what has been asked for so far begun, without waiting for it."""
        self._flush()

    def make_float_depth(self, buffer: moderngl.Renderbuffer) -> None:
        """Give a depth buffer a storage of 32-bit floats."""
        self._bind_renderbuffer(_RENDERBUFFER, buffer.glo)
        self._store(_RENDERBUFFER, _DEPTH_COMPONENT32F, buffer.width, buffer.height)
        self._bind_renderbuffer(_RENDERBUFFER, 0)

    def make_texels(self, buffer: moderngl.Buffer, texel: Texel, unit: int) -> int:
        """A name by which shaders can be given `buffer` as texels; they find them at `unit` from now on."""
        name = _Word()
        self._make_textures(1, ctypes.byref(name))
        self.use_texels(name.value, unit)
        self._attach(_TEXTURE_BUFFER, texel, buffer.glo)
        return name.value

    def use_texels(self, name: int, unit: int) -> None:
        """Shaders find these texels at `unit` from now on."""
        self._choose_unit(_FIRST_UNIT + unit)
        self._bind_texture(_TEXTURE_BUFFER, name)

    def release_texels(self, name: int) -> None:
        """Forget a name; its buffer stays."""
        self._delete_textures(1, ctypes.byref(_Word(name)))

"""Textures: pictures of which only the mean over a face is wanted, in linear light."""

from __future__ import annotations

import io
import struct
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from PIL import Image

from solver.errors import LimitExceededError
from solver.types import ByteArray, FloatArray

_FORMATS: Final = ("PNG", "JPEG", "WEBP", "BMP", "TGA")
_MOST_PIXELS: Final = 2**24

_FAILURES: Final = (
    OSError, ValueError, SyntaxError, EOFError, struct.error, TypeError, LookupError, OverflowError,
    MemoryError, ZeroDivisionError, Image.DecompressionBombError, UserWarning,
)  # fmt: skip
"""What the decoder raises over files that are damaged."""

_SAMPLES: Final = 2**19
"""Looks at a picture, over all faces."""

_FEWEST: Final = 16
_MOST: Final = 4096
"""Looks for one triangle."""

_STEPS: Final = np.array([0.7548776662466927, 0.5698402909980532])
"""Of Roberts' sequence in two dimensions: the inverse powers of the real root of x^3 = x + 1."""


class UnreadableTextureError(ValueError):
    """A picture that cannot be decoded."""

    def __init__(self) -> None:
        super().__init__("this is no picture that can be read (PNG, JPEG, WebP, BMP or TGA)")


@dataclass(frozen=True, eq=False)
class Texture:
    """A decoded picture."""

    pixels: ByteArray
    """(height, width, 4), top row first"""
    clamps: bool = False
    """Whether places outside are those of the border; otherwise the picture repeats"""

    @staticmethod
    def decode(content: bytes, clamps: bool = False) -> Texture:
        """The picture of a file. Raises UnreadableTextureError, LimitExceededError."""
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                with Image.open(io.BytesIO(content), formats=_FORMATS) as picture:
                    pixels = picture.width * picture.height
                    if pixels > _MOST_PIXELS:
                        raise LimitExceededError("texture pixels", pixels, _MOST_PIXELS)
                    return Texture(np.asarray(picture.convert("RGBA")), clamps)
        except _FAILURES:
            raise UnreadableTextureError from None

    def triangle_means(self, uv: FloatArray, is_colour: bool = True) -> FloatArray:
        """(t, 3) means over triangles uv (t, 3, 2), 0 to 1 across and down; colours from sRGB to linear."""
        count = len(uv)
        looks = int(np.clip(_SAMPLES // max(count, 1), _FEWEST, _MOST))
        a, b = (0.5 + _STEPS[:, None] * np.arange(1, looks + 1)) % 1.0
        folded = a + b > 1.0
        a, b = np.where(folded, 1.0 - a, a), np.where(folded, 1.0 - b, b)
        weights = np.stack([1.0 - a - b, a, b])
        table = _linear_light() if is_colour else np.arange(256) / 255.0
        total = np.zeros((count, 3))
        # A slice of samples at a time, so that many faces need no more memory than few.
        step = max(1, _SAMPLES // max(count, 1) // 8)
        for start in range(0, looks, step):
            place = np.einsum("ks,tkc->tsc", weights[:, start : start + step], uv)
            total += table[self._at(place)].sum(axis=1)
        return np.asarray(total / looks)

    def polygon_means(self, polygons: Sequence[FloatArray | None], is_colour: bool = True) -> FloatArray:
        """(f, 3) means over polygons, each (n, 2) as above; over all of the picture for None."""
        whole = np.array([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]], dtype=np.float64)
        fans = [whole if uv is None else uv[_fan(len(uv))] for uv in polygons]
        counts = np.array([len(fan) for fan in fans])
        triangles = np.concatenate(fans)
        means = self.triangle_means(triangles, is_colour)
        side, other = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
        area = np.abs(side[:, 0] * other[:, 1] - side[:, 1] * other[:, 0]) + 1e-12
        first = np.cumsum(counts) - counts
        weighted = np.add.reduceat(means * area[:, None], first, axis=0)
        return np.asarray(weighted / np.add.reduceat(area, first)[:, None])

    def _at(self, place: FloatArray) -> ByteArray:
        """RGB of the pixels at places (..., 2)."""
        height, width = self.pixels.shape[:2]
        place = place.clip(0.0, 1.0) if self.clamps else place - np.floor(place)
        size = np.array([width, height])
        pixel = np.minimum((place * size).astype(np.int64), size - 1)
        return self.pixels[pixel[..., 1], pixel[..., 0], :3]


def _fan(count: int) -> FloatArray:
    """(count - 2, 3) corners of the triangles about the first."""
    k = np.arange(1, count - 1)
    return np.stack([np.zeros_like(k), k, k + 1], axis=1)


def _linear_light() -> FloatArray:
    """(256,) linear values of sRGB bytes (IEC 61966-2-1)."""
    coded = np.arange(256) / 255.0
    return np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)

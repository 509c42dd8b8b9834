"""From radiance to sRGB pictures: exposure, a curve, and the transfer function.

Sources: Reinhard, Stark, Shirley and Ferwerda 2002, "Photographic tone reproduction for digital
images" [R]; Narkowicz 2015, "ACES filmic tone mapping curve" [N]; IEC 61966-2-1:1999 (sRGB).

Nothing that is not finite goes through: NaN and negative radiance become black, infinite radiance white.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum
from typing import Final

import numpy as np

from solver.kernels import inline_kernel, kernel
from solver.parallel import run_chunks
from solver.types import LUMINANCE_WEIGHTS, ByteArray, Float32Array, FloatArray

_KEY: Final = 0.18
"""Automatic exposure takes the middle of the picture here: the reflectance of a grey card [R 2]."""

_TRIMMED: Final = 0.05
"""Part of the pixels at either end that automatic exposure leaves out: lamps, and the darkest corners."""

_LOOKED_AT: Final = 1 << 16
"""Automatic exposure looks at about this many pixels, evenly spread."""

_STOPS: Final = 120.0
"""Exposure stays within these stops, where float32 does."""

_BRIGHTEST: Final = np.float32(1e6)
"""What is brighter than this after exposure is white on any curve; it keeps squares finite."""

_CELLS: Final = 4096
"""Cells of the table of the transfer function: 1 / 4096 is less than its narrowest step, 1 / (255 12.92)."""

_PIXELS: Final = 1 << 16
"""Pixels of a piece of work"""


class ToneCurve(StrEnum):
    """How exposed radiance becomes display luminance."""

    LINEAR = "linear"
    """As it is, up to white"""
    REINHARD = "reinhard"
    """Luminance Y becomes Y / (1 + Y) [R eq. 3]; chromaticity is kept"""
    FILMIC = "filmic"
    """Each channel x becomes x (2.51 x + 0.03) / (x (2.43 x + 0.59) + 0.14) [N]"""


def auto_exposure(radiance: Float32Array) -> float:
    """Exposure in stops that takes the logarithmic mean luminance of `radiance` (h, w, 3) to 0.18.

    The mean is over the pixels that are lit, without the darkest and the brightest 5 %, so that neither
    lamps nor the background count. 0 where nothing is lit.
    """
    height, width = radiance.shape[:2]
    step = max(1, int(np.sqrt(height * width / _LOOKED_AT)))
    with np.errstate(over="ignore", invalid="ignore"):
        luminance = radiance[step // 2 :: step, step // 2 :: step] @ LUMINANCE_WEIGHTS
    lit = luminance[np.isfinite(luminance) & (luminance > 0.0)]
    if lit.size == 0:
        return 0.0
    logarithm = np.sort(np.log2(lit))
    left_out = int(_TRIMMED * lit.size)
    middle = logarithm[left_out : lit.size - left_out].mean()
    return float(np.clip(np.log2(_KEY) - middle, -_STOPS, _STOPS))


def tone_map(radiance: Float32Array, exposure: float | None, curve: ToneCurve) -> ByteArray:
    """The sRGB picture, uint8 (h, w, 3), of `radiance` (h, w, 3).

    Radiance is multiplied by 2 to the `exposure`; None chooses it by `auto_exposure`.
    """
    stops = auto_exposure(radiance) if exposure is None else exposure
    scale = np.float32(2.0 ** float(np.clip(stops, -_STOPS, _STOPS)))
    flat = np.ascontiguousarray(radiance, dtype=np.float32).reshape(-1, 3)
    picture = np.empty(flat.shape, dtype=np.uint8)
    work = _KERNELS[curve]
    run_chunks(
        lambda start, stop: work(start, stop, flat, scale, _FIRST, _THRESHOLDS, picture), len(flat), _PIXELS
    )
    return picture.reshape(radiance.shape)


def encode_srgb(linear: Float32Array) -> ByteArray:
    """sRGB codes, uint8, of linear values of any shape; 1 is white."""
    flat = np.ascontiguousarray(linear, dtype=np.float32).ravel()
    codes = np.empty(flat.shape, dtype=np.uint8)
    run_chunks(
        lambda start, stop: _encode(start, stop, flat, _FIRST, _THRESHOLDS, codes), len(flat), 3 * _PIXELS
    )
    return codes.reshape(linear.shape)


def srgb_to_linear(code: FloatArray) -> FloatArray:
    """Linear values of sRGB values in [0, 1], by IEC 61966-2-1."""
    return np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)


def _table() -> tuple[ByteArray, Float32Array]:
    """For each cell of [0, 1] the code at its beginning, and the linear value at which each code begins.

    Code k begins where the transfer function is (k - 1/2) / 255. A cell holds at most one beginning, so that
    one comparison gives the code that the function itself rounds to.
    """
    begins = srgb_to_linear((np.arange(257, dtype=np.float64) - 0.5) / 255.0)
    begins[0], begins[256] = 0.0, np.inf
    # The first float32 that is not below a beginning: comparisons are the same as in float64.
    rounded = begins.astype(np.float32)
    rounded = np.where(rounded < begins, np.nextafter(rounded, np.float32(np.inf)), rounded)
    cells = np.arange(_CELLS + 1) / _CELLS
    return (np.searchsorted(rounded, cells, side="right") - 1).astype(np.uint8), rounded.astype(np.float32)


_FIRST, _THRESHOLDS = _table()


@inline_kernel
def _code(value: np.float32, first: ByteArray, begins: Float32Array) -> int:
    """sRGB code of a linear value."""
    # Written so that NaN is black.
    if not value > 0.0:
        return 0
    if value >= 1.0:
        return 255
    code = int(first[int(value * np.float32(4096.0))])
    return code + 1 if value >= begins[code + 1] else code


@inline_kernel
def _exposed(value: np.float32, scale: np.float32) -> np.float32:
    """Radiance after exposure, in [0, brightest]."""
    value = value * scale
    if not value > 0.0:
        return np.float32(0.0)
    return min(value, _BRIGHTEST)


@kernel
def _encode(
    start: int, stop: int, linear: Float32Array, first: ByteArray, begins: Float32Array, codes: ByteArray
) -> None:
    for i in range(start, stop):
        codes[i] = _code(linear[i], first, begins)


@kernel
def _map_linear(
    start: int,
    stop: int,
    radiance: Float32Array,
    scale: np.float32,
    first: ByteArray,
    begins: Float32Array,
    picture: ByteArray,
) -> None:
    for i in range(start, stop):
        for c in range(3):
            picture[i, c] = _code(_exposed(radiance[i, c], scale), first, begins)


@kernel
def _map_reinhard(
    start: int,
    stop: int,
    radiance: Float32Array,
    scale: np.float32,
    first: ByteArray,
    begins: Float32Array,
    picture: ByteArray,
) -> None:
    for i in range(start, stop):
        r = _exposed(radiance[i, 0], scale)
        g = _exposed(radiance[i, 1], scale)
        b = _exposed(radiance[i, 2], scale)
        luminance = np.float32(0.2126) * r + np.float32(0.7152) * g + np.float32(0.0722) * b
        factor = np.float32(1.0) / (np.float32(1.0) + luminance)
        picture[i, 0] = _code(r * factor, first, begins)
        picture[i, 1] = _code(g * factor, first, begins)
        picture[i, 2] = _code(b * factor, first, begins)


@kernel
def _map_filmic(
    start: int,
    stop: int,
    radiance: Float32Array,
    scale: np.float32,
    first: ByteArray,
    begins: Float32Array,
    picture: ByteArray,
) -> None:
    for i in range(start, stop):
        for c in range(3):
            x = _exposed(radiance[i, c], scale)
            above = x * (np.float32(2.51) * x + np.float32(0.03))
            below = x * (np.float32(2.43) * x + np.float32(0.59)) + np.float32(0.14)
            picture[i, c] = _code(above / below, first, begins)


_Kernel = Callable[[int, int, Float32Array, np.float32, ByteArray, Float32Array, ByteArray], None]

_KERNELS: Final[dict[ToneCurve, _Kernel]] = {
    ToneCurve.LINEAR: _map_linear,
    ToneCurve.REINHARD: _map_reinhard,
    ToneCurve.FILMIC: _map_filmic,
}

"""Amounts of light as colours on a linear scale, so that values can be read off a picture.

The colours are viridis (van der Walt and Smith 2015, CC0): equal steps of light are equal steps to the eye,
lightness rises throughout, and it reads as well without red-green vision.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from solver.errors import SceneError
from solver.kernels import kernel
from solver.parallel import run_chunks
from solver.types import AnyArray, Float32Array

_WHITE: Final = 0.995
"""This part of the pixels that are lit is not above a scale that is chosen for them."""

_PIXELS: Final = 1 << 15
"""Pixels of a piece of work"""

# Every fifth of the 256 colours; linear between them, no sRGB code is off by more than one.
# fmt: off
_THOUSANDTHS: Final = (
    (267, 5, 329), (274, 31, 359), (279, 62, 387), (282, 90, 412), (283, 116, 436), (283, 141, 458),
    (280, 166, 476), (276, 190, 493), (271, 214, 507), (264, 238, 519), (256, 261, 528), (247, 283, 536),
    (237, 305, 542), (228, 327, 547), (218, 347, 550), (209, 368, 553), (199, 388, 555), (191, 407, 556),
    (182, 426, 557), (174, 445, 558), (167, 464, 558), (159, 482, 558), (152, 501, 558), (145, 519, 557),
    (138, 537, 555), (131, 556, 552), (125, 574, 549), (121, 593, 545), (119, 611, 539), (121, 629, 532),
    (128, 648, 523), (140, 666, 513), (158, 684, 502), (181, 701, 488), (208, 719, 473), (239, 736, 456),
    (274, 752, 437), (312, 768, 416), (352, 783, 393), (395, 797, 368), (440, 811, 341), (487, 824, 312),
    (536, 836, 282), (586, 847, 250), (637, 857, 217), (689, 865, 183), (741, 873, 150), (794, 881, 120),
    (846, 887, 100), (896, 894, 96), (946, 900, 113), (993, 906, 144),
)
# fmt: on
_MAP: Final = np.array(_THOUSANDTHS, dtype=np.float32) / np.float32(1000.0)


def scale_maximum(light: Float32Array, maximum: float | None = None) -> float:
    """The end of the scale on which `light`, of any shape, is shown, in its unit.

    That is `maximum` where given, else the 99.5th percentile of what is lit, or 1 where nothing is.
    Raises SceneError naming the maximum if it is not finite and above 0.
    """
    if maximum is not None:
        if not (np.isfinite(maximum) and maximum > 0.0):
            raise SceneError("the end of a scale is finite and above 0", ("maximum",))
        return maximum
    lit = light[np.isfinite(light) & (light > 0.0)]
    return float(np.quantile(lit, _WHITE)) if lit.size else 1.0


def false_colour(light: Float32Array, maximum: float | None = None) -> Float32Array:
    """sRGB colours in 0..1, (h, w, 3), of `light` (h, w) on a scale from 0 to `scale_maximum`.

    What is above the scale has its last colour. Black, which is no colour of the map, where there is no
    light: on backs, and where nothing is seen.
    """
    scale = scale_maximum(light, maximum)
    amounts = np.ascontiguousarray(light, dtype=np.float32).ravel()
    colours = np.zeros((len(amounts), 3), dtype=np.float32)
    run_chunks(lambda start, stop: _colour(start, stop, amounts, scale, _MAP, colours), len(amounts), _PIXELS)
    return colours.reshape(*light.shape, 3)


def scale_colours(count: int) -> Float32Array:
    """The colours (count, 3) of a legend, evenly from 0 to the scale's maximum."""
    at = np.linspace(0.0, 1.0, count)
    nodes = np.linspace(0.0, 1.0, len(_MAP))
    columns: list[AnyArray] = [np.interp(at, nodes, _MAP[:, c]) for c in range(3)]
    return np.stack(columns, axis=-1).astype(np.float32)


@kernel
def _colour(
    start: int,
    stop: int,
    amounts: Float32Array,
    scale: float,
    colour_map: Float32Array,
    colours: Float32Array,
) -> None:
    last = len(colour_map) - 1
    for i in range(start, stop):
        # Written so that NaN is black.
        if not amounts[i] > 0.0:
            continue
        at = min(amounts[i] / scale, 1.0) * last
        node = min(int(at), last - 1)
        part = np.float32(at - node)
        for c in range(3):
            colours[i, c] = colour_map[node, c] + part * (colour_map[node + 1, c] - colour_map[node, c])

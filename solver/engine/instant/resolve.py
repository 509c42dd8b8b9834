"""From points back to pixels."""

from __future__ import annotations

from solver.kernels import kernel
from solver.types import Float32Array, FloatArray, IntArray


@kernel
def add_to_pixels(pixel: IntArray, values: FloatArray, picture: FloatArray) -> None:
    """Add values (n, c) of points to their pixels (n,) of picture (k, c)."""
    for i in range(len(pixel)):
        for c in range(picture.shape[1]):
            picture[pixel[i], c] += values[i, c]


@kernel
def add_radiance(
    pixel: IntArray,
    patch: IntArray,
    weight: FloatArray,
    emitted: FloatArray,
    reflected: FloatArray,
    light: Float32Array,
    picture: FloatArray,
) -> None:
    """Add weight (n, 3) times radiance to pixels (n,): emitted (n, 3), reflected (p, 3) of light (3, n)."""
    for i in range(len(pixel)):
        for c in range(3):
            picture[pixel[i], c] += weight[i, c] * (emitted[i, c] + reflected[patch[i], c] * light[c, i])

"""The quadratic through six samples of a triangle, in closed form ([H 3.3])."""

from __future__ import annotations

import numpy as np

from solver.kernels import kernel
from solver.parallel import run_chunks
from solver.types import Float32Array, FloatArray, IntArray

_CHUNK = 8192


@kernel
def _fit(node: IntArray, values: FloatArray, start: int, stop: int, out: Float32Array) -> None:
    channels = values.shape[1]
    for t in range(start, stop):
        for c in range(3):
            k = c if channels == 3 else 0
            r0 = values[node[t, 0], k]
            r1 = values[node[t, 1], k]
            r2 = values[node[t, 2], k]
            r3 = values[node[t, 3], k]
            r4 = values[node[t, 4], k]
            r5 = values[node[t, 5], k]
            out[t, 0, c] = 2.0 * r0 - 4.0 * r1 + 2.0 * r2
            out[t, 1, c] = 4.0 * (r0 - r1 + r3 - r5)
            out[t, 2, c] = -3.0 * r0 + 4.0 * r1 - r2
            out[t, 3, c] = 2.0 * r0 + 2.0 * r4 - 4.0 * r5
            out[t, 4, c] = -3.0 * r0 - r4 + 4.0 * r5
            out[t, 5, c] = r0


def fit_interpolants(node: IntArray, values: FloatArray) -> Float32Array:
    """Coefficients (t, 6, 3) A, 2B, 2C, D, 2E, F from samples node (t, 6) of values (m, 1 or 3).

    The samples are those at (s, t) = (0, 0), (1/2, 0), (1, 0), (1/2, 1/2), (0, 1), (0, 1/2).
    """
    out = np.empty((len(node), 6, 3), dtype=np.float32)
    run_chunks(lambda start, stop: _fit(node, values, start, stop, out), len(node), _CHUNK)
    return out

"""What stands between a virtual light and a receiver: the test that gives shadows their edges."""

from __future__ import annotations

import numpy as np

from solver.kernels import inline_kernel
from solver.tolerances import TOUCH
from solver.types import Float32Array, IntArray


@inline_kernel
def is_hidden(
    x: np.float32,
    y: np.float32,
    z: np.float32,
    dx: np.float32,
    dy: np.float32,
    dz: np.float32,
    own: int,
    base: int,
    q0: int,
    q1: int,
    q2: int,
    q3: int,
    seen: IntArray,
    cone: Float32Array,
    clip: Float32Array | None,
) -> bool:
    """Whether the line (dx, dy, dz) from a light to a receiver crosses one of the polygons seen around it.

    With `clip` only where that is inside of the plane through the light of normal clip (s, 3) as well.
    """
    # No views of rows: threads would contend for their counts of references. Few branches: none is foreseen.
    before = -1
    for corner in range(4):
        texel = q0 if corner == 0 else q1 if corner == 1 else q2 if corner == 2 else q3
        if texel == before:
            continue
        before = texel
        q = base + texel
        behind = cone[q, 12] * x + cone[q, 13] * y + cone[q, 14] * z - cone[q, 15]
        if behind > np.float32(TOUCH) and seen[q] != own:
            inside = min(
                min(
                    cone[q, 0] * dx + cone[q, 1] * dy + cone[q, 2] * dz,
                    cone[q, 3] * dx + cone[q, 4] * dy + cone[q, 5] * dz,
                ),
                min(
                    cone[q, 6] * dx + cone[q, 7] * dy + cone[q, 8] * dz,
                    cone[q, 9] * dx + cone[q, 10] * dy + cone[q, 11] * dz,
                ),
            )
            if clip is not None:
                inside = min(inside, clip[q, 0] * dx + clip[q, 1] * dy + clip[q, 2] * dz)
            if inside >= np.float32(0.0):
                return True
    return False

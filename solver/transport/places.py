"""The leaves that points lie on."""

from __future__ import annotations

import numpy as np

from solver.kernels import kernel
from solver.transport.elements import ElementTree
from solver.types import Corners, FloatArray, IntArray, Points


def leaves_at(tree: ElementTree, positions: Points, patch: IntArray) -> IntArray:
    """The leaf (n,) of `patch` (n,) that each point (n, 3) of its plane lies on, or the nearest to it."""
    found = np.empty(len(patch), dtype=np.int32)
    _descend(
        np.ascontiguousarray(positions), patch, tree.child, tree.child_count, tree.corners, tree.corner_count,
        tree.patch_normal, found,
    )  # fmt: skip
    return found


@kernel
def _descend(
    positions: Points,
    patch: IntArray,
    child: IntArray,
    child_count: IntArray,
    corners: Corners,
    corner_count: IntArray,
    normal: FloatArray,
    found: IntArray,
) -> None:
    for i in range(len(patch)):
        element = patch[i]
        while child[element] >= 0:
            # Into the child that the point is deepest within.
            best = -np.inf
            first = child[element]
            chosen = first
            for part in range(first, first + child_count[element]):
                depth = np.inf
                for k in range(corner_count[part]):
                    following = (k + 1) % corner_count[part]
                    sx = corners[part, following, 0] - corners[part, k, 0]
                    sy = corners[part, following, 1] - corners[part, k, 1]
                    sz = corners[part, following, 2] - corners[part, k, 2]
                    nx, ny, nz = normal[patch[i], 0], normal[patch[i], 1], normal[patch[i], 2]
                    ix, iy, iz = ny * sz - nz * sy, nz * sx - nx * sz, nx * sy - ny * sx
                    length = np.sqrt(ix * ix + iy * iy + iz * iz)
                    if length > 0.0:
                        height = (
                            ix * (positions[i, 0] - corners[part, k, 0])
                            + iy * (positions[i, 1] - corners[part, k, 1])
                            + iz * (positions[i, 2] - corners[part, k, 2])
                        )
                        depth = min(depth, height / length)
                if depth > best:
                    best = depth
                    chosen = part
            element = chosen
        found[i] = element

"""The leaves that points lie on, and what functions on elements are there."""

from __future__ import annotations

from typing import Final

import numpy as np

from solver.kernels import kernel
from solver.parallel import run_chunks
from solver.transport.elements import ElementTree
from solver.types import Corners, FloatArray, IntArray, Points, Spectra

_CHUNK: Final = 1 << 12
_LEAST: Final = 1 << 8


def leaves_at(tree: ElementTree, positions: Points, elements: IntArray) -> IntArray:
    """The leaf (n,) of `elements` (n,), such as patches, that each point (n, 3) lies on, or is nearest to."""
    found = np.empty(len(elements), dtype=np.int32)
    places = np.ascontiguousarray(positions)
    run_chunks(
        lambda start, stop: _descend(
            places, elements, tree.patch, tree.child, tree.child_count, tree.corners, tree.corner_count,
            tree.patch_normal, start, stop, found,
        ),
        len(elements),
        _CHUNK,
        _LEAST,
    )  # fmt: skip
    return found


def functions_at(tree: ElementTree, functions: FloatArray, positions: Points, elements: IntArray) -> Spectra:
    """What linear functions (n, 3, channels) on elements are at points (m, 3) of `elements` (m,)."""
    found = np.empty((len(positions), functions.shape[2]))
    run_chunks(
        lambda start, stop: _evaluate(
            start, stop, positions, elements, tree.patch, tree.axes, tree.centroid, functions, found
        ),
        len(positions),
        _CHUNK,
    )
    return found


@kernel
def _descend(
    positions: Points,
    elements: IntArray,
    patch: IntArray,
    child: IntArray,
    child_count: IntArray,
    corners: Corners,
    corner_count: IntArray,
    normal: FloatArray,
    start: int,
    stop: int,
    found: IntArray,
) -> None:
    for i in range(start, stop):
        element = elements[i]
        nx, ny, nz = normal[patch[element]]
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
                if depth > 0.0:
                    # Within it, and so in no other.
                    break
            element = chosen
        found[i] = element


@kernel
def _evaluate(
    start: int,
    stop: int,
    positions: Points,
    elements: IntArray,
    patch: IntArray,
    axes: FloatArray,
    centroid: Points,
    functions: FloatArray,
    found: FloatArray,
) -> None:
    for i in range(start, stop):
        e = elements[i]
        p = patch[e]
        u = 0.0
        v = 0.0
        for axis in range(3):
            from_centroid = positions[i, axis] - centroid[e, axis]
            u += axes[p, 0, axis] * from_centroid
            v += axes[p, 1, axis] * from_centroid
        for c in range(found.shape[1]):
            found[i, c] = functions[e, 0, c] + u * functions[e, 1, c] + v * functions[e, 2, c]

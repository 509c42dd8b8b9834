"""Where borders of different patches run along each other, so that neither leaves cracks in the other.

Two patches that meet are subdivided independently: a vertex of one lies on an edge of the other. The
borders are cut alike instead: every border edge of a leaf takes in the vertices that any patch has
along it. Which patch edges lie on a common line is found once for the surfaces; the vertices on each
line are then sorted along it for every field.

Lines are matched by rounding their direction and position. Two roundings, half a step apart, make it
improbable that both tear a pair of equal lines apart; were it to happen, the cost is a hairline. A pair
that is matched by mistake costs nothing, since only vertices that lie on an edge are taken in.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from solver.geometry.surfaces import Surfaces
from solver.illumination.grouping import settle, unite
from solver.illumination.meshing.cells import Leaves
from solver.illumination.meshing.topology import Topology
from solver.kernels import inline_kernel, kernel
from solver.types import Corners, FloatArray, IntArray, Points

_STEP: Final = 1e-6
"""Rounding step of directions, and of positions relative to the scene's size."""

_SHIFT: Final = 0.2360679775
"""Rounding is shifted by this part of a step, so that round numbers do not sit on a boundary."""

_HALF_SPACE: Final = np.array([1.0, 0.6180339887, 0.3572065189])
"""A direction's sign is that of its product with this."""

_ON_LINE: Final = 1e-6
"""A vertex is on an edge if its distance from the edge's line is at most this times the edge's length."""

_MIXER: Final = np.uint64(0x9E3779B97F4A7C15)
_HALF: Final = np.uint64(32)

_APART: Final = 1e-6
"""Vertices on an edge are distinct if they are further apart than this times the edge's length."""


@dataclass(frozen=True, eq=False)
class SeamLines:
    """The common lines of the edges of p patches."""

    line: IntArray
    """(p, 4) line of each patch edge, -1 where no other patch has an edge on it"""
    direction: FloatArray
    """(lines, 3) unit; the same for all edges of a line, so that positions along it compare"""


@dataclass(frozen=True, eq=False)
class Seams:
    """Vertices that border edges take in from other patches."""

    edge: IntArray
    """(s,) the edge 4 l + k, ascending; the vertices of an edge are in its order"""
    fraction: FloatArray
    """(s,) where on the edge, in (0, 1)"""
    position: Points
    """(s, 3) metres, bit-identical with the other patch's vertex"""


def find_lines(surfaces: Surfaces) -> SeamLines:
    """The lines on which edges of several patches of `surfaces` lie."""
    p = surfaces.patch_count
    line = np.full((p, 4), -1, dtype=np.int32)
    patch, slot = np.nonzero(np.arange(4) < surfaces.corner_count[:, None])
    start = surfaces.corners[patch, slot]
    end = surfaces.corners[patch, (slot + 1) % surfaces.corner_count[patch]]
    direction = end - start
    direction = direction / np.linalg.norm(direction, axis=1, keepdims=True)
    # Both ways along a line are one: all directions lie in the half space of an uncommon vector.
    direction = direction * np.where(direction @ _HALF_SPACE < 0.0, -1.0, 1.0)[:, None]
    # The point of the line that is nearest to the scene's centre.
    offset = (start - surfaces.center) / surfaces.size
    offset = offset - np.einsum("ij,ij->i", offset, direction)[:, None] * direction
    label = _group(np.concatenate([direction, offset], axis=1))
    first, group, size = np.unique(label, return_index=True, return_inverse=True, return_counts=True)[1:]
    line[patch, slot] = np.where(size[group] > 1, group, -1)
    return SeamLines(line, direction[first])


def _group(values: FloatArray) -> IntArray:
    """Numbers that are equal for rows of `values` (n, 6) that agree to about a step."""
    label = np.arange(len(values), dtype=np.int32)
    for shift in (_SHIFT, _SHIFT + 0.5):
        key = np.empty(len(values), dtype=np.uint64)
        _hash_rounded(values, shift, key)
        order = np.argsort(key)
        differs = key[order[1:]] != key[order[:-1]]
        unite(order, differs, label)
    settle(label)
    return label


@kernel
def _hash_rounded(values: FloatArray, shift: float, key: NDArray[np.uint64]) -> None:
    """A number (n,) for each row of `values` (n, 6), rounded; lines that have one by chance cost nothing."""
    for i in range(len(values)):
        mixed = np.uint64(0)
        for k in range(values.shape[1]):
            rounded = np.uint64(np.int64(np.floor(values[i, k] / _STEP + shift)))
            mixed = (mixed ^ rounded) * _MIXER
            mixed ^= mixed >> _HALF
        key[i] = mixed


@dataclass(frozen=True, eq=False)
class BorderEdges:
    """The s border edges of leaves that lie on the common lines of several patches."""

    edge: IntArray
    """(s,) 4 l + k, ascending"""
    line: IntArray
    start: IntArray
    """(s,) vertex of the topology"""
    end: IntArray


def edges_on_lines(topology: Topology, leaves: Leaves, surfaces: Surfaces, lines: SeamLines) -> BorderEdges:
    """The border edges of `leaves` that other patches may meet."""
    border = topology.border
    leaf, slot = border >> 2, border & 3
    patch = leaves.patch[leaf]
    start = topology.vertex[leaf, slot]
    end = topology.vertex[leaf, (slot + 1) % leaves.corner_count[leaf]]
    line = np.empty(len(border), dtype=np.int32)
    _find_line(
        patch, surfaces.corner_count, start, end, topology.position, surfaces.corners, lines.line, line
    )
    on_seam = line >= 0
    return BorderEdges(border[on_seam], line[on_seam], start[on_seam], end[on_seam])


def cut_borders(topology: Topology, leaves: Leaves, surfaces: Surfaces, lines: SeamLines) -> Seams:
    """The vertices that the border edges of `leaves` take in from other patches."""
    found = edges_on_lines(topology, leaves, surfaces, lines)
    border, line, start, end = found.edge, found.line, found.start, found.end
    # Sort all ends along their lines; t is measured from the first vertex to keep its digits.
    vertex = np.concatenate([start, end])
    both = np.concatenate([line, line])
    origin = topology.position[vertex[0]] if len(vertex) else np.zeros(3)
    t = np.einsum("ij,ij->i", topology.position[vertex] - origin, lines.direction[both])
    order = np.lexsort((t, both))
    place = np.empty(len(order), dtype=np.int32)
    place[order] = np.arange(len(order), dtype=np.int32)
    first, last = place[: len(border)], place[len(border) :]
    taken = np.zeros(len(border) + 1, dtype=np.int32)
    _count_between(first, last, t[order], taken)
    start_of = np.cumsum(taken, dtype=np.int32)
    between = np.empty(int(start_of[-1]), dtype=np.int32)
    fraction = np.empty(len(between))
    _take_between(first, last, t[order], vertex[order], start_of, between, fraction)
    return Seams(np.repeat(border, taken[1:]), fraction, topology.position[between])


@inline_kernel
def _distance_squared(position: Points, v: int, corners: Corners, p: int, a: int, b: int) -> float:
    """Squared distance of a vertex from the line through corners a and b of patch p."""
    dx = corners[p, b, 0] - corners[p, a, 0]
    dy = corners[p, b, 1] - corners[p, a, 1]
    dz = corners[p, b, 2] - corners[p, a, 2]
    rx = position[v, 0] - corners[p, a, 0]
    ry = position[v, 1] - corners[p, a, 1]
    rz = position[v, 2] - corners[p, a, 2]
    cx = dy * rz - dz * ry
    cy = dz * rx - dx * rz
    cz = dx * ry - dy * rx
    return float((cx * cx + cy * cy + cz * cz) / (dx * dx + dy * dy + dz * dz))


@kernel
def _find_line(
    patch: IntArray,
    corner_count: IntArray,
    start: IntArray,
    end: IntArray,
    position: Points,
    corners: Corners,
    patch_line: IntArray,
    line: IntArray,
) -> None:
    """The line of the patch edge on which each border edge lies, or -1."""
    for i in range(len(patch)):
        p = patch[i]
        line[i] = -1
        length = 0.0
        for axis in range(3):
            length += (position[end[i], axis] - position[start[i], axis]) ** 2
        best = _ON_LINE * _ON_LINE * length
        for k in range(corner_count[p]):
            if patch_line[p, k] < 0:
                continue
            following = (k + 1) % corner_count[p]
            far = max(
                _distance_squared(position, start[i], corners, p, k, following),
                _distance_squared(position, end[i], corners, p, k, following),
            )
            if far <= best:
                best = far
                line[i] = patch_line[p, k]


@kernel
def _count_between(first: IntArray, last: IntArray, t: FloatArray, taken: IntArray) -> None:
    """How many distinct positions lie between the ends of each edge."""
    for i in range(len(first)):
        low = min(first[i], last[i])
        high = max(first[i], last[i])
        apart = _APART * (t[high] - t[low])
        known = t[low]
        for j in range(low + 1, high):
            if t[j] > known + apart and t[j] < t[high] - apart:
                known = t[j]
                taken[i + 1] += 1


@kernel
def _take_between(
    first: IntArray,
    last: IntArray,
    t: FloatArray,
    vertex: IntArray,
    start: IntArray,
    between: IntArray,
    fraction: FloatArray,
) -> None:
    """As `_count_between`, writing the vertices in the order of each edge."""
    for i in range(len(first)):
        low = min(first[i], last[i])
        high = max(first[i], last[i])
        length = t[high] - t[low]
        apart = _APART * length
        known = t[low]
        backwards = first[i] > last[i]
        at = start[i + 1] - 1 if backwards else start[i]
        for j in range(low + 1, high):
            if t[j] > known + apart and t[j] < t[high] - apart:
                known = t[j]
                along = (known - t[low]) / length
                between[at] = vertex[j]
                fraction[at] = 1.0 - along if backwards else along
                at += -1 if backwards else 1

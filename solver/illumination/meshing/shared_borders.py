"""The places along common lines at which any patch has a vertex: what all of them must have there.

Vertices of different patches are one place where rounding alone parts them. Places are numbered along
each line, so that a border edge between two of them takes in exactly those whose numbers lie between.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.geometry.surfaces import Surfaces
from solver.illumination.meshing.cells import Leaves
from solver.illumination.meshing.seams import BorderEdges, SeamLines, edges_on_lines
from solver.illumination.meshing.topology import Topology
from solver.kernels import kernel
from solver.types import FloatArray, IntArray, Points

_SAME: Final = 1e-7
"""Vertices of different patches on a line are one place if the gap between them is at most this times the
scene's size: the spacing of float32 in the unit box in which a scene is drawn."""

_ON_EDGE: Final = 1e-6
"""A place is taken in by an edge if its distance from the edge is at most this times the edge's length."""

_THIN: Final = 4e-6
"""A patch shares its borders if it is wider than this times the scene's size. Both sides of a thinner one may
count as one line; what it leaves open is far narrower than a pixel."""


@dataclass(frozen=True, eq=False)
class SharedBorders:
    """s border edges on common lines, and c places on those lines."""

    edge: IntArray
    """(s,) 4 l + k, ascending"""
    first: IntArray
    """(s,) place of the edge's start"""
    last: IntArray
    """(s,) place of its end"""
    taken_start: IntArray
    """(s + 1,) where each edge's part of `taken` begins"""
    taken: IntArray
    """Places strictly inside an edge, edge by edge, from its start to its end"""
    position: Points
    """(c, 3) metres"""


def share_borders(topology: Topology, leaves: Leaves, surfaces: Surfaces, lines: SeamLines) -> SharedBorders:
    """The places along the borders of the patches of `leaves`."""
    on = edges_on_lines(topology, leaves, surfaces, lines)
    corners = surfaces.corners
    spread = np.linalg.norm(corners[:, :, None] - corners[:, None], axis=-1).max(axis=(1, 2))
    is_wide = (surfaces.area > _THIN * surfaces.size * spread)[leaves.patch[on.edge >> 2]]
    on = BorderEdges(on.edge[is_wide], on.line[is_wide], on.start[is_wide], on.end[is_wide])
    s = len(on.edge)
    vertex = np.concatenate([on.start, on.end])
    line = np.concatenate([on.line, on.line])
    # Numbers ascend along each line; a gap begins a new one.
    t = np.einsum("ij,ij->i", topology.position[vertex] - surfaces.center, lines.direction[line])
    order = np.lexsort((t, line))
    is_new = np.ones(2 * s, dtype=np.bool_)
    is_new[1:] = (np.diff(line[order]) != 0) | (np.diff(t[order]) > _SAME * surfaces.size)
    place = np.empty(2 * s, dtype=np.int32)
    place[order] = np.cumsum(is_new, dtype=np.int32) - np.int32(1)
    position = topology.position[vertex[order[is_new]]]
    first, last = place[:s], place[s:]
    room = np.zeros(s + 1, dtype=np.int32)
    np.cumsum(np.maximum(np.abs(last - first) - 1, 0), out=room[1:])
    taken = np.empty(room[-1], dtype=np.int32)
    taken_start = np.zeros(s + 1, dtype=np.int32)
    total = _take_between(
        first, last, topology.position[on.start], topology.position[on.end], position, taken_start, taken
    )
    return SharedBorders(on.edge, first, last, taken_start, taken[:total], position)


@kernel
def _take_between(
    first: IntArray,
    last: IntArray,
    start: Points,
    end: Points,
    position: Points,
    taken_start: IntArray,
    taken: IntArray,
) -> int:
    """List the places inside each edge; returns how many."""
    total = 0
    for i in range(len(first)):
        step = 1 if last[i] > first[i] else -1
        place = first[i] + step
        while (last[i] - place) * step > 0:
            if _is_on(start[i], end[i], position[place]):
                taken[total] = place
                total += 1
            place += step
        taken_start[i + 1] = total
    return total


@kernel
def _is_on(a: FloatArray, b: FloatArray, x: FloatArray) -> bool:
    """Whether x lies on the edge from a to b, all (3,)."""
    length = 0.0
    along = 0.0
    far = 0.0
    for axis in range(3):
        length += (b[axis] - a[axis]) ** 2
        along += (b[axis] - a[axis]) * (x[axis] - a[axis])
    for axis in range(3):
        far += (x[axis] - a[axis] - along / length * (b[axis] - a[axis])) ** 2
    return bool(0.0 < along < length and far <= _ON_EDGE * _ON_EDGE * length)

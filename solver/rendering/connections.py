"""How the leaves of a field hang together, found anew for those patches alone whose leaves have changed.

Leaves of different patches share nothing (`solver.illumination.meshing.topology`), so that with leaves patch
by patch vertices, edges and what hangs on them come patch by patch too: what is known of a patch moves to its
new place as a whole, and its numbers by as much. What is told from rounding there goes by the greatest
coordinate of what is connected at once; it is far from either for leaves that are made by halving.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from solver.illumination.meshing.topology import Topology, connect
from solver.kernels import kernel
from solver.parallel import run_chunks
from solver.rendering.leaf_blocks import LeafBlocks
from solver.types import FloatArray, Int64Array, IntArray

_PATCHES: Final = 128
"""Patches of a piece of work"""


class _Arrays(NamedTuple):
    """A topology, as kernels take it."""

    vertex: IntArray
    position: FloatArray
    leaf_start: IntArray
    leaf_edge: IntArray
    hanging_on: IntArray
    inside_start: IntArray
    inside: IntArray
    border: IntArray


@dataclass(frozen=True, eq=False)
class Connections:
    """A topology of leaves in blocks."""

    topology: Topology
    start: IntArray
    """(5, p + 1) where leaves, vertices, `leaf_edge`, `inside` and `border` of each patch begin"""

    @staticmethod
    def of(blocks: LeafBlocks) -> Connections:
        """The connections of all blocks."""
        t = connect(blocks)
        leaf = blocks.start
        # A vertex is numbered when its first leaf is met.
        vertex = np.append(t.vertex[:, 0], np.int32(len(t.position)))[leaf]
        border = np.searchsorted(t.border, 4 * leaf)
        start = np.stack([leaf, vertex, t.leaf_start[vertex], t.inside_start[4 * leaf], border])
        return Connections(t, start.astype(np.int32))

    def updated(self, blocks: LeafBlocks, earlier: IntArray) -> Connections:
        """The connections of `blocks`: these, where `earlier` (p,) names the patch here that has the same
        leaves, and found where it is -1.
        """
        found = Connections.of(blocks.only(earlier < 0))
        kept: Int64Array = np.flatnonzero(earlier >= 0)
        fresh: Int64Array = np.flatnonzero(earlier < 0)
        size = np.empty((5, len(earlier)), dtype=np.int32)
        size[:, kept] = np.diff(self.start)[:, earlier[kept]]
        size[:, fresh] = np.diff(found.start)[:, fresh]
        start = np.zeros((5, len(earlier) + 1), dtype=np.int32)
        np.cumsum(size, axis=1, out=start[:, 1:])
        made = _allocate(*start[:, -1].tolist())
        _take(self, earlier[kept].astype(np.int64), kept, start, made)
        _take(found, fresh, fresh, start, made)
        made.leaf_start[-1], made.inside_start[-1] = len(made.leaf_edge), len(made.inside)
        return Connections(Topology(**made._asdict()), start)


def _allocate(leaves: int, vertices: int, edges: int, inside: int, border: int) -> _Arrays:
    def numbers(*shape: int) -> IntArray:
        return np.empty(shape, dtype=np.int32)

    return _Arrays(
        vertex=numbers(leaves, 4),
        position=np.empty((vertices, 3)),
        leaf_start=numbers(vertices + 1),
        leaf_edge=numbers(edges),
        hanging_on=numbers(vertices),
        inside_start=numbers(4 * leaves + 1),
        inside=numbers(inside),
        border=numbers(border),
    )


def _take(source: Connections, patch: Int64Array, place: Int64Array, start: IntArray, made: _Arrays) -> None:
    """Take what `source` has of each `patch` (k,) to its `place` (k,)."""
    arrays = _Arrays(**vars(source.topology))
    first = np.ascontiguousarray(source.start[:, patch].T)
    after = np.ascontiguousarray(source.start[:, patch + 1].T)
    to = np.ascontiguousarray(start[:, place].T)
    run_chunks(lambda begin, end: _copy(begin, end, first, after, to, arrays, made), len(patch), _PATCHES)


@kernel
def _copy(
    begin: int,
    end: int,
    first: IntArray,
    after: IntArray,
    to: IntArray,
    source: _Arrays,
    made: _Arrays,
) -> None:
    """Copy the parts `first` to `after` (k, 5) of `source` to places `to` (k, 5), numbers shifted alike."""
    for k in range(begin, end):
        leaf = to[k, 0] - first[k, 0]
        vertex = to[k, 1] - first[k, 1]
        edge = to[k, 2] - first[k, 2]
        inside = to[k, 3] - first[k, 3]
        border = to[k, 4] - first[k, 4]
        for i in range(first[k, 0], after[k, 0]):
            for j in range(4):
                made.vertex[i + leaf, j] = source.vertex[i, j] + vertex
                made.inside_start[4 * (i + leaf) + j] = source.inside_start[4 * i + j] + inside
        for i in range(first[k, 1], after[k, 1]):
            for axis in range(3):
                made.position[i + vertex, axis] = source.position[i, axis]
            made.leaf_start[i + vertex] = source.leaf_start[i] + edge
            hanging = source.hanging_on[i]
            made.hanging_on[i + vertex] = hanging + leaf if hanging >= 0 else -1
        for i in range(first[k, 2], after[k, 2]):
            made.leaf_edge[i + edge] = source.leaf_edge[i] + 4 * leaf
        for i in range(first[k, 3], after[k, 3]):
            made.inside[i + inside] = source.inside[i] + vertex
        for i in range(first[k, 4], after[k, 4]):
            made.border[i + border] = source.border[i] + 4 * leaf

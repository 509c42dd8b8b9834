"""All that a triangulation follows from: the nodes, rings and inner edges of every cell, patch by patch.

Within a patch everything is told relative to the patch's first node, so that a patch whose part is equal to
that of an earlier linework has the same triangles, whatever has become of the others.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.illumination.meshing.arrangement import Arrangement
from solver.illumination.meshing.cells import Cells, ConstraintEdges
from solver.illumination.meshing.rings import Rings
from solver.illumination.meshing.skeleton import Skeleton
from solver.kernels import kernel
from solver.types import AnyArray, BoolArray, IntArray, Points

_CROWDED: Final = 2
"""Nodes besides its corners from which a cell without inner edges gets a vertex in its middle."""


@dataclass(frozen=True, eq=False)
class Linework:
    """v nodes and n cells, both sorted by patch; p patches."""

    position: Points
    """(v, 3) metres"""
    node_start: IntArray
    """(p + 1,) where each patch's nodes begin"""
    cell_start: IntArray
    """(p + 1,) where each patch's cells begin"""
    corner_count: IntArray
    """(n,) 3 or 4"""
    ring_start: IntArray
    """(n + 1,)"""
    ring: IntArray
    """(l,) nodes along the outline of each cell, from corner 0 on; from the patch's first"""
    inner_start: IntArray
    """(n + 1,)"""
    inner: IntArray
    """(i,) nodes within each cell; from the patch's first"""
    edge_start: IntArray
    """(n + 1,)"""
    edge: IntArray
    """(j, 2) inner edges of each cell, between places in its ring, followed by its inner nodes"""
    label_start: IntArray
    """(p + 1,)"""
    label: IntArray
    """(k, 4) edges on constraints: two nodes from the patch's first, set, jump; jumps come first"""

    @property
    def patch_count(self) -> int:
        """Number of patches."""
        return len(self.cell_start) - 1

    @property
    def cell_patch(self) -> IntArray:
        """(n,) patch of each cell."""
        return np.repeat(np.arange(self.patch_count, dtype=np.int32), np.diff(self.cell_start))

    def same_patches(self, other: Linework) -> BoolArray:
        """(p,) which patches are drawn exactly as in `other`."""
        p = min(self.patch_count, other.patch_count)
        same = np.zeros(self.patch_count, dtype=np.bool_)
        same[:p] = True
        for mine, theirs in zip(self._parts(), other._parts(), strict=True):
            _compare(mine[0][: p + 1], mine[1], theirs[0][: p + 1], theirs[1], same)
        return same

    def _parts(self) -> list[tuple[IntArray, AnyArray]]:
        """Everything, as rows of bits, with where each patch's rows begin."""
        counts = [
            self.corner_count,
            *(np.diff(s) for s in (self.ring_start, self.inner_start, self.edge_start)),
        ]
        return [
            (self.node_start, self.position.view(np.int64)),
            (self.cell_start, np.stack(counts, axis=1)),
            (self.ring_start[self.cell_start], self.ring[:, None]),
            (self.inner_start[self.cell_start], self.inner[:, None]),
            (self.edge_start[self.cell_start], self.edge),
            (self.label_start, self.label),
        ]


def draw_lines(
    cells: Cells,
    edges: ConstraintEdges,
    skeleton: Skeleton,
    rings: Rings,
    arrangement: Arrangement,
    patch_count: int,
    middles: bool,
) -> Linework:
    """The linework of `cells`, which are sorted by patch.

    With `middles`, a cell with several nodes inside its sides and no inner edge gets one in its middle.
    """
    n, b = len(cells.patch), len(skeleton.position)
    ring = np.empty(len(rings.stop), dtype=np.int32)
    source = np.empty(len(rings.stop), dtype=np.int32)
    count = _number_ring(rings.stop, rings.piece, skeleton.owner, b, ring, source)
    source = source[:count]
    stretch_cell = np.repeat(np.arange(n, dtype=np.int32), np.diff(rings.start))
    # Inner nodes: vertices of the arrangement, or middles of cells that have none.
    edge_start = _starts(arrangement.edge_cell, n)
    extra = np.diff(rings.start) - cells.corner_count
    crowded = np.flatnonzero((extra >= _CROWDED) & (np.diff(edge_start) == 0) & middles).astype(np.int32)
    inner_cell = np.concatenate([arrangement.vertex_cell, crowded])
    by_cell = np.argsort(inner_cell, kind="stable")
    inner_cell = inner_cell[by_cell]
    # All nodes, sorted by patch.
    patch = np.concatenate([skeleton.patch, cells.patch[stretch_cell[source]], cells.patch[inner_cell]])
    position = np.concatenate(
        [
            skeleton.position,
            rings.position[rings.stop[source]],
            np.concatenate([arrangement.vertex, skeleton.center[crowded]])[by_cell],
        ]
    )
    order = np.argsort(patch, kind="stable")
    node_start = _starts(patch, patch_count)
    number = np.empty(len(order), dtype=np.int32)
    number[order] = np.arange(len(order), dtype=np.int32) - node_start[patch[order]]
    ring = number[ring]
    # Edges that are on constraints, within cells and along their rings.
    after = np.arange(1, len(ring) + 1)
    after[rings.start[1:] - 1] = rings.start[:-1]
    inner_start = _starts(inner_cell, n)
    inner = number[b + count :]
    ends = _nodes_at(arrangement.edge_cell, arrangement.edge_ends, rings.start, ring, inner_start, inner)
    mark = arrangement.mark
    constraint = np.concatenate([arrangement.edge_constraint, arrangement.mark_constraint])
    label = np.concatenate(
        [
            np.concatenate([ends, np.stack([ring[mark], ring[after[mark]]], axis=1)]),
            np.stack([edges.set[constraint], edges.jump[constraint]], axis=1),
        ],
        axis=1,
    ).astype(np.int32)
    on = edges.patch[constraint]
    return Linework(
        position=position[order] + 0.0,
        node_start=node_start,
        cell_start=_starts(cells.patch, patch_count),
        corner_count=cells.corner_count,
        ring_start=rings.start,
        ring=ring,
        inner_start=inner_start,
        inner=inner,
        edge_start=edge_start,
        edge=arrangement.edge_ends,
        label_start=_starts(on, patch_count),
        label=label[np.lexsort((1 - label[:, 3], on))],
    )


def _starts(group: IntArray, count: int) -> IntArray:
    """(count + 1,) where each group's part begins in what is sorted by `group`."""
    start = np.zeros(count + 1, dtype=np.int32)
    np.cumsum(np.bincount(group, minlength=count), out=start[1:])
    return start


def _nodes_at(
    cell: IntArray,
    place: IntArray,
    ring_start: IntArray,
    ring: IntArray,
    inner_start: IntArray,
    inner: IntArray,
) -> IntArray:
    """Nodes (j, 2) at places in the rings, followed by the inner nodes, of `cell` (j,)."""
    length = (ring_start[cell + 1] - ring_start[cell])[:, None]
    everything = np.concatenate([ring, inner])
    at = np.where(
        place < length,
        ring_start[cell][:, None] + place,
        len(ring) + inner_start[cell][:, None] + place - length,
    )
    return np.asarray(everything[at])


@kernel
def _number_ring(
    stop: IntArray, piece: IntArray, owner: IntArray, node_count: int, ring: IntArray, source: IntArray
) -> int:
    """Number the points on rails behind the nodes, one for each patch that has them; returns how many.

    `ring` (l,) receives the numbers, `source` the place in the rings where each point came first.
    """
    found = 0
    entry = np.empty(len(owner), dtype=np.int32)
    length = np.zeros(len(owner), dtype=np.int32)
    for i in range(len(stop)):
        if stop[i] < node_count:
            entry[piece[i]] = i
        else:
            length[piece[i]] += 1
    for i in range(len(stop)):
        first = owner[piece[i]]
        if stop[i] < node_count:
            ring[i] = stop[i]
        elif first == piece[i]:
            ring[i] = node_count + found
            source[found] = i
            found += 1
        else:
            # The other side of the edge runs the other way.
            ring[i] = ring[entry[first] + length[first] + 1 - (i - entry[piece[i]])]
    return found


@kernel
def _compare(
    start: IntArray, rows: AnyArray, other_start: IntArray, other_rows: AnyArray, same: BoolArray
) -> None:
    """Unset `same` (>= p,) where the rows of a patch differ from the other's."""
    for patch in range(len(start) - 1):
        count = start[patch + 1] - start[patch]
        if count != other_start[patch + 1] - other_start[patch]:
            same[patch] = False
        i = 0
        while same[patch] and i < count:
            for k in range(rows.shape[1]):
                if rows[start[patch] + i, k] != other_rows[other_start[patch] + i, k]:
                    same[patch] = False
            i += 1

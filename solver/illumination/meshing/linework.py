"""All that a triangulation follows from: the nodes, outlines and inner edges of every cell, sorted by patch.

Edges of a cell run between places: the nodes of its ring in their order, then those within it. Whatever
becomes of other cells and of the numbers of nodes, a cell that is drawn alike has the same places.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.geometry.surfaces import Surfaces
from solver.illumination.meshing.arrangement import Arrangement
from solver.illumination.meshing.cells import Cells, ConstraintEdges
from solver.illumination.meshing.ragged import spread, starts
from solver.illumination.meshing.rings import Rings
from solver.illumination.meshing.skeleton import Skeleton
from solver.kernels import kernel
from solver.types import FloatArray, IntArray, Points

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
    ring_length: IntArray
    """(n,) nodes along the outline of each cell"""
    start: IntArray
    """(n + 1,) where each cell's places begin"""
    node: IntArray
    """(k,) the node at each place: those along the outline from corner 0 on, then those within"""
    edge_start: IntArray
    """(n + 1,)"""
    edge: IntArray
    """(j, 2) inner edges of each cell, between its places"""
    label_start: IntArray
    """(p + 1,)"""
    label: IntArray
    """(l, 4) edges on constraints: two nodes, set, jump; those with a jump come first in each patch"""
    center: Points
    """(n, 3) and"""
    axes: FloatArray
    """(n, 2, 3) the frame of each cell, as `Skeleton` has it"""
    normal: Points
    """(p, 3) of each patch"""

    @property
    def patch_count(self) -> int:
        """Number of patches."""
        return len(self.cell_start) - 1

    @property
    def cell_patch(self) -> IntArray:
        """(n,) patch of each cell."""
        return np.repeat(np.arange(self.patch_count, dtype=np.int32), np.diff(self.cell_start))


def draw_lines(
    cells: Cells,
    surfaces: Surfaces,
    edges: ConstraintEdges,
    skeleton: Skeleton,
    rings: Rings,
    arrangement: Arrangement,
    middles: bool,
) -> Generator[None, None, Linework]:
    """The linework of `cells`, which are sorted by patch; yields every few milliseconds.

    With `middles`, a cell with several nodes inside its sides and no inner edge gets one in its middle.
    """
    n, b, p = len(cells.patch), len(skeleton.position), surfaces.patch_count
    ring = np.empty(len(rings.stop), dtype=np.int32)
    source = np.empty(len(rings.stop), dtype=np.int32)
    count = _number_ring(rings.stop, rings.piece, skeleton.owner, b, ring, source)
    source = source[:count]
    ring_length = np.diff(rings.start)
    stretch_cell = np.repeat(np.arange(n, dtype=np.int32), ring_length)
    # Inner nodes: vertices of the arrangement, or middles of cells that have none.
    edge_start = starts(arrangement.edge_cell, n)
    extra = ring_length - cells.corner_count
    crowded = np.flatnonzero((extra >= _CROWDED) & (np.diff(edge_start) == 0) & middles).astype(np.int32)
    inner_cell = np.concatenate([arrangement.vertex_cell, crowded])
    by_cell = np.argsort(inner_cell, kind="stable")
    inner_cell = inner_cell[by_cell]
    yield
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
    number = np.empty(len(order), dtype=np.int32)
    number[order] = np.arange(len(order), dtype=np.int32)
    yield
    # The nodes at the places of each cell.
    inner_length = np.bincount(inner_cell, minlength=n)
    start = np.zeros(n + 1, dtype=np.int32)
    np.cumsum(ring_length + inner_length, out=start[1:])
    node = np.empty(start[-1], dtype=np.int32)
    at_ring = spread(start[:-1], ring_length)
    node[at_ring] = number[ring]
    node[spread(start[:-1] + ring_length, inner_length)] = number[b + count :]
    yield
    # Edges that are on constraints, within cells and along their rings.
    after = np.arange(1, len(ring) + 1)
    after[rings.start[1:] - 1] = rings.start[:-1]
    mark = arrangement.mark
    constraint = np.concatenate([arrangement.edge_constraint, arrangement.mark_constraint])
    ends = np.concatenate(
        [
            node[start[arrangement.edge_cell][:, None] + arrangement.edge_ends],
            node[np.stack([at_ring[mark], at_ring[after[mark]]], axis=1)],
        ]
    )
    label = np.column_stack([ends, edges.set[constraint], edges.jump[constraint]]).astype(np.int32)
    on = edges.patch[constraint]
    yield
    return Linework(
        position=position[order] + 0.0,
        node_start=starts(patch, p),
        cell_start=starts(cells.patch, p),
        corner_count=cells.corner_count,
        ring_length=ring_length,
        start=start,
        node=node,
        edge_start=edge_start,
        edge=arrangement.edge_ends,
        label_start=starts(on, p),
        label=label[np.lexsort((1 - label[:, 3], on))],
        center=skeleton.center,
        axes=skeleton.axes,
        normal=surfaces.normal,
    )


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

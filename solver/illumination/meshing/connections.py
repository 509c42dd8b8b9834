"""What triangles of patches have across and along their edges: neighbours and discontinuities."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass

import numpy as np

from solver.illumination.meshing.adjacency import edge_labels, opposite_edges
from solver.illumination.meshing.linework import Linework
from solver.transport.pace import Pace
from solver.types import BoolArray, IntArray


@dataclass(frozen=True, eq=False)
class Connections:
    """Of t triangles; edge k runs from corner k to the next."""

    edge_set: IntArray
    """(t, 3) set of discontinuities on each edge, or -1"""
    edge_jump: BoolArray
    """(t, 3)"""
    neighbour: IntArray
    """(t, 3) triangle of the same patch across each edge, or -1"""


def connect_triangles(
    triangles: IntArray, start: IntArray, lines: Linework
) -> Generator[None, None, Connections]:
    """The connections of `triangles` (t, 3) between nodes of `lines`; yields every few milliseconds.

    They are sorted by patch; each patch's begin at `start` (p + 1,).
    """
    t = len(triangles)
    found = Connections(
        np.empty((t, 3), dtype=np.int32), np.empty((t, 3), dtype=np.bool_), np.empty((t, 3), dtype=np.int32)
    )
    # Triangles, nodes and labels of some patches, from the first of each on: patches share none.
    for part in Pace().batches(np.diff(start).astype(np.int64)):
        first, last = start[part.start], start[part.stop]
        node, end = lines.node_start[part.start], lines.node_start[part.stop]
        label = lines.label[lines.label_start[part.start] : lines.label_start[part.stop]]
        corner = triangles[first:last] - node
        here, following = corner.ravel(), corner[:, [1, 2, 0]].ravel()
        opposite = opposite_edges(here, following, end - node).reshape(-1, 3)
        found.neighbour[first:last] = np.where(opposite < 0, np.int32(-1), opposite // np.int32(3) + first)
        yield
        rows = np.arange(len(label), dtype=np.int32)
        row = edge_labels(label[:, 0] - node, label[:, 1] - node, rows, here, following, end - node)
        # The last row, which -1 stands for, is that of edges on no constraint.
        told = np.concatenate([label[:, 2:], np.array([[-1, 0]], dtype=np.int32)])[row].reshape(-1, 3, 2)
        found.edge_set[first:last], found.edge_jump[first:last] = told[:, :, 0], told[:, :, 1] != 0
        yield
    return found

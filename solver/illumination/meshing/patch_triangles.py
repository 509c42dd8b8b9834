"""Triangles of patches, told so that they stay true when other patches change."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.illumination.meshing.adjacency import edge_labels, opposite_edges
from solver.illumination.meshing.delaunay import CellTriangles
from solver.illumination.meshing.linework import Linework
from solver.types import AnyArray, BoolArray, IntArray


@dataclass(frozen=True, eq=False)
class PatchTriangles:
    """t triangles of p patches, each in numbers from its patch's first vertex, cell and triangle."""

    start: IntArray
    """(p + 1,) where each patch's triangles begin"""
    triangles: IntArray
    """(t, 3) vertices"""
    cell: IntArray
    """(t,) ascending in each patch"""
    edge_set: IntArray
    """(t, 3) set of discontinuities on each edge, or -1"""
    edge_jump: BoolArray
    """(t, 3)"""
    neighbour: IntArray
    """(t, 3) triangle across each edge, or -1"""

    @property
    def patch(self) -> IntArray:
        """(t,) patch of each triangle."""
        return np.repeat(np.arange(len(self.start) - 1, dtype=np.int32), np.diff(self.start))


def connect_triangles(found: CellTriangles, lines: Linework) -> PatchTriangles:
    """`found`, triangles of `lines`, with their neighbours and what lies on their edges."""
    t, v = len(found.cell), len(lines.position)
    patch = lines.cell_patch[found.cell]
    start = np.zeros(lines.patch_count + 1, dtype=np.int32)
    np.cumsum(np.bincount(patch, minlength=lines.patch_count), out=start[1:])
    corners = found.triangles + lines.node_start[patch][:, None]
    corner, following = corners.ravel(), corners[:, [1, 2, 0]].ravel()
    opposite = opposite_edges(corner, following, v).reshape(t, 3)
    first = np.repeat(lines.node_start[:-1], np.diff(lines.label_start))
    a, b = lines.label[:, 0] + first, lines.label[:, 1] + first
    row = edge_labels(a, b, np.arange(len(a), dtype=np.int32), corner, following, v)
    # The last row, which -1 stands for, is that of edges on no constraint.
    labels = np.concatenate([lines.label[:, 2:], np.array([[-1, 0]], dtype=np.int32)])[row].reshape(t, 3, 2)
    return PatchTriangles(
        start=start,
        triangles=found.triangles,
        cell=found.cell - lines.cell_start[patch],
        edge_set=np.ascontiguousarray(labels[:, :, 0]),
        edge_jump=labels[:, :, 1] != 0,
        neighbour=np.where(opposite < 0, np.int32(-1), opposite // np.int32(3) - start[patch][:, None]),
    )


def keep_triangles(fresh: PatchTriangles, previous: PatchTriangles, kept: BoolArray) -> PatchTriangles:
    """The triangles of `previous` for patches that are `kept` (p,), of `fresh` for the others."""
    p, offset = len(kept), len(fresh.cell)
    known = np.flatnonzero(kept)
    source = fresh.start[:-1].copy()
    count = np.diff(fresh.start)
    source[known] = previous.start[known] + offset
    count[known] = np.diff(previous.start)[known]
    start = np.zeros(p + 1, dtype=np.int32)
    np.cumsum(count, out=start[1:])
    index = np.arange(start[-1]) - np.repeat(start[:-1] - source, count)

    def chosen(new: AnyArray, old: AnyArray) -> AnyArray:
        return np.asarray(np.concatenate([new, old])[index])

    return PatchTriangles(
        start=start,
        triangles=chosen(fresh.triangles, previous.triangles),
        cell=chosen(fresh.cell, previous.cell),
        edge_set=chosen(fresh.edge_set, previous.edge_set),
        edge_jump=chosen(fresh.edge_jump, previous.edge_jump),
        neighbour=chosen(fresh.neighbour, previous.neighbour),
    )

"""Cells taken out of a linework, each by itself: all that its triangles follow from, and nothing else.

What a cell becomes depends on what is here alone, bit for bit: not on the cells around it, on their number
or order, nor on the numbers of nodes. Only so are triangles of one linework those of another.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from solver.illumination.meshing.linework import Linework
from solver.illumination.meshing.ragged import spread, starts_of
from solver.types import AnyArray, BoolArray, FloatArray, Int64Array, IntArray, Points


@dataclass(frozen=True, eq=False)
class CellLines:
    """c cells with k places in all. A cell's places are the nodes of its ring, then those within it."""

    corner_count: IntArray
    """(c,) 3 or 4"""
    ring_length: IntArray
    """(c,)"""
    start: IntArray
    """(c + 1,) where each cell's places begin"""
    position: Points
    """(k, 3) metres"""
    edge_start: IntArray
    """(c + 1,)"""
    edge: IntArray
    """(j, 2) inner edges, between places of their cell, from 0 on"""
    center: Points
    """(c, 3)"""
    axes: FloatArray
    """(c, 2, 3)"""
    normal: Points
    """(c, 3)"""

    def __len__(self) -> int:
        return len(self.corner_count)

    @classmethod
    def of(cls, lines: Linework, cells: AnyArray) -> CellLines:
        """Some `cells` (c,) of `lines`, in that order."""
        places, edges = np.diff(lines.start)[cells], np.diff(lines.edge_start)[cells]
        return cls(
            corner_count=lines.corner_count[cells],
            ring_length=lines.ring_length[cells],
            start=starts_of(places),
            position=lines.position[lines.node[spread(lines.start[cells], places)]],
            edge_start=starts_of(edges),
            edge=lines.edge[spread(lines.edge_start[cells], edges)],
            center=lines.center[cells],
            axes=lines.axes[cells],
            normal=lines.normal[lines.cell_patch[cells]],
        )

    def take(self, rows: AnyArray) -> CellLines:
        """Some of these cells, in the order of `rows` (r,)."""
        places, edges = np.diff(self.start)[rows], np.diff(self.edge_start)[rows]
        return CellLines(
            corner_count=self.corner_count[rows],
            ring_length=self.ring_length[rows],
            start=starts_of(places),
            position=self.position[spread(self.start[rows], places)],
            edge_start=starts_of(edges),
            edge=self.edge[spread(self.edge_start[rows], edges)],
            center=self.center[rows],
            axes=self.axes[rows],
            normal=self.normal[rows],
        )

    @cached_property
    def place_row(self) -> Int64Array:
        """(k,) which of the cells each place is of."""
        return np.repeat(np.arange(len(self)), np.diff(self.start))

    def same(self, other: CellLines) -> BoolArray:
        """(c,) which cells are drawn exactly as their counterparts in `other`, a cell for each of these.

        Those must have as many places and edges.
        """
        differs = [
            self.place_row[_unlike(self.position, other.position)],
            np.repeat(np.arange(len(self)), np.diff(self.edge_start))[_unlike(self.edge, other.edge)],
            *(
                np.flatnonzero(_unlike(mine, theirs))
                for mine, theirs in (
                    (self.corner_count, other.corner_count),
                    (self.ring_length, other.ring_length),
                    (self.center, other.center),
                    (self.axes, other.axes),
                    (self.normal, other.normal),
                )
            ),
        ]
        same = np.ones(len(self), dtype=np.bool_)
        same[np.concatenate(differs)] = False
        return same


def _unlike(mine: AnyArray, theirs: AnyArray) -> BoolArray:
    """(n,) whether rows differ in any bit."""
    if mine.dtype == np.float64:
        mine, theirs = mine.view(np.int64), theirs.view(np.int64)
    return np.asarray((mine != theirs).any(axis=tuple(range(1, mine.ndim))))

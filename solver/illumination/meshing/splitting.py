"""Cells that are too coarse for what light does on them split, as elements of the solve do ([H 4.4.2])."""

from __future__ import annotations

import numpy as np

from solver.illumination.meshing.cells import Cells
from solver.transport.subdivision import count_children, make_children
from solver.types import BoolArray


def split_cells(cells: Cells, chosen: BoolArray) -> Cells:
    """`cells` with those where `chosen` (n,) is true in two or four parts, which keep their leaf."""
    ids = np.flatnonzero(chosen).astype(np.int32)
    if len(ids) == 0:
        return cells
    n = len(cells.patch)
    counts = np.empty(len(ids), dtype=np.int32)
    count_children(cells.corners, cells.corner_count, ids, counts)
    first = (n + np.cumsum(counts) - counts).astype(np.int32)
    total = n + int(counts.sum())
    corners = np.empty((total, 4, 3))
    corner_count, patch, parent = (np.empty(total, dtype=np.int32) for _ in range(3))
    corners[:n], corner_count[:n], patch[:n] = cells.corners, cells.corner_count, cells.patch
    make_children(ids, first, counts, corners, corner_count, patch, parent, np.empty(total))
    leaf = np.concatenate([cells.leaf, np.repeat(cells.leaf[ids], counts)])
    keep = np.ones(total, dtype=np.bool_)
    keep[ids] = False
    return Cells(corners[keep], corner_count[keep], patch[keep], leaf[keep])

"""Cells that are drawn as they were: what they became before, they become again.

A cell is looked for by its frame, which its corners alone decide, whatever its number has become. Found, it
is the same if all that its triangles follow from is the same to the last bit.
"""

from __future__ import annotations

from collections.abc import Generator

import numpy as np

from solver.illumination.meshing.cell_lines import CellLines
from solver.illumination.meshing.linework import Linework
from solver.illumination.meshing.topology import HASH, table_size
from solver.kernels import kernel
from solver.transport.pace import Pace
from solver.types import Int64Array, IntArray


def find_unchanged(lines: Linework, known: Linework) -> Generator[None, None, IntArray]:
    """(n,) the cell of `known` that is drawn exactly as each cell of `lines`, or -1.

    Yields every few milliseconds.
    """
    found = _find(_frames(lines), _frames(known))
    yield
    for mine, theirs in ((lines.start, known.start), (lines.edge_start, known.edge_start)):
        other = np.diff(mine) != np.append(np.diff(theirs), -1)[found]
        found[other] = -1
    cells = np.flatnonzero(found >= 0)
    for part in Pace().batches(np.diff(lines.start)[cells].astype(np.int64)):
        chosen = cells[part]
        same = CellLines.of(lines, chosen).same(CellLines.of(known, found[chosen]))
        found[chosen[~same]] = -1
        yield
    return found


def _frames(lines: Linework) -> Int64Array:
    """(n, 9) the frames of cells as bits."""
    return np.hstack([lines.center, lines.axes.reshape(-1, 6)]).view(np.int64)


def _find(rows: Int64Array, known: Int64Array) -> IntArray:
    """(n,) which of `known` (m, k), the first of several, equals each of `rows` (n, k); or -1."""
    table = np.full(table_size(len(known)), -1, dtype=np.int32)
    found = np.empty(len(rows), dtype=np.int32)
    _look_up(rows, known, table, found)
    return found


@kernel
def _look_up(rows: Int64Array, known: Int64Array, table: IntArray, found: IntArray) -> None:
    """`table` is open-addressed; known rows are entered first."""
    mask = len(table) - 1
    for i in range(len(known) + len(rows)):
        row = known[i] if i < len(known) else rows[i - len(known)]
        h = 0
        for k in range(len(row)):
            h = ((h ^ (h >> 32)) + row[k]) * HASH
        place = (h >> 24) & mask
        while table[place] >= 0 and not np.array_equal(known[table[place]], row):
            place = (place + 1) & mask
        if i >= len(known):
            found[i - len(known)] = table[place]
        elif table[place] < 0:
            table[place] = i

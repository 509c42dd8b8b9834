"""The lines within each cell made into a plane graph: no two cross, and none comes near a vertex it misses.

A line that comes nearer to a vertex than the vertex's radius is led through it; lines that cross get a
vertex there, or the vertex that is near; a line along a side of its cell marks the stretches it covers.
What that has moved is looked at again, until nothing is left to do. The rules keep vertices twice their
radius apart and edges one radius off all vertices but their own: far above rounding, so that every
decision is safe in floating point and stays so in any frame. Lines move by a few radii.

A crossing that falls on a side wants a vertex there, which the neighbour must have too. It is asked for;
when its rail has got it, all is arranged anew. Rails only ever gain points, twice their reach apart: the
asking ends.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np

from solver.illumination.meshing.arrangement_kernels import arrange_cells
from solver.illumination.meshing.cells import ConstraintEdges
from solver.illumination.meshing.crossings import Chords
from solver.illumination.meshing.rails import RailPoints, add_points
from solver.illumination.meshing.rings import Rings, trace_rings
from solver.illumination.meshing.skeleton import Skeleton
from solver.parallel import run_chunks
from solver.transport.pace import Pace
from solver.types import AnyArray, FloatArray, IntArray, Points

_CHUNK: Final = 256
"""Cells that a core takes at a time."""


@dataclass(frozen=True, eq=False)
class Arrangement:
    """What is within cells, all sorted by cell, and on their rings."""

    vertex_cell: IntArray
    """(i,) cell of each inner vertex"""
    vertex: Points
    """(i, 3) metres"""
    edge_cell: IntArray
    """(j,)"""
    edge_ends: IntArray
    """(j, 2) places in the cell's ring, or, from the ring's length on, its inner vertices"""
    edge_constraint: IntArray
    """(j,) the first of the constraint edges that run there"""
    mark: IntArray
    """(k,) stretch of the outlines that a constraint edge runs along"""
    mark_constraint: IntArray
    """(k,)"""
    wanted_rail: IntArray
    """(w,) rails that should have had a point"""
    wanted_fraction: FloatArray
    """(w,) at this place"""
    dropped: IntArray
    """Cells whose lines did not come to rest; some are left out"""


def arrange(
    chords: Chords, points: RailPoints, edges: ConstraintEdges, skeleton: Skeleton
) -> Generator[None, None, tuple[Arrangement, Rings]]:
    """The arrangement of `chords`, which are parts of `edges`, and rings with all points that it takes.

    Yields every few milliseconds.
    """
    while True:
        rings = trace_rings(skeleton, points)
        yield
        found = yield from _arrange_once(chords, edges, skeleton, rings)
        if len(found.wanted_rail) == 0:
            return found, rings
        count = len(points.rail)
        points, _ = add_points(points, found.wanted_rail, found.wanted_fraction)
        yield
        if len(points.rail) == count:
            return found, rings


def _arrange_once(
    chords: Chords, edges: ConstraintEdges, skeleton: Skeleton, rings: Rings
) -> Generator[None, None, Arrangement]:
    crossed, first, count = np.unique(chords.cell, return_index=True, return_counts=True)
    chord_start = np.append(first, len(chords.cell)).astype(np.int32)
    found: dict[int, tuple[AnyArray, ...]] = {}

    def work(base: int, begin: int, stop: int) -> None:
        found[base + begin] = arrange_cells(
            base + begin,
            base + stop,
            crossed,
            chord_start,
            chords.constraint,
            chords.start,
            chords.end,
            edges.ends,
            rings.start,
            rings.stop,
            rings.piece,
            rings.low,
            rings.high,
            rings.position,
            skeleton.side,
            skeleton.rail,
            skeleton.center,
            skeleton.axes,
            skeleton.tolerance,
        )

    yield
    # Each line of a cell is held against the others.
    for part in Pace().batches(count * (count + 4)):
        run_chunks(partial(work, part.start), part.stop - part.start, _CHUNK, least=16)
        yield
    # The columns of all chunks, in the order of the cells; a call for no cells tells their types.
    work(len(crossed), 0, 0)
    parts = [found[begin] for begin in sorted(found)]
    return Arrangement(*(np.concatenate(column) for column in zip(*parts, strict=True)))

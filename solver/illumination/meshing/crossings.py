"""Where constraint edges meet the outlines of cells, and what they do within each cell.

A constraint edge meets an outline where it crosses it, where it ends on it, and at the nodes that it comes
near. In the order along the edge these are its stops in a cell; an end within the cell is one too. Cells
are convex, so that straight lines from stop to stop, the chords, stay within the cell and near the edge.

Where an edge meets a rail is found from the rail's ends alone, not from the cell's: both sides of a rail
find the same fraction. That is what makes neighbours agree, with no search for what the other has found.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np

from solver.geometry.surfaces import Surfaces
from solver.illumination.meshing.cells import Cells, ConstraintEdges
from solver.illumination.meshing.crossing_kernels import find_stops, near_cells
from solver.illumination.meshing.ragged import starts
from solver.illumination.meshing.rails import RailPoints, add_points
from solver.illumination.meshing.skeleton import Skeleton
from solver.parallel import run_chunks
from solver.transport.pace import Pace
from solver.types import FloatArray, IntArray

_EDGES: Final = 64
_PAIRS: Final = 2048
"""Constraint edges, and pairs of one with a cell, that a core takes at a time."""

_FAR: Final = 64
"""Cells of an edge's patch that are told to be far from it in the time that one takes otherwise."""


@dataclass(frozen=True, eq=False)
class Chords:
    """c straight lines within cells, sorted by cell; stops are b nodes, points on rails, or ends inside."""

    cell: IntArray
    """(c,) ascending"""
    constraint: IntArray
    """(c,) the edge that each is part of"""
    start: IntArray
    """(c,) stop: a node k < b; b + i for point i on a rail; -1 - (2 e + k) for end k of edge e"""
    end: IntArray
    """(c,) stop"""


def find_chords(
    cells: Cells, surfaces: Surfaces, edges: ConstraintEdges, skeleton: Skeleton
) -> Generator[None, None, tuple[Chords, RailPoints]]:
    """The chords of `edges` in `cells`, which are sorted by patch, and where on rails they stop.

    Yields every few milliseconds.
    """
    cell_start = starts(cells.patch, surfaces.patch_count)
    near: dict[int, IntArray] = {}
    found: dict[int, tuple[IntArray, FloatArray]] = {}

    def search(base: int, first: int, last: int) -> None:
        near[base + first] = near_cells(
            base + first, base + last, edges.patch, edges.ends, cell_start, skeleton.center, skeleton.diameter
        )

    cost = 1 + np.diff(cell_start)[edges.patch].astype(np.int64) // _FAR
    for part in Pace().batches(cost):
        run_chunks(partial(search, part.start), part.stop - part.start, _EDGES, least=8)
        yield
    pairs = np.concatenate([np.empty((0, 2), dtype=np.int32), *(near[first] for first in sorted(near))])

    def meet(base: int, first: int, last: int) -> None:
        found[base + first] = find_stops(
            pairs[base + first : base + last], edges.ends, cells.patch, surfaces.normal, skeleton.start,
            skeleton.node, skeleton.end, skeleton.rail, skeleton.forward, skeleton.position, skeleton.radius,
            skeleton.reach,
        )  # fmt: skip

    for part in Pace().batches(np.ones(len(pairs), dtype=np.int64)):
        run_chunks(partial(meet, part.start), part.stop - part.start, _PAIRS, least=64)
        yield
    parts = [found[first] for first in sorted(found)]
    stops = np.concatenate([np.empty((0, 4), dtype=np.int32), *(part[0] for part in parts)])
    fraction = np.concatenate([np.empty(0), *(part[1] for part in parts)])
    cell, constraint, rail, code = stops.T
    yield
    # Stops on rails become points, those that are near each other one.
    on_rail = np.flatnonzero(rail >= 0)
    points, point = add_points(RailPoints.none(), rail[on_rail], fraction[on_rail])
    yield
    code = code.copy()
    code[on_rail] = len(skeleton.position) + point
    # Chords run between the stops of one edge in one cell that follow each other.
    is_chord = (cell[1:] == cell[:-1]) & (constraint[1:] == constraint[:-1]) & (code[1:] != code[:-1])
    at = np.flatnonzero(is_chord)
    at = at[np.argsort(cell[at], kind="stable")]
    return Chords(cell[at], constraint[at], code[at], code[at + 1]), points

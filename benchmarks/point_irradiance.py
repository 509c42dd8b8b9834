"""Point irradiances a second: with all that blocks, and as if nothing did."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from benchmarks.plan import Job, Options, Section
from benchmarks.solving import solve_once
from benchmarks.tables import Row, Table, percent
from benchmarks.timing import best_of
from solver.document.samples import load_sample
from solver.illumination.points.point_irradiance import DEFAULT_ACCURACY, PointIrradiance
from solver.transport.settings import SolverSettings
from solver.transport.state import TransportState
from solver.types import IntArray, Points
from solver.visibility.bvh import build_hierarchy

YARDSTICK: Final = 1e-6
"""Accuracy of the irradiances that errors are told against"""

_LARGE: Final = "robot_cell"


@dataclass(frozen=True)
class PointFigures:
    """Random points on the leaves of one solved scene."""

    scene: str
    patches: int
    elements: int
    points: int
    rate: float
    """Points a second on all cores, all patches asked where they are few"""
    unblocked_rate: float
    """The same where nothing blocks"""
    link_rate: float
    """Points a second over links"""
    error: float
    """RMS of luminance against a finer accuracy, over the RMS"""
    link_error: float


def measure_points(name: str, points: int, checked: int, times: int) -> PointFigures:
    """Gather at random points, as many to each area, at the default accuracy; check some of them."""
    solver = solve_once(load_sample(name), SolverSettings()).solver
    state, hierarchy = solver.state, solver.hierarchy
    positions, leaves = _spread(state, points)
    nothing = build_hierarchy(state.tree.corners, np.empty(0, dtype=np.int32))
    point = PointIrradiance.of(state, hierarchy)
    unblocked = PointIrradiance.of(state, nothing, few=state.tree.patch_count)
    linked = PointIrradiance.of(state, hierarchy, few=0)
    ways = (point, unblocked, linked)
    for way in ways:
        way.at(positions[:10], leaves[:10])
    rates = [points / best_of(lambda way=way: way.at(positions, leaves), times) for way in ways]  # type: ignore[misc]
    truth = replace(point, accuracy=YARDSTICK).at(positions[:checked], leaves[:checked]) @ state.weights
    found = [way.at(positions[:checked], leaves[:checked]) @ state.weights for way in (point, linked)]
    errors = [float(np.sqrt(np.mean((one - truth) ** 2) / np.mean(truth**2))) for one in found]
    return PointFigures(
        name, state.tree.patch_count, len(state.tree), points, rates[0], rates[1], rates[2], *errors
    )


def _spread(state: TransportState, count: int) -> tuple[Points, IntArray]:
    """Points within leaves, and the leaves."""
    random, tree = np.random.default_rng(1), state.tree
    area = tree.area[tree.leaves]
    leaves = random.choice(tree.leaves, count, p=area / area.sum()).astype(np.int32)
    share = random.dirichlet(np.ones(4), count)
    return np.einsum("nk,nka->na", share, tree.corners[leaves]), leaves


def section(options: Options) -> Section:
    """All scenes; fewer points of the large one."""
    jobs = []
    for name in options.scenes:
        points = 500 if name == _LARGE else 5_000
        jobs.append(Job(name, measure_points, (name, points, points // 25, 2 if options.quick else 5)))
    return Section("points", tuple(jobs), tabulate)


def tabulate(found: list[PointFigures]) -> Table:
    """One row a scene."""
    return Table(
        "Point irradiances a second",
        (
            "scene", "patches", "elements", "points / s", "nothing blocks", "over links", "error",
            "over links: error",
        ),
        tuple(Row(_cells(figures)) for figures in found),
        f"Random points on leaves at an accuracy of {DEFAULT_ACCURACY:g}, the best run. Errors: RMS against "
        f"an accuracy of {YARDSTICK:g}, over the RMS.",
    )  # fmt: skip


def _cells(figures: PointFigures) -> tuple[str, ...]:
    return (
        figures.scene,
        f"{figures.patches:,}",
        f"{figures.elements:,}",
        f"{figures.rate:,.0f}",
        f"{figures.unblocked_rate:,.0f}",
        f"{figures.link_rate:,.0f}",
        percent(figures.error),
        percent(figures.link_error),
    )

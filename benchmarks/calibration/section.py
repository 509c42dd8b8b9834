"""The calibration of error estimates as a section of the report: a table, and a plot of told against true."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np

from benchmarks.calibration.measure import Case, Effort, SceneCases, Told, measure_scene
from benchmarks.plan import Job, Options, Section
from benchmarks.tables import Row, Table, Target, percent

ROOMS: Final = 20
SAMPLES: Final = ("cornell", "office", "cube_room")

_QUICK: Final = Effort(field=60_000, pixel=64, probe=2048, probes=24, tolerances=(0.1, 0.03))
_QUICK_ROOMS: Final = 3

_HOLDS: Final = 0.95
"""Target: share of the cases in which the true error is no more than was told"""

_MOST: Final = 5.0
"""Target: told over true, in the median"""

_LEAST_SHOWN: Final = 1e-3
PLOT: Final = "calibration.svg"


def section(options: Options) -> Section:
    """Samples and random rooms."""
    effort = _QUICK if options.quick else Effort()
    rooms = tuple(f"room {seed}" for seed in range(_QUICK_ROOMS if options.quick else ROOMS))
    samples = tuple(name for name in SAMPLES if name in options.scenes)
    names = samples[:1] + rooms if options.quick else samples + rooms
    jobs = tuple(Job(name, measure_scene, (name, effort)) for name in names)
    return Section("calibration", jobs, tabulate, plot)


def tabulate(found: list[SceneCases]) -> Table:
    """One row for each that tells errors, and one for all of them."""
    every = _told(found)
    groups: list[tuple[str, list[Case]]] = [
        (str(told_by), [case for case in every if case.told_by is told_by]) for told_by in Told
    ]
    rows = [Row(_cells(name, cases)) for name, cases in groups if cases]
    if every:
        holds, median = _holds(every), _median(every)
        targets = (Target("holds", holds, _HOLDS, at_most=False), Target("told / true", median, _MOST))
        rows.append(Row(_cells("all", every), targets))
    return Table(
        "Error estimates: told against true",
        ("told by", "cases", "scenes", "holds", "told / true: median", "5 %", "95 %", "true: median"),
        tuple(rows),
        "On rooms drawn at random and on samples, at several tolerances, on the way there, at rest, and "
        "after an edit. True: against the path tracer, elements for the status, pixels of 64x48 for frames, "
        "single points for probes. Holds: true, less one standard error of its own, is no more than told. "
        "Estimates of 100 %, when nothing is known yet, are left out.",
        names=1,
    )  # fmt: skip


def plot(found: list[Any], directory: Path) -> None:
    """Write a plot of all cases."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 5.0), layout="constrained")
    cells = figure.subplots(1, 3, sharex=True, sharey=True)
    shown = ((Told.STATUS,), tuple(t for t in Told if t not in (Told.STATUS, Told.PROBE)), (Told.PROBE,))
    every = _told(found)
    for cell, told_by in zip(cells, shown, strict=True):
        for number, name in enumerate(told_by):
            cases = [case for case in every if case.told_by is name]
            true = [max(case.true, _LEAST_SHOWN) for case in cases]
            cell.plot(
                true,
                [case.told for case in cases],
                f"C{number}.",
                markersize=4,
                label=str(name),
                rasterized=True,
            )
        ends = np.array([_LEAST_SHOWN, 1.0])
        cell.plot(ends, ends, "k-", linewidth=0.8)
        cell.plot(ends, _MOST * ends, "k:", linewidth=0.8)
        cell.set(xscale="log", yscale="log", xlabel="true relative error", ylim=(_LEAST_SHOWN, 1.2))
        cell.grid(alpha=0.3)
        cell.legend(fontsize="small")
    cells[0].set_ylabel("told")
    figure.suptitle("Error estimates: at the line what is told is true, at the dots five times that")
    figure.savefig(directory / PLOT)


def from_records(records: list[dict[str, Any]]) -> list[SceneCases]:
    """What `asdict` made of figures, after JSON."""
    return [
        SceneCases(tuple(Case(**{**case, "told_by": Told(case["told_by"])}) for case in record["cases"]))
        for record in records
    ]


def _told(found: list[SceneCases]) -> list[Case]:
    return [case for scene in found for case in scene.cases if case.told < 1.0]


def _holds(cases: list[Case]) -> float:
    return float(np.mean([case.holds for case in cases]))


def _median(cases: list[Case]) -> float:
    return float(np.median([case.ratio for case in cases]))


def _cells(name: str, cases: list[Case]) -> tuple[str, ...]:
    low, high = np.quantile([case.ratio for case in cases], (0.05, 0.95))
    return (
        name,
        f"{len(cases):,}",
        str(len({case.scene for case in cases})),
        percent(_holds(cases), 1),
        f"{_median(cases):.2f}",
        f"{low:.2f}",
        f"{high:.2f}",
        percent(float(np.median([case.true for case in cases])), 2),
    )

"""Speed against error: what each halving of the tolerance costs, and what it brings."""

from __future__ import annotations

from typing import Final

from benchmarks.plan import Job, Options, Section
from benchmarks.solving import PATHS, SolveFigures, measure_solve
from benchmarks.tables import Row, Table, percent
from solver.transport.settings import SolverSettings

SCENES: Final = ("cornell", "office")
TOLERANCES: Final = (0.08, 0.04, 0.02, 0.01)


def section(options: Options) -> Section:
    """The small scenes, at each tolerance."""
    times, paths = (1, PATHS // 8) if options.quick else (2, PATHS)
    jobs = (
        Job(f"{name} to {percent(tolerance, 0)}", measure_solve, (name, tolerance, times, paths))
        for name in options.scenes
        if name in SCENES
        for tolerance in TOLERANCES
    )
    return Section("accuracy", tuple(jobs), tabulate)


def tabulate(found: list[SolveFigures]) -> Table:
    """One row a scene and tolerance."""
    default = SolverSettings().error_tolerance
    usual = {figures.scene: figures.seconds for figures in found if figures.tolerance == default}
    return Table(
        "Speed against error",
        ("scene", "tolerance", "seconds", "time of default's", "elements", "links", "estimated error",
         "measured error"),
        tuple(
            Row(
                (
                    figures.scene,
                    percent(figures.tolerance, 0),
                    f"{figures.seconds:.3f}" + ("" if figures.converged else " (not converged)"),
                    f"{figures.seconds / usual[figures.scene]:.2f}" if figures.scene in usual else "",
                    f"{figures.elements:,}",
                    f"{figures.links:,}",
                    percent(figures.estimated_error),
                    str(figures.measured),
                )
            )
            for figures in found
        ),
    )  # fmt: skip

"""Edits of a solved scene: redistribution against shooting and solving anew ([G figures 6 and 7]).

All edits of a scene lead to the same one, the sample as it is, from others that lack an object, or have it
elsewhere. So there is one reference, and one mesh that shooting goes by and that errors are told on.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

from benchmarks.edit_cases import EDITS, Edit
from benchmarks.edit_curves import Curve, follow_shooting, follow_solver
from benchmarks.edit_error import EditWitness
from benchmarks.edit_figures import plot_edits
from benchmarks.edit_runs import Run, run_fastest
from benchmarks.plan import Job, Options, Section
from benchmarks.shooting import Shooting
from benchmarks.solving import Solved, solve_once
from benchmarks.tables import Row, Table, Target, percent
from solver.document.samples import load_sample
from solver.engine.world import World
from solver.geometry.scene import Scene
from solver.redistribution.redistribution import Redistribution
from solver.transport.settings import Interleaving, SolverSettings
from solver.transport.solve import RadiositySolver

FRESH: Final = "fresh solve"
SHOOTING: Final = "shooting"

LARGE: Final = "robot_cell"
"""The scene whose edits are measured at two tolerances: at the default one, and at that of its mesh"""

SOON: Final = 0.5
"""Seconds after which the error is told"""

ERROR_SOON: Final = 0.05
"""Target: error by then where most changes"""

MESH: Final = {"cube_room": 0.04, "robot_cell": 0.033}
"""Tolerance of the solve whose leaves are the mesh: about the patches of [G figures 6, 7], 450 and 12,700"""

REFERENCE: Final = {"cube_room": 0.005, "robot_cell": 0.01}
"""Tolerance of the reference: a quarter of the default one, and a half, which takes 400,000 elements in the
robot cell already"""

_MOST_ELEMENTS: Final = 2_000_000
"""Of the reference"""

SMALL_RATIO: Final = 20.0
"""Target: CPU time of a fresh solve over that of redistribution, for a small object; 1 for any other"""

SHOOTING_SECONDS: Final = 60.0
"""CPU seconds that shooting may take"""


@dataclass(frozen=True)
class Depth:
    """How much is measured."""

    mesh: float
    """Tolerance of the solve whose leaves are the mesh"""
    reference: float
    """Tolerance of the reference"""
    shooting: float
    """CPU seconds that shooting may take"""
    times: int
    """Runs of which the fastest is told, where they are short"""
    tolerance: float = SolverSettings().error_tolerance
    """Of the solutions"""


@dataclass(frozen=True)
class EditFigures:
    """One edit by every method."""

    edit: Edit
    tolerance: float
    """Of the solutions"""
    elements: int
    """That errors are told on, and that shoot"""
    changed: int
    """Those of them that change most"""
    links_before: int
    redistribution: Run
    anew: Run
    curves: tuple[Curve, ...]

    def curve(self, method: str) -> Curve:
        """That of one method."""
        return next(curve for curve in self.curves if curve.method == method)


@dataclass(frozen=True)
class SceneEdits:
    """All edits of a scene."""

    edits: tuple[EditFigures, ...]


def measure_edits(edits: tuple[Edit, ...], depth: Depth) -> SceneEdits:
    """Measure edits of one scene."""
    settings = SolverSettings(error_tolerance=depth.tolerance)
    after = load_sample(edits[0].scene)
    _warm_up(edits[0], after)
    world = World.of(after)

    def solve_anew() -> RadiositySolver:
        now = World.of(after)
        return RadiositySolver(now.surfaces, now.rays, settings)

    tree = solve_once(after, replace(settings, error_tolerance=depth.mesh)).solver.state.tree
    reference = solve_once(
        after, replace(settings, error_tolerance=depth.reference, max_elements=_MOST_ELEMENTS)
    ).solver
    witness = EditWitness(world, tree, reference.state)
    del reference
    # What is the same for all edits.
    anew = run_fastest(lambda: solve_anew, depth.times)
    fresh = follow_solver(FRESH, solve_anew, witness)
    shot = follow_shooting(SHOOTING, lambda: Shooting(world.surfaces, world.rays, tree), depth.shooting)

    def measure(edit: Edit) -> EditFigures:
        base = solve_once(edit.before(after), settings)
        most = witness.most_changed(base.world, base.solver.state)
        tracks = [
            follow_solver(
                str(way), _redistribution(base, after, replace(settings, interleaving=way)), witness
            )
            for way in Interleaving
        ]
        return EditFigures(
            edit=edit,
            tolerance=depth.tolerance,
            elements=len(most),
            changed=int(most.sum()),
            links_before=len(base.solver.state.links),
            redistribution=run_fastest(lambda: _redistribution(base, after, settings), depth.times),
            anew=anew,
            curves=tuple(track.curve(witness, most) for track in (*tracks, fresh, shot)),
        )

    return SceneEdits(tuple(measure(edit) for edit in edits))


def _redistribution(base: Solved, after: Scene, settings: SolverSettings) -> Callable[[], Redistribution]:
    """What makes, once, the solver of `after` that goes on from a copy of a base solution."""
    base.solver.keep_a_copy()

    def make() -> Redistribution:
        now = World.of(after, base.world)
        return Redistribution(now.surfaces, now.rays, settings, base.solver)

    return make


def _warm_up(edit: Edit, after: Scene) -> None:
    """Load the kernels: an edit of the scene, solved coarsely."""
    coarse = SolverSettings(error_tolerance=0.1)
    base = solve_once(edit.before(after), coarse)
    solver = _redistribution(base, after, coarse)()
    while solver.step(1.0):
        pass
    Shooting(solver.surfaces, World.of(after).rays, solver.state.tree).shoot()


def depth_of(scene: str, quick: bool) -> Depth:
    """How much is measured of the edits of a scene."""
    if quick:
        return Depth(MESH[scene], 0.01, 2.0, 1)
    return Depth(MESH[scene], REFERENCE[scene], SHOOTING_SECONDS, 3)


def section(options: Options) -> Section:
    """All edits of each scene that has some."""
    jobs = []
    for name in options.scenes:
        edits = tuple(edit for edit in EDITS if edit.scene == name)
        if edits:
            depth = depth_of(name, options.quick)
            jobs.append(Job(name, measure_edits, (edits, depth)))
            if name == LARGE and not options.quick:
                # Of so many elements the first look is to be had within a tenth of a second.
                label = f"{name}, {percent(depth.mesh, 1)}"
                jobs.append(Job(label, measure_edits, (edits, replace(depth, tolerance=depth.mesh))))
    return Section("edits", tuple(jobs), tabulate, plot_edits)


def tabulate(found: list[SceneEdits]) -> Table:
    """Four rows an edit, one for each method."""
    return Table(
        "Edits of a converged scene",
        (
            "scene", "tolerance", "edit", "method", "CPU s", "wall s", "times as fast", "ms to begin",
            "longest slice ms", "elements that shot", "links looked at", "pairs shot over", "CPU s to 20 %",
            "to 5 %", "after 0.5 CPU s", "from its own end", "after 0.5 s", "from its own end", "at the end",
            "everywhere, after 0.5 CPU s", "at the end",
        ),
        tuple(row for scene in found for figures in scene.edits for row in _rows(figures)),
        "Errors: of reflected luminance (George et al. 1990, eq. 7), over the 1 % of the elements, by their "
        "count, that the edit changes most, or everywhere; against a finer solution of the edited scene, or "
        "against where the method itself ends. Shooting: progressive refinement from an unlit scene, on a "
        "fixed coarser mesh, whose errors bound its own. Other work on the machine shows in wall time.",
        names=4,
    )  # fmt: skip


def _rows(figures: EditFigures) -> list[Row]:
    default = str(SolverSettings().interleaving)
    return [
        Row(
            (
                figures.edit.scene,
                percent(figures.tolerance, 1),
                figures.edit.label,
                curve.method,
                *_cells(figures, curve),
            ),
            _targets(figures, curve) if curve.method == default else (),
        )
        for curve in figures.curves
    ]


def _cells(figures: EditFigures, curve: Curve) -> tuple[str, ...]:
    run = {FRESH: figures.anew, str(SolverSettings().interleaving): figures.redistribution}.get(curve.method)
    end, soon, by_clock = curve.samples[-1], curve.after(SOON), curve.within(SOON)
    looks = end.work.looks
    return (
        f"{end.work.cpu if run is None else run.cpu:.3f}",
        f"{end.work.wall if run is None else run.wall:.3f}",
        "" if run is None else f"{figures.anew.cpu / run.cpu:.1f}",
        "" if run is None else f"{1e3 * run.begun:.0f}",
        "" if run is None else f"{1e3 * run.longest_slice:.0f}",
        f"{end.work.shots:,}" if end.work.shots else "",
        f"{looks:,} ({percent(looks / figures.links_before, 0)})" if looks else "",
        f"{end.work.pairs:,}",
        f"{curve.until(0.2):.3f}",
        f"{curve.until(0.05):.3f}",
        percent(soon.error.where_most),
        # Shooting may have been ended before.
        "" if curve.method == SHOOTING else percent(soon.to_come.where_most),
        percent(by_clock.error.where_most),
        "" if curve.method == SHOOTING else percent(by_clock.to_come.where_most),
        percent(end.error.where_most),
        percent(soon.error.everywhere),
        percent(end.error.everywhere),
    )


def _targets(figures: EditFigures, curve: Curve) -> tuple[Target, ...]:
    ratio = figures.anew.cpu / figures.redistribution.cpu
    bound = SMALL_RATIO if figures.edit.is_small else 1.0
    soon = 100.0 * curve.after(SOON).error.where_most
    return (
        Target("times as fast", ratio, bound, at_most=False),
        Target("error after 0.5 s", soon, 100.0 * ERROR_SOON, "%"),
    )

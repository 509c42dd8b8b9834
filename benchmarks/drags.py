"""Edits as a viewer sees them: how soon a frame shows them, and frames of an object that is dragged.

Frames are asked for as by a viewer who wants the next one at once: one is drawn, then the engine works for a
while, and so on.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

from benchmarks.edit_cases import EDITS, Edit, moved
from benchmarks.edit_error import EditWitness
from benchmarks.edits import Depth, depth_of
from benchmarks.frames import HEIGHT, WIDTH
from benchmarks.plan import Job, Options, Section
from benchmarks.solving import solve_once
from benchmarks.tables import Row, Table, Target, percent
from solver.document.edits import MoveEdit
from solver.document.models import TransformDocument
from solver.document.samples import load_sample
from solver.engine.drawing import Drawing
from solver.engine.engine import Engine
from solver.engine.requests import CameraChoice, FrameRequest, RendererName
from solver.geometry.scene import Scene
from solver.illumination.settings import LightSettings
from solver.redistribution.redistribution import Redistribution
from solver.transport.settings import SolverSettings
from solver.types import ObjectId

SHADOW: Final = 0.1
"""Target: seconds until a frame has the shadow where it belongs"""

RATE: Final = 15.0
"""Target: frames a second while an object is dragged"""

MOVES: Final = 90
PAUSE: Final = 1.0 / 30.0
"""Seconds between two of them"""

_THERE: Final = 0.2
"""A shadow has moved when the error where most changes is below this."""

_SLICE: Final = 0.01
"""Seconds of work between two frames"""

_PATIENCE: Final = 20.0
"""Seconds until a shadow that has not moved yet is given up"""

_MANY: Final = 20_000
"""Elements above which the targets, which are those of some 12,000, are not asked for"""

_REQUEST: Final = FrameRequest(CameraChoice(width=WIDTH, height=HEIGHT), RendererName.GOURAUD)


@dataclass(frozen=True)
class Drag:
    """Frames of an object that is dragged."""

    frames: int
    taken: int
    """Moves that were applied: where several are due, the last one is"""
    rate: float
    """Frames a second"""
    longest: float
    """Seconds between two of them, at most"""
    applied: float
    """Seconds that applying a move takes, in the mean"""
    drawn: float
    """Seconds that a frame takes, in the mean"""
    looks: int
    """Links looked at anew between two moves, in the mean"""


@dataclass(frozen=True)
class DragFigures:
    """Of one object."""

    edit: Edit
    elements: int
    """Of the settled solution"""
    applied: float
    """Seconds that applying the edit takes"""
    first: float
    """Seconds from the edit to the first frame; it shows the object where it is"""
    first_error: float
    """Of that frame, where most changes"""
    shadow: float
    """Seconds from the edit to the first frame whose error is less than a fifth where most changes"""
    shadow_frames: int
    """Frames until then"""
    drag: Drag


def measure_drag(edit: Edit, depth: Depth, moves: int) -> DragFigures:
    """Move an object in a settled engine, then drag it there and back in so many moves."""
    after = load_sample(edit.scene)
    _warm_up(edit, after)
    tree = solve_once(after, SolverSettings(error_tolerance=depth.mesh)).solver.state.tree
    finer = solve_once(after, SolverSettings(error_tolerance=depth.reference))
    witness = EditWitness(finer.world, tree, finer.solver.state)
    del finer
    engine = _settled(edit.before(after), depth.tolerance)
    most = witness.most_changed(engine._world, engine._solution.solver.state)
    engine.frame(_REQUEST)
    elements = len(engine._solution.field().area)

    # One move, and frames until the light has followed.
    spent = applied = _apply(engine, _placed(after, edit.object))
    errors, times = [], []
    while True:
        spent += _seconds(lambda: engine.frame(_REQUEST))
        times.append(spent)
        errors.append(witness.error(witness.luminances(engine._solution.solver.state), most).where_most)
        if errors[-1] < _THERE or spent > _PATIENCE:
            break
        spent += _seconds(lambda: engine.step(_SLICE))
    _rest(engine)
    drag = _drag(engine, edit, after, moves)
    return DragFigures(
        edit=edit,
        elements=elements,
        applied=applied,
        first=times[0],
        first_error=errors[0],
        shadow=times[-1] if errors[-1] < _THERE else float("inf"),
        shadow_frames=len(times),
        drag=drag,
    )


def _drag(engine: Engine, edit: Edit, after: Scene, moves: int) -> Drag:
    """Take the object to where it was before and back, a move every `PAUSE` seconds."""
    assert edit.shift is not None
    edits = []
    for number in range(1, moves + 1):
        way = 0.5 * math.cos(2.0 * math.pi * number / moves) - 0.5
        x, y, z = (way * length for length in edit.shift)
        edits.append(_placed(moved(after, edit.object, (x, y, z)), edit.object))
    # The last place is that of a scene whose light is remembered.
    edits.pop()
    start = previous = time.perf_counter()
    done, taken, applied, drawn, looks = 0, 0, 0.0, 0.0, 0
    times = []
    while done < len(edits):
        due = min(len(edits), 1 + int((time.perf_counter() - start) / PAUSE))
        if due > done:
            solver = engine._solution.solver
            looks += solver.looks if isinstance(solver, Redistribution) and taken else 0
            # Where several are due, what is in between is never seen.
            applied += _apply(engine, edits[due - 1])
            done, taken = due, taken + 1
        drawn += _seconds(lambda: engine.frame(_REQUEST))
        now = time.perf_counter()
        times.append(now - previous)
        previous = now
        if now - start < PAUSE * done:
            # Nothing is due yet.
            engine.step(_SLICE)
    count, seconds = len(times), previous - start
    return Drag(count, taken, count / seconds, max(times), applied / taken, drawn / count, looks // taken)


def _settled(scene: Scene, tolerance: float) -> Engine:
    engine = Engine(scene, LightSettings(error_tolerance=tolerance), drawing=Drawing())
    _rest(engine)
    return engine


def _rest(engine: Engine) -> None:
    while engine.step(1.0):
        pass


def _apply(engine: Engine, edit: MoveEdit) -> float:
    return _seconds(lambda: engine.apply([edit]))


def _seconds(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def _placed(scene: Scene, name: ObjectId) -> MoveEdit:
    """The edit that puts an object where it is in `scene`."""
    matrix = scene.object(name).transform.matrix.ravel().tolist()
    return MoveEdit(op="move", id=name, transform=TransformDocument(matrix=matrix))


def _warm_up(edit: Edit, after: Scene) -> None:
    """Load the kernels and the driver: the same edit, solved coarsely."""
    engine = _settled(edit.before(after), 0.1)
    engine.frame(_REQUEST)
    engine.apply([_placed(after, edit.object)])
    engine.frame(_REQUEST)
    _rest(engine)
    engine.frame(_REQUEST)


def section(options: Options) -> Section:
    """All objects that move, of the scenes asked for."""
    jobs = []
    for edit in EDITS:
        if edit.shift is not None and edit.scene in options.scenes:
            depth = depth_of(edit.scene, options.quick)
            for tolerance in (depth.mesh, depth.tolerance):
                # That a shadow is there can be told by a solution like that which is told.
                like = replace(depth, tolerance=tolerance, reference=depth.tolerance)
                name = f"{edit.scene}, {edit.label}, {percent(tolerance, 1)}"
                jobs.append(Job(name, measure_drag, (edit, like, MOVES)))
    return Section("drags", tuple(jobs), tabulate)


def tabulate(found: list[DragFigures]) -> Table:
    """One row an object."""
    return Table(
        f"Frames of edits, gouraud {WIDTH}x{HEIGHT}",
        (
            "scene", "edit", "elements", "ms to apply", "ms to first frame", "its error where most",
            "ms to shadow", "frames until then", "dragged: frames / s", "frames", "moves taken", "longest ms",
            "ms to apply", "ms to draw", "links looked at a move",
        ),
        tuple(Row(_cells(figures), _targets(figures)) for figures in found),
        "Once the edit is applied, frames are drawn as fast as they come, with 10 ms of work between two. "
        "Shadow: the error is below 20 % over the 1 % of the elements that the edit changes most. Dragged: "
        f"{MOVES} places, one each 1/30 s; where several are due, the last one is taken. At the tolerance "
        "of the mesh that edits are compared on, where targets are told, and at the default one.",
        names=3,
    )  # fmt: skip


def _cells(figures: DragFigures) -> tuple[str, ...]:
    drag = figures.drag
    return (
        figures.edit.scene,
        figures.edit.label,
        f"{figures.elements:,}",
        f"{1e3 * figures.applied:.0f}",
        f"{1e3 * figures.first:.0f}",
        percent(figures.first_error, 1),
        f"{1e3 * figures.shadow:.0f}",
        str(figures.shadow_frames),
        f"{drag.rate:.1f}",
        str(drag.frames),
        str(drag.taken),
        f"{1e3 * drag.longest:.0f}",
        f"{1e3 * drag.applied:.0f}",
        f"{1e3 * drag.drawn:.0f}",
        f"{drag.looks:,}",
    )


def _targets(figures: DragFigures) -> tuple[Target, ...]:
    if figures.elements > _MANY:
        return ()
    return (
        Target("first frame", 1e3 * figures.first, 1e3 * SHADOW, "ms"),
        Target("shadow", 1e3 * figures.shadow, 1e3 * SHADOW, "ms"),
        Target("dragged", figures.drag.rate, RATE, "/s", at_most=False),
    )

"""One session's state machine: edits in, time-sliced work, frames and probes out.

An engine has no threads and no clock of its own: whoever owns it calls `step` for as long as it
returns True, and anything else between two steps. An edit replaces world and solution at once, so that
whatever is asked next sees the new geometry, with the light that is still valid.
"""

from __future__ import annotations

import gc
import secrets
import time
from collections.abc import Sequence
from typing import Final

import numpy as np

from solver.document.edits import Edit, apply_edits
from solver.document.limits import SceneLimits
from solver.engine.auto import AutoView
from solver.engine.change_log import ChangeLog, Progress
from solver.engine.checkpoint import Checkpoint
from solver.engine.drawing import Drawing
from solver.engine.exports.files import Export, ExportRequest, encode_export
from solver.engine.frame_times import FrameTimes
from solver.engine.grids import Grid, GridRequest, grid_of
from solver.engine.history import Step, step_of
from solver.engine.lightmaps.bake import Bake, LightmapRequest
from solver.engine.lightmaps.begin import begin_bake
from solver.engine.overlays.base import OverlayRequest, Subject, Work, is_ready
from solver.engine.past import Past
from solver.engine.picking import PickResult, pick_point
from solver.engine.probing import light_at
from solver.engine.requests import CameraChoice, FrameLimits, FrameRequest
from solver.engine.savings import savings_of
from solver.engine.showing import Showing, renderer_of
from solver.engine.solution import Solution
from solver.engine.status import Change, ChangeState, EngineStatus, ProbeResult, SessionState
from solver.engine.views import Frame, Outlook, View
from solver.engine.world import World
from solver.errors import RevisionConflictError
from solver.geometry.scene import Scene
from solver.illumination.settings import LightSettings
from solver.redistribution.memory import Memory
from solver.redistribution.redistribution import Redistribution
from solver.transport.settings import Saving
from solver.transport.solve import RadiositySolver
from solver.types import LUMINANCE_WEIGHTS, FloatArray, ObjectId, Points

_FIRST_LOOK: Final = 0.02
"""Seconds of work before the first frame after an edit: in it the strongest shadows have moved."""

_GLANCE: Final = 0.012
"""The same in the midst of a drag, where the next frame is soon asked for"""


class Engine:
    """A scene, its solution, and the frames of it."""

    def __init__(
        self,
        scene: Scene | Past,
        settings: LightSettings | None = None,
        limits: SceneLimits | None = None,
        drawing: Drawing | None = None,
        frame_limits: FrameLimits | None = None,
        kept: Checkpoint | None = None,
    ) -> None:
        """Take `scene` as revision 1, or go on from a past with light that settles anew.

        `drawing` makes the frames, and may be shared by engines of one thread. Where the solution that was
        `kept` is the one of this scene by these settings, it is gone on from. Raises LimitExceededError, and
        SceneError where a past has an edit that cannot be applied.
        """
        past = scene if isinstance(scene, Past) else Past(scene)
        self._limits = limits or SceneLimits()
        self._history, standing = past.history(self._limits)
        self._settings = settings or LightSettings()
        self._drawing = drawing or Drawing()
        self._revision = past.revision
        self._log = ChangeLog(past.entries, past.count, past.drags)
        self._life = secrets.token_hex(4)
        """Sets the tags of its frames apart from those that the session had in an earlier process"""
        self._turn = 0
        self._memory = Memory()
        self.frame_times = FrameTimes()
        self._moved: ObjectId | None = None
        """What the edits since the last transition, or those of it, have moved, if nothing else"""
        self._drags = False
        self._is_behind = False
        """Whether the solution is that of an earlier world"""
        self._halted: str | None = None
        """What to tell where no work is done until the next change"""
        self._is_outgrown = False
        """Whether what the solution was halted for is still held by it"""
        self._power: dict[ObjectId, float] = {}
        """W of luminance that left each object before the last transition that goes on with no drag"""
        self._world = World.of(standing, in_colour=_in_colour(self._settings))
        self._solution = Solution(
            self._world, self._settings, None, self._revision, False, self._memory, False, kept
        )
        self._showing = Showing(
            self._world, self._solution, self._settings, self._drawing, frame_limits or FrameLimits(), kept
        )

    @property
    def scene(self) -> Scene:
        """The scene as it stands."""
        return self._world.scene

    @property
    def revision(self) -> int:
        """Counts the edit batches: 1 for the scene as it was given."""
        return self._revision

    @property
    def settings(self) -> LightSettings:
        """What the solve goes by."""
        return self._settings

    def apply(
        self, edits: Sequence[Edit], if_revision: int | None = None, gesture: str | None = None
    ) -> tuple[Change, ...]:
        """Apply all of `edits`, or none. Batches of one `gesture` in a row are taken back together.

        Raises RevisionConflictError where `if_revision` is given and not the current one, SceneError
        located in `edits.<index>`, LimitExceededError.
        """
        if if_revision is not None and if_revision != self._revision:
            raise RevisionConflictError(if_revision, self._revision)
        before, scene = self.scene, apply_edits(self.scene, edits)
        self._limits.check(scene)
        step = step_of(edits, scene)
        changes = self._take(step)
        self._history.record(before, step, gesture)
        return changes

    def undo(self) -> tuple[Change, ...]:
        """Take back the newest edit batch, as an edit of its own. Raises NothingToReverseError."""
        return self._take(self._history.undo())

    def redo(self) -> tuple[Change, ...]:
        """Bring back the batch that was taken back last. Raises NothingToReverseError."""
        return self._take(self._history.redo())

    def log(self) -> tuple[Change, ...]:
        """The change log as it stands, oldest entries first."""
        self._catch_up()
        return self._log.entries(self._progress())

    def configure(self, settings: LightSettings) -> None:
        """Solve on by other settings."""
        self._catch_up()
        if settings == self._settings:
            return
        # What is too large to be gone on from would be so again.
        earlier = None if self._is_outgrown else self._solution
        before, self._settings, self._halted = self._settings, settings, None
        if settings.solves_as(before):
            self._showing.configure(settings)
            self._turn += 1
        else:
            self._settle(World.of(self.scene, self._world, _in_colour(settings)), earlier, False)
            if self._is_outgrown:
                # Solutions are in cycles with their work, and would be held on to for a while.
                gc.collect()
                self._is_outgrown = False

    def step(self, budget: float) -> bool:
        """Work for about `budget` seconds; False if nothing needed any.

        So, when it is False, whoever waits for something has seen what the last of the work came to.
        """
        if self._halted is not None:
            return False
        self._catch_up()
        solving = self._solution.state is SessionState.SOLVING
        busy = self._showing.refine(0.5 * budget) or solving
        tracing = self._showing.trace(0.5 * budget if busy else budget)
        remembering = self._solution.step(0.5 * budget if tracing else budget)
        return busy or tracing or remembering

    def halt(self, reason: str) -> None:
        """Do no more work, and keep nothing that could be done without, until the next edit or settings.

        The status tells `reason` as a warning; what was solving is paused.
        """
        self._halted, self._is_outgrown = reason, True
        self._memory = Memory()

    def build_everything(self) -> None:
        """Build the interpolants of all triangles, seen or not, once there are any."""
        self._catch_up()
        self._showing.build_everything()

    def status(self) -> EngineStatus:
        """How the session stands."""
        self._catch_up()
        solution, solver = self._solution, self._solution.solver
        return EngineStatus(
            name=self.scene.name,
            revision=self._revision,
            state=self._state(),
            progress=solver.progress,
            error_estimate=solution.error_estimate,
            unshot_fraction=solver.unshot_fraction,
            statistics=solver.statistics(),
            fine=self._showing.statistics(),
            savings=savings_of(solution, self._showing.fine),
            warnings=self._warnings(),
            settings=self._settings,
        )

    def _state(self) -> SessionState:
        state = self._solution.state
        is_halted = self._halted is not None and state is SessionState.SOLVING
        return SessionState.PAUSED if is_halted else state

    def _warnings(self) -> tuple[str, ...]:
        fine = self._showing.fine
        failure = None if fine is None else fine.failure
        told = (*self.scene.notes, *self._solution.warnings, failure, self._halted)
        return tuple(warning for warning in told if warning is not None)

    def outlook(self, request: FrameRequest) -> Outlook:
        """What a frame drawn now would be.

        Raises NotAvailableError, SceneError, LimitExceededError, RenderingUnavailableError.
        """
        self._catch_up(_FIRST_LOOK)
        return self._outlook(request, self._view(request))

    def frame(self, request: FrameRequest) -> Frame:
        """The frame as well as it can be drawn now.

        Raises NotAvailableError, SceneError, LimitExceededError, RenderingUnavailableError.
        """
        self._catch_up(_FIRST_LOOK)
        view = self._view(request)
        # The light may have changed by the time that the picture of it is there.
        outlook = self._outlook(request, view)
        start = time.perf_counter()
        image = view.draw()
        return Frame(image, outlook, time.perf_counter() - start)

    def probe(self, positions: Points, normals: FloatArray) -> ProbeResult:
        """Measure the light at points (n, 3) with normals (n, 3) of any length, as `light_at` does."""
        self._catch_up()
        unit = normals / np.linalg.norm(normals, axis=1, keepdims=True)
        found, error = light_at(self._solution, self._showing.fine_light(), self._settings, positions, unit)
        return ProbeResult(
            revision=self._revision,
            irradiance=found,
            illuminance=self.scene.luminous_efficacy * (found @ LUMINANCE_WEIGHTS),
            error_estimate=error,
        )

    def measure(self, request: GridRequest) -> tuple[Grid, ProbeResult]:
        """Measure the light over a grid of points, as `probe` does. Raises SceneError, LimitExceededError."""
        grid = grid_of(self.scene, request)
        return grid, self.probe(grid.positions, grid.normals)

    def export(self, request: ExportRequest) -> Export:
        """The session as a file for other programs, with the light as far as it has come."""
        self._catch_up()
        return Export(
            content=encode_export(request, self._revision, self._world, self._solution),
            revision=self._revision,
            error_estimate=self._solution.error_estimate,
            converged=self._solution.state is SessionState.CONVERGED,
        )

    def pick(self, camera: CameraChoice, x: int, y: int) -> PickResult:
        """What a frame of `camera` shows in column `x` and row `y`, both from 0 at the top left.

        Raises SceneError naming x or y for a pixel outside the frame, or the camera's field;
        LimitExceededError, RenderingUnavailableError.
        """
        self._catch_up()
        chosen = self._showing.camera(camera)
        fine = self._showing.fine_light()
        mesh = None if fine is None else fine.mesh()
        point = pick_point(self._solution, mesh, self._drawing, chosen, x, y)
        return PickResult(self._revision, point)

    def is_overlay_ready(self, request: OverlayRequest, complete: bool) -> bool:
        """Whether an overlay can be shown, and is complete if it is to be; what is missing is worked on.

        Raises NotReadyError where it never can be, SceneError, LimitExceededError,
        RenderingUnavailableError.
        """
        self._catch_up()
        return is_ready(request.overlay, self._subject(request), complete)

    def overlay(self, request: OverlayRequest) -> Work:
        """Show an overlay that is ready, in slices of a few milliseconds. Raises as `Overlay.show`."""
        self._catch_up()
        self._solution.lend()
        return request.overlay.show(self._subject(request))

    def bake(self, request: LightmapRequest) -> Bake | None:
        """A lightmap of the scene as it stands, to be stepped; None while what it needs is worked on.

        An edit leaves it as it is, of the revision before. Raises NotReadyError where it never can be made.
        """
        self._catch_up()
        self._solution.lend()
        return begin_bake(request, self._revision, self._solution, self._showing.fine_light(), self._settings)

    def _subject(self, request: OverlayRequest) -> Subject:
        return Subject(
            revision=self._revision,
            world=self._world,
            solution=self._solution,
            drawing=self._drawing,
            fine=self._showing.fine_light(),
            camera=self._showing.camera(request.camera),
        )

    def checkpoint(self) -> Checkpoint | None:
        """The solution as it is to be kept, and what is built on it, if that is complete; None while it does
        not rest. Good until the next edit."""
        found = None if self._is_behind else self._solution.checkpoint()
        fine = self._showing.fine
        return found if found is None or fine is None else fine.kept(found)

    def _settle(self, world: World, earlier: Solution | None, drags: bool) -> None:
        """Let light settle in `world`, anew or from what it was `earlier`."""
        left = self._showing.leave()
        solution = Solution(
            world, self._settings, earlier, self._revision, drags, self._memory, left is not None
        )
        self._showing.turn(world, solution, self._settings, left)
        self._world, self._solution = world, solution
        self._turn += 1
        self._is_behind = False

    def _view(self, request: FrameRequest) -> View:
        return self._showing.view(request, drags=self._drags and self._halted is None)

    def _outlook(self, request: FrameRequest, view: View) -> Outlook:
        return Outlook(
            tag=f"{self._life}.{self._turn}.{view.version}",
            renderer=view.chosen[0] if isinstance(view, AutoView) else renderer_of(request),
            revision=self._revision,
            error_estimate=view.error_estimate,
            converged=view.converged,
            drawable=view.drawable,
            improving=view.improving and self._halted is None,
        )

    def _take(self, step: Step) -> tuple[Change, ...]:
        """Go on in the scene that `step` leads to. What that does to the light is found out when asked for.

        So a burst of edits costs one transition, and none waits for those before it.
        """
        world = World.of(step.scene, self._world, _in_colour(self._settings))
        before = None
        moved, drags = _moved_alone(step), self._drags
        if not self._is_behind:
            before = self._progress()
            drags = moved is not None and moved == self._moved
            if not drags:
                self._power = self._solution.power_by_object()
            self._moved = moved
        elif moved != self._moved:
            drags, self._moved = False, None
        self._revision += 1
        self._world, self._drags, self._is_behind, self._halted = world, drags, True, None
        changes = self._changes(step, world)
        self._log.add(changes, before)
        return changes

    def _catch_up(self, first_look: float = 0.0) -> None:
        """Let the solution be that of the world as it stands; if it was not, work on it for some seconds."""
        if self._is_behind:
            self._settle(self._world, self._solution, self._drags)
            if first_look > 0.0:
                self._solution.step(min(first_look, _GLANCE) if self._drags else first_look)

    def _progress(self) -> Progress:
        solver, shots = self._solution.solver, self._solution.solver.shots
        if self._solution.state is SessionState.CONVERGED:
            return Progress({}, 0.0, shots, is_settled=True)
        owed = solver.owed() if isinstance(solver, Redistribution) else {}
        return Progress(
            owed=owed,
            unshot=solver.unshot_power() if isinstance(solver, RadiositySolver) else 0.0,
            shots=shots,
            is_settled=False,
        )

    def _changes(self, step: Step, after: World) -> tuple[Change, ...]:
        emitted = after.emission_by_object()
        return tuple(
            Change(
                entry=self._log.count + number,
                revision=self._revision,
                op=deed.op,
                id=deed.object_id,
                state=ChangeState.PENDING,
                energy_to_redistribute=self._power.get(deed.object_id, emitted.get(deed.object_id, 0.0)),
                shots=0,
            )
            for number, deed in enumerate(step.deeds, 1)
        )


def _moved_alone(step: Step) -> ObjectId | None:
    """The object that `step` moves, if it does nothing else."""
    deed = step.deeds[0] if len(step.deeds) == 1 else None
    return deed.object_id if deed is not None and deed.op == "move" else None


def _in_colour(settings: LightSettings) -> bool:
    return Saving.CHANNELS in settings.in_full

"""The hierarchical radiosity solve: link, settle, refine, until the estimated error is within tolerance.

Source: [H 4.3, 4.4]. The state is residual-based: the leaf radiosities B and the *unshot* radiosity
r = E + rho T B - B, which is what one more gather would add. Whatever changes the operator (a refined
link, a closure factor) changes r and nothing else.

Work is a generator that yields about every few milliseconds, so that `step` can stop at any time.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from solver.geometry.surfaces import Surfaces
from solver.transport.closure import balance, is_closed
from solver.transport.elements import ElementTree
from solver.transport.estimate import ErrorEstimate, ErrorParts, estimate_error
from solver.transport.field import RadiosityField, SolveOutcome
from solver.transport.linking import Light, Linker
from solver.transport.pace import Pace
from solver.transport.refine import Choice, choose, refine
from solver.transport.settings import SolverSettings
from solver.transport.settle import settle
from solver.transport.sliced import SlicedSolve
from solver.transport.state import TransportState
from solver.types import Corners, FloatArray, IntArray, Spectra
from solver.visibility.bvh import Hierarchy
from solver.visibility.pair_rays import STRATA
from solver.visibility.rays import RayScene
from solver.visibility.shafts import FULL, NONE, PARTIAL

_FACING_AT_ONCE: Final = 1 << 18
"""Pairs of patches looked at between two yields."""

_UNSHOT: Final = 0.03
"""Light is settled until this part of the error is unshot."""

_LINKING: Final = 0.2
"""Part of the progress that linking the patches makes."""

_REFINE_SHARE: Final = 0.5
"""A round of refinement deals with at most this share of the squared error."""

_RESOLVED: Final = 0.9
"""Share of a link's squared error that refining it takes away."""

_AIM: Final = 0.97
"""Part of the tolerance that the last round aims at."""


@dataclass(frozen=True)
class SolverStatistics:
    """Counts at one moment."""

    polygons: int
    patches: int
    elements: int
    leaves: int
    links: int
    links_full: int
    links_partial: int
    links_none: int
    channels: int
    closed: bool
    rays: int
    rounds: int
    gathers: int
    memory_bytes: int
    seconds: float


@dataclass(frozen=True, eq=False)
class _Leaves:
    """What `field` tells of the leaves of a tree that had `count` elements."""

    tree: ElementTree
    count: int
    leaves: IntArray
    corners: Corners
    corner_count: IntArray
    patch: IntArray
    area: FloatArray


class RadiositySolver(SlicedSolve):
    """One radiosity solution in the making."""

    def __init__(
        self,
        surfaces: Surfaces,
        rays: RayScene,
        settings: SolverSettings,
        state: TransportState | None = None,
    ) -> None:
        """Set up the patches as the first elements; no light is moved yet. Or go on from a `state`."""
        super().__init__(surfaces, settings)
        self._rays = rays
        linker = Linker.of(surfaces, rays, min(1e-3, 0.05 * settings.error_tolerance))
        self._linker = replace(linker, in_full=settings.in_full)
        self.pace = Pace()
        self._state = TransportState.of(surfaces) if state is None else state
        self._closed: bool | None = None
        self._ray_count = 0
        self._rounds = 0
        self._handed: TransportState | None = None
        self._gathers_before = 0
        self.error_parts = ErrorParts()
        """Of the last estimate"""
        self.norm = 0.0
        """Squared luminance of what is reflected, times area, by the last estimate"""
        self._shape: _Leaves | None = None
        self.linked = 0
        """Patches that are linked with all that come after them"""
        self.bound = 0.0
        """Squared error of a link, times area, that is refined at this tolerance: of the last round"""

    @property
    def state(self) -> TransportState:
        """Elements, links and light, to be read while nothing works on them."""
        return self._state

    @property
    def hierarchy(self) -> Hierarchy:
        """Of the patches that block."""
        return self._linker.hierarchy

    def hand_over(self) -> TransportState:
        """The state, for somebody else to change; what this solver has is then no longer of use."""
        return self._state if self._handed is None else self._handed

    def keep_a_copy(self) -> None:
        """Let those that read the state keep it as it is: what is handed over is another one."""
        self._handed = replace(self._state, links=self._state.links.copy())

    def again(self, surfaces: Surfaces, rays: RayScene, state: TransportState) -> RadiositySolver:
        """A solver of the same scene that has settled already, with the light of `state`."""
        other = RadiositySolver(surfaces, rays, self.settings)
        other._state = replace(state, surfaces=surfaces)
        other._closed, other.bound, other.linked = self._closed, self.bound, surfaces.patch_count
        other.error_estimate, other.unshot_fraction = self.error_estimate, self.unshot_fraction
        other.norm = self.norm
        other.progress, other.outcome = 1.0, SolveOutcome.CONVERGED
        return other

    def statistics(self) -> SolverStatistics:
        """Counts at this moment."""
        state = self._state
        kinds = np.bincount(state.links.kind, minlength=3)
        return SolverStatistics(
            polygons=self.surfaces.face_count,
            patches=self.surfaces.patch_count,
            elements=len(state.tree),
            leaves=len(state.tree.leaves),
            links=len(state.links),
            links_full=int(kinds[FULL]),
            links_partial=int(kinds[PARTIAL]),
            links_none=int(kinds[NONE]),
            channels=state.channels,
            closed=bool(self._closed),
            rays=self._ray_count,
            rounds=self._rounds,
            gathers=state.gathers,
            memory_bytes=state.nbytes,
            seconds=self._seconds,
        )

    def field(self) -> RadiosityField:
        """The leaves and their radiosities; the ambient term where no light is known yet.

        While the leaves are the same, so are the arrays that tell of them, which nobody may change.
        """
        state = self._state
        tree, shape = state.tree, self._shape
        if shape is None or shape.tree is not tree or shape.count != len(tree):
            leaves = tree.leaves
            self._shape = shape = _Leaves(
                tree,
                len(tree),
                leaves,
                tree.corners[leaves],
                tree.corner_count[leaves],
                tree.patch[leaves],
                tree.area[leaves],
            )
        received = np.maximum(state.received[shape.leaves, 0], 0.0)
        patch = shape.patch
        return RadiosityField(
            corners=shape.corners,
            corner_count=shape.corner_count,
            patch=patch,
            area=shape.area,
            radiosity=self._to_rgb(state.emission[patch] + state.reflectance[patch] * received),
            irradiance=self._to_rgb(received),
        )

    @property
    def shots(self) -> int:
        """Links shot over, those of all gathers included."""
        return (self._state.gathers - self._gathers_before) * len(self._state.links)

    @property
    def estimates(self) -> int:
        """Times that all links have been asked for the error so far."""
        return self._rounds

    def unshot_power(self) -> float:
        """W of luminance that leaves have received and not sent on."""
        state = self._state
        leaves = state.tree.leaves
        patch = state.tree.patch[leaves]
        unshot = state.emission[patch] + state.reflectance[patch] * state.received[leaves, 0]
        unshot -= state.radiosity[leaves, 0]
        return float(state.tree.area[leaves] @ np.abs(unshot @ state.weights))

    def _to_rgb(self, spectra: Spectra) -> Spectra:
        return np.repeat(spectra, 3, axis=1) if self._state.channels == 1 else spectra.copy()

    def step(self, budget: float) -> bool:
        """Work for about `budget` seconds; True while more remains."""
        self.pace.resume(budget)
        try:
            return super().step(budget)
        finally:
            self.pace.pause()

    # --- the work, in slices -------------------------------------------------------------------------

    def _open(self) -> Iterator[bool]:
        """Bring about links between all patches that exchange light; sets `outcome` where that fails."""
        yield from self._link_patches()

    def _find_closed(self) -> None:
        """Find out whether the scene is closed, once."""
        if self._closed is None:
            self._closed = is_closed(self.surfaces, self._rays)

    def _run(self) -> Iterator[bool]:
        yield from self._open()
        if self.outcome is not SolveOutcome.RUNNING:
            return
        self._find_closed()
        yield True
        tolerance = self.settings.error_tolerance
        state = self._state
        while True:
            cutoff = self.settings.relative_cutoff
            if cutoff is None:
                target = _UNSHOT * max(tolerance, self.error_estimate)
            else:
                target = cutoff
            if not (yield from self._settle(target)):
                state.radiosity[:, 1:] = 0.0
                yield from self._settle(target, strict=True)
            estimate = self._estimate()
            self.error_estimate = max(estimate.relative, cutoff or 0.0)
            self.norm, self.error_parts = estimate.norm, estimate.parts
            self._rounds += 1
            self.version += 1
            self._report_progress()
            yield True
            if estimate.relative <= tolerance:
                # Where less was left than aimed at, links may err by more another time.
                room = _AIM * tolerance / max(estimate.relative, 0.5 * tolerance)
                self.bound *= max(1.0, room) ** 2
                for _ in state.links.trim():
                    yield True
                if self.error_estimate > tolerance:
                    self.outcome = SolveOutcome.RELATIVE_CUTOFF
                return
            choice = self._choose(estimate)
            if isinstance(choice, SolveOutcome):
                self.outcome = choice
                return
            self.bound = choice.bound
            yield True
            yield from self._refine(estimate.light, choice)

    def _estimate(self) -> ErrorEstimate:
        """The error of what has settled."""
        return estimate_error(self._state)

    def _choose(self, estimate: ErrorEstimate) -> Choice | SolveOutcome:
        """What to refine next; or why nothing can be done."""
        total = float(estimate.links.sum())
        excess = total * (1.0 - (_AIM * self.settings.error_tolerance / estimate.relative) ** 2) / _RESOLVED
        return choose(self._state, estimate, self.settings, min(excess, _REFINE_SHARE * total))

    def _refine(self, light: Light, choice: Choice) -> Generator[bool, None, IntArray]:
        """Refine the chosen links; returns the rows of those that came for them."""
        work = refine(self._state, self._linker, self.pace, light, choice)
        # The leaves are others from the first slice on.
        self.version += 1
        while True:
            try:
                self._ray_count += STRATA * next(work)
            except StopIteration as end:
                rows: IntArray = end.value
                return rows
            yield True

    def _settle(self, target: float, strict: bool = False) -> Generator[bool, None, bool]:
        for _ in balance(self._state, bool(self._closed), strict):
            yield True
        work = settle(self._state, target, self.settings.relative_cutoff is None)
        while True:
            try:
                share = next(work)
            except StopIteration as end:
                return bool(end.value)
            if share is not None:
                self.unshot_fraction = share
            yield True

    def _report_progress(self) -> None:
        tolerance = self.settings.error_tolerance
        if self.error_estimate <= tolerance:
            self.progress = 1.0
        else:
            done = np.log(1.0 / max(self.error_estimate, tolerance)) / np.log(1.0 / min(tolerance, 0.999))
            done = _LINKING + (1.0 - _LINKING) * float(done)
            self.progress = max(self.progress, min(0.99, done))

    def _link_patches(self) -> Iterator[bool]:
        n = self.surfaces.patch_count
        rows = max(1, min(n, _FACING_AT_ONCE // max(n, 1)))
        light = Light(np.zeros(n), np.zeros(n), 1.0)
        everything = np.arange(n, dtype=np.int32)
        for start in range(0, n, rows):
            p, q = self._linker.facing_pairs(everything, everything, start, min(start + rows, n))
            yield True
            batches = []
            for part in self.pace.batches(np.ones(len(p), dtype=np.int64)):
                batches.append(self._linker.link(self._state.tree, p[part], q[part], light))
                self._ray_count += STRATA * int(batches[-1].samples.sum())
                # Rows get shorter towards the end, since each pair is looked at once.
                left = 1.0 - (start + rows * part.stop / len(p)) / n
                self.progress = max(self.progress, _LINKING * (1.0 - max(0.0, left) ** 2))
                yield True
            for batch in batches:
                self._state.links.append(batch)
            self.linked = min(start + rows, n)
            if len(self._state.links) > self.settings.max_links:
                self.outcome = SolveOutcome.LINK_LIMIT
                return

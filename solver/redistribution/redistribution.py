"""Redistribution: the solution of an edited scene out of the one before ([G]).

With residuals the paper's two kinds of shots are one. A link whose form factor an edit has changed by
delta F shoots delta F times the radiosity that its ends have shot: positive energy where something is seen
that was hidden, negative where a shadow falls ([G eq. 5]). What arrives is unshot, and is propagated by the
solve as ever ([G eq. 6]). A solution that had not converged has shot less, and so has less to redistribute.

An edit finds out which links it has touched, and owes them a new look; debts are paid in the order of what
they can add to the squared error. Another edit may interrupt at any time: it takes over what is still owed.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from solver import tolerances
from solver.arrays import GrowingArray
from solver.geometry.surfaces import Surfaces
from solver.redistribution.arrivals import Arrivals
from solver.redistribution.carrying import Shots, add_moments, carry, moments_of
from solver.redistribution.debts import UnlinkedPairs, owe
from solver.redistribution.energy import unshot_square
from solver.redistribution.marks import Marks
from solver.redistribution.matching import Match, match_patches
from solver.redistribution.plan import Plan, make_plan
from solver.redistribution.reach import boxes_around
from solver.redistribution.trace import Trace
from solver.transport.coarsen import coarsen, moved_rows, unneeded
from solver.transport.estimate import SAFETY, ErrorEstimate, Residuals
from solver.transport.field import RadiosityField, SolveOutcome
from solver.transport.linking import Light
from solver.transport.links import LinkBatch
from solver.transport.pace import Pace, steps
from solver.transport.refine import Choice, choose_above
from solver.transport.settings import Interleaving, SolverSettings
from solver.transport.solve import RadiositySolver
from solver.transport.state import TransportState
from solver.types import BoolArray, FloatArray, IntArray
from solver.visibility.bvh import build_hierarchy
from solver.visibility.pair_rays import STRATA
from solver.visibility.rays import RayScene

_PROGRESS: Final = 0.5
"""Part of the progress that redistribution makes."""

_ROUGHLY: Final = 0.1
"""Share of what redistribution has left unshot that may be unshot when refinement begins."""

_FIRST_NOISE: Final = 64.0
"""Noise that links may have at first, of the error that is refined: the strongest ones get some light at
once, and more rays when they are refined."""

_FIRST_LOOKS: Final = 256.0
"""Links looked at in the first batch: some milliseconds, of which the first frame after an edit has few"""

_EARLY: Final = ((0.3, 8.0), (0.1, 1.0))
"""Shares of the energy at stake at which links are refined, while others are still to be looked at; and the
error from which on they are, of what is refined when nothing changes"""

_THRESHOLD: Final = 0.05
"""Share of the energy below which redistribution does not come first any more."""

_SHOTS_A_GATHER: Final = 0.02
"""Links that are looked at between two propagations, of all."""

_GROWN: Final = 1.02
"""Growth of the number of links at which those are tried for mergers that something has ceased to block."""

_CREEP: Final = 1.15
"""The same for all links."""

_IDLE: Final = 1e-3
"""Share of the squared error that may be left to links of which nobody finds out what they see now: they have
it as noise"""

_FOLDED: Final = 0.03
"""Elements without links are folded back when they are more than this share of all."""


class Redistribution(RadiositySolver):
    """The solution of a scene, from that of an earlier revision, which is used up."""

    def __init__(
        self,
        surfaces: Surfaces,
        rays: RayScene,
        settings: SolverSettings,
        earlier: RadiositySolver,
        number: int = 1,
        drags: bool = False,
        anew: bool = True,
    ) -> None:
        """Take over what `earlier` has and owes; no light is moved yet but what has gone with its surfaces.

        `number`: of the edit, greater than those before. `drags`: it moves the object that the edit before
        moved, and no other. `anew`: the trace of what happens begins with this edit.
        """
        match = match_patches(earlier.surfaces, surfaces)
        margin = 2.0 * tolerances.SIDE * max(surfaces.size, earlier.surfaces.size)
        state, moments = earlier.hand_over(), None
        owe(state, surfaces, match, number, margin, drags)
        is_own = False
        if isinstance(earlier, Redistribution):
            moments, is_own = earlier.moments, earlier.is_own
        carried = carry(state, surfaces, match, number, moments, in_place=is_own)
        super().__init__(surfaces, rays, settings, carried.state)
        self._moments = carried.moments
        owed = earlier.unlinked if isinstance(earlier, Redistribution) else UnlinkedPairs.none()
        self._unlinked = owed.carried(match).joined(self._fresh_pairs(match, number, earlier))
        self.bound = earlier.bound
        # Of a solution that had settled it is that of other work.
        self.pace = earlier.pace if is_own else Pace(_FIRST_LOOKS)
        self.linked = surfaces.patch_count
        self.lean: int = earlier.lean if isinstance(earlier, Redistribution) else len(earlier.state.links)
        """Links when all of them were last looked at for mergers"""
        self._known_error, self.norm = earlier.error_estimate, earlier.norm
        self.error_estimate = 1.0
        self.recent = self._fresh_since(match, earlier)
        """(p,) patches that some link in debt has never met"""
        self._near = build_hierarchy(
            surfaces.corners, np.flatnonzero(self.recent & (surfaces.side == 0)).astype(np.int32)
        )
        self._fresh = match.fresh
        before = earlier.trace if isinstance(earlier, Redistribution) and not anew else None
        self._number = number
        self._boxes = np.concatenate(
            [
                boxes_around(earlier.surfaces.corners[match.gone], earlier.surfaces.object[match.gone]),
                boxes_around(surfaces.corners[match.fresh], surfaces.object[match.fresh]),
            ]
        )
        self._boxes += margin * np.array([[-1.0], [1.0]])
        self.trace: Trace = Trace.after(before, match, carried)
        """What has happened since the last solution that somebody looked at closely"""
        self._arrivals = Arrivals(self._state, self._fresh)
        self._plan: Plan | None = None
        self._paid = 0
        self._new, self._faded = Marks(), Marks()
        """Links that are new or have changed, and those of them that something has ceased to block"""
        self.looks = 0
        """Links and pairs looked at anew"""
        self._gathers_before = state.gathers
        self._told: ErrorEstimate | None = None
        """The error, as it was told before light had settled"""

    @property
    def moments(self) -> FloatArray | None:
        """Moments (n, 3, channels) of what elements send, where they are known."""
        return self._moments

    @property
    def is_own(self) -> bool:
        """Whether nobody else can have elements and light that are handed over: they have never rested."""
        return self._handed is None and self.outcome is SolveOutcome.RUNNING

    @property
    def unlinked(self) -> UnlinkedPairs:
        """Pairs that are to be linked."""
        return self._unlinked

    @property
    def owes(self) -> bool:
        """Whether there are debts."""
        return len(self._unlinked) > 0 or bool(self._state.links.debt.any())

    def hand_over(self) -> TransportState:
        """The state, with what has arrived so far."""
        self._arrivals.take_in()
        return super().hand_over()

    @property
    def shots(self) -> int:
        """Links shot over: those looked at anew, and those of all gathers."""
        return self.looks + super().shots

    def field(self) -> RadiosityField:
        """As the solve's, with what has arrived so far."""
        self._arrivals.take_in()
        return super().field()

    def owed(self) -> dict[int, float]:
        """W of luminance that is still at stake, by the numbers of the edits that it is owed to."""
        plan = self._plan or self._make_plan()
        number, energy = np.abs(plan.debt[self._paid :]), plan.energy[self._paid :]
        total = np.bincount(number, energy)
        present = np.flatnonzero(np.bincount(number))
        return dict(zip(present.tolist(), total[present].tolist(), strict=True))

    # --- the work, in slices -------------------------------------------------------------------------

    def _open(self) -> Iterator[bool]:
        plan, state = self._plan or self._make_plan(), self._state
        # What has been shot is as uncertain as what has not, until it is propagated.
        self.error_estimate = min(1.0, math.hypot(self._known_error, SAFETY * plan.doubt))
        # No pause here: every frame of a drag shows something of the light where it is now.
        at_stake = float(plan.left[0])
        for left, error in _EARLY:
            yield from self._pay(at_stake, left)
            if self.bound > 0.0 and not self._is_almost_done():
                # What is refined now is worth more than what is still to be looked at.
                yield from self._refine_new(error * self.bound)
                self._make_plan()
        yield from self._pay(at_stake, 0.0)
        unshot, scale = unshot_square(state)
        new = math.sqrt(unshot / scale) if scale > 0.0 else 1.0
        self.error_estimate = min(1.0, math.hypot(self._known_error, new))
        self._moments = None
        if new > self.settings.error_tolerance and at_stake > 0.0:
            # So much has changed that refinement would look at the wrong light.
            self._find_closed()
            yield from self._settle(_ROUGHLY * new)
            self.version += 1
            yield True
        else:
            state.radiosity = state.answering()
        yield from self._refine_as_before()

    def _pay(self, at_stake: float, least: float) -> Iterator[bool]:
        """Pay debts by the plan until no more than `least` of the W that were `at_stake` are left."""
        plan, state = self._plan, self._state
        assert plan is not None
        moments = self._known_moments()
        coarse = replace(plan.light, noise_limit=_FIRST_NOISE * self.bound)
        since, before = 0, self._paid
        for batch in self.pace.batches(np.ones(len(plan.energy) - before, dtype=np.int64)):
            part = slice(before + batch.start, before + batch.stop)
            is_link = plan.rows[part] >= 0
            seen, doubt = plan.rows[part][is_link], plan.doubt_of_each[part][is_link]
            left = seen[state.links.debt[seen] > 0]
            changed = self._look_again(seen, doubt, coarse, moments)
            self._new.mark(changed)
            self._faded.mark(np.intersect1d(changed, left, assume_unique=True))
            paired = int((plan.rows[part] < 0).sum())
            first = len(state.links)
            self._link(self._unlinked.p[:paired], self._unlinked.q[:paired], coarse, moments)
            self._new.mark(np.arange(first, len(state.links), dtype=np.int32))
            self._unlinked = self._unlinked.without(paired)
            self._paid = part.stop
            self.looks += part.stop - part.start
            self.version += 1
            share = float(plan.left[part.stop]) / at_stake if at_stake > 0.0 else 0.0
            self._arrivals.to_come = self.unshot_fraction = share
            self.progress = _PROGRESS * (1.0 - share)
            yield True
            if 0.0 < share <= least:
                break
            since += part.stop - part.start
            if self._is_propagations_turn(share, since):
                since = 0
                self._arrivals.take_in()
                if not self._is_almost_done() and self.unshot_power() > float(plan.left[part.stop]):
                    moments = yield from self._propagate()
        self._arrivals.take_in()

    def _is_almost_done(self) -> bool:
        """Whether what is left to be looked at takes less than a gather does."""
        assert self._plan is not None
        return len(self._plan.energy) - self._paid < _SHOTS_A_GATHER * len(self._state.links)

    def _is_propagations_turn(self, share: float, since: int) -> bool:
        """Whether propagation may come now, `since` shots after the last; `share` of the energy is at stake.

        A propagation is a gather over all links, so that there are some redistribution shots to each.
        """
        if self.settings.interleaving is Interleaving.REDISTRIBUTE_FIRST and share > _THRESHOLD:
            return False
        return since >= _SHOTS_A_GATHER * len(self._state.links)

    def _propagate(self) -> Generator[bool, None, FloatArray]:
        """Shoot all that has arrived. Returns the moments of what elements send from now on."""
        state = self._state
        radiosity = state.answering()
        arrived = yield from steps(state.gather_in_steps(radiosity - state.radiosity))
        state.received += arrived
        state.radiosity = radiosity
        self.version += 1
        self._moments = None
        return self._known_moments()

    def _known_moments(self) -> FloatArray:
        if self._moments is None:
            self._moments = moments_of(self._state)
        return self._moments

    def _refine_as_before(self) -> Iterator[bool]:
        """Refine what is new until it errs no more than what was there, in the light that has arrived."""
        state = self._state
        rows, merging = self._new.rows(), self._faded.rows()
        if self.bound <= 0.0 or len(rows) == 0:
            return
        full = len(state.links) > _CREEP * self.lean
        if len(state.links) <= _GROWN * self.lean:
            merging = merging[:0]
        if full:
            rows = merging = np.arange(len(state.links), dtype=np.int32)
        if len(merging):
            residuals = Residuals.of(state)
            yield True
            work = coarsen(state, self._linker, self.pace, rows, merging, residuals, self.bound)
            self._new, self._faded = Marks.of((yield from steps(work))), Marks()
        elif full:
            self._new = Marks.of(rows)
        if full:
            self.lean = len(state.links)
        yield from self._refine_new(self.bound)
        # From here on elements are divided and light is settled as in any solve.
        self._moments = None
        yield from self._refine_beyond()
        gone = unneeded(state.tree, state.links)
        if gone.sum() > _FOLDED * len(gone):
            self.trace.keep(np.flatnonzero(~gone).astype(np.int32))
            state.fold(gone)
            self.version += 1
            yield True

    def _refine_new(self, bound: float) -> Iterator[bool]:
        """Refine links that are new until none of them errs by more than `bound`, squared, times area.

        What a link brings otherwise once it is refined is shot at once.
        """
        state = self._state
        # Light that cannot arrive is looked for when this is done.
        residuals = Residuals.of(state, with_excess=False)
        moments = GrowingArray.of(self._known_moments())
        self._moments = None
        rows = self._new.rows()
        yield True
        while True:
            choice = choose_above(state, rows, residuals.estimate(state, rows), self.settings, bound)
            yield True
            if not isinstance(choice, Choice):
                break
            before, worse = len(state.links), Shots.of(state.links, choice.links).taken_back()
            rows = yield from self._refine(residuals.light, choice)
            moved = moved_rows(choice.links, len(rows), before)
            for marks in (self._new, self._faded):
                marks.replace(choice.links, moved, len(state.links))
            self._new.mark(rows)
            rows.sort()
            add_moments(state, moments)
            for shots in (worse, Shots.of(state.links, rows)):
                self._arrivals.shoot(shots, moments.live)
            self.version += 1
            residuals = residuals.grown(state, rows)
        self._arrivals.take_in()
        self._moments = moments.live
        self._arrivals.spread_guess()

    def _refine_beyond(self) -> Iterator[bool]:
        """Refine what else is needed by the light that has arrived, so that it is settled but once."""
        estimate = self._estimate()
        yield True
        choice = self._choose(estimate) if self.settings.error_tolerance < estimate.relative else None
        if isinstance(choice, Choice):
            yield from self._refine(estimate.light, choice)
        else:
            self._told = estimate

    def _estimate(self) -> ErrorEstimate:
        """The error of what has settled.

        It is told before, where nothing is refined since: what was unshot then, no more than the tolerance of
        all light, makes no more of a difference to errors, which are in proportion to the light.
        """
        told, self._told = self._told, None
        return told or super()._estimate()

    def _make_plan(self) -> Plan:
        """All debts, the most urgent first; `_unlinked` gets into that order too."""
        self._plan, self._unlinked = make_plan(
            self._state, self._unlinked, self._number, self._boxes, self._fresh, self.norm,
            _IDLE * self.settings.error_tolerance**2 * self.norm, self.bound,
        )  # fmt: skip
        self._paid = 0
        return self._plan

    def _look_again(self, rows: IntArray, doubt: FloatArray, light: Light, moments: FloatArray) -> IntArray:
        """Let links shoot what they have changed by. Returns the rows (m,) that have changed.

        Where their visible fraction may err by the root of `doubt` (k,), it is not told anew unless it is 0.
        """
        if len(rows) == 0:
            return rows
        links = self._state.links
        renewed = self._linker.renew(
            self._state.tree, links, rows, self.recent, self._near, light, doubt > 0.0
        )
        links.noise[rows[renewed.left]] += doubt[renewed.left]
        links.relist(renewed.relisted, renewed.blocker_count, renewed.blockers)
        changed, fresh = renewed.changed, renewed.batch
        exchange = links.open_exchange[changed] * links.visibility[changed]
        self._shoot(
            fresh,
            fresh.open_exchange * fresh.visibility - exchange,
            fresh.slope_p - links.slope_p[changed],
            fresh.slope_q - links.slope_q[changed],
            moments,
        )
        links.overwrite(changed, fresh)
        links.debt[rows] = 0
        return changed

    def _link(self, p: IntArray, q: IntArray, light: Light, moments: FloatArray) -> None:
        """Link pairs of patches, and shoot over them all that they have shot at others before."""
        if len(p) == 0:
            return
        fresh = self._linker.link(self._state.tree, p, q, light)
        self._shoot(fresh, fresh.open_exchange * fresh.visibility, fresh.slope_p, fresh.slope_q, moments)
        self._state.links.append(fresh)

    def _shoot(
        self,
        batch: LinkBatch,
        exchange: FloatArray,
        slope_p: FloatArray,
        slope_q: FloatArray,
        moments: FloatArray,
    ) -> None:
        area, weights = self._state.tree.area, self._state.weights
        to_p = exchange / area[batch.p] * (moments[batch.q, 0] @ weights)
        to_q = exchange / area[batch.q] * (moments[batch.p, 0] @ weights)
        self.trace.disturb(batch.p, batch.q, to_p, to_q)
        self._ray_count += STRATA * int(batch.samples.sum())
        self._arrivals.shoot(Shots(batch.p, batch.q, exchange, slope_p, slope_q), moments)

    def _fresh_since(self, match: Match, earlier: RadiositySolver) -> BoolArray:
        """Patches (p,) that some link in debt has never met."""
        recent = np.zeros(self.surfaces.patch_count, dtype=np.bool_)
        if isinstance(earlier, Redistribution) and earlier.owes:
            before = match.number[np.flatnonzero(earlier.recent)]
            recent[before[before >= 0]] = True
        recent[match.fresh] = True
        return recent

    def _fresh_pairs(self, match: Match, number: int, earlier: RadiositySolver) -> UnlinkedPairs:
        """Pairs of fresh patches with all others, and what an interrupted first linking left over."""
        n = self.surfaces.patch_count
        fresh = match.fresh
        rank = np.full(n, n, dtype=np.int32)
        rank[fresh] = np.arange(len(fresh), dtype=np.int32)
        p, q = self._linker.facing_pairs(fresh, rank, 0, len(fresh))
        pairs = UnlinkedPairs(p, q, np.full(len(p), number, dtype=np.int32))
        left = match.number[earlier.linked :]
        left = left[left >= 0]
        if len(left) == 0:
            return pairs
        rank = np.full(n, -1, dtype=np.int32)
        rank[left] = np.arange(len(left), dtype=np.int32)
        p, q = self._linker.facing_pairs(left, rank, 0, len(left))
        return pairs.joined(UnlinkedPairs(p, q, np.full(len(p), number, dtype=np.int32)))

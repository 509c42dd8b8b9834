"""The radiosity of scenes too large to link: elements' mean irradiances, sampled by the path tracer.

All bounces are in every sample, so that nothing is iterated and no form factor is kept. Rounds of passes
go to the elements whose errors weigh most; elements split where siblings differ by more than noise and
tolerance allow. Means of elements are unbiased; the error is known from the passes' own spread
(`solver.engine.sampled_error`). A field of m lit elements takes some m (s / error)^2 paths, where s is the
relative spread of one path, 1 to 5 mostly: many more than links would take, where there can be links.

Source: mean irradiances as in [H 4.1], with constant elements; sampled as in Keller 1997, but from the
receivers.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Final

import numpy as np

from solver.engine.sampled_error import SampledError, sampled_error
from solver.engine.sampled_splits import choose_splits
from solver.geometry.surfaces import Surfaces
from solver.pathtracing import PathTracer
from solver.pathtracing.element_means import PASS, ElementMeans, deal, explored
from solver.transport.closure import is_closed
from solver.transport.field import RadiosityField, SolveOutcome
from solver.transport.settings import SolverSettings
from solver.transport.sliced import SlicedSolve
from solver.transport.solve import SolverStatistics
from solver.transport.state import TransportState
from solver.types import LUMINANCE_WEIGHTS, FloatArray, Int64Array, IntArray, Points
from solver.visibility.rays import RayScene

FIRST_AREA: Final = 1.0 / 8000.0
"""Largest element to begin with, as a part of all area. The work goes with the number of elements; frames of
an office of 17,000 patches err by half as much as with 1 / 2000, at 1.6 times the work to a 5 % error."""

LEAST_AREA: Final = 1e-7
"""Smallest element that splitting may make unless the settings say, as a part of all area."""

_SLICE: Final = 0.012
"""Seconds of tracing between two yields."""

_SHORTEST: Final = 0.25
_LONGEST: Final = 2.0
_ROUND_SHARE: Final = 0.25
"""A round takes this share of the time so far, within these bounds in seconds; the field changes once a
round."""

_FIRST_RATE: Final = 2e5
"""Paths a second, until it is known."""

_EXPLORED: Final = 16
"""Rounds in which every element gets a pass, whatever its error seems to be."""

_PROBE_PATHS: Final = 1 << 16
_LEAST_PROBE_PATHS: Final = 256
"""Paths of all points of a probe together, about; and of each, at least."""

_PROBE_SEED: Final = 1


class SampledSolver(SlicedSolve):
    """One sampled solution in the making."""

    def __init__(self, surfaces: Surfaces, rays: RayScene, settings: SolverSettings) -> None:
        """Set up the patches as the first elements; nothing is traced yet."""
        super().__init__(surfaces, settings)
        self._rays = rays
        self._tracer = PathTracer(surfaces, rays)
        self._prober = PathTracer(surfaces, rays, _PROBE_SEED)
        self._state = TransportState.of(surfaces)
        self._means = ElementMeans(surfaces.patch_count)
        self._weights: FloatArray = surfaces.reflectance * LUMINANCE_WEIGHTS
        self._least_area = LEAST_AREA * float(surfaces.area.sum())
        self._closed = False
        self._ray_count = 0
        self._path_count = 0
        self._tracing = 0.0
        self._rounds = 0

    @property
    def state(self) -> TransportState:
        """Elements without links, and the light that `field` tells."""
        return self._state

    def statistics(self) -> SolverStatistics:
        """Counts at this moment; there are no links and no gathers."""
        tree = self._state.tree
        return SolverStatistics(
            polygons=self.surfaces.face_count,
            patches=self.surfaces.patch_count,
            elements=len(tree),
            leaves=len(tree.leaves),
            links=0,
            links_full=0,
            links_partial=0,
            links_none=0,
            channels=self._state.channels,
            closed=self._closed,
            rays=self._ray_count,
            rounds=self._rounds,
            gathers=0,
            memory_bytes=self._state.nbytes + self._means.nbytes,
            seconds=self._seconds,
        )

    def field(self) -> RadiosityField:
        """The leaves and their radiosities; the ambient term where no light is known yet."""
        tree, surfaces = self._state.tree, self.surfaces
        leaves = tree.leaves
        patch = tree.patch[leaves]
        irradiance = np.broadcast_to(self._state.received[leaves, 0], (len(leaves), 3)).copy()
        return RadiosityField(
            corners=tree.corners[leaves],
            corner_count=tree.corner_count[leaves],
            patch=patch,
            area=tree.area[leaves],
            radiosity=surfaces.emission[patch] + surfaces.reflectance[patch] * irradiance,
            irradiance=irradiance,
        )

    def irradiance_at(self, positions: Points, normals: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Irradiance (n, 3) W/m2 at points (n, 3) with unit normals (n, 3), and its relative error (n,).

        Not from the field, but by paths of their own. Where none of them meets light, nothing is known of
        the error, which is 1; where there are no lamps, it is 0.
        """
        samples = max(_LEAST_PROBE_PATHS, _PROBE_PATHS // max(1, len(positions)))
        mean, error = self._prober.irradiance(positions, normals, samples)
        light, noise = mean @ LUMINANCE_WEIGHTS, error @ LUMINANCE_WEIGHTS
        relative = np.full(len(positions), 1.0 if self.surfaces.emission.any() else 0.0)
        np.divide(noise, light, out=relative, where=light > 0.0)
        return mean, np.minimum(relative, 1.0)

    # --- the work, in slices -------------------------------------------------------------------------

    def _run(self) -> Iterator[bool]:
        self._closed = is_closed(self.surfaces, self._rays)
        yield True
        if not self.surfaces.emission.any():
            self._finish_dark()
            return
        yield from self._split_evenly()
        tolerance = self.settings.error_tolerance
        # Two passes tell an error; the first is shown as soon as it is there.
        leaves = self._state.tree.leaves
        yield from self._sample(leaves, np.ones(len(leaves), dtype=np.int64))
        self._show(leaves)
        yield from self._sample(leaves, np.ones(len(leaves), dtype=np.int64))
        while True:
            leaves = self._state.tree.leaves
            error, worth = self._judge(leaves)
            if error.relative < self.error_estimate:
                self._show(leaves)
                self._report(error)
            yield True
            if error.relative <= tolerance:
                return
            chosen = choose_splits(self._state.tree, leaves, error, self.settings, self._least_area)
            if isinstance(chosen, SolveOutcome):
                self.outcome = chosen
                return
            if len(chosen):
                known = self._means.passes[chosen]
                fresh = self._split(chosen)
                yield True
                yield from self._sample(fresh, self._first_passes(chosen, known))
                continue
            passes = deal(self._round_passes(), self._means.passes[leaves], worth)
            passes += explored(self._rounds, _EXPLORED, len(leaves))
            yield True
            yield from self._sample(leaves, passes)

    def _sample(self, leaves: IntArray, passes: Int64Array) -> Iterator[bool]:
        tree = self._state.tree
        ids = np.repeat(leaves, passes)
        patch = tree.patch[ids]
        estimate = self._tracer.element_pass(
            tree.corners[ids], tree.corner_count[ids], patch, PASS, self._rounds
        )
        yield True
        more = True
        while more:
            start = time.perf_counter()
            more = estimate.step(_SLICE)
            self._tracing += time.perf_counter() - start
            yield True
        self._rounds += 1
        self._ray_count += estimate.ray_count
        self._path_count += PASS * len(ids)
        self._means.add(ids, estimate.mean, self._weights[tree.patch])
        yield True

    def _round_passes(self) -> int:
        rate = self._path_count / self._tracing if self._tracing > 0.0 else _FIRST_RATE
        seconds = min(_LONGEST, max(_SHORTEST, _ROUND_SHARE * self._tracing))
        return max(1, int(rate * seconds / PASS))

    def _first_passes(self, parents: IntArray, known: Int64Array) -> Int64Array:
        """Passes for the children of `parents` (m,): two, and what those had, as far as a round goes."""
        count = self._state.tree.child_count[parents]
        share = min(1.0, self._round_passes() / float(known.sum()))
        return np.repeat(2 + (share * known / count).astype(np.int64), count)

    def _judge(self, leaves: IntArray) -> tuple[SampledError, FloatArray]:
        """The error of the leaves, and what passes of each (m,) are worth."""
        tree, means = self._state.tree, self._means
        patch = tree.patch[leaves]
        weights = self._weights[patch]
        reflected = np.einsum("mc,mc->m", means.irradiance[leaves], weights)
        spread = means.spread(leaves, patch)
        error = sampled_error(
            reflected, spread / means.passes[leaves], tree.area[leaves], tree.parent[leaves],
            np.asarray(weights.any(axis=1)),
        )  # fmt: skip
        return error, np.sqrt(error.weight * spread)

    def _split_evenly(self) -> Iterator[bool]:
        tree = self._state.tree
        largest = max(FIRST_AREA * float(self.surfaces.area.sum()), self.settings.minimum_area or 0.0)
        while True:
            leaves = tree.leaves
            large = leaves[tree.area[leaves] > largest]
            room = (self.settings.max_elements - len(tree)) // 4
            large = large[np.argsort(-tree.area[large], kind="stable")][: max(0, room)]
            if len(large) == 0:
                return
            self._split(np.sort(large))
            yield True

    def _split(self, leaves: IntArray) -> IntArray:
        """Split leaves; the children, which know nothing yet."""
        before = len(self._state.tree)
        self._state.split(leaves)
        count = len(self._state.tree) - before
        self._means.grow(count)
        self.version += 1
        return np.arange(before, before + count, dtype=np.int32)

    # --- what it shows -------------------------------------------------------------------------------

    def _show(self, leaves: IntArray) -> None:
        """Have the field hold the means as they are. Until then, children have their parents' light."""
        state = self._state
        received = self._means.irradiance[leaves, : state.channels]
        patch = state.tree.patch[leaves]
        state.received[leaves, 0] = received
        state.radiosity[leaves, 0] = state.emission[patch] + state.reflectance[patch] * received
        self.version += 1

    def _report(self, error: SampledError) -> None:
        self.error_estimate = error.relative
        self.unshot_fraction = 0.0
        tolerance = self.settings.error_tolerance
        # Work goes with the inverse square of the error.
        done = (tolerance / error.relative) ** 2 if error.relative > tolerance else 1.0
        self.progress = max(self.progress, done)

    def _finish_dark(self) -> None:
        self._show(self._state.tree.leaves)
        self.error_estimate, self.unshot_fraction, self.progress = 0.0, 0.0, 1.0

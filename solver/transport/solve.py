"""The hierarchical radiosity solve: link, settle, refine, until the estimated error is within tolerance.

Source: [H 4.3, 4.4]. The state is residual-based: the leaf radiosities B and the *unshot* radiosity
r = E + rho T B - B, which is what one more gather would add. Light is settled by conjugate gradients on
the symmetric form of (I - rho T) B = E, whose preconditioned residual is r itself: the search directions
are combinations of shots, and Jacobi's iteration ([H 4.3], step 2) is its first step. Whatever changes
the operator (a refined link, a closure factor) changes r and nothing else.

Work is a generator that yields about every few milliseconds, so that `step` can stop at any time.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.geometry.surfaces import Surfaces
from solver.parallel import run_chunks
from solver.transport.closure import is_closed, rescale
from solver.transport.elements import ElementTree
from solver.transport.field import RadiosityField, SolveOutcome
from solver.transport.linking import Light, Linker
from solver.transport.links import LinkBatch, LinkTable
from solver.transport.oracle import (
    MAX_SAMPLES,
    RESAMPLE,
    SPLIT_P,
    SPLIT_Q,
    child_pairs,
    coherent_bias,
    element_spread,
    leaf_variance,
    link_errors,
    threshold_for_share,
)
from solver.transport.pushpull import irradiance, pull
from solver.transport.settings import SolverSettings
from solver.types import LUMINANCE_WEIGHTS, BoolArray, FloatArray, IntArray, Spectra
from solver.visibility.rays import RayScene
from solver.visibility.shafts import FULL, NONE, PARTIAL

_PAIRS_AT_ONCE: Final = 4096
"""Links evaluated between two yields."""

import os
LEAF=float(os.environ.get('LEAF','0.25'))
NOISE_SHARE=float(os.environ.get('NS','0.5'))
_CLOSURE_STEPS: Final = 2
_MOST_REFLECTED: Final = 0.995
"""In an open scene no leaf may reflect more than this share of a unit field, whatever its links say."""

_REFINE_SHARE: Final = 0.75
"""A round of refinement resolves at most this share of the squared error."""


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


class RadiositySolver:
    """One radiosity solution in the making."""

    def __init__(
        self,
        surfaces: Surfaces,
        rays: RayScene,
        settings: SolverSettings,
        warm_start: RadiositySolver | None = None,
    ) -> None:
        """Set up the patches as the first elements; no light is moved yet.

        `warm_start`: a solution of an earlier revision, whose mean radiosities of patches that still
        exist are where this one starts from.
        """
        self.surfaces = surfaces
        self.settings = settings
        self.outcome = SolveOutcome.RUNNING
        self.error_estimate = 1.0
        self.unshot_fraction = 1.0
        self.progress = 0.0
        self.version = 0
        """Counts the changes of the field."""
        self._rays = rays
        self._channels = 1 if surfaces.is_grey else 3
        self._weights = np.ones(1) if self._channels == 1 else LUMINANCE_WEIGHTS
        self._patch_emission = np.ascontiguousarray(surfaces.emission[:, : self._channels])
        self._patch_reflectance = np.ascontiguousarray(surfaces.reflectance[:, : self._channels])
        self._linker = Linker.of(surfaces, rays, min(1e-3, 0.05 * settings.error_tolerance))
        self._tree = ElementTree(surfaces)
        self._links = LinkTable()
        self._closed = False
        self._closure = np.ones(surfaces.patch_count)
        self._radiosity: Spectra = self._patch_emission.copy()
        self._received: Spectra = np.tile(self._ambient(), (surfaces.patch_count, 1))
        if warm_start is not None:
            self._adopt(warm_start)
        self._counts = {"rays": 0, "rounds": 0, "gathers": 0}
        self._seconds = 0.0
        self._work = self._run()

    def step(self, budget: float) -> bool:
        """Work for about `budget` seconds; True while more remains."""
        start = time.perf_counter()
        while self.outcome is SolveOutcome.RUNNING:
            if next(self._work, None) is None and self.outcome is SolveOutcome.RUNNING:
                self.outcome = SolveOutcome.CONVERGED
            if time.perf_counter() - start >= budget:
                break
        self._seconds += time.perf_counter() - start
        return self.outcome is SolveOutcome.RUNNING

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a user should know about this solution."""
        told = self.surfaces.warnings
        if self.outcome not in (SolveOutcome.RUNNING, SolveOutcome.CONVERGED):
            told = (*told, self.outcome.value)
        return told

    def statistics(self) -> SolverStatistics:
        """Counts at this moment."""
        tree, links = self._tree, self._links
        kinds = np.bincount(links.kind, minlength=3)
        return SolverStatistics(
            polygons=self.surfaces.face_count,
            patches=self.surfaces.patch_count,
            elements=len(tree),
            leaves=len(tree.leaves),
            links=len(links),
            links_full=int(kinds[FULL]),
            links_partial=int(kinds[PARTIAL]),
            links_none=int(kinds[NONE]),
            channels=self._channels,
            closed=self._closed,
            rays=self._counts["rays"],
            rounds=self._counts["rounds"],
            gathers=self._counts["gathers"],
            memory_bytes=tree.nbytes + links.nbytes + 6 * self._radiosity.nbytes,
            seconds=self._seconds,
        )

    def field(self) -> RadiosityField:
        """The leaves and their radiosities; the ambient term where no light is known yet."""
        tree = self._tree
        leaves = tree.leaves
        patch = tree.patch[leaves]
        received = self._received[leaves]
        radiosity = self._patch_emission[patch] + self._patch_reflectance[patch] * received
        return RadiosityField(
            corners=tree.corners[leaves],
            corner_count=tree.corner_count[leaves],
            patch=patch,
            area=tree.area[leaves],
            radiosity=self._to_rgb(radiosity),
            irradiance=self._to_rgb(received),
        )

    def _to_rgb(self, spectra: Spectra) -> Spectra:
        return np.repeat(spectra, 3, axis=1) if self._channels == 1 else spectra.copy()

    def _ambient(self) -> FloatArray:
        """Mean irradiance of the scene if it were one well-mixed enclosure, (channels,)."""
        area = self.surfaces.area[:, None]
        total = max(float(area.sum()), 1e-300)
        emitted = (area * self._patch_emission).sum(axis=0) / total
        absorbed = 1.0 - (area * self._patch_reflectance).sum(axis=0) / total
        return np.asarray(emitted / absorbed)

    def _adopt(self, earlier: RadiositySolver) -> None:
        old = {key: n for n, key in enumerate(_patch_keys(earlier.surfaces))}
        match = np.array([old.get(key, -1) for key in _patch_keys(self.surfaces)], dtype=np.int64)
        known = match >= 0
        earlier_received = earlier._received.copy()
        pull(earlier._tree.child, earlier._tree.child_count, earlier._tree.area, earlier_received)
        received = earlier_received[match[known]]
        if received.shape[1] != self._channels:
            received = np.repeat(received[:, :1], self._channels, axis=1)
        self._received[known] = received
        self._radiosity[known] += self._patch_reflectance[known] * received

    # --- the work, in slices -------------------------------------------------------------------------

    def _run(self) -> Iterator[bool]:
        yield from self._link_patches()
        self._closed = is_closed(self.surfaces, self._rays)
        tolerance = self.settings.error_tolerance
        while True:
            yield from self._balance_closure()
            yield from self._settle(0.05 * min(tolerance, self.error_estimate))
            errors, light, scale = self._link_errors()
            yield True
            total = float(errors.sum())
            self.error_estimate = min(1.0, float(np.sqrt(total / scale))) if scale > 0.0 else 0.0
            self._counts["rounds"] += 1
            self.version += 1
            self._report_progress()
            if self.error_estimate <= tolerance:
                return
            excess = (total - (0.95 * tolerance) ** 2 * scale) / 0.7
            if not (yield from self._refine(errors, light, min(excess, _REFINE_SHARE * total))):
                return

    def _report_progress(self) -> None:
        tolerance = self.settings.error_tolerance
        if self.error_estimate <= tolerance:
            self.progress = 1.0
        else:
            done = np.log(1.0 / max(self.error_estimate, tolerance)) / np.log(1.0 / min(tolerance, 0.999))
            self.progress = max(self.progress, min(0.99, float(done)))

    def _link_patches(self) -> Iterator[bool]:
        n = self.surfaces.patch_count
        rows = max(1, min(n, (1 << 21) // max(n, 1)))
        light = Light(np.zeros(n), np.zeros(n), 1.0)
        for start in range(0, n, rows):
            p, q = self._linker.facing_pairs(start, min(start + rows, n))
            yield True
            for first in range(0, len(p), _PAIRS_AT_ONCE):
                part = slice(first, first + _PAIRS_AT_ONCE)
                self._take(self._linker.link_patches(self._tree, p[part], q[part], light))
                yield True

    def _take(self, batch: LinkBatch) -> None:
        self._links.append(batch)
        self._counts["rays"] += 16 * int(batch.samples.sum())

    def _operator(self, values: Spectra) -> Spectra:
        """Irradiance on every element from leaf radiosities."""
        self._counts["gathers"] += 1
        tree, links = self._tree, self._links
        return irradiance(
            tree.child, tree.child_count, tree.parent, tree.area, links.p, links.q,
            self._exchange, self._closure, values,
        )  # fmt: skip

    def _balance_closure(self) -> Iterator[bool]:
        """Bring the row sums to where they must be, after links have changed."""
        self._exchange = self._links.open_exchange * self._links.visibility
        leaf: BoolArray = self._tree.child < 0
        self._closure = np.ones(len(self._tree))
        ones = np.ones((len(self._tree), 1))
        highest = self._patch_reflectance.max(axis=1)[self._tree.patch]
        limit = _MOST_REFLECTED / np.maximum(highest, 1e-300)
        for _ in range(_CLOSURE_STEPS):
            row_sum = self._operator(ones)[:, 0]
            closure = rescale(self._closure, row_sum, leaf, limit, self._closed)
            yield True
            if np.array_equal(closure, self._closure):
                break
            self._closure = closure

    def _settle(self, target: float) -> Iterator[bool]:
        """Conjugate gradients until the unshot radiosity is below `target` of the radiosity, both RMS."""
        tree = self._tree
        leaf = tree.child < 0
        patch = tree.patch
        reflectance = np.where(leaf[:, None], self._patch_reflectance[patch], 0.0)
        emission = self._patch_emission[patch]
        active = reflectance > 0.0
        weight = np.where(active, tree.area[:, None] / np.where(active, reflectance, 1.0), 0.0)
        area = np.where(leaf, tree.area, 0.0)[:, None]
        self._radiosity[~active] = emission[~active]
        self._received = self._operator(self._radiosity)
        unshot = np.where(active, emission + reflectance * self._received - self._radiosity, 0.0)
        yield True
        cutoff = self.settings.relative_cutoff
        limit = target if cutoff is None else cutoff
        direction = unshot.copy()
        energy = (weight * unshot * unshot).sum(axis=0)
        for _ in range(500):
            scale = float(np.sqrt((area * self._radiosity**2).sum()))
            self.unshot_fraction = float(
                np.abs(area * unshot).sum() / max((area * np.abs(self._radiosity)).sum(), 1e-300)
            )
            if float(np.sqrt((area * unshot * unshot).sum())) <= limit * scale:
                break
            arrived = self._operator(direction)
            moved = np.where(active, direction - reflectance * arrived, 0.0)
            curvature = (weight * direction * moved).sum(axis=0)
            length = np.where(curvature > 0.0, energy / np.where(curvature > 0.0, curvature, 1.0), 0.0)
            self._radiosity += length * direction
            self._received += length * arrived
            unshot -= length * moved
            before, energy = energy, (weight * unshot * unshot).sum(axis=0)
            direction = unshot + np.where(before > 0.0, energy / np.where(before > 0.0, before, 1.0), 0.0) * direction
            yield True

    def _link_errors(self) -> tuple[FloatArray, Light, float]:
        """Squared errors of links by remedy (3, n), the light, and the squared norm of reflected radiosity.

        All are area-weighted. Emission is known and would only dilute a relative error, so that the norm
        leaves it out.
        """
        tree, links = self._tree, self._links
        luminance = self._radiosity @ self._weights
        column = luminance[:, None].copy()
        pull(tree.child, tree.child_count, tree.area, column)
        mean = np.ascontiguousarray(column[:, 0])
        reflectance = (self._patch_reflectance @ self._weights)[tree.patch]
        variance, spread = np.empty(len(tree)), np.empty(len(tree))
        leaf_variance(
            links.p, links.q, links.deviation_p, links.deviation_q, tree.parent, tree.area, reflectance,
            mean, variance,
        )  # fmt: skip
        element_spread(tree.child, tree.child_count, tree.area, mean, variance, spread)
        bias = np.empty(len(tree))
        coherent_bias(
            links.p, links.q, links.deviation_p, links.deviation_q, tree.parent, tree.child,
            tree.child_count, tree.area, reflectance, spread, bias,
        )  # fmt: skip
        leaf = tree.child < 0
        resolved = np.where(leaf, LEAF, 1.0)
        errors = np.empty((3, len(links)))

        def work(start: int, stop: int) -> None:
            link_errors(
                links.p, links.q, links.open_exchange, links.noise, links.deviation_p,
                links.deviation_q, tree.area, reflectance, mean, spread, resolved, bias, start, stop,
                errors[SPLIT_P], errors[SPLIT_Q], errors[RESAMPLE],
            )  # fmt: skip

        run_chunks(work, len(links), 1 << 15)
        reflected = luminance[leaf] - (self._patch_emission @ self._weights)[tree.patch[leaf]]
        return errors, Light(mean, reflectance, 0.0), float((tree.area[leaf] * reflected**2).sum())

    def _refine(self, errors: FloatArray, light: Light, resolve: float) -> Iterator[bool]:
        """Split or resample the worst links until `resolve` of the squared error is dealt with.

        False if nothing more can be done.
        """
        tree, links = self._tree, self._links
        errors[SPLIT_P, ~self._splittable(links.p)] = 0.0
        errors[SPLIT_Q, ~self._splittable(links.q)] = 0.0
        errors[RESAMPLE, links.samples >= MAX_SAMPLES] = 0.0
        action = np.argmax(errors, axis=0).astype(np.int32)
        worth = errors.max(axis=0)
        if float(worth.sum()) <= 1e-3 * resolve:
            self.outcome = SolveOutcome.MINIMUM_AREA
            return False
        bound = threshold_for_share(worth, min(resolve, 0.9 * float(worth.sum())))
        chosen = np.flatnonzero(worth >= bound)
        if self._over_limit(len(chosen)):
            return False
        action = action[chosen]
        p, q, samples = links.p[chosen], links.q[chosen], links.samples[chosen]
        split = np.where(action == SPLIT_P, p, q)
        ends = np.unique(split[action != RESAMPLE])
        self._split(ends[tree.child[ends] < 0])
        grown = len(tree) - len(light.radiosity)
        parent = tree.parent[len(tree) - grown :]
        light = Light(
            np.concatenate([light.radiosity, light.radiosity[parent]]),
            np.concatenate([light.reflectance, light.reflectance[parent]]),
            NOISE_SHARE * bound,
        )
        yield True
        rows = np.where(action == RESAMPLE, 1, tree.child_count[split]).astype(np.int64)
        slot = np.cumsum(rows) - rows
        total = int(rows.sum())
        new_p, new_q, origin = (np.empty(total, dtype=np.int32) for _ in range(3))
        child_pairs(p, q, action, tree.child, tree.child_count, slot, new_p, new_q, origin)
        least = np.where(action == RESAMPLE, 4 * samples, 1).astype(np.int32)
        start, count = links.blocker_start[chosen], links.blocker_count[chosen]
        pool = links.pool
        batches = []
        for first in range(0, total, _PAIRS_AT_ONCE):
            part = slice(first, first + _PAIRS_AT_ONCE)
            source = origin[part]
            batches.append(
                self._linker.link_children(
                    tree, new_p[part], new_q[part], start[source], count[source], pool, least[source], light
                )
            )
            yield True
        gone = np.zeros(len(links), dtype=bool)
        gone[chosen] = True
        links.remove(gone)
        for batch in batches:
            self._take(batch)
        return True

    def _splittable(self, elements: IntArray) -> BoolArray:
        tree = self._tree
        minimum = self.settings.minimum_area
        if minimum is None:
            minimum = 1e-8 * self.surfaces.size**2
        return np.asarray((tree.child[elements] >= 0) | (tree.area[elements] >= 2.0 * minimum))

    def _over_limit(self, chosen: int) -> bool:
        if len(self._tree) + 4 * chosen > self.settings.max_elements and len(self._tree) > self.settings.max_elements // 2:
            self.outcome = SolveOutcome.ELEMENT_LIMIT
        elif len(self._links) + 3 * chosen > self.settings.max_links:
            self.outcome = SolveOutcome.LINK_LIMIT
        return self.outcome is not SolveOutcome.RUNNING

    def _split(self, ids: IntArray) -> None:
        """Subdivide leaves; the children start with their parent's light."""
        tree = self._tree
        before = len(tree)
        tree.split(ids)
        parent = tree.parent[before:]
        self._radiosity = np.concatenate([self._radiosity, self._radiosity[parent]])
        self._received = np.concatenate([self._received, self._received[parent]])


def _patch_keys(surfaces: Surfaces) -> list[tuple[str, int, int, int]]:
    """Names of patches that survive edits of other objects: object, face, side, rank within the face."""
    seen: dict[tuple[str, int, int], int] = {}
    keys = []
    for index, face, side in zip(
        surfaces.object.tolist(), surfaces.face.tolist(), surfaces.side.tolist(), strict=True
    ):
        base = (surfaces.object_ids[index], face, side)
        rank = seen.get(base, 0)
        seen[base] = rank + 1
        keys.append((*base, rank))
    return keys

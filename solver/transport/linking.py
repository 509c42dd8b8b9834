"""From pairs of elements to evaluated links: exchange area, its variation, blockers and visibility.

Everything runs in bulk: kernels over ranges of pairs, then one batch of rays for the pairs that have
blockers. Pairs without blockers cost no ray ("model only what a scene needs").
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from solver import tolerances
from solver.geometry.surfaces import Surfaces
from solver.parallel import run_chunks
from solver.transport.elements import ElementTree
from solver.transport.links import LinkBatch, LinkTable, take_ranges
from solver.transport.oracle import MAX_SAMPLES, samples_needed
from solver.transport.pairs import find_exchange, find_slopes, inherit_blockers, mark_facing
from solver.transport.settings import Saving
from solver.types import BoolArray, FloatArray, Int64Array, IntArray, Points
from solver.visibility.blockers import UNKNOWN, first_blockers, renewed_blockers
from solver.visibility.bvh import Hierarchy, build_hierarchy
from solver.visibility.fraction import visible_fractions
from solver.visibility.lifts import ray_lifts
from solver.visibility.rays import RayScene
from solver.visibility.shafts import NONE, PARTIAL

_CHUNK: Final = 256
_LEAST: Final = 32

_AGAIN: Final = 4
"""Rays, in units of 16, that a link takes up to when it is looked at again, if it had more"""


@dataclass(frozen=True, eq=False)
class Light:
    """The light as it stands, which decides how much care a link deserves; luminance, n elements."""

    radiosity: FloatArray
    """(n,) W/m2"""
    reflectance: FloatArray
    """(n,)"""
    noise_limit: float
    """squared error times area, (W/m2)^2 m2, that the sampling of one link's visibility may leave"""


@dataclass(frozen=True, eq=False)
class Renewed:
    """What has become of links that have been looked at again."""

    changed: IntArray
    """(m,) rows that are different"""
    batch: LinkBatch
    """(m,) what they are"""
    relisted: IntArray
    """(k,) rows that have other blockers, though all their rays go where they went"""
    blocker_count: IntArray
    """(k,)"""
    blockers: IntArray
    """all lists of those, one after the other"""
    left: Int64Array
    """(l,) which of the links asked for have been left to what they saw"""


@dataclass(frozen=True, eq=False)
class Linker:
    """What linking needs to know of a scene."""

    surfaces: Surfaces
    rays: RayScene
    hierarchy: Hierarchy
    side_tolerance: float
    """metres"""
    exchange_tolerance: float
    """relative error of an unoccluded exchange area"""
    in_full: tuple[Saving, ...] = ()
    """Of shadow tests and rays, what is not saved"""

    @staticmethod
    def of(surfaces: Surfaces, rays: RayScene, exchange_tolerance: float) -> Linker:
        """The linker of a scene; its hierarchy holds the front patches, which are the blockers."""
        fronts = np.flatnonzero(surfaces.side == 0).astype(np.int32)
        return Linker(
            surfaces,
            rays,
            build_hierarchy(surfaces.corners, fronts),
            tolerances.SIDE * surfaces.size,
            exchange_tolerance,
        )

    def facing_pairs(
        self, members: IntArray, rank: IntArray, start: int, stop: int
    ) -> tuple[IntArray, IntArray]:
        """Pairs (p, q) of patches, p < q, that have a part in front of each other.

        Of one of members[start:stop] and any patch whose `rank` (p,) is not less than its own; members are
        ranked by their places.
        """
        s = self.surfaces
        middle, reach = self.extents
        facing = np.zeros((stop - start, s.patch_count), dtype=np.bool_)

        def mark(a: int, b: int) -> None:
            mark_facing(
                s.corners, s.corner_count, s.normal, middle, reach, self.side_tolerance, members, rank, start,
                start + a, start + b, facing,
            )  # fmt: skip

        run_chunks(mark, stop - start, 64, 8)
        member, other = np.nonzero(facing)
        one, other = members[start + member], other.astype(np.int32)
        return np.minimum(one, other), np.maximum(one, other)

    @cached_property
    def extents(self) -> tuple[Points, FloatArray]:
        """Middles (p, 3) of all patches, and how far (p,) from these their corners are, metres."""
        corners = self.surfaces.corners
        middle = corners.mean(axis=1)
        return middle, np.sqrt(np.max(((corners - middle[:, None]) ** 2).sum(axis=2), axis=1))

    @cached_property
    def lift(self) -> FloatArray:
        """(p,) how far rays leave all patches."""
        return ray_lifts(self.surfaces.corners, self.surfaces.normal, self.surfaces.size)

    def link(
        self, tree: ElementTree, p: IntArray, q: IntArray, light: Light, keep_dark: bool = False
    ) -> LinkBatch:
        """Links between elements p, q (n,) of which no blockers are known.

        Pairs that cannot exchange light are left out, unless `keep_dark`.
        """
        s, h = self.surfaces, self.hierarchy
        n = len(p)
        kind, kept = np.empty(n, dtype=np.int32), np.zeros(n, dtype=np.int32)
        lists: dict[int, list[IntArray]] = {}

        def work(start: int, stop: int) -> None:
            pieces: list[IntArray] = []
            at, room = start, 64 * (stop - start) + len(h.order)
            while at < stop:
                pool = np.empty(room, dtype=np.int32)
                used = first_blockers(
                    p, q, tree.corners, tree.corner_count, tree.patch, s.corners, s.corner_count, s.normal,
                    h.low, h.high, h.skip, h.first, h.count, h.order, self.side_tolerance, at, stop, kind,
                    kept, pool,
                )  # fmt: skip
                done = stop - at if used >= 0 else -1 - used
                length = int(kept[at : at + done].sum())
                pieces.append(pool[:length].copy())
                at += done
            lists[start] = pieces

        run_chunks(work, n, _CHUNK, _LEAST)
        pool = np.concatenate([piece for start in sorted(lists) for piece in lists[start]] or [kept[:0]])
        return self._evaluate(tree, p, q, kind, kept, pool, np.ones(n, dtype=np.int32), light, keep_dark)

    def renew(
        self,
        tree: ElementTree,
        links: LinkTable,
        rows: IntArray,
        recent: BoolArray,
        near: Hierarchy,
        light: Light,
        faint: BoolArray,
    ) -> Renewed:
        """Links of `rows` (n,) as they are now that patches have come and gone.

        recent (p,): patches that came, which are in the hierarchy `near`. Those that went are -1 among the
        blockers, or are there again, elsewhere. Rows that are `faint` (n,) see what they saw, as far as
        anybody cares, if they saw a part and see one.
        """
        s, h = self.surfaces, near
        p, q = links.p[rows], links.q[rows]
        before, listed, first = links.kind[rows], links.blocker_count[rows], links.blocker_start[rows]
        n = len(rows)
        kind, kept = np.empty(n, dtype=np.int32), np.zeros(n, dtype=np.int32)
        most = listed.astype(np.int64) + len(h.order)
        room = np.cumsum(most) - most
        loose = np.empty(int(most.sum()), dtype=np.int32)

        def work(start: int, stop: int) -> None:
            renewed_blockers(
                p, q, before, tree.corners, tree.corner_count, tree.patch, s.corners, s.corner_count,
                s.normal, h.low, h.high, h.skip, h.first, h.count, h.order, self.side_tolerance, first,
                listed, links.pool, recent, start, stop, room, kind, kept, loose,
            )  # fmt: skip

        run_chunks(work, n, _CHUNK, _LEAST)
        samples = links.samples[rows]
        sampled = (kind == PARTIAL) & (before == PARTIAL) & (samples > 0)
        stays = sampled & faint
        left = np.flatnonzero(stays)
        known = np.flatnonzero((kind <= NONE) & ~stays)
        pool = take_ranges(loose, room[known], kept[known])
        # By the rays that they had, so that only what has changed makes a difference, unless these are many.
        least = np.where(sampled, np.minimum(samples, _AGAIN), 1)[known].astype(np.int32)
        batch = self._evaluate(tree, p[known], q[known], kind[known], kept[known], pool, least, light, True)
        same = sampled[known] & (batch.samples == samples[known])
        same &= batch.visibility == links.visibility[rows[known]]
        batches = [batch.chosen(np.flatnonzero(~same))]
        unknown = np.flatnonzero(kind == UNKNOWN)
        if len(unknown):
            batches.append(self.link(tree, p[unknown], q[unknown], light, keep_dark=True))
        stays[known[same]] = True
        alike = np.flatnonzero(stays)
        return Renewed(
            changed=rows[np.concatenate([known[~same], unknown])],
            batch=LinkBatch.joined(batches),
            relisted=rows[alike],
            blocker_count=kept[alike],
            blockers=take_ranges(loose, room[alike], kept[alike]),
            left=left,
        )

    def link_children(
        self,
        tree: ElementTree,
        p: IntArray,
        q: IntArray,
        parent_start: Int64Array,
        parent_count: IntArray,
        parent_pool: IntArray,
        least_samples: IntArray,
        light: Light,
        keep_dark: bool = False,
    ) -> LinkBatch:
        """Links between elements that have no other blockers than those given, as of their parents' link."""
        n = len(p)
        kind, kept = np.empty(n, dtype=np.int32), np.zeros(n, dtype=np.int32)
        room = np.cumsum(parent_count, dtype=np.int64) - parent_count
        loose = np.empty(int(parent_count.sum()), dtype=np.int32)
        s = self.surfaces

        def work(start: int, stop: int) -> None:
            inherit_blockers(
                p, q, tree.corners, tree.corner_count, tree.patch, s.corners, s.corner_count, s.normal,
                parent_start, parent_count, parent_pool, self.side_tolerance, start, stop, room, loose, kind,
                kept,
            )  # fmt: skip

        run_chunks(work, n, _CHUNK, _LEAST)
        return self._evaluate(
            tree, p, q, kind, kept, take_ranges(loose, room, kept), least_samples, light, keep_dark
        )

    def _evaluate(
        self,
        tree: ElementTree,
        p: IntArray,
        q: IntArray,
        kind: IntArray,
        kept: IntArray,
        pool: IntArray,
        least_samples: IntArray,
        light: Light,
        keep_dark: bool = False,
    ) -> LinkBatch:
        n = len(p)
        open_exchange = np.zeros(n)
        position, residual = np.zeros((2, n, 2)), np.zeros((2, n))

        def work(start: int, stop: int) -> None:
            find_exchange(
                p, q, kind, tree.corners, tree.corner_count, tree.area, tree.patch, tree.centroid,
                tree.moment, self.surfaces.normal, tree.axes, self.side_tolerance, self.exchange_tolerance,
                start, stop, open_exchange, position[0], position[1], residual[0], residual[1],
            )  # fmt: skip

        run_chunks(work, n, _CHUNK, _LEAST)
        visibility = np.where(kind == NONE, 0.0, 1.0)
        samples, noise = np.zeros(n, dtype=np.int32), np.zeros(n)
        tested = kind == PARTIAL
        if Saving.SHADOW_TESTS in self.in_full:
            tested[:] = True
        partial = np.flatnonzero(tested & (open_exchange > 0.0))
        needed = np.empty(len(partial), dtype=np.int32)
        samples_needed(
            p[partial], q[partial], open_exchange[partial], tree.area, light.reflectance, light.radiosity,
            light.noise_limit, needed,
        )  # fmt: skip
        if Saving.RAYS in self.in_full:
            needed[:] = MAX_SAMPLES
        samples[partial] = np.maximum(needed, least_samples[partial])
        for count in np.unique(samples[partial]):
            part = partial[samples[partial] == count]
            found = visible_fractions(
                self.rays, p[part], q[part], tree.corners, tree.corner_count, tree.area, tree.patch,
                self.surfaces.normal, tree.axes, self.lift, tree.centroid, tree.moment, tree.key, int(count),
            )  # fmt: skip
            seen = found.visibility
            visibility[part] = seen
            noise[part] = found.noise
            for end, element, lean, spread in (
                (0, p, found.lean_p, found.residual_p),
                (1, q, found.lean_q, found.residual_q),
            ):
                position[end, part] = seen[:, None] * position[end, part] + lean
                mean = open_exchange[part] / tree.area[element[part]]
                varied = residual[end, part] ** 2
                residual[end, part] = np.sqrt(seen**2 * varied + (mean**2 + varied) * spread)
        slope = np.empty((2, n, 2))
        for end, element in enumerate((p, q)):
            find_slopes(tree.moment, element, open_exchange, position[end], slope[end])
        alive = (open_exchange > 0.0) | (kind == NONE) | keep_dark
        ends = np.cumsum(kept, dtype=np.int64)
        return LinkBatch(
            p=p[alive],
            q=q[alive],
            open_exchange=open_exchange[alive],
            visibility=visibility[alive],
            samples=samples[alive],
            noise=noise[alive],
            kind=kind[alive],
            slope_p=slope[0, alive],
            slope_q=slope[1, alive],
            residual_p=residual[0, alive],
            residual_q=residual[1, alive],
            blocker_count=kept[alive],
            blockers=take_ranges(pool, (ends - kept)[alive], kept[alive]),
        )

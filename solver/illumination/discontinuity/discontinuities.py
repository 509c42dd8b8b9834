"""Discontinuities of irradiance: lines on receivers, and how much each matters ([H] chapter 5, 8.2).

They are found once, on whole patches. A leaf of whatever subdivision is tested against them by geometry
(`leaf_crossings`), so that nothing has to be handed down when elements are split ([H 5.5.6]'s inheritance).

Two weights. Hardt's [H 5.3] is max(d_sb / d_br) B. The other one follows [H 8.2]: it bounds the irradiance,
in W/m2, by which a quadratic interpolant over a cell is wrong if the line is left out of the mesh. Across a
cell of size h, with nodes at its ends and in the middle, a jump of height E is missed by at most E, one of
s in the first derivative by KINK s h, one of c in the second by BEND c h^2, wherever in the cell it lies.
At every line all three hold, and the least of them is the bound: E is the source's radiosity B times its
form factor F, s = E / width, c = B bend. `shadow_strength` derives width and bend of VE and EV lines,
`horizon_segments` and `graze_segments` those of theirs. F is the source's without any blockers, and as if
the blocker could hide all of it. The bounds at both ends and in the middle are averaged as squares by
Simpson's rule: where a line runs into a contact its penumbra vanishes, and only E limits the error there.

What geometry decides is kept with the discontinuity; only B and h change from one iteration to the next
([H 5.4]'s caching).
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Final

import numpy as np

from solver import tolerances
from solver.geometry.surfaces import Surfaces
from solver.illumination.discontinuity.contact_segments import find_contacts
from solver.illumination.discontinuity.discontinuity_pairs import facing_pairs, find_blockers
from solver.illumination.discontinuity.graze_segments import find_grazes
from solver.illumination.discontinuity.horizon_segments import find_horizons
from solver.illumination.discontinuity.outlines import Outlines, find_outlines
from solver.illumination.discontinuity.segments import (
    CONTACT,
    EV,
    FIELDS,
    GRAZE,
    HORIZON,
    ID_FIELDS,
    SAMPLES,
    VE,
    Polygons,
    polygons_of,
)
from solver.illumination.discontinuity.shadow_segments import cast_shadows
from solver.parallel import run_chunks
from solver.types import BoolArray, FloatArray, IntArray
from solver.visibility.bvh import Hierarchy

KINK: Final = 0.0963
"""Greatest error of quadratic interpolation of max(0, x - c) over a cell of size 1, for any c: it is
1 / (6 sqrt 3), rounded up."""

BEND: Final = 0.0189
"""The same for max(0, x - c)^2 / 2."""

_SIMPSON: Final = np.array([1.0, 4.0, 1.0]) / 6.0

_CHUNK: Final = 16
_LEAST: Final = 1
_ROOM: Final = 4096

KINDS: Final = {VE: "VE", EV: "EV", HORIZON: "horizon", CONTACT: "contact", GRAZE: "graze"}
"""Names of the kinds."""


@dataclass(frozen=True, eq=False)
class Discontinuities:
    """d discontinuities; those of a receiver are not necessarily together."""

    receiver: IntArray
    """(d,) patch"""
    source: IntArray
    """(d,) patch, -1 for a contact"""
    blocker: IntArray
    """(d,) a patch that the edge or vertex belongs to, or that touches; -1 for a horizon"""
    kind: IntArray
    """(d,) VE, EV, HORIZON or CONTACT"""
    ends: FloatArray
    """(d, 2, 3) metres, on the receiver's plane and inside of it, at least SHORTEST of its size apart"""
    ratio: FloatArray
    """(d,) the greater d_sb / d_br of both ends; 1 for a horizon, infinite for a contact"""
    form_factor: FloatArray
    """(d, 3) of the source without blockers, at first end, middle and last end; 0 for a contact"""
    width: FloatArray
    """(d, 3) m over which irradiance would change by all of it if it did so evenly; 0 for a contact"""
    bend: FloatArray
    """(d, 3) jump of the form factor's second derivative across the line, 1/m2; infinite if of the first"""

    def __len__(self) -> int:
        return len(self.receiver)

    @property
    def jump(self) -> BoolArray:
        """(d,) whether irradiance itself may jump (contacts), or only a derivative."""
        return np.asarray(self.kind == CONTACT)

    def take(self, chosen: IntArray | BoolArray) -> Discontinuities:
        """Those `chosen` by index or mask."""
        return Discontinuities(**{f.name: getattr(self, f.name)[chosen] for f in fields(self)})

    @staticmethod
    def joined(parts: list[Discontinuities]) -> Discontinuities:
        """All of `parts`, one after the other. `parts` may not be empty."""
        return Discontinuities(
            **{f.name: np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(parts[0])}
        )

    def counts(self) -> dict[str, int]:
        """How many there are of each kind, by its name."""
        return {name: int(np.count_nonzero(self.kind == kind)) for kind, name in KINDS.items()}

    def hardt_weights(self, radiosity: FloatArray) -> FloatArray:
        """(d,) max(d_sb / d_br) B; radiosity (p,) is the patches' luminance, W/m2. [H 5.3]"""
        weight = np.full(len(self), np.inf)
        lit = ~self.jump
        weight[lit] = self.ratio[lit] * radiosity[self.source[lit]]
        return weight

    def weights(self, radiosity: FloatArray, cell_size: FloatArray) -> FloatArray:
        """(d,) W/m2 of luminance that a quadratic interpolant may be wrong by without the line. [H 8.2]

        radiosity (p,) is the patches' luminance, W/m2; cell_size (d,) that of the largest cell across the
        line, m, as told by `LeafCrossings.size`. Infinite for contacts.
        """
        weight = np.full(len(self), np.inf)
        lit = ~self.jump
        factor, h = self.form_factor[lit], cell_size[lit, None]
        kink = np.divide(KINK * factor * h, self.width[lit], out=np.full(factor.shape, np.inf),
                         where=self.width[lit] > 0.0)  # fmt: skip
        bend = np.multiply(BEND * h**2, self.bend[lit], out=np.full(factor.shape, np.inf),
                           where=np.isfinite(self.bend[lit]))  # fmt: skip
        error = np.minimum(np.minimum(factor, kink), bend)
        weight[lit] = radiosity[self.source[lit]] * np.sqrt(error**2 @ _SIMPSON)
        return weight


def find_discontinuities(
    surfaces: Surfaces,
    hierarchy: Hierarchy,
    sources: IntArray,
    receivers: IntArray | None = None,
    *,
    outlines: Outlines | None = None,
    keep_hidden: bool = False,
) -> Discontinuities:
    """All discontinuities on patches `receivers` (m,), all if None: contacts, and what `sources` (k,) cause.

    `hierarchy` holds the patches of side 0, `outlines` are those of `surfaces`, found if not given.
    `keep_hidden` keeps the parts of VE and EV lines that the source's vertex or edge cannot be seen from.
    """
    scene = _Scene.of(surfaces, hierarchy, outlines)
    where = _all_if_none(surfaces, receivers)
    return Discontinuities.joined([_contacts(scene, where), _cast(scene, sources, where, keep_hidden)])


def find_shadow_lines(
    surfaces: Surfaces,
    hierarchy: Hierarchy,
    sources: IntArray,
    receivers: IntArray | None = None,
    *,
    outlines: Outlines | None = None,
    keep_hidden: bool = False,
) -> Discontinuities:
    """As `find_discontinuities`, less the contacts: what more sources add to what is known."""
    scene = _Scene.of(surfaces, hierarchy, outlines)
    return _cast(scene, sources, _all_if_none(surfaces, receivers), keep_hidden)


@dataclass(frozen=True, eq=False)
class _Scene:
    surfaces: Surfaces
    hierarchy: Hierarchy
    outlines: Outlines
    polygons: Polygons
    tolerance: float

    @staticmethod
    def of(surfaces: Surfaces, hierarchy: Hierarchy, outlines: Outlines | None) -> _Scene:
        return _Scene(
            surfaces,
            hierarchy,
            find_outlines(surfaces) if outlines is None else outlines,
            polygons_of(surfaces),
            tolerances.SIDE * surfaces.size,
        )


def _all_if_none(surfaces: Surfaces, receivers: IntArray | None) -> IntArray:
    if receivers is None:
        return np.arange(surfaces.patch_count, dtype=np.int32)
    return np.asarray(receivers, dtype=np.int32)


class _Table:
    """Rows that kernels fill; full ones are put aside."""

    def __init__(self) -> None:
        self.full: list[tuple[FloatArray, IntArray]] = []
        self.make(_ROOM)

    def make(self, room: int) -> None:
        self.rows = np.empty((room, FIELDS))
        self.ids = np.empty((room, ID_FIELDS), dtype=np.int32)

    def put_aside(self, used: int) -> None:
        """Keep the first `used` rows and make room for more, twice as much if that was none."""
        self.full.append((self.rows[:used].copy(), self.ids[:used].copy()))
        self.make(len(self.rows) if used > 0 else 2 * len(self.rows))


def _contacts(scene: _Scene, receivers: IntArray) -> Discontinuities:
    h = scene.hierarchy
    tables: dict[int, _Table] = {}

    def work(start: int, stop: int) -> None:
        table = tables[start] = _Table()
        chunk, begin = receivers[start:stop], 0
        while begin < stop - start:
            used, begin = find_contacts(
                scene.polygons, scene.outlines, h.low, h.high, h.skip, h.first, h.count, h.order, chunk,
                scene.tolerance, begin, table.rows, table.ids,
            )  # fmt: skip
            table.put_aside(used)

    run_chunks(work, len(receivers), _CHUNK, _LEAST)
    return _collected(tables)


def _cast(scene: _Scene, sources: IntArray, receivers: IntArray, keep_hidden: bool) -> Discontinuities:
    to, by = facing_pairs(scene.surfaces, receivers, np.asarray(sources, dtype=np.int32), scene.tolerance)
    tables: dict[int, _Table] = {}

    def work(start: int, stop: int) -> None:
        r, s = to[start:stop], by[start:stop]
        blocked = find_blockers(scene.surfaces, scene.hierarchy, r, s, scene.tolerance)
        count = np.where(blocked.count > 0, blocked.count, 0).astype(np.int32)
        table = tables[start] = _Table()
        if stop - start > len(table.rows):
            table.make(stop - start)
        table.put_aside(
            find_horizons(scene.polygons, r, s, blocked.visibility, scene.tolerance, table.rows, table.ids)
        )
        if len(blocked.pool) > len(table.rows):
            table.make(len(blocked.pool))
        table.put_aside(
            find_grazes(
                scene.polygons, scene.outlines, r, s, count, blocked.pool, scene.tolerance, table.rows,
                table.ids,
            )
        )  # fmt: skip
        begin, first = 0, 0
        while begin < stop - start:
            used, begin, first = cast_shadows(
                scene.polygons, scene.outlines, r, s, count, blocked.pool, scene.tolerance, keep_hidden,
                begin, first, table.rows, table.ids,
            )  # fmt: skip
            table.put_aside(used)

    run_chunks(work, len(to), _CHUNK, _LEAST)
    return _collected(tables)


def _collected(tables: dict[int, _Table]) -> Discontinuities:
    pieces = [piece for start in sorted(tables) for piece in tables[start].full]
    rows = np.concatenate([rows for rows, _ in pieces] or [np.empty((0, FIELDS))])
    ids = np.concatenate([ids for _, ids in pieces] or [np.empty((0, ID_FIELDS), dtype=np.int32)])
    samples = rows[:, 7:].reshape(-1, 3, SAMPLES)
    return Discontinuities(
        receiver=ids[:, 0].copy(),
        source=ids[:, 1].copy(),
        blocker=ids[:, 2].copy(),
        kind=ids[:, 3].copy(),
        ends=rows[:, :6].reshape(-1, 2, 3).copy(),
        ratio=rows[:, 6].copy(),
        form_factor=samples[:, 0].copy(),
        width=samples[:, 1].copy(),
        bend=samples[:, 2].copy(),
    )

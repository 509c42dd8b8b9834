"""A solution taken over into the next revision of its scene ([G eq. 3 to 5]).

Elements and links of what an edit leaves alone stay as they are, with the radiosity that they have. What goes
takes the light with it that it had sent: its links shoot their energy once more, as negative energy.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from solver.arrays import GrowingArray
from solver.geometry.surfaces import Surfaces
from solver.redistribution.matching import Match
from solver.transport.closure import of_patches
from solver.transport.elements import ElementTree
from solver.transport.links import LinkTable
from solver.transport.pushpull import gather, means, pull
from solver.transport.state import TransportState, ambient, shine_of
from solver.types import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Carried:
    """A solution in the next revision."""

    state: TransportState
    source: IntArray
    """(n,) the element that each one was before, -1 for none"""
    dimmed: FloatArray
    """(n,) luminance irradiance, W/m2, that links of the element have lost with patches that are gone"""
    moments: FloatArray | None = None
    """(n, 3, channels) of what all elements send, where that is known"""


def carry(
    state: TransportState,
    surfaces: Surfaces,
    match: Match,
    edit: int,
    moments: FloatArray | None = None,
    in_place: bool = False,
) -> Carried:
    """What `state` is in the scene of `surfaces`; its link table is handed over, not copied.

    Links that were blocked by patches that are gone are in debt, or come into it by that to `edit`; those of
    such patches are removed. Irradiance is right but for links that the edit has changed, and for fresh
    patches, whose irradiance is a guess: what they received where they were before, or the ambient term.

    `moments` (n, 3, channels) are those of `state`, where they are known. Where all that has happened is that
    undivided patches have moved, as in the midst of a drag, all can stay where it is, and does if `in_place`.
    """
    if in_place and _can_stay(state, surfaces, match):
        return _carry_in_place(state, surfaces, match, moments)
    tree, number = ElementTree.carried(surfaces, state.tree, match.number)
    links = state.links
    removed = links.rows_of(number < 0)
    lost = sent_over(state, removed, moments)
    if not match.only_moves:
        links.forget(match.number, edit)
    links.remove(removed)
    links.renumber(number, match.number)

    weights, emission, reflectance = shine_of(surfaces)
    channels = len(weights)
    # The earlier element that each one was; fresh ones take any, for now.
    source = np.zeros(len(tree), dtype=np.int32)
    kept = np.flatnonzero(number >= 0)
    source[number[kept]] = kept
    fresh = match.fresh
    after = TransportState(
        surfaces=surfaces,
        tree=tree,
        links=links,
        weights=weights,
        emission=emission,
        reflectance=reflectance,
        radiosity=_in_channels(state, state.radiosity.take(source, axis=0), channels),
        received=_in_channels(state, state.received.take(source, axis=0), channels),
        closure=state.closure.take(source),
        remainder=state.remainder.take(source, axis=0),
        gathers=state.gathers,
    )
    after.closure[fresh] = 1.0
    for functions in (after.radiosity, after.received, after.remainder):
        functions[fresh] = 0.0
    dimmed = np.zeros(len(tree))
    if len(removed):
        lost = _in_channels(state, lost.take(source, axis=0), channels)
        lost[fresh] = 0.0
        dimmed = np.abs(lost[:, 0] @ after.weights)
        after.add_received(lost, -1.0)
    _repaint(state, after, match)
    known = match.likeness[fresh] >= 0
    after.received[fresh, 0] = ambient(surfaces.area, emission, reflectance)
    if known.any():
        before = _in_channels(state, means(state.tree, state.received), channels)
        after.received[fresh[known], 0] = before[match.likeness[fresh[known]]]
        # What has moved sees about as much too much of itself as before.
        after.closure[fresh[known]] = of_patches(state.tree, state.closure)[match.likeness[fresh[known]]]
    after.radiosity[fresh, 0] = after.emission[fresh] + after.reflectance[fresh] * after.received[fresh, 0]
    source[fresh] = -1
    return Carried(after, source, dimmed)


def _can_stay(state: TransportState, surfaces: Surfaces, match: Match) -> bool:
    """Whether patches have moved that are leaves, and nothing else has happened."""
    now, before = surfaces, state.surfaces
    return (
        match.only_moves
        and not (state.tree.child[match.gone] >= 0).any()
        and np.array_equal(now.emission, before.emission)
        and np.array_equal(now.reflectance, before.reflectance)
    )


def _carry_in_place(
    state: TransportState, surfaces: Surfaces, match: Match, moments: FloatArray | None
) -> Carried:
    """As `carry`, where patches that are leaves have moved: they have the means that they had."""
    tree, fresh = state.tree, match.fresh
    moved = np.zeros(len(tree), dtype=np.bool_)
    moved[fresh] = True
    removed = state.links.rows_of(moved)
    guess = state.received[fresh, 0]
    dimmed = np.zeros(len(tree))
    if len(removed):
        lost = sent_over(state, removed, moments)
        lost[fresh] = 0.0
        dimmed = np.abs(lost[:, 0] @ state.weights)
        state.add_received(lost, -1.0)
    state.links.remove(removed)
    tree.move(surfaces, fresh)
    for functions in (state.radiosity, state.received, state.remainder):
        functions[fresh] = 0.0
    state.received[fresh, 0] = guess
    state.radiosity[fresh, 0] = state.emission[fresh] + state.reflectance[fresh] * guess
    if moments is not None:
        moments[fresh] = state.radiosity[fresh] * state.closure[fresh, None, None]
    source = np.arange(len(tree), dtype=np.int32)
    source[fresh] = -1
    return Carried(replace(state, surfaces=surfaces), source, dimmed, moments)


class Shots(NamedTuple):
    """What k links do to the light at their ends, both ways."""

    p: IntArray
    q: IntArray
    exchange: FloatArray
    """(k,) m2, visibility included"""
    slope_p: FloatArray
    slope_q: FloatArray

    @staticmethod
    def of(links: LinkTable, rows: IntArray) -> Shots:
        """What links `rows` (k,) do."""
        exchange = links.open_exchange[rows] * links.visibility[rows]
        return Shots(links.p[rows], links.q[rows], exchange, links.slope_p[rows], links.slope_q[rows])

    def taken_back(self) -> Shots:
        """The same with negative energy."""
        return self._replace(exchange=-self.exchange, slope_p=-self.slope_p, slope_q=-self.slope_q)

    def shoot(self, area: FloatArray, moments: FloatArray, arrived: FloatArray) -> None:
        """Add to the irradiance functions `arrived` (n, 3, channels) what `moments` (n, 3, channels) send."""
        gather(*self, area, moments, 0, len(self.p), arrived)


def sent_over(state: TransportState, rows: IntArray, moments: FloatArray | None = None) -> FloatArray:
    """Irradiance functions (n, 3, channels) that the links `rows` bring to their own ends.

    `moments` (n, 3, channels) of what elements send are found where they are not known.
    """
    arrived = np.zeros_like(state.received)
    if len(rows):
        known = moments_of(state) if moments is None else moments
        Shots.of(state.links, rows).shoot(state.tree.area, known, arrived)
    return arrived


def moments_of(state: TransportState) -> FloatArray:
    """Means and first moments (n, 3, channels) of what all elements send."""
    tree, moments = state.tree, np.empty_like(state.radiosity)
    pull(
        tree.child, tree.child_count, tree.area, tree.moment, tree.offset, state.radiosity, moments,
        state.closure,
    )  # fmt: skip
    return moments


def add_moments(state: TransportState, moments: GrowingArray[np.float64]) -> None:
    """Add to `moments` (m, 3, channels), those of the first elements, those of the rest, which are leaves."""
    tree, first = state.tree, len(moments)
    count = len(tree) - first
    fresh = moments.grow(count)
    leaves, none = np.full(count, -1, dtype=np.int32), np.zeros(count, dtype=np.int32)
    pull(
        leaves, none, tree.area[first:], tree.moment[first:], tree.offset[first:], state.radiosity[first:],
        fresh, state.closure[first:],
    )  # fmt: skip


def _repaint(before: TransportState, after: TransportState, match: Match) -> None:
    """Let patches of another material than before shine by it, in the light that they have."""
    stays = np.flatnonzero(match.number >= 0)
    now = match.number[stays]
    old, new = before.surfaces, after.surfaces
    changed = np.zeros(new.patch_count, dtype=np.bool_)
    changed[now] = np.any(old.emission[stays] != new.emission[now], axis=1)
    changed[now] |= np.any(old.reflectance[stays] != new.reflectance[now], axis=1)
    if changed.any():
        rows = np.flatnonzero(changed[after.tree.patch])
        after.radiosity[rows] = after.answering()[rows]


def _in_channels(state: TransportState, values: FloatArray, channels: int) -> FloatArray:
    """Values (..., channels of `state`) in as many channels as there are now."""
    if values.shape[-1] == channels:
        return values
    if channels == 1:
        return np.asarray(values @ state.weights)[..., None]
    return np.repeat(values, channels, axis=-1)

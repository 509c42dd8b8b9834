"""What to look at first: all debts by what they can add to the squared error ([G "Patch importance"])."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.parallel import run_chunks
from solver.redistribution.debts import UnlinkedPairs
from solver.redistribution.energy import doubt_of, rank_links
from solver.transport.linking import Light
from solver.transport.pushpull import means
from solver.transport.refine import NOISE_SHARE
from solver.transport.state import TransportState
from solver.types import FloatArray, IntArray

_FAINT: Final = 0.1
"""Share of the squared error that is refined, which may be left to a link of which nobody finds out what it
sees now"""

_RANKED: Final = 1 << 14
"""Debts of a piece of work"""


@dataclass(frozen=True, eq=False)
class Plan:
    """What is to be looked at, the most important first; n debts."""

    rows: IntArray
    """(n,) the link, or -1: the next pair without one"""
    debt: IntArray
    """(n,) number of the edit"""
    energy: FloatArray
    """(n,) at stake, W of luminance"""
    doubt_of_each: FloatArray
    """(n,) squared error of the visible fraction that a link is left to, 0 where it is traced"""
    left: FloatArray
    """(n + 1,) sum of this and all later energies"""
    doubt: float
    """RMS of the radiosity that is at stake, relative to what is reflected"""
    light: Light


def make_plan(
    state: TransportState,
    pairs: UnlinkedPairs,
    number: int,
    boxes: FloatArray,
    fresh: IntArray,
    norm: float,
    idle: float,
    bound: float,
) -> tuple[Plan, UnlinkedPairs]:
    """A plan for all links of `state` in debt and all `pairs`; and these in the order of the plan.

    The edit `number` has changed something within `boxes` (k, 2, 3), metres; patches `fresh` (f,) came with
    it. norm: squared luminance that is reflected, times area. No more of that than `idle` in sum, and than a
    part of `bound` each, may be left to links that are not traced.
    """
    links, tree, surfaces = state.links, state.tree, state.surfaces
    rows = np.flatnonzero(links.debt).astype(np.int32)
    radiosity = np.maximum(means(tree, state.radiosity) @ state.weights, 0.0)
    reflectance = (state.reflectance @ state.weights)[tree.patch]
    p, q = np.concatenate([links.p[rows], pairs.p]), np.concatenate([links.q[rows], pairs.q])
    energy, share, urgency = np.empty((3, len(p)))
    # What hides links that are in debt to earlier edits is not known any more.
    known, exchange = np.abs(links.debt[rows]) == number, links.open_exchange[rows]
    run_chunks(
        lambda start, stop: rank_links(
            p, q, exchange, tree.area, tree.centroid, tree.patch, surfaces.normal, radiosity, reflectance,
            boxes, known, energy, share, urgency, start, stop,
        ),
        len(p),
        _RANKED,
    )  # fmt: skip
    # What an emitter sends out that came with the edit is what everybody looks at.
    first = np.zeros(surfaces.patch_count, dtype=np.bool_)
    first[fresh] = state.emission[fresh].any(axis=1)
    rank = urgency
    if first.any():
        lit = first[tree.patch[p]] | first[tree.patch[q]]
        rank = urgency + np.where(lit, 1.0 + urgency.max(initial=0.0), 0.0)
    order = np.argsort(-rank)
    urgency, energy = urgency[order], energy[order]
    faint = (_sums_from(urgency)[:-1] < idle) & (urgency < _FAINT * bound)
    paired = order[order >= len(rows)] - len(rows)
    plan = Plan(
        doubt=doubt_of(p[order], q[order], energy, tree.area) / math.sqrt(max(norm, 1e-300)),
        rows=np.concatenate([rows, np.full(len(pairs), -1, dtype=np.int32)])[order],
        debt=np.concatenate([links.debt[rows], pairs.debt])[order],
        energy=energy,
        doubt_of_each=np.where(faint, share[order] ** 2, 0.0),
        left=_sums_from(energy),
        light=Light(radiosity, reflectance, NOISE_SHARE * bound),
    )
    return plan, UnlinkedPairs(pairs.p[paired], pairs.q[paired], pairs.debt[paired])


def _sums_from(values: FloatArray) -> FloatArray:
    """The sums (n + 1,) of each of `values` (n,) and all that follow."""
    sums = np.zeros(len(values) + 1)
    np.cumsum(values[::-1], out=sums[-2::-1])
    return sums

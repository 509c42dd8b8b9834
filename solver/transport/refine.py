"""Refinement: the worst links are split or sampled more densely ([H 4.4.1])."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.transport.estimate import ErrorEstimate
from solver.transport.field import SolveOutcome
from solver.transport.linking import Light, Linker
from solver.transport.oracle import RESAMPLE, SPLIT_P, best_remedies, child_pairs, threshold_for_share
from solver.transport.pace import Pace
from solver.transport.settings import SolverSettings
from solver.transport.state import TransportState
from solver.types import FloatArray, IntArray

NOISE_SHARE: Final = 4.0
"""Noise that fresh links may have, of the least error that is refined in the same round."""

DEFAULT_MINIMUM_AREA: Final = 1e-8
"""Smallest element by default, relative to the squared size of the scene."""


@dataclass(frozen=True, eq=False)
class Choice:
    """Links to refine, and how."""

    links: IntArray
    """(m,)"""
    action: IntArray
    """(m,)"""
    bound: float
    """the least squared error among them"""


def choose(
    state: TransportState, estimate: ErrorEstimate, settings: SolverSettings, resolve: float
) -> Choice | SolveOutcome:
    """The worst links, until `resolve` of the squared error is dealt with; or why nothing can be done."""
    worth, action, left_alone = _worths(state, estimate, settings)
    total = float(worth.sum())
    if total <= 1e-3 * resolve:
        return SolveOutcome.TRANSPORT_ERROR if left_alone > 1e-3 * resolve else SolveOutcome.MINIMUM_AREA
    bound = threshold_for_share(worth, min(resolve, 0.9 * total))
    chosen = np.flatnonzero(worth >= bound).astype(np.int32)
    return _within_limits(state, settings, chosen, action[chosen], bound)


def choose_above(
    state: TransportState, rows: IntArray, estimate: ErrorEstimate, settings: SolverSettings, bound: float
) -> Choice | SolveOutcome | None:
    """Those of the links `rows`, whose estimate it is, with a squared error above `bound`; None for none."""
    worth, action, _ = _worths(state, estimate, settings, rows)
    worst = np.flatnonzero(worth > bound)
    if len(worst) == 0:
        return None
    return _within_limits(state, settings, rows[worst], action[worst], bound)


def _worths(
    state: TransportState,
    estimate: ErrorEstimate,
    settings: SolverSettings,
    rows: IntArray | slice = slice(None),
) -> tuple[FloatArray, IntArray, float]:
    """What the best remedy of each link (n,) resolves, which it is, and the error that is left alone."""
    tree, links = state.tree, state.links
    minimum = settings.minimum_area
    if minimum is None:
        minimum = DEFAULT_MINIMUM_AREA * state.surfaces.size**2
    splittable = (tree.child >= 0) | (tree.area >= 4.0 * minimum)
    limit = -1.0 if settings.transport_error is None else settings.transport_error
    p, q, samples = links.p[rows], links.q[rows], links.samples[rows]
    worth, action = np.empty(len(p)), np.empty(len(p), dtype=np.int32)
    left_alone = best_remedies(
        p, q, samples, splittable, estimate.irradiance, limit, estimate.links, worth, action
    )
    return worth, action, left_alone


def _within_limits(
    state: TransportState, settings: SolverSettings, chosen: IntArray, action: IntArray, bound: float
) -> Choice | SolveOutcome:
    """The choice of links (m,) and of what to do with each, unless there would be too many then."""
    links, tree = state.links, state.tree
    if len(links) + 3 * len(chosen) > settings.max_links:
        return SolveOutcome.LINK_LIMIT
    split = np.where(action == SPLIT_P, links.p[chosen], links.q[chosen])
    ends = np.unique(split[action != RESAMPLE])
    if len(tree) + 4 * int((tree.child[ends] < 0).sum()) > settings.max_elements:
        return SolveOutcome.ELEMENT_LIMIT
    return Choice(chosen, action, bound)


def refine(
    state: TransportState, linker: Linker, pace: Pace, light: Light, choice: Choice
) -> Generator[int, None, IntArray]:
    """Replace the chosen links by better ones; yields the rays that each slice of it took, / 16.

    Returns the rows of the better ones.
    """
    tree, links = state.tree, state.links
    chosen, action = choice.links, choice.action
    p, q, samples = links.p[chosen], links.q[chosen], links.samples[chosen]
    split = np.where(action == SPLIT_P, p, q)
    ends = np.unique(split[action != RESAMPLE])
    before = len(tree)
    state.split(ends[tree.child[ends] < 0])
    parent = tree.parent[before:]
    light = Light(
        np.concatenate([light.radiosity, light.radiosity[parent]]),
        np.concatenate([light.reflectance, light.reflectance[parent]]),
        NOISE_SHARE * choice.bound,
    )
    rows = np.where(action == RESAMPLE, 1, tree.child_count[split]).astype(np.int64)
    slot = np.cumsum(rows) - rows
    total = int(rows.sum())
    new_p, new_q, origin = (np.empty(total, dtype=np.int32) for _ in range(3))
    child_pairs(p, q, action, tree.child, tree.child_count, slot, new_p, new_q, origin)
    least = np.where(action == RESAMPLE, 4 * samples, 1).astype(np.int32)
    start, count, pool = links.blocker_start[chosen], links.blocker_count[chosen], links.pool
    batches = []
    # A pair costs about as much as 8 rays and its blockers.
    for part in pace.batches((1 + 2 * least[origin] + count[origin] // 4).astype(np.int64)):
        source = origin[part]
        batch = linker.link_children(
            tree, new_p[part], new_q[part], start[source], count[source], pool, least[source], light
        )
        batches.append(batch)
        yield int(batch.samples.sum())
    before = len(links)
    for _ in links.replace(chosen, batches):
        yield 0
    filled = chosen[: sum(len(batch.p) for batch in batches)]
    return np.concatenate([filled, np.arange(before, len(links), dtype=np.int32)])

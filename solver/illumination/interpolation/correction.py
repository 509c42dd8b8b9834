"""What the links of a solution miss of the reflected light, found by exact gathers and put back.

Links carry linear functions; what varies faster at both ends of a link at once is lost, a little at every
bounce, and always to the same side: bright places see each other better than means do. One exact gather of
the reflected light at the middle of every leaf tells what the links missed there. With this defect as a
source of its own the light settles anew over the same links (defect correction): what remains of the error
is the links' error of the defect alone.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import replace
from typing import Final

import numpy as np

from solver.illumination.points.point_irradiance import PointIrradiance
from solver.transport.pace import Pace
from solver.transport.state import TransportState
from solver.types import FloatArray, IntArray, Points, Spectra

MOST_POINTS: Final = 4096
"""Of more leaves so many are asked, by area; the others have the mean share of their patch."""

_AGAIN: Final = 96
"""If all leaves are asked, so many are at several points: those whose middle is off by most light."""

_CORNERWARDS: Final = 1.0 / np.sqrt(3.0)
"""Points between the middle and the corners of a leaf, so far out that their mean is right for quadratics."""

_BOUNCES: Final = 8
"""Bounces of the defect that are followed: it is small, and each leaves a part of it."""


def corrected(state: TransportState, point: PointIrradiance) -> Generator[None, None, TransportState]:
    """`state` with the light of exact gathers; yields every few milliseconds, shares the tree and links.

    `point` is the point irradiance of `state`. A scene without reflected light is returned as it is.
    """
    tree = state.tree
    reflected = state.radiosity.copy()
    reflected[:, 0] -= state.emission[tree.patch]
    told = yield from state.gather_in_steps(reflected)
    told_mean = told[:, 0]
    if not np.any(told_mean @ state.weights > 0.0):
        return state
    defect = np.zeros_like(state.radiosity)
    defect[tree.leaves, 0] = yield from _defects(state, point, told_mean)
    reflectance = np.where(tree.child < 0, 1.0, 0.0)[:, None, None] * state.reflectance[tree.patch][:, None]
    gained = defect
    for _ in range(_BOUNCES):
        gained = defect + (yield from state.gather_in_steps(reflectance * gained))
        yield
    leaf = (tree.child < 0)[:, None, None]
    gained = np.where(leaf, gained, 0.0)
    return replace(state, radiosity=state.radiosity + reflectance * gained, received=state.received + gained)


def _defects(state: TransportState, point: PointIrradiance, told: Spectra) -> Generator[None, None, Spectra]:
    """(leaves, channels) exact less `told` irradiance (n, channels) of reflected light."""
    tree, leaves = state.tree, state.tree.leaves
    asked = _spread_by_area(tree.area[leaves])
    chosen = leaves[asked]
    point = point.of_reflected()
    found = (yield from _gather(point, tree.centroid[chosen][:, None], chosen)) - told[chosen]
    if len(asked) == len(leaves):
        # Where the middle is off, it may not be what the leaf is off by.
        weight = tree.area[chosen] * np.abs(found @ state.weights)
        again = np.argsort(-weight, kind="stable")[:_AGAIN]
        worst = chosen[again]
        middle = tree.centroid[worst][:, None]
        # A triangle's last corner counts twice, which shifts the mean by little.
        places = middle + _CORNERWARDS * (tree.corners[worst] - middle)
        found[again] = (yield from _gather(point, places, worst)) - told[worst]
        return np.asarray(found)
    patch, area = tree.patch, tree.area
    share = _ratio(
        _by_patch(tree.patch_count, patch[chosen], area[chosen], found),
        _by_patch(tree.patch_count, patch[chosen], area[chosen], told[chosen]),
    )
    return np.asarray(share[patch[leaves]] * told[leaves])


def _gather(point: PointIrradiance, places: Points, leaves: IntArray) -> Generator[None, None, Spectra]:
    """Mean irradiance (l, channels) over places (l, k, 3) on leaves (l,)."""
    each = places.shape[1]
    positions, owner = np.ascontiguousarray(places.reshape(-1, 3)), np.repeat(leaves, each)
    exact = np.empty((len(owner), point.emission.shape[1]))
    for part in Pace().batches(np.ones(len(owner), dtype=np.int64)):
        exact[part] = point.at(positions[part], owner[part])
        yield
    return np.asarray(exact.reshape(-1, each, exact.shape[1]).mean(axis=1))


def _spread_by_area(area: FloatArray) -> IntArray:
    """Indices of at most MOST_POINTS leaves, each with a chance in proportion to its area."""
    if len(area) <= MOST_POINTS:
        return np.arange(len(area), dtype=np.int32)
    ends = np.cumsum(area)
    marks = (np.arange(MOST_POINTS) + 0.5) / MOST_POINTS * ends[-1]
    return np.unique(np.minimum(np.searchsorted(ends, marks), len(area) - 1)).astype(np.int32)


def _by_patch(count: int, patch: IntArray, area: FloatArray, values: Spectra) -> Spectra:
    return np.stack([np.bincount(patch, area * column, count) for column in values.T], axis=1)


def _ratio(above: Spectra, below: Spectra) -> Spectra:
    return np.asarray(np.where(below > 0.0, above / np.where(below > 0.0, below, 1.0), 0.0))

"""Light that is sent where it cannot arrive: form factors that sum to more than 1, and what they tell.

Where a surface lies close over another, what it lights is hidden from all else by itself. Links from elements
that are larger than it know how much of them is hidden, on average, but not that this is where they shine:
the product of the means is not the mean of the products, and what stands between may be hit by no ray of a
few. Conservation tells: under the surface, form factors sum to 1 over its links alone, so that whatever else
is seen from there is seen in error. What the residuals and the noise of links tell already is taken off, by
squares, and the rest is laid to the links that something stands between, in proportion to what they bring.

On average over an element no more can be seen in error than is known to be hidden: what rays do not see, such
as gaps that are smaller than their offset, is not resolved by subdivision.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from solver.kernels import kernel
from solver.transport.elements import ElementTree
from solver.transport.links import LinkTable
from solver.transport.sums import add_up
from solver.types import FloatArray, IntArray
from solver.visibility.shafts import PARTIAL

_TOLD: Final = 2.0
"""Times as much as the squared error that links tell of themselves is theirs, not an excess"""

_SCATTERED: Final = 0.05
"""By so much sums of single leaves scatter about 1: gradients of visibility are told by few rays, too, which
makes some leaves see more and others less. What is less than this counts as far as it does not cancel over a
patch."""


def excess_light(tree: ElementTree, links: LinkTable, radiosity: FloatArray) -> FloatArray:
    """Mean square (n,) of the radiosity times the part of it that is sent in error, over each element.

    In (W/m2)^2, of the mean luminance radiosity (n,) of leaves. Those links of an element that something
    stands between send it, in proportion to their form factors.
    """
    n = len(tree)

    def add(start: int, stop: int, sums: FloatArray) -> None:
        _add(
            links.p, links.q, links.kind, links.open_exchange, links.visibility, links.noise, links.slope_p,
            links.slope_q, links.residual_p, links.residual_q, tree.area, start, stop, sums,
        )  # fmt: skip

    total, excess = add_up(add, len(links), (n, 8)), np.empty(n)
    _find(
        tree.patch_count, tree.patch, tree.parent, tree.child, tree.child_count, tree.area, tree.offset,
        radiosity, total, excess,
    )  # fmt: skip
    return excess


@kernel
def _add(
    p: IntArray,
    q: IntArray,
    kind: IntArray,
    open_exchange: FloatArray,
    visibility: FloatArray,
    noise: FloatArray,
    slope_p: FloatArray,
    slope_q: FloatArray,
    residual_p: FloatArray,
    residual_q: FloatArray,
    area: FloatArray,
    start: int,
    stop: int,
    sums: FloatArray,
) -> None:
    """Add the form factors of links [start, stop) to those of either end.

    sums (n, 8): the function that they come to, as mean and gradient; the same of links that something stands
    between; the squared error that is told of all; and what the latter would be if nothing did.
    """
    for link in range(start, stop):
        for end in range(2):
            e = p[link] if end == 0 else q[link]
            slope = slope_p if end == 0 else slope_q
            residual = residual_p[link] if end == 0 else residual_q[link]
            whole = open_exchange[link] / area[e]
            mean = visibility[link] * whole
            u = slope[link, 0] / area[e]
            v = slope[link, 1] / area[e]
            sums[e, 0] += mean
            sums[e, 1] += u
            sums[e, 2] += v
            sums[e, 6] += residual * residual
            if kind[link] == PARTIAL:
                sums[e, 3] += mean
                sums[e, 4] += u
                sums[e, 5] += v
                sums[e, 6] += whole * whole * noise[link]
                sums[e, 7] += whole


@kernel
def _find(
    patches: int,
    patch: IntArray,
    parent: IntArray,
    child: IntArray,
    child_count: IntArray,
    area: FloatArray,
    offset: FloatArray,
    radiosity: FloatArray,
    sums: FloatArray,
    excess: FloatArray,
) -> None:
    n = len(parent)
    share = np.zeros(n)
    # Of each patch: what sums a little above 1 come to, and those below.
    more = np.zeros(patches)
    less = np.zeros(patches)
    most = np.empty(n)
    for e in range(n):
        # What the own links of an element can see in error on average, as a part of what they see.
        hidden = sums[e, 7] - sums[e, 3] + math.sqrt(sums[e, 6])
        most[e] = hidden / sums[e, 3] if sums[e, 3] > 0.0 else 0.0
        if parent[e] >= 0:
            up = sums[parent[e]]
            sums[e, 0] += up[0] + offset[e, 0] * up[1] + offset[e, 1] * up[2]
            sums[e, 1] += up[1]
            sums[e, 2] += up[2]
            sums[e, 3] += up[3] + offset[e, 0] * up[4] + offset[e, 1] * up[5]
            sums[e, 4] += up[4]
            sums[e, 5] += up[5]
            sums[e, 6] += up[6]
        excess[e] = 0.0
        over = sums[e, 0] - 1.0
        if child[e] < 0 and sums[e, 3] > 0.0:
            power = area[e] * radiosity[e]
            if over < 0.0:
                less[patch[e]] += power * min(-over, _SCATTERED)
            elif over < _SCATTERED:
                more[patch[e]] += power * over
    for e in range(n):
        over = sums[e, 0] - 1.0
        if child[e] < 0 and over > 0.0 and sums[e, 3] > 0.0:
            over = math.sqrt(max(0.0, over * over - _TOLD * sums[e, 6]))
            if sums[e, 0] - 1.0 < _SCATTERED:
                p = patch[e]
                over *= max(0.0, more[p] - less[p]) / (more[p] + less[p]) if more[p] > 0.0 else 0.0
            share[e] = min(1.0, over / sums[e, 3])
            sent = radiosity[e] * share[e]
            excess[e] = sent * sent * sums[e, 3]
    for e in range(n - 1, -1, -1):
        if child[e] >= 0:
            for k in range(child[e], child[e] + child_count[e]):
                excess[e] += excess[k] * area[k] / area[e]
                share[e] += share[k] * area[k] / area[e]
    for e in range(n):
        if share[e] > most[e]:
            excess[e] *= most[e] / share[e]

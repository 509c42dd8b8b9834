"""The transport operator on the hierarchy: pull radiosities up, gather over links, push irradiance down.

[H 4.3], with two changes. Links are symmetric exchange areas G = A_p F_pq = A_q F_qp: one link carries
light both ways, so that reciprocity holds to the last bit and the operator is self-adjoint. And light
is linear, not constant, over every element: a link couples points x of p and y of q by

    G / (A_p A_q) (v + a . x + b . y),    x, y from the centroids,

the projection of kernel and visibility on functions of this form. The source counts with its mean and
first moment, the receiver gets a mean and a gradient, and both ends keep what would else need one more
level of elements at half the size to be seen.

Functions on elements are arrays (n, 3, channels): mean, and the gradient by the two axes of the patch.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import Final

import numpy as np

from solver.kernels import kernel
from solver.parallel import run_chunks
from solver.transport.elements import ElementTree
from solver.transport.links import LinkTable
from solver.transport.pace import finish
from solver.types import FloatArray, IntArray, Spectra

_MANY: Final = 1 << 16
_PARTS: Final = 2
"""Of so many links each part has an array of its own to gather into; the number is fixed, so that sums are
the same on any machine."""

_AT_ONCE: Final = 1 << 17
"""Links gathered over between two yields."""


@kernel
def pull(
    child: IntArray,
    child_count: IntArray,
    area: FloatArray,
    moment: FloatArray,
    offset: FloatArray,
    functions: FloatArray,
    moments: FloatArray,
) -> None:
    """Means and first moments (n, 3, channels) of all elements from the functions on the leaves."""
    channels = functions.shape[2]
    for e in range(len(child) - 1, -1, -1):
        if child[e] < 0:
            for c in range(channels):
                moments[e, 0, c] = functions[e, 0, c]
                moments[e, 1, c] = moment[e, 0] * functions[e, 1, c] + moment[e, 1] * functions[e, 2, c]
                moments[e, 2, c] = moment[e, 1] * functions[e, 1, c] + moment[e, 2] * functions[e, 2, c]
            continue
        moments[e] = 0.0
        for k in range(child[e], child[e] + child_count[e]):
            share = area[k] / area[e]
            for c in range(channels):
                mean = moments[k, 0, c]
                moments[e, 0, c] += share * mean
                moments[e, 1, c] += share * (moments[k, 1, c] + offset[k, 0] * mean)
                moments[e, 2, c] += share * (moments[k, 2, c] + offset[k, 1] * mean)


@kernel
def push(parent: IntArray, offset: FloatArray, functions: FloatArray) -> None:
    """Add to the function of every element that of its parent, from the patches down."""
    channels = functions.shape[2]
    for e in range(len(parent)):
        up = parent[e]
        if up < 0:
            continue
        for c in range(channels):
            du = functions[up, 1, c]
            dv = functions[up, 2, c]
            functions[e, 0, c] += functions[up, 0, c] + offset[e, 0] * du + offset[e, 1] * dv
            functions[e, 1, c] += du
            functions[e, 2, c] += dv


@kernel
def take_in(
    parent: IntArray,
    offset: FloatArray,
    closure: FloatArray,
    factor: float,
    arrived: FloatArray,
    received: FloatArray,
) -> None:
    """Push the functions `arrived` down and add them to `received`, times `factor` and `closure` (n,)."""
    push(parent, offset, arrived)
    for e in range(len(parent)):
        scale = factor * closure[e]
        for k in range(3):
            for c in range(arrived.shape[2]):
                received[e, k, c] += scale * arrived[e, k, c]


@kernel
def gather(
    p: IntArray,
    q: IntArray,
    exchange: FloatArray,
    slope_p: FloatArray,
    slope_q: FloatArray,
    area: FloatArray,
    moments: FloatArray,
    start: int,
    stop: int,
    received: FloatArray,
) -> None:
    """Add to the irradiance functions `received` what links [start, stop) bring to both their ends.

    Per link: exchange (n,) m2 and slopes (n, 2) in m2 per metre, visibility included.
    """
    channels = moments.shape[2]
    for link in range(start, stop):
        i = p[link]
        j = q[link]
        g = exchange[link]
        au = slope_p[link, 0]
        av = slope_p[link, 1]
        bu = slope_q[link, 0]
        bv = slope_q[link, 1]
        to_i = 1.0 / area[i]
        to_j = 1.0 / area[j]
        for c in range(channels):
            mi = moments[i, 0, c]
            mj = moments[j, 0, c]
            received[i, 0, c] += to_i * (g * mj + bu * moments[j, 1, c] + bv * moments[j, 2, c])
            received[i, 1, c] += to_i * au * mj
            received[i, 2, c] += to_i * av * mj
            received[j, 0, c] += to_j * (g * mi + au * moments[i, 1, c] + av * moments[i, 2, c])
            received[j, 1, c] += to_j * bu * mi
            received[j, 2, c] += to_j * bv * mi


def irradiance_in_steps(
    tree: ElementTree, links: LinkTable, closure: FloatArray, remainder: FloatArray, radiosity: FloatArray
) -> Generator[None, None, FloatArray]:
    """Irradiance functions (n, 3, channels) on every element from the leaf radiosities (n, 3, channels).

    Yields every few milliseconds and returns them. Inner rows of `radiosity` are ignored; inner rows of
    the result hold what the leaves below share through links of the inner element and its ancestors.
    `closure` (n,) scales the leaves at both ends of a transfer and `remainder` (n, 3) couples each leaf
    with itself (see `closure.py`).
    """
    sent = radiosity * closure[:, None, None]
    moments = np.empty_like(sent)
    pull(tree.child, tree.child_count, tree.area, tree.moment, tree.offset, sent, moments)
    parts = _PARTS if len(links) >= _MANY else 1
    received = np.zeros((parts, *sent.shape))
    exchange = links.exchange

    pieces = max(1, -(-len(links) // _AT_ONCE))
    for piece in range(pieces):
        if piece:
            yield

        def work(start: int, stop: int, piece: int = piece) -> None:
            for part in range(start, stop):
                at = part * pieces + piece
                whole = parts * pieces
                gather(
                    links.p, links.q, exchange, links.slope_p, links.slope_q, tree.area, moments,
                    len(links) * at // whole, len(links) * (at + 1) // whole, received[part],
                )  # fmt: skip

        run_chunks(work, parts, 1)
    total: FloatArray = received[0] if parts == 1 else received.sum(axis=0)
    push(tree.parent, tree.offset, total)
    total *= closure[:, None, None]
    if remainder.any():
        # The closure's scale is already in the moments of leaves, and divided out again.
        own = moments / closure[:, None, None]
        total[:, 0] += np.einsum("nk,nkc->nc", remainder, own)
        total[:, 1:] += remainder[:, 1:, None] * own[:, :1]
    return total


def irradiance(
    tree: ElementTree, links: LinkTable, closure: FloatArray, remainder: FloatArray, radiosity: FloatArray
) -> FloatArray:
    """As `irradiance_in_steps`, in one."""
    return finish(irradiance_in_steps(tree, links, closure, remainder, radiosity))


def means(tree: ElementTree, functions: FloatArray) -> Spectra:
    """Mean values (n, channels) of all elements, from functions (n, 3, channels) on the leaves."""
    moments = np.empty_like(functions)
    pull(tree.child, tree.child_count, tree.area, tree.moment, tree.offset, functions, moments)
    return np.ascontiguousarray(moments[:, 0])

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
from solver.transport.sums import add_up, part_count
from solver.types import FloatArray, IntArray, Spectra

_AT_ONCE: Final = 1 << 18
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
    scale: FloatArray | None = None,
) -> None:
    """Means and first moments (n, 3, channels) of all elements from the functions on the leaves.

    Those of leaves count times `scale` (n,), where given.
    """
    channels = functions.shape[2]
    for e in range(len(child) - 1, -1, -1):
        if child[e] < 0:
            by = 1.0 if scale is None else scale[e]
            for c in range(channels):
                du = by * functions[e, 1, c]
                dv = by * functions[e, 2, c]
                moments[e, 0, c] = by * functions[e, 0, c]
                moments[e, 1, c] = moment[e, 0] * du + moment[e, 1] * dv
                moments[e, 2, c] = moment[e, 1] * du + moment[e, 2] * dv
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
def collect(parent: IntArray, offset: FloatArray, closure: FloatArray, received: FloatArray) -> None:
    """Sum the parts of `received` (parts, n, 3, channels) in the first, push it down, scale by `closure`."""
    parts, n, _, channels = received.shape
    total = received[0]
    for part in range(1, parts):
        for e in range(n):
            for k in range(3):
                for c in range(channels):
                    total[e, k, c] += received[part, e, k, c]
    push(parent, offset, total)
    for e in range(n):
        if closure[e] != 1.0:
            for k in range(3):
                for c in range(channels):
                    total[e, k, c] *= closure[e]


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

    Per link: exchange (n,) m2 and slopes (n, 2) in m2 per metre, visibility included; 0 where that is 0.
    """
    channels = moments.shape[2]
    for link in range(start, stop):
        i = p[link]
        j = q[link]
        g = exchange[link]
        if g == 0.0:
            continue
        au = slope_p[link, 0]
        av = slope_p[link, 1]
        bu = slope_q[link, 0]
        bv = slope_q[link, 1]
        to_i = 1.0 / area[i]
        to_j = 1.0 / area[j]
        for c in range(channels):
            mi = moments[i, 0, c]
            mj = moments[j, 0, c]
            at_i = to_i * mj
            at_j = to_j * mi
            received[i, 0, c] += g * at_i + to_i * (bu * moments[j, 1, c] + bv * moments[j, 2, c])
            received[i, 1, c] += au * at_i
            received[i, 2, c] += av * at_i
            received[j, 0, c] += g * at_j + to_j * (au * moments[i, 1, c] + av * moments[i, 2, c])
            received[j, 1, c] += bu * at_j
            received[j, 2, c] += bv * at_j


@kernel
def add_exchange(
    p: IntArray,
    q: IntArray,
    exchange: FloatArray,
    patch: IntArray,
    scale: FloatArray,
    start: int,
    stop: int,
    total: FloatArray,
) -> None:
    """Add to `total` (patches,) the exchange areas, m2, of links [start, stop) at the patches of their ends.

    Each counts times the `scale` (patches,) of the other end's.
    """
    for link in range(start, stop):
        i = patch[p[link]]
        j = patch[q[link]]
        total[i] += exchange[link] * scale[j]
        total[j] += exchange[link] * scale[i]


def patch_sums(tree: ElementTree, links: LinkTable, exchange: FloatArray, scale: FloatArray) -> FloatArray:
    """What patches (n,) receive on average where all leaves send 1 W/m2, if `scale` (n,) is their closure.

    `exchange` (m,) is that of the links.
    """

    def add(start: int, stop: int, total: FloatArray) -> None:
        add_exchange(links.p, links.q, exchange, tree.patch, scale, start, stop, total)

    total = add_up(add, len(links), (tree.patch_count,))
    return np.asarray(total * scale / tree.area[: tree.patch_count])


def irradiance_in_steps(
    tree: ElementTree, links: LinkTable, closure: FloatArray, remainder: FloatArray, radiosity: FloatArray
) -> Generator[None, None, FloatArray]:
    """Irradiance functions (n, 3, channels) on every element from the leaf radiosities (n, 3, channels).

    Yields every few milliseconds and returns them. Inner rows of `radiosity` are ignored; inner rows of
    the result hold what the leaves below share through links of the inner element and its ancestors.
    `closure` (n,) scales the leaves at both ends of a transfer and `remainder` (n, 3) couples each leaf
    with itself (see `closure.py`).
    """
    moments = np.empty_like(radiosity)
    pull(tree.child, tree.child_count, tree.area, tree.moment, tree.offset, radiosity, moments, closure)
    parts = part_count(len(links))
    received = np.zeros((parts, *radiosity.shape))
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
    collect(tree.parent, tree.offset, closure, received)
    total: FloatArray = received[0]
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

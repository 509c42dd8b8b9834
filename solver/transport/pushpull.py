"""The transport operator on the hierarchy: pull radiosities up, gather over links, push irradiance down.

[H 4.3], with links as symmetric exchange areas G = A_p F_pq = A_q F_qp: one link carries light both
ways, so that reciprocity holds to the last bit and the operator is self-adjoint.
"""

from __future__ import annotations

import numpy as np

from solver.kernels import kernel
from solver.types import FloatArray, IntArray, Spectra


@kernel
def pull(child: IntArray, child_count: IntArray, area: FloatArray, values: Spectra) -> None:
    """Set the values (n, channels) of inner elements to the area-weighted mean of their children."""
    channels = values.shape[1]
    for e in range(len(child) - 1, -1, -1):
        if child[e] < 0:
            continue
        for c in range(channels):
            values[e, c] = 0.0
        for k in range(child[e], child[e] + child_count[e]):
            share = area[k] / area[e]
            for c in range(channels):
                values[e, c] += share * values[k, c]


@kernel
def push(parent: IntArray, values: Spectra) -> None:
    """Add to every element the value of its parent, from the patches down."""
    channels = values.shape[1]
    for e in range(len(parent)):
        if parent[e] >= 0:
            for c in range(channels):
                values[e, c] += values[parent[e], c]


@kernel
def gather(p: IntArray, q: IntArray, exchange: FloatArray, radiosity: Spectra, power: Spectra) -> None:
    """Add to `power` (n, channels) in W what every link brings to both its ends."""
    channels = radiosity.shape[1]
    if channels == 1:
        for link in range(len(p)):
            power[p[link], 0] += exchange[link] * radiosity[q[link], 0]
            power[q[link], 0] += exchange[link] * radiosity[p[link], 0]
        return
    for link in range(len(p)):
        i = p[link]
        j = q[link]
        g = exchange[link]
        for c in range(channels):
            power[i, c] += g * radiosity[j, c]
            power[j, c] += g * radiosity[i, c]


def irradiance(
    child: IntArray,
    child_count: IntArray,
    parent: IntArray,
    area: FloatArray,
    p: IntArray,
    q: IntArray,
    exchange: FloatArray,
    closure: FloatArray,
    radiosity: Spectra,
) -> Spectra:
    """Irradiance (n, channels) in W/m2 on every element from the leaf radiosities (n, channels).

    Inner rows of `radiosity` are ignored; inner rows of the result hold what the leaves below share
    through links of the inner element and its ancestors. `closure` (n,) scales the leaves at both ends
    of a transfer (see `closure.py`).
    """
    sent = radiosity * closure[:, None]
    pull(child, child_count, area, sent)
    received = np.zeros_like(sent)
    gather(p, q, exchange, sent, received)
    received /= area[:, None]
    push(parent, received)
    received *= closure[:, None]
    return received

"""Constrained Delaunay triangulations made unique: of each cell alone, in one order.

Four vertices on a circle may be cut along either diagonal, and a library's choice depends on everything it
was given. Here a diagonal at the vertex of the lowest place is the one: as if vertices were lifted off the
paraboloid, each by far less than those before it. So is every tie decided, since what is left
without ties has one lower hull, which flips from wherever they begin reach (Edelsbrunner and Mücke,
Simulation of Simplicity, 1990, for the principle).
"""

from __future__ import annotations

import numpy as np

from solver.illumination.meshing.adjacency import edge_labels, opposite_edges
from solver.illumination.meshing.incircle import in_circle
from solver.kernels import kernel
from solver.types import BoolArray, Int64Array, IntArray


def make_unique(triangles: IntArray, edges: IntArray, whole: Int64Array) -> IntArray:
    """The Delaunay triangles (t, 3) with the given `edges` (e, 2), from others of the same points and edges.

    Points `whole` (k, 2) are whole numbers, those of each cell one after the other. Each triangle begins with
    its first vertex; triangles are sorted by their vertices, and thereby by cell.
    """
    t, k = len(triangles), len(whole)
    start, end = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    opposite = opposite_edges(start, end, k)
    label = np.zeros(len(edges), dtype=np.int32)
    fixed = edge_labels(edges[:, 0], edges[:, 1], label, start, end, k) >= 0
    _flip(triangles, opposite, fixed, whole)
    first = triangles.argmin(axis=1)
    turned = triangles[np.arange(t)[:, None], (first[:, None] + np.arange(3)) % 3]
    return np.asarray(turned[np.lexsort((turned[:, 1], turned[:, 0]))])


@kernel
def _flip(triangles: IntArray, opposite: IntArray, fixed: BoolArray, whole: Int64Array) -> None:
    """Flip edges until each that is not `fixed` (3 t,) is the better diagonal.

    Edge 3 t + k runs from corner k of triangle t to the next; `opposite` (3 t,) is the one that runs back.
    Each flip brings the surface down: it comes to an end. The bound is only against triangles that lie
    over each other, which are for `tiling` to find.
    """
    for _ in range(len(triangles) + 1):
        flipped = False
        for edge in range(len(opposite)):
            back = opposite[edge]
            if back < edge or fixed[edge]:
                continue
            t = edge // 3
            u = back // 3
            a = triangles[t, edge % 3]
            b = triangles[u, back % 3]
            c = triangles[t, (edge + 2) % 3]
            d = triangles[u, (back + 2) % 3]
            side = in_circle(whole, a, b, c, d)
            if side < 0 or (side == 0 and min(a, b) < min(c, d)):
                continue
            # a, b, c and b, a, d become a, d, c and d, b, c: four edges move, and keep what is behind them.
            bc, ca = 3 * t + (edge + 1) % 3, 3 * t + (edge + 2) % 3
            ad, db = 3 * u + (back + 1) % 3, 3 * u + (back + 2) % 3
            behind = opposite[ad], opposite[ca], opposite[db], opposite[bc]
            is_fixed = fixed[ad], fixed[ca], fixed[db], fixed[bc]
            place = 3 * t, 3 * t + 2, 3 * u, 3 * u + 1
            triangles[t, 0], triangles[t, 1], triangles[t, 2] = a, d, c
            triangles[u, 0], triangles[u, 1], triangles[u, 2] = d, b, c
            for i in range(4):
                opposite[place[i]] = behind[i]
                fixed[place[i]] = is_fixed[i]
                if behind[i] >= 0:
                    opposite[behind[i]] = place[i]
            opposite[3 * t + 1], opposite[3 * u + 2] = 3 * u + 2, 3 * t + 1
            fixed[3 * t + 1] = fixed[3 * u + 2] = False
            flipped = True
        if not flipped:
            return

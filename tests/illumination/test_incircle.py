"""The circle test is exact: held to Python's own whole numbers, ties and what is next to them above all."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from solver.illumination.meshing.incircle import BITS, in_circle
from solver.kernels import kernel
from solver.types import Int64Array

Place = tuple[int, int]

# Vectors of one length: points on a circle around any centre.
ROUND = [
    (sign * x, other * y)
    for a, b in [(7, 24), (15, 20), (0, 25)]
    for x, y in [(a, b), (b, a)]
    for sign in (-1, 1)
    for other in (-1, 1)
]

anywhere = st.integers(-(1 << BITS), 1 << BITS)
near = st.integers(-3, 3)


def expected(a: Place, b: Place, c: Place, d: Place) -> int:
    """The sign of the determinant."""
    rows = [(x - d[0], y - d[1]) for x, y in (a, b, c)]
    lifts = [x * x + y * y for x, y in rows]
    crosses = [
        rows[(k + 1) % 3][0] * rows[(k + 2) % 3][1] - rows[(k + 1) % 3][1] * rows[(k + 2) % 3][0]
        for k in range(3)
    ]
    det = sum(lift * cross for lift, cross in zip(lifts, crosses, strict=True))
    return (det > 0) - (det < 0)


@kernel
def answer(xy: Int64Array) -> int:
    return in_circle(xy, 0, 1, 2, 3)


def told(*places: Place) -> int:
    return int(answer(np.array(places, dtype=np.int64)))


@given(st.tuples(*[st.tuples(anywhere, anywhere)] * 4))
@settings(max_examples=200, deadline=None)
def test_any_four_points(places: tuple[Place, Place, Place, Place]) -> None:
    assert told(*places) == expected(*places)


@given(
    center=st.tuples(*[st.integers(-(1 << (BITS - 1)), 1 << (BITS - 1))] * 2),
    scale=st.integers(1, (1 << (BITS - 1)) // 25),
    turns=st.permutations(range(len(ROUND))),
    off=st.tuples(near, near),
)
@settings(max_examples=300, deadline=None)
def test_points_on_a_circle_or_next_to_it(
    center: Place, scale: int, turns: list[int], off: tuple[int, int]
) -> None:
    a, b, c, d = ((center[0] + scale * ROUND[k][0], center[1] + scale * ROUND[k][1]) for k in turns[:4])
    assert told(a, b, c, d) == expected(a, b, c, d) == 0
    moved = (d[0] + off[0], d[1] + off[1])
    assert told(a, b, c, moved) == expected(a, b, c, moved)


def test_corners_of_the_largest_square() -> None:
    far = 1 << BITS
    square = ((-far, -far), (far, -far), (far, far), (-far, far))
    assert told(*square) == 0
    assert told(*square[:3], (1 - far, far)) == 1
    assert told((1 - far, -far), *square[1:]) == -1

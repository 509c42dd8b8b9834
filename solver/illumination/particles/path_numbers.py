"""The numbers in [0, 1) that paths take their decisions by: Halton points, made unlike a grid ([K 4.1]).

A path has a pair of dimensions for where it begins and one for each direction in which it goes on. All
numbers depend on the seed, the index of the path and the dimension alone: not on which paths are traced
beside it, but for the range of the jitter, which is told.

Halton points as they are serve the first reflections only: n points of primes above n lie on a diagonal of
the square, and jitter by 1 / n [K 4.1] leaves them there. The third reflection of 32 paths goes into few
directions, and that is no chance that averages out over seeds. So there are points with scrambled digits,
too: a digit a becomes (m a + s) mod b, with m and s random for each dimension and digit (Matousek 1998, *On
the L2-discrepancy for anchored boxes*). Any b^k successive ones still have one in each cell of b^-k, and
each by itself is uniform: what is estimated with them is right in the mean, however few they are.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Final

import numpy as np

from solver.illumination.particles.radical_inverse import check_range, first_primes, halton_points
from solver.kernels import kernel
from solver.types import FloatArray, Int64Array
from solver.visibility.sampling import hash_index

_TO_UNIT: Final = 2.0**-53
_FINEST: Final = 1 << 46
"""Digits are scrambled to cells about this small: the last of them stays below 1 in float64."""


class PathPoints(Enum):
    """What a path's numbers are."""

    SCRAMBLED = "scrambled"
    """Halton points with scrambled digits"""
    JITTERED = "jittered"
    """Halton points, each moved at random by up to the resolution of their number, around the unit interval:
    as in [K 4.1]"""
    RANDOM = "random"
    """Pseudo-random numbers, to compare with"""


@dataclass(frozen=True)
class PathNumbers:
    """The numbers of all paths."""

    points: PathPoints
    seed: int

    def pairs(self, first: int, rows: Int64Array, dimension: int, spread: float) -> FloatArray:
        """Numbers (n, 2) in dimensions `dimension` and the next of the paths first + `rows` (n,), ascending.

        `spread` is the range of the jitter, 1 over the number of points that share the square. Raises
        ValueError for indices that have no Halton point.
        """
        out = np.empty((len(rows), 2))
        if len(rows) == 0:
            return out
        end = first + int(rows[-1]) + 1
        check_range(first, end)
        match self.points:
            case PathPoints.RANDOM:
                _fill_random(self.seed, first, rows, dimension, out)
            case PathPoints.JITTERED:
                _jitter(
                    halton_points(first, end, 2, dimension), spread, self.seed, first, rows, dimension, out
                )
            case PathPoints.SCRAMBLED:
                for axis, base in enumerate(first_primes(dimension + 2)[dimension:].tolist()):
                    _scramble(base, self.seed, first, rows, dimension + axis, out[:, axis])
        return out


@kernel
def hashed(seed: int, index: int, dimension: int) -> float:
    """A pseudo-random number in [0, 1), the same for the same arguments."""
    h = hash_index(hash_index(hash_index(np.int64(seed)) + np.int64(index)) + np.int64(dimension))
    return float(h >> np.int64(10)) * _TO_UNIT


@kernel
def _fill_random(seed: int, first: int, rows: Int64Array, dimension: int, out: FloatArray) -> None:
    for k in range(len(rows)):
        for axis in range(2):
            out[k, axis] = hashed(seed, first + rows[k], dimension + axis)


@kernel
def _jitter(
    points: FloatArray,
    spread: float,
    seed: int,
    first: int,
    rows: Int64Array,
    dimension: int,
    out: FloatArray,
) -> None:
    """The rows of points (>= rows, 2), moved."""
    for k in range(len(rows)):
        for axis in range(2):
            x = points[rows[k], axis] + spread * hashed(seed, first + rows[k], dimension + axis)
            out[k, axis] = x if x < 1.0 else x - 1.0


@kernel
def _scramble(base: int, seed: int, first: int, rows: Int64Array, dimension: int, out: FloatArray) -> None:
    """Radical inverses of first + rows with scrambled digits, into out (n,)."""
    digits, power = 0, 1
    while power <= _FINEST // base:
        power *= base
        digits += 1
    # What each digit becomes. Paths have numbers from 0 up: those below are free for this.
    factor = np.empty(digits, dtype=np.int64)
    shift = np.empty(digits, dtype=np.int64)
    for k in range(digits):
        factor[k] = 1 + int(hashed(seed, -1 - dimension, 2 * k) * (base - 1))
        shift[k] = int(hashed(seed, -1 - dimension, 2 * k + 1) * base)
    # What the noughts behind an index's last digit become.
    unit = np.ones(digits + 1)
    for k in range(digits):
        unit[k + 1] = unit[k] * base
    noughts = np.zeros(digits + 1)
    for k in range(digits - 1, -1, -1):
        noughts[k] = noughts[k + 1] + shift[k] / unit[k + 1]
    for row in range(len(rows)):
        index, mirrored, place = first + rows[row], 0, 0
        while index > 0:
            rest = index // base
            digit = index - rest * base
            mirrored = mirrored * base + (digit * factor[place] + shift[place]) % base
            index = rest
            place += 1
        out[row] = mirrored / unit[place] + noughts[place]

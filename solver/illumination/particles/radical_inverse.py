"""Radical inverses, and the Halton points that they make ([K 3.1]; Halton and Weller 1964, algorithm 247).

The radical inverse of i in base b mirrors its digits at the radix point. It is a fraction k / b^n, and it is
kept as one: k is counted in whole numbers, and divided at the end. Counting on from i to i + 1 as in [K fig.
3] adds rounded powers of 1 / b instead; there a tolerance has to tell 1 from a little less, and what was
rounded stays for all that follow. Whole numbers need no tolerance and do not drift: after any number of
steps the result is the direct one, to the last bit.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Final

import numpy as np

from solver.kernels import kernel
from solver.types import FloatArray, Int64Array

LAST_INDEX: Final = 1 << 31
"""Indices end here: b^n, below b times the index, is a whole number of a float64 up to b = 2^22."""


@kernel
def mirror_digits(base: int, index: int) -> tuple[int, int]:
    """The digits of `index` >= 0 in reverse, as a whole number, and the power of `base` above both."""
    mirrored, power = 0, 1
    while index > 0:
        rest = index // base
        mirrored = mirrored * base + index - rest * base
        power *= base
        index = rest
    return mirrored, power


@kernel
def radical_inverse(base: int, index: int) -> float:
    """The radical inverse of `index` >= 0, in [0, 1), digit by digit ([K fig. 2])."""
    mirrored, power = mirror_digits(base, index)
    return mirrored / power


@kernel
def count_on(base: int, unit: int, mirrored: int) -> int:
    """What follows the radical inverse mirrored / unit, `unit` a power of `base` ([K fig. 3]).

    Adds 1 to the digit behind the radix point; nines (b - 1) become noughts and carry to the right, over less
    than b / (b - 1) digits a step in the mean. The last of all, 1 - 1 / unit, has none that follows.
    """
    step = unit // base
    if mirrored + step < unit:
        return mirrored + step
    above = step
    while mirrored + step >= unit:
        above = step
        step //= base
    return mirrored + above + step - unit


@kernel
def _fill(base: int, unit: int, start: int, out: FloatArray) -> None:
    """Radical inverses of start, start + 1, ... into out (n,); `unit` a power of `base` above all of them."""
    mirrored, power = mirror_digits(base, start)
    mirrored *= unit // power
    for i in range(len(out)):
        out[i] = mirrored / unit
        if i + 1 < len(out):
            mirrored = count_on(base, unit, mirrored)


def first_primes(count: int) -> Int64Array:
    """The first `count` primes (count,)."""
    # Walks ask for two more at every reflection.
    return _sieve(1 << max(count - 1, 0).bit_length())[:count]


@lru_cache(maxsize=8)
def _sieve(count: int) -> Int64Array:
    """The first `count` primes (count,), by Eratosthenes' sieve."""
    # The n-th is below n (log n + log log n) from n = 6 on (Rosser and Schoenfeld 1962).
    n = max(count, 6)
    is_prime = np.ones(math.ceil(n * (math.log(n) + math.log(math.log(n)))) + 1, dtype=np.bool_)
    is_prime[:2] = False
    for k in range(2, math.isqrt(len(is_prime)) + 1):
        if is_prime[k]:
            is_prime[k * k :: k] = False
    primes = np.flatnonzero(is_prime)[:count].astype(np.int64)
    primes.setflags(write=False)
    return primes


def halton_points(start: int, stop: int, dimensions: int, first_dimension: int = 0) -> FloatArray:
    """Points (stop - start, dimensions) of the Halton sequence, in [0, 1), the indices [start, stop).

    Column k belongs to prime number `first_dimension` + k, counted from 0. Raises ValueError for a range that
    is none or goes beyond `LAST_INDEX`.
    """
    check_range(start, stop)
    bases = first_primes(first_dimension + dimensions)[first_dimension:].tolist()
    columns = np.empty((dimensions, stop - start))
    for base, column in zip(bases, columns, strict=True):
        unit = base
        while unit < stop:
            unit *= base
        _fill(base, unit, start, column)
    return np.ascontiguousarray(columns.T)


def check_range(start: int, stop: int) -> None:
    """Raises ValueError unless 0 <= start <= stop <= `LAST_INDEX`."""
    if not 0 <= start <= stop <= LAST_INDEX:
        raise ValueError(f"indices of points are in [0, {LAST_INDEX}), not [{start}, {stop})")

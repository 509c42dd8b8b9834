"""Owen-scrambled Sobol points by hashing, and the maps from the unit square to directions and triangles.

A path takes its random numbers in pairs: pair 0 for the pixel or the element, then one pair for the
light and one for the direction at each vertex. Every pair is its own shuffled and scrambled (0, 2)
sequence over the sample index, so that the samples of one item are stratified in every pair while pairs
stay independent. Nothing is stored: a pair is a function of stream, index and number, which makes a
result independent of the order in which threads work.

Sources: Laine and Karras 2011, *Stratified sampling for stochastic transparency* (the hash that is a
nested uniform scramble of reversed bits); Burley 2020, *Practical hash-based Owen scrambling* (shuffling
the index to pad dimensions). Constants of the hash are N. Vegdahl's, of `mix` those of C. Wellons's
lowbias32 search.

Integers are uint64 that hold 32 bits: numba would widen uint32 products, and mix signs, silently.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from solver.kernels import inline_kernel

MASK: Final = np.uint64(0xFFFFFFFF)
GOLDEN: Final = np.uint64(0x9E3779B9)
FIRST_AXIS: Final = np.uint64(0x85EBCA6B)
SECOND_AXIS: Final = np.uint64(0xC2B2AE35)
TO_UNIT: Final = 2.0**-32


@inline_kernel
def mix(x: np.uint64) -> np.uint64:
    """A 32-bit integer hash without visible bias."""
    x = x ^ (x >> np.uint64(16))
    x = (x * np.uint64(0x21F0AAAD)) & MASK
    x = x ^ (x >> np.uint64(15))
    x = (x * np.uint64(0xD35A2D97)) & MASK
    return x ^ (x >> np.uint64(15))


@inline_kernel
def stream_of(key: np.uint64, item: int) -> np.uint64:
    """The random stream of an item within a pass whose hashed seed is `key`."""
    return mix((mix(np.uint64(item) & MASK) + key) & MASK)


@inline_kernel
def reverse_bits(x: np.uint64) -> np.uint64:
    """The 32 bits of x in opposite order."""
    x = ((x >> np.uint64(1)) & np.uint64(0x55555555)) | ((x & np.uint64(0x55555555)) << np.uint64(1))
    x = ((x >> np.uint64(2)) & np.uint64(0x33333333)) | ((x & np.uint64(0x33333333)) << np.uint64(2))
    x = ((x >> np.uint64(4)) & np.uint64(0x0F0F0F0F)) | ((x & np.uint64(0x0F0F0F0F)) << np.uint64(4))
    x = ((x >> np.uint64(8)) & np.uint64(0x00FF00FF)) | ((x & np.uint64(0x00FF00FF)) << np.uint64(8))
    return ((x >> np.uint64(16)) | (x << np.uint64(16))) & MASK


@inline_kernel
def scramble_reversed(x: np.uint64, seed: np.uint64) -> np.uint64:
    """Nested uniform scramble of a number whose bits are reversed: each bit is flipped by those below it."""
    x = (x ^ (x * np.uint64(0x3D20ADEA))) & MASK
    x = (x + seed) & MASK
    x = (x * ((seed >> np.uint64(16)) | np.uint64(1))) & MASK
    x = (x ^ (x * np.uint64(0x05526C56))) & MASK
    return (x ^ (x * np.uint64(0x53A22864))) & MASK


@inline_kernel
def sobol_second_reversed(x: np.uint64) -> np.uint64:
    """Second Sobol coordinate of index x, bits reversed: Pascal's triangle modulo 2 as a superset sum."""
    x = x ^ ((x >> np.uint64(1)) & np.uint64(0x55555555))
    x = x ^ ((x >> np.uint64(2)) & np.uint64(0x33333333))
    x = x ^ ((x >> np.uint64(4)) & np.uint64(0x0F0F0F0F))
    x = x ^ ((x >> np.uint64(8)) & np.uint64(0x00FF00FF))
    return x ^ (x >> np.uint64(16))


@inline_kernel
def pair(stream: np.uint64, index: np.uint64, number: int) -> tuple[float, float]:
    """Point `index` in [0, 1)^2 of the scrambled sequence that pair `number` of `stream` is."""
    key = mix((stream + np.uint64(number) * GOLDEN) & MASK)
    # The index is shuffled so that pairs do not march in step.
    shuffled = reverse_bits(scramble_reversed(reverse_bits(index), key))
    # The first coordinate is the radical inverse: its reversed bits are the index itself.
    u = reverse_bits(scramble_reversed(shuffled, mix(key ^ FIRST_AXIS)))
    v = reverse_bits(scramble_reversed(sobol_second_reversed(shuffled), mix(key ^ SECOND_AXIS)))
    return (float(u) + 0.5) * TO_UNIT, (float(v) + 0.5) * TO_UNIT


@inline_kernel
def single(stream: np.uint64, index: np.uint64, number: int) -> float:
    """A plain random number in (0, 1), for decisions that gain nothing from stratification."""
    key = mix((stream ^ (np.uint64(number) * FIRST_AXIS)) & MASK)
    return (float(mix((key + index * GOLDEN) & MASK)) + 0.5) * TO_UNIT


@inline_kernel
def about(nx: float, ny: float, nz: float, x: float, y: float, z: float) -> tuple[float, float, float]:
    """The vector (x, y, z) of the z axis' frame in a frame about the unit vector (nx, ny, nz).

    The frame is that of Duff et al. 2017, *Building an orthonormal basis, revisited*.
    """
    sign = math.copysign(1.0, nz)
    a = -1.0 / (sign + nz)
    b = nx * ny * a
    dx = x * (1.0 + sign * nx * nx * a) + y * b + z * nx
    dy = x * sign * b + y * (sign + ny * ny * a) + z * ny
    dz = -x * sign * nx - y * ny + z * nz
    return dx, dy, dz


@inline_kernel
def cosine_direction(
    nx: float, ny: float, nz: float, u: float, v: float
) -> tuple[float, float, float, float]:
    """Unit direction about a unit normal with density cosine / pi, and its cosine."""
    radius, angle = math.sqrt(u), 2.0 * math.pi * v
    x, y, z = radius * math.cos(angle), radius * math.sin(angle), math.sqrt(1.0 - u)
    dx, dy, dz = about(nx, ny, nz, x, y, z)
    return dx, dy, dz, z


@inline_kernel
def lobe_direction(
    rx: float, ry: float, rz: float, exponent: float, u: float, v: float
) -> tuple[float, float, float, float]:
    """Unit direction about a unit vector with density (n + 1) / (2 pi) cosine^n, and its cosine."""
    z = u ** (1.0 / (exponent + 1.0))
    radius, angle = math.sqrt(1.0 - z * z), 2.0 * math.pi * v
    dx, dy, dz = about(rx, ry, rz, radius * math.cos(angle), radius * math.sin(angle), z)
    return dx, dy, dz, z


@inline_kernel
def triangle_weights(u: float, v: float) -> tuple[float, float]:
    """Barycentric weights of the second and third corner of a point uniform over a triangle's area."""
    root = math.sqrt(u)
    return root * (1.0 - v), root * v

"""Places that two meshes share, to the last bit."""

from __future__ import annotations

from typing import Final

import numpy as np

from solver.types import BoolArray, Int64Array, IntArray, Points

_ODD: Final = np.array(
    [0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9, 0x27D4EB2F165667C5], dtype=np.uint64
)
"""Odd numbers without a pattern: multiplicative hashing."""


def find_places(
    known: Points, known_patch: IntArray, position: Points, patch: IntArray
) -> tuple[BoolArray, Int64Array]:
    """Which of the positions (n, 3) on patches (n,) are among the known ones, and where.

    Where two places share a hash, one of them may be overlooked, never taken for the other.
    """
    at = np.zeros(len(position), dtype=np.int64)
    if len(known) == 0:
        return np.zeros(len(position), dtype=np.bool_), at
    hashes, wanted = _hash(known, known_patch), _hash(position, patch)
    order = np.argsort(hashes, kind="stable")
    slot = np.minimum(np.searchsorted(hashes[order], wanted), len(known) - 1)
    at[:] = order[slot]
    found = np.all(known[at] == position, axis=1) & (known_patch[at] == patch)
    return np.asarray(found), at


def _hash(position: Points, patch: IntArray) -> np.ndarray[tuple[int], np.dtype[np.uint64]]:
    # Adding 0 makes -0 into 0.
    bits = np.ascontiguousarray(position + 0.0).view(np.uint64)
    mixed = (bits ^ (bits >> np.uint64(29))) * _ODD[:3]
    total = mixed.sum(axis=1, dtype=np.uint64) + patch.astype(np.uint64) * _ODD[3]
    return np.asarray(total ^ (total >> np.uint64(32)))

"""Sampling patterns of the unit square, of any number of points: [K 4.1, figures 1, 7 and 8].

All of them are sets, made anew for each number of points; low-discrepancy sequences, of which every segment
will do, are in `radical_inverse` and `path_numbers`.
"""

from __future__ import annotations

import math
from enum import Enum

import numpy as np

from solver.illumination.particles.radical_inverse import halton_points
from solver.types import FloatArray


class Pattern(Enum):
    """How points are placed."""

    RANDOM = "random"
    JITTERED = "jittered"
    """One point at random in each of N cells of equal area, in rows, as square as N lets them be"""
    N_ROOKS = "n-rooks"
    """One in each row and each column of N, and at random in both"""
    HAMMERSLEY = "hammersley"
    """(i / N, radical inverse of i in base 2)"""
    JITTERED_HAMMERSLEY = "jittered hammersley"
    """N-rooks in Hammersley's order: where N is a power of two, Hammersley points that are moved by up to
    1 / N both ways; else the radical inverses count by their rank, so that no row is empty"""


def pattern_points(pattern: Pattern, count: int, sets: int, random: np.random.Generator) -> FloatArray:
    """Points (sets, count, 2) in [0, 1): independent sets of `count` >= 1 points, in the pattern's order.

    Means over random, jittered and N-rooks points are right in the mean over sets. Hammersley's sets are all
    the same, and jittered ones keep to the same cells, of which there is one in each row and column.
    """
    match pattern:
        case Pattern.RANDOM:
            return random.random((sets, count, 2))
        case Pattern.JITTERED:
            return _jittered(count, sets, random)
        case Pattern.N_ROOKS:
            column = np.broadcast_to(np.arange(count), (sets, count))
            cells = np.stack([column, random.permuted(column, axis=1)], axis=-1)
            return (cells + random.random((sets, count, 2))) / count
        case Pattern.HAMMERSLEY:
            points = np.stack([np.arange(count) / count, halton_points(0, count, 1)[:, 0]], axis=-1)
            return np.broadcast_to(points, (sets, count, 2)).copy()
        case Pattern.JITTERED_HAMMERSLEY:
            rank = np.argsort(np.argsort(halton_points(0, count, 1)[:, 0]))
            cells = np.stack([np.arange(count), rank], axis=-1)
            return np.asarray((cells + random.random((sets, count, 2))) / count)


def _jittered(count: int, sets: int, random: np.random.Generator) -> FloatArray:
    """Rows of cells: where `count` is no square, rows differ in length, and are as high as they are long."""
    rows = round(math.sqrt(count))
    # The row, its length and the place in it of each cell.
    first = np.arange(rows + 1) * count // rows
    row = np.repeat(np.arange(rows), np.diff(first))
    length = np.diff(first)[row]
    place = np.arange(count) - first[row]
    moved = random.random((sets, count, 2))
    x = (place + moved[..., 0]) / length
    y = (first[row] + moved[..., 1] * length) / count
    return np.stack([x, y], axis=-1)

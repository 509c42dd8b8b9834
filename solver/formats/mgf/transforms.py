"""Transforms of MGF: `-t`, `-rx`, `-ry`, `-rz`, `-s`, `-mx`, `-my`, `-mz`, `-i n`, and arrays `-a n`.

Each argument acts upon what those before it have made. `-i n` repeats what follows it, up to the next of its
kind or an array; `-a n` has the block placed n times, with what follows it applied 0 to n - 1 times.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.errors import LimitExceededError, SceneError
from solver.formats.text import integer_of, number_of
from solver.types import FloatArray

MOST_COPIES: Final = 100_000
_AXES: Final = "xyz"
_LARGEST: Final = 1e12


@dataclass(frozen=True, eq=False)
class _Segment:
    """Arguments in a row, which are applied together."""

    matrix: FloatArray
    repeats: range
    """How often, in each copy"""


def placements(words: Sequence[str], line: int) -> list[FloatArray]:
    """The matrices (4, 4) of a transform: one, or one for each copy of an array.

    Raises SceneError, LimitExceededError.
    """
    segments: list[_Segment] = []
    matrix, repeats = np.eye(4), range(1, 2)
    copies, at = 1, 0
    while at < len(words):
        word = words[at]
        if word in {"-a", "-i"}:
            segments.append(_Segment(matrix, repeats))
            count = integer_of(_argument(words, at + 1, line), line)
            if count < (1 if word == "-a" else 0):
                raise SceneError(f"{word} {count}", ("line", line))
            repeats = range(count) if word == "-a" else range(count, count + 1)
            copies *= count if word == "-a" else 1
            if max(copies, count) > MOST_COPIES:
                raise LimitExceededError("copies", max(copies, count), MOST_COPIES)
            matrix, at = np.eye(4), at + 2
            continue
        step, used = _step(words, at, line)
        matrix, at = step @ matrix, at + used
    segments.append(_Segment(matrix, repeats))
    return [_product(segments, counts, line) for counts in itertools.product(*(s.repeats for s in segments))]


def _product(segments: Sequence[_Segment], counts: Sequence[int], line: int) -> FloatArray:
    placed = np.eye(4)
    for segment, count in zip(segments, counts, strict=True):
        with np.errstate(over="ignore", invalid="ignore"):
            placed = np.linalg.matrix_power(segment.matrix, count) @ placed
        if not np.abs(placed).max() < _LARGEST:
            raise SceneError("the transform leads too far away", ("line", line))
    return placed


def _step(words: Sequence[str], at: int, line: int) -> tuple[FloatArray, int]:
    """The matrix (4, 4) of one argument, and how many words it takes."""
    word, matrix = words[at], np.eye(4)

    def number(k: int) -> float:
        return number_of(_argument(words, at + k, line), line)

    match word:
        case "-t":
            matrix[:3, 3] = [number(1), number(2), number(3)]
            return matrix, 4
        case "-s":
            factor = number(1)
            if factor == 0.0:
                raise SceneError("-s 0 leaves nothing", ("line", line))
            matrix[:3, :3] *= factor
            return matrix, 2
        case "-rx" | "-ry" | "-rz":
            axis = _AXES.index(word[2])
            angle = math.radians(number(1))
            i, j = (axis + 1) % 3, (axis + 2) % 3
            matrix[i, i] = matrix[j, j] = math.cos(angle)
            matrix[j, i] = math.sin(angle)
            matrix[i, j] = -matrix[j, i]
            return matrix, 2
        case "-mx" | "-my" | "-mz":
            axis = _AXES.index(word[2])
            matrix[axis, axis] = -1.0
            return matrix, 1
        case _:
            raise SceneError(f"{word[:40]!r} is no argument of a transform", ("line", line))


def _argument(words: Sequence[str], at: int, line: int) -> str:
    if at >= len(words):
        raise SceneError(f"{words[-1][:40]!r} wants a number after it", ("line", line))
    return words[at]

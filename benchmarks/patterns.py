"""Error against number of samples: pixels of a picture with edges and texture, by each sampling pattern.

As [K fig. 8] has it, for 1 to 64 samples a pixel and with a picture that is known as a function: a chequered
and textured floor in perspective, a sky and a disk, tilted, so that edges run in all directions.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from benchmarks.plan import Job, Options, Section
from benchmarks.tables import Row, Table
from solver.illumination.particles.patterns import Pattern, pattern_points
from solver.types import FloatArray

MOST: Final = 64
"""Samples a pixel, at most"""
MASTER: Final = 4096
"""Those of the picture that errors are told against: it errs by a twentieth of the least error told"""
SHOWN: Final = (1, 4, 16, 64)

_TILT: Final = math.radians(17.0)
_HORIZON: Final = 0.9


@dataclass(frozen=True)
class PatternFigures:
    """How one pattern converges."""

    pattern: str
    side: int
    """Pixels along a side of the picture"""
    errors: tuple[float, ...]
    """RMS error of a pixel for 1, 2, ... samples"""
    slope: float
    """Of the logarithm of the error by that of the number of samples"""


def picture(x: FloatArray, y: FloatArray) -> FloatArray:
    """Grey levels at points of the unit square, y upwards; of the same shape."""
    across, up = x - 0.5, y - 0.5
    x = 0.5 + across * math.cos(_TILT) - up * math.sin(_TILT)
    y = 0.5 + across * math.sin(_TILT) + up * math.cos(_TILT)
    # The floor in perspective; what is above it is overwritten.
    depth = 1.0 / np.where(y < 0.8, _HORIZON - y, 1.0)
    along = (x - 0.5) * depth
    square = (np.floor(1.3 * along + 0.3) + np.floor(0.9 * depth)) % 2.0
    floor = 0.15 + 0.7 * square * (0.8 + 0.2 * np.sin(20.0 * along))
    sky = 0.5 + 0.4 * np.sin(7.0 * x + 5.0 * y)
    in_disk = (x - 0.35) ** 2 + (y - 0.55) ** 2 < 0.18**2
    return np.where(in_disk, 0.9 - 0.3 * (x + y), np.where(y < 0.72, floor, sky))


def pixels(points: FloatArray, side: int) -> FloatArray:
    """Means (side^2,) of the picture over points (side^2, n, 2), a set of the unit square for each pixel."""
    row, column = np.divmod(np.arange(side * side), side)
    x = (column[:, None] + points[..., 0]) / side
    y = (row[:, None] + points[..., 1]) / side
    return np.asarray(picture(x, y).mean(axis=1))


def measure_pattern(name: str, side: int, times: int) -> PatternFigures:
    """The RMS error over side^2 pixels and `times` pictures, all with points of their own."""
    random = np.random.default_rng(1)
    master = pixels(pattern_points(Pattern.JITTERED, MASTER, side * side, random), side)
    pattern = Pattern(name)
    counts = np.arange(1, MOST + 1)

    def square(count: int) -> float:
        sampled = pixels(pattern_points(pattern, count, side * side, random), side)
        return float(np.mean((sampled - master) ** 2))

    errors = np.sqrt([np.mean([square(n) for _ in range(times)]) for n in counts.tolist()])
    slope = float(np.polyfit(np.log(counts), np.log(errors), 1)[0])
    return PatternFigures(name, side, tuple(errors.tolist()), slope)


def section(options: Options) -> Section:
    """All patterns."""
    side, times = (24, 2) if options.quick else (32, 8)
    jobs = (Job(pattern.value, measure_pattern, (pattern.value, side, times)) for pattern in Pattern)
    return Section("patterns", tuple(jobs), tabulate)


def tabulate(found: list[PatternFigures]) -> Table:
    """One row a pattern."""
    return Table(
        "Sampling patterns: error of a pixel against samples",
        ("pattern", *(f"{n} samples" for n in SHOWN), "slope"),
        tuple(
            Row(
                (
                    figures.pattern,
                    *(f"{figures.errors[n - 1]:.4f}" for n in SHOWN),
                    f"{figures.slope:.2f}",
                )
            )
            for figures in found
        ),
        f"RMS over pixels of a picture of edges and texture, against {MASTER:,} samples; slopes are those of "
        f"1 to {MOST} samples in logarithms.",
    )

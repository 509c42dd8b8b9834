"""IES LM-63 luminaire files: a small lamp, or one down and one up, of the luminaire's lumens.

The luminaire hangs at the origin and shines down, along -z, its width along x and its length along y.
Type C photometry, as almost all files have. Lumens are the integral of the candela table; each
hemisphere becomes a rectangle of the size of the luminous opening, whose directional emission is
fitted to the table.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.errors import LimitExceededError, SceneError
from solver.formats.beams import fit_beam, flux
from solver.formats.building import Imported, SceneBuilder
from solver.formats.lamps import lamp, quadrilateral
from solver.formats.source import ReadOptions, SourceFile, UpAxis
from solver.formats.text import decoded
from solver.types import FloatArray

_FEET: Final = 0.3048
_POINT: Final = 0.05
"""Metres across the opening of a luminaire that is said to be a point."""
_MOST_ANGLES: Final = 4096
_HORIZONTALS: Final = (0.0, 90.0, 180.0, 270.0, 360.0)
"""Last horizontal angles of type C: all around alike, by quadrants, by halves, or all told."""


@dataclass(frozen=True, eq=False)
class Photometry:
    """What an LM-63 file measures."""

    vertical: FloatArray
    """(n,) radians from straight down"""
    horizontal: FloatArray
    """(m,) radians"""
    candela: FloatArray
    """(m, n) with all factors applied"""
    width: float
    """Metres along x"""
    length: float
    """Metres along y"""
    name: str

    @property
    def around(self) -> tuple[FloatArray, FloatArray]:
        """Mean and standard deviation (n,) of the candelas around the axis."""
        if len(self.horizontal) == 1:
            return self.candela[0], np.zeros(len(self.vertical))
        # A symmetric part of the circle has the means of all of it; the intensity is linear between planes.
        span = np.diff(self.horizontal)
        weight = np.zeros(len(self.horizontal))
        weight[:-1] += 0.5 * span
        weight[1:] += 0.5 * span
        mean = np.average(self.candela, axis=0, weights=weight)
        return mean, np.sqrt(np.average((self.candela - mean) ** 2, axis=0, weights=weight))

    @property
    def lumens(self) -> float:
        """Of all directions."""
        return flux(self.vertical, self.around[0])


class _Words:
    """The numbers of a file, one after the other."""

    def __init__(self, lines: list[str], first: int) -> None:
        self._words = [
            (word, first + k) for k, line in enumerate(lines) for word in line.replace(",", " ").split()
        ]
        self._at = 0

    def take(self, count: int, what: str) -> FloatArray:
        """The next numbers (count,). Raises SceneError."""
        found = []
        for _ in range(count):
            if self._at >= len(self._words):
                raise SceneError(f"the file ends before all of {what}", (what,))
            word, line = self._words[self._at]
            self._at += 1
            try:
                value = float(word)
            except ValueError:
                value = math.nan
            if not math.isfinite(value) or abs(value) > 1e12:
                raise SceneError(f"{word[:40]!r} in {what} is not a number", ("line", line))
            found.append(value)
        return np.array(found)

    def one(self, what: str) -> float:
        """The next number. Raises SceneError."""
        return float(self.take(1, what)[0])

    def count(self, what: str) -> int:
        """The next number, how many there are of something. Raises SceneError, LimitExceededError."""
        value = self.one(what)
        if value != int(value) or value < 1:
            raise SceneError(f"{value:g} is no number of things", (what,))
        if value > _MOST_ANGLES:
            raise LimitExceededError(what, int(value), _MOST_ANGLES)
        return int(value)


def read_photometry(source: SourceFile) -> Photometry:
    """What the file measures. Raises SceneError, LimitExceededError."""
    lines = decoded(source.content).splitlines()
    tilt = next((k for k, line in enumerate(lines) if line.strip().upper().startswith("TILT")), None)
    if tilt is None:
        raise SceneError("there is no line TILT=, which every LM-63 file has", ("TILT",))
    words = _Words(lines[tilt + 1 :], tilt + 2)
    kind = lines[tilt].partition("=")[2].strip().upper()
    if kind == "INCLUDE":
        words.one("TILT")
        pairs = words.count("TILT")
        words.take(2 * pairs, "TILT")
    elif kind != "NONE":
        raise SceneError("TILT from another file is not read: NONE and INCLUDE are", ("TILT",))
    lamps, _lumens, multiplier = words.take(3, "lamps")
    if lamps < 1:
        raise SceneError("there is no lamp in it", ("lamps",))
    verticals, horizontals = words.count("vertical angles"), words.count("horizontal angles")
    photometric, units = words.one("photometric type"), words.one("units")
    if photometric != 1:
        raise SceneError("photometry of types A and B is not read; type C is", ("photometric type",))
    if units not in {1, 2}:
        raise SceneError(f"units are 1, feet, or 2, metres, not {units:g}", ("units",))
    metre = _FEET if units == 1 else 1.0
    width, length, _height = metre * np.abs(words.take(3, "dimensions"))
    ballast, _future, _watts = words.take(3, "ballast factor")
    vertical = _ascending(words.take(verticals, "vertical angles"), "vertical angles")
    horizontal = _ascending(words.take(horizontals, "horizontal angles"), "horizontal angles")
    if vertical[0] not in {0.0, 90.0} or vertical[-1] not in {90.0, 180.0}:
        raise SceneError("vertical angles go from 0 or 90 to 90 or 180 degrees", ("vertical angles",))
    if horizontal[-1] not in _HORIZONTALS or horizontal[0] not in {0.0, 90.0, 180.0}:
        message = "horizontal angles go from 0 to 0, 90, 180 or 360 degrees, or from 90 to 270"
        raise SceneError(message, ("horizontal angles",))
    candela = words.take(verticals * horizontals, "candela values").reshape(horizontals, verticals)
    scaled = candela * multiplier * ballast
    if (scaled < 0.0).any():
        raise SceneError("there are negative candelas", ("candela values",))
    return Photometry(
        np.radians(vertical), np.radians(horizontal), scaled, float(width), float(length), _name(lines[:tilt])
    )


def _ascending(angles: FloatArray, what: str) -> FloatArray:
    if (np.diff(angles) <= 0.0).any():
        raise SceneError("angles must ascend", (what,))
    return angles


def _name(header: list[str]) -> str:
    for key in ("[LUMCAT]", "[LUMINAIRE]"):
        for line in header:
            if line.strip().upper().startswith(key) and line.strip()[len(key) :].strip():
                return line.strip()[len(key) :].strip()
    return ""


def read_ies(source: SourceFile, options: ReadOptions) -> Imported:
    """The luminaire of a file as one object or two. Raises SceneError, LimitExceededError."""
    measured = read_photometry(source)
    builder = SceneBuilder(options, UpAxis.Z)
    mean, spread = measured.around
    name = measured.name or source.name or "luminaire"
    # An opening of which a file tells one side alone, as of a disc, is as broad as it is long.
    width = measured.width or measured.length or _POINT
    length = measured.length or width
    for part, axis, shown in (("down", -1.0, measured.vertical), ("up", 1.0, math.pi - measured.vertical)):
        below = shown <= 0.5 * math.pi + 1e-9
        if np.count_nonzero(below) < 2:
            continue
        order = np.argsort(shown[below])
        beam = fit_beam(shown[below][order], mean[below][order], spread[below][order])
        if beam is None:
            continue
        # The two faces back to back would touch: each is lifted off the other by a little.
        lift = 1e-3 * max(width, length) * axis
        corners, faces = quadrilateral(np.array([0.0, 0.0, lift]), np.array([0.0, 0.0, axis]), width, length)
        scaled = options.scale**2 * width * length
        emission = np.full(3, beam.lumens / builder.efficacy / scaled)
        title = name if part == "down" else f"{name} up"
        builder.add(title, corners, faces, lamp(emission, beam.exponent), (part,))
        builder.warn(
            f"{beam.lumens:.4g} lm {part}wards are emitted with the exponent {beam.exponent:.3g}, which errs "
            f"by {beam.error:.1%} of the file's intensities (RMS)"
        )
    return builder.finish(name)

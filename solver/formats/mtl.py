"""MTL, the materials of OBJ files: Kd and Ke, and Ks of what is said to reflect.

Ke is taken as radiance in W/(m2 sr), as the usual Cornell box has it: exitance is pi times that.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from solver.errors import SceneError
from solver.formats.shading import Shade, is_nearly_diffuse
from solver.formats.text import integer_of, number_of, numbered_lines
from solver.types import Vector

_REFLECTING: Final = {3, 5, 8}
"""Illumination models that trace reflections, glass aside; in others Ks is a highlight, mostly one that a
modeller has never looked at."""

_COLOURS: Final = {"Kd": "diffuse", "Ke": "radiance", "Ks": "specular"}


@dataclass(eq=False)
class MtlMaterial:
    """A material as the file has it."""

    diffuse: Vector = field(default_factory=lambda: np.full(3, 0.5))
    radiance: Vector = field(default_factory=lambda: np.zeros(3))
    specular: Vector = field(default_factory=lambda: np.zeros(3))
    shininess: float = 0.0
    model: int = 1
    picture: str | None = None
    """Name of the texture of Kd"""
    is_transparent: bool = False

    @property
    def emits(self) -> bool:
        """Whether it shines."""
        return bool(self.radiance.any())

    @property
    def reflects(self) -> bool:
        """Whether it reflects specularly."""
        return self.model in _REFLECTING and bool(self.specular.any())

    def shade(self, diffuse: Vector, two_sided: bool) -> Shade:
        """The surface of diffuse reflectance (3,)."""
        emission = math.pi * self.radiance
        if not self.reflects:
            return Shade.matt(diffuse, emission, two_sided)
        if is_nearly_diffuse(self.shininess):
            return Shade.matt(diffuse + self.specular, emission, two_sided)
        exponent = math.inf if self.shininess >= 1000.0 else self.shininess
        return Shade(diffuse, emission, self.specular, exponent, two_sided)


def read_mtl(content: bytes, name: str) -> dict[str, MtlMaterial]:
    """The materials of a file, by their names. Raises SceneError."""
    found: dict[str, MtlMaterial] = {}
    try:
        _read(numbered_lines(content), found)
    except SceneError as refused:
        raise SceneError(refused.message, (name, *refused.location)) from None
    return found


def _read(lines: Iterable[tuple[int, list[str]]], found: dict[str, MtlMaterial]) -> None:
    current = MtlMaterial()
    for line, words in lines:
        key, rest = words[0], words[1:]
        if key == "newmtl":
            current = found[" ".join(rest)] = MtlMaterial()
        elif not rest:
            continue
        elif key in _COLOURS:
            setattr(current, _COLOURS[key], _colour(rest, line))
        elif key == "Ns":
            current.shininess = max(0.0, number_of(rest[0], line))
        elif key == "illum":
            current.model = integer_of(rest[0], line)
        elif key == "map_Kd":
            current.picture = rest[-1]
        elif (key == "d" and rest[0] != "-halo" and number_of(rest[0], line) < 1.0) or (
            key == "Tr" and number_of(rest[0], line) > 0.0
        ):
            current.is_transparent = True


def _colour(words: list[str], line: int) -> Vector:
    """One number for all channels, or three."""
    if words[0] in {"spectral", "xyz"}:
        raise SceneError(f"colours of MTL are read as r g b, not as {words[0]}", ("line", line))
    values = [number_of(word, line) for word in words[:3]]
    if len(values) == 2:
        raise SceneError("a colour has one number or three", ("line", line))
    return np.array(values * (3 // len(values)))

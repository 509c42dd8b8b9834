"""The named contexts of MGF: colours, materials and vertices, made, copied and set."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

import numpy as np

from solver.errors import SceneError
from solver.formats.colours import of_chromaticity, of_spectrum, of_temperature, rgb_of
from solver.formats.shading import Shade, is_nearly_diffuse, phong_exponent
from solver.formats.text import number_of, numbers_of
from solver.types import Vector

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class MgfMaterial:
    """A material: amounts, each with the colour (3,) RGB of luminance 1 that was current when it was set."""

    sides: int = 2
    diffuse: tuple[float, Vector] = (0.0, np.ones(3))
    emission: tuple[float, Vector] = (0.0, np.ones(3))
    """Lumens per square metre"""
    specular: tuple[float, Vector] = (0.0, np.ones(3))
    slope: float = 0.0
    """RMS slope of microfacets"""
    transmits: bool = False

    def shade(self, efficacy: float, more: float) -> Shade:
        """The surface, its emission `more` times as strong; lm/W."""
        diffuse, specular = self.diffuse[0] * self.diffuse[1], self.specular[0] * self.specular[1]
        emission = more / efficacy * self.emission[0] * self.emission[1]
        exponent = phong_exponent(self.slope)
        if self.specular[0] == 0.0 or is_nearly_diffuse(exponent):
            return Shade.matt(diffuse + specular, emission, self.sides == 2)
        return Shade(diffuse, emission, specular, exponent, self.sides == 2)


@dataclass(frozen=True, eq=False)
class MgfVertex:
    """A place, and a normal if it has one."""

    place: Vector
    normal: Vector


class Named(Generic[T]):
    """Contexts of one kind: the current one, and those with names."""

    def __init__(self, what: str, fresh: T) -> None:
        self._what = what
        self._fresh = fresh
        self._named: dict[str, T] = {}
        self._name: str | None = None
        self.current = fresh

    def select(self, words: Sequence[str], line: int) -> None:
        """What `c`, `m` or `v` say: nothing, a name, a name and `=`, or a template after that.

        Raises SceneError.
        """
        if not words:
            self._name, self.current = None, self._fresh
            return
        name = words[0]
        if len(words) == 1:
            self.current = self.find(name, line)
        elif words[1] != "=" or len(words) > 3:
            raise SceneError("a name, `=` and the name of a template are meant", ("line", line))
        else:
            self.current = self.find(words[2], line) if len(words) == 3 else self._fresh
            self._named[name] = self.current
        self._name = name

    def find(self, name: str, line: int) -> T:
        """The context of that name. Raises SceneError."""
        if name not in self._named:
            raise SceneError(f"there is no {self._what} {name[:80]!r}", ("line", line))
        return self._named[name]

    def change(self, how: Callable[[T], T]) -> None:
        """Set something of the current one."""
        self.current = how(self.current)
        if self._name is not None:
            self._named[self._name] = self.current


def colour_of(key: str, words: Sequence[str], line: int, colours: Named[Vector]) -> Vector:
    """XYZ (3,) of luminance 1 that `cxy`, `cspec`, `cct` or `cmix` say. Raises SceneError."""
    match key:
        case "cxy":
            x, y = numbers_of(words, line, 2)
            if not (0.0 <= x <= 1.0 and 1e-3 <= y <= 1.0 and x + y <= 1.0):
                raise SceneError(f"{x:g} {y:g} is no chromaticity", ("line", line))
            return of_chromaticity(x, y)
        case "cct":
            (kelvin,) = numbers_of(words, line, 1)
            if not 500.0 <= kelvin <= 1e6:
                raise SceneError("a temperature is from 500 to 1,000,000 K", ("line", line))
            return of_temperature(kelvin)
        case "cspec":
            low, high = numbers_of(words, line, 2)
            values = [number_of(word, line) for word in words[2:]]
            if len(values) < 2 or not 0.0 < low < high or min(values) < 0.0 or max(values) > 1e12:
                raise SceneError("a spectrum has bounds in nm and two values or more", ("line", line))
            found = of_spectrum(low, high, np.array(values))
            if found is None:
                raise SceneError("nothing of the spectrum is visible", ("line", line))
            return found
        case _:
            if len(words) < 2 or len(words) % 2:
                raise SceneError("a weight before each colour is meant", ("line", line))
            weights = [number_of(word, line) for word in words[::2]]
            parts = [colours.find(name, line) for name in words[1::2]]
            if min(weights) < 0.0 or not 0.0 < sum(weights) < 1e12:
                raise SceneError("weights are not negative, nor all 0", ("line", line))
            # Weights are of luminance, which each colour has 1 of.
            return np.asarray(np.average(parts, axis=0, weights=weights))


def with_amount(
    material: MgfMaterial, key: str, words: Sequence[str], line: int, colour: Vector
) -> MgfMaterial:
    """`material` with what `sides`, `rd`, `ed`, `rs`, `td`, `ts` or `ir` say. Raises SceneError."""
    if key == "ir":
        return material
    (amount,) = numbers_of(words, line, 1)
    tint = rgb_of(colour)
    if key == "sides":
        if amount not in {1.0, 2.0}:
            raise SceneError("sides are 1 or 2", ("line", line))
        return replace(material, sides=int(amount))
    if amount < 0.0 or (key != "ed" and amount > 1.0) or amount > 1e15:
        raise SceneError(f"{key} {amount:g} is out of bounds", ("line", line))
    match key:
        case "rd":
            return replace(material, diffuse=(amount, tint))
        case "ed":
            return replace(material, emission=(amount, tint))
        case "rs":
            slope = numbers_of(words, line, 2)[1]
            if not 0.0 <= slope <= 10.0:
                raise SceneError(f"a roughness of {slope:g}", ("line", line))
            return replace(material, specular=(amount, tint), slope=slope)
        case _:
            return replace(material, transmits=material.transmits or amount > 0.0)

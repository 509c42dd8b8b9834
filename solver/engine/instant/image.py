"""What some paths give to the points of a frame: the images of which a picture is the mean."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.engine.instant.points import GlossyPoints, LitPoints
from solver.engine.instant.resolve import CHUNK, add_weighed, divide
from solver.parallel import run_chunks
from solver.types import BoolArray, Float32Array


@dataclass(eq=False)
class Image:
    """Irradiance W/m2 at the points of a frame, by one block or by several."""

    light: list[Float32Array]
    """(3, n) of the points of each sample"""
    gloss: list[Float32Array]
    """(3, g) of the glossy ones, counted by their lobes"""
    valid: list[BoolArray]
    """(n,) of each sample"""
    is_new: bool
    """Whether it is of the scene as it stands"""
    paths: int

    @classmethod
    def dark(cls, points: list[LitPoints], glossy: list[GlossyPoints], paths: int) -> Image:
        """No light, which is known everywhere."""
        return cls(
            [np.zeros((3, len(p)), dtype=np.float32) for p in points],
            [g.dark() for g in glossy],
            [np.ones(len(p), dtype=np.bool_) for p in points],
            True,
            paths,
        )


def joined(a: Image, b: Image) -> Image:
    """Two images, valid everywhere, as one."""
    paths = a.paths + b.paths
    share = np.float32(b.paths / paths)

    def mean(of: list[Float32Array], and_of: list[Float32Array]) -> list[Float32Array]:
        return [x + share * (y - x) for x, y in zip(of, and_of, strict=True)]

    return Image(mean(a.light, b.light), mean(a.gloss, b.gloss), a.valid, True, paths)


def mean_light(images: list[Image], points: list[LitPoints]) -> list[Float32Array]:
    """Irradiance (3, n) of each sample, of each image by its paths where it is valid."""
    means = []
    for sample, of in enumerate(points):
        parts = [(image.light[sample], image.valid[sample], image.paths) for image in images]
        means.append(_mean(parts, len(of)))
    return means


def mean_gloss(images: list[Image], glossy: list[GlossyPoints]) -> list[Float32Array]:
    """The same of the glossy points (3, g), by their lobes."""
    means = []
    for sample, of in enumerate(glossy):
        parts = [(image.gloss[sample], image.valid[sample][of.row], image.paths) for image in images]
        means.append(_mean(parts, len(of)))
    return means


def _mean(parts: list[tuple[Float32Array, BoolArray, int]], count: int) -> Float32Array:
    total, weight = np.zeros((3, count), dtype=np.float32), np.zeros(count, dtype=np.float32)
    parts = [(np.ascontiguousarray(light), valid, paths) for light, valid, paths in parts]

    def add(start: int, stop: int) -> None:
        for light, valid, paths in parts:
            add_weighed(start, stop, light, valid, np.float32(paths), total, weight)
        divide(start, stop, total, weight)

    run_chunks(add, count, CHUNK)
    return total

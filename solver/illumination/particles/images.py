"""Images of lights in mirrors made ready to shine: their frames, and what they see through their mirrors."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from solver.illumination.particles.folds import Folds
from solver.illumination.particles.hemisphere import texel_directions
from solver.illumination.particles.lighting import ShiningLights
from solver.illumination.particles.mirrors import Images
from solver.illumination.particles.receivers import Polygons, local
from solver.illumination.particles.sights import Sights, join_sights, number_polygons, span_cones
from solver.kernels import kernel
from solver.parallel import run_chunks
from solver.types import BoolArray, Float32Array, FloatArray, Int64Array, IntArray
from solver.visibility.rays import CHUNK, RayScene


@dataclass(frozen=True, eq=False)
class ShiningImages:
    """k images as the kernel takes them, in the order of `Images`."""

    lights: ShiningLights
    """(k), each in the mirrored frame of what it is an image of"""
    source: Int64Array
    """(k,) the light proper"""
    parent: Int64Array
    """(k,) the image that is shown, or -1"""
    mirror: IntArray
    """(k,) patch that shows it"""

    @classmethod
    def of(
        cls,
        polygons: Polygons,
        lights: ShiningLights,
        images: Images,
        emission_bound: FloatArray | None = None,
    ) -> ShiningImages:
        """The `images` of `lights`."""
        surfaces, mirror = polygons.surfaces, images.lights.mirror
        frames = np.empty((15, len(mirror)))
        normal = surfaces.normal[mirror].T
        anchor = local(surfaces, surfaces.corners[mirror, 0]).T
        is_left = np.ones(len(mirror), dtype=np.bool_)
        while is_left.any():
            # What is shown comes first.
            ready = np.flatnonzero(is_left & ((images.parent < 0) | ~is_left[images.parent]))
            parent, source = images.parent[ready], images.source[ready]
            shown = np.where(parent < 0, lights.frames[:, source], frames[:, parent])
            n, a = normal[:, ready], anchor[:, ready]
            for first in range(0, 15, 3):
                vector = shown[first : first + 3]
                along = ((vector - a if first == 0 else vector) * n).sum(axis=0)
                frames[first : first + 3, ready] = vector - 2.0 * along * n
            is_left[ready] = False
        shining = ShiningLights.all_of(polygons, images.lights, emission_bound)
        shining = replace(shining, frames=np.ascontiguousarray(frames, dtype=np.float32))
        return cls(shining, images.source, images.parent, mirror)

    def __len__(self) -> int:
        return len(self.lights)

    def part(self, first: int, last: int) -> ShiningImages:
        """The images of the lights [first, last), as of a list of these alone."""
        rows = np.flatnonzero((self.source >= first) & (self.source < last))
        place = np.full(len(self) + 1, -1, dtype=np.int64)
        place[rows] = np.arange(len(rows))
        return ShiningImages(
            self.lights.take(rows), self.source[rows] - first, place[self.parent[rows]], self.mirror[rows]
        )


@dataclass(frozen=True, eq=False)
class FoldedLights:
    """Some lights followed by their images, ready for `add_light`, which lights with the images alone."""

    lights: ShiningLights
    sights: Sights
    folds: Folds

    @property
    def nbytes(self) -> int:
        """Bytes held."""
        return self.sights.nbytes + self.folds.pyramid.nbytes + self.folds.clip.nbytes

    def scaled(self, factor: float | Float32Array) -> FoldedLights:
        """`factor` times as strong, or each light and its images by that of the light (m,)."""
        source = np.arange(len(self.lights))
        while np.any(self.folds.parent[source] >= 0):
            source = np.where(self.folds.parent[source] >= 0, self.folds.parent[source], source)
        each = np.broadcast_to(np.float32(factor), self.folds.first)[source]
        return replace(self, lights=self.lights.scaled(each))


def look_through(
    rays: RayScene, polygons: Polygons, lights: ShiningLights, sights: Sights, images: ShiningImages
) -> FoldedLights:
    """What the `images` of `lights`, which have `sights`, see through their mirrors; at least one of each."""
    m, k = len(lights), len(images)
    resolution = sights.texels.shape[1]
    frames = images.lights.frames
    mirror = polygons.of_patch[images.mirror]
    pyramid = np.empty((k, 16), dtype=np.float32)
    span_cones(frames, np.arange(k + 1, dtype=np.int32), mirror, polygons.corners, polygons.plane, pyramid)
    seen = _sights(rays, polygons, frames, mirror, pyramid, resolution)
    clip = np.empty((len(seen.polygon), 3), dtype=np.float32)
    _clip(frames, seen.start, seen.polygon, polygons.plane, pyramid, clip)
    parent = np.where(images.parent < 0, images.source, images.parent + m)
    folds = Folds(
        first=m,
        parent=np.concatenate([np.full(m, -1), parent]).astype(np.int32),
        polygon=np.concatenate([np.zeros(m, dtype=np.int32), mirror]).astype(np.int32),
        pyramid=np.concatenate([np.zeros((m, 16), dtype=np.float32), pyramid]),
        clip=np.concatenate([np.zeros((len(sights.polygon), 3), dtype=np.float32), clip]),
    )
    together = ShiningLights(
        np.concatenate([lights.frames, frames], axis=1),
        np.concatenate([lights.power, images.lights.power]),
        np.concatenate([lights.lobe, images.lights.lobe]),
        np.concatenate([lights.least_bound, images.lights.least_bound]),
    )
    return FoldedLights(together, join_sights([sights, seen]), folds)


def _sights(
    rays: RayScene,
    polygons: Polygons,
    frames: Float32Array,
    mirror: IntArray,
    pyramid: Float32Array,
    resolution: int,
) -> Sights:
    """Maps of images `frames` (15, k): what is seen through mirrors, `pyramid` (k, 16), from there on."""
    table = texel_directions(resolution)
    n, k = len(table), len(pyramid)
    texels = np.empty((k, n), dtype=np.uint16)
    found: list[IntArray] = [np.empty(0, dtype=np.int32)] * k
    of_triangle = np.concatenate([polygons.of_triangle, np.zeros(1, dtype=np.int32)])
    middle = polygons.corners[mirror].mean(axis=1) - frames[:3].T

    def trace(start: int, stop: int) -> None:
        origins = np.empty((n, 3), dtype=np.float32)
        directions = np.empty((n, 3), dtype=np.float32)
        through = np.empty(n, dtype=np.int32)
        is_through = np.empty((resolution, resolution), dtype=np.bool_)
        number = np.zeros(len(polygons) + 1, dtype=np.int32)
        palette = np.empty(n + 1, dtype=np.int32)
        for image in range(start, stop):
            count = _aim_through(
                frames, image, pyramid, middle[image], table, np.float32(rays.offset),
                is_through, through, origins, directions,
            )  # fmt: skip
            seen = np.zeros(n, dtype=np.int32)
            for first in range(0, count, CHUNK):
                part = slice(first, min(first + CHUNK, count))
                seen[through[part]] = of_triangle[rays.first_local(origins[part], directions[part])]
            found[image] = palette[: number_polygons(seen, number, palette, texels[image])].copy()

    run_chunks(trace, k, 8, 1)
    start = np.zeros(k + 1, dtype=np.int32)
    np.cumsum([len(part) for part in found], out=start[1:])
    polygon = np.concatenate(found)
    cone = np.empty((len(polygon), 16), dtype=np.float32)
    span_cones(frames, start, polygon, polygons.corners, polygons.plane, cone)
    return Sights(texels.reshape(k, resolution, resolution), start, polygon, cone)


@kernel
def _aim_through(
    frames: Float32Array,
    image: int,
    pyramid: Float32Array,
    middle: Float32Array,
    table: Float32Array,
    offset: np.float32,
    is_through: BoolArray,
    through: IntArray,
    origins: Float32Array,
    directions: Float32Array,
) -> int:
    """Rays (n, 3) from a mirror on, through those texels of `table` (n, 3) that show it or are next to one.

    A mirror that falls between texels counts as shown where its middle is, in the direction `middle` (3,).
    Lists these in through (n,), and returns how many there are; is_through (r, r) is for use in between.
    """
    size = len(is_through)
    vx, vy, vz = frames[0, image], frames[1, image], frames[2, image]
    ax, ay, az = pyramid[image, 12], pyramid[image, 13], pyramid[image, 14]
    depth = pyramid[image, 15] - (ax * vx + ay * vy + az * vz)
    nearest, most = 0, np.float32(-np.inf)
    for k in range(size * size):
        x = frames[6, image] * table[k, 0] + frames[9, image] * table[k, 1] + frames[3, image] * table[k, 2]
        y = frames[7, image] * table[k, 0] + frames[10, image] * table[k, 1] + frames[4, image] * table[k, 2]
        z = frames[8, image] * table[k, 0] + frames[11, image] * table[k, 1] + frames[5, image] * table[k, 2]
        fall = ax * x + ay * y + az * z
        inside = fall > np.float32(0.0)
        for edge in range(4):
            inside = inside and (
                pyramid[image, 3 * edge] * x
                + pyramid[image, 3 * edge + 1] * y
                + pyramid[image, 3 * edge + 2] * z
                >= np.float32(0.0)
            )
        is_through[k // size, k % size] = inside
        along = middle[0] * x + middle[1] * y + middle[2] * z
        if along > most:
            nearest, most = k, along
        far = depth / max(fall, np.float32(1e-6))
        origins[k, 0] = vx + far * x + offset * ax
        origins[k, 1] = vy + far * y + offset * ay
        origins[k, 2] = vz + far * z + offset * az
        directions[k, 0], directions[k, 1], directions[k, 2] = x, y, z
    is_through[nearest // size, nearest % size] = True
    count = 0
    for k in range(size * size):
        row, column = k // size, k % size
        near = False
        for i in range(max(row - 1, 0), min(row + 2, size)):
            for j in range(max(column - 1, 0), min(column + 2, size)):
                near = near or is_through[i, j]
        fall = ax * directions[k, 0] + ay * directions[k, 1] + az * directions[k, 2]
        if near and fall > np.float32(1e-6):
            # To the front of the lists, where nothing is that is still to be read.
            for axis in range(3):
                origins[count, axis] = origins[k, axis]
                directions[count, axis] = directions[k, axis]
            through[count] = k
            count += 1
    return count


@kernel
def _clip(
    frames: Float32Array,
    start: IntArray,
    polygon: IntArray,
    plane: Float32Array,
    pyramid: Float32Array,
    clip: Float32Array,
) -> None:
    """The normals (s, 3) of `Folds.clip`, of all polygons that images see."""
    for image in range(len(start) - 1):
        x, y, z = frames[0, image], frames[1, image], frames[2, image]
        mirror = pyramid[image]
        depth = mirror[12] * x + mirror[13] * y + mirror[14] * z - mirror[15]
        for k in range(start[image], start[image + 1]):
            q = polygon[k]
            side = plane[q, 0] * x + plane[q, 1] * y + plane[q, 2] * z - plane[q, 3]
            sign = np.float32(1.0) if side >= 0.0 else np.float32(-1.0)
            for axis in range(3):
                clip[k, axis] = sign * (side * mirror[12 + axis] - depth * plane[q, axis])

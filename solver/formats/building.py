"""A scene document in the making: whatever a reader finds becomes objects, cameras and warnings here."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from solver.document.conversion import scene_of
from solver.document.fields import MAX_COORDINATE, MAX_FACE_CORNERS, Location
from solver.document.framing import overview
from solver.document.models import (
    CameraDocument,
    MaterialDocument,
    MeshDocument,
    ObjectDocument,
    SceneDocument,
    TransformDocument,
)
from solver.errors import LimitExceededError, SceneError
from solver.formats.polygons import merge_triangles, weld
from solver.formats.shading import Shade
from solver.formats.source import ReadOptions, UpAxis
from solver.geometry.transform import Transform
from solver.types import FloatArray, Points

_LONGEST_NAME: Final = 180
"""Characters of a name, so that there is room for a number after it."""

_TRIANGLES_A_POLYGON: Final = 16
"""Triangles of a file for each polygon that a scene may have, before they are merged."""

_MOST_WARNINGS: Final = 50
_LONGEST_WARNING: Final = 900

_Z_UP: Final = np.array([[1.0, 0, 0, 0], [0, 0, -1.0, 0], [0, 1.0, 0, 0], [0, 0, 0, 1.0]])
"""Turns a scene whose y is up so that its z is."""


@dataclass(frozen=True)
class Imported:
    """A scene out of a file, and what its reader could not keep, which are the scene's notes too."""

    document: SceneDocument
    warnings: tuple[str, ...]


class SceneBuilder:
    """Takes what a reader finds, checks it, and makes the document."""

    def __init__(self, options: ReadOptions, up: UpAxis) -> None:
        """`up` is the axis that is usual for the format."""
        self.options = options
        self.efficacy = options.efficacy
        """lm/W; a reader may set what its file says"""
        self._up = options.up or up
        self._objects: list[ObjectDocument] = []
        self._lamps: set[str] = set()
        self._cameras: dict[str, CameraDocument] = {}
        self._names, self._camera_names = _Names(), _Names()
        self._warnings: dict[str, int] = {}
        self._polygons = self._raw = self._corners = 0
        self._low, self._high = np.full(3, np.inf), np.full(3, -np.inf)

    def warn(self, message: str) -> None:
        """Tell what is not as the file has it; said twice it is told once, with a count."""
        self._warnings[message] = self._warnings.get(message, 0) + 1

    def add(
        self,
        name: str,
        vertices: Points,
        faces: Sequence[Sequence[int]],
        surface: Shade | MaterialDocument,
        where: Location,
        transform: FloatArray | None = None,
        is_lamp: bool = False,
    ) -> None:
        """An object: vertices (n, 3) in the file's units, which `transform` (4, 4) places; found at `where`.

        Lamps that stand for lights without a shape are not merged, nor looked at for the camera.
        Raises SceneError, LimitExceededError.
        """
        self._count_raw(faces)
        self._check(vertices, faces, where)
        points, rings = weld(vertices, faces)
        if self.options.merge and not is_lamp:
            rings = merge_triangles(points, rings)
        if not rings:
            return
        matrix = self._matrix(transform, where)
        if matrix is None:
            self.warn(f"{_plain(name)!r} is left out: its transform flattens it")
            return
        self._count(points, rings)
        if isinstance(surface, Shade):
            for message in surface.out_of_bounds:
                self.warn(message)
            surface = surface.document()
        chosen = self._names.unique(name, "object")
        self._objects.append(
            ObjectDocument(
                id=chosen,
                mesh=MeshDocument(vertices=points.tolist(), faces=[list(ring) for ring in rings]),
                material=surface,
                transform=TransformDocument(matrix=matrix.ravel().tolist())
                if not np.array_equal(matrix, np.eye(4))
                else TransformDocument(),
            )
        )
        if is_lamp:
            self._lamps.add(chosen)
        else:
            world = points @ matrix[:3, :3].T + matrix[:3, 3]
            self._low, self._high = (
                np.minimum(self._low, world.min(axis=0)),
                np.maximum(self._high, world.max(axis=0)),
            )

    def add_camera(self, name: str, camera: CameraDocument) -> None:
        """A camera in metres; the first is `main` if it has no name."""
        chosen = self._camera_names.unique(name, "camera" if self._cameras else "main")
        self._cameras[chosen] = camera

    @property
    def middle(self) -> Points:
        """(3,) metres, the middle of what has been added so far."""
        return np.zeros(3) if np.isinf(self._low).any() else 0.5 * (self._low + self._high)

    @property
    def size(self) -> float:
        """Metres, the diagonal of what has been added so far; 1 where that is nothing."""
        size = 0.0 if np.isinf(self._low).any() else float(np.linalg.norm(self._high - self._low))
        return size if size > 0.0 else 1.0

    def finish(self, name: str) -> Imported:
        """The scene under that name. Raises SceneError where nothing was found."""
        if not self._objects:
            raise SceneError("there is no surface in it")
        document = SceneDocument(
            name=_plain(name), luminous_efficacy=self.efficacy, objects=self._objects, cameras=self._cameras
        )
        if not self._cameras and (self._lamps or self._up is UpAxis.Y):
            document = document.model_copy(update={"cameras": {"main": self._overview(document)}})
        told = [text if n == 1 else f"{text} ({n} times)" for text, n in self._warnings.items()]
        if len(told) > _MOST_WARNINGS:
            told[_MOST_WARNINGS:] = [f"and {len(told) - _MOST_WARNINGS} more"]
        notes = [text[0].upper() + text[1:_LONGEST_WARNING] + "." for text in told]
        return Imported(document.model_copy(update={"notes": notes}) if notes else document, tuple(notes))

    def _overview(self, document: SceneDocument) -> CameraDocument:
        """A camera that sees the surfaces, but need not see lamps, which may be far away."""
        seen = [o for o in document.objects if o.id not in self._lamps] or document.objects
        scene = scene_of(document.model_copy(update={"objects": seen}))
        turn = _Z_UP if self._up is UpAxis.Y else np.eye(4)
        turned = {o.id: replace(o, transform=Transform(turn @ o.transform.matrix)) for o in scene}
        camera = CameraDocument()
        aspect = camera.width / camera.height
        eye, target = overview(replace(scene, objects=turned), camera.vertical_fov, aspect)
        back = turn[:3, :3].T
        up = [0.0, 1.0, 0.0] if self._up is UpAxis.Y else [0.0, 0.0, 1.0]
        ahead = back @ (target - eye)
        if abs(ahead @ np.array(up)) > 0.999 * float(np.linalg.norm(ahead)):
            up = [0.0, 0.0, -1.0] if self._up is UpAxis.Y else [0.0, 1.0, 0.0]
        return CameraDocument(eye=(back @ eye).tolist(), target=(back @ target).tolist(), up=up)

    def _matrix(self, transform: FloatArray | None, where: Location) -> FloatArray | None:
        """Where an object goes, the file's units included; None where that has no inverse."""
        matrix = np.eye(4) if transform is None else np.array(transform, dtype=np.float64)
        scaled = np.diag([self.options.scale] * 3 + [1.0]) @ matrix
        scaled[3] = [0.0, 0.0, 0.0, 1.0]
        if not np.isfinite(scaled).all() or np.abs(scaled).max() > MAX_COORDINATE:
            raise SceneError(f"the transform takes vertices beyond {MAX_COORDINATE:g} m", where)
        rows = np.linalg.norm(scaled[:3, :3], axis=1)
        flat = not rows.all() or abs(float(np.linalg.det(scaled[:3, :3] / rows[:, None]))) <= 1e-11
        return None if flat else scaled

    def _check(self, vertices: Points, faces: Sequence[Sequence[int]], where: Location) -> None:
        if not np.isfinite(vertices).all():
            row = int(np.flatnonzero(~np.isfinite(vertices).all(axis=1))[0])
            raise SceneError(f"vertex {row} is not a place: its coordinates are not finite", where)
        if np.abs(vertices).max(initial=0.0) > MAX_COORDINATE:
            raise SceneError(f"vertices lie beyond {MAX_COORDINATE:g} m", where)
        longest = max(map(len, faces), default=0)
        if longest > MAX_FACE_CORNERS:
            raise SceneError(f"a face of {longest} corners; {MAX_FACE_CORNERS} are allowed", where)

    def _count_raw(self, faces: Sequence[Sequence[int]]) -> None:
        self._raw += len(faces)
        most = _TRIANGLES_A_POLYGON * self.options.limits.max_polygons
        if self._raw > most:
            raise LimitExceededError("triangles", self._raw, most)

    def _count(self, points: Points, rings: Sequence[Sequence[int]]) -> None:
        limits = self.options.limits
        self._polygons += len(rings)
        self._corners += max(len(points), sum(map(len, rings)))
        if self._polygons > limits.max_polygons:
            raise LimitExceededError("polygons", self._polygons, limits.max_polygons)
        if self._corners > limits.max_vertices:
            raise LimitExceededError("vertices", self._corners, limits.max_vertices)


class _Names:
    """Names that are in use."""

    def __init__(self) -> None:
        self._used: set[str] = set()
        self._last: dict[str, int] = {}

    def unique(self, name: str, otherwise: str) -> str:
        """`name`, or `otherwise` if it is empty, with a number after it where that is in use."""
        plain = _plain(name) or otherwise
        chosen, number = plain, self._last.get(plain, 1)
        while chosen in self._used:
            number += 1
            chosen = f"{plain}.{number}"
        self._last[plain] = number
        self._used.add(chosen)
        return chosen


def _plain(name: str) -> str:
    """A name that can be written anywhere."""
    text = name.encode("utf-8", "replace").decode("utf-8")
    return "".join(c if c.isprintable() else " " for c in text).strip()[:_LONGEST_NAME]

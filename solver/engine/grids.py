"""Grids of points at which light is measured: on the faces of an object, or in a plane anywhere."""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.engine.status import ProbeResult
from solver.errors import LimitExceededError, SceneError, UnknownObjectError
from solver.geometry.faces import newell_normal
from solver.geometry.scene import Scene
from solver.types import BoolArray, FloatArray, IntArray, Points, Vector

Triple = tuple[float, float, float]

_HEAD: Final = "face,x,y,z,nx,ny,nz,lux,irradiance_r,irradiance_g,irradiance_b,error_estimate"
_ROOM: Final = 16
"""Places that are looked at for each point that may be measured: faces do not fill their rectangles."""


@dataclass(frozen=True)
class GridRequest:
    """Where to measure: on an object, or in the parallelogram of `origin`, `u` and `v`."""

    spacing: float
    """Metres between neighbours, at most"""
    object: str | None = None
    face: int | None = None
    """Of the object; None: all"""
    origin: Triple | None = None
    u: Triple | None = None
    """A side; u x v is the direction that is measured"""
    v: Triple | None = None
    offset: float = 0.0
    """Metres off the plane, along its normal"""
    back: bool = False
    """Whether the other side is meant"""
    most: int = 10_000
    """Points"""


@dataclass(frozen=True, eq=False)
class Grid:
    """n points."""

    positions: Points
    """(n, 3) metres"""
    normals: FloatArray
    """(n, 3)"""
    face: IntArray
    """(n,) -1 in a plane that is no object's"""


def grid_of(scene: Scene, request: GridRequest) -> Grid:
    """The points of a grid: the middles of even cells, of those whose middles lie on the face.

    Raises SceneError naming the field of the request, LimitExceededError.
    """
    parts: list[tuple[Points, Vector, int]] = []
    room = _ROOM * request.most
    for number, polygon in _polygons(scene, request):
        normal = newell_normal(polygon[None])[0]
        length = float(np.linalg.norm(normal))
        if length <= 0.0:
            continue
        normal /= length
        cells, inside = _cells(polygon, normal, request.spacing, room)
        room -= len(cells)
        side = -normal if request.back else normal
        parts.append((cells[inside] + request.offset * side, side, number))
    count = sum(len(places) for places, _, _ in parts)
    if count > request.most:
        raise LimitExceededError("points", count, request.most)
    return Grid(
        positions=np.concatenate([np.empty((0, 3)), *(places for places, _, _ in parts)]),
        normals=np.concatenate(
            [np.empty((0, 3)), *(np.tile(side, (len(places), 1)) for places, side, _ in parts)]
        ),
        face=np.repeat(
            np.array([number for _, _, number in parts], dtype=np.int32),
            [len(places) for places, _, _ in parts],
        ),
    )


def csv_of(grid: Grid, result: ProbeResult) -> bytes:
    """A line for each point, after one that names the columns; lux and W/m2."""
    table = np.column_stack(
        [
            grid.face, grid.positions, grid.normals, result.illuminance, result.irradiance,
            result.error_estimate,
        ]
    )  # fmt: skip
    file = io.StringIO()
    np.savetxt(file, table + 0.0, fmt=["%d"] + ["%.9g"] * 11, delimiter=",", header=_HEAD, comments="")
    return file.getvalue().encode()


def _polygons(scene: Scene, request: GridRequest) -> list[tuple[int, Points]]:
    """Faces (k, 3) in the world, by their numbers."""
    if request.object is None:
        return [(-1, _parallelogram(request))]
    if any(given is not None for given in (request.origin, request.u, request.v)):
        raise SceneError("give either an object, or origin, u and v", ("origin",))
    if request.object not in scene.objects:
        raise UnknownObjectError(request.object, ("object",))
    source = scene.object(request.object)
    faces = source.mesh.faces
    if request.face is not None:
        if request.face >= len(faces):
            raise SceneError(f"there is no face {request.face}: the object has {len(faces)}", ("face",))
        faces = (faces[request.face],)
    turn = -1 if source.transform.mirrors else 1
    first = request.face or 0
    return [(first + k, source.world_vertices[list(face[::turn])]) for k, face in enumerate(faces)]


def _parallelogram(request: GridRequest) -> Points:
    """(4, 3) corners."""
    if request.face is not None:
        raise SceneError("a face is an object's", ("face",))
    for name, given in (("origin", request.origin), ("u", request.u), ("v", request.v)):
        if given is None:
            raise SceneError("give an object, or origin, u and v", (name,))
    origin, u, v = np.array(request.origin), np.array(request.u), np.array(request.v)
    area = float(np.linalg.norm(np.cross(u, v)))
    if not area > 1e-12 * float(np.linalg.norm(u)) * float(np.linalg.norm(v)):
        raise SceneError("u and v span no plane", ("v",))
    return np.stack([origin, origin + u, origin + u + v, origin + v])


def _cells(polygon: Points, normal: Vector, spacing: float, room: int) -> tuple[Points, BoolArray]:
    """Middles (n, 3) of the cells of a polygon's rectangle along its first side, and which lie on it."""
    u = polygon[1] - polygon[0]
    if not u.any():
        u = polygon[2] - polygon[0]
    u = u - (u @ normal) * normal
    u /= np.linalg.norm(u)
    axes = np.stack([u, np.cross(normal, u)])
    flat = (polygon - polygon[0]) @ axes.T
    low, extent = flat.min(axis=0), np.ptp(flat, axis=0)
    counts = np.maximum(1.0, np.ceil(extent / spacing - 1e-9))
    if not float(counts[0]) * float(counts[1]) <= room:
        raise LimitExceededError("points", float(counts[0]) * float(counts[1]), room)
    steps = [low[k] + extent[k] * (np.arange(int(counts[k])) + 0.5) / counts[k] for k in range(2)]
    x, y = (part.ravel() for part in np.meshgrid(*steps))
    return polygon[0] + np.stack([x, y], axis=1) @ axes, _is_inside(flat, x, y)


def _is_inside(polygon: FloatArray, x: FloatArray, y: FloatArray) -> BoolArray:
    """(n,) whether places lie in a polygon (k, 2): whether an odd number of its sides is to the right."""
    inside = np.zeros(len(x), dtype=np.bool_)
    for (ax, ay), (bx, by) in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        if ay != by:
            inside ^= ((ay > y) != (by > y)) & (x < ax + (y - ay) * ((bx - ax) / (by - ay)))
    return inside

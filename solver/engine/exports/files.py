"""A session as a file: its scene, or what the solution holds, in the formats of other programs."""

from __future__ import annotations

import io
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Final

import numpy as np

from solver.document.conversion import document_of
from solver.engine.exports.elements import elements_of
from solver.engine.solution import Solution
from solver.engine.world import World
from solver.formats.gltf.buffers import UNLIT
from solver.formats.gltf.writer import SceneWriter, scene_glb
from solver.formats.vtu import vtu_of
from solver.rendering.tessellation import Tessellator
from solver.types import BoolArray, FloatArray

_WHITE_SHARE: Final = 0.999
"""Share of what reflects that is not brighter than white."""


class ExportFormat(StrEnum):
    """The files that a session can be had as."""

    GLB = "glb"
    """Binary glTF"""
    NPZ = "npz"
    """The elements, as arrays of numpy"""
    VTU = "vtu"
    """The elements, for ParaView"""
    JSON = "json"
    """The scene document"""


class Shading(StrEnum):
    """What the surfaces of glTF show."""

    LIGHT = "light"
    """The solution, as colours of vertices that need no light"""
    MATERIALS = "materials"
    """What they are made of, for programs that light them by themselves"""


@dataclass(frozen=True)
class ExportRequest:
    """What is wanted."""

    format: ExportFormat
    shading: Shading = Shading.LIGHT


@dataclass(frozen=True)
class Export:
    """A file, and what is to be told of it."""

    content: bytes
    revision: int
    error_estimate: float
    """Of the light, relative"""
    converged: bool


def encode_export(request: ExportRequest, revision: int, world: World, solution: Solution) -> bytes:
    """The file of a session as it stands."""
    match request.format:
        case ExportFormat.JSON:
            return document_of(world.scene).model_dump_json(exclude_unset=True).encode()
        case ExportFormat.NPZ:
            return _npz(revision, world, solution)
        case ExportFormat.VTU:
            return _vtu(revision, world, solution)
        case ExportFormat.GLB if request.shading is Shading.MATERIALS:
            return scene_glb(world.scene, {"revision": revision})
        case ExportFormat.GLB:
            return _lit_glb(revision, world, solution)


def _npz(revision: int, world: World, solution: Solution) -> bytes:
    file = io.BytesIO()
    np.savez_compressed(
        file,
        **asdict(elements_of(world, solution)),
        object_ids=np.array(world.surfaces.object_ids, dtype=np.str_),
        revision=np.int64(revision),
        error_estimate=np.float64(solution.error_estimate),
        luminous_efficacy=np.float64(world.scene.luminous_efficacy),
    )
    return file.getvalue()


def _vtu(revision: int, world: World, solution: Solution) -> bytes:
    elements = elements_of(world, solution)
    return vtu_of(
        elements.corners,
        elements.corner_count,
        cells={
            "radiosity": elements.radiosity,
            "irradiance": elements.irradiance,
            "illuminance": elements.illuminance,
            "area": elements.area,
            "patch": elements.patch,
            "object": elements.object,
            "face": elements.face,
            "side": elements.side,
        },
        points={"radiosity": elements.corner_radiosity, "irradiance": elements.corner_irradiance},
        facts={
            "revision": np.array([revision], dtype=np.int64),
            "error_estimate": np.array([solution.error_estimate]),
            "luminous_efficacy": np.array([world.scene.luminous_efficacy]),
        },
    )


def _lit_glb(revision: int, world: World, solution: Solution) -> bytes:
    """What the renderer gouraud draws: elements without cracks, with the light at their corners."""
    surfaces, scene = world.surfaces, world.scene
    mesh = Tessellator(surfaces).mesh(solution.field())
    position = surfaces.center + surfaces.size * mesh.position.astype(np.float64)
    radiance = mesh.radiance.astype(np.float64)
    white = _white(radiance, np.asarray(surfaces.emission.any(axis=1))[mesh.patch])
    facts = {
        "revision": revision,
        "error_estimate": solution.error_estimate,
        "white_radiance": white,
        "luminous_efficacy": scene.luminous_efficacy,
        "units": {"length": "m", "radiance": "W/(m2 sr) = colour of vertex, linear, times white"},
    }
    writer = SceneWriter(scene.name, facts)
    # The back of a two-sided face is a surface of its own, with light of its own.
    patch = mesh.patch[mesh.triangles[:, 0]]
    for number, object_id in enumerate(surfaces.object_ids):
        of_object = surfaces.object[patch] == number
        for side, title in ((0, object_id), (1, f"{object_id} back")):
            chosen = mesh.triangles[of_object & (surfaces.side[patch] == side)]
            if len(chosen) == 0:
                continue
            used, indices = np.unique(chosen, return_inverse=True)
            material = writer.unlit(title, scene.object(object_id).material, UNLIT, is_back=side == 1)
            writer.add(
                title,
                position[used],
                indices.ravel().astype(np.int32),
                material,
                None,
                is_polygonal=False,
                colours=radiance[used] / white,
            )
    for name, camera in scene.cameras.items():
        writer.camera(name, camera)
    return writer.file()


def _white(radiance: FloatArray, emits: BoolArray) -> float:
    """W/(m2 sr) that are shown white: nearly the largest of what reflects; of lamps, where nothing does."""
    shown = radiance[~emits] if (~emits).any() and radiance[~emits].any() else radiance
    brightest = float(np.quantile(shown.max(axis=1), _WHITE_SHARE)) if len(shown) else 0.0
    return brightest if brightest > 0.0 else 1.0

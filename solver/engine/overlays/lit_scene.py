"""A scene with its lightmap as a binary glTF 2.0 file, which shows its diffuse light wherever glTF is shown.

Each object is a node. TEXCOORD_1 are places in the lightmap, a PNG in the file; TEXCOORD_0, which glTF wants
to be there too, are places in the plane of a face, in metres. Materials need no light: what is seen is the
lightmap times the reflectance, and emitters in the colour of what they emit.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import pygltflib as gltf

from solver.formats.gltf.buffers import UNLIT, Buffers
from solver.geometry.surfaces import Surfaces
from solver.illumination.lightmaps.atlas import Atlas
from solver.types import FloatArray, IntArray

LIGHTMAP_SET: Final = 1
"""The set of texture coordinates that the lightmap goes by."""


def lit_scene_glb(
    surfaces: Surfaces, atlas: Atlas, picture: bytes, white: float, name: str, extras: Mapping[str, object]
) -> bytes:
    """The file; `picture` is the PNG in which `white` W/m2 of irradiance are white.

    `extras` go to the scene's. Without surfaces the file has no node.
    """
    buffers = Buffers()
    nodes: list[Any] = []
    meshes: list[Any] = []
    materials: list[Any] = []
    order = np.argsort(surfaces.object, kind="stable").astype(np.int32)
    bounds = np.searchsorted(surfaces.object[order], np.arange(len(surfaces.object_ids) + 1))
    for number, object_id in enumerate(surfaces.object_ids):
        patch = order[bounds[number] : bounds[number + 1]]
        if len(patch) == 0:
            continue
        primitive = _primitive(buffers, surfaces, atlas, patch)
        primitive.material = len(materials)
        nodes.append(gltf.Node(name=object_id, mesh=len(meshes)))
        meshes.append(gltf.Mesh(name=object_id, primitives=[primitive]))
        first = patch[0]
        materials.append(_material(object_id, surfaces.reflectance[first], surfaces.emission[first], white))
    made = gltf.GLTF2(
        asset=gltf.Asset(version="2.0", generator="halflight"),
        scene=0,
        scenes=[gltf.Scene(name=name, nodes=list(range(len(nodes))), extras=dict(extras))],
    )
    if nodes:
        made.nodes, made.meshes, made.materials = nodes, meshes, materials
        made.extensionsUsed = [UNLIT]
        made.images = [gltf.Image(name="lightmap", mimeType="image/png", bufferView=buffers.view(picture))]
        edge = gltf.CLAMP_TO_EDGE
        made.samplers = [gltf.Sampler(magFilter=gltf.LINEAR, minFilter=gltf.LINEAR, wrapS=edge, wrapT=edge)]
        made.textures = [gltf.Texture(sampler=0, source=0)]
        buffers.put_into(made)
    return b"".join(made.save_to_bytes())


def _primitive(buffers: Buffers, surfaces: Surfaces, atlas: Atlas, patch: IntArray) -> Any:
    """The triangles of some patches, each with corners of its own."""
    count = surfaces.corner_count[patch]
    corners = surfaces.corners[patch]
    there = np.arange(4) < count[:, None]
    first = np.cumsum(count) - count
    pieces = first[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])
    indices = pieces[np.arange(2) < (count - 2)[:, None]].ravel()

    def floats(values: FloatArray, kind: str) -> int:
        return buffers.array(np.ascontiguousarray(values, dtype="<f4"), gltf.FLOAT, kind)

    return gltf.Primitive(
        attributes=gltf.Attributes(
            POSITION=buffers.positions(corners[there]),
            NORMAL=floats(np.repeat(surfaces.normal[patch], count, axis=0), "VEC3"),
            TEXCOORD_0=floats(atlas.charts.places(corners, patch)[there], "VEC2"),
            TEXCOORD_1=floats(atlas.coordinates(corners, patch)[there], "VEC2"),
        ),
        indices=buffers.array(indices.astype("<u4"), gltf.UNSIGNED_INT, "SCALAR", gltf.ELEMENT_ARRAY_BUFFER),
        mode=gltf.TRIANGLES,
    )


def _material(name: str, reflectance: FloatArray, emission: FloatArray, white: float) -> Any:
    """Reflectance times the lightmap; of an emitter, what it emits by the same measure, up to white."""
    emits = bool(emission.any())
    colour = np.minimum(emission / white, 1.0) if emits else reflectance
    return gltf.Material(
        name=name,
        alphaCutoff=None,
        extensions={UNLIT: {}},
        pbrMetallicRoughness=gltf.PbrMetallicRoughness(
            baseColorFactor=[*colour.tolist(), 1.0],
            metallicFactor=0.0,
            baseColorTexture=None if emits else gltf.TextureInfo(index=0, texCoord=LIGHTMAP_SET),
        ),
        extras={"reflectance": reflectance.tolist(), "emission": emission.tolist()},
    )

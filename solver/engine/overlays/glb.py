"""Shapes as a binary glTF 2.0 file: metres, the scene's own axes, colours of vertices, no light needed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import pygltflib as gltf

from solver.engine.overlays.shapes import Primitives, Shapes
from solver.formats.gltf.buffers import UNLIT, Buffers

_BYTE: Final = 255.0


def glb_of(shapes: Shapes, name: str, extras: Mapping[str, object]) -> bytes:
    """The file: one node `name` whose mesh has a primitive for each kind of shape that there is.

    `extras` go to the scene's. Without shapes the file has no node.
    """
    builder = _Builder()
    for mode, figures in (
        (gltf.POINTS, shapes.points),
        (gltf.LINES, shapes.lines),
        (gltf.TRIANGLES, shapes.triangles),
    ):
        if len(figures):
            builder.add(mode, figures)
    return builder.file(name, extras)


class _Builder:
    """A file in the making."""

    def __init__(self) -> None:
        self._buffers = Buffers()
        self._primitives: list[Any] = []

    def add(self, mode: int, figures: Primitives) -> None:
        """Add a primitive."""
        k = figures.position.shape[1]
        position = figures.position.reshape(-1, 3)
        colour = np.full((len(position), 4), _BYTE, dtype=np.uint8)
        colour[:, :3] = np.repeat(np.rint(_BYTE * figures.colour.clip(0.0, 1.0)), k, axis=0)
        at = self._buffers.positions(position)
        coloured = self._buffers.array(colour, gltf.UNSIGNED_BYTE, "VEC4", normalized=True)
        self._primitives.append(
            gltf.Primitive(attributes=gltf.Attributes(POSITION=at, COLOR_0=coloured), mode=mode, material=0)
        )

    def file(self, name: str, extras: Mapping[str, object]) -> bytes:
        """The bytes of the file."""
        made = gltf.GLTF2(
            asset=gltf.Asset(version="2.0", generator="halflight"),
            scene=0,
            scenes=[gltf.Scene(name=name, nodes=[0] if self._primitives else [], extras=dict(extras))],
        )
        if self._primitives:
            made.nodes = [gltf.Node(name=name, mesh=0)]
            made.meshes = [gltf.Mesh(name=name, primitives=self._primitives)]
            made.materials = [gltf.Material(doubleSided=True, alphaCutoff=None, extensions={UNLIT: {}})]
            made.extensionsUsed = [UNLIT]
            self._buffers.put_into(made)
        return b"".join(made.save_to_bytes())

"""Frames of a mesh: radiance, irradiance and the layers that geometry alone gives."""

from __future__ import annotations

from enum import StrEnum

import numpy as np

from solver.geometry.scene import Camera
from solver.rendering import geometry_layers
from solver.rendering.device import GlDevice
from solver.rendering.gpu_mesh import GpuMesh
from solver.rendering.layers import Layer
from solver.rendering.passes import AccumulationPass, FlatPass, GouraudPass, IdentityPass, Viewpoint
from solver.rendering.projection import Projection, pixel_pattern
from solver.rendering.targets import Pixel, Target, Targets, require_drawable
from solver.rendering.tessellation import RenderMesh
from solver.types import LUMINANCE_WEIGHTS, AnyArray, Float32Array, IntArray

__all__ = ["FrameRenderer", "Layer", "Shading"]


class Shading(StrEnum):
    """How light varies over a leaf."""

    FLAT = "flat"
    """Not at all: each leaf has its mean"""
    GOURAUD = "gouraud"
    """Linearly over triangles, from values at the corners of leaves"""


class FrameRenderer:
    """Draws meshes with one device, in the thread that owns it."""

    def __init__(self, device: GlDevice) -> None:
        """Compile the shaders. Raises DeviceUseError."""
        self._device = device
        with device.current() as context:
            self._gouraud = GouraudPass(context)
            self._flat = FlatPass(context)
            self._identity = IdentityPass(context)
            self._accumulation = AccumulationPass(context)
        self._targets = Targets(device)
        self._scene: GpuMesh | None = None

    def draw(
        self, mesh: RenderMesh, camera: Camera, shading: Shading, layer: Layer, samples: int = 1
    ) -> AnyArray:
        """A frame of `mesh` seen by `camera`, top row first.

        radiance (h, w, 3) float32 W/(m2 sr), irradiance (h, w, 3) float32 and illuminance (h, w) float32
        W/m2: 0 where nothing is seen or only the black back of a face, the mean of `samples` points of each
        pixel. The other layers take the pixel's centre: depth (h, w) float32 metres along the viewing
        direction, infinite where nothing is seen; position (h, w, 3) float64 metres, NaN; normal (h, w, 3)
        float32, 0; object (h, w) int32 and element (h, w) int32, -1. Backs have the normal of their front.

        The mesh stays on the device for as long as the same object is drawn. Raises LimitExceededError or
        SceneError naming width, height or samples, DeviceUseError, and MemoryError.
        """
        require_drawable(camera, samples, self._device)
        with self._device.current() as context:
            self._device.entry_points.keep_depth()
            if self._scene is None or self._scene.mesh is not mesh:
                if self._scene is not None:
                    self._scene.release()
                self._scene = GpuMesh(context, mesh)
            match layer:
                case Layer.RADIANCE | Layer.IRRADIANCE:
                    return self._draw_light(self._scene, camera, shading, layer, samples)
                case Layer.ILLUMINANCE:
                    irradiance = self._draw_light(self._scene, camera, shading, Layer.IRRADIANCE, samples)
                    return irradiance @ LUMINANCE_WEIGHTS.astype(np.float32)
                case Layer.DEPTH | Layer.POSITION | Layer.NORMAL | Layer.OBJECT | Layer.ELEMENT:
                    return _geometry(self._draw_identity(self._scene, camera), mesh, camera, layer)

    def release(self) -> None:
        """Give back all that it holds of the device. Raises DeviceUseError."""
        with self._device.current():
            self._targets.release()
            if self._scene is not None:
                self._scene.release()
                self._scene = None
            for made in (self._gouraud, self._flat, self._identity, self._accumulation):
                made.release()

    def _draw_light(
        self, scene: GpuMesh, camera: Camera, shading: Shading, layer: Layer, samples: int
    ) -> Float32Array:
        mesh = scene.mesh
        is_radiance = layer is Layer.RADIANCE
        painter: FlatPass | GouraudPass
        if shading is Shading.FLAT:
            painter, name = self._flat, f"leaf {layer}"
            values = mesh.leaf_radiance if is_radiance else mesh.leaf_irradiance
        else:
            painter, name = self._gouraud, f"vertex {layer}"
            values = mesh.radiance if is_radiance else mesh.irradiance
        size = (camera.width, camera.height)
        projection = Projection.of(camera, mesh.surfaces)
        frame = self._targets.get(size, Pixel.COLOUR)
        if samples == 1:
            painter.draw(scene, Viewpoint(camera.eye, projection), frame, name, values)
            return _read_colours(frame)
        total = self._targets.get(size, Pixel.COLOUR, has_depth=False)
        total.framebuffer.clear()
        for right, down in pixel_pattern(samples).tolist():
            # The picture moves against the point that is sampled.
            jitter = (-2.0 * right / camera.width, -2.0 * down / camera.height)
            painter.draw(scene, Viewpoint(camera.eye, projection, jitter), frame, name, values)
            self._accumulation.add(frame, 1.0 / samples, total)
        return _read_colours(total)

    def _draw_identity(self, scene: GpuMesh, camera: Camera) -> IntArray:
        """Triangle that each pixel shows, (h, w), or -1."""
        target = self._targets.get((camera.width, camera.height), Pixel.IDENTITY)
        self._identity.draw(scene, Viewpoint(camera.eye, Projection.of(camera, scene.mesh.surfaces)), target)
        shown = np.empty((camera.height, camera.width), dtype=np.uint32)
        target.framebuffer.read_into(shown, components=1, dtype=Pixel.IDENTITY.value, alignment=4)
        return (shown - np.uint32(1)).view(np.int32)


def _geometry(identity: IntArray, mesh: RenderMesh, camera: Camera, layer: Layer) -> AnyArray:
    match layer:
        case Layer.DEPTH:
            return geometry_layers.depths(identity, mesh, camera).astype(np.float32)
        case Layer.POSITION:
            return geometry_layers.positions(identity, mesh, camera)
        case Layer.NORMAL:
            return geometry_layers.normals(identity, mesh)
        case Layer.OBJECT:
            return geometry_layers.object_ids(identity, mesh)
        case _:
            return geometry_layers.leaf_ids(identity, mesh)


def _read_colours(target: Target) -> Float32Array:
    """(h, w, 3) of a target, whose rows run downwards."""
    width, height = target.size
    pixels = np.empty((height, width, 3), dtype=np.float32)
    target.framebuffer.read_into(pixels, components=3, dtype=Pixel.COLOUR.value, alignment=4)
    return pixels

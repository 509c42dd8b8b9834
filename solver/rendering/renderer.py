"""Frames of a mesh: radiance, irradiance and the layers that geometry alone gives."""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum
from typing import TypeAlias

import numpy as np

from solver.errors import SceneError
from solver.geometry.scene import Camera
from solver.illumination.interpolation.mesh import InterpolantMesh
from solver.rendering import geometry_layers
from solver.rendering.device import GlDevice
from solver.rendering.false_colour import false_colour
from solver.rendering.gpu_mesh import GpuMesh
from solver.rendering.interpolant_pass import InterpolantPass
from solver.rendering.layers import Layer
from solver.rendering.meshes import DrawnMesh, NotInMeshError
from solver.rendering.passes import BACK, AccumulationPass, FlatPass, GouraudPass, IdentityPass, Viewpoint
from solver.rendering.picking import Pick
from solver.rendering.projection import Projection, pixel_pattern
from solver.rendering.surface_points import SurfacePoints, surface_points
from solver.rendering.targets import Pixel, Target, Targets, require_drawable
from solver.types import LUMINANCE_WEIGHTS, AnyArray, BoolArray, Float32Array, IntArray

__all__ = ["FrameRenderer", "Layer", "Meanwhile", "Shading", "needs_interpolants"]


class Shading(StrEnum):
    """How light varies over a leaf."""

    FLAT = "flat"
    """Not at all: each leaf has its mean"""
    GOURAUD = "gouraud"
    """Linearly over triangles, from values at the corners of leaves; over a mesh of interpolants from those
    of each triangle's own, so that it breaks where light does ([H B.3.2])"""
    INTERPOLANT = "interpolant"
    """Quadratically over triangles ([H 3.4])"""


def needs_interpolants(shading: Shading, layer: Layer) -> bool:
    """Whether only a mesh of interpolants has such a frame."""
    return shading is Shading.INTERPOLANT or layer is Layer.ERROR


Meanwhile: TypeAlias = Callable[[], object]
"""What is done while a device draws, which software does on all cores, too, but not all of the time."""

_Painter: TypeAlias = Callable[[Viewpoint, Target], None]
"""Draws what a viewpoint sees into a target of colours."""


class FrameRenderer:
    """Draws meshes with one device, in the thread that owns it."""

    def __init__(self, device: GlDevice) -> None:
        """Compile the shaders. Raises DeviceUseError."""
        self._device = device
        with device.current() as context:
            self._gouraud = GouraudPass(context)
            self._flat = FlatPass(context)
            self._identity = IdentityPass(context)
            self._interpolant = InterpolantPass(context)
            self._accumulation = AccumulationPass(context)
        self._targets = Targets(device)
        self._scene: GpuMesh | None = None

    @property
    def uploaded(self) -> int:
        """Bytes of meshes written to the device so far."""
        return 0 if self._scene is None else self._scene.uploaded

    def draw(
        self,
        mesh: DrawnMesh,
        camera: Camera,
        shading: Shading,
        layer: Layer,
        samples: int = 1,
        meanwhile: Meanwhile | None = None,
    ) -> AnyArray:
        """A frame of `mesh` seen by `camera`, top row first.

        radiance (h, w, 3) float32 W/(m2 sr), irradiance (h, w, 3) float32 and illuminance (h, w) float32
        W/m2: 0 where nothing is seen or only the black back of a face, the mean of `samples` points of each
        pixel; false_colour (h, w, 3) float32 sRGB shows this illuminance on a scale of its own. The other
        layers take the pixel's centre: depth (h, w) float32 metres along the viewing direction, infinite
        where nothing is seen; position (h, w, 3) float64 metres, NaN; normal (h, w, 3) float32, 0; object,
        element and triangle (h, w) int32, -1; barycentric (h, w, 3) float32, 0; error (h, w) float32 W/m2, 0.
        Backs have the normal of their front, and no error.

        `meanwhile` is called while the device draws light, once it has all that it needs. What is uploaded
        stays there for as long as the same arrays are drawn. Raises NotInMeshError,
        LimitExceededError or SceneError naming width, height or samples, DeviceUseError, and MemoryError.
        """
        require_drawable(camera, samples, self._device)
        if needs_interpolants(shading, layer) and not isinstance(mesh, InterpolantMesh):
            raise NotInMeshError(layer if layer is Layer.ERROR else shading)
        with self._device.current():
            scene = self._hold(mesh)
            match layer:
                case Layer.RADIANCE | Layer.IRRADIANCE:
                    return self._draw_light(scene, camera, shading, layer, samples, meanwhile)
                case Layer.ILLUMINANCE | Layer.FALSE_COLOUR:
                    irradiance = self._draw_light(
                        scene, camera, shading, Layer.IRRADIANCE, samples, meanwhile
                    )
                    illuminance = irradiance @ LUMINANCE_WEIGHTS.astype(np.float32)
                    return illuminance if layer is Layer.ILLUMINANCE else false_colour(illuminance)
                case Layer.ERROR if isinstance(mesh, InterpolantMesh):
                    shown, is_back = self._draw_identity(scene, *_middles(mesh, camera))
                    return geometry_layers.errors(np.where(is_back, np.int32(-1), shown), mesh)
                case _:
                    shown, _ = self._draw_identity(scene, *_middles(mesh, camera))
                    return _geometry(shown, mesh, camera, layer)

    def surface_points(
        self, mesh: DrawnMesh, camera: Camera, offset: tuple[float, float] = (0.0, 0.0)
    ) -> SurfacePoints:
        """The points on fronts of patches that pixels of `camera` show.

        `offset` is how far right and down of a pixel's centre its point lies, in pixels. Raises as `draw`.
        """
        require_drawable(camera, 1, self._device)
        size = (camera.width, camera.height)
        jitter = (-2.0 * offset[0] / camera.width, -2.0 * offset[1] / camera.height)
        projection = Projection.of(camera, mesh.surfaces)
        with self._device.current():
            shown, is_back = self._draw_identity(
                self._hold(mesh), Viewpoint(camera.eye, projection, jitter), size
            )
        patch = geometry_layers.patches(np.where(is_back, np.int32(-1), shown), mesh)
        return surface_points(patch, mesh.surfaces, projection.eye, projection.rays(size, jitter))

    def pick(self, mesh: DrawnMesh, camera: Camera, x: int, y: int) -> Pick | None:
        """What the pixel in column `x` and row `y` shows, both counted from the top left; None for nothing.

        Raises SceneError naming x or y for a pixel outside the frame, and as `draw`.
        """
        require_drawable(camera, 1, self._device)
        for name, at, length in (("x", x, camera.width), ("y", y, camera.height)):
            if not 0 <= at < length:
                raise SceneError(f"a pixel of this frame is in 0 to {length - 1}", (name,))
        with self._device.current():
            shown, _ = self._draw_identity(self._hold(mesh), *_middles(mesh, camera), (x, y, 1, 1))
        triangle = int(shown[0, 0])
        if triangle < 0:
            return None
        surfaces = mesh.surfaces
        patch = int(geometry_layers.patches(shown, mesh)[0, 0])
        return Pick(
            triangle=triangle,
            barycentric=geometry_layers.barycentrics(shown, mesh, camera, (y, x))[0, 0],
            position=geometry_layers.positions(shown, mesh, camera, (y, x))[0, 0],
            normal=surfaces.normal[patch].copy(),
            patch=patch,
            face=int(surfaces.face[patch]),
            object_id=surfaces.object_ids[surfaces.object[patch]],
            leaf=int(mesh.leaf[triangle]),
        )

    def release(self) -> None:
        """Give back all that it holds of the device. Raises DeviceUseError."""
        with self._device.current():
            self._targets.release()
            if self._scene is not None:
                self._scene.release()
                self._scene = None
            for made in (self._gouraud, self._flat, self._identity, self._interpolant, self._accumulation):
                made.release()

    def _hold(self, mesh: DrawnMesh) -> GpuMesh:
        self._device.entry_points.keep_depth()
        if self._scene is None:
            self._scene = GpuMesh(self._device, mesh)
        elif self._scene.mesh is not mesh:
            self._scene.hold(mesh)
        return self._scene

    def _draw_light(
        self,
        scene: GpuMesh,
        camera: Camera,
        shading: Shading,
        layer: Layer,
        samples: int,
        meanwhile: Meanwhile | None,
    ) -> Float32Array:
        paint = self._painter(scene, shading, layer)
        size = (camera.width, camera.height)
        projection = Projection.of(camera, scene.mesh.surfaces)
        frame = self._targets.get(size, Pixel.COLOUR)
        if samples == 1:
            paint(Viewpoint(camera.eye, projection), frame)
            self._wait(meanwhile)
            return _read_colours(frame)
        total = self._targets.get(size, Pixel.COLOUR, has_depth=False)
        total.framebuffer.clear()
        for right, down in pixel_pattern(samples).tolist():
            # The picture moves against the point that is sampled.
            jitter = (-2.0 * right / camera.width, -2.0 * down / camera.height)
            paint(Viewpoint(camera.eye, projection, jitter), frame)
            self._accumulation.add(frame, 1.0 / samples, total)
        self._wait(meanwhile)
        return _read_colours(total)

    def _wait(self, meanwhile: Meanwhile | None) -> None:
        """Do something else while the device draws."""
        if meanwhile is not None:
            self._device.entry_points.begin()
            meanwhile()

    def _painter(self, scene: GpuMesh, shading: Shading, layer: Layer) -> _Painter:
        mesh = scene.mesh
        is_radiance = layer is Layer.RADIANCE
        if shading is Shading.FLAT:
            return lambda viewpoint, target: self._flat.draw(scene, viewpoint, target, is_radiance)
        if isinstance(mesh, InterpolantMesh):

            def paint(viewpoint: Viewpoint, target: Target) -> None:
                identity = self._targets.get(target.size, Pixel.IDENTITY)
                self._identity.draw(scene, viewpoint, identity)
                self._interpolant.draw(
                    scene, mesh, viewpoint, identity, target,
                    is_linear=shading is Shading.GOURAUD, is_radiance=is_radiance,
                )  # fmt: skip

            return paint
        name = f"vertex {layer}"
        values = mesh.radiance if is_radiance else mesh.irradiance
        return lambda viewpoint, target: self._gouraud.draw(scene, viewpoint, target, name, values)

    def _draw_identity(
        self,
        scene: GpuMesh,
        viewpoint: Viewpoint,
        size: tuple[int, int],
        piece: tuple[int, int, int, int] | None = None,
    ) -> tuple[IntArray, BoolArray]:
        """Triangle that each pixel shows, (h, w), or -1, and whether its back.

        Of the whole frame, or of the `piece` from a column and a row on, so many wide and high.
        """
        target = self._targets.get(size, Pixel.IDENTITY)
        self._identity.draw(scene, viewpoint, target)
        window = piece or (0, 0, *size)
        shown = np.empty((window[3], window[2]), dtype=np.uint32)
        target.framebuffer.read_into(shown, window, 1, dtype=Pixel.IDENTITY.value, alignment=4)
        return ((shown & ~BACK) - np.uint32(1)).view(np.int32), (shown & BACK) != 0


def _middles(mesh: DrawnMesh, camera: Camera) -> tuple[Viewpoint, tuple[int, int]]:
    """`camera` looking through the centres of its pixels, and the size of its frames."""
    return Viewpoint(camera.eye, Projection.of(camera, mesh.surfaces)), (camera.width, camera.height)


def _geometry(shown: IntArray, mesh: DrawnMesh, camera: Camera, layer: Layer) -> AnyArray:
    match layer:
        case Layer.DEPTH:
            return geometry_layers.depths(shown, mesh, camera).astype(np.float32)
        case Layer.POSITION:
            return geometry_layers.positions(shown, mesh, camera)
        case Layer.NORMAL:
            return geometry_layers.normals(shown, mesh)
        case Layer.BARYCENTRIC:
            return geometry_layers.barycentrics(shown, mesh, camera).astype(np.float32)
        case Layer.OBJECT:
            return geometry_layers.object_ids(shown, mesh)
        case Layer.ELEMENT:
            return geometry_layers.leaf_ids(shown, mesh)
        case _:
            return shown


def _read_colours(target: Target) -> Float32Array:
    """(h, w, 3) of a target, whose rows run downwards."""
    width, height = target.size
    pixels = np.empty((height, width, 3), dtype=np.float32)
    target.framebuffer.read_into(pixels, components=3, dtype=Pixel.COLOUR.value, alignment=4)
    return pixels

"""Pictures of a radiosity field: which renderers and layers there are, and what is kept between frames.

The tessellation of a scene outlives its fields, and the mesh of a field outlives its frames, so that a
camera that moves over a settled solution costs one pass of the GL and nothing else.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from solver.engine.requests import Encoding, LayerName, NotAvailableError, RendererName
from solver.engine.world import World
from solver.errors import RenderingUnavailableError
from solver.geometry.scene import Camera
from solver.illumination.interpolation.mesh import InterpolantMesh
from solver.rendering.device import GlDevice
from solver.rendering.encoding import PictureFormat, encode_linear, encode_picture
from solver.rendering.layers import picture_of
from solver.rendering.renderer import FrameRenderer, Layer, Meanwhile, Shading
from solver.rendering.tessellation import RenderMesh, Tessellator
from solver.rendering.tone_mapping import tone_map
from solver.transport.field import RadiosityField
from solver.types import AnyArray, FloatArray

BEST_RENDERER: Final = RendererName.INTERPOLANT
"""What draws a frame whose renderer is not named."""

WITHOUT_LINKS: Final = (
    RendererName.FLAT,
    RendererName.GOURAUD,
    RendererName.INTERPOLANT,
    RendererName.VPL,
    RendererName.PATH,
)
"""What draws a solution that has no links; interpolants are drawn as gouraud then."""

_SHADINGS: Final = {
    RendererName.FLAT: Shading.FLAT,
    RendererName.GOURAUD: Shading.GOURAUD,
    RendererName.INTERPOLANT: Shading.INTERPOLANT,
}
_FINE_LAYERS: Final = (LayerName.TRIANGLE, LayerName.BARYCENTRIC, LayerName.ERROR)
"""Only interpolants have these."""

_GATHERED_LAYERS: Final = (LayerName.RADIANCE, LayerName.IRRADIANCE, LayerName.ILLUMINANCE)
LIT_LAYERS: Final = (*_GATHERED_LAYERS, LayerName.FALSE_COLOUR)
_LAYERS: Final = {LayerName(layer.value): layer for layer in Layer}


class Drawing:
    """Draws fields, in the thread that made it. Where there is no OpenGL, it says so when asked to draw."""

    def __init__(self) -> None:
        self._renderer: FrameRenderer | None = None
        self._unavailable: RenderingUnavailableError | None = None
        self._tessellator: Tessellator | None = None
        self._mesh: RenderMesh | None = None
        try:
            self._renderer = FrameRenderer(GlDevice())
        except RenderingUnavailableError as error:
            self._unavailable = error

    @property
    def problem(self) -> str | None:
        """Why frames cannot be drawn here; None where they can."""
        return None if self._unavailable is None else str(self._unavailable)

    def require(self, renderer: RendererName, layer: LayerName) -> None:
        """Raise NotAvailableError where this version has no such renderer, or the renderer no such layer."""
        if renderer is RendererName.GATHER:
            if layer not in _GATHERED_LAYERS:
                raise NotAvailableError("layer of the gather renderer", layer, _GATHERED_LAYERS)
            return
        if renderer is RendererName.VPL and layer not in LIT_LAYERS:
            raise NotAvailableError("layer of the vpl renderer", layer, LIT_LAYERS)
        if renderer not in _SHADINGS:
            return
        if layer in _FINE_LAYERS and renderer is not RendererName.INTERPOLANT:
            there = tuple(name for name in _LAYERS if name not in _FINE_LAYERS)
            raise NotAvailableError(f"layer of the {renderer} renderer", layer, there)

    def draw(
        self,
        world: World,
        field: RadiosityField,
        camera: Camera,
        renderer: RendererName,
        layer: LayerName,
        samples: int,
        meanwhile: Meanwhile | None = None,
    ) -> AnyArray:
        """A layer of `field` as `camera` sees it, (height, width, ...), top row first.

        Radiance in W/(m2 sr), irradiance in W/m2, illuminance in lux, depth and position in metres. The
        interpolant renderer draws the field as gouraud does: of layers that only interpolants have, nothing
        is known. `meanwhile` is called while light is drawn. Raises NotAvailableError,
        RenderingUnavailableError.
        """
        self.require(renderer, layer)
        if layer in _FINE_LAYERS:
            shape = (camera.height, camera.width)
            if layer is LayerName.TRIANGLE:
                return np.full(shape, -1, dtype=np.int32)
            if layer is LayerName.BARYCENTRIC:
                return np.zeros((*shape, 3), dtype=np.float32)
            return np.full(shape, np.nan, dtype=np.float32)
        if renderer is RendererName.INTERPOLANT:
            renderer = RendererName.GOURAUD
        mesh = self.mesh_of(world, field)
        return self.draw_mesh(world, mesh, camera, renderer, layer, samples, meanwhile)

    def draw_mesh(
        self,
        world: World,
        mesh: RenderMesh | InterpolantMesh,
        camera: Camera,
        renderer: RendererName,
        layer: LayerName,
        samples: int,
        meanwhile: Meanwhile | None = None,
    ) -> AnyArray:
        """A layer of `mesh` as `camera` sees it; as `draw`. Raises RenderingUnavailableError."""
        device = self.require_device()
        image = device.draw(mesh, camera, _SHADINGS[renderer], _LAYERS[layer], samples, meanwhile)
        return world.scene.luminous_efficacy * image if layer is LayerName.ILLUMINANCE else image

    def pixels_by_triangle(self, mesh: InterpolantMesh, camera: Camera) -> FloatArray:
        """How many pixels (t,) of `camera` see each triangle's front. Raises RenderingUnavailableError."""
        shown = self.require_device().draw(mesh, camera, Shading.INTERPOLANT, _LAYERS[LayerName.TRIANGLE], 1)
        counts = np.bincount(shown.ravel() + 1, minlength=len(mesh.triangles) + 1)[1:]
        patch = mesh.patch[mesh.triangles[:, 0]]
        surfaces = mesh.surfaces
        before = np.einsum("pa,pa->p", camera.eye - surfaces.corners[:, 0], surfaces.normal) > 0.0
        return np.where(before[patch], counts, 0).astype(np.float64)

    def require_device(self) -> FrameRenderer:
        """What draws. Raises RenderingUnavailableError where nothing can."""
        if self._renderer is None:
            # A new error, so that no traceback grows on the one that is kept.
            raise RenderingUnavailableError(self._unavailable.reason if self._unavailable else "no device")
        return self._renderer

    def mesh_of(self, world: World, field: RadiosityField) -> RenderMesh:
        """The mesh of a field as gouraud draws it; kept until another field's is asked for."""
        if self._tessellator is None or self._tessellator.surfaces is not world.surfaces:
            self._tessellator, self._mesh = Tessellator(world.surfaces, self._tessellator), None
        if self._mesh is None or self._mesh.field is not field:
            self._mesh = self._tessellator.mesh(field)
        return self._mesh


def encode(image: AnyArray, layer: LayerName, encoding: Encoding) -> bytes:
    """The file of an image of `layer`.

    Pictures show radiance tone-mapped, and other layers as `solver.rendering.layers` says. Linear files
    hold the layer's own numbers, float32 in three channels; a layer of one number a pixel has it in each.
    """
    if isinstance(encoding.format, PictureFormat):
        if layer is LayerName.RADIANCE:
            picture = tone_map(image, encoding.exposure, encoding.tone_map)
        else:
            picture = picture_of(image, _LAYERS[layer])
        return encode_picture(picture, encoding.format)
    numbers = image[:, :, None] if image.ndim == 2 else image
    shape = (*numbers.shape[:2], 3)
    return encode_linear(np.ascontiguousarray(np.broadcast_to(numbers, shape), np.float32), encoding.format)

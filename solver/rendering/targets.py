"""What passes draw into: frames of one size with their depth, of which memory is kept for the next frame."""

from __future__ import annotations

from enum import StrEnum

import moderngl

from solver.errors import LimitExceededError, SceneError
from solver.geometry.scene import Camera
from solver.rendering.device import GlDevice


class Pixel(StrEnum):
    """What a pixel holds, as the binding calls it."""

    COLOUR = "f4"
    """Four float32"""
    IDENTITY = "u4"
    """One uint32"""


class Target:
    """A framebuffer with one attachment, with depth or without."""

    def __init__(self, device: GlDevice, size: tuple[int, int], pixel: Pixel, has_depth: bool) -> None:
        context = device.context
        self.size = size
        self.channels = 4 if pixel is Pixel.COLOUR else 1
        self.texture = context.texture(size, self.channels, dtype=pixel.value)
        # Integers cannot be interpolated: with the default filter shaders read 0.
        self.texture.filter = moderngl.NEAREST, moderngl.NEAREST
        self._depth: moderngl.Renderbuffer | None = None
        if has_depth:
            self._depth = context.depth_renderbuffer(size)
            device.entry_points.make_float_depth(self._depth)
        self.framebuffer = context.framebuffer([self.texture], self._depth)

    def release(self) -> None:
        """Give its memory back; the context must be current."""
        self.framebuffer.release()
        self.texture.release()
        if self._depth is not None:
            self._depth.release()


class Targets:
    """The targets of one device, of the size that was asked for last."""

    def __init__(self, device: GlDevice) -> None:
        self._device = device
        self._kept: dict[tuple[Pixel, bool], Target] = {}

    def get(self, size: tuple[int, int], pixel: Pixel, has_depth: bool = True) -> Target:
        """A target of `size` (width, height) with whatever was drawn into it last.

        Raises MemoryError where the driver has no room for it.
        """
        if any(target.size != size for target in self._kept.values()):
            self.release()
        key = (pixel, has_depth)
        if key not in self._kept:
            self._device.context.clear_errors()
            made = Target(self._device, size, pixel, has_depth)
            if self._device.context.error == "GL_OUT_OF_MEMORY":
                made.release()
                raise MemoryError(f"no room for a frame of {size[0]} x {size[1]} pixels")
            self._kept[key] = made
        return self._kept[key]

    def release(self) -> None:
        """Give all back; the context must be current."""
        for target in self._kept.values():
            target.release()
        self._kept.clear()


def require_drawable(camera: Camera, samples: int, device: GlDevice) -> None:
    """Raise LimitExceededError or SceneError, naming the field, where no frame can be drawn."""
    for name, length, limit in zip(
        ("width", "height"), (camera.width, camera.height), device.largest_frame, strict=True
    ):
        if length < 1:
            raise SceneError("a frame has at least 1 pixel", (name,))
        if length > limit:
            raise LimitExceededError(name, length, limit)
    if samples < 1:
        raise SceneError("a pixel has at least 1 sample", ("samples",))

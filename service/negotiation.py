"""What HTTP's headers of a request say: the formats that a client accepts, the frames that it has."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Final, TypeAlias, TypeVar

from service.problems import NOT_ACCEPTABLE, ProblemError
from solver.engine.lightmaps.files import LightmapFormat
from solver.engine.overlays.files import OverlayFormat
from solver.rendering.encoding import LinearFormat, PictureFormat

FrameFormat: TypeAlias = PictureFormat | LinearFormat

T = TypeVar("T")

MEDIA_TYPES: Final[dict[FrameFormat, str]] = {
    PictureFormat.PNG: "image/png",
    PictureFormat.JPEG: "image/jpeg",
    PictureFormat.WEBP: "image/webp",
    LinearFormat.EXR: "image/x-exr",
    LinearFormat.HDR: "image/vnd.radiance",
    LinearFormat.NPY: "application/x-npy",
}
"""In the order of preference where a client accepts several alike."""

OVERLAY_TYPES: Final[dict[OverlayFormat, str]] = {
    OverlayFormat.JSON: "application/json",
    OverlayFormat.GLB: "model/gltf-binary",
}
"""The same for overlays"""

LIGHTMAP_TYPES: Final[dict[LightmapFormat, str]] = {
    LightmapFormat.GLB: "model/gltf-binary",
    LightmapFormat.EXR: "image/x-exr",
    LightmapFormat.PNG: "image/png",
}
"""The same for lightmaps"""

_QUALITY: Final = re.compile(r"q=(0(?:\.\d{0,3})?|1(?:\.0{0,3})?)", re.IGNORECASE)
_TAG: Final = re.compile(r'(?:W/)?"([^"]*)"')


def choose_format(accept: str) -> FrameFormat:
    """The format of frames that an Accept header likes best. Raises ProblemError if it likes none."""
    return _choose(accept, MEDIA_TYPES, "a frame")


def choose_overlay_format(accept: str) -> OverlayFormat:
    """The format of overlays that an Accept header likes best. Raises ProblemError if it likes none."""
    return _choose(accept, OVERLAY_TYPES, "an overlay")


def choose_lightmap_format(accept: str) -> LightmapFormat:
    """The format of lightmaps that an Accept header likes best. Raises ProblemError if it likes none."""
    return _choose(accept, LIGHTMAP_TYPES, "a lightmap")


def _choose(accept: str, types: Mapping[T, str], what: str) -> T:
    """By RFC 9110, 12.5.1; `types` in the order of preference."""
    ranges = _ranges(accept or "*/*")
    qualities = {chosen: _quality(media, ranges) for chosen, media in types.items()}
    best = max(qualities, key=lambda chosen: qualities[chosen])
    if qualities[best] == 0.0:
        raise ProblemError(NOT_ACCEPTABLE, f"{what} can be had as {', '.join(types.values())}")
    return best


def known_tags(if_none_match: str) -> frozenset[str]:
    """The entity tags of an If-None-Match header."""
    return frozenset(_TAG.findall(if_none_match))


def _ranges(accept: str) -> dict[str, float]:
    """Media ranges and their qualities; parameters other than q are of no account."""
    ranges = {}
    for entry in accept.split(","):
        media, *parameters = (part.strip().lower() for part in entry.split(";"))
        found = [match[1] for part in parameters if (match := _QUALITY.fullmatch(part))]
        ranges[media] = float(found[0]) if found else 1.0
    return ranges


def _quality(media: str, ranges: dict[str, float]) -> float:
    """By the most specific range that names the media type."""
    kind = f"{media.partition('/')[0]}/*"
    return next((ranges[name] for name in (media, kind, "*/*") if name in ranges), 0.0)

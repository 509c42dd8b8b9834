"""A scene as Mitsuba 3 has it: the same opaque triangles, diffuse on their front and black behind.

Imported where Mitsuba is installed, and a variant of it chosen.
"""

from __future__ import annotations

from typing import Any, Final

import mitsuba as mi
import numpy as np

from solver.engine.world import World
from solver.geometry.scene import Camera
from solver.types import FloatArray

_GUIDES: Final = "albedo:albedo,normal:sh_normal"
"""What a denoiser is told besides: channels 3 to 5 and 6 to 8 of a picture"""

_ALL_BOUNCES: Final = -1
_PICTURE: Final = "picture"


def mitsuba_scene(world: World, camera: Camera, has_guides: bool) -> Any:
    """The scene with one mesh a material, its camera, and the integrator `path`, of whatever depth.

    Pictures are box filtered, of stratified samples, and have albedo and normal, too, if they are to be
    denoised. Raises ValueError for what only the project has: mirrors, gloss, directional lamps, back sides.
    """
    surfaces = world.surfaces
    if surfaces.has_specular or surfaces.has_directional_emission or surfaces.side.any():
        raise ValueError("a scene is put into Mitsuba's form only if it is diffuse and one-sided")
    integrator: dict[str, Any] = {"type": "path", "max_depth": _ALL_BOUNCES}
    if has_guides:
        integrator = {"type": "aov", "aovs": _GUIDES, _PICTURE: integrator}
    patch = surfaces.triangle_patch[:, 0]
    light = np.concatenate([surfaces.reflectance[patch], surfaces.emission[patch]], axis=1)
    materials, chosen = np.unique(light, axis=0, return_inverse=True)
    meshes = {
        f"mesh{number}": _mesh(number, surfaces.triangles[chosen.ravel() == number], material)
        for number, material in enumerate(materials)
    }
    return mi.load_dict({"type": "scene", "integrator": integrator, "sensor": _sensor(camera), **meshes})


def _mesh(number: int, triangles: FloatArray, material: FloatArray) -> Any:
    """Triangles (n, 3, 3) of one reflectance and exitance, (6,)."""
    reflectance, radiance = material[:3].tolist(), (material[3:] / np.pi).tolist()
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(
        {"type": "diffuse", "reflectance": {"type": "rgb", "value": reflectance}}
    )
    if any(radiance):
        lamp = {"type": "area", "radiance": {"type": "rgb", "value": radiance}}
        properties["emitter"] = mi.load_dict(lamp)
    mesh = mi.Mesh(f"mesh{number}", 3 * len(triangles), len(triangles), props=properties)
    arrays = mi.traverse(mesh)
    arrays["vertex_positions"] = mi.Float(triangles.astype(np.float32).ravel())
    arrays["faces"] = mi.UInt32(np.arange(3 * len(triangles), dtype=np.uint32))
    arrays.update()
    return mesh


def _sensor(camera: Camera) -> dict[str, Any]:
    place = mi.ScalarTransform4f().look_at(
        origin=camera.eye.tolist(), target=camera.target.tolist(), up=camera.up.tolist()
    )
    return {
        "type": "perspective",
        "fov_axis": "y",
        "fov": camera.vertical_fov,
        "to_world": place,
        "sampler": {"type": "multijitter"},
        "film": {
            "type": "hdrfilm",
            "width": camera.width,
            "height": camera.height,
            "pixel_format": "rgb",
            "component_format": "float32",
            "rfilter": {"type": "box"},
        },
    }

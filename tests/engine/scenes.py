"""Small scenes for tests of the engine and the service."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from solver.document.conversion import scene_of
from solver.document.models import SceneDocument
from solver.geometry.scene import Camera, Scene
from tests.redistribution.rooms import crate, room


def box_document() -> dict[str, Any]:
    """A floor of 4 m2 at z = 0 under a lamp of 1 m2 at z = 2, open at the sides, and a crate on the floor.

    The camera looks straight down from below the lamp: x goes right, y goes up.
    """
    return {
        "name": "box",
        "objects": [
            {
                "id": "floor",
                "mesh": {
                    "vertices": [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]],
                    "faces": [[0, 1, 2, 3]],
                },
                "material": {"reflectance": [0.6, 0.4, 0.2]},
            },
            {
                "id": "lamp",
                "mesh": {
                    "vertices": [[-0.5, -0.5, 2], [-0.5, 0.5, 2], [0.5, 0.5, 2], [0.5, -0.5, 2]],
                    "faces": [[0, 1, 2, 3]],
                },
                "material": {"reflectance": [0, 0, 0], "emission": [10, 10, 8]},
            },
            {
                "id": "crate",
                "mesh": {
                    "vertices": [[-0.25, -0.25, 0], [0.25, -0.25, 0], [0.25, 0.25, 0], [-0.25, 0.25, 0]],
                    "faces": [[0, 1, 2, 3]],
                },
                "material": {"reflectance": [0.5, 0.5, 0.5], "two_sided": True},
                "transform": {"translation": [0.5, 0.5, 0.5]},
            },
        ],
        "cameras": {
            "main": {
                "eye": [0, 0, 1.9],
                "target": [0, 0, 0],
                "up": [0, 1, 0],
                "vertical_fov": 60,
                "width": 48,
                "height": 48,
            },
            "side": {"eye": [-4, 0, 1], "target": [0, 0, 1], "up": [0, 0, 1], "width": 32, "height": 24},
        },
    }


def box() -> Scene:
    """The scene of `box_document`."""
    return scene_of(SceneDocument.model_validate(box_document()))


def furnished() -> Scene:
    """A lit room with two crates, and a camera in its corner."""
    camera = Camera(
        np.array([0.3, 0.3, 2.1]), np.array([2.2, 1.8, 0.3]), np.array([0.0, 0.0, 1.0]), 70.0, 96, 72
    )
    scene = room((0.6, 0.5, 0.4)).with_object(crate("a", (2.6, 1.9, 0.0), 0.3))
    return replace(scene.with_object(crate("b", (1.0, 1.2, 0.0), 0.5)), cameras={"main": camera})

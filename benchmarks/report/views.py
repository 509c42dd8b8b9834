"""What the report looks at: each sample scene by its camera `main`, and one small edit that leads to it.

An edit leads to the sample as it is, from the same scene with one object elsewhere: so that what is right
after it is what is right of the sample.
"""

from __future__ import annotations

from typing import Final

from benchmarks.edit_cases import Edit
from solver.document.edits import MoveEdit
from solver.document.models import TransformDocument
from solver.engine.requests import CameraChoice
from solver.geometry.scene import Scene

WIDTH: Final = 640
HEIGHT: Final = 480

CAMERA: Final = CameraChoice("main", width=WIDTH, height=HEIGHT)
"""By which all frames are made"""

SMALL_EDITS: Final = {
    "cornell": Edit("cornell", "short_block", (0.03, 0.0, 0.0), is_small=True),
    "office": Edit("office", "books", (-0.1, 0.0, 0.0), is_small=True),
    "cube_room": Edit("cube_room", "cube", (-0.1, 0.0, 0.0), is_small=True),
    "robot_cell": Edit("robot_cell", "part3", (-0.25, 0.0, 0.0), is_small=True),
}
"""Of each sample scene"""


def edit_to(scene: Scene, edit: Edit) -> MoveEdit:
    """What puts the edit's object where it is in `scene`."""
    matrix = scene.object(edit.object).transform.matrix.ravel().tolist()
    return MoveEdit(op="move", id=edit.object, transform=TransformDocument(matrix=matrix))

"""Edits of a scene as a client sends them, and what each makes of a scene.

A batch is applied to the immutable scene, edit by edit; where one is refused, the scene that the batch
started from is still there, untouched.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Literal, TypeAlias

from pydantic import Field

from solver.document.conversion import material_of, mesh_of, object_of, require_in_bounds, transform_of
from solver.document.fields import Closed, Identifier, Location
from solver.document.models import MaterialDocument, MeshDocument, ObjectDocument, TransformDocument
from solver.errors import DuplicateObjectError, UnknownObjectError
from solver.geometry.scene import Scene, SceneObject


class AddEdit(Closed):
    """Put a new object into the scene."""

    op: Literal["add"]
    object: ObjectDocument

    @property
    def object_id(self) -> str:
        """The object that the edit is about."""
        return self.object.id


class _EditOfObject(Closed):
    id: Identifier = Field(description="An object of the scene.")

    @property
    def object_id(self) -> str:
        """The object that the edit is about."""
        return self.id


class RemoveEdit(_EditOfObject):
    """Take an object out of the scene."""

    op: Literal["remove"]


class MoveEdit(_EditOfObject):
    """Place an object anew: the transform replaces the one it had."""

    op: Literal["move"]
    transform: TransformDocument


class SetMaterialEdit(_EditOfObject):
    """Give an object another material."""

    op: Literal["set_material"]
    material: MaterialDocument


class SetMeshEdit(_EditOfObject):
    """Give an object another shape."""

    op: Literal["set_mesh"]
    mesh: MeshDocument


Edit: TypeAlias = Annotated[
    AddEdit | RemoveEdit | MoveEdit | SetMaterialEdit | SetMeshEdit, Field(discriminator="op")
]


def apply_edits(scene: Scene, edits: Sequence[Edit]) -> Scene:
    """The scene after all of `edits`, in their order. Raises SceneError, located in `edits.<index>`."""
    for index, edit in enumerate(edits):
        scene = _apply(scene, edit, ("edits", index))
    return scene


def _apply(scene: Scene, edit: Edit, where: Location) -> Scene:
    if isinstance(edit, AddEdit):
        if edit.object.id in scene.objects:
            raise DuplicateObjectError(edit.object.id, (*where, "object", "id"))
        return scene.with_object(object_of(edit.object, (*where, "object")))
    if edit.id not in scene.objects:
        raise UnknownObjectError(edit.id, (*where, "id"))
    if isinstance(edit, RemoveEdit):
        return scene.without_object(edit.id)
    return scene.with_replaced(_changed(scene.object(edit.id), edit, where))


def _changed(
    before: SceneObject, edit: MoveEdit | SetMaterialEdit | SetMeshEdit, where: Location
) -> SceneObject:
    match edit:
        case MoveEdit():
            moved = replace(before, transform=transform_of(edit.transform))
            require_in_bounds(moved, (*where, "transform"))
            return moved
        case SetMaterialEdit():
            return replace(before, material=material_of(edit.material, (*where, "material")))
        case SetMeshEdit():
            reshaped = replace(before, mesh=mesh_of(edit.mesh, (*where, "mesh")))
            require_in_bounds(reshaped, (*where, "mesh", "vertices"))
            return reshaped

"""What one pixel shows."""

from __future__ import annotations

from dataclasses import dataclass

from solver.types import ObjectId, Vector


@dataclass(frozen=True, eq=False)
class Pick:
    """The point that a pixel's centre shows, and what it lies on."""

    triangle: int
    """Of the mesh"""
    barycentric: Vector
    """(3,) weights of the triangle's corners, each at least 0, together 1"""
    position: Vector
    """(3,) metres"""
    normal: Vector
    """(3,) unit, of the front of what is seen, which may be seen from behind"""
    patch: int
    """Index into the surfaces' patches"""
    face: int
    """Index of the face in its object's mesh"""
    object_id: ObjectId
    leaf: int
    """Of the radiosity field"""

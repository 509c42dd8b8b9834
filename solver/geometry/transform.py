"""Affine placement of an object: translation, unit quaternion and scale, or any invertible matrix."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.types import FloatArray, Points


@dataclass(frozen=True, eq=False)
class Transform:
    """Maps an object's own frame to the world: p' = M p."""

    matrix: FloatArray
    """(4, 4), row-major, last row 0 0 0 1."""

    @staticmethod
    def identity() -> Transform:
        """The transform that changes nothing."""
        return Transform(np.eye(4))

    @staticmethod
    def from_parts(translation: FloatArray, rotation: FloatArray, scale: FloatArray) -> Transform:
        """Scale, then rotate by the quaternion x, y, z, w (normalised here), then translate.

        translation (3,) metres, rotation (4,), scale (3,).
        """
        x, y, z, w = rotation / np.linalg.norm(rotation)
        rotate = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
        )
        matrix = np.eye(4)
        matrix[:3, :3] = rotate * scale
        matrix[:3, 3] = translation
        return Transform(matrix)

    def apply(self, points: Points) -> Points:
        """Transformed points, (n, 3)."""
        return points @ self.matrix[:3, :3].T + self.matrix[:3, 3]

    @property
    def mirrors(self) -> bool:
        """Whether the transform turns a right-handed frame into a left-handed one."""
        return bool(np.linalg.det(self.matrix[:3, :3]) < 0.0)

"""The light at one point: exact, by the interpolant, and the difference ([H B.4.9])."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from solver.engine.overlays.base import Needs, Overlay, Shown, Subject, Work, to_rgb
from solver.engine.overlays.heights import height_scale, lifted
from solver.engine.overlays.places import Address
from solver.engine.overlays.shapes import WHITE, Primitives, Shapes
from solver.illumination.interpolation.evaluate import evaluate_interpolants
from solver.types import LUMINANCE_WEIGHTS


@dataclass(frozen=True)
class ProbeOverlay(Overlay):
    """One point."""

    at: Address
    name: ClassVar[str] = "probe"
    needs: ClassVar[Needs] = Needs.TRIANGLES
    scale: float | None = None
    """Metres for a W/m2; None: as suits"""

    def show(self, subject: Subject) -> Work:
        """One item. Raises SceneError naming a parameter, NotReadyError, RenderingUnavailableError."""
        yield
        place = self.at.find(subject)
        interpolants, surfaces = subject.interpolants(), subject.world.surfaces
        assert place.triangle is not None
        triangle = np.array([place.triangle], dtype=np.int32)
        position = place.position[None]
        element = np.array([place.element], dtype=np.int32)
        analytic = to_rgb(subject.point_irradiance().at(position, element))
        interpolated = evaluate_interpolants(interpolants.mesh(), triangle, place.st[None])
        bright = analytic @ LUMINANCE_WEIGHTS
        patch = np.array([place.patch], dtype=np.int32)
        scale = height_scale(subject, triangle, self.scale)
        top = lifted(subject, position, patch, scale * bright)
        efficacy = subject.world.scene.luminous_efficacy
        weights = np.append(1.0 - place.st.sum(), place.st)
        return Shown(
            name=self.name,
            revision=subject.revision,
            total=1,
            facts={"objects": surfaces.object_ids, "height_scale": scale},
            columns={
                "position": position,
                "normal": surfaces.normal[patch] + 0.0,
                "object": surfaces.object[patch],
                "face": surfaces.face[patch],
                "patch": patch,
                "element": element,
                "triangle": triangle,
                "barycentric": weights[None],
                "analytic": analytic,
                "interpolated": interpolated,
                "difference": analytic - interpolated,
                "illuminance": efficacy * bright,
                "illuminance_interpolated": efficacy * (interpolated @ LUMINANCE_WEIGHTS),
                "exact_samples": interpolants.is_fine[triangle],
            },
            shapes=Shapes(
                points=Primitives.of(top[:, None], WHITE),
                lines=Primitives.of(np.stack([position, top], axis=1), WHITE),
            ),
        )

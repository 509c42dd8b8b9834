"""What a client may set about the solve; `None` means: derived from `error_tolerance` and the scene."""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import Annotated, TypeAlias

from pydantic import Field

from solver.document.fields import Closed
from solver.illumination.particles.sights import MOST_RESOLUTION
from solver.illumination.settings import Compensation, LightSettings
from solver.transport.settings import Interleaving, Saving

_DEFAULTS = LightSettings()

_Positive: TypeAlias = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0.0)]
_Count: TypeAlias = Annotated[int, Field(strict=True, ge=1, lt=2**31)]


class SettingsDocument(Closed):
    """Solver settings. `error_tolerance` is the one to set; the others follow from it unless given."""

    error_tolerance: float = Field(
        default=_DEFAULTS.error_tolerance,
        strict=True,
        allow_inf_nan=False,
        gt=0.0,
        le=1.0,
        description="Relative error that the solve aims at: the area-weighted RMS luminance error of the "
        "radiosities over their RMS luminance.",
    )
    transport_error: Annotated[_Positive, Field(le=1e12)] | None = Field(
        default=None, description="Largest error of irradiance, W/m2 of luminance, that one link may carry."
    )
    minimum_area: Annotated[_Positive, Field(le=1e18)] | None = Field(
        default=None, description="Elements about this small, m2, are not subdivided."
    )
    relative_cutoff: Annotated[_Positive, Field(lt=1.0)] | None = Field(
        default=None,
        description="The solve is done when the unshot radiosity is at most this fraction of all.",
    )
    interleaving: Interleaving = Field(
        default=_DEFAULTS.interleaving,
        description="What comes first after an edit: `redistribute_first`, the object and its shadow, or "
        "`by_energy`, whatever moves more energy.",
    )
    in_full: tuple[Saving, ...] = Field(
        default=_DEFAULTS.in_full,
        max_length=16,
        description="Savings that are not made, to see what they are worth: of `channels`, `shadow_tests`, "
        "`rays`, `discontinuities` and `interpolants`.",
    )
    max_elements: _Count = Field(
        default=_DEFAULTS.max_elements, description="Elements after which refinement stops, with a warning."
    )
    max_links: _Count = Field(
        default=_DEFAULTS.max_links, description="Links after which refinement stops, with a warning."
    )

    interpolation_error: Annotated[_Positive, Field(le=1.0)] | None = Field(
        default=None,
        description="Relative RMS error that interpolants may add to the solution's, over what is in view.",
    )
    point_accuracy: Annotated[_Positive, Field(le=1.0)] = Field(
        default=_DEFAULTS.point_accuracy,
        description="Share of a point's irradiance that the treatment of one source may err by.",
    )
    max_leaf_discontinuities: Annotated[int, Field(strict=True, ge=0, le=1000)] = Field(
        default=_DEFAULTS.max_leaf_discontinuities,
        description="Most lines of discontinuities that cut one leaf of the mesh.",
    )
    minimum_discontinuity_weight: Annotated[_Positive, Field(le=1e12)] | None = Field(
        default=None,
        description="A discontinuity is meshed if without it an interpolant would be wrong by this much, "
        "W/m2 of luminance.",
    )
    max_triangles: _Count = Field(
        default=_DEFAULTS.max_triangles, description="Triangles after which interpolants are not refined."
    )

    vpl_reach: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0, le=1.0)] = Field(
        default=_DEFAULTS.vpl_reach,
        description="Distance, in diameters of the scene, within which the light of a virtual light is "
        "bounded; 0: nowhere, which leaves bright spots.",
    )
    vpl_compensation: Compensation = Field(
        default=_DEFAULTS.vpl_compensation,
        description="How what the bound takes away is put back: `rays`, `solution` or `none`.",
    )
    vpl_resolution: Annotated[int, Field(strict=True, ge=2, le=MOST_RESOLUTION)] = Field(
        default=_DEFAULTS.vpl_resolution,
        description="Texels along a side of the map of what a virtual light sees.",
    )
    max_paths: _Count = Field(
        default=_DEFAULTS.max_paths,
        description="Paths after which a frame by virtual lights is not improved any more.",
    )

    def changes_to(self, settings: LightSettings) -> LightSettings:
        """`settings` with the fields that this document gives, and only those."""
        return replace(settings, **{name: getattr(self, name) for name in self.model_fields_set})

    @classmethod
    def describing(cls, settings: LightSettings) -> SettingsDocument:
        """The document of `settings`, every field given."""
        return cls(**asdict(settings))

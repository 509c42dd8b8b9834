"""Interpolants of some triangles and elements of some leaves, as one mesh: each shows what it would alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from solver.document.samples import load_sample
from solver.geometry.scene import Camera
from solver.geometry.surfaces import Surfaces, flatten
from solver.illumination.interpolation.mesh import InterpolantMesh
from solver.rendering.joining import join
from solver.rendering.renderer import FrameRenderer, Layer, Shading
from solver.rendering.tessellation import RenderMesh, Tessellator
from solver.types import BoolArray, FloatArray
from tests.rendering.fields import build_field, linear, uneven
from tests.rendering.interpolant_meshes import interpolants, random_coefficients

CORNELL = flatten(load_sample("cornell"))
VIEW = replace(load_sample("cornell").cameras["main"], width=80, height=80)


def elements_of(surfaces: Surfaces, seed: int) -> RenderMesh:
    return Tessellator(surfaces).mesh(build_field(surfaces, uneven(seed, 3), linear((0.1, 0.2, 0.1), 1.0)))


def joined(
    known: InterpolantMesh, triangles: BoolArray, elements: RenderMesh, shown: BoolArray
) -> InterpolantMesh:
    patch = known.patch[known.triangles[:, 0]]
    return join(
        known.position,
        known.triangles[triangles],
        known.coefficients[triangles],
        patch[triangles],
        elements,
        shown,
    )


def irradiance(
    renderer: FrameRenderer, mesh: InterpolantMesh | RenderMesh, view: Camera = VIEW
) -> FloatArray:
    shading = Shading.INTERPOLANT if isinstance(mesh, InterpolantMesh) else Shading.GOURAUD
    return np.asarray(renderer.draw(mesh, view, shading, Layer.IRRADIANCE), dtype=np.float64)


def both(seed: int) -> tuple[InterpolantMesh, RenderMesh]:
    """Random quadratics and a linear field over the same leaves."""
    elements = elements_of(CORNELL, seed)
    return interpolants(elements, random_coefficients(seed, len(elements.triangles))), elements


def one_or_the_other(mesh: InterpolantMesh, elements: RenderMesh, shown: bool) -> tuple[BoolArray, BoolArray]:
    """All triangles and no leaves, or, where these are `shown`, all leaves and no triangles."""
    return np.full(len(mesh.triangles), not shown), np.full(len(elements.field.patch), shown)


@pytest.mark.parametrize("seed", range(3))
def test_of_elements_alone_the_frame_is_that_of_elements(renderer: FrameRenderer, seed: int) -> None:
    known, elements = both(seed)
    triangles, leaves = one_or_the_other(known, elements, shown=True)
    found = irradiance(renderer, joined(known, triangles, elements, leaves))
    expected = irradiance(renderer, elements)
    assert expected.max() > 1.0
    np.testing.assert_allclose(found, expected, atol=2e-5 * expected.max())


@pytest.mark.parametrize("seed", range(3))
def test_of_interpolants_alone_the_frame_is_theirs(renderer: FrameRenderer, seed: int) -> None:
    known, elements = both(seed)
    triangles, leaves = one_or_the_other(known, elements, shown=False)
    mesh = joined(known, triangles, elements, leaves)
    np.testing.assert_array_equal(irradiance(renderer, mesh), irradiance(renderer, known))


@settings(deadline=None, max_examples=10)
@given(seed=st.integers(0, 1 << 20))
def test_each_pixel_shows_what_it_would_of_one_or_the_other(renderer: FrameRenderer, seed: int) -> None:
    random = np.random.default_rng(seed)
    known, elements = both(seed)
    shown = random.random(len(elements.field.patch)) < 0.5
    mesh = joined(known, ~shown[elements.leaf], elements, shown)
    found = irradiance(renderer, mesh)
    one, other = irradiance(renderer, elements), irradiance(renderer, known)
    leaf = elements.leaf[renderer.draw(known, VIEW, Shading.INTERPOLANT, Layer.TRIANGLE)]
    expected = np.where(shown[leaf][:, :, None], one, other)
    off = np.abs(found - expected).max(axis=2) > 2e-5 * expected.max()
    # On an edge between two triangles either may be drawn.
    assert off.mean() < 0.002
    assert mesh.triangles.shape == known.triangles.shape
    assert np.all(np.diff(mesh.patch[mesh.triangles[:, 0]]) >= 0), "sorted by patch"

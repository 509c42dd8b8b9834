"""What the interpolant renderer draws: triangles, each with a quadratic function of its own ([H 3.2])."""

from __future__ import annotations

from dataclasses import dataclass

from solver.geometry.surfaces import Surfaces
from solver.types import BoolArray, Float32Array, FloatArray, IntArray, Points


@dataclass(frozen=True, eq=False)
class InterpolantMesh:
    """t triangles over v vertices, without T-vertices within patches or between them.

    On triangle k with vertices a, b, c the irradiance at a + s (b - a) + t (c - a) is
    A s^2 + 2B s t + 2C s + D t^2 + 2E t + F.
    """

    surfaces: Surfaces
    position: Points
    """(v, 3) metres"""
    patch: IntArray
    """(v,) patch of each vertex: patches share none"""
    triangles: IntArray
    """(t, 3) vertices, counter-clockwise from the front"""
    leaf: IntArray
    """(t,) leaf of the radiosity field that each triangle lies on"""
    coefficients: Float32Array
    """(t, 6, 3) A, 2B, 2C, D, 2E, F per channel, W/m2"""
    error: Float32Array
    """(t,) estimated RMS error of the luminance irradiance over each triangle, W/m2"""
    is_fine: BoolArray
    """(t,) whether the samples are point irradiances; the others show the solution's own linear functions"""
    leaf_irradiance: FloatArray
    """(n, 3) mean irradiance of the field's leaves, W/m2"""

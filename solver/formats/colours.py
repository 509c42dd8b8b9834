"""Chromaticities and spectra as linear RGB with the primaries of Rec. 709.

Sources: the colour matching functions of CIE 1931 as sums of Gaussians by Wyman, Sloan and Shirley, *Simple
analytic approximations to the CIE XYZ color matching functions*, 2013; chromatic adaptation by Bradford's
matrix. White is the equal-energy stimulus, as in MGF: it becomes R = G = B.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from solver.types import LUMINANCE_WEIGHTS, FloatArray, Vector

WAVELENGTHS: Final = np.arange(380.0, 781.0, 5.0)
"""(81,) nm, at which spectra are weighed"""

_LOBES: Final = (
    ((1.056, 599.8, 37.9, 31.0), (0.362, 442.0, 16.0, 26.7), (-0.065, 501.1, 20.4, 26.2)),
    ((0.821, 568.8, 46.9, 40.5), (0.286, 530.9, 16.3, 31.1)),
    ((1.217, 437.0, 11.8, 36.0), (0.681, 459.0, 26.0, 13.8)),
)
"""Of x, y and z: height, middle, and the widths below and above, nm"""

_BRADFORD: Final = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])
_RGB_OF_XYZ: Final = np.linalg.inv(
    np.array([[0.4123908, 0.3575843, 0.1804808], [0.2126390, 0.7151687, 0.0721923],
              [0.0193308, 0.1191948, 0.9505322]])
)  # fmt: skip
_D65: Final = np.array([0.9504559, 1.0, 1.0890578])

_SECOND_RADIATION: Final = 1.438776877e7
"""nm K, hc / k of Planck's law"""


def _matching() -> FloatArray:
    """(3, 81) colour matching functions whose sums are 1."""
    found = np.zeros((3, len(WAVELENGTHS)))
    for row, lobes in enumerate(_LOBES):
        for height, middle, below, above in lobes:
            away = WAVELENGTHS - middle
            found[row] += height * np.exp(-0.5 * (away / np.where(away < 0.0, below, above)) ** 2)
    return np.asarray(found / found.sum(axis=1, keepdims=True))


_MATCHING: Final = _matching()


def of_chromaticity(x: float, y: float) -> Vector:
    """XYZ (3,) of luminance 1 of a chromaticity with y > 0."""
    return np.array([x / y, 1.0, (1.0 - x - y) / y])


def of_spectrum(low: float, high: float, values: FloatArray) -> Vector | None:
    """XYZ (3,) of luminance 1 of a spectrum (n,), evenly from `low` to `high` nm; None if invisible."""
    grid = np.linspace(low, high, len(values))
    xyz = _MATCHING @ np.interp(WAVELENGTHS, grid, values, left=0.0, right=0.0)
    return xyz / xyz[1] if xyz[1] > 0.0 else None


def of_temperature(kelvin: float) -> Vector:
    """XYZ (3,) of luminance 1 of a black body."""
    exponent = (_SECOND_RADIATION / (WAVELENGTHS * kelvin)).clip(max=600.0)
    # Over the value at 560 nm, so that no power of ten is lost.
    reference = min(_SECOND_RADIATION / (560.0 * kelvin), 600.0)
    spectrum = (560.0 / WAVELENGTHS) ** 5 * np.exp(reference - exponent)
    xyz = _MATCHING @ spectrum
    return np.asarray(xyz / xyz[1])


def rgb_of(xyz: FloatArray) -> Vector:
    """RGB (3,) of luminance 1 of a colour XYZ (3,); what lies outside of the primaries is cut off."""
    cones = _BRADFORD @ xyz
    adapted = np.linalg.inv(_BRADFORD) @ (cones * (_BRADFORD @ _D65) / (_BRADFORD @ np.ones(3)))
    rgb = np.maximum(_RGB_OF_XYZ @ adapted, 0.0)
    luminance = float(rgb @ LUMINANCE_WEIGHTS)
    return rgb / luminance if luminance > 0.0 else np.ones(3)

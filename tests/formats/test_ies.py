"""IES luminaires: their lumens, their beams, their errors."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from solver.errors import SceneError
from solver.formats.beams import fit_beam, flux
from solver.formats.ies import read_photometry
from solver.formats.source import SourceFile
from solver.geometry.surfaces import flatten
from tests.formats.making import ies, lumens, read, scene

DOWN = np.arange(0, 91, 2.5)
ALL = np.arange(0, 181, 2.5)


@given(st.floats(0, 200), st.floats(1, 1e5))
def test_powers_of_a_cosine_are_found(exponent: float, total: float) -> None:
    """Candelas total (d + 2) / 2 pi cos^(d + 1) have the flux `total`, and the exponent d."""
    angle = np.radians(np.linspace(0, 90, 721))
    beam = fit_beam(angle, total * (exponent + 2) / (2 * math.pi) * np.cos(angle).clip(0) ** (exponent + 1))
    assert beam is not None
    assert beam.lumens == pytest.approx(total, rel=2e-3)
    assert beam.exponent == pytest.approx(exponent, rel=0.03, abs=0.06)
    assert beam.error < 0.01


def test_flux_of_a_constant_and_of_a_line() -> None:
    angle = np.radians([0.0, 30.0, 180.0])
    assert flux(angle, np.ones(3)) == pytest.approx(4 * math.pi)
    # 2 pi times the integral of t sin t from 0 to pi is 2 pi^2.
    assert flux(angle, angle) == pytest.approx(2 * math.pi**2)


def test_a_downlight() -> None:
    imported = read(ies(DOWN, 1000 / math.pi * np.cos(np.radians(DOWN))), "ies")
    (lamp,) = imported.document.objects
    assert lamp.id == "DOWNLIGHT"
    assert lumens(imported, "DOWNLIGHT") == pytest.approx(1000, rel=1e-3)
    assert lamp.material.emission_exponent < 0.1
    surfaces = flatten(scene(imported))
    assert surfaces.normal == pytest.approx(np.array([[0, 0, -1]]))
    assert surfaces.area == pytest.approx([0.125])
    assert np.ptp(surfaces.corners[0], axis=0) == pytest.approx([0.5, 0.25, 0])
    assert "lm downwards are emitted with the exponent 0" in imported.warnings[0]


def test_light_that_goes_both_ways() -> None:
    imported = read(ies(ALL, np.full(len(ALL), 50.0)), "ies")
    assert lumens(imported, "DOWNLIGHT") == pytest.approx(100 * math.pi)
    assert lumens(imported, "DOWNLIGHT up") == pytest.approx(100 * math.pi)
    surfaces = flatten(scene(imported))
    assert sorted(surfaces.normal[:, 2]) == pytest.approx([-1, 1])
    assert all("errs by" in warning for warning in imported.warnings)


def test_quadrants_are_averaged_around() -> None:
    planes = np.arange(0, 91, 15)
    candela = np.outer(1 + np.cos(np.radians(2 * planes)) ** 2, np.cos(np.radians(DOWN)))
    imported = read(ies(DOWN, 100 * candela, planes), "ies")
    weights = np.interp(np.linspace(0, 90, 9001), planes, 1 + np.cos(np.radians(2 * planes)) ** 2).mean()
    assert lumens(imported, "DOWNLIGHT") == pytest.approx(100 * math.pi * weights, rel=1e-3)
    error = float(imported.warnings[0].split("errs by ")[1].split("%")[0])
    assert 15 < error < 35, "what differs around the axis is told as error"


def test_factors_and_feet() -> None:
    text = ies(DOWN, np.cos(np.radians(DOWN))).replace("1 -1 1 ", "1 -1 10 ", 1)
    text = text.replace(" 1 2 0.5 0.25 0\n1 1 20", " 1 1 1 1 0\n0.5 1 20")
    measured = read_photometry(SourceFile("a", text.encode()))
    assert measured.lumens == pytest.approx(5 * math.pi, rel=1e-3)
    assert (measured.width, measured.length) == (0.3048, 0.3048)


def test_tilt_included_is_passed_over() -> None:
    text = ies(DOWN, np.ones(len(DOWN))).replace("TILT=NONE", "TILT=INCLUDE\n1\n2\n0 90\n1.0 0.9")
    assert read(text, "ies").document.objects


@pytest.mark.parametrize(
    ("change", "location"),
    [
        (("TILT=NONE", ""), ("TILT",)),
        (("TILT=NONE", "TILT=a.txt"), ("TILT",)),
        ((" 1 2 0.5", " 3 2 0.5"), ("photometric type",)),
        ((" 1 2 0.5", " 1 5 0.5"), ("units",)),
        (("\n0 2.5 5", "\n5 2.5 5"), ("vertical angles",)),
        (("\n0 2.5 5", "\nx 2.5 5"), ("line", 7)),
        (("\n1 1 1", "\n1 1"), ("candela values",)),
        (("\n1 1 1", "\n-1 1 1"), ("candela values",)),
        (("1 -1 1 37", "1 -1 1 37.5"), ("vertical angles",)),
    ],
)
def test_faults_are_named(change: tuple[str, str], location: tuple[str | int, ...]) -> None:
    text = ies(DOWN, np.ones(len(DOWN)))
    head, tail = text.rsplit("\n0\n", 1)
    changed = head.replace(*change, 1) + "\n0\n" + tail if change[0] in head else text.replace(*change)
    assert changed != text
    with pytest.raises(SceneError) as refused:
        read(changed, "ies")
    assert refused.value.location == location

"""Tone mapping against its formulas, in float64, and what must never get through."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from solver.rendering.tone_mapping import ToneCurve, auto_exposure, encode_srgb, srgb_to_linear, tone_map
from solver.types import LUMINANCE_WEIGHTS, Float32Array, FloatArray


def to_srgb(linear: FloatArray) -> FloatArray:
    """IEC 61966-2-1."""
    return np.where(
        linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055
    )


def curve_of(curve: ToneCurve, exposed: FloatArray) -> FloatArray:
    match curve:
        case ToneCurve.LINEAR:
            return exposed
        case ToneCurve.REINHARD:
            return exposed / (1.0 + exposed @ LUMINANCE_WEIGHTS)[..., None]
        case ToneCurve.FILMIC:
            x = exposed
            return (x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14)


def picture(seed: int, shape: tuple[int, int] = (60, 80)) -> Float32Array:
    random = np.random.default_rng(seed)
    return np.exp(random.normal(-2.0, 2.0, (*shape, 3))).astype(np.float32)


@pytest.mark.parametrize("curve", ToneCurve)
@pytest.mark.parametrize("stops", [-3.0, 0.0, 1.5])
def test_curves_are_their_formulas(curve: ToneCurve, stops: float) -> None:
    radiance = picture(1)
    exact = 255.0 * to_srgb(np.clip(curve_of(curve, radiance.astype(np.float64) * 2.0**stops), 0.0, 1.0))
    # float32 moves what is rounded by far less than a hundredth of a code.
    off = np.abs(tone_map(radiance, stops, curve) - exact)
    assert off.max() < 0.51


def test_srgb_codes_are_exact() -> None:
    """Every code, on both sides of where it begins, and a dense sweep: as float64 rounds."""
    beginnings = srgb_to_linear((np.arange(1, 256, dtype=np.float64) - 0.5) / 255.0)
    begins = beginnings.astype(np.float32)
    around = [np.nextafter(begins, np.float32(end)) for end in (-1.0, 2.0)]
    values = np.concatenate([begins, *around, np.linspace(0.0, 1.0, 100_003, dtype=np.float32)])
    # Not by to_srgb: its published constants meet with a gap of 1e-8 at 0.04045, and the inverse decides.
    exact = np.digitize(values.astype(np.float64), beginnings)
    np.testing.assert_array_equal(encode_srgb(values), exact)
    away = np.abs(255.0 * to_srgb(values.astype(np.float64)) % 1.0 - 0.5) > 1e-3
    np.testing.assert_array_equal(
        encode_srgb(values)[away], np.rint(255.0 * to_srgb(values.astype(np.float64)))[away]
    )


def test_srgb_transfer_meets_the_standard() -> None:
    codes = np.arange(256) / 255.0
    np.testing.assert_array_equal(encode_srgb(srgb_to_linear(codes).astype(np.float32)), np.arange(256))
    assert srgb_to_linear(np.array([0.5]))[0] == pytest.approx(0.21404114048223255, rel=1e-12)
    np.testing.assert_allclose(to_srgb(srgb_to_linear(codes)), codes, atol=1e-7)


@given(
    arrays.arrays(np.float32, (5, 7, 3), elements=st.floats(width=32)),
    st.sampled_from(ToneCurve),
    st.none() | st.floats(-2000.0, 2000.0),
)
def test_anything_gives_a_picture(radiance: Float32Array, curve: ToneCurve, stops: float | None) -> None:
    shown = tone_map(radiance, stops, curve)
    assert shown.dtype == np.uint8
    assert shown.shape == radiance.shape
    black = ~(radiance > 0.0)
    assert np.all(shown[black] == 0)


@pytest.mark.parametrize("curve", ToneCurve)
def test_infinite_is_white_and_not_a_number_is_black(curve: ToneCurve) -> None:
    radiance = np.array([[[np.inf] * 3, [np.nan] * 3, [-np.inf] * 3, [3e38] * 3]], dtype=np.float32)
    shown = tone_map(radiance, 0.0, curve)
    assert np.all(shown[0, [0, 3]] == 255)
    assert np.all(shown[0, [1, 2]] == 0)


@pytest.mark.parametrize("curve", ToneCurve)
def test_curves_rise(curve: ToneCurve) -> None:
    ramp = np.repeat(np.geomspace(1e-4, 1e5, 3000, dtype=np.float32)[None, :, None], 3, axis=2)
    assert np.all(np.diff(tone_map(ramp, 0.0, curve)[0, :, 1].astype(int)) >= 0)


def test_reinhard_keeps_chromaticity() -> None:
    radiance = np.array([[[4.0, 2.0, 1.0]]], dtype=np.float32)
    red, green, blue = srgb_to_linear(tone_map(radiance, -2.0, ToneCurve.REINHARD)[0, 0] / 255.0)
    assert red / green == pytest.approx(2.0, rel=0.02)
    assert green / blue == pytest.approx(2.0, rel=0.02)


@given(st.floats(-20.0, 20.0), st.integers(0, 100))
def test_auto_exposure_undoes_any_exposure(stops: float, seed: int) -> None:
    radiance = picture(seed)
    brighter = (radiance * np.float32(2.0**stops)).astype(np.float32)
    assert auto_exposure(brighter) == pytest.approx(auto_exposure(radiance) - stops, abs=1e-4)


def test_auto_exposure_takes_a_grey_picture_to_eighteen_percent() -> None:
    assert auto_exposure(np.full((9, 9, 3), 0.72, np.float32)) == pytest.approx(-2.0, abs=1e-6)


def test_auto_exposure_does_not_see_lamps_nor_background() -> None:
    plain = np.full((100, 100, 3), 0.18, np.float32)
    with_lamp = plain.copy()
    with_lamp[:20, :20] = 1e5
    with_lamp[50:] = 0.0
    with_lamp[99] = np.nan
    # 400 of 5000 lit pixels are lamp, 250 are trimmed: three in a hundred are left over.
    assert auto_exposure(plain) == pytest.approx(0.0, abs=1e-6)
    assert -0.7 < auto_exposure(with_lamp) < 0.0


@pytest.mark.parametrize("value", [0.0, np.nan, -1.0, np.inf])
def test_auto_exposure_of_nothing_lit_is_none(value: float) -> None:
    radiance = np.full((6, 6, 3), value, np.float32)
    assert auto_exposure(radiance) == 0.0
    assert tone_map(radiance, None, ToneCurve.LINEAR).max() == (255 if value == np.inf else 0)


def test_large_pictures_are_sampled_evenly() -> None:
    radiance = picture(5, (700, 900))
    full = picture(5, (700, 900))
    assert auto_exposure(radiance) == auto_exposure(full)
    logarithm = np.sort(np.log2((radiance.astype(np.float64) @ LUMINANCE_WEIGHTS).ravel()))
    cut = len(logarithm) // 20
    assert auto_exposure(radiance) == pytest.approx(np.log2(0.18) - logarithm[cut:-cut].mean(), abs=0.05)

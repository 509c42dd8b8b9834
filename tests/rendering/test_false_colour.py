"""Light as colours on a scale."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from solver.errors import SceneError
from solver.rendering.false_colour import false_colour, scale_colours, scale_maximum
from solver.rendering.tone_mapping import srgb_to_linear
from solver.types import LUMINANCE_WEIGHTS


def test_lightness_rises_evenly() -> None:
    """CIE L*: what the eye takes as equal steps."""
    colours = scale_colours(400).astype(np.float64)
    luminance = srgb_to_linear(colours) @ LUMINANCE_WEIGHTS
    lightness = np.where(luminance > 0.008856, 116.0 * np.cbrt(luminance) - 16.0, 903.3 * luminance)
    steps = np.diff(lightness)
    assert steps.min() > 0.7 * steps.mean()
    assert steps.max() < 1.3 * steps.mean()
    assert lightness[-1] - lightness[0] > 70.0


@given(st.floats(1e-3, 1e6), st.integers(2, 300))
def test_a_legend_has_the_colours_of_the_picture(maximum: float, count: int) -> None:
    light = np.linspace(0.0, maximum, count, dtype=np.float32)[None, 1:]
    np.testing.assert_allclose(false_colour(light, maximum)[0], scale_colours(count)[1:], atol=1e-4)


def test_what_is_not_lit_is_black_and_what_is_above_has_the_last_colour() -> None:
    light = np.array([[0.0, -1.0, np.nan, 1e-6, 10.0, 11.0, np.inf]], dtype=np.float32)
    shown = false_colour(light, 10.0)[0]
    assert shown.dtype == np.float32
    assert not shown[:3].any()
    np.testing.assert_allclose(shown[3], scale_colours(2)[0], atol=1e-5)
    np.testing.assert_allclose(shown[4:], np.tile(scale_colours(2)[1], (3, 1)), atol=1e-6)


def test_the_scale_ends_where_nearly_all_that_is_lit_lies_below() -> None:
    light = np.concatenate([np.zeros(5000), np.linspace(1.0, 2.0, 1000), [np.inf, np.nan]])
    light = np.append(light, 1e6).astype(np.float32)[None]
    assert scale_maximum(light) == pytest.approx(1.995, abs=0.002)
    assert scale_maximum(light, 7.0) == 7.0
    assert scale_maximum(np.zeros((3, 4), np.float32)) == 1.0
    np.testing.assert_array_equal(false_colour(light), false_colour(light, scale_maximum(light)))


@given(st.floats(1e-6, 1e6))
def test_a_scale_of_its_own_is_the_same_in_any_unit(factor: float) -> None:
    light = np.random.default_rng(5).random((6, 7)).astype(np.float32)
    np.testing.assert_allclose(false_colour(np.float32(factor) * light), false_colour(light), atol=1e-4)


@pytest.mark.parametrize("maximum", [0.0, -1.0, np.inf, np.nan])
def test_scales_that_end_nowhere_are_refused(maximum: float) -> None:
    with pytest.raises(SceneError) as refused:
        false_colour(np.ones((2, 2), np.float32), maximum)
    assert refused.value.location == ("maximum",)

"""How layers are shown."""

from __future__ import annotations

import numpy as np
import pytest

from solver.rendering.layers import Layer, picture_of
from solver.rendering.tone_mapping import ToneCurve, srgb_to_linear, tone_map


def test_numbers_have_colours_of_their_own_and_nothing_is_black() -> None:
    numbers = np.arange(-1, 400, dtype=np.int32)[None, :]
    for layer in (Layer.OBJECT, Layer.ELEMENT, Layer.TRIANGLE):
        shown = picture_of(numbers, layer)[0].astype(int)
        assert np.all(shown[0] == 0)
        assert shown[1:].min() > 0
        assert len(np.unique(shown, axis=0)) > 398
    # Neighbours in number, as leaves of one patch are, look different.
    assert np.median(np.abs(np.diff(shown[1:], axis=0)).sum(axis=1)) > 100


def test_normals() -> None:
    normal = np.array([[[0, 0, 1], [-1, 0, 0], [0, 0, 0]]], dtype=np.float32)
    assert picture_of(normal, Layer.NORMAL)[0].tolist() == [[128, 128, 255], [0, 128, 128], [0, 0, 0]]


def test_near_is_bright_and_nothing_is_black() -> None:
    depth = np.array([[1.0, 2.0, 3.0, np.inf]], dtype=np.float32)
    shown = picture_of(depth, Layer.DEPTH)[0, :, 0].astype(int)
    assert shown[0] == 255
    assert np.all(np.diff(shown) < 0)
    assert shown[3] == 0


@pytest.mark.parametrize("layer", [Layer.ILLUMINANCE, Layer.ERROR])
def test_illuminance_and_error_are_in_proportion(layer: Layer) -> None:
    light = np.array([[1.0, 2.0, 4.0, 0.0]], dtype=np.float32)
    shown = srgb_to_linear(picture_of(np.repeat(light, 50, axis=0), layer)[0, :, 0] / 255.0)
    np.testing.assert_allclose(shown, [0.25, 0.5, 1.0, 0.0], atol=0.005)


def test_positions_span_the_colours() -> None:
    position = np.full((2, 3, 3), np.nan)
    position[0, 0], position[0, 1], position[1, 1] = (5.0, -1.0, 7.0), (7.0, -1.0, 8.0), (6.0, -1.0, 7.0)
    shown = picture_of(position, Layer.POSITION)
    assert shown[0, 0].tolist() == [0, 0, 0]
    assert shown[0, 1].tolist() == [255, 0, 255]
    assert shown[1, 1].tolist() == [128, 0, 0]
    assert shown[1, 2].tolist() == [0, 0, 0]


@pytest.mark.parametrize("layer", [Layer.BARYCENTRIC, Layer.FALSE_COLOUR])
def test_what_is_in_colours_already_is_shown_as_it_is(layer: Layer) -> None:
    colours = np.array([[[1.0, 0.0, 0.0], [0.25, 0.5, 0.25], [0.0, 0.0, 0.0]]], dtype=np.float32)
    assert picture_of(colours, layer)[0].tolist() == [[255, 0, 0], [64, 128, 64], [0, 0, 0]]


def test_light_is_tone_mapped() -> None:
    light = np.random.default_rng(1).random((8, 9, 3), dtype=np.float32)
    expected = tone_map(light, None, ToneCurve.LINEAR)
    np.testing.assert_array_equal(picture_of(light, Layer.IRRADIANCE), expected)


@pytest.mark.parametrize("layer", Layer)
@pytest.mark.filterwarnings("error")
def test_pictures_of_nothing(layer: Layer) -> None:
    nothing = {
        Layer.DEPTH: np.full((4, 5), np.inf, np.float32),
        Layer.ILLUMINANCE: np.zeros((4, 5), np.float32),
        Layer.POSITION: np.full((4, 5, 3), np.nan),
        Layer.OBJECT: np.full((4, 5), -1, np.int32),
        Layer.ELEMENT: np.full((4, 5), -1, np.int32),
        Layer.TRIANGLE: np.full((4, 5), -1, np.int32),
        Layer.ERROR: np.zeros((4, 5), np.float32),
    }.get(layer, np.zeros((4, 5, 3), np.float32))
    shown = picture_of(nothing, layer)
    assert shown.shape == (4, 5, 3)
    assert shown.dtype == np.uint8
    assert not shown.any()

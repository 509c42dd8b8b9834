"""Requests: cameras with parts replaced, and when a wait is over."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image

from solver.engine.drawing import encode
from solver.engine.requests import CameraChoice, Encoding, LayerName, Wait, WaitFor
from solver.errors import SceneError, UnknownCameraError
from solver.geometry.scene import Scene
from solver.rendering.encoding import LinearFormat, PictureFormat
from solver.rendering.tone_mapping import ToneCurve
from tests.engine.scenes import box


def test_without_a_name_it_is_main_or_the_first() -> None:
    scene = box()
    assert CameraChoice().resolve(scene).width == 48
    only_side = Scene(objects=scene.objects, cameras={"side": scene.cameras["side"]})
    assert CameraChoice().resolve(only_side).width == 32


def test_parts_replace_those_of_the_named_camera() -> None:
    camera = CameraChoice(name="side", eye=(-4.0, 2.0, 1.0), width=7).resolve(box())
    assert np.array_equal(camera.eye, [-4, 2, 1])
    assert np.array_equal(camera.target, [0, 0, 1])
    assert (camera.width, camera.height) == (7, 24)


def test_unknown_camera_is_told_with_those_there_are() -> None:
    with pytest.raises(UnknownCameraError, match="main, side") as refused:
        CameraChoice(name="nope").resolve(box())
    assert refused.value.location == ("camera",)


def test_an_up_that_no_longer_fits_is_chosen_anew_unless_it_was_given() -> None:
    down = CameraChoice(name="side", eye=(0.0, 0.0, 5.0), target=(0.0, 0.0, 1.0))
    assert np.array_equal(down.resolve(box()).up, [0, 1, 0])
    with pytest.raises(SceneError) as refused:
        CameraChoice(name="side", up=(2.0, 0.0, 0.0)).resolve(box())
    assert refused.value.location == ("up",)


def test_a_target_in_the_eye_is_refused() -> None:
    with pytest.raises(SceneError) as refused:
        CameraChoice(eye=(0.0, 0.0, 0.0)).resolve(box())
    assert refused.value.location == ("target",)


@pytest.mark.parametrize(
    ("wait", "error", "converged", "over"),
    [
        (Wait(), 1.0, False, True),
        (Wait(WaitFor.CONVERGED), 0.0, False, False),
        (Wait(WaitFor.CONVERGED), 0.5, True, True),
        (Wait(WaitFor.MAX_ERROR, 0.1), 0.11, True, False),
        (Wait(WaitFor.MAX_ERROR, 0.1), 0.1, False, True),
    ],
)
def test_waits(wait: Wait, error: float, converged: bool, over: bool) -> None:
    assert wait.is_over(error, converged) is over


def test_exposure_and_curve_shape_pictures_of_radiance() -> None:
    image = np.full((2, 3, 3), 0.25, dtype=np.float32)

    def pixel(exposure: float, curve: ToneCurve) -> int:
        file = encode(image, LayerName.RADIANCE, Encoding(PictureFormat.PNG, exposure, curve))
        picture = Image.open(io.BytesIO(file))
        assert picture.size == (3, 2)
        return int(np.asarray(picture)[0, 0, 0])

    assert pixel(2.0, ToneCurve.LINEAR) == 255
    assert pixel(0.0, ToneCurve.LINEAR) == 137  # 255 (1.055 0.25^(1/2.4) - 0.055)
    assert pixel(0.0, ToneCurve.REINHARD) == 124  # of 0.2
    assert pixel(1.0, ToneCurve.LINEAR) == 188  # of 0.5


@pytest.mark.parametrize("shape", [(4, 5), (4, 5, 3)])
def test_npy_has_three_float32_channels_whatever_the_layer(shape: tuple[int, ...]) -> None:
    numbers = np.arange(np.prod(shape), dtype=np.int32).reshape(shape)
    loaded = np.load(io.BytesIO(encode(numbers, LayerName.ELEMENT, Encoding(LinearFormat.NPY))))
    assert loaded.dtype == np.float32
    assert loaded.shape == (4, 5, 3)
    expected = numbers if len(shape) == 3 else np.repeat(numbers[:, :, None], 3, axis=2)
    assert np.array_equal(loaded, expected)

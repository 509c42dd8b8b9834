"""`halflight render`: pictures of scene files, and what is told when there can be none."""

from __future__ import annotations

import functools
import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from typer.testing import Result

from halflight import pictures
from solver.illumination.settings import LightSettings
from tests.halflight.commands import WITHOUT_OPENGL, invoke, run

SCENE: dict[str, Any] = {
    "name": "small",
    "objects": [
        {
            "id": "floor",
            "mesh": {"vertices": [[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]], "faces": [[0, 1, 2, 3]]},
        },
        {
            "id": "lamp",
            "mesh": {"vertices": [[0, 0, 1], [0, 2, 1], [2, 2, 1], [2, 0, 1]], "faces": [[0, 1, 2, 3]]},
            "material": {"reflectance": [0, 0, 0], "emission": [3, 3, 3]},
        },
    ],
    "cameras": {
        "main": {"eye": [1, 1, 0.9], "target": [1, 1, 0], "up": [0, 1, 0], "width": 24, "height": 16},
        "from_below": {"eye": [1, 1, 0.1], "target": [1, 1, 1], "up": [0, 1, 0], "width": 12, "height": 10},
    },
}
LAMP = 3.0 / np.pi
"""Radiance of the lamp."""


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    file = tmp_path / "small.json"
    file.write_text(json.dumps(SCENE))
    return file


def render(scene: Path | str, output: Path, *options: str) -> Result:
    return invoke("render", scene, "-o", output, *options)


def linear(scene: Path | str, tmp_path: Path, *options: str) -> np.ndarray[Any, np.dtype[np.float32]]:
    output = tmp_path / "out.npy"
    result = render(scene, output, *options)
    assert result.exit_code == 0, result.output
    image: np.ndarray[Any, np.dtype[np.float32]] = np.load(output)
    assert image.dtype == np.float32
    return image


# --- pictures ---


def test_a_sample_becomes_a_png(tmp_path: Path) -> None:
    output = tmp_path / "cornell.png"
    result = render("cornell", output, "--tolerance", "0.1", "--width", "80", "--height", "60")
    assert result.exit_code == 0
    assert result.stderr == ""
    assert result.stdout.startswith(f"{output}: error estimate ")
    with Image.open(output) as picture:
        assert picture.size == (80, 60)
        pixels = np.asarray(picture).astype(int)
    # The left wall is red, the right one green.
    assert pixels[30, 14, 0] > 2 * pixels[30, 14, 1]
    assert pixels[30, 66, 1] > 1.5 * pixels[30, 66, 0]


@pytest.mark.parametrize(
    ("suffix", "magic"),
    [
        (".png", b"\x89PNG"), (".jpg", b"\xff\xd8\xff"), (".JPEG", b"\xff\xd8\xff"), (".webp", b"RIFF"),
        (".exr", b"\x76\x2f\x31\x01"), (".hdr", b"#?"), (".npy", b"\x93NUMPY"),
    ],
)  # fmt: skip
def test_suffix_says_the_format(scene: Path, tmp_path: Path, suffix: str, magic: bytes) -> None:
    output = tmp_path / f"out{suffix}"
    assert render(scene, output, "--tolerance", "0.2").exit_code == 0
    assert output.read_bytes().startswith(magic)


@pytest.mark.parametrize("renderer", ["flat", "gouraud", "vpl", "path"])
def test_every_renderer_sees_the_lamp_as_it_is(scene: Path, tmp_path: Path, renderer: str) -> None:
    image = linear(scene, tmp_path, "--renderer", renderer, "--camera", "from_below", "--samples", "4")
    assert image.shape == (10, 12, 3)
    np.testing.assert_allclose(image, LAMP, rtol=1e-5)


def test_renderers_agree_on_the_floor(scene: Path, tmp_path: Path) -> None:
    """Half of the light between the plates reaches the floor's middle, which reflects half."""
    solved = linear(scene, tmp_path, "--tolerance", "0.001")
    traced = linear(scene, tmp_path, "--renderer", "path", "--samples", "1024")
    middle = slice(6, 10), slice(10, 14)
    assert solved[middle].mean() == pytest.approx(traced[middle].mean(), rel=0.02)


def test_samples_of_paths_are_taken_exactly(scene: Path, tmp_path: Path) -> None:
    output = tmp_path / "out.npy"
    result = render(scene, output, "--renderer", "path", "--samples", "8")
    assert "8 samples a pixel" in result.stdout
    first = output.read_bytes()
    render(scene, output, "--renderer", "path", "--samples", "8")
    assert output.read_bytes() == first


def test_paths_go_on_until_the_tolerance(scene: Path, tmp_path: Path) -> None:
    result = render(scene, tmp_path / "out.png", "--renderer", "path", "--tolerance", "0.05")
    assert result.exit_code == 0
    assert float(result.stdout.split("error estimate ")[1].split("%")[0]) <= 5.0


def test_camera_given_on_the_command_line(scene: Path, tmp_path: Path) -> None:
    """Looking up from below the lamp, through a camera that is not in the file."""
    view = ["--eye", "1,1,0.5", "--target", "1,1,1", "--up", "1,0,0", "--fov", "40"]
    image = linear(scene, tmp_path, *view, "--width", "9", "--height", "7", "--tolerance", "0.2")
    assert image.shape == (7, 9, 3)
    np.testing.assert_allclose(image, LAMP, rtol=1e-5)


def test_layers(scene: Path, tmp_path: Path) -> None:
    depth = linear(scene, tmp_path, "--layer", "depth", "--tolerance", "0.2")
    np.testing.assert_allclose(depth, 0.9, rtol=1e-4)
    normal = linear(scene, tmp_path, "--layer", "normal", "--tolerance", "0.2")
    np.testing.assert_allclose(normal, np.broadcast_to([0.0, 0.0, 1.0], normal.shape), atol=1e-5)
    named = linear(scene, tmp_path, "--layer", "object", "--tolerance", "0.2")
    assert not named.any()


def test_exposure_is_in_stops(scene: Path, tmp_path: Path) -> None:
    def brightness(stops: str) -> float:
        output = tmp_path / "out.png"
        options = ["--exposure", stops, "--tone-map", "linear", "--tolerance", "0.2"]
        assert render(scene, output, *options).exit_code == 0
        return float(np.asarray(Image.open(io.BytesIO(output.read_bytes()))).mean())

    assert 0 < brightness("-6") < brightness("-4") < brightness("-2")


# --- what is told ---


def told(result: Result, code: int) -> str:
    """The one line of a failure."""
    assert result.exit_code == code, result.output
    assert result.stdout == ""
    (line,) = result.stderr.splitlines()
    assert line.startswith("halflight: ")
    return line.removeprefix("halflight: ")


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"objects": [{"id": "a"}]}, "objects.0.mesh: Field required"),
        ({"obejcts": []}, "obejcts: Extra inputs are not permitted"),
        ({"luminous_efficacy": -1}, "luminous_efficacy: Input should be greater than 0"),
        ({"objects": [SCENE["objects"][0]] * 2}, "objects.1.id: an object with id 'floor' exists already"),
    ],
)
@pytest.mark.parametrize("renderer", ["gouraud", "vpl", "path"])
def test_a_bad_scene_is_refused_by_field(
    tmp_path: Path, change: dict[str, Any], expected: str, renderer: str
) -> None:
    file, output = tmp_path / "bad.json", tmp_path / "out.png"
    file.write_text(json.dumps({**SCENE, **change}))
    assert told(render(file, output, "--renderer", renderer), 2) == f"{file}: {expected}"
    assert not output.exists()


@pytest.mark.parametrize("text", ["", "{", "[]", "\x00\xff", '{"objects": NaN}'])
def test_a_file_that_is_no_scene_is_refused(tmp_path: Path, text: str) -> None:
    file = tmp_path / "bad.json"
    file.write_text(text)
    assert told(render(file, tmp_path / "out.png"), 2).startswith(f"{file}: ")


def test_a_file_that_is_not_there_is_told_with_the_samples(tmp_path: Path) -> None:
    line = told(render("nowhere.json", tmp_path / "out.png"), 2)
    assert "nowhere.json: no such file" in line and "cornell, cube_room, office, robot_cell" in line
    assert "directory" in told(render(tmp_path, tmp_path / "out.png"), 2)


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (["--camera", "side"], "--camera: no camera 'side'; the scene has main, from_below"),
        (["--eye", "1,2"], "--eye: '1,2' is not three numbers like 1,2.5,0"),
        (["--target", "1,2,inf"], "--target: '1,2,inf' is not three numbers like 1,2.5,0"),
        (["--up", "0,0,0"], "--up: a direction of length 0 points nowhere"),
        (["--up", "0,0,1"], "--up: the camera looks along its up direction"),
        (["--eye", "1,1,0", "--target", "1,1,0"], "--target: the target is where the eye is"),
        (["--exposure", "bright"], "--exposure: 'bright' is neither a number of stops nor auto"),
        (["--renderer", "path", "--layer", "depth"], "--layer: paths show radiance alone"),
    ],
)
def test_bad_options_are_named(scene: Path, tmp_path: Path, options: list[str], expected: str) -> None:
    assert told(render(scene, tmp_path / "out.png", *options), 2) == expected
    assert not (tmp_path / "out.png").exists()


@pytest.mark.parametrize(
    "options",
    [["--width", "0"], ["--height", "99999"], ["--fov", "180"], ["--tolerance", "0"], ["--samples", "x"],
     ["--renderer", "none"], ["--layer", "luminance"], ["--tone-map", "none"]],
)  # fmt: skip
def test_options_out_of_range_are_named(scene: Path, tmp_path: Path, options: list[str]) -> None:
    result = render(scene, tmp_path / "out.png", *options)
    assert result.exit_code == 2
    assert f"Invalid value for '{options[0]}'" in result.stderr


def test_unusable_outputs_are_refused_before_any_work(scene: Path, tmp_path: Path) -> None:
    assert "ends in none of .png" in told(render(scene, tmp_path / "out.gif"), 2)
    assert "there is no directory" in told(render(scene, tmp_path / "missing" / "out.png"), 2)


def test_a_picture_that_cannot_be_written_is_told(scene: Path, tmp_path: Path) -> None:
    output = tmp_path / "taken.png"
    output.mkdir()
    assert "cannot write" in told(render(scene, output, "--tolerance", "0.2"), 1)


def test_a_picture_short_of_its_tolerance_is_written_and_told(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pictures, "LightSettings", functools.partial(LightSettings, max_elements=20))
    output = tmp_path / "out.png"
    result = render(scene, output, "--tolerance", "0.001")
    assert result.exit_code == 3
    assert "warning: The element limit was reached" in result.stderr
    assert output.exists()


def test_dropped_faces_are_told(scene: Path, tmp_path: Path) -> None:
    document = json.loads(scene.read_text())
    document["objects"][0]["mesh"]["faces"].append([0, 1, 0])
    scene.write_text(json.dumps(document))
    for renderer in ("gouraud", "path"):
        result = render(scene, tmp_path / "out.png", "--tolerance", "0.2", "--renderer", renderer)
        assert result.exit_code == 0
        assert result.stderr == "halflight: warning: object 'floor': 1 face of zero area dropped (first: 1)\n"


def test_without_opengl_one_sentence_says_so_and_paths_still_work(scene: Path, tmp_path: Path) -> None:
    output = tmp_path / "out.png"
    status, printed, errors = run("render", scene, "-o", output, **WITHOUT_OPENGL)
    assert (status, printed) == (1, "")
    assert len(errors.splitlines()) == 1 and "apt-get install" in errors
    assert not output.exists()
    status, _, errors = run(
        "render", scene, "-o", output, "--renderer", "path", "--samples", "4", **WITHOUT_OPENGL
    )
    assert (status, errors) == (0, "")
    assert output.exists()

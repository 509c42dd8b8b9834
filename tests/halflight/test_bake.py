"""`halflight bake`: lightmaps of scene files, and what is told when there can be none."""

from __future__ import annotations

import json
from pathlib import Path

import pygltflib
import pytest
from typer.testing import Result

from tests.engine.scenes import box_document
from tests.halflight.commands import WITHOUT_OPENGL, invoke, run


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    file = tmp_path / "box.json"
    file.write_text(json.dumps(box_document()))
    return file


def bake(scene: Path | str, output: Path, *options: str) -> Result:
    return invoke("bake", scene, "-o", output, "--tolerance", "0.05", "--density", "4", *options)


@pytest.mark.parametrize("source", ["vpl", "radiosity"])
@pytest.mark.parametrize(
    ("suffix", "magic"), [(".glb", b"glTF"), (".exr", b"\x76\x2f\x31\x01"), (".PNG", b"\x89PNG")]
)
def test_suffix_says_the_format(scene: Path, tmp_path: Path, suffix: str, magic: bytes, source: str) -> None:
    output = tmp_path / f"out{suffix}"
    result = bake(scene, output, "--source", source)
    assert result.exit_code == 0, result.output
    assert result.stderr == ""
    assert result.stdout.startswith(f"{output}: error estimate ")
    assert "4 a metre" in result.stdout
    assert output.read_bytes().startswith(magic)


def test_the_scene_has_its_second_coordinates(scene: Path, tmp_path: Path) -> None:
    output = tmp_path / "out.glb"
    assert bake(scene, output, "--white", "7").exit_code == 0
    file = pygltflib.GLTF2.load_from_bytes(output.read_bytes())
    assert file.scenes[0].extras["lightmap"]["white_irradiance"] == 7.0
    assert all(mesh.primitives[0].attributes.TEXCOORD_1 is not None for mesh in file.meshes)


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (["--density", "1000000"], "--density: "),
        (["--output", "out.gif"], "--output: out.gif ends in none of .glb .exr .png"),
        (["--output", "nowhere/out.png"], "--output: there is no directory nowhere"),
    ],
)
def test_bad_options_are_named(scene: Path, tmp_path: Path, options: list[str], told: str) -> None:
    result = bake(scene, tmp_path / "out.glb", *options)
    assert result.exit_code == 2
    assert result.stderr.startswith(f"halflight: {told}")


def test_no_opengl_is_needed(scene: Path, tmp_path: Path) -> None:
    output = tmp_path / "out.png"
    status, _, errors = run("bake", str(scene), "-o", str(output), "--density", "2", **WITHOUT_OPENGL)
    assert (status, errors) == (0, "")
    assert output.exists()


def test_help_has_every_option() -> None:
    options = invoke("bake", "--help").stdout
    for name in ("output", "density", "source", "gather", "white", "tolerance"):
        assert f"--{name} " in options

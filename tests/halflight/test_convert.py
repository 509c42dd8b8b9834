"""`halflight convert`, and scene files of other formats for the other commands."""

from __future__ import annotations

from pathlib import Path

import pytest

from solver.document.samples import load_sample, load_scene
from tests.formats.making import square_glb
from tests.formats.test_obj_and_stl import MTL, OBJ
from tests.halflight.commands import invoke


@pytest.fixture
def room(tmp_path: Path) -> Path:
    (tmp_path / "room.mtl").write_bytes(MTL)
    file = tmp_path / "room.obj"
    file.write_text(OBJ.replace("/1", "").replace("/2", ""))
    return file


def test_there_and_back(tmp_path: Path) -> None:
    glb, json = tmp_path / "a.glb", tmp_path / "a.json"
    result = invoke("convert", "cornell", glb)
    assert result.exit_code == 0, result.output
    assert result.stdout == f"{glb}: 8 objects, {result.stdout.split(', ')[1]}, 1 cameras\n"
    assert invoke("convert", glb, json).exit_code == 0
    before, after = load_sample("cornell"), load_scene(json)
    assert list(after.objects) == list(before.objects)
    assert after.cameras["main"].eye == pytest.approx(before.cameras["main"].eye)


def test_files_beside_are_read_and_warnings_told(room: Path, tmp_path: Path) -> None:
    output = tmp_path / "room.json"
    result = invoke("convert", room, output, "--scale", "2")
    assert result.exit_code == 0, result.output
    assert "halflight: warning: Ks is left out" in result.stderr
    floor = load_scene(output).object("floor")
    assert floor.material.reflectance == pytest.approx([0.2, 0.3, 0.4])
    assert floor.world_vertices.max() == 4.0


def test_pictures_of_other_formats(tmp_path: Path) -> None:
    file = tmp_path / "square.glb"
    file.write_bytes(square_glb({"emissiveFactor": [1, 1, 1]}, name="a").bytes())
    output = tmp_path / "a.png"
    size = ("--width", "8", "--height", "8", "--samples", "1", "--renderer", "path")
    result = invoke("render", file, "-o", output, *size)
    assert result.exit_code == 0, result.output
    assert output.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("content", "told"),
    [(b"glTF", "a.glb: header: "), (b"{}", "a.glb: asset: "), (None, "a.glb: no such file")],
)
def test_bad_files_are_told(tmp_path: Path, content: bytes | None, told: str) -> None:
    file = tmp_path / "a.glb"
    if content is not None:
        file.write_bytes(content)
    result = invoke("convert", file, tmp_path / "b.json")
    assert result.exit_code == 2
    assert told in result.stderr


def test_bad_outputs_are_told(tmp_path: Path) -> None:
    result = invoke("convert", "cornell", tmp_path / "a.step")
    assert (result.exit_code, "ends in none of .json .glb" in result.stderr) == (2, True)
    assert invoke("convert", "cornell", tmp_path / "nowhere" / "a.glb").exit_code == 1

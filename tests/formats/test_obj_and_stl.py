"""OBJ with MTL, and STL: geometry, materials, and what is refused where."""

from __future__ import annotations

import io
import math
import zipfile

import numpy as np
import pytest
from PIL import Image

from solver.errors import SceneError
from solver.geometry.surfaces import flatten
from tests.formats.making import areas, binary_stl, read, scene

OBJ = """# two quads and a pentagon
mtllib room.mtl
v 0 0 0
v 2 0 0
v 2 0 -3
v 0 0 -3
v 0 2 0
v 2 2 0 0.5 0.5 0.5
v 2 2 -3
v 0 2 -3
o floor
usemtl paint
f 1/1 2/2/1 3//1 4
o lamp
usemtl bulb
f -4 -1 -2 -3
g gable
f 1 2 \\
  6 5
"""
MTL = b"""newmtl paint
Kd 0.2 0.3 0.4
Ks 0.5 0.5 0.5
illum 2
newmtl bulb
Kd 0
Ke 17 12 4
newmtl mirror
Kd 0 0 0
Ks 0.8
Ns 1000
illum 3
"""


def archive(**files: bytes) -> bytes:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as written:
        for name, content in files.items():
            written.writestr(name.replace("__", "/").replace("_", "."), content)
    return packed.getvalue()


def test_polygons_stay_polygons() -> None:
    imported = read(OBJ.replace("vt", "#").replace("/1", "").replace("/2", ""), "obj")
    assert [(o.id, [len(face) for face in o.mesh.faces]) for o in imported.document.objects] == [
        ("floor", [4]),
        ("lamp", [4]),
        ("gable", [4]),
    ]
    assert areas(imported) == {"floor": 6, "lamp": 6, "gable": 4}
    assert "Materials are missing: 'room.mtl' has not come with the file." in imported.warnings
    assert imported.document.cameras["main"].up in ([0, 1, 0], [0, 0, -1]), (
        "y is up, or the view is from above"
    )


def test_materials_come_in_an_archive() -> None:
    plain = OBJ.replace("/1", "").replace("/2", "").encode()
    imported = read(archive(scene__room_obj=plain, scene__room_mtl=MTL), "zip")
    floor, lamp, _ = imported.document.objects
    assert floor.material.reflectance == [0.2, 0.3, 0.4]
    assert floor.material.specular == [0, 0, 0]
    assert floor.material.two_sided
    assert any("Ks is left out" in warning for warning in imported.warnings)
    assert lamp.material.emission == pytest.approx([17 * math.pi, 12 * math.pi, 4 * math.pi])
    assert not lamp.material.two_sided
    surfaces = flatten(scene(imported))
    assert surfaces.normal[surfaces.emission.any(axis=1)][:1] == pytest.approx(np.array([[0, -1, 0]]))


def test_names_may_hold_what_begins_comments() -> None:
    text = "v 0 0 0 # origin\nv 1 0 0 #x\nv 0 1 0\no Box #1\nusemtl paint#2\nf 1 2 3 #face\n#f 1 1 1\n"
    imported = read(text, "obj")
    assert [o.id for o in imported.document.objects] == ["Box #1"]
    assert "'paint#2'" in imported.warnings[0]


def test_mirrors_are_those_that_trace_reflections() -> None:
    text = b"mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl mirror\nf 1 2 3\n"
    (made,) = read(archive(a_obj=text, m_mtl=MTL), "zip").document.objects
    assert made.material.specular == [0.8, 0.8, 0.8]
    assert made.material.exponent is None


def test_textures_of_an_archive_are_averaged() -> None:
    picture = io.BytesIO()
    Image.fromarray(np.array([[[188, 188, 188], [0, 0, 0]]], dtype=np.uint8)).save(picture, "PNG")
    text = b"mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
    text += b"usemtl tiles\nf 1/1 2/2 3/3 4/4\n"
    files = {"a_obj": text, "m_mtl": b"newmtl tiles\nKd 1 1 1\nmap_Kd t.png\n", "t_png": picture.getvalue()}
    (made,) = read(archive(**files), "zip").document.objects
    assert made.material.reflectance == pytest.approx([0.25145] * 3, rel=0.01)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("v 0 0\n", 1),
        ("v 0 0 x\n", 1),
        ("v 0 0 nan\n", 1),
        ("v 0 0 0\nf 1 1\n", 2),
        ("v 0 0 0\n\nf 1 1 2\n", 3),
        ("v 0 0 0\nf 1 0 1\n", 2),
        ("v 0 0 0\nf 1 1 -2\n", 2),
        ("v 0 0 0\nf 1/1 1 1\n", 2),
        ("v 0 0 0\nf a b c\n", 2),
        ("\x01\x02\n", 1),
    ],
)
def test_faults_of_obj_are_named_by_line(text: str, line: int) -> None:
    with pytest.raises(SceneError) as refused:
        read(text, "obj")
    assert refused.value.location == ("line", line)


CUBE = np.array(
    [
        [[0, 0, 0], [0, 1, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [1, 0, 0]],
        [[0, 0, 1], [1, 0, 1], [1, 1, 1]], [[0, 0, 1], [1, 1, 1], [0, 1, 1]],
        [[0, 0, 0], [1, 0, 0], [1, 0, 1]], [[0, 0, 0], [1, 0, 1], [0, 0, 1]],
        [[0, 1, 0], [0, 1, 1], [1, 1, 1]], [[0, 1, 0], [1, 1, 1], [1, 1, 0]],
        [[0, 0, 0], [0, 0, 1], [0, 1, 1]], [[0, 0, 0], [0, 1, 1], [0, 1, 0]],
        [[1, 0, 0], [1, 1, 0], [1, 1, 1]], [[1, 0, 0], [1, 1, 1], [1, 0, 1]],
    ]
)  # fmt: skip


def test_a_cube_of_twelve_triangles_has_six_faces() -> None:
    text = "solid cube of mine\n"
    for triangle in CUBE:
        loops = "".join(f"vertex {x} {y} {z}\n" for x, y, z in triangle)
        text += f"facet normal 0 0 0\nouter loop\n{loops}endloop\nendfacet\n"
    text += "endsolid\n"
    for imported in (read(binary_stl(1000 * CUBE), "stl", scale=0.001), read(text, "stl")):
        (cube,) = imported.document.objects
        assert [len(face) for face in cube.mesh.faces] == [4] * 6
        assert list(areas(imported).values()) == [pytest.approx(6)]
        surfaces = flatten(scene(imported))
        outward = np.einsum("pc,pc->p", surfaces.normal, surfaces.corners.mean(axis=1) - 0.5)
        assert (outward > 0).all()
    assert cube.id == "cube of mine"


@pytest.mark.parametrize(
    "content", [b"", b"abc", bytes(84), binary_stl(CUBE)[:-1], b"solid\nfacet\n", b"solid\nvertex 1 2\n"]
)
def test_faults_of_stl(content: bytes) -> None:
    with pytest.raises(SceneError):
        read(content, "stl")

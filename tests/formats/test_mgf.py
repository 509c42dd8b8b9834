"""MGF: contexts, transforms and arrays, solids of known area, colours."""

from __future__ import annotations

import math

import numpy as np
import pytest

from solver.errors import LimitExceededError, SceneError
from solver.formats.colours import of_chromaticity, of_spectrum, of_temperature, rgb_of
from solver.formats.mgf.transforms import placements
from solver.geometry.surfaces import flatten
from solver.types import LUMINANCE_WEIGHTS
from tests.formats.making import EFFICACY, areas, lumens, read, scene

CORNERS = """
v a =
  p 0 0 0
v b =
  p 1 0 0
v c =
  p 1 1 0
v d =
  p 0 1 0
"""
WALL = f"""# a wall
{CORNERS}
m grey =
  sides 1
  rd 0.5
o wall
m grey
f a b c d
o
"""


def test_a_wall() -> None:
    imported = read(WALL, "mgf")
    (wall,) = imported.document.objects
    assert (wall.id, len(wall.mesh.faces), len(wall.mesh.faces[0])) == ("wall", 1, 4)
    assert wall.material.reflectance == pytest.approx([0.5] * 3)
    assert not wall.material.two_sided
    assert areas(imported) == {"wall": 1}
    assert flatten(scene(imported)).normal == pytest.approx(np.array([[0, 0, 1]]))


def test_emission_is_lumens_per_square_metre() -> None:
    text = f"{CORNERS}m lit =\nsides 1\ned 1000\nxf -s 2\no lamp\nf a b c d\no\nxf\n"
    assert lumens(read(text, "mgf"), "lamp") == pytest.approx(4000)


@pytest.mark.parametrize(
    ("shape", "area"),
    [
        ("sph a 2", 16 * math.pi),
        ("sph a -2", 16 * math.pi),
        ("cyl a 0.5 b", math.pi),
        ("cone a 0.5 b 0", math.pi * 0.5 * math.hypot(1, 0.5)),
        ("cone a 0.5 b 0.25", math.pi * 0.75 * math.hypot(1, 0.25)),
        ("ring u 0 2", 4 * math.pi),
        ("ring u 1 2", 3 * math.pi),
        ("prism a b c d 3", 14),
        ("prism a b c d -3", 14),
    ],
)
def test_shapes_have_their_areas_and_lumens(shape: str, area: float) -> None:
    text = f"{CORNERS}v u =\np 0 0 0\nn 0 0 1\nm lit =\nsides 1\ned 100\no thing\n{shape}\no\n"
    imported = read(text, "mgf")
    assert lumens(imported, "thing") == pytest.approx(100 * area, rel=1e-5)
    assert areas(imported)["thing"] == pytest.approx(area, rel=0.05)
    surfaces = flatten(scene(imported))
    middle = surfaces.corners.reshape(-1, 3).mean(axis=0)
    outward = np.einsum("pc,pc->p", surfaces.normal, surfaces.corners.mean(axis=1) - middle)
    if shape.startswith(("sph", "cyl", "prism")):
        assert (outward < 0).all() if "-" in shape else (outward > 0).all()
    if shape.startswith("prism"):
        ends = sorted(surfaces.corners[..., 2].ravel())[:: len(surfaces.corners) * 4 - 1]
        assert ends == ([-3, 0] if shape == "prism a b c d 3" else [0, 3]), (
            "the polygon faces outwards, or in"
        )
    if shape.startswith("ring"):
        assert surfaces.normal[:, 2].min() == pytest.approx(1)


def test_closed_shapes_are_closed() -> None:
    for shape in ("sph a 2", "prism a b c 1"):
        surfaces = flatten(scene(read(f"{CORNERS}m x =\nsides 1\nrd 0.5\n{shape}\n", "mgf")))
        total = (surfaces.area[:, None] * surfaces.normal).sum(axis=0)
        assert total == pytest.approx([0, 0, 0], abs=1e-12)


def test_transforms_act_in_their_order() -> None:
    (moved,) = placements(["-t", "1", "0", "0", "-rz", "90", "-s", "2"], 1)
    assert moved @ [0, 0, 0, 1] == pytest.approx([0, 2, 0, 1])
    (three,) = placements(["-i", "3", "-rz", "30"], 1)
    assert three @ [1, 0, 0, 1] == pytest.approx([0, 1, 0, 1])
    array = placements(["-a", "2", *["-t", "1", "0", "0"], "-a", "3", *["-t", "0", "5", "0"]], 1)
    places = [tuple((m @ [0, 0, 0, 1])[:2].round(9)) for m in array]
    assert sorted(places) == [(x, y) for x in (0, 1) for y in (0, 5, 10)]


def test_arrays_repeat_their_block_within_other_transforms() -> None:
    block = "o tile\nf a b c d\no\n"
    text = f"{CORNERS}m x =\nsides 1\nrd 0.5\nxf -t 0 0 7\nxf -a 3 -t 2 0 0 -a 2 -t 0 2 0\n{block}xf\nxf\n"
    imported = read(text, "mgf")
    assert len(imported.document.objects) == 6
    corners = flatten(scene(imported)).corners.reshape(-1, 3)
    assert corners.min(axis=0) == pytest.approx([0, 0, 7])
    assert corners.max(axis=0) == pytest.approx([5, 3, 7])


def test_mirrors_keep_fronts_in_front() -> None:
    text = f"{CORNERS}m x =\nsides 1\nrd 0.5\nxf -mx\nf a b c d\nprism a b c d 1\nxf\n"
    surfaces = flatten(scene(read(text, "mgf")))
    assert surfaces.normal[0] == pytest.approx([0, 0, 1])
    prism = surfaces.corners[1:].mean(axis=1) - [-0.5, 0.5, -0.5]
    assert (np.einsum("pc,pc->p", surfaces.normal[1:], prism) > 0).all()


def test_neutral_is_grey_and_amounts_are_luminance() -> None:
    assert rgb_of(np.ones(3)) == pytest.approx([1, 1, 1], abs=1e-4)
    for xyz in (of_chromaticity(0.5, 0.4), of_temperature(2700), of_temperature(20000)):
        assert rgb_of(xyz) @ LUMINANCE_WEIGHTS == pytest.approx(1)
    flat = of_spectrum(380, 780, np.ones(41))
    assert flat is not None
    assert rgb_of(flat) == pytest.approx([1, 1, 1], abs=1e-3)


def test_black_bodies_have_their_chromaticities() -> None:
    """CIE 015: illuminant A, 2856 K, is at x = 0.4476, y = 0.4074."""
    xyz = of_temperature(2855.5)
    assert xyz[:2] / xyz.sum() == pytest.approx([0.4476, 0.4074], abs=3e-3)


def test_colours_mix_by_luminance() -> None:
    text = f"""{CORNERS}
c red =
  cxy 0.6 0.35
c blue =
  cspec 400 500 1 1 1
c both =
  cmix 3 red 1 blue
m x =
  sides 1
  c both
  rd 0.2
  c
f a b c d
"""
    (made,) = read(text, "mgf").document.objects
    assert np.array(made.material.reflectance) @ LUMINANCE_WEIGHTS == pytest.approx(0.2, rel=1e-6)
    assert made.material.reflectance[0] > made.material.reflectance[1]


def test_materials_are_copied_by_name() -> None:
    text = f"{CORNERS}m x =\nrd 0.5\nm y = x\nrd 0.25\nm x\nf a b c d\n"
    (made,) = read(text, "mgf").document.objects
    assert made.material.reflectance == pytest.approx([0.5] * 3)
    assert made.material.two_sided
    text = f"{CORNERS}m x =\nrd 0.1\nrs 0.5 0.1\ned {EFFICACY}\nf a b c d\n"
    (made,) = read(text, "mgf").document.objects
    assert made.material.specular == pytest.approx([0.5] * 3)
    assert made.material.exponent == pytest.approx(49.5)
    assert made.material.emission == pytest.approx([1, 1, 1])


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("i other.mgf\n", 1),
        ("\nwhatever 1 2\n", 2),
        ("v a =\np 1 2\n", 2),
        ("v a =\np 1 2 3\nf a b c\n", 3),
        ("m x = y\n", 1),
        ("cxy 0.5 0\n", 1),
        ("m x =\nrd 1.5\n", 2),
        ("xf\n", 1),
        ("o\n", 1),
        ("xf -t 1 2\nxf\n", 1),
        ("xf -q 1\nxf\n", 1),
        ("cmix 1 red\n", 1),
    ],
)
def test_faults_are_named_by_line(text: str, line: int) -> None:
    with pytest.raises(SceneError) as refused:
        read(text, "mgf")
    assert refused.value.location == ("line", line)


def test_arrays_within_arrays_have_a_limit() -> None:
    with pytest.raises(LimitExceededError):
        read(f"{CORNERS}{'xf -a 1000 -t 1 0 0' + chr(10)}" * 5 + "v q =\n" + "xf\n" * 5, "mgf")
    with pytest.raises(LimitExceededError):
        read("xf -a 100000 -t 1 0 0 -a 100000\nxf\n", "mgf")

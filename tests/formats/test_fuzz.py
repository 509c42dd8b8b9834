"""Whatever bytes come: a scene, or an error that says where; nothing else."""

from __future__ import annotations

import json
from typing import Any, Final

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from solver.document.conversion import scene_of
from solver.document.limits import SceneLimits
from solver.document.samples import load_sample
from solver.errors import LimitExceededError, SceneError
from solver.formats.gltf.writer import scene_glb
from solver.geometry.surfaces import flatten
from tests.formats.making import binary_stl, ies, read
from tests.formats.test_archives import packed
from tests.formats.test_gltf import textured
from tests.formats.test_mgf import WALL
from tests.formats.test_obj_and_stl import CUBE, MTL, OBJ

SOUND: Final[dict[str, list[bytes]]] = {
    "glb": [
        scene_glb(load_sample("cornell"), {}),
        textured([[[9, 9, 9], [255, 0, 0]]], [[0, 0], [1, 0], [1, 1], [0, 1]]).bytes(),
    ],
    "gltf": [json.dumps({"asset": {"version": "2.0"}, "nodes": [{}]}).encode()],
    "obj": [OBJ.encode()],
    "stl": [binary_stl(CUBE)],
    "mgf": [WALL.encode() + b"xf -a 3 -t 1 0 0\nsph a 1\nxf\n"],
    "ies": [ies(np.arange(0, 91, 10), np.ones(10)).encode()],
    "zip": [packed(("a.obj", OBJ.encode()), ("room.mtl", MTL))],
}
SMALL: Final = SceneLimits(max_polygons=2000, max_vertices=20_000)


def try_to_read(content: bytes, chosen: str) -> None:
    try:
        imported = read(content, chosen, limits=SMALL)
        flatten(scene_of(imported.document))
    except SceneError as refused:
        assert refused.message
    except LimitExceededError:
        pass


@pytest.mark.parametrize("chosen", SOUND)
def test_random_bytes(chosen: str) -> None:
    @given(st.binary(max_size=400))
    def run(content: bytes) -> None:
        try_to_read(content, chosen)

    run()


@pytest.mark.parametrize("chosen", SOUND)
def test_truncated_and_damaged_files(chosen: str) -> None:
    """A prefix of a sound file, with a few bytes of it changed."""

    @given(st.data())
    @settings(max_examples=200)
    def run(data: st.DataObject) -> None:
        sound = data.draw(st.sampled_from(SOUND[chosen]))
        cut = bytearray(sound[: data.draw(st.integers(0, len(sound)) | st.just(len(sound)))])
        changes = st.tuples(st.integers(0, max(0, len(cut) - 1)), st.integers(0, 255))
        for place, value in data.draw(st.lists(changes, max_size=6)):
            if cut:
                cut[place] = value
        try_to_read(bytes(cut), chosen)

    run()


WORDS: Final = """v f o m c p n rd ed rs sides xf -a -i -t -rx -s sph cyl cone ring prism cmix cxy cspec cct
a b = 1 2 -1 1e9"""
words = st.sampled_from(WORDS.split()) | st.integers(-5, 50).map(str)


@pytest.mark.parametrize("chosen", ["obj", "mgf"])
def test_lines_of_known_words(chosen: str) -> None:
    @given(st.lists(st.lists(words, max_size=6).map(" ".join), max_size=15).map("\n".join))
    @settings(max_examples=300)
    def run(text: str) -> None:
        try_to_read(f"v a =\np 0 0 0\nv b =\np 1 0 0\n{text}\n".encode(), chosen)

    run()


numbers: Any = st.integers(-3, 12) | st.floats() | st.sampled_from([2**31 - 1, 2**40, 1e300])
trees = st.recursive(
    st.none() | st.booleans() | numbers | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=4),
    max_leaves=8,
)


def test_members_of_any_value() -> None:
    """A sound glTF file with one member, anywhere, of any value."""
    sound = textured([[[9, 9, 9], [255, 0, 0]]], [[0, 0], [1, 0], [1, 1], [0, 1]])

    @given(st.data())
    @settings(max_examples=300)
    def run(data: st.DataObject) -> None:
        file = json.loads(json.dumps(sound.file))
        place = file
        while True:
            keys = list(place) if isinstance(place, dict) else list(range(len(place)))
            if not keys:
                break
            key = data.draw(st.sampled_from(keys))
            if isinstance(place[key], dict | list) and data.draw(st.booleans()):
                place = place[key]
                continue
            place[key] = data.draw(trees | numbers)
            break
        before, sound.file = sound.file, file
        try:
            content = sound.bytes()
        except (TypeError, AttributeError):
            return
        finally:
            sound.file = before
        try_to_read(content, "glb")

    run()

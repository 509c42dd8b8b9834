"""Archives: bombs, paths that lead out, and what is not what it says."""

from __future__ import annotations

import io
import zipfile

import pytest

from solver.errors import LimitExceededError, SceneError
from solver.formats.archives import unpack

TRIANGLE = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


def packed(*files: tuple[str, bytes], compression: int = zipfile.ZIP_DEFLATED) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", compression) as archive:
        for name, content in files:
            archive.writestr(name, content)
    return buffer.getvalue()


def test_what_lies_beside_is_found_from_where_the_file_lies() -> None:
    source = unpack(packed(("a/b.obj", TRIANGLE), ("a/m/c.mtl", b"x"), ("d.png", b"y")), [".obj"], 1000)
    assert (source.name, source.content) == ("b.obj", TRIANGLE)
    assert source.neighbour("m/c.mtl") == b"x"
    assert source.neighbour("./m/../m/c.mtl") == b"x"
    assert source.neighbour("..\\d.png") == b"y"
    assert source.neighbour("%6d/c.mtl") == b"x"
    assert source.neighbour("/etc/passwd") is None


def test_bombs_stop_at_the_limit() -> None:
    bomb = packed(("a.obj", bytes(50_000_000)))
    assert len(bomb) < 100_000
    with pytest.raises(LimitExceededError, match="unpacked bytes"):
        unpack(bomb, [".obj"], 1_000_000)
    with pytest.raises(LimitExceededError, match="unpacked bytes"):
        unpack(packed(*((f"{n}.obj", bytes(600)) for n in range(2))), [".obj"], 1000)


def test_many_files_are_too_many() -> None:
    with pytest.raises(LimitExceededError, match="files in the archive"):
        unpack(packed(*((f"{n}.txt", b"") for n in range(1000))), [".obj"], 1000)


@pytest.mark.parametrize(
    "name", ["../a.obj", "/etc/a.obj", "..\\a.obj", "C:/a.obj", "x/../../a.obj", "a\n.obj"]
)
def test_names_that_lead_out_are_refused(name: str) -> None:
    with pytest.raises(SceneError) as refused:
        unpack(packed((name, TRIANGLE)), [".obj"], 1000)
    assert refused.value.location == ("archive", 0)


@pytest.mark.parametrize(
    "content",
    [
        b"", b"PK", b"PK\x05\x06" + bytes(18), packed(("a.obj", TRIANGLE))[:-30], packed(("a.txt", b"")),
        packed(("a.obj", TRIANGLE), ("b.obj", TRIANGLE)),
        packed(("a.obj", TRIANGLE), compression=zipfile.ZIP_LZMA),
        packed(("a.obj", TRIANGLE), compression=zipfile.ZIP_STORED).replace(TRIANGLE[:2], b"zz"),
    ],
)  # fmt: skip
def test_faults_are_told(content: bytes) -> None:
    with pytest.raises(SceneError) as refused:
        unpack(content, [".obj"], 1000)
    assert refused.value.location[0] == "archive"


def test_damaged_members_are_told() -> None:
    sound = packed(("a.obj", TRIANGLE * 20))
    at = sound.index(b"a.obj") + 20
    with pytest.raises(SceneError):
        unpack(sound[:at] + bytes([sound[at] ^ 255]) + sound[at + 1 :], [".obj"], 10_000)

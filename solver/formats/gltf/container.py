"""Where the bytes of glTF are: chunks of GLB, data URIs, files beside it; and arrays out of them."""

from __future__ import annotations

import base64
import binascii
from typing import Final, TypeVar

import numpy as np
from pydantic import ValidationError

from solver.document.fields import Location
from solver.errors import LimitExceededError, SceneError
from solver.formats.gltf.models import Accessor, BufferView, GltfFile
from solver.formats.source import SourceFile
from solver.types import AnyArray, FloatArray, Int64Array

T = TypeVar("T")

_MAGIC: Final = b"glTF"
_JSON: Final = 0x4E4F534A
_BIN: Final = 0x004E4942

_DTYPES: Final = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_COMPONENTS: Final = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_DATA: Final = "data:"


class Container:
    """A file and its buffers."""

    def __init__(self, source: SourceFile, most_elements: int) -> None:
        """Take the file apart; arrays may have `most_elements`. Raises SceneError."""
        self._source = source
        self._most = most_elements
        text, self._chunk = _chunks(source.content)
        try:
            self.file = GltfFile.model_validate_json(text)
        except ValidationError as refused:
            first = refused.errors(include_url=False, include_context=False, include_input=False)[0]
            raise SceneError(first["msg"], first["loc"]) from None
        except UnicodeDecodeError:
            raise SceneError("it is not encoded in UTF-8") from None
        if not self.file.asset.version.startswith("2."):
            raise SceneError("only version 2 of glTF is read", ("asset", "version"))
        self._buffers: dict[int, bytes] = {}

    def floats(self, index: int, components: int, where: Location) -> FloatArray:
        """The array (n, components) of an accessor, normalised where it says so. Raises SceneError."""
        accessor = self._accessor(index, where)
        found = self._array(accessor, components, index)
        if accessor.componentType == 5126:
            return found.astype(np.float64)
        if not accessor.normalized:
            return found.astype(np.float64)
        most = np.iinfo(found.dtype).max
        return np.maximum(found.astype(np.float64) / most, -1.0)

    def indices(self, index: int, where: Location) -> Int64Array:
        """The whole numbers (n,) of an accessor. Raises SceneError."""
        accessor = self._accessor(index, where)
        if accessor.componentType not in {5121, 5123, 5125}:
            raise SceneError("indices are unsigned whole numbers", ("accessors", index, "componentType"))
        return self._array(accessor, 1, index).ravel().astype(np.int64)

    def view(self, index: int, where: Location) -> bytes:
        """The bytes of a view. Raises SceneError."""
        found = self.item(self.file.bufferViews, index, where, "buffer view")
        return self._slice(found, index)

    def resource(self, uri: str, where: Location) -> bytes:
        """What a URI stands for: data, or a file that has come along. Raises SceneError."""
        if uri.startswith(_DATA):
            head, _, text = uri.partition(",")
            try:
                if not head.endswith(";base64"):
                    raise ValueError
                return base64.b64decode(text, validate=True)
            except (ValueError, binascii.Error):
                raise SceneError("this data URI is not in base64", where) from None
        found = self._source.neighbour(uri)
        if found is None:
            raise SceneError(
                f"{uri[:80]!r} has not come with the file: send binary glTF, or a zip archive of both", where
            )
        return found

    def item(self, items: list[T], index: int, where: Location, what: str) -> T:
        """`items[index]`. Raises SceneError where there is none."""
        if index >= len(items):
            raise SceneError(f"there is no {what} {index}: the file has {len(items)}", where)
        return items[index]

    def _accessor(self, index: int, where: Location) -> Accessor:
        return self.item(self.file.accessors, index, where, "accessor")

    def _array(self, accessor: Accessor, components: int, index: int) -> AnyArray:
        """(n, components) as stored. Raises SceneError, LimitExceededError."""
        where: Location = ("accessors", index)
        if _COMPONENTS[accessor.type] != components:
            raise SceneError(f"{accessor.type} does not have {components} numbers", (*where, "type"))
        if accessor.count > self._most:
            raise LimitExceededError("vertices", accessor.count, self._most)
        dtype = np.dtype(_DTYPES[accessor.componentType])
        shape = (accessor.count, components)
        if accessor.bufferView is None:
            found = np.zeros(shape, dtype)
        else:
            at = (accessor.bufferView, accessor.byteOffset)
            found = self._read(at, dtype, shape, where)
        if accessor.sparse is not None:
            found = self._patched(found, accessor, where)
        return found

    def _read(
        self, at: tuple[int, int], dtype: np.dtype[np.generic], shape: tuple[int, int], where: Location
    ) -> AnyArray:
        number, offset = at
        view = self.item(self.file.bufferViews, number, (*where, "bufferView"), "buffer view")
        memory = self._slice(view, number)
        size = dtype.itemsize * shape[1]
        stride = view.byteStride or size
        if stride < size:
            raise SceneError(f"a stride of {stride} bytes for {size}", ("bufferViews", number, "byteStride"))
        needed = offset + stride * (shape[0] - 1) + size if shape[0] else 0
        if needed > len(memory):
            raise SceneError(f"{needed} bytes are needed of a view that has {len(memory)}", where)
        if shape[0] == 0:
            return np.zeros(shape, dtype)
        strides = (stride, dtype.itemsize)
        return np.ndarray(shape, dtype, memory, offset, strides).copy()

    def _patched(self, found: AnyArray, accessor: Accessor, where: Location) -> AnyArray:
        sparse = accessor.sparse
        if sparse is None:
            return found
        inside: Location = (*where, "sparse")
        if sparse.count > accessor.count:
            raise SceneError("more values are replaced than there are", (*inside, "count"))
        kind = np.dtype(_DTYPES[sparse.indices.componentType])
        at = (sparse.indices.bufferView, sparse.indices.byteOffset)
        rows = self._read(at, kind, (sparse.count, 1), (*inside, "indices")).ravel().astype(np.int64)
        if len(rows) and rows.max() >= accessor.count:
            raise SceneError(f"there is no value {rows.max()}", (*inside, "indices"))
        shape = (sparse.count, found.shape[1])
        values = self._read(
            (sparse.values.bufferView, sparse.values.byteOffset), found.dtype, shape, (*inside, "values")
        )
        found[rows] = values
        return found

    def _slice(self, view: BufferView, index: int) -> bytes:
        memory = self._buffer(view.buffer, ("bufferViews", index, "buffer"))
        end = view.byteOffset + view.byteLength
        if end > len(memory):
            raise SceneError(
                f"it ends at byte {end} of a buffer of {len(memory)}", ("bufferViews", index, "byteLength")
            )
        return memory[view.byteOffset : end]

    def _buffer(self, index: int, where: Location) -> bytes:
        if index in self._buffers:
            return self._buffers[index]
        buffer = self.item(self.file.buffers, index, where, "buffer")
        place: Location = ("buffers", index)
        if buffer.uri is not None:
            memory = self.resource(buffer.uri, (*place, "uri"))
        elif index == 0 and self._chunk is not None:
            memory = self._chunk
        else:
            raise SceneError("neither does it have a URI, nor is it the binary chunk", place)
        if buffer.byteLength > len(memory):
            raise SceneError(
                f"{buffer.byteLength} bytes are declared, and there are {len(memory)}", (*place, "byteLength")
            )
        self._buffers[index] = memory
        return memory


def _chunks(content: bytes) -> tuple[bytes, bytes | None]:
    """The JSON of a file, and the binary chunk of one that is GLB. Raises SceneError."""
    if not content.startswith(_MAGIC):
        return content, None
    if len(content) < 20:
        raise SceneError("the file ends within its header", ("header",))
    version, length = (int.from_bytes(content[k : k + 4], "little") for k in (4, 8))
    if version != 2:
        raise SceneError(f"only version 2 of GLB is read, not {version}", ("header", "version"))
    if length > len(content):
        raise SceneError(f"{length} bytes are declared, and there are {len(content)}", ("header", "length"))
    found: dict[int, bytes] = {}
    start, number = 12, 0
    while start + 8 <= length:
        size, kind = (int.from_bytes(content[start + k : start + k + 4], "little") for k in (0, 4))
        end = start + 8 + size
        if end > length:
            raise SceneError("it goes on beyond the end of the file", ("chunks", number))
        if number == 0 and kind != _JSON:
            raise SceneError("the first chunk is not JSON", ("chunks", 0))
        found.setdefault(kind, content[start + 8 : end])
        start, number = end + (-size % 4), number + 1
    if _JSON not in found:
        raise SceneError("there is no chunk of JSON", ("chunks",))
    return found[_JSON].rstrip(b"\0"), found.get(_BIN)

"""Polygons with values as an unstructured grid of VTK, in XML (`.vtu`), for ParaView and its like.

Arrays are in base64, each after its length in bytes, uncompressed and little-endian.
"""

from __future__ import annotations

import base64
from collections.abc import Mapping
from typing import Final
from xml.etree import ElementTree

import numpy as np

from solver.types import AnyArray, Corners, IntArray

_TYPES: Final = {
    "<f8": "Float64", "<f4": "Float32", "<i4": "Int32", "<i8": "Int64", "|u1": "UInt8",
}  # fmt: skip
_TRIANGLE: Final = 5
_QUADRILATERAL: Final = 9


def vtu_of(
    corners: Corners,
    count: IntArray,
    cells: Mapping[str, AnyArray],
    points: Mapping[str, AnyArray],
    facts: Mapping[str, AnyArray],
) -> bytes:
    """The file of polygons (n, 4, 3) with `count` (n,) corners, each with corners of its own.

    `cells` are values (n, ...) of polygons, `points` values (n, 4, ...) of their corners, `facts` of all.
    """
    there = np.arange(4) < count[:, None]
    root = ElementTree.Element(
        "VTKFile", type="UnstructuredGrid", version="1.0", byte_order="LittleEndian", header_type="UInt64"
    )
    grid = ElementTree.SubElement(root, "UnstructuredGrid")
    told = ElementTree.SubElement(grid, "FieldData")
    for name, values in facts.items():
        _array(told, name, np.atleast_1d(values), is_fact=True)
    piece = ElementTree.SubElement(
        grid, "Piece", NumberOfPoints=str(int(count.sum())), NumberOfCells=str(len(count))
    )
    of_points = ElementTree.SubElement(piece, "PointData")
    for name, values in points.items():
        _array(of_points, name, values[there])
    of_cells = ElementTree.SubElement(piece, "CellData")
    for name, values in cells.items():
        _array(of_cells, name, values)
    _array(ElementTree.SubElement(piece, "Points"), "Points", corners[there].astype("<f8"))
    shape = ElementTree.SubElement(piece, "Cells")
    _array(shape, "connectivity", np.arange(int(count.sum()), dtype="<i8"))
    _array(shape, "offsets", np.cumsum(count).astype("<i8"))
    _array(shape, "types", np.where(count == 3, _TRIANGLE, _QUADRILATERAL).astype("u1"))
    return b'<?xml version="1.0"?>\n' + ElementTree.tostring(root)


def _array(parent: ElementTree.Element, name: str, values: AnyArray, is_fact: bool = False) -> None:
    """Add an array (n,) or (n, components)."""
    flat = np.ascontiguousarray(values)
    kind = _TYPES[flat.dtype.newbyteorder("<").str]
    element = ElementTree.SubElement(parent, "DataArray", type=kind, Name=name, format="binary")
    if is_fact:
        element.set("NumberOfTuples", str(len(flat)))
    if flat.ndim > 1:
        element.set("NumberOfComponents", str(flat.shape[1]))
    raw = flat.astype(flat.dtype.newbyteorder("<")).tobytes()
    # The length and the numbers are coded apart from one another.
    head = base64.b64encode(len(raw).to_bytes(8, "little"))
    element.text = (head + base64.b64encode(raw)).decode()

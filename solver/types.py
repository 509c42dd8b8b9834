"""Shaped array aliases and ids shared by every floor of the solver.

numpy's type system does not carry shapes, so each alias says its shape here, once.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.float64]
"""float64, any shape named in the docstring that uses it."""

Float32Array: TypeAlias = NDArray[np.float32]
IntArray: TypeAlias = NDArray[np.int32]
Int64Array: TypeAlias = NDArray[np.int64]
BoolArray: TypeAlias = NDArray[np.bool_]
ByteArray: TypeAlias = NDArray[np.uint8]
AnyArray: TypeAlias = NDArray[Any]

Vector: TypeAlias = FloatArray
"""(3,) float64: a point or direction in metres, or an RGB triple in W/m2."""

Points: TypeAlias = FloatArray
"""(n, 3) float64: points in metres."""

Corners: TypeAlias = FloatArray
"""(n, 4, 3) float64: corners of quadrilaterals; a triangle repeats its last corner in slot 3."""

Spectra: TypeAlias = FloatArray
"""(n, channels) float64: one column where the scene is grey, else R, G, B."""

ObjectId: TypeAlias = str
"""The client's name of an object, unique in a scene."""

LUMINANCE_WEIGHTS: FloatArray = np.array([0.2126, 0.7152, 0.0722])
"""Rec.709 luminance of a linear RGB triple."""

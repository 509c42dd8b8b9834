"""Arrays that grow: capacity grows by half, the live part is a view."""

from __future__ import annotations

from typing import Any, Final, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

T = TypeVar("T", bound=np.generic)

_LITTLE: Final = 64
"""Part of the rows that are worth copying them"""


class GrowingArray(Generic[T]):
    """An array whose first axis grows by appending, at amortised constant cost; capacity grows by half."""

    def __init__(self, shape: tuple[int, ...], dtype: type[T], capacity: int = 256) -> None:
        self._data: NDArray[T] = np.zeros((capacity, *shape), dtype=dtype)
        self._size = 0

    @staticmethod
    def of(rows: NDArray[T]) -> GrowingArray[T]:
        """A copy of `rows`, with room for an eighth more."""
        array = GrowingArray(rows.shape[1:], rows.dtype.type, 0)
        array._data = np.empty((len(rows) + len(rows) // 8, *rows.shape[1:]), rows.dtype)
        array.append(rows)
        return array

    def __len__(self) -> int:
        return self._size

    @property
    def live(self) -> NDArray[T]:
        """The live rows, a view that stays valid until the next growth."""
        return self._data[: self._size]

    @property
    def nbytes(self) -> int:
        """Bytes held, spare capacity included."""
        return int(self._data.nbytes)

    def grow(self, count: int) -> NDArray[T]:
        """Append `count` rows of zeros and return a view of them."""
        fresh = self._extend(count)
        fresh[...] = 0
        return fresh

    def append(self, rows: NDArray[Any]) -> None:
        """Append rows."""
        self._extend(len(rows))[...] = rows

    def extend(self, count: int) -> int:
        """Append `count` rows with anything in them; returns the first one's number."""
        first = self._size
        self._extend(count)
        return first

    def truncate(self, count: int) -> None:
        """Keep the first `count` rows."""
        self._size = min(self._size, count)

    def trim(self, spare: float = 0.0625) -> None:
        """Give capacity back beyond what a few more rows will need: `spare` of those that there are.

        It is left where it is not much more, since all rows are copied.
        """
        enough = self._size + int(spare * self._size)
        if enough + enough // _LITTLE < len(self._data):
            kept: NDArray[T] = np.empty((enough, *self._data.shape[1:]), self._data.dtype)
            kept[: self._size] = self.live
            self._data = kept

    def _extend(self, count: int) -> NDArray[T]:
        needed = self._size + count
        if needed > len(self._data):
            grown = np.empty(
                (max(needed, len(self._data) + len(self._data) // 2), *self._data.shape[1:]), self._data.dtype
            )
            grown[: self._size] = self._data[: self._size]
            self._data = grown
        fresh = self._data[self._size : needed]
        self._size = needed
        return fresh

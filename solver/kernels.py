"""The one way hot loops are compiled: numba, cached on disk, GIL released, IEEE semantics kept.

`fastmath` is never used, since NaN and sign decide outcomes in most kernels; `parallel=True` is not
used either: kernels take a range and `solver.parallel` spreads ranges over threads.

numba keeps a kernel's machine code for as long as the kernel's own file does not change. The code of
kernels that it calls, and module constants, go into it too, wherever they are written: here they are part
of the stamp by which a kept kernel is known to be fresh.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any, ParamSpec, TypeVar, cast

import numba
import numpy as np
from numba.core.dispatcher import Dispatcher

P = ParamSpec("P")
R = TypeVar("R")


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile `function` on first call for its argument types; the machine code is cached on disk."""
    return cast("Callable[P, R]", _compiled(function))


def inline_kernel(function: Callable[P, R]) -> Callable[P, R]:
    """As `kernel`, for small functions called inside other kernels: LLVM is asked to inline them."""
    return cast("Callable[P, R]", _compiled(function, forceinline=True))


def _compiled(function: Callable[..., object], forceinline: bool = False) -> Any:
    dispatcher: Any = numba.njit(cache=True, nogil=True, error_model="numpy", forceinline=forceinline)(
        function
    )
    kept = dispatcher._cache._cache_file
    kept._source_stamp = (kept._source_stamp, _ingredients(cast("FunctionType", function)))
    return dispatcher


def _ingredients(function: FunctionType) -> str:
    """A digest of all kernels and constants that a kernel's module knew by then.

    Not of those alone that the kernel names: a helper that stands further down in the file is not known yet,
    but what it takes in from other files, at the top, is.
    """
    known = ((name, _stamp(value)) for name, value in function.__globals__.items())
    told = repr(sorted((name, stamp) for name, stamp in known if stamp is not None))
    return hashlib.sha256(told.encode()).hexdigest()


def _stamp(value: Any) -> str | None:
    if isinstance(value, Dispatcher):
        return repr(cast("Any", value)._cache._cache_file._source_stamp)
    match value:
        case int() | float() | tuple() | np.generic():
            return repr(value)
        case np.ndarray():
            return repr((value.dtype.str, value.shape, value.tobytes()))
        case ModuleType() if value.__name__.startswith("solver."):
            return repr(Path(str(value.__file__)).read_bytes())
        case _:
            return None

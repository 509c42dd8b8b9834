"""The one way hot loops are compiled: numba, cached on disk, GIL released, IEEE semantics kept.

`fastmath` is never used, since NaN and sign decide outcomes in most kernels; `parallel=True` is not
used either: kernels take a range and `solver.parallel` spreads ranges over threads.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import ParamSpec, TypeVar, cast

import numba

P = ParamSpec("P")
R = TypeVar("R")


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile `function` on first call for its argument types; the machine code is cached on disk."""
    return cast("Callable[P, R]", numba.njit(cache=True, nogil=True, error_model="numpy")(function))


def inline_kernel(function: Callable[P, R]) -> Callable[P, R]:
    """As `kernel`, for small functions called inside other kernels: LLVM is asked to inline them."""
    return cast(
        "Callable[P, R]",
        numba.njit(cache=True, nogil=True, error_model="numpy", forceinline=True)(function),
    )

"""The machine code of kernels that is kept on disk, loaded at one go and without calling any.

Calling them all, as `solver.engine.warm` does, needs scenes, rays and OpenGL, and these start threads. What
is loaded here without any is there after a fork.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from types import CodeType, FunctionType, ModuleType
from typing import Any

from numba.core.dispatcher import Dispatcher


def load_kept_kernels() -> tuple[str, ...]:
    """Load what is kept of the kernels that the solver's modules call, as far as they have been imported.

    Returns the names of those of which nothing is kept: they have not been compiled since their source
    changed, or are never called.
    """
    missing = [kernel for kernel in entered_kernels() if not _load(kernel)]
    return tuple(sorted(f"{kernel.__module__}.{kernel.__name__}" for kernel in missing))


def entered_kernels() -> list[Any]:
    """The kernels that modules of the solver may enter from Python, as far as those have been imported."""
    return list({id(kernel): kernel for module in _modules() for kernel in _entered(module)}.values())


def _modules() -> list[ModuleType]:
    return [module for name, module in sorted(sys.modules.items()) if name.startswith("solver.")]


def _entered(module: ModuleType) -> Iterator[Any]:
    """Kernels that a module may enter from Python; what kernels alone call has its code in theirs."""
    kernels = {name: value for name, value in vars(module).items() if isinstance(value, Dispatcher)}
    inside = {name for kernel in kernels.values() for name in _named(kernel.py_func.__code__)}
    outside = {name for code in _functions(module, vars(module)) for name in _named(code)}
    for name, kernel in kernels.items():
        is_own = kernel.__module__ == module.__name__
        if name in outside or (is_own and name not in inside and not kernel.targetoptions.get("forceinline")):
            yield kernel


def _functions(module: ModuleType, names: Any) -> Iterator[CodeType]:
    """The code of a module's own functions, and of the methods of its classes."""
    for value in tuple(names.values()):
        if isinstance(value, Dispatcher):
            continue
        match getattr(value, "__func__", getattr(value, "fget", getattr(value, "__wrapped__", value))):
            case FunctionType() as function if function.__module__ == module.__name__:
                yield function.__code__
            case type() as kind if kind.__module__ == module.__name__:
                yield from _functions(module, vars(kind))


def _named(code: CodeType) -> Iterator[str]:
    """Names that code, or functions inside it, may look up."""
    yield from code.co_names
    for inner in code.co_consts:
        if isinstance(inner, CodeType):
            yield from _named(inner)


def _load(kernel: Any) -> bool:
    """Load all variants of a kernel that are kept; False where there are none.

    numba offers no way to ask for them: what it keeps is an index by signature, processor and source.
    """
    codegen = kernel.targetctx.codegen()
    kept = [
        key
        for key in kernel._cache._cache_file._load_index()
        if kernel._cache._index_key(key[0], codegen) == key
    ]
    for signature, *_ in kept:
        kernel.compile(signature)
    return bool(kept)

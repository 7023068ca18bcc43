"""Compiling with Numba: imported only when something is compiled, or is Numba's own to call."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable
from typing import Any

import numba
from numba.core import event, sigutils
from numba.core.ccallback import CFunc
from numba.extending import overload, register_jitable

import mbsim.core.address_forms  # noqa: F401  (what they are for compiled code)
from mbsim.core import linking, profile
from mbsim.core.function_cache import CodeCache
from mbsim.core.jitable import take_marked
from mbsim.core.machine_code import Code

_installed = False


def register() -> None:
    """Tell Numba of the functions marked since the last compilation: what is loaded needs none."""
    global _installed
    if not _installed:
        linking.install()
        _installed = True
    for function, form, options in take_marked():
        if form is not None:
            overload(function)(form)
        else:
            usual = {"error_model": "numpy", "no_cfunc_wrapper": True}
            register_jitable(**(usual | dict(options)))(function)


class _Watch(event.Listener):
    """Counts the time that Numba compiles (loading from the cache is not compiling)."""

    def __init__(self, begins: Callable[[], None], took: Callable[[float], None]) -> None:
        self._begins, self._took = begins, took
        self._depth = 0
        self._began = 0.0
        self._collects = False
        self._counts: profile.Profile | None = None

    def on_start(self, happened: Any) -> None:
        if self._depth == 0:
            self._began = time.perf_counter()
            self._counts = profile.running
            if self._counts is not None:
                self._counts.enter("compile")
            self._collects = gc.isenabled()
            gc.disable()  # the compiler's million small objects are looked through again and again
            self._begins()
        self._depth += 1

    def on_end(self, happened: Any) -> None:
        self._depth -= 1
        if self._depth == 0:
            if self._collects:
                gc.enable()
            self._took(time.perf_counter() - self._began)
            if self._counts is not None:
                self._counts.leave()


def watch(begins: Callable[[], None], took: Callable[[float], None]) -> None:
    """Have one function called before Numba compiles, and one with the seconds behind that."""
    listener = _Watch(begins, took)
    event.register("numba:run_pass", listener)
    # around the passes, and what Python calls is linked there
    event.register("numba:compile", listener)


def dispatcher(
    py_func: Callable[..., Any], allocates: bool, on_miss: Callable[[str], None] | None
) -> Any:
    """Return a function that Python calls; it is kept if somebody is told what no cache holds."""
    linking.install_library()
    options: dict[str, Any] = {"error_model": "numpy", "nogil": True, "_nrt": allocates}
    made: Any = numba.njit(**options)(py_func)
    if on_miss is None:
        register()
    else:
        made._cache = CodeCache(py_func, on_miss)
    return made


def c_function(py_func: Callable[..., Any], signature: Any, allocates: bool) -> Any:
    """Return a function compiled as a C function, with its `address`."""
    register()
    typed = sigutils.normalize_signature(str(signature))
    made: Any = CFunc(py_func, typed, {}, {"error_model": "numpy", "_nrt": allocates})
    made.compile()
    return made


def code_of(made: Any) -> Code:
    """Return what `c_function` compiled."""
    library = made._library
    module = library._final_module
    declared = [v.name for of in (module.functions, module.global_variables) for v in of
                if v.is_declaration and not v.name.startswith("llvm.")]  # fmt: skip
    return Code(made.native_name, tuple(sorted(declared)), library._get_compiled_object())

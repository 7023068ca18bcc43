"""The one compile policy: what is compiled, and when.

Two ways into compiled code, and only these:

* `function(f)`: a Numba dispatcher, for the few functions that Python calls;
* `address(f, signature)`: a C function behind an address, for everything that a
  scene chooses (laws, pairs) and for what an integrator calls without knowing it.

Everything these call is a plain function marked `jitable`. `core.code_cache` keeps the result.
"""

from __future__ import annotations

import functools
import gc
import time
from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
from numba.core import event, sigutils
from numba.core.ccallback import CFunc
from numba.extending import register_jitable

import mbsim.core.address  # noqa: F401  (compiled forms of core.memory)
from mbsim.core import linking, profile
from mbsim.core.code_cache import CodeCache, cache_root, is_known, source_digest
from mbsim.core.jitable import take_marked

__all__ = ["address", "cache_root", "function", "planned", "source_digest"]

Made = TypeVar("Made")

#: Seconds spent compiling in this process, and the hook that is told before the first compilation.
compile_seconds = 0.0
on_first_compile: Callable[[], None] | None = None
#: Roots that were compiled in this process, and of the run at hand, the one that is about to be
#: among them; how many the run will have as far as is known (`planned`). One hook is told the name
#: before each, the other that more are known.
total = compiled = expected = 0
on_compile: Callable[[str], None] | None = None
on_plan: Callable[[], None] | None = None

_missing: list[str] | None = None  # names, while roots are counted
_planning = False


_installed = False


def _register() -> None:
    """Tell Numba of the functions marked since the last compilation: what is loaded needs none."""
    global _installed
    if not _installed:
        linking.install()
        _installed = True
    for function in take_marked():
        register_jitable(error_model="numpy", no_cfunc_wrapper=True)(function)


class _Watch(event.Listener):
    """Counts the time that Numba compiles (loading from the cache is not compiling)."""

    def __init__(self) -> None:
        self._depth = 0
        self._began = 0.0
        self._collects = False
        self._counts: profile.Profile | None = None

    def on_start(self, happened: Any) -> None:
        global on_first_compile
        if self._depth == 0:
            self._began = time.perf_counter()
            self._counts = profile.running
            if self._counts is not None:
                self._counts.enter("compile")
            self._collects = gc.isenabled()
            gc.disable()  # the compiler's million small objects are looked through again and again
            if on_first_compile is not None:
                tell, on_first_compile = on_first_compile, None
                tell()
        self._depth += 1

    def on_end(self, happened: Any) -> None:
        global compile_seconds
        self._depth -= 1
        if self._depth == 0:
            if self._collects:
                gc.enable()
            compile_seconds += time.perf_counter() - self._began
            if self._counts is not None:
                self._counts.leave()


_watch = _Watch()
event.register("numba:run_pass", _watch)
event.register("numba:compile", _watch)  # around the passes, and what Python calls is linked there


class _NotKeptError(Exception):
    """What is only counted is in no cache."""


def _about_to_compile(name: str) -> None:
    """Count a root that no cache holds, and tell of it."""
    global total, compiled, expected
    if _missing is not None:
        _missing.append(name)
        raise _NotKeptError
    _register()
    total += 1
    compiled += 1
    expected = max(expected, compiled)
    if on_compile is not None:
        on_compile(name)


def planned(make: Callable[[], Made]) -> Made:
    """Return what `make` makes, having counted first what it asks for that no cache holds.

    To be counted `make` is called once more, with addresses that nobody may call; it leaves no more
    behind than a second call would set again.
    """
    global _missing, _planning, expected
    if _planning:
        return make()
    _missing, _planning = [], True
    try:
        made = make()
        missing, _missing = len(_missing), None
        if missing == 0:
            return made
        expected = compiled + missing
        if on_plan is not None:
            on_plan()
        return make()
    finally:
        _missing, _planning = None, False


@functools.cache
def function(py_func: Callable[..., Any], allocates: bool = True) -> Callable[..., Any]:
    """Return `py_func` compiled at its first call (or loaded from the cache), once a process.

    It runs without Python's lock, so that another thread may write meanwhile. What stands elsewhere
    is not cached: Numba would keep it while the arrays that it looks at change. What `allocates` no
    arrays need not count who uses which: that costs a call for each that is passed on.
    """
    linking.install_library()
    options: dict[str, Any] = {"error_model": "numpy", "nogil": True, "_nrt": allocates}
    made: Any = numba.njit(**options)(py_func)
    if is_known(py_func):
        made._cache = CodeCache(py_func, _about_to_compile)
    else:
        _register()
    return cast(Callable[..., Any], made)


def awaited(py_func: Callable[..., Any], allocates: bool = True) -> Callable[..., Any]:
    """Return `function(py_func)`, counted (`planned`) as what is called soon."""
    made: Any = function(py_func, allocates)
    if _missing is not None and isinstance(made._cache, CodeCache):
        if not made.overloads and made._cache.is_empty():
            _missing.append(py_func.__qualname__)
    return cast(Callable[..., Any], made)


_kept: dict[Any, Any] = {}
#: Addresses by function and id of the signature, which is kept so that the id stays its own: most
#: are written down once, and their hashes take long.
_known: dict[tuple[Any, int], tuple[int, Any]] = {}
_KNOWN_MOST = 1 << 12


def _note(key: tuple[Any, Any], address: int) -> int:
    """Return an address, having noted it."""
    if len(_known) >= _KNOWN_MOST:
        _known.clear()
    py_func, signature = key
    _known[py_func, id(signature)] = address, signature
    return address


def address(py_func: Callable[..., Any], signature: Any, allocates: bool = False) -> int:
    """Return the address of `py_func` compiled as a C function; it lives as long as the process.

    As with `function`, what stands elsewhere is not cached, and only what `allocates` may make
    arrays, as users' functions may.
    """
    global compile_seconds
    if (known := _known.get((py_func, id(signature)))) is not None:
        return known[0]
    key = py_func, signature
    if key in _kept:
        return _note(key, int(_kept[key].address))
    linking.install_library()
    typed = sigutils.normalize_signature(signature)
    made: Any = CFunc(py_func, typed, {}, {"error_model": "numpy", "_nrt": allocates})
    if is_known(py_func):
        made._cache = CodeCache(py_func, _about_to_compile)
    else:
        _register()
    before, counted, began = total, compile_seconds, time.perf_counter()
    try:
        with profile.part("compile"):  # loading counts as such
            made.compile()
    except _NotKeptError:
        return NOT_YET
    if total > before:
        # what Numba and the linker do between the passes is compiling as well
        compile_seconds = counted + time.perf_counter() - began
    _kept[key] = made
    return _note(key, int(made.address))


#: Stands for the address of what is only counted; 0 would say that nothing is wanted.
NOT_YET = -1

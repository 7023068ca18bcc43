"""The one compile policy: what is compiled, and when.

Two ways into compiled code, and only these:

* `function(f)`: a Numba dispatcher, for the few functions that Python calls;
* `address(f, signature)`: a C function behind an address, for everything that a
  scene chooses (laws, pairs) and for what an integrator calls without knowing it.

Everything these call is a plain function marked `jitable`. `core.code_cache` keeps the result.
A process that finds all its C functions there does not import Numba: `core.compiling` does.
"""

from __future__ import annotations

import functools
import time
from collections.abc import Callable
from types import ModuleType
from typing import Any, TypeVar, cast

from mbsim.core import machine_code, profile
from mbsim.core.code_cache import cache_root, is_known, source_digest

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


def tell_of_first() -> None:
    """Tell that something is compiled, once."""
    global on_first_compile
    if on_first_compile is not None:
        tell, on_first_compile = on_first_compile, None
        tell()


def _add_seconds(seconds: float) -> None:
    """Count time that was spent compiling."""
    global compile_seconds
    compile_seconds += seconds


@functools.cache
def _compiler() -> ModuleType:
    """Return `core.compiling`, which counts here what it takes."""
    from mbsim.core import compiling

    compiling.watch(tell_of_first, _add_seconds)
    return compiling


class _NotKeptError(Exception):
    """What is only counted is in no cache."""


def _about_to_compile(name: str) -> None:
    """Count a root that no cache holds, and tell of it."""
    global total, compiled, expected
    if _missing is not None:
        _missing.append(name)
        raise _NotKeptError
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
    compiling = _compiler()

    def on_miss(name: str) -> None:
        _about_to_compile(name)
        compiling.register()

    made = compiling.dispatcher(py_func, allocates, on_miss if is_known(py_func) else None)
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

    `signature` is a `core.signature.Signature`. As with `function`, what stands elsewhere is not
    cached, and only what `allocates` may make arrays, as users' functions may.
    """
    global compile_seconds
    if (known := _known.get((py_func, id(signature)))) is not None:
        return known[0]
    key = py_func, signature
    if key in _kept:
        return _note(key, int(_kept[key].address))
    place = None
    if is_known(py_func):
        with profile.part("load"):
            place = machine_code.Place(py_func, signature, allocates)
            code = place.find()
            loaded = machine_code.load(code) if code is not None else None
        if loaded is not None:
            _kept[key] = loaded
            return _note(key, loaded.address)
        try:
            _about_to_compile(py_func.__qualname__)
        except _NotKeptError:
            return NOT_YET
    compiling = _compiler()
    before, began = compile_seconds, time.perf_counter()
    with profile.part("compile"):
        made = compiling.c_function(py_func, signature, allocates)
        if place is not None:
            place.keep(compiling.code_of(made))
    # what Numba and the linker do between the passes is compiling as well
    compile_seconds = before + time.perf_counter() - began
    _kept[key] = made
    return _note(key, int(made.address))


#: Stands for the address of what is only counted; 0 would say that nothing is wanted.
NOT_YET = -1

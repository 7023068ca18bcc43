"""The time that solving takes: seconds, those left out in which code is compiled or loaded.

A machine compiles a kernel once, and a process loads it once. Numba does both under one lock, whose
events are heard here once something is to be compiled. Compiled code asks the same clock (`late`),
so that a large factorisation ends in time as well.
"""

from __future__ import annotations

import ctypes
import functools
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.core import jit
from mbsim.core.address import call_float
from mbsim.core.jitable import jitable
from mbsim.core.memory import floats_at

if TYPE_CHECKING:
    from mbsim.fclib.problem import Vector


class _Preparing:
    """Counts the seconds in which the compiler's lock is held."""

    def __init__(self) -> None:
        self.seconds = 0.0
        self.shared = np.zeros(1)  # the same, for compiled code
        self._depth = 0
        self._began = 0.0

    def on_start(self, happened: Any) -> None:
        if self._depth == 0:
            self._began = time.perf_counter()
        self._depth += 1

    def on_end(self, happened: Any) -> None:
        self._depth -= 1
        if self._depth == 0:
            self.seconds += time.perf_counter() - self._began
            self.shared[0] = self.seconds


_preparing = _Preparing()
_seen: dict[Callable[..., Any], Callable[..., Any]] = {}
# perf_counter itself, no function of ours: it takes no notice of Ctrl+C, which would be lost here
_now = ctypes.CFUNCTYPE(ctypes.c_double)(time.perf_counter)
_addresses = np.array(
    [float(ctypes.cast(_now, ctypes.c_void_p).value or 0), _preparing.shared.ctypes.data, np.inf]
)


def clock() -> float:
    """Return seconds, without those in which code was compiled or loaded."""
    return time.perf_counter() - _preparing.seconds


def until(deadline: float) -> Any:
    """Return what tells compiled code a value of `clock` (`late`): three numbers.

    These are the addresses of a function that gives the time and of the seconds that do not count,
    and the deadline.
    """
    found = _addresses.copy()
    found[2] = deadline
    return found


@jitable
def unlimited() -> Vector:
    """Return an `until` that never comes."""
    return np.array([0.0, 0.0, np.inf])


@jitable
def late(until: Vector) -> bool:
    """Return whether the time is over; a question takes 0.2 us."""
    if until[2] == np.inf:
        return False
    now: float = call_float(np.int64(until[0]), ())
    over: bool = now - floats_at(until[1], 1)[0] > until[2]
    return over


@functools.cache
def _listen() -> None:
    """Hear of the compiler's lock."""
    from numba.core import event

    class Lock(event.Listener):
        def on_start(self, happened: Any) -> None:
            _preparing.on_start(happened)

        def on_end(self, happened: Any) -> None:
            _preparing.on_end(happened)

    event.register("numba:compiler_lock", Lock())


@contextmanager
def loading() -> Iterator[None]:
    """Leave out the seconds that the block takes, which loads code."""
    _preparing.on_start(None)
    try:
        yield
    finally:
        _preparing.on_end(None)


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function compiled (`jit.function`); what its first call needs is loading, too."""
    found = _seen.get(function)
    if found is None:
        with loading():
            _listen()
            found = _seen[function] = jit.function(function)
        # looking at arguments of a new kind, and getting the code for them
        for name in ("typeof_pyval", "_compile_for_args"):
            setattr(found, name, _left_out(getattr(found, name)))
    return found


def _left_out(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function whose seconds are left out."""

    def called(*arguments: Any, **options: Any) -> Any:
        with loading():
            return function(*arguments, **options)

    return called

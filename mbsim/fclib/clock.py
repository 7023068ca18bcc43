"""The time that solving takes: seconds, those left out in which code is compiled or loaded.

A machine compiles a kernel once, and a process loads it once. Numba does both under one lock, whose
events are heard here.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from numba.core import event

from mbsim.core import jit


class _Preparing(event.Listener):
    """Counts the seconds in which the compiler's lock is held."""

    def __init__(self) -> None:
        self.seconds = 0.0
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


_preparing = _Preparing()
event.register("numba:compiler_lock", _preparing)
_seen: dict[Callable[..., Any], Callable[..., Any]] = {}


def clock() -> float:
    """Return seconds, without those in which code was compiled or loaded."""
    return time.perf_counter() - _preparing.seconds


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function compiled (`jit.function`); finding its cache is loading, too."""
    found = _seen.get(function)
    if found is None:
        _preparing.on_start(None)
        found = _seen[function] = jit.function(function)
        _preparing.on_end(None)
    return found

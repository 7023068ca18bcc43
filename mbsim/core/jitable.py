"""Mark a plain Python function as callable from compiled code.

A marked function stays what it is: it can be called, tested and read as plain
Python, and its module does not import Numba. Only when something is compiled
does `core.jit` tell Numba of the marked functions. So `mbsim check` starts
without Numba, and a law file says nothing about compilation.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

F = TypeVar("F", bound=Callable[..., Any])

_marked: list[Callable[..., Any]] = []


def jitable(function: F) -> F:
    """Return `function` unchanged, and remember that compiled code may call it."""
    _marked.append(function)
    return function


def take_marked() -> list[Callable[..., Any]]:
    """Return the functions marked since the last call."""
    taken = list(_marked)
    _marked.clear()
    return taken

"""Marks a plain function as callable from compiled code.

A marked function stays what it is: it can be called, tested and read as plain
Python, and its module does not import Numba. Only when something is compiled
does `core.jit` tell Numba of the marked functions. So `mbsim check`, and a run that finds its code
compiled, do without Numba, and a law file says nothing about compilation.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, TypeVar

F = TypeVar("F", bound=Callable[..., Any])


class Marked(NamedTuple):
    """A function that compiled code may call."""

    function: Callable[..., Any]
    #: Makes what is compiled in its place of Numba's types of the arguments; None: itself.
    form: Callable[..., Any] | None
    options: Mapping[str, Any]  # of Numba, other than those of all functions


_marked: list[Marked] = []


def jitable(function: F) -> F:
    """Return `function` unchanged, and remember that compiled code may call it."""
    _marked.append(Marked(function, None, {}))
    return function


def uncounted(function: F) -> F:
    """Return `function` unchanged, as `jitable`, where it makes no arrays and is called often.

    Of arrays that it is given nobody need count who uses them, which costs a call for each that is
    passed on. What it calls is compiled so too.
    """
    _marked.append(Marked(function, None, {"_nrt": False}))
    return function


def mark(function: Callable[..., Any], **options: Any) -> None:
    """Remember that compiled code may call a function, which is compiled with Numba's options."""
    _marked.append(Marked(function, None, options))


def compiled_form(of: Callable[..., Any]) -> Callable[[F], F]:
    """Remember what compiled code has in the place of a function.

    What is decorated is called with Numba's types of the arguments and returns a function of the
    same arguments, as `numba.extending.overload` has it.
    """

    def remember(form: F) -> F:
        _marked.append(Marked(of, form, {}))
        return form

    return remember


def take_marked() -> list[Marked]:
    """Return what was marked since the last call."""
    taken = list(_marked)
    _marked.clear()
    return taken

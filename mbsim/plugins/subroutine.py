"""User subroutines of forces and variables: SFOSUB, GFOSUB, VARSUB and their like.

All are called as (id, time, par, npar, dflag, iflag) and return a number or a list of them.
They stay interpreted: what they ask by `py_sysfnc` is looked up in Python.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from mbsim.model.elements import Subroutine
from mbsim.model.names import element_name, is_adams
from mbsim.plugins import guard
from mbsim.plugins.helpers import host
from mbsim.plugins.source.find import find_script
from mbsim.plugins.source.octave import end_all
from mbsim.plugins.source.script import Scripts, user_function

ARGUMENTS = "id, time, par, npar, dflag, iflag"


@dataclass(frozen=True, eq=False)
class UserSubroutine:
    """A user subroutine, ready to be called; keep it alive as long as `address` is in use.

    Attributes
    ----------
    address : int
        Of the C function that `guard.state_callback` made.
    count : int
        How many numbers it returns.
    source : Path
        The user's file.
    name : str
        The function in that file.
    element : (str, int)
        Statement and id of the element that names it.
    looks : bool
        Whether its script may ask for functions of the language by `py_sysfnc`.
    """

    address: int
    count: int
    source: Path
    name: str
    element: tuple[str, int]
    looks: bool
    keep: object = field(default=None, repr=False)


def load_subroutine(
    user: Subroutine,
    element: tuple[str, int],
    count: int,
    plugin_files: Sequence[Path],
    scripts: Scripts,
    deck: str = "",
) -> UserSubroutine:
    """Return the subroutine of an element (its statement and id) that gives `count` numbers.

    Messages name the element as the file `deck` does.

    Raises
    ------
    ModelError
        If the file or the function cannot be used; the message says what to change.
    """
    title = element_name(deck, *element)
    prefix = "ROUTINE" if is_adams(deck) else "usrsub"
    script = find_script(user, user.fnc_name, title, prefix, plugin_files, scripts)
    function = user_function(script, user.fnc_name, title, ARGUMENTS)
    place = user.fnc_name, str(script.path)
    address, keep = guard.state_callback(function, (title, element[1]), place, user.par, count)
    return UserSubroutine(address, count, script.path, user.fnc_name, element, script.looks, keep)


def begin_run(log: Callable[[str], None] | None) -> None:
    """Forget what an earlier run of this process left behind."""
    guard.failure.clear()
    host.forget()
    if log is not None:
        host.log = log


def end_run() -> None:
    """End what a run started."""
    end_all()

"""User subroutines in place of expressions: SFOSUB, GFOSUB, VARSUB, DIFSUB, MOTSUB and their like.

They are called as `model.subroutines.Call` says and return a number or a list of them.
They stay interpreted: what they ask by `py_sysfnc` is looked up in Python.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from mbsim.errors import PluginError
from mbsim.model.names import element_name, is_adams
from mbsim.model.source import RelationSubroutine, StateSubroutine
from mbsim.model.subroutines import Call, Wanted
from mbsim.plugins import guard
from mbsim.plugins.helpers import host
from mbsim.plugins.relation import related
from mbsim.plugins.returned import NotAForce, two_parts
from mbsim.plugins.source.find import find_either
from mbsim.plugins.source.native import asks, native
from mbsim.plugins.source.octave import end_all
from mbsim.plugins.source.script import Scripts, require, user_function
from mbsim.plugins.source.shared_library import Library


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
        Whether it may ask for functions of the language by `py_sysfnc`.
    acts : bool
        Whether motion may follow from what it gives.
    how : str
        ``interpreted``, or the language of a library.
    """

    address: int
    count: int
    source: Path
    name: str
    element: tuple[str, int]
    looks: bool
    acts: bool = True
    how: str = "interpreted"
    keep: Any = field(default=None, repr=False)

    def called(self, time: float, results: npt.NDArray[np.float64]) -> int:
        """Write what one that looks at no state gives at a time; return 0 or a code."""
        return int(self.keep(0, time, 0, results.ctypes.data))


def load_subroutine(
    each: Wanted,
    plugin_files: Sequence[Path],
    scripts: Scripts,
    deck: str = "",
    span: tuple[float, float] = (0.0, 1.0),
) -> UserSubroutine:
    """Return the subroutine of an element; messages name the element as the file `deck` does.

    `span`: the times over which the deck runs.

    Raises
    ------
    ModelError
        If the file or the function cannot be used; the message says what to change.
    """
    user, title = each.user, element_name(deck, each.statement, each.id)
    prefix = "ROUTINE" if is_adams(deck) else "usrsub"
    parts = _parts(each)
    script = find_either(user, user.fnc_name, title, prefix, plugin_files, scripts)

    def named(name: str, *parts: int) -> Callable[..., Any]:
        if isinstance(script, Library):
            return native(script, name, prefix, user.language, *parts)[0]
        require(script, name, title, prefix if prefix == "ROUTINE" else f"{prefix}_fnc_name")
        return user_function(script, name, title, each.call.value)

    if isinstance(script, Library):
        function, how = native(script, user.fnc_name, prefix, user.language, *parts)
        looks = asks(script)
    else:
        function = named(user.fnc_name)
        looks, how = script.looks, "interpreted"
    place = user.fnc_name, str(script.path)
    if isinstance(user, StateSubroutine):
        function, looks = of_states(function, user), True
    elif isinstance(user, RelationSubroutine):
        function = related(function, user, script, named, span)
    address, keep = guard.state_callback(function, title, place, each)
    looks = looks and each.call not in (Call.MOTION, Call.RELATION)
    return UserSubroutine(
        address,
        each.results,
        script.path,
        user.fnc_name,
        (each.statement, each.id),
        looks,
        each.kind != "REQUEST",
        how,
        keep,
    )


def _parts(each: Wanted) -> tuple[int, ...]:
    """Return how many numbers a subroutine of a library writes, array by array."""
    if isinstance(each.user, StateSubroutine):
        return len(each.user.state_ids), each.user.outputs
    if isinstance(each.user, RelationSubroutine):
        return (1,)
    return (1 if each.call is Call.MOTION else each.results,)


def of_states(function: Callable[..., Any], user: StateSubroutine) -> Callable[..., Any]:
    """Return a GSESUB as a function that looks its states and inputs up.

    That is one of (id, time, par, npar, dflag, iflag), which returns slopes, then outputs. Being a
    function of time, states and inputs, it is called once for the same of these.
    """
    n, m = len(user.state_ids), user.outputs
    kept: list[Any] = [None, []]

    def looked_up(
        id: int, time: float, par: list[float], npar: int, dflag: int, iflag: int, *_: Any
    ) -> Any:
        states = [_known("DIF", state) for state in user.state_ids]
        inputs = [_known("VARVAL", variable) for variable in user.input_ids]
        key = (time, iflag, *states, *inputs)
        if kept[0] != key:
            result = function(id, time, par, npar, dflag, iflag, n, states, len(inputs), inputs, m)
            if not iflag:
                slopes, outputs = two_parts(result, n, m)
                kept[:] = key, slopes + outputs
        return kept[1][0] if n + m == 1 and kept[1] else list(kept[1])

    return looked_up


def _known(name: str, id: int) -> float:
    """Return a state or a variable at the state of the call."""
    value, errflg = host.sysfnc(name, [id])
    if errflg:
        raise NotAForce(
            f"{name}({id}), an input, needs forces or accelerations, which are not known yet"
        )
    return float(value)


#: Times at which the rates of a motion are tried, how far off the differences for that are taken,
#: in parts of the run, and by how much both may differ.
_TRIED, _APART, _ALIKE = 9, 1e-7, 0.1


def check_rates(user: UserSubroutine, each: Wanted, begin: float, end: float, deck: str) -> None:
    """Refuse a MOTSUB whose rates are not those of what it gives: bodies would drift from it.

    What it raises meanwhile is left to the run.

    Raises
    ------
    PluginError
        If that is so at more than half of the times that are tried.
    """
    found = np.zeros((3, 3))
    wrong: list[tuple[float, int, float, float]] = []
    for t in np.linspace(begin, end, _TRIED + 2)[1:-1]:
        h = _APART * (end - begin)
        if any(user.called(at, row) for at, row in zip((t - h, t, t + h), found, strict=True)):
            guard.failure.clear()
            return
        for order in range(1, len(each.orders)):
            rate, seen = found[1, order], (found[2, order - 1] - found[0, order - 1]) / (2.0 * h)
            noise = 1e-15 * np.abs(found[:, order - 1]).max() / h
            if abs(rate - seen) > _ALIKE * max(abs(rate), abs(seen)) + noise:
                wrong.append((float(t), order, float(rate), float(seen)))
    for order in range(1, len(each.orders)):
        of_order = [one for one in wrong if one[1] == order]
        if 2 * len(of_order) > _TRIED:
            t, _, rate, seen = of_order[0]
            before, iord = each.orders[order - 1], each.orders[order]
            raise PluginError(
                f"{element_name(deck, each.statement, each.id)}: {user.name} ({user.source}) gives "
                f"{rate:.6g} with iord {iord} at time {t:.6g}, but what it gives with iord "
                f"{before} changes by {seen:.6g} a unit of time there: one must be the rate of the "
                "other"
            )


def begin_run(log: Callable[[str], None] | None) -> None:
    """Forget what an earlier run of this process left behind."""
    guard.failure.clear()
    host.forget()
    if log is not None:
        host.log = log


def end_run() -> None:
    """End what a run started."""
    end_all()

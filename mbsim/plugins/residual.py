"""Force_Element: from the residual that a deck names to addresses that a run can call.

The script declares the unknowns of each of its residuals,

    ELEMENT_UNKNOWNS = {"maxwell": {"f": 0.0}}

by name, with the number at which each begins, or {"initial": .., "scale": .., "kind": ..}. Whether
r = 0 gives f' or f is found by asking the residual at many points, where `kind` does not say.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from mbsim.errors import ModelError
from mbsim.laws.residual import KINDS, MOST_UNKNOWNS, inputs
from mbsim.model.elements import ForceElement
from mbsim.plugins import guard
from mbsim.plugins.compile.residual_trials import points, refuse_jumps, sort_unknowns
from mbsim.plugins.helpers import host
from mbsim.plugins.permission import named, not_run, watched
from mbsim.plugins.returned import numbers
from mbsim.plugins.source.find import find_script
from mbsim.plugins.source.script import Script, Scripts, user_function
from mbsim.plugins.types import Unknown, UserResidual

ARGUMENTS = "x, xdot, f, fdot, t, par"
_WORDS = ("initial", "scale", "kind")
_EXAMPLE = '{"NAME": {"f": 0.0}}'


def title_of(element: ForceElement) -> str:
    """Return how messages name an element: file, line and id."""
    place = f"{element.source.file}:{element.source.line}: " if element.source.file else ""
    return f"{place}Force_Element[{element.id}]"


def declared(script: Script, name: str, title: str, axes: int) -> tuple[Unknown, ...]:
    """Return the unknowns that a script declares for a residual.

    Raises
    ------
    ModelError
        Saying what of the declaration is wrong, and what is allowed.
    """
    table = script.values.get("ELEMENT_UNKNOWNS")
    if not isinstance(table, dict) or name not in table:
        what = "is missing" if table is None else f"has no {name!r}"
        raise ModelError(
            f"{title}: {script.path}: ELEMENT_UNKNOWNS {what}: must be like {_EXAMPLE}, with the "
            f"unknowns of {name}"
        )
    given = table[name]
    if isinstance(given, (list, tuple)) and all(isinstance(word, str) for word in given):
        given = dict.fromkeys(given, 0.0) if len(set(given)) == len(given) else None
    if not isinstance(given, Mapping) or not all(isinstance(word, str) for word in given):
        raise ModelError(
            f"{title}: {script.path}: ELEMENT_UNKNOWNS[{name!r}] = {table[name]!r}: must be names, "
            'each once, with the number at which each begins: {"f": 0.0}'
        )
    if not axes <= len(given) <= MOST_UNKNOWNS:
        raise ModelError(
            f"{title}: {script.path}: ELEMENT_UNKNOWNS[{name!r}] has {len(given)} unknowns: must "
            f"be {axes} to {MOST_UNKNOWNS}, the first {axes} being the forces of the directions"
        )
    return tuple(_unknown(script, name, title, word, value) for word, value in given.items())


def _unknown(script: Script, name: str, title: str, word: str, value: Any) -> Unknown:
    """Return one unknown of a declaration."""
    where = f"{title}: {script.path}: ELEMENT_UNKNOWNS[{name!r}][{word!r}] = {value!r}"
    about = value if isinstance(value, Mapping) else {"initial": value}
    if not word.isidentifier() or any(key not in _WORDS for key in about):
        raise ModelError(f"{where}: must be a number, or have {', '.join(_WORDS)} alone")
    initial, scale, kind = (about.get(key) for key in _WORDS)
    if not _is_number(0.0 if initial is None else initial):
        raise ModelError(f"{where}: must begin at a finite number")
    if scale is not None and (not _is_number(scale) or not scale > 0.0):
        raise ModelError(f"{where}: scale must be a number > 0")
    if kind is not None and kind not in KINDS:
        raise ModelError(f"{where}: kind must be one of {', '.join(KINDS)}")
    return Unknown(
        word,
        0.0 if initial is None else float(initial),
        None if scale is None else float(scale),
        None if kind is None else KINDS.index(kind),
    )


def _is_number(value: Any) -> bool:
    kind = isinstance(value, (int, float)) and not isinstance(value, bool)
    return kind and math.isfinite(value)


def load_residual(
    element: ForceElement,
    plugin_files: Sequence[Path] = (),
    interpret: bool = False,
    scripts: Scripts | None = None,
    log: Callable[[str], None] | None = None,
) -> UserResidual:
    """Return the residual of an element, compiled if it can be, its unknowns sorted.

    The arguments are those of `friction.load_friction`.

    Raises
    ------
    ModelError
        If the file, the function or its declaration cannot be used.
    """
    say, title = log or host.log, title_of(element)
    name, axes = element.user.fnc_name, len(element.directions)
    scripts = {} if scripts is None else scripts
    script = find_script(element.user, name, title, "usrsub", plugin_files, scripts)
    function = user_function(script, name, title, ARGUMENTS)
    unknowns = declared(script, name, title, axes)
    count, par = len(unknowns), np.array(element.user.par, dtype=np.float64)
    place = name, str(script.path)
    twin, keep = _callback(function, element.id, place, par, axes, count)

    def asked(given: list[float]) -> Any:
        first = 1 + 2 * axes
        parts = (given[1 : 1 + axes], given[1 + axes : first])
        f, fdot = given[first : first + count], given[first + count :]
        return function(*parts, f, fdot, given[0], par.tolist())

    def call(given: list[float]) -> list[float]:
        return numbers(asked(given), count)

    sizes = _sizes(script, par.tolist())
    who = f"{title}: {name} of {script.path}"
    unknowns = sort_unknowns(unknowns, asked, sizes, axes, who)
    refuse_jumps(unknowns, call, sizes, axes, who)
    address, reason = 0, "--interpret-plugins"
    if not interpret:
        address, reason = _compiled(script, name, par, axes, count, call, sizes)
        if reason:
            say(f"Force_Element[{element.id}]: {name} of {script.path} stays interpreted: {reason}")
    made = UserResidual(
        twin, twin, par, unknowns, False, reason, script.path, name, element.id, keep
    )
    return made if reason else replace(made, address=address, compiled=True)


def _sizes(script: Script, par: list[float]) -> list[float]:
    """Return the sizes at which a residual may change its mind."""
    from mbsim.plugins.compile.probe import thresholds

    if script.text is None:
        return sorted({abs(value) for value in par if value != 0.0})
    return thresholds(script.text, par, script.values)


def _compiled(
    script: Script,
    name: str,
    par: npt.NDArray[np.float64],
    axes: int,
    count: int,
    call: Callable[[list[float]], list[float]],
    sizes: list[float],
) -> tuple[int, str]:
    """Return the address of compiled code that has passed the probes, or 0 and the reason."""
    if script.text is None:
        return 0, "a .pyc has no source"
    # here and not above: `import mbsim.plugins` must not load Numba
    from mbsim.plugins.compile.compiled import compile_residual
    from mbsim.plugins.compile.probe import residual_disagreement

    address, reason = compile_residual(script.text, script.values, name, len(par), axes, count)
    if reason:
        return 0, reason
    reason = residual_disagreement(address, call, par, points(sizes, axes, count), count)
    return (0, reason) if reason else (address, "")


def _callback(
    function: Callable[..., Any],
    element: int,
    place: tuple[str, str],
    par: npt.NDArray[np.float64],
    axes: int,
    count: int,
) -> tuple[int, object]:
    """Return the address of the interpreted residual, and what keeps it alive."""
    given_at, out_at = guard.Views(inputs(axes, count)), guard.Views(count)
    count_of_par = len(par)
    first, par_at = 1 + 2 * axes, guard.Views(len(par))
    name, source = place
    function = watched(function, f"Force_Element[{element}]: {name} ({source})")

    def guarded(id: int, inputs: int, par: int, out: int) -> int:
        time, outer = 0.0, host.state
        host.state = None
        try:
            given = given_at[inputs].tolist()
            host.time = time = given[0]
            f, fdot = given[first : first + count], given[first + count :]
            values = par_at[par].tolist() if count_of_par else []
            result = function(given[1 : 1 + axes], given[1 + axes : first], f, fdot, time, values)
            room = out_at[out]
            for k, number in enumerate(numbers(result, count)):
                room[k] = number
            return 0
        except BaseException as error:
            guard.failure.store(error, f"Force_Element[{element}]", time, name, source)
            return guard.code_of(error)
        finally:
            host.state = outer

    entry = guard.C_FUNCTION(guarded)
    return int(ctypes.cast(entry, ctypes.c_void_p).value or 0), entry


def about_residual(
    element: ForceElement, plugin_files: Sequence[Path], scripts: Scripts
) -> dict[str, Any]:
    """Return what `mbsim info` says of an element's residual; a script of `plugin_files` is run.

    Raises
    ------
    ModelError
        If the deck names a file that cannot be used.
    """
    facts: dict[str, Any] = {"function": element.user.fnc_name}
    if not (element.user.script_name or plugin_files):
        return facts | {"file": "none; name one with --plugin FILE"}
    if not named(element.user, plugin_files):
        return facts | not_run(element.user)
    user = load_residual(element, plugin_files, True, scripts, lambda line: None)
    return facts | {"file": str(user.source), "unknowns": user.about()}

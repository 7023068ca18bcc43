"""Force_Element: from the residual that a deck names to addresses that a run can call.

The script declares the unknowns of each of its residuals,

    ELEMENT_UNKNOWNS = {"maxwell": {"f": 0.0}}

by name, with the number at which each begins, or {"initial": .., "scale": .., "kind": ..}. Whether
r = 0 gives f' or f is found by asking the residual at many points, where `kind` does not say.
"""

from __future__ import annotations

import ctypes
import heapq
import itertools
import math
import random
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from mbsim.errors import ModelError
from mbsim.laws.residual import (
    ALGEBRAIC,
    DIFFERENTIAL,
    KINDS,
    MOST_UNKNOWNS,
    SWITCHING,
    inputs,
)
from mbsim.model.elements import ForceElement
from mbsim.plugins import guard
from mbsim.plugins.dual import Dual, slope
from mbsim.plugins.helpers import StopRun, host
from mbsim.plugins.loader import Script, Scripts, find_script, user_function

ARGUMENTS = "x, xdot, f, fdot, t, par"
_WORDS = ("initial", "scale", "kind")
#: Jumps are looked for at one in so many of the points at which a residual is asked, in so many
#: parts; what is left of a change, as a part of the largest number there, is one.
JUMPS_EVERY, PARTS, LEFT_OF_JUMP = 7, 64, 1e-4
_EXAMPLE = '{"NAME": {"f": 0.0}}'


@dataclass(frozen=True)
class Unknown:
    """An unknown of a residual; `scale` None: by the model, `kind` None: not known yet."""

    name: str
    initial: float = 0.0
    scale: float | None = None
    kind: int | None = None


@dataclass(frozen=True, eq=False)
class UserResidual:
    """A user's residual, ready to be called; keep it alive as long as its addresses are in use.

    Attributes
    ----------
    address : int
        Of the function (`laws.residual`), compiled or a callback into Python.
    twin : int
        Of the callback into Python, which says what a compiled one raises.
    par : ndarray, shape (n,)
    unknowns : tuple of Unknown
        The first of them, as many as directions, are forces.
    compiled : bool
    reason : str
        Why it stays interpreted, empty if compiled.
    source : Path
    name : str
    element : int
    """

    address: int
    twin: int
    par: npt.NDArray[np.float64]
    unknowns: tuple[Unknown, ...]
    compiled: bool
    reason: str
    source: Path
    name: str
    element: int
    keep: object = field(default=None, repr=False)

    @property
    def how(self) -> str:
        """How it runs, in a word for the user."""
        return "compiled" if self.compiled else "interpreted"

    @property
    def states(self) -> list[int]:
        """Which unknowns are states."""
        return [k for k, u in enumerate(self.unknowns) if u.kind == DIFFERENTIAL]

    @property
    def switches(self) -> bool:
        """Whether an unknown is a state in one mode and not in another."""
        return any(u.kind == SWITCHING for u in self.unknowns)

    def about(self) -> list[str]:
        """Return the unknowns in words."""
        return [f"{u.name}: {KINDS[u.kind or 0].lower()}" for u in self.unknowns]


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

    The arguments are those of `loader.load_friction`.

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
        return guard.numbers(asked(given), count)

    sizes = _sizes(script, par.tolist())
    who = f"{title}: {name} of {script.path}"
    unknowns = _sorted(unknowns, asked, sizes, axes, who)
    _refuse_jumps(unknowns, call, sizes, axes, who)
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
    from mbsim.plugins.probe import thresholds

    if script.text is None:
        return sorted({abs(value) for value in par if value != 0.0})
    return thresholds(script.text, par, script.values)


def _points(sizes: list[float], axes: int, count: int) -> Iterator[list[float]]:
    """Yield inputs of a residual: all of one size, then of many."""
    chance = random.Random(20)
    every = [1.0, *sizes]
    n = inputs(axes, count)
    yield [0.0] * n
    for size in every:
        for part in (0.5, 1.0 - 1e-9, 1.0 + 1e-9, 2.0):
            for _ in range(4):
                signs = [chance.choice([-1.0, 0.0, 1.0]) for _ in range(n)]
                yield [abs(signs[0]), *(part * size * sign for sign in signs[1:])]
    for _ in range(400):
        values = [
            chance.choice(every) * 10.0 ** chance.uniform(-3, 1) * chance.gauss(0, 1)
            for _ in range(n)
        ]
        yield [abs(values[0]), *values[1:]]


def _sorted(
    unknowns: tuple[Unknown, ...],
    asked: Callable[[list[float]], Any],
    sizes: list[float],
    axes: int,
    who: str,
) -> tuple[Unknown, ...]:
    """Return the unknowns with their kinds: whether r depends on f' always, never, or at times.

    Raises
    ------
    ModelError
        If the residual gives no numbers at any point.
    """
    count = len(unknowns)
    first = 1 + 2 * axes + count
    seen = [[0, 0] for _ in unknowns]
    trouble: BaseException | None = None
    log, host.log = host.log, lambda line: None  # what a probe says is no news
    try:
        for given in _points(sizes, axes, count):
            try:
                moved = [_depends(asked, given, first + k, count) for k in range(count)]
            except KeyboardInterrupt:
                raise
            except (Exception, StopRun) as error:
                trouble = trouble or error
                continue
            for k, found in enumerate(moved):
                seen[k][found] += 1
    finally:
        host.log = log
    if count and not any(seen[0]):
        raise ModelError(f"{who}: fails wherever it is asked: {trouble}")
    kinds = [
        SWITCHING if never and always else DIFFERENTIAL if always else ALGEBRAIC
        for never, always in seen
    ]
    for u, kind in zip(unknowns, kinds, strict=True):
        # at times is what any kind may look like where it was asked
        if u.kind is not None and u.kind != SWITCHING and kind != SWITCHING and u.kind != kind:
            raise ModelError(
                f"{who}: {u.name} is declared {KINDS[u.kind]}, but asked at many points the "
                f"residual is {KINDS[kind]} in it"
            )
    return tuple(
        u if u.kind is not None else replace(u, kind=kind)
        for u, kind in zip(unknowns, kinds, strict=True)
    )


def _refuse_jumps(
    unknowns: tuple[Unknown, ...],
    call: Callable[[list[float]], list[float]],
    sizes: list[float],
    axes: int,
    who: str,
) -> None:
    """Refuse a residual that jumps where an unknown, its rate or x' changes.

    It may have no zero; or its force jumps against the motion, which then is at rest nowhere near.
    Where f' alone jumps, f does not.

    Raises
    ------
    ModelError
        Saying where, and what to write instead.
    """
    count = len(unknowns)
    first = 1 + 2 * axes + count
    log, host.log = host.log, lambda line: None
    try:
        points = list(itertools.islice(_points(sizes, axes, count), 1, None, JUMPS_EVERY))
        # what has no zero is told first
        for places in (range(first - count, first + count), range(1 + axes, first - count)):
            for given, at in itertools.product(points, places):
                found = _jump(call, given, at)
                if found is None:
                    continue
                where, low, high, row = found
                if at < first - count:
                    if _gives_a_rate(call, given, row, first, unknowns):
                        continue
                    raise ModelError(
                        f"{who}: jumps from {low:.6g} to {high:.6g} where x' passes {where:.6g}: "
                        "a force that jumps against the motion switches to and fro for ever. Take "
                        "Force_DryFriction, or a smooth law, F tanh(x'/v), or write stick and slip "
                        "in one equation, f = clip(f + r (x' - f'/k), -F, F): see "
                        "userfuncs/dry_friction_element.py"
                    )
                name, rate = unknowns[(at - first) % count].name, "'" if at >= first else ""
                raise ModelError(
                    f"{who}: jumps from {low:.6g} to {high:.6g} where {name}{rate} passes "
                    f"{where:.6g}, so that it may be 0 nowhere: a residual must be continuous. "
                    "Write one equation for all modes, as stick and slip in "
                    "f = clip(f + r (x' - f'/k), -F, F): see userfuncs/dry_friction_element.py"
                )
    finally:
        host.log = log


def _gives_a_rate(
    call: Callable[[list[float]], list[float]],
    given: list[float],
    row: int,
    first: int,
    unknowns: tuple[Unknown, ...],
) -> bool:
    """Return whether a row depends on the rate of an unknown that is a state."""
    base = call(given)[row]
    for k, unknown in enumerate(unknowns):
        if unknown.kind == DIFFERENTIAL:
            other = given.copy()
            other[first + k] += abs(other[first + k]) or 1.0
            if call(other)[row] != base:
                return True
    return False


def _jump(
    call: Callable[[list[float]], list[float]], given: list[float], at: int
) -> tuple[float, float, float, int] | None:
    """Return where a residual jumps as one argument changes, from what to what, and its row.

    The parts over which it changes most are halved down to rounding: what is left of the change of
    a residual that is continuous goes down with them.
    """
    size = abs(given[at]) or 1.0
    low, high = given[at] - size, given[at] + 1.1 * size
    try:
        places = [low + (high - low) * k / PARTS for k in range(PARTS + 1)]
        values = [call([*given[:at], x, *given[at + 1 :]]) for x in places]
        whole = max(abs(value) for row in values for value in row)
        ends = list(zip(places, values, strict=True))
        parts = [(a, b) for a, b in itertools.pairwise(ends)]
        while parts[0][1][0] - parts[0][0][0] > 1e-14 * size:
            parts = heapq.nlargest(4, parts, key=_change)
            halves = []
            for one, other in parts:
                x = 0.5 * (one[0] + other[0])
                middle = (x, call([*given[:at], x, *given[at + 1 :]]))
                halves += [(one, middle), (middle, other)]
            parts = halves
    except KeyboardInterrupt:
        raise
    except (Exception, StopRun):
        return None  # it was not written for such values
    (_, before), (where, behind) = max(parts, key=_change)
    left = [abs(a - b) for a, b in zip(before, behind, strict=True)]
    row = left.index(max(left))
    # rounding of what cancels in it may be larger than the interval
    return (where, before[row], behind[row], row) if left[row] > LEFT_OF_JUMP * whole else None


def _change(part: Any) -> float:
    """Return the largest change of a residual from one end of a part to the other."""
    (_, one), (_, other) = part
    return float(max(abs(a - b) for a, b in zip(one, other, strict=True)))


def _depends(asked: Callable[[list[float]], Any], given: list[float], at: int, count: int) -> bool:
    """Return whether the residual differs where one argument does, a little, either way."""
    marked: list[float] = [*given[:at], Dual(given[at], 1.0), *given[at + 1 :]]
    found = asked(marked)
    base = guard.numbers(found, count)
    if any(slope(value) != 0.0 for value in found):
        return True
    for part in (1e-3, -1e-3):
        other = given.copy()
        other[at] += part * (abs(other[at]) or 1e-3)
        if guard.numbers(asked(other), count) != base:
            return True
    return False


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
    from mbsim.plugins.compiled import compile_residual
    from mbsim.plugins.probe import residual_disagreement

    address, reason = compile_residual(script.text, script.values, name, len(par), axes, count)
    if reason:
        return 0, reason
    reason = residual_disagreement(address, call, par, _points(sizes, axes, count), count)
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
    first, values = 1 + 2 * axes, par.tolist()
    name, source = place

    def guarded(id: int, inputs: int, par: int, out: int) -> int:
        time, outer = 0.0, host.state
        host.state = None
        try:
            given = given_at[inputs].tolist()
            host.time = time = given[0]
            f, fdot = given[first : first + count], given[first + count :]
            result = function(
                given[1 : 1 + axes], given[1 + axes : first], f, fdot, time, values.copy()
            )
            room = out_at[out]
            for k, number in enumerate(guard.numbers(result, count)):
                room[k] = number
            return 0
        except BaseException as error:
            guard.failure.store(error, f"Force_Element[{element}]", time, name, source)
            from mbsim.core.codes import Code

            return Code.STOPPED_BY_USER if isinstance(error, StopRun) else Code.RAISED_INTERPRETED
        finally:
            host.state = outer

    entry = guard.C_FUNCTION(guarded)
    return int(ctypes.cast(entry, ctypes.c_void_p).value or 0), entry


def about_residual(
    element: ForceElement, plugin_files: Sequence[Path], scripts: Scripts
) -> dict[str, Any]:
    """Return what `mbsim info` says of an element's residual; its script is run.

    Raises
    ------
    ModelError
        If the deck names a file that cannot be used.
    """
    facts: dict[str, Any] = {"function": element.user.fnc_name}
    if not (element.user.script_name or plugin_files):
        return facts | {"file": "none; name one with --plugin FILE"}
    user = load_residual(element, plugin_files, True, scripts, lambda line: None)
    return facts | {"file": str(user.source), "unknowns": user.about()}

"""COUSUB: a relation of displacements by a user's function, with its derivatives.

COUXX gives the first derivatives and COUXX2 the second ones; what is not there is found by
differences. What is there is held against differences, at first and then ever more seldom.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from mbsim.model.source import RelationSubroutine
from mbsim.plugins.returned import NotAForce, numbers, one_number
from mbsim.plugins.source.script import Script
from mbsim.plugins.source.shared_library import Library

Array = npt.NDArray[np.float64]

#: Sizes of differences, in parts of L or of a radian: of a first derivative, of a second one.
_ONCE, _TWICE = 1e-3, 5e-3
#: Weights of the four values of a central difference of order four, and where they are.
_WEIGHTS = ((2.0, -1.0 / 12.0), (1.0, 8.0 / 12.0), (-1.0, -8.0 / 12.0), (-2.0, 1.0 / 12.0))
#: By how much derivatives may be off their differences, and what is rounding of these.
_ALIKE, _NOISE = 1e-3, 1e-9
#: Times at which it is looked whether the relation changes with time, and by how much it may.
_TIMES, _SAME = 101, 1e-12


def _slopes(function: Callable[[Array], Any], at: Array, sizes: Array, part: float) -> Array:
    """Return the derivatives of a function, one row for each number that it depends on."""
    rows = []
    for k, size in enumerate(sizes):
        h = part * size
        total: Any = 0.0
        for steps, weight in _WEIGHTS:
            moved = at.copy()
            moved[k] += steps * h
            total = total + (weight / h) * np.asarray(function(moved), dtype=np.float64)
        rows.append(total)
    return np.array(rows, dtype=np.float64)


def related(
    function: Callable[..., Any],
    user: RelationSubroutine,
    script: Script | Library,
    named: Callable[..., Callable[..., Any]],
    span: tuple[float, float],
) -> Callable[..., list[float]]:
    """Return a function (id, time, par, npar, given, iflag) of what a COUSUB and its like give.

    Parameters
    ----------
    function : callable
        The COUSUB.
    user : RelationSubroutine
    script : Script or Library
        Where it is; the others are there too.
    named : callable
        Returns a function by its name, of so many numbers.
    span : (float, float)
        Of times, in which it may not change.

    Returns
    -------
    callable
        `given` begins with the displacements and the sizes by which they are judged. It returns
        the relation, its first derivatives and its second ones row by row.
    """
    n = user.count
    first = _found(user, user.first, script, named, n)
    second = _found(user, user.second, script, named, n * n)
    calls, next_check = 0, 1

    def values(
        id: int, time: float, par: list[float], npar: int, given: list[float], iflag: int
    ) -> list[float]:
        nonlocal calls, next_check
        at, sizes = np.array(given[:n]), np.array(given[n : 2 * n])

        def call(each: Callable[..., Any], at: Array, when: float = time) -> Any:
            return each(id, when, par.copy(), npar, at.tolist(), n, iflag)

        def phi(at: Array) -> float:
            return one_number(call(function, at))[0]

        def by_first(at: Array) -> Array:
            assert first is not None
            return np.array(numbers(call(first, at), n, f" of {user.first}"))

        if iflag:
            for each in (function, first, second):
                if each is not None:
                    call(each, at)
            return [0.0] * user.results
        value = phi(at)
        slopes = _slopes(phi, at, sizes, _ONCE) if first is None else by_first(at)
        gradient = by_first if first else lambda x: _slopes(phi, x, sizes, _TWICE)
        if second is not None:
            bends = _square(call(second, at), n, user.second)
        else:
            bends = _slopes(gradient, at, sizes, _ONCE if first else _TWICE)
            bends = 0.5 * (bends + bends.T)
        calls += 1
        if calls == next_check:
            next_check *= 2
            _check_time(lambda when: one_number(call(function, at, when))[0], value, user, span)
            if first is not None:
                _check(slopes, _slopes(phi, at, sizes, _ONCE), user.first, user.fnc_name, sizes)
            if second is not None:
                of = user.first if first else user.fnc_name
                seen = _slopes(gradient, at, sizes, _ONCE if first else _TWICE)
                _check(bends, seen, user.second, of, sizes)
        return [value, *slopes.tolist(), *bends.ravel().tolist()]

    return values


def _found(
    user: RelationSubroutine,
    name: str,
    script: Script | Library,
    named: Callable[..., Callable[..., Any]],
    count: int,
) -> Callable[..., Any] | None:
    """Return the function of derivatives, None where it is not there and need not be."""
    return named(name, count) if user.named or script.defines(name) else None


def _square(result: Any, n: int, name: str) -> Array:
    """Return second derivatives that came row by row, in one list or as a list of rows."""
    if hasattr(result, "__len__") and len(result) == n and n > 1:
        result = [each for row in result for each in numbers(row, n, f" of a row of {name}")]
    return np.array(numbers(result, n * n, f" of {name}")).reshape(n, n)


def _check(given: Array, seen: Array, name: str, of: str, sizes: Array) -> None:
    """Raise `NotAForce` where derivatives are not those of what they should be."""
    scaled = sizes if given.ndim == 1 else np.outer(sizes, sizes)
    off = np.abs(given - seen) * scaled
    allowed = _ALIKE * np.max(np.abs([given, seen]) * scaled) + _NOISE
    if np.max(off) > allowed:
        raise NotAForce(
            f"{name} gives {_listed(given)}, but what {of} gives changes by {_listed(seen)}"
        )


def _listed(values: Array) -> str:
    return "[" + ", ".join(f"{value:.6g}" for value in values.ravel()) + "]"


def _check_time(
    at_time: Callable[[float], float],
    value: float,
    user: RelationSubroutine,
    span: tuple[float, float],
) -> None:
    """Raise `NotAForce` where the relation changes with time: no derivative by it is asked for."""
    for when in np.linspace(span[0], span[1], _TIMES):
        other = at_time(float(when))
        if abs(other - value) > _SAME * (1.0 + abs(value)):
            raise NotAForce(
                f"gives {value:.6g}, and {other:.6g} for the same displacements at time "
                f"{when:.6g}: it may not depend on the time, by which it gives no derivative; a "
                "Constraint_General may"
            )

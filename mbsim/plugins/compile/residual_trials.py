"""A user's residual asked at many points: which unknowns are states, and whether it jumps."""

from __future__ import annotations

import heapq
import itertools
import random
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

from mbsim.errors import ModelError
from mbsim.laws.residual import ALGEBRAIC, DIFFERENTIAL, KINDS, SWITCHING, inputs
from mbsim.plugins.compile.dual import Dual, slope
from mbsim.plugins.helpers import StopRun, host
from mbsim.plugins.returned import numbers
from mbsim.plugins.types import Unknown

#: Jumps are looked for at one in so many of the points at which a residual is asked, in so many
#: parts; what is left of a change, as a part of the largest number there, is one.
JUMPS_EVERY, PARTS, LEFT_OF_JUMP = 7, 64, 1e-4


def points(sizes: list[float], axes: int, count: int) -> Iterator[list[float]]:
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


def sort_unknowns(
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
    first_error: BaseException | None = None
    log, host.log = host.log, lambda line: None  # what a probe says is no news
    try:
        for given in points(sizes, axes, count):
            try:
                moved = [_depends(asked, given, first + k, count) for k in range(count)]
            except KeyboardInterrupt:
                raise
            except (Exception, StopRun) as error:
                first_error = first_error or error
                continue
            for k, found in enumerate(moved):
                seen[k][found] += 1
    finally:
        host.log = log
    if count and not any(seen[0]):
        raise ModelError(f"{who}: fails wherever it is asked: {first_error}")
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


def refuse_jumps(
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
        asked_at = list(itertools.islice(points(sizes, axes, count), 1, None, JUMPS_EVERY))
        # what has no zero is told first
        for places in (range(first - count, first + count), range(1 + axes, first - count)):
            for given, at in itertools.product(asked_at, places):
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
    base = numbers(found, count)
    if any(slope(value) != 0.0 for value in found):
        return True
    for part in (1e-3, -1e-3):
        other = given.copy()
        other[at] += part * (abs(other[at]) or 1e-3)
        if numbers(asked(other), count) != base:
            return True
    return False

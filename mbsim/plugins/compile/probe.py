"""Trust nothing: a compiled function must give the interpreted one's results before it is used."""

from __future__ import annotations

import ast
import ctypes
import math
import random
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

from mbsim.laws import user_normal as at
from mbsim.laws.abi import FRICTION_INPUTS, MEMORY_OUT
from mbsim.plugins import guard
from mbsim.plugins.helpers import host

if TYPE_CHECKING:
    from mbsim.plugins.types import UserNormal

_THRESHOLD_MAX = 24
_TOLERANCE = 1e-14
_BELOW, _ABOVE = 1.0 - 1e-9, 1.0 + 1e-9


def thresholds(text: str, par: list[float], values: dict[str, Any]) -> list[float]:
    """Return the sizes at which a function may change its mind: its numbers and parameters."""
    sizes = {abs(float(value)) for value in par}
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Constant) and isinstance(node.value, (int, float)):
            if abs(node.value) < 1e300:
                sizes.add(abs(float(node.value)))
        elif isinstance(node, ast.Name) and isinstance(values.get(node.id), (int, float)):
            sizes.add(abs(min(float(values[node.id]), 1e300)))
    return sorted(size for size in sizes if 0.0 < size < 1e12)[:_THRESHOLD_MAX]


def probes(sizes: list[float], read: list[bool]) -> Iterator[list[float]]:
    """Yield the 20 inputs of every probe call; `read`: whether loci, locj, x, dflag are read."""
    chance = random.Random(20)
    quiet = [0.7, 0.0, 0.01, -0.02, 0.03, 0.3, -0.4, 0.2, 0.0, 0.0, 5.0, 0.0, 0.0]
    quiet += [0.01, 0.02, -0.03, -0.04, 0.05, 0.06, 0.0]
    values = sorted({s * side for s in (*sizes, 1.0) for side in (_BELOW, _ABOVE, 0.5)})
    values += [1e-12, 1e3, 1e6]

    vectors = [(0.0, 0.0, 0.0)]
    for value in (*values, *(-value for value in values)):
        vectors += [(value, 0.0, 0.0), (0.0, value, 0.0), (0.0, 0.0, value)]
        vectors += [(0.6 * value, -0.8 * value, 0.1), (value, value, value)]

    # slip at several normal forces; then deformation, normal force, time and places alone
    for vector in vectors:
        for nforce in (0.0, 1.7, 450.0):
            yield [*quiet[:5], *vector, 0.0, 0.0, nforce, *quiet[11:]]
        if read[2]:
            for slip in ((0.0, 0.0, 0.0), (0.3, -0.4, 0.2)):
                yield [*quiet[:2], *vector, *slip, *quiet[8:]]
        if read[0]:
            yield [*quiet[:13], *vector, *quiet[16:]]
        if read[1]:
            yield [*quiet[:16], *vector, *quiet[19:]]
        if read[3]:
            yield [*quiet[:5], *vector, *quiet[8:19], 1.0]
    for value in values:
        yield [*quiet[:10], value, *quiet[11:]]
        yield [value, *quiet[1:]]

    # and all of them together, over many magnitudes
    for _ in range(300):
        scale = 10.0 ** chance.uniform(-6, 4)
        yield [
            chance.uniform(0, 10) if k == 0 else abs(chance.gauss(0, 100)) if k == 10
            else chance.gauss(0, 1) * (scale if 5 <= k < 8 else 1.0)
            for k in range(19)
        ] + [0.0]  # fmt: skip


def with_states(
    cases: Iterator[list[float]], sizes: list[float], states: int
) -> Iterator[list[float]]:
    """Yield the cases with nothing kept and with numbers of many sizes kept."""
    chance = random.Random(21)
    for given in cases:
        rest = [0.0] * (FRICTION_INPUTS - len(given))
        size = chance.choice([*sizes, 10.0 ** chance.uniform(-6, 2)])
        kept = [size * chance.choice([-1.0, 0.5, 1.0, chance.gauss(0, 1)]) for _ in range(states)]
        yield [*given, *rest, *([0.0] * states)]
        yield [*given, *rest, *kept]


def _near(call: Callable[[list[float]], list[float]], given: list[float]) -> Iterator[list[float]]:
    """Yield the interpreted results one rounding away."""
    for factor in (1.0 - 4e-16, 1.0 + 4e-16):
        try:
            yield call([value * factor for value in given])
        except Exception:
            continue


def disagreement(
    address: int,
    call: Callable[[list[float]], list[float]],
    par: Any,
    text: str,
    values: dict[str, Any],
    element: int,
    read: list[bool],
    states: int = 0,
) -> str:
    """Return '' if the code at `address` does what `call` does at every probe, else where not."""
    entry = guard.C_FUNCTION(address)
    size = MEMORY_OUT + states
    c_inputs, c_out = (ctypes.c_double * (FRICTION_INPUTS + states))(), (ctypes.c_double * size)()
    unset = (ctypes.c_double * size)(*[math.nan] * size)
    c_par = (ctypes.c_double * max(len(par), 1))(*par)

    def run(given: list[float]) -> tuple[bool, list[float]]:
        for position, value in enumerate(given):
            c_inputs[position] = value
        ctypes.memmove(c_out, unset, ctypes.sizeof(c_out))
        failed = entry(element, c_inputs, c_par, c_out) != 0
        return failed, [c_out[0], c_out[1], c_out[4], *c_out[MEMORY_OUT:size]]

    def shown(given: list[float]) -> str:
        return f"xdot={given[5:8]}, nforce={given[10]:g}, x={given[2:5]}, time={given[0]:g}"

    sizes = thresholds(text, list(par), values)
    cases = probes(sizes, read)
    return _compare(run, call, with_states(cases, sizes, states) if states else cases, shown)


def normal_disagreement(
    address: int, user: UserNormal, text: str, values: dict[str, Any], read: list[bool]
) -> str:
    """Return '' if the code at `address` does what the user's CNFSUB does, else where not.

    `read`: whether loci, ni, locj and nj are read. A probe is the law's place (`laws.user_normal`).
    """
    signature = (ctypes.c_int64, ctypes.c_double, ctypes.c_double, ctypes.c_void_p, ctypes.c_void_p)
    entry, c_out = ctypes.CFUNCTYPE(*signature)(address), (ctypes.c_double * 3)()
    row, chance = user.row, random.Random(20)
    sizes = thresholds(text, user.par.tolist(), values)
    quiet = user.inputs.tolist()
    quiet[at.TIME], quiet[at.MODE] = 0.7, at.EVALUATE
    steps = sorted({s * side for s in (*sizes, 1.0) for side in (_BELOW, _ABOVE, 0.5)})
    steps += [1e-12, 1e-9, 1e-6, 1e-3, 1e3]

    def cases() -> Iterator[list[float]]:
        for depth in steps:
            for rate in (0.0, *steps, *(-step for step in steps)):
                for mode in (at.EVALUATE, at.SLOPES):
                    yield [mode, *quiet[1 : at.DEPTH], depth, rate, *quiet[at.ID :]]
        for k, used in zip((at.LOCI, at.NI, at.LOCJ, at.NJ), read, strict=True):
            for value in (*steps, *(-step for step in steps)) if used else ():
                for axis in range(3):
                    given = [*quiet[: at.DEPTH], 1e-3, 0.1, *quiet[at.ID :]]
                    given[k + axis] = value
                    yield given
        for _ in range(300):
            given = [0.0, chance.uniform(0, 10), *(chance.gauss(0, 1) for _ in range(12))]
            depth, rate = 10.0 ** chance.uniform(-7, 1), chance.gauss(0, 1)
            rate *= 10.0 ** chance.uniform(-4, 2)
            yield [*given, depth, rate, *quiet[at.ID : at.AREA], chance.choice([0.0, 1e-4, 0.3])]

    def run(given: list[float]) -> tuple[bool, list[float]]:
        user.inputs[:] = given
        code = entry(given[at.DEPTH], given[at.RATE], row.ctypes.data, ctypes.addressof(c_out))
        return code != 0, [c_out[0]]

    def call(given: list[float]) -> list[float]:
        user.inputs[:] = given
        return [user.call(given[at.DEPTH], given[at.RATE])]

    def shown(given: list[float]) -> str:
        return f"gap={-given[at.DEPTH]:g}, gapdot={-given[at.RATE]:g}, time={given[at.TIME]:g}"

    return _compare(run, call, cases(), shown)


def residual_disagreement(
    address: int,
    call: Callable[[list[float]], list[float]],
    par: Any,
    cases: Iterator[list[float]],
    count: int,
) -> str:
    """Return '' if the code at `address` does what `call`, a residual, does in all cases."""
    entry = guard.C_FUNCTION(address)
    c_out, c_par = (ctypes.c_double * count)(), (ctypes.c_double * max(len(par), 1))(*par)

    def run(given: list[float]) -> tuple[bool, list[float]]:
        failed = entry(0, (ctypes.c_double * len(given))(*given), c_par, c_out) != 0
        return failed, list(c_out)

    def shown(given: list[float]) -> str:
        return "t, x, xdot, f, fdot = " + ", ".join(f"{value:g}" for value in given)

    return _compare(run, call, cases, shown)


def _compare(
    run: Callable[[list[float]], tuple[bool, list[float]]],
    call: Callable[[list[float]], list[float]],
    cases: Iterator[list[float]],
    shown: Callable[[list[float]], str],
) -> str:
    """Return '' if compiled `run` does what `call` does in all cases, else where it does not."""
    log, host.log = host.log, lambda line: None  # what a probe says is no news
    try:
        for given in cases:
            signalled, got = run(given)
            signalled = signalled or not all(math.isfinite(value) for value in got)
            try:
                wanted: list[float] | None = call(given)
            except BaseException as error:
                if isinstance(error, KeyboardInterrupt):
                    raise
                wanted = None
            if signalled != (wanted is None):
                who = "compiled" if signalled else "interpreted"
                return f"only the {who} function fails at {shown(given)}"
            if wanted is None or got == wanted:
                continue
            wrong = [
                abs(a - b) - _TOLERANCE * max(abs(a), abs(b))
                for a, b in zip(got, wanted, strict=True)
            ]
            if max(wrong) > 0.0:
                # hypot and the like may round otherwise; a difference of two near numbers grows it
                moved = [[abs(a - b) for a, b in zip(near, wanted, strict=True)]
                         for near in _near(call, given)]  # fmt: skip
                allowed = [2.0 * max(column) for column in zip(*moved, strict=True)]
                allowed = allowed or [0.0] * len(wanted)
                if any(w > a for w, a in zip(wrong, allowed, strict=True)):
                    where = shown(given)
                    return f"gives {got} when compiled and {wanted} interpreted at {where}"
    finally:
        host.log = log
    return ""

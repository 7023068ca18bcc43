"""The functions of TIME that a model follows, and what each of them moves."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from mbsim.arrays.codes import AXIS_TORQUE, EQUAL, SCALE_LENGTH, SCALE_SPEED
from mbsim.arrays.scene import Scene
from mbsim.compile_model.instructions import SPLINE
from mbsim.expressions.elementary import CODES, FIRST_MEASURE, IF, NUMBER, SIGN, TIME

#: Part of tol that what is hidden may change.
PART = 0.1


#: Functions whose value follows their first argument in pieces, and what to put for the others
#: where these are not of TIME: what they choose between is made to differ.
_CHOOSING = {
    IF: (0.0, 0.5, 1.0),
    CODES["STEP"]: (None, 0.0, None, 1.0),
    CODES["STEP5"]: (None, 0.0, None, 1.0),
    CODES["HAVSIN"]: (None, 0.0, None, 1.0),
}
#: Functions that pass on what they are given as it is, up to a factor.
_PASSING = {CODES[name] for name in ("ADD", "SUB", "MUL", "NEG")}


class Code(NamedTuple):
    """One instruction: operation, its numbers, and the value of NUMBER."""

    op: int
    rows: tuple[int, ...]
    value: float = 0.0


class Function(NamedTuple):
    """A function of TIME that something follows.

    `role` is the highest derivative that may not jump within a step; `sizes` are factors of
    d / w, d, d T and d w T for a hidden distance d over a time T, each over the tolerance; all 0
    where only the function's own size tells.
    """

    code: tuple[Code, ...]
    role: int
    sizes: tuple[float, float, float, float]


UNKNOWN = (0.0, 0.0, 0.0, 0.0)
#: The roles of what nothing moves by. Steps end behind its jumps, where a sensor locates them; or,
#: where it does not, no step goes over two, so that it is on or off for the end of one.
WATCHED, GLANCED = -1, -2
_CONSTANT, _OF_TIME, _OTHER = range(3)


class _Part(NamedTuple):
    code: tuple[Code, ...]
    looks: int
    mixed: bool  # it looks at TIME and at what is not known ahead


def _program(scene: Scene, program: int) -> Iterator[Code]:
    """Yield the instructions of a program."""
    programs = scene.programs
    for row in programs.code[programs.start[program] : programs.start[program + 1]]:
        op, rows = int(row[0]), tuple(map(int, row[1:]))
        if op == NUMBER:
            yield Code(op, (), float(programs.number[rows[0]]))
        else:
            count = 1 if op < FIRST_MEASURE else 3 if op == SPLINE else 0
            yield Code(op, rows[:count])


def parts(scene: Scene, program: int) -> tuple[list[tuple[Code, ...]], bool, bool]:
    """Return what of a program looks at TIME alone, whether that is all of it, and what is left.

    The last says whether TIME is mixed with what is not known ahead, so that pulses of both may
    be missed.
    """
    stack: list[_Part] = []
    found: dict[tuple[Code, ...], None] = {}
    blind = False
    for code in _program(scene, program):
        if code.op == NUMBER or code.op == TIME:
            looks = _CONSTANT if code.op == NUMBER else _OF_TIME
            stack.append(_Part((code,), looks, False))
            continue
        taken = code.rows[0] if code.op < FIRST_MEASURE else 2 if code.op == SPLINE else 0
        given = stack[len(stack) - taken :]
        del stack[len(stack) - taken :]
        looks = max((part.looks for part in given), default=_OTHER)
        if looks < _OTHER:
            whole = tuple(one for part in given for one in part.code)
            stack.append(_Part((*whole, code), looks, False))
            continue
        for part in given:
            if part.looks == _OF_TIME:
                found[part.code] = None
        chosen = _chosen(code, given)
        if chosen is not None:
            found[chosen] = None
        seen = any(part.mixed or part.looks == _OF_TIME for part in given)
        if code.op == SPLINE or code.op not in _PASSING:
            # a factor of TIME that only chooses is known
            lone = chosen is not None and not any(part.mixed for part in given)
            blind |= seen and not lone and not _is_quotient(code, given)
        stack.append(_Part((), _OTHER, seen))
    (all_of_it,) = stack
    if all_of_it.looks == _OF_TIME:
        return [all_of_it.code], True, False
    return list(found), False, blind


def _is_quotient(code: Code, given: Sequence[_Part]) -> bool:
    """Return whether this is something over a function of TIME or a number."""
    return code.op == CODES["DIV"] and given[1].looks < _OTHER


def _chosen(code: Code, given: Sequence[_Part]) -> tuple[Code, ...] | None:
    """Return what chooses, by TIME alone, between things that are not known ahead."""
    if code.op == SIGN and given[1].looks == _OF_TIME:
        return (Code(NUMBER, (), 1.0), *given[1].code, code)
    others = _CHOOSING.get(code.op)
    if others is None or given[0].looks != _OF_TIME:
        return None
    made = list(given[0].code)
    for part, other in zip(given[1:], others, strict=True):
        if other is None and part.looks == _OTHER:
            return None
        made += part.code if other is None else (Code(NUMBER, (), other),)
    return (*made, code)


def _lever(scene: Scene, marker: int, tol_v: float, tol_l: float, turning: bool) -> Any:
    """Return the factors of a force or torque on the body of a marker."""
    body = int(scene.markers.body[marker])
    bodies = scene.bodies
    if body >= len(bodies.mass):
        return np.zeros(4)
    length = float(scene.world.scale[SCALE_LENGTH])
    stiffest = float(np.linalg.norm(bodies.inverse[body], 2))
    if turning:
        rate = length * stiffest
    else:
        arm = float(np.linalg.norm(scene.markers.p[marker]))
        rate = 1.0 / float(bodies.mass[body]) + arm * length * stiffest
    return np.array([0.0, 0.0, rate / tol_v, rate / tol_l])


def _forces(scene: Scene, tol_v: float, tol_l: float) -> Iterator[tuple[int, int, Any]]:
    """Yield program, role and factors of the applied forces."""
    applied = scene.applied
    for f in range(len(applied.form)):
        ends = (int(applied.i[f]), int(applied.j[f]))
        whole = int(applied.program[f])
        if whole >= 0:
            turning = applied.form[f] == AXIS_TORQUE
            yield whole, 0, sum(_lever(scene, m, tol_v, tol_l, turning) for m in ends)
        for c, program in enumerate(applied.components[f]):
            if program >= 0:
                yield int(program), 0, sum(_lever(scene, m, tol_v, tol_l, c >= 3) for m in ends)


def _acting(scene: Scene, tol: float) -> Iterator[tuple[int, int, Any]]:
    """Yield program, role and factors of all that moves something."""
    length, speed = float(scene.world.scale[SCALE_LENGTH]), float(scene.world.scale[SCALE_SPEED])
    tol_v, tol_l = PART * tol * speed, PART * tol * length
    yield from _forces(scene, tol_v, tol_l)
    for program in scene.states.program:
        yield int(program), 0, UNKNOWN
    for program in scene.world.weight.ravel():
        if program >= 0:
            yield int(program), 0, (0.0, 0.0, 1.0 / tol_v, 1.0 / tol_l)
    equations = scene.equations
    for k, program in enumerate(equations.program):
        if program < 0:
            continue
        # of displacements, velocities or accelerations; an angle is over 1, a length over L
        level, ratio = int(equations.level[k]), length / float(equations.unit[k])
        sizes = np.zeros(4)
        sizes[3 - level] += ratio / tol_l
        sizes[2 - level] += ratio / tol_v
        yield int(program), level, sizes


def _sensed(scene: Scene) -> Iterator[tuple[tuple[Code, ...], float, int]]:
    """Yield what sensors of TIME alone watch, each value where one turns on or off, the role."""
    sensors = scene.sensors
    for k, program in enumerate(sensors.program):
        found, whole, _ = parts(scene, int(program))
        if whole:
            width = float(sensors.width[k])
            for edge in {width, -width, 0.0} if sensors.compare[k] == EQUAL else {width, -width}:
                role = WATCHED if sensors.located[k] == 1 else GLANCED
                yield found[0], float(sensors.value[k]) + edge, role


def functions(scene: Scene, tol: float) -> tuple[list[Function], bool]:
    """Return the functions of TIME that something follows, and whether pulses may be missed."""
    found: dict[tuple[Any, int], Any] = {}
    blind = False
    for program, role, sizes in _acting(scene, tol):
        codes, whole, unseen = parts(scene, program)
        blind |= unseen
        for code in codes:
            given = np.array(sizes if whole else UNKNOWN)
            # of two that follow one function, the more sensitive counts
            found[code, role] = np.maximum(found.get((code, role), 0.0), given)
    made = [Function(code, role, tuple(sizes)) for (code, role), sizes in found.items()]
    for code, edge, role in _sensed(scene):
        numbers = (Code(NUMBER, (), value) for value in (0.0, 0.5, 1.0))
        switch = (*code, Code(NUMBER, (), edge), Code(CODES["SUB"], (2,)), *numbers)
        made.append(Function((*switch, Code(IF, (4,))), role, UNKNOWN))
    return made, blind

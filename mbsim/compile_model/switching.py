"""Where forces by expressions have switches: on which sides of their switches they are, as numbers.

A switch is a function that is 0 where an expression goes from one branch to another. Of each
expression one more program is made, the sum of 2^k over the switches k that are above 0, so that it
differs where a branch does:

| function            | switches                                                              |
|---------------------|-----------------------------------------------------------------------|
| ABS(x), IF(x: ..)   | x                                                                     |
| SIGN(a, b)          | a; b, where 0 is on the side of what is above                         |
| DIM, MIN, MAX       | a - b, one argument after the other                                   |
| MOD(a, b)           | whether AINT(a / b) is odd                                            |
| AINT(x), ANINT(x)   | whether they are odd                                                  |
| STEP, STEP5, HAVSIN | x - x0, x - x1                                                        |
| SWEEP               | the same, and x - x0 - dx                                             |
| ATAN2, PSI, PHI, YAW, ROLL | themselves where they are more than pi/2 off 0: from pi to -pi  |
| IMPACT, BISTOP      | depth d; with a damper d - dmax, and what the force is without its bound |
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import islice

import numpy as np

from mbsim.arrays.model import Switching
from mbsim.compile_model.instructions import ELEMENT, NET, USER, Instruction
from mbsim.compile_model.programs import ProgramTable
from mbsim.expressions.elementary import NUMBER
from mbsim.expressions.tree import Call, Expression, Node, Number
from mbsim.forces.catalog import FORCES, Components, Expressed, Switched, memories, of_form
from mbsim.laws.catalog import FRICTION_LAWS
from mbsim.model.elements import Model
from mbsim.model.mechanism_checks import looked_at

#: Switches of one expression that are watched at most: so many bits a number has.
MOST_SWITCHES = 48
#: Instructions of the program of an expression's switches at most; with more none is watched.
LONGEST = 2000

#: A user's function is not to be asked more often than forces are; forces are not known yet.
_NOT_ASKED = (USER, NET, ELEMENT)

#: Angles that go from pi to -pi; others are counted on.
_ANGLES = ("ATAN2", "PSI", "PHI", "YAW", "ROLL")
#: What may jump at its switch.
_JUMPS = frozenset(("IF", "SIGN", "MOD", "AINT", "ANINT", *_ANGLES))

_NAUGHT = Number(0.0)


def _call(name: str, *args: Node) -> Call:
    return Call(name, args)


def _odd(whole: Node) -> Node:
    """Return what is above 0 where a whole number is odd.

    As it is rounded: a step that ends behind a jump of time is on its side then.
    """
    return _call("ABS", _call("MOD", whole, Number(2.0)))


def _stop(depth: Node, rate: Node, law: tuple[Node, ...]) -> Iterator[Node]:
    """Yield the switches of a stop."""
    k, e, c, dmax = law
    yield depth
    if c == _NAUGHT:
        return
    yield _call("SUB", depth, dmax)
    spring = _call("MUL", k, _call("POW", _call("MAX", depth, _NAUGHT), e))
    damper = _call("MUL", _call("STEP", depth, _NAUGHT, _NAUGHT, dmax, c), rate)
    yield _call("ADD", spring, damper)


def _of_call(node: Call) -> Iterator[Node]:
    """Yield the switches of one function."""
    name, x = node.name, node.args
    if name in ("ABS", "IF"):
        yield x[0]
    elif name == "SIGN":
        yield x[0]
        yield _call("IF", x[1], Number(-1.0), Number(1.0), Number(1.0))
    elif name in ("DIM", "MIN", "MAX"):
        best = x[0]
        for other in x[1:]:
            yield _call("SUB", best, other)
            best = _call(name, best, other)
    elif name == "MOD":
        yield _odd(_call("AINT", _call("DIV", *x)))
    elif name in ("AINT", "ANINT"):
        yield _odd(node)
    elif name in _ANGLES:
        behind = _call("SUB", _call("ABS", node), Number(0.5 * math.pi))
        yield _call("IF", behind, Number(-1.0), node, node)
    elif name in ("STEP", "STEP5", "HAVSIN"):
        yield from (_call("SUB", x[0], x[1]), _call("SUB", x[0], x[3]))
    elif name == "SWEEP":
        yield from (_call("SUB", x[0], x[2]), _call("SUB", x[0], x[4]))
        yield _call("SUB", x[0], _call("ADD", x[2], x[6]))
    elif name == "IMPACT":
        yield from _stop(_call("SUB", x[2], x[0]), _call("NEG", x[1]), x[3:7])
    elif name == "BISTOP":
        yield from _stop(_call("SUB", x[2], x[0]), _call("NEG", x[1]), x[4:8])
        yield from _stop(_call("SUB", x[0], x[3]), x[1], x[4:8])


def switches(root: Node, variables: Mapping[int, Expression]) -> dict[Node, bool]:
    """Return the switches of an expression and of the variables that it uses, each once.

    Each with whether the value may jump there, not only its slope.
    """
    found: dict[Node, bool] = {}
    waiting, seen = [root], set[int]()
    while waiting:
        node = waiting.pop()
        if not isinstance(node, Call):
            continue
        if node.name == "VARVAL":
            id = int(node.args[0].value) if isinstance(node.args[0], Number) else 0
            if id in variables and id not in seen:
                seen.add(id)
                waiting.append(variables[id].root)
            continue
        for switch in _of_call(node):
            found[switch] = found.get(switch, False) or node.name in _JUMPS
        waiting.extend(node.args)
    return found


def _sides(found: Iterable[Node]) -> Node:
    """Return the expression whose value tells the sides of all switches."""
    total: Node = _NAUGHT
    for k, switch in enumerate(islice(found, MOST_SWITCHES)):
        bit = _call("IF", switch, _NAUGHT, _NAUGHT, Number(2.0**k))
        total = bit if k == 0 else _call("ADD", total, bit)
    return total


def _acting(model: Model) -> Iterator[Expression]:
    """Yield the expressions of forces, slopes of states, and accelerations that depend on these."""
    for kind in of_form(Expressed):
        yield from (force.expr for force in model.table(kind.name).values())
    for kind in of_form(Components):
        for element in model.table(kind.name).values():
            yield from (expression for expression in element.exprs if expression is not None)
    for state in model.differentials.values():
        yield state.expr
    for motion in model.motions.values():
        of_state = motion.expr is not None and any(looked_at(model, motion.expr))
        if motion.expr is not None and motion.val_type == "A" and of_state:
            yield motion.expr


def has_modes(model: Model) -> bool:
    """Return whether some friction is one that sticks or slips."""
    if any(model.table(kind.name) for kind in memories()):
        return True
    return bool(sticking(model))


def sticking(model: Model) -> set[int]:
    """Return the ids of the contacts whose friction sticks or slips."""
    return {
        id
        for id, contact in model.contacts.items()
        if contact.cff_type in FRICTION_LAWS and FRICTION_LAWS[contact.cff_type].modes
    }


def switching_table(
    model: Model,
    programs: ProgramTable,
    applied: Sequence[tuple[str, int]],
    modes: Sequence[int] = (),
) -> Switching:
    """Return what is watched: a program for each expression, forces with branches, modes.

    `applied` are kind and id of the applied forces, `modes` programs that tell the modes of users'
    elements.
    """
    variables = {id: v.expr for id, v in model.variables.items() if v.user is None}
    rows, jumps, any_found = [], [], any(s.changes for s in model.simulations)
    still = [Instruction(NUMBER, value=0.0)]
    for expression in _acting(model):
        found = switches(expression.root, variables)
        row = programs.add(Expression(expression.text, _sides(found)), forces=True)
        made = programs.programs[row]
        if len(made) > LONGEST or any(made_op.op in _NOT_ASKED for made_op in made):
            programs.programs[row] = made = still
        any_found = any_found or len(made) > 1
        rows.append(row)
        jumps.append(1 if any(found.values()) else 0)
    if not any_found:
        rows, jumps = [], []
    rows += modes
    forms = [FORCES[name].form for name, _ in applied]
    branched = [f for f, form in enumerate(forms) if isinstance(form, Switched)]
    last = [-1] if has_modes(model) else []
    return Switching(
        np.array([*rows, *(-1 for _ in branched), *last], dtype=np.int64),
        np.array([*(-1 for _ in rows), *branched, *last], dtype=np.int64),
        np.array([*jumps, *(0 for _ in (*modes, *branched, *last))], dtype=np.int64),
    )

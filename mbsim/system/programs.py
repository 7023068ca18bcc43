"""Expressions of a model as programs of a stack machine.

A program pushes jets (value, first and second derivative by time) on a stack and replaces the
topmost by functions of them; its last jet is the result. An instruction is its operation and
up to five numbers:

| operation          | numbers                                                               |
|--------------------|-----------------------------------------------------------------------|
| NUMBER, TIME       | row of `Programs.number`; none                                        |
| elementary         | how many arguments it takes from the stack                            |
| DISTANCE           | markers i, j                                                          |
| OFFSET             | markers i, j, k and axis of k                                         |
| ANGLE              | row of `Angles`                                                       |
| TURN               | markers i, j, place in `TURNS`                                        |
| ORIENT             | markers i, j, which Euler parameter (0 to 3)                          |
| SPEED              | markers i, j, l                                                       |
| CLOSING            | markers i, j                                                          |
| VELOCITY           | markers i, j, k, l and axis of k                                      |
| TURNING            | markers i, j                                                          |
| SPIN               | markers i, j, k and axis of k                                         |
| NET                | markers i, j, k and component 1 to 8; j is 0 for forces on i alone    |
| ELEMENT            | 0 a connection or 1 an applied force, its row, jflag, comp, marker k  |
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from mbsim.errors import DeckError, Fault
from mbsim.expressions import elementary
from mbsim.expressions.elementary import CODES, FIRST_MEASURE, NUMBER, TIME
from mbsim.expressions.functions import FUNCTIONS, Kind
from mbsim.expressions.parse import ExpressionError
from mbsim.expressions.tree import Call, Expression, Node, Number, Time
from mbsim.model.elements import Variable
from mbsim.model.names import element_name
from mbsim.system import arrays as a
from mbsim.system.markers import MarkerTable

DISTANCE, OFFSET, ANGLE, TURN, ORIENT = range(FIRST_MEASURE, FIRST_MEASURE + 5)
SPEED, CLOSING, VELOCITY, TURNING, SPIN = range(FIRST_MEASURE + 5, FIRST_MEASURE + 10)
NET, ELEMENT = range(FIRST_MEASURE + 10, FIRST_MEASURE + 12)
TURNS = ("PSI", "THETA", "PHI", "YAW", "PITCH", "ROLL")

#: Variables that use each other, and instructions of a program with all its variables.
DEEPEST_VARIABLE = 50
LONGEST_PROGRAM = 50_000

_COMPONENTS = ("FM", "FX", "FY", "FZ", "TM", "TX", "TY", "TZ")
_STATEMENTS = {
    "Motion": "Motion_Joint",
    "GeneralConstraint": "Constraint_General",
    "ScalarForce": "Force_Scalar_TwoBody",
    "VectorForce": "Force_Vector_TwoBody",
    "BodyForce": "Force_Vector_OneBody",
    "Gravity": "Force_Gravity",
    "Variable": "Reference_Variable",
    "Request": "Post_Request",
}


class Instruction(NamedTuple):
    """One instruction; `element` is (statement, id) where the row is not known yet."""

    op: int
    rows: tuple[int, ...] = ()
    value: float = 0.0
    element: tuple[str, int] | None = None


@dataclass
class ProgramTable:
    """Programs in the order in which they are asked for."""

    markers: MarkerTable
    variables: Mapping[int, Variable] = field(default_factory=dict)
    programs: list[list[Instruction]] = field(default_factory=list)

    def add(
        self,
        expression: Expression,
        owner: Any = None,
        *,
        differentiable: bool = False,
        of_time: bool = False,
        forces: bool = False,
    ) -> int:
        """Return the row of a new program.

        Parameters
        ----------
        expression : Expression
        owner : element of the model, optional
            Whose expression it is: a fault then names its line.
        differentiable : bool
            Only displacements and TIME, so that jets mean something.
        of_time : bool
            Only TIME.
        forces : bool
            Forces too: these are known when an output row is written, not while forces are summed.

        Raises
        ------
        DeckError, or ExpressionError if no owner is given
            Where the expression has what may not be used.
        """
        allowed = {Kind.ELEMENTARY, Kind.VARIABLE}
        if not of_time:
            allowed.add(Kind.DISPLACEMENT)
            if not differentiable:
                allowed.add(Kind.VELOCITY)
                if forces:
                    allowed.add(Kind.FORCE)
        try:
            made = _Compiler(self, frozenset(allowed)).compile(expression.root)
        except ExpressionError as fault:
            if owner is None:
                raise
            source, type_name = owner.source, type(owner).__name__
            statement = getattr(owner, "statement", _STATEMENTS.get(type_name, type_name))
            name = element_name(source.file, statement, owner.id)
            where = Fault(source.file, source.line, name, f"in {expression.text!r}: {fault}")
            raise DeckError([where]) from None
        self.programs.append(made)
        return len(self.programs) - 1

    def looks_at(self, program: int) -> list[int]:
        """Return the rows of the markers that displacements of a program are measured between."""
        angles = list(self.markers.angle_rows)
        found: dict[int, None] = {}
        for op, rows, _, _ in self.programs[program]:
            if op in (DISTANCE, TURN, ORIENT):
                found.update(dict.fromkeys(rows[:2]))
            elif op == OFFSET:
                found.update(dict.fromkeys(rows[:3]))
            elif op == ANGLE:
                found.update(dict.fromkeys(angles[rows[0]]))
        return list(found)

    def arrays(
        self,
        connections: Sequence[tuple[str, int]] = (),
        applied: Sequence[tuple[str, int]] = (),
    ) -> a.Programs:
        """Return the programs; force measures find their rows by (statement, id) in these lists."""
        rows = {element: (1, k) for k, element in enumerate(applied)}
        rows.update({element: (0, k) for k, element in enumerate(connections)})
        numbers: dict[float, int] = {}
        code = np.zeros((sum(map(len, self.programs)), 6), dtype=np.int64)
        at = 0
        for program in self.programs:
            for op, given, value, element in program:
                if op == NUMBER:
                    # the sign of a zero counts, but neither gives another result than the other
                    given = (numbers.setdefault(value, len(numbers)),)
                elif element is not None:
                    given = (*rows[element], *given)
                code[at, 0] = op
                code[at, 1 : 1 + len(given)] = given
                at += 1
        lengths = [len(program) for program in self.programs]
        return a.Programs(
            np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64),
            code,
            np.array(list(numbers), dtype=np.float64),
            np.zeros((max(map(_deepest, self.programs), default=0), 3)),
        )


def _deepest(program: list[Instruction]) -> int:
    """Return how many jets stand on the stack at most."""
    depth, most = 0, 0
    for op, rows, _, _ in program:
        depth += 1 - (rows[0] if TIME < op < FIRST_MEASURE else 0)
        most = max(most, depth)
    return most


class _Compiler:
    """Makes one program; variables are put in place."""

    def __init__(self, table: ProgramTable, allowed: frozenset[Kind]) -> None:
        self.table, self.allowed = table, allowed
        self.open: list[int] = []  # variables that are being put in
        self.made: dict[int, list[Instruction]] = {}

    def compile(self, root: Node) -> list[Instruction]:
        """Return the instructions of a tree, arguments before their function."""
        made: list[Instruction] = []
        starts: list[int] = []  # of what is complete and not yet an argument
        waiting: list[tuple[Node, bool]] = [(root, False)]
        while waiting:
            node, complete = waiting.pop()
            if isinstance(node, Call) and self.is_elementary(node):
                if complete:
                    _combine(node, made, starts)
                else:
                    waiting.append((node, True))
                    waiting.extend((arg, False) for arg in reversed(node.args))
                continue
            starts.append(len(made))
            made.extend(self.leaf(node))
            if len(made) > LONGEST_PROGRAM:
                column = node.column if isinstance(node, Call) else 1
                raise ExpressionError(
                    f"more than {LONGEST_PROGRAM} operations, those of variables counted", column
                )
        return made

    def is_elementary(self, node: Call) -> bool:
        """Return whether a function takes its arguments from the stack; refuse what may not be."""
        function = FUNCTIONS.get(node.name)
        kind = function.kind if function else Kind.ELEMENTARY
        if kind not in self.allowed:
            raise ExpressionError(
                f"{node.name} looks at {kind.value}, which cannot be used here", node.column
            )
        return kind is Kind.ELEMENTARY

    def leaf(self, node: Node) -> list[Instruction]:
        """Return the instructions of what takes nothing from the stack."""
        if isinstance(node, Number):
            return [Instruction(NUMBER, value=node.value)]
        if isinstance(node, Time):
            return [Instruction(TIME)]
        kind = FUNCTIONS[node.name].kind
        return self.variable(node) if kind is Kind.VARIABLE else [self.measure(node, kind)]

    def variable(self, node: Call) -> list[Instruction]:
        """Return the instructions of another variable's expression."""
        key = self.number(node, 0)
        if key in self.made:
            return self.made[key]
        variable = self.table.variables.get(key)
        if variable is None:
            raise ExpressionError(f"there is no variable {key}", node.column)
        ring = " -> ".join(map(str, [*self.open, key]))
        if key in self.open:
            raise ExpressionError(f"variables that need each other: {ring}", node.column)
        if len(self.open) >= DEEPEST_VARIABLE:
            raise ExpressionError(
                f"more than {DEEPEST_VARIABLE} variables that use one another", node.column
            )
        self.open.append(key)
        try:
            made = self.compile(variable.expr.root)
        except ExpressionError as fault:
            if fault.message.startswith("in variable"):
                raise
            raise ExpressionError(
                f"in variable {key}, {variable.expr.text!r}: {fault.message}", fault.column
            ) from None
        self.open.pop()
        self.made[key] = made
        return made

    def number(self, node: Call, place: int) -> int:
        """Return an argument that is a whole number, 0 where it is left out."""
        if place >= len(node.args):
            return 0
        arg = node.args[place]
        if not isinstance(arg, Number):
            raise ExpressionError(f"{node.name} needs ids that are numbers", node.column)
        return int(arg.value)

    def marker(self, node: Call, place: int) -> int:
        """Return the row of a marker, that of the global frame where it is left out."""
        key = self.number(node, place)
        if key and key not in self.table.markers.placement.markers:
            raise ExpressionError(f"{node.name}: there is no marker {key}", node.column)
        return self.table.markers.row(key)

    def measure(self, node: Call, kind: Kind) -> Instruction:
        """Return the one instruction of a function that looks at the model."""
        name, table = node.name, self.table.markers
        if kind is Kind.FORCE:
            return self.force(node)
        if name == "ORIENT":
            which = self.number(node, 1) - 1
            return Instruction(ORIENT, (self.marker(node, 2), self.marker(node, 3), which))
        i, j = self.marker(node, 0), self.marker(node, 1)
        if name in ("DM", "VR", "WM"):
            return Instruction({"DM": DISTANCE, "VR": CLOSING, "WM": TURNING}[name], (i, j))
        if name in TURNS:
            return Instruction(TURN, (i, j, TURNS.index(name)))
        k = self.marker(node, 2)
        if name == "VM":
            return Instruction(SPEED, (i, j, k))
        axis = "XYZ".index(name[1])
        if name[0] == "A":
            return Instruction(ANGLE, (table.angle(table.turned(i, axis), table.turned(j, axis)),))
        if name[0] == "V":
            return Instruction(VELOCITY, (i, j, k, self.marker(node, 3), axis))
        return Instruction({"D": OFFSET, "W": SPIN}[name[0]], (i, j, k, axis))

    def force(self, node: Call) -> Instruction:
        """Return a force between markers, or of one element whose row is found later."""
        if node.name in _COMPONENTS:
            i, j, k = (self.marker(node, place) for place in range(3))
            return Instruction(NET, (i, 0 if j == i else j, k, 1 + _COMPONENTS.index(node.name)))
        element = (FUNCTIONS[node.name].args[0], self.number(node, 0))
        rows = (self.number(node, 1), self.number(node, 2), self.marker(node, 3))
        return Instruction(ELEMENT, rows, element=element)


def _combine(node: Call, made: list[Instruction], starts: list[int]) -> None:
    """Put a function behind its arguments, or the number that it makes of numbers there."""
    count = len(node.args)
    first = starts[-count]
    del starts[-count:]
    starts.append(first)
    args = made[first:]
    if len(args) == count and all(arg.op == NUMBER for arg in args):
        made[first:] = [_folded(node, [arg.value for arg in args])]
    else:
        made.append(Instruction(CODES[node.name], (count,)))


def _folded(node: Call, values: list[float]) -> Instruction:
    """Return the number that a function makes of numbers."""
    stack = np.zeros((len(values), 3))
    stack[:, 0] = values
    try:
        with np.errstate(divide="raise", over="raise", invalid="raise"):
            elementary.apply(CODES[node.name], len(values), stack, len(values))
    except (ArithmeticError, ValueError):
        stack[0, 0] = np.nan
    if not np.isfinite(stack[0, 0]):
        shown = ", ".join(f"{value:g}" for value in values)
        raise ExpressionError(f"{node.name} of {shown} is not a finite number", node.column)
    return Instruction(NUMBER, value=float(stack[0, 0]))

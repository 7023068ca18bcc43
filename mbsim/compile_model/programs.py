"""Expressions of a model as programs of a stack machine, see `instructions`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mbsim.arrays.codes import CODE_OPERAND, CODE_OPERATION, JET_VALUE
from mbsim.arrays.model import Programs
from mbsim.compile_model.instructions import (
    ACCELERATION,
    ANGLE,
    CLOSING,
    DEEPEST,
    DISTANCE,
    ELEMENT,
    INCLUDED,
    INPUT,
    NET,
    OFFSET,
    ORIENT,
    SENSED,
    SPEED,
    SPIN,
    SPIN_UP,
    SPLINE,
    STATE,
    TURN,
    TURNING,
    TURNS,
    USER,
    VELOCITY,
    Instruction,
)
from mbsim.compile_model.markers import MarkerTable
from mbsim.compile_model.program_quick import quicken, stack_depth
from mbsim.compile_model.splines import SplineTable
from mbsim.core.prototypes import copies
from mbsim.errors import DeckError, Fault
from mbsim.expressions import elementary
from mbsim.expressions.elementary import CODES, NUMBER, TIME
from mbsim.expressions.functions import CONTACT_BY_INDEX, FUNCTIONS, SPLINE_POINTS, Kind
from mbsim.expressions.parse import ExpressionError
from mbsim.expressions.tree import Call, Expression, Node, Number, Time, UserResult
from mbsim.forces.catalog import FORCES, Components
from mbsim.model.elements import ArrayOfNumbers, Differential, InputElement, Spline, Variable
from mbsim.model.names import element_name

#: Variables that use each other, and instructions of a program with all its variables.
DEEPEST_VARIABLE = 50
LONGEST_PROGRAM = 50_000
_COMPONENTS = ("FM", "FX", "FY", "FZ", "TM", "TX", "TY", "TZ")
_STATEMENTS = {
    "Motion": "Motion_Joint",
    "GeneralConstraint": "Constraint_General",
    "Gravity": "Force_Gravity",
    "Variable": "Reference_Variable",
    "Differential": "Control_Diff",
    "Sensor": "Sensor_Event",
    "Evaluation": "Sensor_Evaluate",
    "Request": "Post_Request",
}


#: How many rows of markers an instruction that measures between them begins with.
_MEASURED = {
    **dict.fromkeys((DISTANCE, TURN, ORIENT, CLOSING, TURNING), 2),
    **dict.fromkeys((OFFSET, INCLUDED, SPEED, SPIN), 3),
    VELOCITY: 4,
}

Rows = Mapping[tuple[str, int], tuple[int, int]]


@dataclass
class ProgramTable:
    """Programs in the order in which they are asked for."""

    markers: MarkerTable
    variables: Mapping[int, Variable] = field(default_factory=dict)
    differentials: Mapping[int, Differential] = field(default_factory=dict)
    first_state: int = 0  # where in y the first of their states stands
    sensors: Sequence[int] = ()  # ids by which SENVAL shows what they evaluate, row by row
    splines: Mapping[int, Spline] = field(default_factory=dict)
    arrays_of_numbers: Mapping[int, ArrayOfNumbers] = field(default_factory=dict)
    programs: list[list[Instruction]] = field(default_factory=list)
    curves: SplineTable = field(default_factory=SplineTable)
    #: Row of `arrays.Users` of each user subroutine, by statement and id of its element.
    users: Mapping[tuple[str, int], int] = field(default_factory=dict)
    #: What the caller sets between steps; each has the row of `Programs.number` of its place here.
    inputs: Sequence[InputElement] = ()
    #: Where the rows of elements are that force measures name, once the programs are arrays.
    element_rows: Rows = field(default_factory=dict)

    def add(
        self,
        expression: Expression,
        owner: Any = None,
        *,
        differentiable: bool = False,
        velocities: bool = False,
        of_time: bool = False,
        forces: bool = False,
        accelerations: bool = False,
    ) -> int:
        """Return the row of a new program.

        Parameters
        ----------
        expression : Expression
        owner : element of the model, optional
            Whose expression it is: a fault then names its line.
        differentiable : bool
            Only displacements and TIME, so that jets mean something.
        velocities : bool
            Velocities too, where it is differentiable: of these the jets are values alone.
        of_time : bool
            Only TIME.
        forces : bool
            Forces too: for what is evaluated behind them, see `compile_model.force_order`.
        accelerations : bool
            Accelerations too, which are known when an output row is written.

        Raises
        ------
        DeckError, or ExpressionError if no owner is given
            Where the expression has what may not be used.
        """
        allowed = {Kind.ELEMENTARY, Kind.VARIABLE, Kind.TABLE}
        if not of_time:
            allowed.add(Kind.DISPLACEMENT)
            if velocities:
                allowed.add(Kind.VELOCITY)
            if not differentiable:
                allowed |= {Kind.VELOCITY, Kind.STATE}
                if forces:
                    allowed.add(Kind.FORCE)
                if accelerations:
                    allowed.add(Kind.ACCELERATION)
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

    def input_row(self, table: str, id: int) -> int | None:
        """Return which of the inputs an element is, None for none."""
        elements = [(each.table, each.id) for each in self.inputs]
        return elements.index((table, id)) if (table, id) in elements else None

    def add_input(self, row: int) -> int:
        """Return the row of a new program that is an input alone."""
        self.programs.append([Instruction(INPUT, (row,), self.inputs[row].start)])
        return len(self.programs) - 1

    def measure(self, node: Call) -> Instruction:
        """Return the instruction of a function that looks at the model."""
        return _Compiler(self, frozenset()).measure(node, FUNCTIONS[node.name].kind)

    def rows_of(self, instruction: Instruction) -> tuple[int, ...]:
        """Return the numbers of an instruction, once the programs are arrays.

        Raises
        ------
        KeyError
            If the element that it names is not there.
        """
        if instruction.element is None:
            return instruction.rows
        return (*self.element_rows[instruction.element], *instruction.rows)

    def looks_at(self, program: int) -> list[int]:
        """Return the rows of the markers that a program measures between."""
        angles = list(self.markers.angle_rows)
        found: dict[int, None] = {}
        for op, rows, _, _ in self.programs[program]:
            if op in _MEASURED:
                found.update(dict.fromkeys(rows[: _MEASURED[op]]))
            elif op == ANGLE:
                found.update(dict.fromkeys(angles[rows[0]]))
        return list(found)

    def arrays(
        self,
        connections: Sequence[tuple[str, int]] = (),
        applied: Sequence[tuple[str, int]] = (),
        contacts: Sequence[int] = (),
    ) -> Programs:
        """Return the programs; force measures find their rows by (statement, id) in these lists."""
        rows = {
            (form.known_as, id): (1, k)
            for k, (kind, id) in enumerate(applied)
            if isinstance(form := FORCES[kind].form, Components) and form.known_as
        }
        rows.update({element: (1, k) for k, element in enumerate(applied)})
        rows.update({element: (0, k) for k, element in enumerate(connections)})
        rows.update({("CONTACT", id): (2, k) for k, id in enumerate(contacts)})
        self.element_rows = rows
        if not (self.programs or self.inputs or self.curves.made):
            return _no_programs()
        numbers = NumberTable([each.start for each in self.inputs])
        start, code = _table(self.programs, rows, numbers)
        shortened = [quicken(program) for program in self.programs]
        quick_start, quick = _table(shortened, rows, numbers)
        deepest = max(map(stack_depth, self.programs), default=0)
        return Programs(
            start,
            code,
            np.array(numbers.values, dtype=np.float64),
            np.zeros((deepest, 3)),
            quick_start,
            quick,
            # beside the instruction: one load less than by its row of `number`
            np.array([instruction.value for program in shortened for instruction in program]),
            np.zeros(deepest + 1),
            *self.curves.arrays(),
        )


@copies
def _no_programs() -> Programs:
    start, code = _table([], {}, NumberTable([]))
    none, curves = np.zeros(0), SplineTable().arrays()
    return Programs(start, code, none, np.zeros((0, 3)), start, code, none, np.zeros(1), *curves)


class NumberTable:
    """The numbers of programs; inputs come first.

    Each has a row of its own, also where two are the same number: what changes one of them for a
    derivative leaves the other alone.
    """

    def __init__(self, inputs: list[float]) -> None:
        self.values = list(inputs)

    def row(self, value: float) -> int:
        """Return the row of a number, which is no input."""
        self.values.append(value)
        return len(self.values) - 1


def _table(
    programs: list[list[Instruction]], rows: Rows, numbers: NumberTable
) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """Return where each program starts, and all instructions; numbers are put into their table."""
    code = np.zeros((sum(map(len, programs)), 6), dtype=np.int64)
    at = 0
    for program in programs:
        for op, given, value, element in program:
            if op == NUMBER:
                # the sign of a zero counts, but neither gives another result than the other
                given = (numbers.row(value),)
            elif op == INPUT:
                op = NUMBER
            elif element is not None:
                given = (*rows[element], *given)
            code[at, CODE_OPERATION] = op
            code[at, CODE_OPERAND : CODE_OPERAND + len(given)] = given
            at += 1
    lengths = [len(program) for program in programs]
    return np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64), code


class _Compiler:
    """Makes one program; variables are put in place."""

    def __init__(self, table: ProgramTable, allowed: frozenset[Kind]) -> None:
        self.table, self.allowed = table, allowed
        # variables and slopes that are being put in, by function and id
        self.open: list[tuple[str, int]] = []
        self.made: dict[tuple[str, int], list[Instruction]] = {}

    def compile(self, root: Node) -> list[Instruction]:
        """Return the instructions of a tree, arguments before their function."""
        made: list[Instruction] = []
        starts: list[int] = []  # of what is complete and not yet an argument
        waiting: list[tuple[Node, bool]] = [(root, False)]
        while waiting:
            node, complete = waiting.pop()
            operands = self.operands(node)
            if operands and isinstance(node, Call):
                if complete:
                    self.combine(node, made, starts)
                else:
                    waiting.append((node, True))
                    waiting.extend((arg, False) for arg in reversed(operands))
                continue
            starts.append(len(made))
            made.extend(self.leaf(node))
            if len(made) > LONGEST_PROGRAM:
                column = node.column if isinstance(node, Call) else 1
                raise ExpressionError(
                    f"more than {LONGEST_PROGRAM} operations, those of variables counted", column
                )
        return made

    def operands(self, node: Node) -> tuple[Node, ...]:
        """Return the arguments that a function takes from the stack; refuse what may not be."""
        if not isinstance(node, Call):
            return ()
        function = FUNCTIONS.get(node.name)
        kind = function.kind if function else Kind.ELEMENTARY
        if kind not in self.allowed:
            raise ExpressionError(
                f"{node.name} looks at {kind.value}, which cannot be used here", node.column
            )
        if kind is Kind.ELEMENTARY:
            return node.args
        return node.args[:2] if node.name in SPLINE_POINTS else ()

    def combine(self, node: Call, made: list[Instruction], starts: list[int]) -> None:
        """Put a function behind its arguments, or the number that it makes of numbers there."""
        if node.name in SPLINE_POINTS:
            starts.pop()
            made.append(self.spline(node))
        else:
            _combine(node, made, starts)

    def spline(self, node: Call) -> Instruction:
        """Return the instruction that evaluates a spline at x and z."""
        key, order = self.number(node, 2), self.number(node, 3)
        spline = self.table.splines.get(key)
        if spline is None:
            raise ExpressionError(f"{node.name}: there is no spline {key}", node.column)
        first, count = self.table.curves.rows(spline, node.name)
        return Instruction(SPLINE, (first, count, order))

    def entry(self, node: Call) -> Instruction:
        """Return a number of an array."""
        key, position = self.number(node, 0), self.number(node, 1)
        array = self.table.arrays_of_numbers.get(key)
        if array is None:
            raise ExpressionError(f"ARYVAL: there is no array {key}", node.column)
        return Instruction(NUMBER, value=array.values[position - 1])

    def leaf(self, node: Node) -> list[Instruction]:
        """Return the instructions of what takes nothing from the stack."""
        if isinstance(node, Number):
            return [Instruction(NUMBER, value=node.value)]
        if isinstance(node, Time):
            return [Instruction(TIME)]
        if isinstance(node, UserResult):
            if Kind.STATE not in self.allowed and node.statement != "MOTION":
                raise ExpressionError("what a user subroutine returns cannot be used here", 1)
            row = self.table.users[node.statement, node.id]
            # one of several results that are asked for apart, as outputs in forces: it is called
            calls = int(node.statement == "GSE")
            return [Instruction(USER, (row, node.component, calls))]
        kind = FUNCTIONS[node.name].kind
        if kind is Kind.VARIABLE:
            return self.variable(node)
        return [self.entry(node) if kind is Kind.TABLE else self.measure(node, kind)]

    def variable(self, node: Call) -> list[Instruction]:
        """Return the instructions of a variable's expression, or of a state's slope."""
        slope, id = node.name == "DIF1", self.number(node, 0)
        key, what = (node.name, id), "state" if slope else "variable"
        if key in self.made:
            return self.made[key]
        row = None if slope else self.table.input_row("variables", id)
        if row is not None:
            return [Instruction(INPUT, (row,), self.table.inputs[row].start)]
        variable: Any = (self.table.differentials if slope else self.table.variables).get(id)
        if variable is None:
            raise ExpressionError(f"there is no {what} {id}", node.column)
        ring = " -> ".join(str(id) for _, id in [*self.open, key])
        if key in self.open:
            raise ExpressionError(f"{what}s that need each other: {ring}", node.column)
        if len(self.open) >= DEEPEST_VARIABLE:
            raise ExpressionError(
                f"more than {DEEPEST_VARIABLE} variables that use one another", node.column
            )
        self.open.append(key)
        try:
            made = self.compile(variable.expr.root)
        except ExpressionError as fault:
            if fault.message.startswith(("in variable", "in state")):
                raise
            raise ExpressionError(
                f"in {what} {id}, {variable.expr.text!r}: {fault.message}", fault.column
            ) from None
        self.open.pop()
        self.made[key] = made
        return made

    def number(self, node: Call, position: int) -> int:
        """Return an argument that is a whole number, 0 where it is left out."""
        if position >= len(node.args):
            return 0
        arg = node.args[position]
        if not isinstance(arg, Number):
            raise ExpressionError(f"{node.name} needs ids that are numbers", node.column)
        return int(arg.value)

    def marker(self, node: Call, position: int) -> int:
        """Return the row of a marker, that of the global frame where it is left out."""
        key = self.number(node, position)
        if key and key not in self.table.markers.placement.markers:
            raise ExpressionError(f"{node.name}: there is no marker {key}", node.column)
        return self.table.markers.row(key)

    def measure(self, node: Call, kind: Kind) -> Instruction:
        """Return the one instruction of a function that looks at the model."""
        name, table = node.name, self.table.markers
        if kind is Kind.FORCE:
            return self.force(node)
        if kind is Kind.STATE:
            return self.state(node)
        if name == "ORIENT":
            which = self.number(node, 1) - 1
            return Instruction(ORIENT, (self.marker(node, 2), self.marker(node, 3), which))
        i, j = self.marker(node, 0), self.marker(node, 1)
        if name in ("DM", "VR", "WM"):
            return Instruction({"DM": DISTANCE, "VR": CLOSING, "WM": TURNING}[name], (i, j))
        if name[:3] in ("ACC", "WDT"):
            return self.acceleration(node)
        if name == "INCANG":
            return Instruction(INCLUDED, (i, j, self.marker(node, 2)))
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

    def state(self, node: Call) -> Instruction:
        """Return a state of the user's own, or what a sensor has evaluated."""
        id = self.number(node, 0)
        if node.name == "SENVAL":
            if id not in self.table.sensors:
                raise ExpressionError(f"no sensor evaluates what SENVAL({id}) shows", node.column)
            return Instruction(SENSED, (list(self.table.sensors).index(id),))
        if id not in self.table.differentials:
            raise ExpressionError(f"there is no state {id}", node.column)
        return Instruction(STATE, (self.table.first_state + [*self.table.differentials].index(id),))

    def acceleration(self, node: Call) -> Instruction:
        """Return the derivative of a velocity; of a magnitude the third marker is the observer."""
        axis = "XYZM".index(node.name[3])
        i, j, third, fourth = (self.marker(node, position) for position in range(4))
        k, observer = (third, fourth) if axis < 3 else (self.table.markers.row(0), third)
        op = ACCELERATION if node.name[0] == "A" else SPIN_UP
        return Instruction(op, (i, j, k, observer, axis))

    def force(self, node: Call) -> Instruction:
        """Return a force between markers, or of one element whose row is found later."""
        if node.name in _COMPONENTS:
            i, j, k = (self.marker(node, position) for position in range(3))
            return Instruction(NET, (i, 0 if j == i else j, k, 1 + _COMPONENTS.index(node.name)))
        element = (FUNCTIONS[node.name].args[0], self.number(node, 0))
        if node.name == CONTACT_BY_INDEX:
            return Instruction(ELEMENT, (0, DEEPEST, self.marker(node, 2)), element=element)
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
    stack[:, JET_VALUE] = values
    try:
        with np.errstate(divide="raise", over="raise", invalid="raise"):
            elementary.apply(CODES[node.name], len(values), stack, len(values))
    except (ArithmeticError, ValueError):
        stack[0, JET_VALUE] = np.nan
    if not np.isfinite(stack[0, JET_VALUE]):
        shown = ", ".join(f"{value:g}" for value in values)
        raise ExpressionError(f"{node.name} of {shown} is not a finite number", node.column)
    return Instruction(NUMBER, value=float(stack[0, JET_VALUE]))

"""The instructions of expressions: operations of a stack machine and their numbers.

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
| TURN               | markers i, j, index in `TURNS`                                        |
| ORIENT             | markers i, j, which Euler parameter (0 to 3)                          |
| SPEED              | markers i, j, l                                                       |
| CLOSING            | markers i, j                                                          |
| VELOCITY           | markers i, j, k, l and axis of k                                      |
| TURNING            | markers i, j                                                          |
| SPIN               | markers i, j, k and axis of k                                         |
| INCLUDED           | markers i, j, k                                                       |
| ACCELERATION       | markers i, j, k, l and axis of k, 3 for the magnitude                 |
| SPIN_UP            | the same                                                              |
| NET                | markers i, j, k and component 1 to 8; j is 0 for forces on i alone    |
| STATE              | offset in y                                                           |
| SENSED             | row of `Sensors`                                                      |
| ELEMENT            | 0 a connection, 1 an applied force, 2 a contact, its row, jflag,      |
|                    | comp (9 is the depth of a contact), marker k                          |
| SPLINE             | first curve, how many, order of the derivative; x and z are the two   |
|                    | topmost jets                                                          |
| USER               | row of `Users`, which of its results, 1 to call it; so does result 0  |
"""

from __future__ import annotations

from typing import NamedTuple

from mbsim.expressions import elementary
from mbsim.expressions.elementary import FIRST_MEASURE

#: Columns of an instruction: its operation, then markers of measures; the last of SPEED.
OP, MARKER_I, MARKER_J, MARKER_K, MARKER_L = range(5)
OBSERVER = 3
#: Of OFFSET and SPIN the axis of K, of NET the component; of VELOCITY and accelerations the axis.
AXIS_OF_K, AXIS = 4, 5
#: Which angle of TURNS, which Euler parameter.
WHICH = 3
#: Of others: a row of `Programs.number`, `Angles`, `Sensors`, `Users`; how many arguments; where in
#: y a state stands.
ROW, COUNT, STATE_AT = 1, 1, 1
RESULT, CALLS = 2, 3
KIND, ELEMENT_ROW, JFLAG, COMPONENT, SEEN_BY = range(1, 6)
FIRST_CURVE, CURVES, ORDER = range(1, 4)
#: As a component of a contact: its deepest penetration.
DEEPEST = 9
#: As an axis of accelerations: their magnitude.
MAGNITUDE = 3

DISTANCE, OFFSET, ANGLE, TURN, ORIENT, INCLUDED = range(FIRST_MEASURE, FIRST_MEASURE + 6)
SPEED, CLOSING, VELOCITY, TURNING, SPIN = range(FIRST_MEASURE + 6, FIRST_MEASURE + 11)
ACCELERATION, SPIN_UP, NET, ELEMENT = range(FIRST_MEASURE + 11, FIRST_MEASURE + 15)
STATE, SENSED, USER, SPLINE = range(FIRST_MEASURE + 15, FIRST_MEASURE + 19)
#: Of values alone: the topmost with a number, x + n and so on, then n - x, n / x.
#: TIME n; x + TIME n.
ADD_N, SUB_N, MUL_N, DIV_N, POW_N, N_SUB, N_DIV = range(SPLINE + 1, SPLINE + 8)
TIME_N, ADD_TIME_N = range(SPLINE + 8, SPLINE + 10)
#: A number that may change between steps, while a program is made; then a NUMBER with a row of its
#: own, before those of all others, which nothing else is put together with.
INPUT = SPLINE + 10
TURNS = ("PSI", "THETA", "PHI", "YAW", "PITCH", "ROLL")

BY_RIGHT = {
    elementary.ADD: ADD_N,
    elementary.SUB: SUB_N,
    elementary.MUL: MUL_N,
    elementary.DIV: DIV_N,
    elementary.POW: POW_N,
}
BY_LEFT = {
    elementary.ADD: ADD_N,
    elementary.SUB: N_SUB,
    elementary.MUL: MUL_N,
    elementary.DIV: N_DIV,
}


class Instruction(NamedTuple):
    """One instruction; `element` is (statement, id) where the row is not known yet."""

    op: int
    rows: tuple[int, ...] = ()
    value: float = 0.0
    element: tuple[str, int] | None = None

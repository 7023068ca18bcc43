"""Programs in fewer instructions, and how deep their stack grows."""

from __future__ import annotations

from mbsim.compile_model.instructions import (
    ADD_TIME_N,
    BY_LEFT,
    BY_RIGHT,
    MUL_N,
    SPLINE,
    TIME_N,
    Instruction,
)
from mbsim.expressions import elementary
from mbsim.expressions.elementary import FIRST_MEASURE, NUMBER, TIME


def quicken(program: list[Instruction]) -> list[Instruction]:
    """Return a program with what is done by a number as one instruction."""
    made: list[Instruction] = []
    starts: list[int] = []  # of what stands on the stack
    for instruction in program:
        taken = _taken(instruction)
        first = starts[-taken] if taken else len(made)
        right = starts[-1] if taken == 2 else 0
        if taken == 2 and instruction.op in BY_RIGHT and _is_number(made[right:]):
            made[-1] = Instruction(BY_RIGHT[instruction.op], value=made[-1].value)
        elif taken == 2 and instruction.op in BY_LEFT and _is_number(made[first:right]):
            made.append(Instruction(BY_LEFT[instruction.op], value=made.pop(first).value))
        else:
            made.append(instruction)
        if len(made) > 1 and made[-1].op == MUL_N and made[-2].op == TIME:
            made[-2:] = [Instruction(TIME_N, value=made[-1].value)]
        if len(made) > 1 and made[-1].op == elementary.ADD and made[-2].op == TIME_N:
            made[-2:] = [Instruction(ADD_TIME_N, value=made[-2].value)]
        if taken:
            del starts[-taken:]
        starts.append(first)
    return made


def _is_number(part: list[Instruction]) -> bool:
    return len(part) == 1 and part[0].op == NUMBER


def _taken(instruction: Instruction) -> int:
    """Return how many jets an instruction takes from the stack."""
    op = instruction.op
    return instruction.rows[0] if TIME < op < FIRST_MEASURE else 2 if op == SPLINE else 0


def stack_depth(program: list[Instruction]) -> int:
    """Return how many jets stand on the stack at most."""
    depth, most = 0, 0
    for instruction in program:
        depth += 1 - _taken(instruction)
        most = max(most, depth)
    return most

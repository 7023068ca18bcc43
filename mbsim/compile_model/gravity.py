"""Force_Gravity as numbers and programs: what is constant, and what follows from TIME."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mbsim.compile_model.programs import ProgramTable
from mbsim.expressions.elementary import NUMBER
from mbsim.model.elements import Gravity, Model


@dataclass(frozen=True)
class Pull:
    """A Force_Gravity as arrays: `constant` [L/T^2] (3,) and `program` (3,), -1 for none."""

    gravity: Gravity
    constant: np.ndarray[Any, Any]
    program: np.ndarray[Any, Any]


def pulls(model: Model, programs: ProgramTable) -> list[Pull]:
    """Return the model's gravity, then those that its Simulate statements have set."""
    found = [model.gravity]
    for simulation in model.simulations:
        given = simulation.gravity
        if given is not None and not any(given is other for other in found):
            found.append(given)
    return [_pull(gravity, programs) for gravity in found]


def _pull(gravity: Gravity, programs: ProgramTable) -> Pull:
    """Return one gravity; an expression that is a number has no program."""
    constant, program = np.array(gravity.g, dtype=np.float64), np.full(3, -1, dtype=np.int64)
    for k, expression in enumerate(gravity.exprs):
        if expression is None:
            continue
        row = programs.add(expression, gravity, of_time=True)
        first = programs.programs[row][0]
        constant[k] = 0.0
        if first.op == NUMBER and len(programs.programs[row]) == 1:
            constant[k] = first.value
        else:
            program[k] = row
    return Pull(gravity, constant, program)

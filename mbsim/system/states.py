"""States of the user's own as rows."""

from __future__ import annotations

import numpy as np

from mbsim.model.elements import Model
from mbsim.system import arrays as a
from mbsim.system.programs import ProgramTable


def states_table(model: Model, programs: ProgramTable) -> a.States:
    """Return the states, whose slopes become programs."""
    states = model.differentials.values()
    return a.States(
        np.array([programs.add(state.expr, state) for state in states], dtype=np.int64),
        programs.first_state + np.arange(len(states), dtype=np.int64),
        np.array([state.scale for state in states], dtype=np.float64),
    )

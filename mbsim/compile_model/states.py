"""States of the user's own and sensors, as rows."""

from __future__ import annotations

import numpy as np

from mbsim.arrays import codes
from mbsim.arrays.model import Sensors, States
from mbsim.compile_model.programs import ProgramTable
from mbsim.model.elements import Model


def states_table(model: Model, programs: ProgramTable) -> States:
    """Return the states, whose slopes become programs."""
    states = model.differentials.values()
    return States(
        np.array(
            [programs.add(state.expr, state, forces=True) for state in states], dtype=np.int64
        ),
        programs.first_state + np.arange(len(states), dtype=np.int64),
        np.array([state.scale for state in states], dtype=np.float64),
    )


_COMPARE = {
    "GE": codes.NOT_LESS,
    "LE": codes.NOT_MORE,
    "GT": codes.MORE,
    "LT": codes.LESS,
    "EQ": codes.EQUAL,
}


def sensors_table(model: Model, programs: ProgramTable) -> Sensors:
    """Return the sensors, with the programs of what they watch and evaluate."""
    sensors = model.sensors.values()
    return Sensors(
        np.array([sensor.id for sensor in sensors], dtype=np.int64),
        np.array([programs.add(sensor.expr, sensor) for sensor in sensors], dtype=np.int64),
        np.array(
            [-1 if s.evaluate is None else programs.add(s.evaluate, s) for s in sensors],
            dtype=np.int64,
        ),
        np.array([_COMPARE[sensor.compare] for sensor in sensors], dtype=np.int64),
        np.array([sensor.value for sensor in sensors], dtype=np.float64),
        np.array([0.0 if s.zero_crossing else s.error_tol for s in sensors], dtype=np.float64),
        np.array([sensor.zero_crossing for sensor in sensors], dtype=np.int64),
    )

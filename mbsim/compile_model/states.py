"""States of the user's own and sensors, as rows."""

from __future__ import annotations

import numpy as np

from mbsim.arrays import scene as a
from mbsim.compile_model.programs import ProgramTable
from mbsim.model.elements import Model


def states_table(model: Model, programs: ProgramTable) -> a.States:
    """Return the states, whose slopes become programs."""
    states = model.differentials.values()
    return a.States(
        np.array(
            [programs.add(state.expr, state, forces=True) for state in states], dtype=np.int64
        ),
        programs.first_state + np.arange(len(states), dtype=np.int64),
        np.array([state.scale for state in states], dtype=np.float64),
    )


_COMPARE = {
    "GE": a.NOT_LESS,
    "LE": a.NOT_MORE,
    "GT": a.MORE,
    "LT": a.LESS,
    "EQ": a.EQUAL,
}


def sensors_table(model: Model, programs: ProgramTable) -> a.Sensors:
    """Return the sensors, with the programs of what they watch and evaluate."""
    sensors = model.sensors.values()
    return a.Sensors(
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

"""How rows are taken of a Drake simulation, and what its stepping takes."""

from __future__ import annotations

import time
from typing import Any

import numpy as np


def advanced(simulator: Any, plant: Any, context: Any, times: np.ndarray) -> tuple[float, Any]:
    """Step to all of `times` [s], the first being the start.

    Returns the wall time of the loop [s] and positions and velocities, a row a time.
    """
    simulator.Initialize()
    state = np.empty((len(times), plant.num_positions() + plant.num_velocities()))
    state[0] = plant.GetPositionsAndVelocities(context)
    start = time.perf_counter()
    for k in range(1, len(times)):
        simulator.AdvanceTo(times[k])
        state[k] = plant.GetPositionsAndVelocities(context)
    return time.perf_counter() - start, state

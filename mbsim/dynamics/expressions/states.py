"""Slopes of the user's own states; `place_bodies` has been called."""

from __future__ import annotations

import math

from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1
from mbsim.core.codes import Code
from mbsim.core.jitable import jitable
from mbsim.dynamics.expressions.jets import value


@jitable
def add_slopes(scene: Scene, t: float, y: F1, dy: F1) -> int:
    """Write z' of every state into y'; return 0 or that one is no number."""
    states = scene.states
    for k in range(len(states.program)):
        slope = value(scene, t, y, states.program[k])
        dy[states.offset[k]] = slope
        if not math.isfinite(slope):
            return Code.NOT_FINITE
    return 0

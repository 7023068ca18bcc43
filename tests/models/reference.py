"""Independent solutions: a mass on the IMPACT law in one dimension, by an 8th-order method."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp


def drop_height(times, z0, low, mass, stiffness, exponent, damping, dmax, g=9.81):
    """Return the height of a body whose lowest point is `low` below its centre.

    Steps are bounded in contact, where the force may vanish and come back (see README,
    design note 6), so that none is missed.
    """

    def force(z, v):
        depth = low - z
        if depth <= 0.0:
            return 0.0
        s = min(depth / dmax, 1.0)
        damper = damping * s * s * (3.0 - 2.0 * s)
        return max(0.0, stiffness * depth**exponent - damper * v)

    def rhs(t, y):
        return [y[1], force(y[0], y[1]) / mass - g]

    def touch(t, y):
        return y[0] - low

    touch.terminal, touch.direction = True, -1.0

    def leave(t, y):
        return y[0] - low

    leave.terminal, leave.direction = True, 1.0
    heights = np.full(len(times), np.nan)
    t, y, end = float(times[0]), [z0, 0.0], float(times[-1])
    free = True
    while t < end:
        solution = solve_ivp(
            rhs,
            (t, end),
            y,
            method="DOP853",
            rtol=1e-12,
            atol=1e-14,
            events=touch if free else leave,
            max_step=np.inf if free else 5e-6,
            dense_output=True,
        )
        inside = (times >= t) & (times <= solution.t[-1])
        if inside.any():
            heights[inside] = solution.sol(times[inside])[0]
        t, y = float(solution.t[-1]), list(solution.y[:, -1])
        y[0] = low
        free = not free
        # leave the surface before the event is armed again
        t_new = t + 1e-12
        y[0] += y[1] * 1e-12
        t = t_new
    return heights

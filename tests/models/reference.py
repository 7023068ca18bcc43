"""Independent solutions: a mass on the IMPACT law, by an 8th-order method; a top, by series."""

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


def top_attitude(inertia, w0, end, steps, order=28):
    """Return the attitude (w first) at `end` of a free top that starts at the identity.

    Taylor series of Euler's equations and q' = q (0, w)/2, all of them products: the series
    of a product is the convolution of the series. In extended precision where there is one.
    """
    real = np.longdouble
    a, b, c = (real(str(i)) for i in inertia)
    ratio = ((b - c) / a, (c - a) / b, (a - b) / c)
    w, q = np.zeros((3, order + 1), real), np.zeros((4, order + 1), real)
    w[:, 0], q[0, 0] = [real(str(x)) for x in w0], 1.0
    powers = (real(str(end)) / steps) ** np.arange(order + 1)
    for _ in range(steps):
        for k in range(order):

            def product(x, y, k=k):
                return np.dot(x[: k + 1], y[k::-1]) / (k + 1)

            for i in range(3):
                w[i, k + 1] = ratio[i] * product(w[(i + 1) % 3], w[(i + 2) % 3])
            q[0, k + 1] = -sum(product(q[i + 1], w[i]) for i in range(3)) / 2
            for i in range(3):
                j, m = (i + 1) % 3, (i + 2) % 3
                turn = product(q[j + 1], w[m]) - product(q[m + 1], w[j])
                q[i + 1, k + 1] = (product(q[0], w[i]) + turn) / 2
        w[:, 0], q[:, 0] = w @ powers, q @ powers
        q[:, 0] /= np.sqrt(q[:, 0] @ q[:, 0])
    return q[:, 0].astype(float)


def angle_between(p, q):
    """Return the angle [rad] from attitude p to attitude q."""
    return 4.0 * np.arcsin(0.5 * min(np.linalg.norm(p - q), np.linalg.norm(p + q)))

"""The woodpecker toy in its three coordinates, by a projected time stepping of its own.

Ch. Glocker, C. Studer, Formulation and preparation for numerical evaluation of linear
complementarity systems in dynamics, Multibody System Dynamics 13 (2005) 447: coordinates are the
sleeve's height, its angle and the bird's; contacts the beak and the sleeve's two edges on the pole.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

#: The published parameters: masses and moments of inertia of sleeve and bird, spring, gravity.
M_SLEEVE, J_SLEEVE, M_BIRD, J_BIRD, SPRING, G = 3e-4, 5e-9, 4.5e-3, 7e-7, 0.0056, 9.81
#: Radius of the pole; sleeve's radius and half height; from the sleeve's axis to the spring, from
#: there to the bird's centre, from there back to the beak; beak's height over it.
POLE, BORE, HALF, TO_SPRING, TO_BIRD, TO_BEAK, BEAK = (
    2.5e-3,
    3.1e-3,
    5.8e-3,
    0.01,
    0.015,
    0.0201,
    0.02,
)
RESTITUTION, MU = (0.5, 0.0, 0.0), 0.3
#: A state of the published limit cycle: coordinates, then velocities.
PUBLISHED = (0.0, -0.1036, -0.2788, -0.3411, 0.0, -7.4583)


@njit
def _model(q, u, tip, curved):
    """Mass matrix, forces, gaps, directions (contact, n or t, coordinate).

    `tip` is the radius of the balls that beak and edges end in. Not `curved`: as published, with
    sin a = a and cos a = 1, and edges at their places of angle 0.
    """
    a, b = q[1], q[2]
    ca, sa, cb, sb = (
        (math.cos(a), math.sin(a), math.cos(b), math.sin(b)) if curved else (1.0, a, 1.0, b)
    )
    mass = np.zeros((3, 3))
    both = M_SLEEVE + M_BIRD
    turn = ca * cb + sa * sb if curved else 1.0
    mass[0, 0], mass[0, 1], mass[0, 2] = both, M_BIRD * TO_SPRING * ca, M_BIRD * TO_BIRD * cb
    mass[1, 1] = J_SLEEVE + M_BIRD * TO_SPRING**2
    mass[1, 2] = M_BIRD * TO_SPRING * TO_BIRD * turn
    mass[2, 2] = J_BIRD + M_BIRD * TO_BIRD**2
    mass[1, 0], mass[2, 0], mass[2, 1] = mass[0, 1], mass[0, 2], mass[1, 2]
    twist = SPRING * (a - b)
    force = np.array(
        [-both * G, -twist - M_BIRD * G * TO_SPRING * ca, twist - M_BIRD * G * TO_BIRD * cb]
    )
    if curved:
        # centripetal: M q'' = force + what velocities ask for
        wa, wb = u[1] ** 2, u[2] ** 2
        cross = M_BIRD * TO_SPRING * TO_BIRD * (sb * ca - cb * sa)
        force[0] += M_BIRD * (TO_SPRING * sa * wa + TO_BIRD * sb * wb)
        force[1] += cross * wb
        force[2] -= cross * wa
    gap, way = np.zeros(3), np.zeros((3, 2, 3))
    back = TO_BIRD - TO_BEAK + tip
    # of the centre of a ball at (x, y) of a body turned by an angle: x cos - y sin, x sin + y cos
    gap[0] = TO_SPRING * ca + back * cb - BEAK * sb - tip - POLE
    way[0, 0] = np.array([0.0, -TO_SPRING * sa, -back * sb - BEAK * cb])
    way[0, 1] = np.array([1.0, TO_SPRING * ca, back * cb - BEAK * sb - tip])
    for k in (1, 2):
        high = -HALF if k == 1 else HALF
        gap[k] = (BORE + tip) * ca - high * sa - tip - POLE
        way[k, 0] = np.array([0.0, -(BORE + tip) * sa - high * ca, 0.0])
        # the point of contact is a tip's radius towards the pole
        way[k, 1] = np.array([1.0, (BORE + tip) * ca - high * sa - tip, 0.0])
    if not curved:
        way[0, 0], way[0, 1] = (
            np.array([0.0, 0.0, -BEAK]),
            np.array([1.0, TO_SPRING, TO_BIRD - TO_BEAK]),
        )
        for k in (1, 2):
            way[k, 0] = np.array([0.0, HALF if k == 1 else -HALF, 0.0])
            way[k, 1] = np.array([1.0, BORE, 0.0])
    return mass, force, gap, way


@njit
def _advance(state, h, steps, tip, curved, restitution, mu):
    """Moreau's midpoint rule with Gauss-Seidel; `state` is changed."""
    r = np.zeros((3, 2))
    for _ in range(steps):
        state[:3] += 0.5 * h * state[3:]
        mass, force, gap, way = _model(state[:3], state[3:], tip, curved)
        inverse = np.linalg.inv(mass)
        before = state[3:].copy()
        u = before + h * inverse @ force
        answer = np.zeros((3, 2, 3))
        for k in range(3):
            for a in range(2):
                if gap[k] > 0.0:
                    r[k, a] = 0.0
                answer[k, a] = inverse @ way[k, a]
                u += answer[k, a] * r[k, a]
        for _ in range(500):
            change = 0.0
            for k in range(3):
                if gap[k] > 0.0:
                    continue
                n, t = way[k, 0], way[k, 1]
                old = r[k].copy()
                back = (n * u).sum() + restitution[k] * (n * before).sum()
                r[k, 0] = max(0.0, old[0] - back / (n * answer[k, 0]).sum())
                u += answer[k, 0] * (r[k, 0] - old[0])
                across = old[1] - (t * u).sum() / (t * answer[k, 1]).sum()
                r[k, 1] = min(max(across, -mu * r[k, 0]), mu * r[k, 0])
                u += answer[k, 1] * (r[k, 1] - old[1])
                change = max(change, abs(r[k, 0] - old[0]), abs(r[k, 1] - old[1]))
            if change < 1e-16:
                break
        state[3:] = u
        state[:3] += 0.5 * h * u


def solve(start, times, h, tip=0.0, curved=True):
    """Return states (rows, 6) at times that are multiples of h, by steps of h [s]."""
    state, rows, now = np.array(start, float), [], 0
    for t in times:
        step = round(t / h)
        _advance(state, h, step - now, tip, curved, np.array(RESTITUTION), MU)
        now = step
        rows.append(state.copy())
    return np.array(rows)

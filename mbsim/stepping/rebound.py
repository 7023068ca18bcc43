"""Rebound of many points at once, no more than bodies have the energy for.

Newton's law asks u_n' = -e u_n of each point alone. Where bodies touch many others, as in a heap,
impulses that give it to all of them press on points that were about to open, and do work there:

    sum of r . (u + u')/2 > 0

which no contact can do. An impact is then taken as Poisson's: with v_0, r_0 those that stop what
closes, the end of compression, and v_1, r_1 those with all rebound, a part s of what lies between
them is given back,

    v' = v_0 + s (v_1 - v_0),   r = r_0 + s (r_1 - r_0),

the largest one at which contacts do no work; that is a root of a square. Cones are convex, so r is
within them, and u_n' >= -s e u_n. Bodies that press on each other have one s.
Source: energy and restitution: C. Glocker, Set-Valued Force Laws, Springer 2001.
"""

from __future__ import annotations

import math

from mbsim.arrays.scene import Scene
from mbsim.core.jitable import jitable
from mbsim.dynamics.bodies.awake import bodies_awake, body_awake
from mbsim.stepping.arrays import Stepping
from mbsim.stepping.displacements import NO_IMPACT
from mbsim.stepping.one_point import velocity_of
from mbsim.stepping.scales import left_of
from mbsim.stepping.sleep import root_of
from mbsim.stepping.solver import MOST_LEFT, solve_points

#: Columns of `Motion.work`: that of contacts with r_0, what s and s^2 add to it, and impulses.
WITHOUT, LINEAR, SQUARE, SIZE = range(4)


@jitable
def join(S: Stepping, i: int, j: int) -> None:
    """Let two bodies be of one island."""
    parent, ground = S.rest.parent, len(S.rest.body)
    if i != ground and j != ground:
        first, other = root_of(parent, i), root_of(parent, j)
        parent[max(first, other)] = min(first, other)


@jitable
def join_islands(scene: Scene, S: Stepping, count: int) -> None:
    """Fill the islands of bodies that press on each other, by `r` or by `full`, or joints hold."""
    P, plan = S.points, S.plan
    for row in range(bodies_awake(scene)):
        b = body_awake(scene, row)
        S.rest.parent[b] = b
        for c in range(SIZE + 1):
            S.motion.work[b, c] = 0.0
    for g in range(len(plan.first) - 1):
        for m in range(plan.first[g] + 1, plan.first[g + 1]):
            join(S, plan.members[plan.first[g]], plan.members[m])
    for k in range(count):
        if P.r[k, 0] != 0.0 or P.full[k, 0] != 0.0:
            join(S, P.body[k, 0], P.body[k, 1])


@jitable
def island_of(S: Stepping, k: int) -> int:
    """Return the first body of the island of a point that presses."""
    i, j = S.points.body[k, 0], S.points.body[k, 1]
    return root_of(S.rest.parent, i if i != len(S.rest.body) else j)


@jitable
def add_work(S: Stepping, count: int) -> None:
    """Fill the work of contacts in each island as s goes from r_0, v_0 to those with all rebound.

    Velocities before are those right before an impact, and behind it those right behind.
    """
    P, M = S.points, S.motion
    for k in range(count):
        if P.r[k, 0] == 0.0 and P.full[k, 0] == 0.0:
            continue
        work = M.work[island_of(S, k)]
        work[SIZE] += max(P.r[k, 0], P.full[k, 0])
        for a in range(3):
            u = velocity_of(P, k, a, M.before)
            if P.part[k] != NO_IMPACT:
                u += (2.0 * P.part[k] - 1.0) * (velocity_of(P, k, a, M.flight) - u)
            r, first = P.r[k, a], velocity_of(P, k, a, M.v)
            more, change = P.full[k, a] - r, velocity_of(P, k, a, M.full) - first
            work[WITHOUT] += 0.5 * r * (u + first)
            work[LINEAR] += 0.5 * (more * (u + first) + r * change)
            work[SQUARE] += 0.5 * more * change


@jitable
def does_work(S: Stepping, b: int, h: float, sharp: float) -> bool:
    """Return whether contacts of an island do work with all rebound, beyond what solving leaves."""
    work = S.motion.work[b]
    whole = work[WITHOUT] + work[LINEAR] + work[SQUARE]
    allowed = sharp * left_of(S, S.plan.connected[b], h)
    return not whole <= MOST_LEFT * allowed * work[SIZE]


@jitable
def part_given(S: Stepping, b: int, h: float, sharp: float) -> float:
    """Return the part of all rebound that an island gets."""
    if not does_work(S, b, h, sharp):
        return 1.0
    work = S.motion.work[b]
    # gaps that close, and forces, may let contacts do a little work without rebound too
    c, linear, square = min(work[WITHOUT], 0.0), work[LINEAR], work[SQUARE]
    root = math.sqrt(max(linear * linear - 4.0 * square * c, 0.0))
    if linear > 0.0:
        return min(-2.0 * c / (linear + root), 1.0)
    return min((root - linear) / (2.0 * square), 1.0) if square > 0.0 else 0.0


@jitable
def keep_full(scene: Scene, S: Stepping, count: int) -> None:
    """Keep r and v with all rebound."""
    P, M, ground = S.points, S.motion, len(S.rest.body)
    for k in range(count):
        for a in range(3):
            P.full[k, a] = P.r[k, a]
    for c in range(6):
        M.full[ground, c] = M.v[ground, c]
    for row in range(bodies_awake(scene)):
        b = body_awake(scene, row)
        for c in range(6):
            M.full[b, c] = M.v[b, c]


@jitable
def stop_all(S: Stepping, count: int, h: float, sharp: float) -> bool:
    """Take their rebound from points of islands whose contacts do work; return whether from any.

    `push` keeps what it was.
    """
    P, some = S.points, False
    for k in range(count):
        P.push[k] = 0.0
        if P.part[k] == NO_IMPACT or P.ahead[k] >= 0.0 or P.full[k, 0] == 0.0:
            continue
        if does_work(S, island_of(S, k), h, sharp):
            P.push[k], P.ahead[k], some = P.ahead[k], max(P.gap[k], 0.0) / h, True
    return some


@jitable
def mix(scene: Scene, S: Stepping, count: int, h: float, sharp: float) -> None:
    """Let r and v be those with the part of all rebound that each island gets."""
    P, M = S.points, S.motion
    for k in range(count):
        if P.r[k, 0] == 0.0 and P.full[k, 0] == 0.0:
            continue
        part = part_given(S, island_of(S, k), h, sharp)
        for a in range(3):
            P.r[k, a] = part * P.full[k, a] + (1.0 - part) * P.r[k, a]
        if P.push[k] != 0.0 and part > 0.0:
            P.ahead[k] = part * P.push[k]
        elif P.push[k] != 0.0:
            P.part[k] = NO_IMPACT
    for row in range(bodies_awake(scene)):
        b = body_awake(scene, row)
        part = part_given(S, root_of(S.rest.parent, b), h, sharp)
        for c in range(6):
            M.v[b, c] = part * M.full[b, c] + (1.0 - part) * M.v[b, c]


@jitable
def limit_rebound(
    scene: Scene, S: Stepping, count: int, h: float, may: tuple[float, float]
) -> tuple[float, int, int]:
    """Let impacts give back no more than contacts may; return what is left, sweeps, Newtons.

    Where they give back all, nothing is solved: 0 is left then. `may` as in `solver.sweep_on`.
    """
    P, M, impacts = S.points, S.motion, False
    for k in range(count):
        impacts = impacts or (P.part[k] != NO_IMPACT and P.ahead[k] < 0.0 and P.r[k, 0] > 0.0)
    if not impacts:
        return 0.0, 0, 0
    keep_full(scene, S, count)
    join_islands(scene, S, count)
    add_work(S, count)
    if not stop_all(S, count, h, may[0]):
        return 0.0, 0, 0
    left, sweeps, newtons, _ = solve_points(P, M, len(S.rest.body), count, may)
    join_islands(scene, S, count)
    add_work(S, count)
    mix(scene, S, count, h, may[0])
    return left, sweeps, newtons

"""The energy that a step leaves open, as it follows from the way it moves bodies on.

Impulses do their work at the mean of velocities, and so do forces in

    K' - K = (v + v')/2 . (h F + H' r)

to rounding. The potential of forces goes by where bodies are put, which is not h (v + v')/2 across
an impact that a step takes at its end, nor where positions are projected; and kinetic energy is
that of the inertia as bodies are turned. What is left open by both is known, and no more than that
may be: whatever else opens the balance is a fault, or a step too long for its forces.
"""

from __future__ import annotations

from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1, V3
from mbsim.core.jitable import jitable
from mbsim.core.layout import AT_W, BODY_SIZE
from mbsim.core.rotation import add, dot, rotate, scale, sub, unrotate, vector
from mbsim.dynamics.bodies.awake import bodies_awake, body_awake
from mbsim.stepping.arrays import ASLEEP, LEFT_OPEN, Stepping


@jitable
def turned_energy(scene: Scene, b: int, w: V3, u: V3) -> float:
    """Return w . I u of body b as it is turned now, global axes."""
    R = scene.work.R[b]
    return dot(unrotate(R, w), rotate(scene.bodies.inertia[b], unrotate(R, u)))


@jitable
def left_by_forces(scene: Scene, S: Stepping, h: float) -> float:
    """Return the work of forces that displacements leave out, and begin with that of spins.

    Bodies are turned as at the step's begin. What spins are to have is kept in `Motion.spins`.
    """
    M, total = S.motion, 0.0
    for k in range(bodies_awake(scene)):
        b = body_awake(scene, k)
        if S.rest.body[b, ASLEEP] == 1:
            continue
        before, v, shift = M.before[b], M.v[b], M.shift[b]
        off = sub(vector(shift), scale(0.5, add(vector(before), vector(v))))
        total += abs(h * dot(vector(scene.work.force[b]), off))
        w, u = vector(before, 3), vector(v, 3)
        free = sub(vector(M.free[b], 3), w)
        mean = scale(0.5, add(w, u))
        done = turned_energy(scene, b, mean, free)
        done -= h * dot(mean, vector(scene.work.torque[b]))
        M.spins[b] = 0.5 * turned_energy(scene, b, u, u) - done
    return total


@jitable
def left_by_spins(scene: Scene, S: Stepping, new: F1) -> float:
    """Return by how much kinetic energies of free bodies' spins are not what impulses make them."""
    total = 0.0
    for k in range(bodies_awake(scene)):
        b = body_awake(scene, k)
        if scene.tree.of_body[b] < 0 and S.rest.body[b, ASLEEP] == 0:
            w = vector(new, BODY_SIZE * b + AT_W)
            kinetic = 0.5 * dot(w, rotate(scene.bodies.inertia[b], w))
            total += abs(kinetic - S.motion.spins[b])
    return total


@jitable
def keep_left(S: Stepping, left: float, committed: bool) -> None:
    """Keep what a step leaves open; its second half adds to what the first one did."""
    number = S.tally.number
    number[LEFT_OPEN] = left if committed else number[LEFT_OPEN] + left

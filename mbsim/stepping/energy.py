"""The energy that a step leaves open, as it follows from the way it moves bodies on.

Impulses do their work at the mean of velocities, and so do forces in

    K' - K = (v + v')/2 . (h F + H' r)

to rounding. The potential of forces goes by where bodies are put, which is not h (v + v')/2 across
an impact that a step takes at its end, nor where positions are projected; and kinetic energy is
that of the inertia as bodies are turned. What is left open by both is known, and no more than that
may be: whatever else opens the balance is a fault, or a step too long for its forces.

Of bodies that nothing but impacts, and what carries them, presses on contacts take that too: their
displacements are those of flight. With c and d as in `displacements`, a = v_free - v, u = H v,

    r . (u + u')/2 + (c - 1/2) (r . H d - (v' - v) . M (d - a))

is what impulses do to a body that flies before an impact and behind it. One that rests behind it is
not moved on by d there: 1/2 (1 - c)^2 a . M d less.
"""

from __future__ import annotations

from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1, V3
from mbsim.core.jitable import jitable
from mbsim.core.layout import AT_W, BODY_SIZE
from mbsim.core.rotation import add, dot, rotate, scale, sub, unrotate, vector
from mbsim.dynamics.bodies.awake import bodies_awake, body_awake
from mbsim.stepping.arrays import ASLEEP, LEFT_OPEN, POINTS, Stepping
from mbsim.stepping.displacements import LANDS, is_hit, shift_of
from mbsim.stepping.one_point import direction, velocity_of


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
        hit, work = is_hit(S, b), 0.0
        for c in range(3):
            off = shift[c] - 0.5 * (before[c] + v[c])
            weight = scene.bodies.mass[b] * scene.world.gravity[c]
            work += (scene.work.force[b, c] - weight) * off
            # of what is hit, weight along the flight is in what contacts take
            work += weight * (shift[c] - shift_of(S, b, c) if hit else off)
        total += abs(h * work)
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


@jitable
def note_grounded(scene: Scene, S: Stepping, i: int, j: int) -> None:
    """Note that ground presses on the group of a body, where one of two bodies is ground."""
    nb, group = len(scene.bodies.mass), scene.scales.group
    if i == nb and j < nb:
        S.tally.grounded[group[j]] = 1
    elif j == nb and i < nb:
        S.tally.grounded[group[i]] = 1


@jitable
def change(v: F1, before: F1) -> tuple[V3, V3]:
    """Return by how much a velocity and a spin differ from others."""
    return sub(vector(v), vector(before)), sub(vector(v, 3), vector(before, 3))


@jitable
def product(scene: Scene, b: int, v: tuple[V3, V3], w: tuple[V3, V3]) -> float:
    """Return v . M w of body b as it is turned now, global axes."""
    return scene.bodies.mass[b] * dot(v[0], w[0]) + turned_energy(scene, b, v[1], w[1])


@jitable
def left_of_flight(scene: Scene, S: Stepping, b: int) -> float:
    """Return what contacts take of a body that is hit beside `add_losses`' work at its points.

    Bodies are turned as at the step's begin.
    """
    M, part = S.motion, S.motion.part[b]
    if not is_hit(S, b):
        return 0.0
    lost, before = 0.0, M.before[b]
    takes = change(M.flight[b], M.free[b])
    lost += (part - 0.5) * product(scene, b, takes, change(M.v[b], before))
    if M.flies[b] == LANDS:
        alone, flies = change(M.free[b], before), change(M.flight[b], before)
        lost += 0.5 * (1.0 - part) ** 2 * product(scene, b, alone, flies)
    return lost


@jitable
def left_of_flight_once(scene: Scene, S: Stepping, b: int) -> float:
    """Return `left_of_flight` of a body and of all that joints hold to it, 0 when asked again.

    `Motion.changed` is -1 of what was asked for; the next step begins with 0.
    """
    M, plan, total = S.motion, S.plan, 0.0
    if b == len(S.rest.body) or M.changed[b] == -1:
        return 0.0
    group = plan.group[b]
    if group < 0:
        M.changed[b] = -1
        return left_of_flight(scene, S, b)
    for row in range(plan.first[group], plan.first[group + 1]):
        member = plan.members[row]
        M.changed[member] = -1
        total += left_of_flight(scene, S, member)
    return total


@jitable
def flown(S: Stepping, k: int, side: int, a: int) -> float:
    """Return (c - 1/2) H d of component a at point k, as far as one of its bodies has it."""
    M, b, total = S.motion, S.points.body[k, side], 0.0
    if b == len(S.rest.body) or not is_hit(S, b):
        return 0.0
    for c in range(6):
        total += direction(S.points, k, side, a, c) * (M.flight[b, c] - M.before[b, c])
    return (M.part[b] - 0.5) * total


@jitable
def add_losses(scene: Scene, S: Stepping, new: F1) -> None:
    """Add what contacts took, before bodies are moved on."""
    P, M = S.points, S.motion
    first = len(new) - len(scene.contacts.id)
    for k in range(S.tally.count[POINTS]):
        if P.r[k, 0] == 0.0:
            continue
        i, j = P.body[k, 0], P.body[k, 1]
        c, lost, across = P.contact[k], 0.0, 0.0
        note_grounded(scene, S, i, j)
        for a in range(3):
            before = velocity_of(P, k, a, M.before)
            work = 0.5 * P.r[k, a] * (before + velocity_of(P, k, a, M.v))
            work += P.r[k, a] * (flown(S, k, 0, a) + flown(S, k, 1, a))
            lost -= work
            across += work if a > 0 else 0.0
        lost += left_of_flight_once(scene, S, i) + left_of_flight_once(scene, S, j)
        new[first + c] += lost
        if scene.audit.friction_at[c] >= 0:
            new[scene.audit.friction_at[c]] += across

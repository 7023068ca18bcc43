"""What follows from y and the state, but for the fields that say otherwise; and output rows."""

from __future__ import annotations

from typing import NamedTuple

from mbsim.core import tags
from mbsim.core.arrays import F1, F2, F3, I1


@tags.scratch
class Work(NamedTuple):
    """All that follows from (y, committed state). Filling it with NaN first changes nothing."""

    R: F3  # (nb + 1, 3, 3) cg axes to global
    v: F2  # (nb + 1, 3)
    w: F2  # (nb + 1, 3) angular velocity, global frame
    force: F2  # (nb + 1, 3)
    torque: F2  # (nb + 1, 3) about the cg
    noise: F2  # (nb + 1, 2) force and torque that the detector's noise may be wrong by
    frames: F2  # (ng, 12)
    travel: F1  # (ng,) how far any point may have moved since the committed state
    speed: F2  # (ng, 2) of its fastest point, and acceleration of its centre
    approach: F1  # (MOTION,) of a pair that touches, see geometry.motion
    points: F2  # (ns, POINT) candidates of geometry.catalog
    touching: I1  # (ns,)
    beyond: I1  # (nc,) 1 + the first pair whose overlap is deeper than its form knows; 0: none
    hit: I1  # (ns + 1,) slots that touch, their number last
    t: F2  # (ns, 3) x-axis of the incident marker at the trial point
    slot: F2  # (ns, SLOT_COLUMNS) see contact.forces
    memory: F2  # (ns, most) of friction laws at the trial point
    kept: F2  # (ns, 3 + most) while a step is followed in two halves: friction along x and y of the
    # whole step and what an error of it counts as, what is committed
    friction_slope: tags.State[F2]  # (ns, 4) friction over N by slip, as linearised last
    fcl: I1  # (np,) pairs that FCL shall do
    net: F2  # (nc, 3) force of each contact
    block: F2  # (nb, 20) stiffness that acts on a body (3 x 3) and its turning part, damping
    bound: F1  # (3,) squared frequency, rates of damping and of friction, the largest so far
    best: F1  # (4,) pair that gave it: contact, energy at touch, force behind it, inverse mass
    idle: F1  # (ny,) y' at points that are only looked at; (0,) where none is
    ahead: F2  # (2, ny) y and y' a little later; (0, 0) where no rates of forces are looked for
    law_in: F1  # (FRICTION_INPUTS + most,)
    law_out: F1  # (MEMORY_OUT + 2 most,)
    applied: F2  # (nf, 8) force, torque on I at the I marker, stored energy, dissipated power
    motion: F1  # (12,) of a marker force: see forces.abi, as the next two
    wrench: F1  # (8,)
    slopes: F2  # (12, 6)
    joint_friction: F2  # (nf, 9) of friction: see forces.joint_friction
    by_reactions: F2  # (nu, 5) of what is settled with the reactions, see forces.reaction_forces
    secant: F2  # (nu, nu) how that follows from what it misses
    reaction: F1  # (6 nj,) force, torque on I's body at the I marker of each connection
    squares: tags.State[F1]  # (n,) V^2 of each group of bodies where an error was judged last
    diagnostics: I1  # (2,) worst body of the error norm, contact or row of `Applied` at fault
    sticking_point: F2  # (ns, 15) of slots that stick: point, n, x-axis, rates of point and n
    sticking_force: F2  # (ns, 2) forces that hold these, along x and y
    look: F3  # (3, points, POINT) candidates of a pair now, a moment later and before; no rows
    # for the three where none is rigid


@tags.scratch
class Sweep(NamedTuple):
    """Scratch of the articulated-body recursion.

    Spatial vectors are (angular, linear) about O, the cg of the root of each tree at the trial
    point.
    """

    H: F3  # (nt, 6, 6) articulated inertia, its lower triangle
    S: F3  # (nt, 6, 6) free directions by rows
    W: F3  # (nt, 6, 6) L^-1 S'H by rows, L D L' = S'H S
    L: F3  # (nt, 6, 6) with 1/D on its diagonal
    c: F2  # (nt, 6) acceleration of the child that follows from velocities
    p: F2  # (nt, 6) force that the body would need, articulated
    z: F2  # (nt, 6) forces, then accelerations, in the free directions
    a: F2  # (nt, 6) acceleration
    arm: F2  # (nt, 3) cg from O
    bias: F2  # (nt, 6) force that velocities call for
    answer: F2  # (nt, 6) accelerations by a unit multiplier
    mark: I1  # (nt,) by root: equation for which `answer` was made
    chosen: I1  # (ne + 1,) `Equations.active` before others are chosen
    G: F2  # (terms, 12) of each term: wrench on I's body and on J's, each about its O
    rate: F2  # (ne, 4) residual, its rate, its second rate by velocities alone, rate of its sum
    aim: F2  # (ne, 2) rate at a step's begin and acceleration asked for within it, of `nearest`
    aimed: F1  # (3,) see codes
    A: F2  # (ne, ne) how equations act on each other, then its factor
    multiplier: F1  # (ne,)
    rhs: F1  # (ne,)
    skyline: tags.State[I1]  # (ne,) first column of a row of A
    size: tags.State[F1]  # (ne,) square root of what A would have if the bodies were free
    released: tags.State[I1]  # (ne,) equations that do not hold while a loop passes a fold
    wanted: F1  # (ne,) multipliers of equations alone, near a fold
    kept_at: tags.State[F1]  # (8,) times of the last committed states away from any fold
    kept_a: tags.State[F3]  # (8, nt, 6) what multipliers did to accelerations then
    kept_power: tags.State[F1]  # (8,) power of motions then
    quality: tags.State[F1]  # (18,) least pivot over its size squared, see codes
    stress: F2  # (ne, 6 nj) self-stresses of implied equations
    jet: F1  # (12,) what a program gives
    pair: F1  # (3,) value, rate and second rate of a term of a higher pair, or of a relation
    related: F2  # (terms, 3) the same of the terms that an equation of a user's relation has
    located: F1  # (curves + 2 surfaces,) parameters of where higher pairs touch
    share: F2  # (nh, nh) slips of what sticks, by rows: S of stiction.cones, and its matrix
    mix: F2  # (nh, nh)
    cone: F2  # (CONE_ROWS, nh) its vectors
    kept_p: F2  # (nt or 0, 6) p while others are tried


@tags.scratch
class Rows(NamedTuple):
    """Output rows not yet taken by Python."""

    time: F1  # (rows,)
    y: F2  # (rows, n)
    accel: F2  # (rows, 6 nb)
    contact: F2  # (rows, CONTACT_COLUMNS nc)
    energy: F2  # (rows, 4) kinetic, potential, dissipated, work of motions
    joint: F2  # (rows, 6 nj) force, torque on I's body at the I marker, global, of `Connections`
    applied: F2  # (rows, 6 nf) the same of `Applied`
    value: F2  # (rows, values) expressions of requests
    incident_count: I1  # (rows,)
    incidents: F2  # (capacity, INC_MEMORY + most) slot, p, n, t, X, depth, ...: see codes
    points: F2  # (capacity, POINT_COLUMNS) beside `incidents`; no rows where nobody asked for them
    events: F2  # (capacity, 4) time, kind, contact, slot
    used: tags.State[I1]  # (3,) rows, incidents, events

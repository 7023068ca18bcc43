"""Every array of the compiled pipeline, grouped by use: shape and meaning on its line.

Counts: nb moving bodies (row nb of a body array is ground), ng graphics, np pairs, nc
contacts, ns slots. A *slot* is a place for one incident: a pair owns a fixed range of
slots. Everything is in model units, global frame unless said otherwise.

The ODE vector y holds, body after body, BODY_SIZE numbers: position of the cg (3), unit
quaternion w first (4), velocity of the cg (3), angular velocity in cg axes (3); then X (3) of every
slot whose law uses it; last the energy that each contact has dissipated so far (one number
where there is no contact, so that y is never empty).
"""

from __future__ import annotations

from typing import NamedTuple

from mbsim.core.arrays import F1, F2, F3, I1, I2

BODY_SIZE = 13

# columns of `Log.contacts`, one row a contact
(
    PEAK_FORCE,  # largest net |force| over all steps
    PEAK_DEPTH,
    PEAK_SLIP,
    FIRST_TOUCH,  # time; NaN before
    APPROACH,  # closing speed of the last touch
    REBOUND,  # separation speed over closing speed, of the first impact that left again
    TOUCHES,
    PEAK_FORCE_TIME,
    ENERGY_LOST,  # dissipated by the damper and by friction
) = range(9)
LOG_COLUMNS = 9

# entries of `Log.counters`
NARROWPHASE, SKIPPED, FCL_CALLS, FRICTION_CALLS, PYTHON_CALLS, NORMAL_CALLS = range(6)
COUNTERS = 6

# why a step was rejected: columns of `Log.rejections`, one row a contact, the last row for none
REJECT_ERROR, REJECT_DEPTH, REJECT_NOT_FINITE = range(3)

# kinds of `Rows.events`
TOUCH, LEAVE = range(2)


class Bodies(NamedTuple):
    """Moving bodies."""

    mass: F1  # (nb,) scaled so that F = m a
    inertia: F3  # (nb, 3, 3) about the cg, in cg axes
    inverse: F3  # (nb, 3, 3) its inverse


class Graphics(NamedTuple):
    """Shapes that take part in contacts."""

    body: I1  # (ng,)
    p: F2  # (ng, 3) centre, in the body's cg axes
    R: F3  # (ng, 3, 3) shape axes to cg axes
    size: F2  # (ng, 3) see geometry.catalog
    reach: F1  # (ng,) radius of the ball around the centre that holds the shape; inf for a plane
    half: F2  # (ng, 3) half edges of the box in shape axes that holds the shape; inf for a plane
    turns: I1  # (ng,) 0 for a sphere, whose surface a rotation about its centre does not move
    marker_p: F2  # (ng, 3) reference marker, in cg axes
    marker_R: F3  # (ng, 3, 3)


class Pairs(NamedTuple):
    """Graphics that may touch, in the order that their kernel wants."""

    contact: I1  # (np,)
    graphic_i: I1  # (np,) the kernel's I
    graphic_j: I1  # (np,)
    swapped: I1  # (np,) 1 where the kernel's I is the contact's J
    slot: I1  # (np + 1,) first slot
    kernel: I1  # (np,) address, 0 where FCL does it
    watched: I1  # (np,) 0 where no distance can be known (a plane that moves)
    regroups: I1  # (np,) 1 where points may appear deep in a contact that goes on
    thickness: F1  # (np,) what a step may not jump over
    noise: F1  # (np,) scatter of the normals that its detector gives


class Contacts(NamedTuple):
    """Force_Contact elements."""

    id: I1  # (nc,)
    normal_law: I1  # (nc,) address
    normal_par: F2  # (nc, widest)
    friction_law: I1  # (nc,) address, 0 for none
    friction_par: F2  # (nc, widest)
    interpreted: I1  # (nc,) 1 where the friction law enters Python
    framed: I1  # (nc,) 1 where the law needs the incident marker's own axes
    ignore_deeper: F1  # (nc,) inf if not given
    dmax: F1  # (nc,) 0 if not given
    first_pair: I1  # (nc + 1,)


class Slots(NamedTuple):
    """Places for incidents."""

    pair: I1  # (ns,)
    contact: I1  # (ns,)
    x: I1  # (ns,) where X starts in y, -1 where it is not carried


class World(NamedTuple):
    """What belongs to no element."""

    gravity: F1  # (3,)
    scale: F1  # (2,) length L and speed V of the error norm
    doors: I1  # (1,) address of the FCL detector


class State(NamedTuple):
    """The physical state beside y: the incident table, and what the motion bound refers to."""

    q: F2  # (nb + 1, 4) quaternions at the committed state
    touching: I1  # (ns,)
    p: F2  # (ns, 3) contact point
    n: F2  # (ns, 3) normal from J into I
    t: F2  # (ns, 3) x-axis of the incident marker
    depth: F1  # (ns,)
    rate: F1  # (ns,) of depth
    normal: F1  # (ns,) normal force
    gap: F1  # (np,) distance that the pair kept when last measured
    left: F1  # (np,) what the motion since has left of it for certain
    centre: F2  # (np, 6) centres of both graphics then
    turn: F2  # (np, 8) quaternions of both bodies then


class Log(NamedTuple):
    """What is counted and watched over all steps; saved with the state."""

    contacts: F2  # (nc, LOG_COLUMNS)
    counters: I1  # (COUNTERS,)
    rejections: I2  # (nc + 1, 3)


class Work(NamedTuple):
    """All that follows from (y, committed state). Filling it with NaN first changes nothing."""

    R: F3  # (nb + 1, 3, 3) cg axes to global
    v: F2  # (nb + 1, 3)
    w: F2  # (nb + 1, 3) angular velocity, global frame
    force: F2  # (nb + 1, 3)
    torque: F2  # (nb + 1, 3) about the cg
    accel: F2  # (nb, 6) of the cg, and angular, global frame
    noise: F2  # (nb + 1, 2) force and torque that the detector's noise may be wrong by
    frames: F2  # (ng, 12)
    points: F2  # (ns, POINT) candidates of geometry.catalog
    touching: I1  # (ns,)
    t: F2  # (ns, 3) x-axis of the incident marker at the trial point
    slot: F2  # (ns, SLOT_COLUMNS) see dynamics.contact
    fcl: I1  # (np,) pairs that FCL shall do
    law_in: F1  # (FRICTION_INPUTS,)
    law_out: F1  # (5,)
    trouble: I1  # (2,) worst body of the error norm, contact at fault


class Rows(NamedTuple):
    """Output rows not yet taken by Python."""

    time: F1  # (rows,)
    y: F2  # (rows, n)
    accel: F2  # (rows, 6 nb)
    contact: F2  # (rows, CONTACT_COLUMNS nc)
    energy: F2  # (rows, 3) kinetic, potential, dissipated
    incident_count: I1  # (rows,)
    incidents: F2  # (rows ns, 14) slot, p, n, t, X, depth
    events: F2  # (capacity, 4) time, kind, contact, slot
    used: I1  # (3,) rows, incidents, events


SLOT_COLUMNS = 12
CONTACT_COLUMNS = 10  # force 3, torque 3, depth, slip, incidents, area


class Scene(NamedTuple):
    """Everything a compiled hook gets through its one address."""

    bodies: Bodies
    graphics: Graphics
    pairs: Pairs
    contacts: Contacts
    slots: Slots
    world: World
    state: State
    log: Log
    work: Work
    rows: Rows

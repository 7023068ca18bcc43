"""What contacts give to rows of results, log and events: a step's impulses over its length.

All of it is read from `Kept`: the points where the impulses acted.
"""

from __future__ import annotations

import math

from mbsim.arrays.codes import (
    APPROACH,
    CONTACT_COLUMNS,
    DISSIPATED,
    EVENT_ELEMENT,
    EVENT_KIND,
    EVENT_SLOT,
    EVENT_TIME,
    FIRST_TOUCH,
    INC_POINT,
    LEAVE,
    PEAK_DEPTH,
    PEAK_FORCE,
    PEAK_FORCE_TIME,
    PEAK_SLIP,
    POINT_AREA,
    POINT_CONTACT,
    POINT_FORCE,
    POINT_SLIP,
    TOUCH,
    TOUCHES,
    USED_EVENTS,
    USED_INCIDENTS,
)
from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1
from mbsim.core.jitable import jitable
from mbsim.core.rotation import cross, norm, scale, sub, vector
from mbsim.dynamics.bodies.kinematics import position
from mbsim.dynamics.contact.forces import add_wrench
from mbsim.stepping.arrays import (
    KEPT_BODY_I,
    KEPT_BODY_J,
    KEPT_CONTACT,
    KEPT_FORCE,
    KEPT_GAP,
    KEPT_POINT,
    KEPT_SLIP,
    KEPT_SLOT,
    KEPT_STAYS,
    POINTS,
    SLEEPING_ROWS,
    STEP_LENGTH,
    Stepping,
)
from mbsim.stepping.kept import index_kept, keep_points


@jitable
def push_as_kept(scene: Scene, S: Stepping, y: F1) -> None:
    """Add the forces of the last step to the bodies."""
    for row in range(S.kept.count[0]):
        values = S.kept.table[row]
        p, force = vector(values[KEPT_POINT:]), vector(values[KEPT_FORCE:])
        none = (0.0, 0.0, 0.0)
        add_wrench(scene, y, int(values[KEPT_BODY_I]), p, force, none)
        add_wrench(scene, y, int(values[KEPT_BODY_J]), p, scale(-1.0, force), none)


@jitable
def record(scene: Scene, t: float, kind: int, c: int, s: int) -> None:
    """Append an event."""
    rows = scene.rows
    k = rows.used[USED_EVENTS]
    if k < len(rows.events):
        rows.events[k, EVENT_TIME], rows.events[k, EVENT_KIND] = t, kind
        rows.events[k, EVENT_ELEMENT], rows.events[k, EVENT_SLOT] = scene.contacts.id[c], s
        rows.used[USED_EVENTS] = k + 1


@jitable
def keep_step(scene: Scene, S: Stepping, t: float, h: float) -> None:
    """Keep the points of the step that is taken; note which began to press and which ceased to.

    A point that presses in this step and not in the last one touches within it, at the time that
    its gap and closing speed give.
    """
    P, kept, first = S.points, S.kept, t - S.tally.number[STEP_LENGTH]
    for k in range(S.tally.count[POINTS]):
        was = P.was[k]
        if P.r[k, 0] == 0.0:
            if was >= 0:
                kept.table[was, KEPT_STAYS] = 0.0
            continue
        if was >= 0:
            continue
        c = P.contact[k]
        log = scene.log.contacts[c]
        speed = max(-P.closing[k], 0.0)
        when = first + min(max(P.gap[k], 0.0) / speed, t - first) if speed > 0.0 else first
        if math.isnan(log[FIRST_TOUCH]):
            log[FIRST_TOUCH] = when
        log[TOUCHES] += 1.0
        log[APPROACH] = speed
        record(scene, when, TOUCH, c, P.slot[k])
    for row in range(kept.count[SLEEPING_ROWS], kept.count[0]):
        values = kept.table[row]
        if values[KEPT_STAYS] == 0.0:
            record(scene, first, LEAVE, int(values[KEPT_CONTACT]), int(values[KEPT_SLOT]))
    keep_points(scene, S)
    index_kept(S)


@jitable
def watch_peaks(scene: Scene, S: Stepping, t: float) -> None:
    """Keep the largest force, depth and slip of every contact."""
    net, log = scene.work.net, scene.log.contacts
    for c in range(len(net)):
        for j in range(3):
            net[c, j] = S.rest.net[c, j]
        log[c, PEAK_DEPTH] = max(log[c, PEAK_DEPTH], S.tally.deepest[c])
    # what sleeps does not slip
    for row in range(S.kept.count[SLEEPING_ROWS], S.kept.count[0]):
        values = S.kept.table[row]
        c = int(values[KEPT_CONTACT])
        for j in range(3):
            net[c, j] += values[KEPT_FORCE + j]
        log[c, PEAK_SLIP] = max(log[c, PEAK_SLIP], values[KEPT_SLIP])
    for c in range(len(net)):
        size = norm(vector(net[c]))
        if size > log[c, PEAK_FORCE]:
            log[c, PEAK_FORCE], log[c, PEAK_FORCE_TIME] = size, t


@jitable
def add_lost(scene: Scene, y: F1, row: F1) -> None:
    """Add what contacts took to a row of energies."""
    for c in range(len(scene.contacts.id)):
        row[DISSIPATED] += y[len(y) - len(scene.contacts.id) + c]


@jitable
def fill_contacts(scene: Scene, S: Stepping, y: F1, row: F1) -> None:
    """Write net force, net torque about I's cg, deepest depth, fastest slip and points."""
    for k in range(len(row)):
        row[k] = 0.0
    for k in range(S.kept.count[0]):
        values = S.kept.table[k]
        at = CONTACT_COLUMNS * int(values[KEPT_CONTACT])
        force = vector(values[KEPT_FORCE:])
        arm = sub(vector(values[KEPT_POINT:]), position(scene, y, int(values[KEPT_BODY_I])))
        moment = cross(arm, force)
        for c in range(3):
            row[at + c] += force[c]
            row[at + 3 + c] += moment[c]
        row[at + 6] = max(row[at + 6], -values[KEPT_GAP])
        row[at + 7] = max(row[at + 7], values[KEPT_SLIP])
        row[at + 8] += 1.0


@jitable
def fill_incidents(scene: Scene, S: Stepping) -> int:
    """Append where the contact points of this row are; return how many.

    The other columns are what a contact law is asked with anew, and there is none: they are 0.
    """
    rows = scene.rows
    k = rows.used[USED_INCIDENTS]
    for number in range(S.kept.count[0]):
        values, row = S.kept.table[number], rows.incidents[k]
        for j in range(len(row)):
            row[j] = 0.0
        for j in range(3):
            row[INC_POINT + j] = values[KEPT_POINT + j]
        if len(rows.points) > 0:
            point = rows.points[k]
            for j in range(3):
                point[POINT_FORCE + j] = values[KEPT_FORCE + j]
            point[POINT_SLIP], point[POINT_AREA] = values[KEPT_SLIP], 0.0
            point[POINT_CONTACT] = values[KEPT_CONTACT]
        k += 1
    count = k - rows.used[USED_INCIDENTS]
    rows.used[USED_INCIDENTS] = k
    return count


@jitable
def hardest(scene: Scene, S: Stepping) -> int:
    """Return the contact whose points press hardest in sum, their number for none."""
    net, best, largest = scene.work.net, len(scene.contacts.id), 0.0
    for c in range(len(net)):
        size = norm(vector(net[c]))
        if size > largest:
            best, largest = c, size
    return best

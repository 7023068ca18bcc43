"""What is kept of a step's contact points: impulses for the next step, rows of results.

A contact point is the same from step to step where its pair of graphics and its row are, or else
where it is. A table of keys finds the points of a pair, so that slots may move meanwhile.
"""

from __future__ import annotations

import math

from mbsim.arrays.scene import Scene
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, cross, dot, scale, sub, vector
from mbsim.dynamics.contact.forces import sides
from mbsim.stepping.arrays import (
    BESIDE_STUCK,
    KEPT_ARMS,
    KEPT_BODY_I,
    KEPT_BODY_J,
    KEPT_CLOSING,
    KEPT_CONTACT,
    KEPT_FORCE,
    KEPT_GAP,
    KEPT_HIT_I,
    KEPT_NORMAL,
    KEPT_POINT,
    KEPT_ROW,
    KEPT_SLIP,
    KEPT_SLOT,
    KEPT_STAYS,
    KEPT_STICKS,
    KEPT_TANGENT,
    NOT_KEPT,
    POINTS,
    SLEEPING_ROWS,
    STEP_LENGTH,
    Stepping,
)
from mbsim.stepping.displacements import NO_IMPACT
from mbsim.stepping.one_point import slip_at

#: A multiplier that spreads keys over a table: 2^64 over the golden ratio, odd, made positive.
SPREAD = 0x1E3779B97F4A7C15


@jitable
def place_of(key: int, room: int) -> int:
    """Return where a key is looked for first in a table of 2^k places."""
    return ((key * SPREAD) >> 20) & (room - 1)


@jitable
def room_of(S: Stepping) -> int:
    """Return how many places of the table of keys are in use: it is cleared at every step."""
    room = 16
    while room < 4 * (S.kept.count[0] - S.kept.count[SLEEPING_ROWS]):
        room *= 2
    return room


@jitable
def index_kept(S: Stepping) -> None:
    """Fill the table by which the kept points of a pair are found."""
    kept, room = S.kept, room_of(S)
    for at in range(room):
        kept.table_of_keys[at] = 0
    for row in range(kept.count[SLEEPING_ROWS], kept.count[0]):
        if row > kept.count[SLEEPING_ROWS] and kept.key[row] == kept.key[row - 1]:
            continue
        at = place_of(kept.key[row], room)
        while kept.table_of_keys[at] != 0:
            at = (at + 1) & (room - 1)
        kept.table_of_keys[at] = 1 + row


@jitable
def first_kept(S: Stepping, key: int) -> int:
    """Return the first row of a pair's kept points, their number for none."""
    kept, room = S.kept, room_of(S)
    at = place_of(key, room)
    while kept.table_of_keys[at] != 0:
        row = kept.table_of_keys[at] - 1
        if kept.key[row] == key:
            return row
        at = (at + 1) & (room - 1)
    return kept.count[0]


@jitable
def nearest_kept(S: Stepping, k: int, first: int, last: int) -> int:
    """Return the kept point nearest to point k that is no other's, -1 where all are."""
    best, least, p = -1, math.inf, vector(S.points.point[k])
    for row in range(first, last):
        values = S.kept.table[row]
        d = sub(p, vector(values[KEPT_POINT:]))
        if values[KEPT_STAYS] == 0.0 and dot(d, d) < least:
            best, least = row, dot(d, d)
    return best


@jitable
def match_pair(S: Stepping, begin: int, end: int) -> None:
    """Find the kept points that the points of one pair, `begin` to `end`, are.

    Those of the same row; then the nearest ones: where edges lie on each other rounding decides
    which row a point has.
    """
    P, kept = S.points, S.kept
    first = first_kept(S, P.key[begin])
    last = first
    while last < kept.count[0] and kept.key[last] == P.key[begin]:
        kept.table[last, KEPT_STAYS] = 0.0
        last += 1
    sticks = first < last and kept.table[first, KEPT_STICKS] == 1.0
    none = BESIDE_STUCK if sticks else NOT_KEPT
    for k in range(begin, end):
        P.was[k] = none
        for row in range(first, last):
            if kept.table[row, KEPT_ROW] == P.row[k]:
                P.was[k] = row
                kept.table[row, KEPT_STAYS] = 1.0
    for k in range(begin, end):
        if P.was[k] < 0 and first < last:
            row = nearest_kept(S, k, first, last)
            if row >= 0:
                P.was[k] = row
                kept.table[row, KEPT_STAYS] = 1.0


@jitable
def recall(S: Stepping, h: float) -> None:
    """Start all impulses of a step h from what the points pressed in the last one."""
    P, kept, count = S.points, S.kept, S.tally.count[POINTS]
    begin = 0
    for row in range(kept.count[SLEEPING_ROWS], kept.count[0]):
        kept.table[row, KEPT_STAYS] = 0.0
    while begin < count:
        end = begin + 1
        while end < count and P.key[end] == P.key[begin]:
            end += 1
        match_pair(S, begin, end)
        begin = end
    for k in range(count):
        row = P.was[k]
        P.r[k, 0] = P.r[k, 1] = P.r[k, 2] = P.slides[k] = 0.0
        if row < 0:
            continue
        f = vector(kept.table[row, KEPT_FORCE:])
        n, x = vector(P.normal[k]), vector(P.tangent[k])
        z = cross(n, x)
        # a normal that has turned against the force is another contact
        pressed = h * dot(f, n)
        if pressed > 0.0:
            P.r[k, 0], P.r[k, 1], P.r[k, 2] = pressed, h * dot(f, x), h * dot(f, z)


@jitable
def share_sticking(S: Stepping) -> None:
    """Let all points of a pair stick where their friction in sum is less than it may be.

    How they share it is not determined.
    """
    kept, begin = S.kept, S.kept.count[SLEEPING_ROWS]
    while begin < kept.count[0]:
        end, most, total = begin, 0.0, (0.0, 0.0, 0.0)
        while end < kept.count[0] and kept.key[end] == kept.key[begin]:
            force, n = vector(kept.table[end, KEPT_FORCE:]), vector(kept.table[end, KEPT_NORMAL:])
            normal = dot(force, n)
            total = add(total, sub(force, scale(normal, n)))
            most += kept.table[end, KEPT_STICKS] * normal
            end += 1
        held = dot(total, total) < (1.0 - 1e-9) * most * most
        for row in range(begin, end):
            kept.table[row, KEPT_STICKS] = 1.0 if held else 0.0
        begin = end


@jitable
def keep_points(scene: Scene, S: Stepping) -> None:
    """Keep the points that press in the step that is taken."""
    P, kept, M = S.points, S.kept, S.motion
    h = S.tally.number[STEP_LENGTH]
    row = kept.count[SLEEPING_ROWS]
    for k in range(S.tally.count[POINTS]):
        if P.r[k, 0] == 0.0:
            continue
        values = kept.table[row]
        kept.key[row], values[KEPT_ROW] = P.key[k], P.row[k]
        s = P.slot[k]
        values[KEPT_CONTACT], values[KEPT_SLOT] = P.contact[k], s
        gi, gj = sides(scene, s)
        values[KEPT_BODY_I], values[KEPT_BODY_J] = scene.graphics.body[gi], scene.graphics.body[gj]
        values[KEPT_GAP], values[KEPT_CLOSING] = P.gap[k], -P.closing[k]
        x, z = slip_at(P, k, M.v)
        values[KEPT_SLIP] = (x * x + z * z) ** 0.5
        # see `share_sticking`
        values[KEPT_STICKS] = P.mu[k]
        for side in range(2):
            hit = P.part[k] != NO_IMPACT and M.goes_on[P.body[k, side]] == 0
            values[KEPT_HIT_I + side] = 1.0 if hit else 0.0
        n, t = vector(P.normal[k]), vector(P.tangent[k])
        b = cross(n, t)
        force = add(scale(P.r[k, 0], n), add(scale(P.r[k, 1], t), scale(P.r[k, 2], b)))
        for c in range(3):
            values[KEPT_POINT + c], values[KEPT_NORMAL + c] = P.point[k, c], n[c]
            values[KEPT_TANGENT + c] = t[c]
            values[KEPT_FORCE + c] = force[c] / h
            values[KEPT_ARMS + c], values[KEPT_ARMS + 3 + c] = P.arm[k, 0, c], P.arm[k, 1, c]
        row += 1
    kept.count[0] = row
    share_sticking(S)

"""What an error does to contacts: how much of friction, pressure and impacts it changes."""

from __future__ import annotations

import math

from mbsim.arrays.codes import X_BY_X, X_BY_Y, Y_BY_X, Y_BY_Y
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int
from mbsim.core.arrays import F1, V3
from mbsim.core.jitable import jitable
from mbsim.core.layout import BODY_SIZE
from mbsim.core.rotation import add, cross, dot, rotate, sub, vector
from mbsim.dynamics.bodies.kinematics import position
from mbsim.dynamics.contact.forces import (
    DEPTH,
    FORCE,
    NORMAL,
    RATE,
    SLIP,
    STORED,
    contact_of,
    sides,
)
from mbsim.dynamics.contact.points import effective_mass
from mbsim.geometry.catalog import AT_NORMAL, AT_POINT
from mbsim.laws.abi import ELASTIC, LOAD

#: The least speed of an impact, over its group's V, that it is judged by, slower ones having little
#: of the energy; what counts least of its own speed.
FAST, SLIGHT = 0.2, 5e-4
#: What a change of a normal force counts, over that of friction.
PRESSED = 0.1


@jitable
def speed_change(scene: Scene, e: F1, y: F1, b: int, p: V3) -> V3:
    """Return by how much body b's point at p is faster with velocities that differ by e."""
    if b == len(scene.bodies.mass):
        return 0.0, 0.0, 0.0
    at = BODY_SIZE * b
    turn = rotate(scene.work.R[b], (e[at + 10], e[at + 11], e[at + 12]))
    return add((e[at + 7], e[at + 8], e[at + 9]), cross(turn, sub(p, position(scene, y, b))))


@jitable
def friction_left(scene: Scene, e: F1, y: F1, turns: bool) -> float:
    """Return the largest change of friction that e causes, over the normal force.

    By friction's slopes where it was linearised last, 0 where none was; and, if `turns`, by a slip
    that it turns round.
    """
    work, contacts, largest = scene.work, scene.contacts, 0.0
    for k in range(work.hit[len(work.hit) - 1]):
        s = work.hit[k]
        slope, point = work.friction_slope[s], work.points[s]
        if work.slot[s, NORMAL] <= 0.0 or (slope[X_BY_X] == 0.0 and slope[Y_BY_Y] == 0.0):
            continue
        gi, gj = sides(scene, s)
        p, n = vector(point[AT_POINT:]), vector(point[AT_NORMAL:])
        tx = vector(work.t[s])
        v = sub(
            speed_change(scene, e, y, scene.graphics.body[gi], p),
            speed_change(scene, e, y, scene.graphics.body[gj], p),
        )
        u, w = dot(v, tx), dot(v, cross(n, tx))
        change = max(
            abs(slope[X_BY_X] * u + slope[X_BY_Y] * w), abs(slope[Y_BY_X] * u + slope[Y_BY_Y] * w)
        )
        c = contact_of(scene, s)
        if turns and contacts.memory[c] == 0 and contacts.rigid[c] == 0:
            # what turns the slip round turns friction round, whose slope along it knows of no such
            row, force = work.slot[s], vector(work.slot[s, FORCE : FORCE + 3])
            fx, fy = dot(force, tx), dot(force, cross(n, tx))
            tangential = math.hypot(fx, fy)
            if fx * u + fy * w > tangential * row[SLIP]:
                change = max(change, 2.0 * tangential / row[NORMAL])
        if not change <= largest:
            largest = change
    return largest


@jitable
def pressure_left(scene: Scene, e: F1, y: F1) -> float:
    """Return how much the speed that e changes makes of a normal force, over that force, at most.

    Or over what its spring has, where a damper takes that away; PRESSED of it counts. What rests
    on strong dampers parts at speeds far below a loose tolerance: left to chance by Newton's
    iteration they keep it shaking, and each parting costs steps.
    """
    work, contacts, largest, out = scene.work, scene.contacts, 0.0, scene.work.law_out
    for k in range(work.hit[len(work.hit) - 1]):
        s = work.hit[k]
        c, row, point = contact_of(scene, s), work.slot[s], work.points[s]
        gi, gj = sides(scene, s)
        p, n = vector(point[AT_POINT:]), vector(point[AT_NORMAL:])
        v = sub(
            speed_change(scene, e, y, scene.graphics.body[gi], p),
            speed_change(scene, e, y, scene.graphics.body[gj], p),
        )
        off, law, par = abs(dot(v, n)), contacts.normal_law[c], contacts.normal_par[c]
        if off == 0.0 or call_int(law, (row[DEPTH], row[RATE], par, out)) != 0:
            continue
        here, most, change = out[LOAD], max(out[LOAD], out[ELASTIC]), 0.0
        for rate in (row[RATE] - off, row[RATE] + off):
            call_int(law, (row[DEPTH], rate, par, out))
            change = max(change, abs(out[LOAD] - here))
        if PRESSED * change > largest * most:
            largest = PRESSED * change / most if most > 0.0 else math.inf
    return largest


@jitable
def impact_left(scene: Scene, h: float, e: F1, y: F1) -> float:
    """Return the largest change of a closing speed that e causes, over that in the step h.

    That is of the motion or, where a weight is nearly balanced, what the contact's force would make
    it: there the errors of very many steps add up, though none is large. What hardly changes, as
    just behind a touch, counts as SLIGHT of the closing motion with what is stored of it. So does
    an error of what is lost, over the energy that changes. Of slow impacts as much energy may be
    wrong as of the least that count.
    """
    work, state, largest = scene.work, scene.state, 0.0
    first = len(e) - max(1, len(scene.contacts.id))
    for k in range(work.hit[len(work.hit) - 1]):
        s = work.hit[k]
        mass, rate, point = effective_mass(scene, y, s), work.slot[s, RATE], work.points[s]
        speed = math.sqrt(rate * rate + 2.0 * max(0.0, work.slot[s, STORED]) / mass)
        if state.touching[s] == 0 or speed == 0.0:
            continue
        c = contact_of(scene, s)
        least = FAST * math.sqrt(work.squares[scene.scales.of_contact[c]])
        gi, gj = sides(scene, s)
        p, n = vector(point[AT_POINT:]), vector(point[AT_NORMAL:])
        v = sub(
            speed_change(scene, e, y, scene.graphics.body[gi], p),
            speed_change(scene, e, y, scene.graphics.body[gj], p),
        )
        change = max(abs(rate - state.rate[s]), h * work.slot[s, NORMAL] / mass)
        change = max(change, SLIGHT * speed) * max(1.0, least / speed) ** 2
        off = max(abs(dot(v, n)), abs(e[first + c]) / (mass * speed))
        if not off <= largest * change:
            largest = off / change
    return largest

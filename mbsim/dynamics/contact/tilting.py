"""Flat faces that are one incident: what dampers of their points do against tilting."""

from __future__ import annotations

import math

from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, dot, scale, sub, vector
from mbsim.dynamics.contact.forces import (
    LOST,
    TILTING,
    TORQUE,
    ask_normal,
    contact_of,
    face_weight_of,
    is_patch,
    patch,
    sides,
)
from mbsim.geometry.catalog import (
    AT_DEPTH,
    AT_NORMAL,
    AT_POINT,
    AT_WEIGHT,
    MOMENT_XX,
    MOMENT_XY,
    MOMENT_YY,
    plane_axes,
)
from mbsim.laws.abi import LOAD


@jitable
def place_of(scene: Scene, s: int) -> tuple[tuple[int, int, V3, V3, float], float, V3]:
    """Return graphics I and J, point, normal and area of slot s; its depth; w_I - w_J."""
    point, work = scene.work.points[s], scene.work
    gi, gj = sides(scene, s)
    bi, bj = scene.graphics.body[gi], scene.graphics.body[gj]
    at = (gi, gj, vector(point[AT_POINT:]), vector(point[AT_NORMAL:]), patch(scene, s))
    return at, point[AT_DEPTH], sub(vector(work.w[bi]), vector(work.w[bj]))


@jitable
def damp_tilting(scene: Scene, t: float, y: F1, s: int, normal: float) -> int:
    """Find the couple on I and the power lost of points of slot s that are damped one by one.

    With w the relative angular velocity, the law's c = dN/d(rate) and the moments J of the points'
    parts about the incident, in `plane_axes` x, y,

        couple = -c [(Jyy wx - Jxy wy) x + (Jxx wy - Jxy wx) y]

    asked of the law at the mean rate at which points come and go. It is no more than the normal
    force has at their mean distance, for none of them pulls. Columns TORQUE and LOST of the slot
    hold what was found until the contact's own are known. Returns 0 or the law's code.
    """
    at, depth, w = place_of(scene, s)
    work, out, c = scene.work, scene.work.law_out, contact_of(scene, s)
    numbers, row = work.points[s + 1], work.slot[s]
    # the weights that the moments are made of: of a field the area of its patch
    whole = work.points[s, AT_WEIGHT] if is_patch(scene, s) else face_weight_of(scene, s)
    xx, xy, yy = numbers[MOMENT_XX], numbers[MOMENT_XY], numbers[MOMENT_YY]
    row[TILTING] = row[LOST] = 0.0
    for k in range(3):
        row[TORQUE + k] = 0.0
    x, y_axis = plane_axes(at[3])
    wx, wy = dot(w, x), dot(w, y_axis)
    square = (yy * wx * wx - 2.0 * xy * wx * wy + xx * wy * wy) / whole
    if square <= 0.0 or normal <= 0.0:
        return 0
    rate = math.sqrt(square)
    code = ask_normal(scene, t, y, c, at, depth, rate, out)
    closing = out[LOAD]
    if code == 0:
        code = ask_normal(scene, t, y, c, at, depth, -rate, out)
    if code != 0:
        return code
    damping = (closing - out[LOAD]) / (2.0 * rate)
    about_x, about_y = damping * (yy * wx - xy * wy), damping * (xx * wy - xy * wx)
    size, most = math.hypot(about_x, about_y), normal * math.sqrt((xx + yy) / whole)
    part = most / size if size > most else 1.0
    row[TILTING] = part * damping
    couple = add(scale(-part * about_x, x), scale(-part * about_y, y_axis))
    for k in range(3):
        row[TORQUE + k] = couple[k]
    row[LOST] = part * damping * whole * square
    return 0

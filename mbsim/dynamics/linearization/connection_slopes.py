"""How friction in joints changes with displacements and velocities: more of K and D.

Apart from `applied_slopes`, so that only scenes that have them compile them. The reactions that
press friction are taken as they are.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from mbsim.arrays.codes import BALL_FRICTION, SCALE_SPEED, SCREW_FRICTION, SLIDE_FRICTION
from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import dot, scale, sub, vector
from mbsim.dynamics.bodies.markers import marker_axis, marker_point, marker_velocity
from mbsim.dynamics.expressions.measures import unit
from mbsim.dynamics.forces.joint_friction import FORCE, RADIUS, SPEED, ask_law
from mbsim.dynamics.linearization.stiffness import (
    PART,
    PART_OF_SPEED,
    add_axis_rate,
    add_geometry,
    add_rate_by_pose,
    add_two_sided,
    lever,
    sides_of,
)

if TYPE_CHECKING:
    from mbsim.compile_model.tangent import Tangent


@jitable
def joint_friction_slopes(scene: Scene, t: float, f: int) -> V3:
    """Return slip speed s, dF/ds and F/s of friction f in a joint, its normal force as it is."""
    row = scene.work.joint_friction[f]
    s, kept = row[SPEED], PART * row[SPEED] + PART_OF_SPEED * scene.world.scale[SCALE_SPEED]
    low, high = max(s - kept, 0.0), s + kept
    row[SPEED] = low
    before = ask_law(scene, t, f)
    row[SPEED] = high
    by_speed = (ask_law(scene, t, f) - before) / (high - low)
    row[SPEED] = s
    return s, by_speed, row[FORCE] / s if s > 0.0 else by_speed


@jitable
def add_joint_friction_slopes(scene: Scene, T: Tangent, t: float, y: F1, f: int) -> None:
    """Add friction in a joint: dF/ds along the slip s, F/s across it.

    Of slip and wrenches there are one (slide or turn), two (screw) or three (ball) components.
    """
    P, L, nb, form = T.pattern, T.linear, len(scene.bodies.mass), scene.applied.form[f]
    i, j, ball = scene.applied.i[f], scene.applied.j[f], form == BALL_FRICTION
    bi, bj = sides_of(scene, f)
    radius, z = scene.applied.par[f, RADIUS], marker_axis(scene, j, 2)
    w = sub(vector(scene.work.w[bi]), vector(scene.work.w[bj]))
    v = sub(marker_velocity(scene, i), marker_velocity(scene, j))
    s, along, over = joint_friction_slopes(scene, t, f)
    none, count = (0.0, 0.0, 0.0), 3 if ball else 2
    slip = L.rates
    for k in range(count):
        e = unit(k) if ball else z
        # of slide and turn, the slide is the second
        slides = not ball and k == 1
        used = ball or form == SCREW_FRICTION or slides == (form == SLIDE_FRICTION)
        size = (1.0 if slides else radius) if used else 0.0
        slip[k] = size * dot(v if slides else w, e)
        wrench = scale(size, e)
        force, torque = (wrench, none) if slides else (none, wrench)
        lever(scene, L, y, bi, marker_point(scene, y, i), force, torque, L.basis[0, k])
        lever(scene, L, y, bj, marker_point(scene, y, j), force, torque, L.basis[1, k])
    for a in range(count):
        for b in range(count):
            part = over if a == b else 0.0
            if s > 0.0:
                part += (along - over) * slip[a] * slip[b] / (s * s)
            u = L.basis[:, a]
            add_two_sided(P, L.D, nb, bi, bj, part, u, L.basis[:, b])
            if ball:
                continue
            if b == 1:
                add_rate_by_pose(scene, T, f, u, part, z)
                add_axis_rate(scene, T, f, part, z, u, False)
            else:
                add_axis_rate(scene, T, f, part * radius, z, u, True)
    add_geometry(scene, T, y, f, -1 if ball else j, 1)


@jitable
def add_joint_frictions_slopes(scene: Scene, T: Tangent, t: float, y: F1) -> None:
    """Add what friction in joints does."""
    for f in range(len(scene.applied.form)):
        if scene.applied.connection[f] >= 0 and scene.applied.law[f] != 0:
            add_joint_friction_slopes(scene, T, t, y, f)

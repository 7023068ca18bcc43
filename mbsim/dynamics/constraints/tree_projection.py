"""Bodies put where the joints of the tree have them, parents first.

A child is turned by the shortest rotation that its joint asks for, then moved; of its velocity
relative to the parent what the joint allows is kept.
"""

from __future__ import annotations

import math

from mbsim.arrays.codes import (
    CHILD_AXIS,
    PARENT_AXIS,
    TURN_AXIS,
    TURN_CROSS,
    TURN_FREE,
    TURN_LOCKED,
    TURN_ROOT,
)
from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1, V3
from mbsim.core.jitable import jitable
from mbsim.core.layout import BODY_SIZE
from mbsim.core.rotation import add, cross, dot, norm, rotate, scale, sub, unrotate, vector
from mbsim.dynamics.bodies.kinematics import place_body, position
from mbsim.dynamics.constraints.tree import child_axis, parent_axis, parent_body


@jitable
def turn_body(scene: Scene, y: F1, b: int, rotation: V3) -> None:
    """Turn body b by a rotation vector, global, and place it anew."""
    angle = norm(rotation)
    if angle == 0.0:
        return
    s = math.sin(0.5 * angle) / angle
    c, x, yy, z = math.cos(0.5 * angle), s * rotation[0], s * rotation[1], s * rotation[2]
    at = BODY_SIZE * b + 3
    q0, q1, q2, q3 = y[at], y[at + 1], y[at + 2], y[at + 3]
    y[at] = c * q0 - x * q1 - yy * q2 - z * q3
    y[at + 1] = c * q1 + x * q0 + yy * q3 - z * q2
    y[at + 2] = c * q2 - x * q3 + yy * q0 + z * q1
    y[at + 3] = c * q3 + x * q2 - yy * q1 + z * q0
    # the velocity in global axes stays what it was
    w = vector(scene.work.w[b])
    place_body(scene, y, b)
    set_spin(scene, y, b, w)


@jitable
def set_spin(scene: Scene, y: F1, b: int, w: V3) -> None:
    """Give body b an angular velocity, global."""
    turn = unrotate(scene.work.R[b], w)
    for i in range(3):
        scene.work.w[b, i] = w[i]
        y[BODY_SIZE * b + 10 + i] = turn[i]


@jitable
def set_velocity(scene: Scene, y: F1, b: int, v: V3) -> None:
    """Give the cg of body b a velocity."""
    for i in range(3):
        scene.work.v[b, i] = v[i]
        y[BODY_SIZE * b + 7 + i] = v[i]


@jitable
def wanted_turn(scene: Scene, k: int) -> V3:
    """Return the shortest rotation vector that brings the child's axes where the joint has them."""
    turn = scene.tree.turn[k]
    if turn == TURN_LOCKED:
        s, c = (0.0, 0.0, 0.0), -1.0
        for axis in range(3):
            a, b = child_axis(scene, k, axis), parent_axis(scene, k, axis)
            s = add(s, scale(0.5, cross(a, b)))
            c += dot(a, b)
        # of a rotation by phi: |s| = sin phi, c = 2 cos phi
        c *= 0.5
    elif turn == TURN_AXIS:
        a, b = child_axis(scene, k, 2), parent_axis(scene, k, 2)
        s, c = cross(a, b), dot(a, b)
    elif turn == TURN_CROSS:
        a = child_axis(scene, k, scene.tree.axis[k, CHILD_AXIS])
        b = parent_axis(scene, k, scene.tree.axis[k, PARENT_AXIS])
        s, c = cross(a, b), dot(a, b)
        size = norm(s)
        return scale(-math.atan2(c, size) / size, s) if size > 0.0 else (0.0, 0.0, 0.0)
    else:
        return (0.0, 0.0, 0.0)
    size = norm(s)
    return scale(math.atan2(size, c) / size, s) if size > 0.0 else (0.0, 0.0, 0.0)


@jitable
def joint_arms(scene: Scene, y: F1, k: int) -> tuple[V3, V3]:
    """Return the joint's point on the child, from the child's cg and from that on the parent."""
    tree, R = scene.tree, scene.work.R
    body, parent = tree.body[k], parent_body(scene, k)
    arm = rotate(R[body], vector(tree.child_p[k]))
    there = add(position(scene, y, parent), rotate(R[parent], vector(tree.parent_p[k])))
    return arm, sub(add(position(scene, y, body), arm), there)


@jitable
def project_child(scene: Scene, y: F1, k: int) -> None:
    """Put the child at tree index k where its joint has it."""
    tree = scene.tree
    body = tree.body[k]
    turn_body(scene, y, body, wanted_turn(scene, k))
    apart = joint_arms(scene, y, k)[1]
    for axis in range(3):
        if tree.slide[k, axis] == 1:
            e = parent_axis(scene, k, axis)
            apart = sub(apart, scale(dot(apart, e), e))
    at = BODY_SIZE * body
    for i in range(3):
        y[at + i] -= apart[i]


@jitable
def project_tree(scene: Scene, y: F1) -> None:
    """Put all bodies of the trees where their joints have them, parents first."""
    for k in range(len(scene.tree.body)):
        if scene.tree.turn[k] != TURN_ROOT:
            project_child(scene, y, k)


@jitable
def project_child_velocity(scene: Scene, y: F1, k: int) -> None:
    """Give the child at tree index k a velocity that its joint allows."""
    tree, work = scene.tree, scene.work
    turn, body, parent = tree.turn[k], tree.body[k], parent_body(scene, k)
    w_p = vector(work.w[parent])
    relative = sub(vector(work.w[body]), w_p)
    arm = joint_arms(scene, y, k)[0]
    at = add(position(scene, y, body), arm)
    v_P = add(vector(work.v[body]), cross(vector(work.w[body]), arm))
    v_p = add(vector(work.v[parent]), cross(w_p, sub(at, position(scene, y, parent))))
    w = w_p
    if turn == TURN_FREE:
        w = add(w, relative)
    elif turn == TURN_AXIS:
        e = parent_axis(scene, k, 2)
        w = add(w, scale(dot(relative, e), e))
    elif turn == TURN_CROSS:
        a = child_axis(scene, k, tree.axis[k, CHILD_AXIS])
        b = parent_axis(scene, k, tree.axis[k, PARENT_AXIS])
        w = add(w, add(scale(dot(relative, a), a), scale(dot(relative, b), b)))
    slip = (0.0, 0.0, 0.0)
    for axis in range(3):
        if tree.slide[k, axis] == 1:
            e = parent_axis(scene, k, axis)
            slip = add(slip, scale(dot(sub(v_P, v_p), e), e))
    set_spin(scene, y, body, w)
    set_velocity(scene, y, body, sub(add(v_p, slip), cross(w, arm)))


@jitable
def project_tree_velocities(scene: Scene, y: F1) -> None:
    """Give all bodies of the trees velocities that their joints allow, parents first."""
    for k in range(len(scene.tree.body)):
        if scene.tree.turn[k] != TURN_ROOT:
            project_child_velocity(scene, y, k)

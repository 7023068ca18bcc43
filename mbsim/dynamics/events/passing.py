"""How long a pair of a mesh that touches may move until it may have passed through a wall.

Slots in touch tell of the walls that they press; what else of both shapes moves towards each other
is told by the pair's motion bound (`geometry.mesh.motion`), from velocities and accelerations at
the committed point.
"""

from __future__ import annotations

import math

from mbsim.arrays.codes import BEYOND_TIME
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int
from mbsim.core.arrays import F1, V3
from mbsim.core.jitable import jitable
from mbsim.core.layout import AT_V, AT_W, BODY_SIZE
from mbsim.core.problem import STABLE_EVERY
from mbsim.core.rotation import add, cross, norm, rotate, scale, sub, vector
from mbsim.dynamics.bodies.kinematics import place_body, place_graphic, position
from mbsim.dynamics.contact.forces import velocity_at
from mbsim.geometry.motion import (
    ACCELERATION,
    ALLOWED,
    ASKED,
    MORE,
    OVERLAP,
    SPIN,
    VELOCITY,
    time_for,
)

#: How much deeper a step may lead, over half of the thickness of both shapes: `points.log_deep`
#: looks at ends of steps, and sees what passes within 0.4 of it.
DEEPER = 0.3
#: The same of pairs with a mesh, over half of the thinner one: the other may lie so that it does
#: not tell of a depth, as a ring around a bore, in whose layer it is all the way.
OF_THINNER = 0.5
#: How deep what touches may be in each other, over how far walls may be gone into, to be no more.
SHALLOW = 0.25
#: What is this many times as deep, at most, is no deeper.
LIKE = 1.01


@jitable
def place_side(scene: Scene, y: F1, g: int) -> None:
    """Place graphic g and its body at y."""
    if scene.graphics.body[g] < len(scene.bodies.mass):
        place_body(scene, y, scene.graphics.body[g])
        place_graphic(scene, y, g)


@jitable
def turning_of(scene: Scene, f: F1, b: int) -> V3:
    """Return the angular acceleration of body b."""
    if b == len(scene.bodies.mass):
        return (0.0, 0.0, 0.0)
    return rotate(scene.work.R[b], vector(f[BODY_SIZE * b + AT_W :]))


@jitable
def acceleration_at(scene: Scene, y: F1, f: F1, b: int, p: V3) -> V3:
    """Return the acceleration of body b's material point at p."""
    if b == len(scene.bodies.mass):
        return (0.0, 0.0, 0.0)
    arm, w = sub(p, position(scene, y, b)), vector(scene.work.w[b])
    turned = add(cross(turning_of(scene, f, b), arm), cross(w, cross(w, arm)))
    return add(vector(f[BODY_SIZE * b + AT_V :]), turned)


@jitable
def deepest_in_touch(scene: Scene, pair: int) -> float:
    """Return the largest depth of a pair at the committed point."""
    deepest = 0.0
    for s in range(scene.pairs.slot[pair], scene.pairs.last[pair]):
        if scene.state.touching[s] == 1:
            deepest = max(deepest, scene.state.depth[s])
    return deepest


@jitable
def deeper_at_once(scene: Scene, pair: int) -> float:
    """Return how much deeper a pair may go in one step to be seen where it is too deep.

    As deep as it likes where it was.
    """
    i, j, thin = scene.pairs.graphic_i[pair], scene.pairs.graphic_j[pair], scene.graphics.thin
    kind = scene.pairs.kind[pair]
    if scene.kinds.bound[kind] == 0:
        return DEEPER * (thin[i] + thin[j])
    told = not math.isnan(scene.log.contacts[scene.kinds.contact[kind], BEYOND_TIME])
    return math.inf if told else OF_THINNER * min(thin[i], thin[j])


@jitable
def passing_time(scene: Scene, y: F1, f: F1, pair: int, asked: float) -> float:
    """Return how long of the time asked for a pair that touches passes no wall.

    The whole shape of I moves no faster than its fastest point: where that is enough no tree is
    looked into.
    """
    pairs, graphics, work = scene.pairs, scene.graphics, scene.work
    allowed = deeper_at_once(scene, pair)
    if math.isinf(allowed):
        return asked
    gi, gj = pairs.graphic_i[pair], pairs.graphic_j[pair]
    bi, bj = graphics.body[gi], graphics.body[gj]
    place_side(scene, y, gi)
    place_side(scene, y, gj)
    c = vector(work.frames[gi])
    v = sub(velocity_at(scene, y, bi, c), velocity_at(scene, y, bj, c))
    wj = vector(work.w[bj])
    w = sub(vector(work.w[bi]), wj)
    a = sub(acceleration_at(scene, y, f, bi, c), acceleration_at(scene, y, f, bj, c))
    a = sub(a, scale(2.0, cross(wj, v)))
    radius = graphics.radius[gi] if graphics.turns[gi] == 1 else 0.0
    turned = norm(sub(turning_of(scene, f, bi), turning_of(scene, f, bj)))
    more = (norm(w) * (norm(w) + 2.0 * norm(wj)) + turned) * radius
    simple = time_for(allowed, norm(v) + norm(w) * radius, norm(a) + more)
    if simple >= asked:
        return asked
    # steps of a method without error estimate are found anew after so many of them
    many = STABLE_EVERY if scene.world.fixed_step[0] == 1 else 1
    asked, motion = many * asked, work.approach
    motion[ASKED], motion[ALLOWED], motion[MORE] = asked, allowed, more
    motion[OVERLAP] = min(LIKE * deepest_in_touch(scene, pair), SHALLOW * allowed)
    for k in range(3):
        motion[VELOCITY + k], motion[ACCELERATION + k], motion[SPIN + k] = v[k], a[k], w[k]
    call_int(
        scene.kinds.bound[pairs.kind[pair]],
        (work.frames[gi], graphics.size[gi], work.frames[gj], graphics.size[gj], motion),
    )
    return max(simple, motion[ASKED] / many)

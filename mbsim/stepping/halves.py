"""A step as long as the deck says, and what its length leaves off where it has impacts.

Impacts are taken by the step: one for each contact. What a body met twice, what it would have
passed beside, or how it went on behind an impact is seen by two halves of the step, as steps by
error see it (`stepping.moreau`). Steps without impacts are of order 2 and are not compared.
"""

from __future__ import annotations

import math

from mbsim.arrays.codes import AUDIT_TOL, FOUND_ALLOWED, FOUND_VALUE, STEP_END
from mbsim.arrays.hooks import Hook
from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1
from mbsim.core.jitable import jitable
from mbsim.core.layout import AT_Q, AT_V, BODY_SIZE
from mbsim.dynamics.bodies.awake import bodies_awake, body_awake
from mbsim.stepping.arrays import (
    CLOSED,
    COMPARED,
    END_OFF,
    FASTEST,
    POINTS,
    Stepping,
)
from mbsim.stepping.displacements import comes_at
from mbsim.stepping.forces import bring_to_end
from mbsim.stepping.step import take_step

#: What impacts may leave off without a word, over tol times the length: `results.audit`.
SAID = 100.0
#: Error of a step over what it differs from two halves of it: across an impact it is of order 1,
#: and theirs is half of it (L. F. Richardson, Phil. Trans. R. Soc. A 210 (1911) 307).
RICHARDSON = 2.0
#: Steps that are compared in any case; once so many were, and it was said that steps are too long,
#: others are where they may be so many times worse.
MANY, WORSE = 32, 10.0


@jitable
def find_fastest(scene: Scene, S: Stepping, h: float) -> float:
    """Find the contact that closed fastest of those that press; return by how much over L."""
    P, number, most = S.points, S.tally.number, 0.0
    number[FASTEST] = number[CLOSED] = 0.0
    for k in range(S.tally.count[POINTS]):
        c = P.contact[k]
        if P.r[k, 0] == 0.0:
            continue
        closed = h * comes_at(S, k)
        part = closed / scene.scales.length[scene.scales.of_contact[c]]
        if part > most:
            most = part
            number[FASTEST], number[CLOSED] = c, closed
    return most


@jitable
def is_doubtful(scene: Scene, S: Stepping, h: float) -> bool:
    """Return whether impacts may leave the step off by more than is passed over."""
    found, said = scene.audit.found[STEP_END], SAID * scene.audit.plan[AUDIT_TOL]
    if find_fastest(scene, S, h) <= said:
        return False
    if S.tally.count[COMPARED] < MANY or not found[FOUND_VALUE] > 10.0 * found[FOUND_ALLOWED]:
        return True
    return S.tally.number[CLOSED] > WORSE * found[FOUND_VALUE]


@jitable
def distance(scene: Scene, b: int, one: F1, other: F1) -> float:
    """Return how far a body is in two states: the larger of |dx| and L |dtheta|."""
    at, way, turned = BODY_SIZE * b, 0.0, 0.0
    for c in range(at, at + AT_Q):
        way += (one[c] - other[c]) ** 2
    # q and -q are the same attitude
    same = 0.0
    for c in range(at + AT_Q, at + AT_V):
        same += one[c] * other[c]
    for c in range(at + AT_Q, at + AT_V):
        turned += (one[c] - math.copysign(other[c], same * other[c])) ** 2
    length = scene.scales.length[scene.scales.group[b]]
    return math.sqrt(max(way, 4.0 * turned * length * length))


@jitable
def take_part(
    scene: Scene, S: Stepping, t: float, h: float, y: F1, new: F1, committed: bool
) -> int:
    """Take a step as `take_step` does, and bring it back onto joints; return 0 or a code."""
    code = take_step(scene, S, t, h, y, new, committed)
    if code == 0 and scene.world.hooks[Hook.JOINTS] != 0:
        code = bring_to_end(scene, t + h, new)
    return code


@jitable
def take_fixed_step(scene: Scene, S: Stepping, t: float, h: float, y: F1, new: F1) -> int:
    """Fill the state a step h after (t, y), and how far impacts leave it off; return 0 or a code.

    The step is taken anew behind its halves: what it leaves is that of the whole step.
    """
    number, half = S.tally.number, S.motion.half
    code = take_part(scene, S, t, h, y, new, True)
    number[END_OFF] = 0.0
    if code != 0 or not is_doubtful(scene, S, h):
        return code
    S.tally.count[COMPARED] += 1
    code = take_part(scene, S, t, 0.5 * h, y, half[0], True)
    if code == 0:
        code = take_part(scene, S, t + 0.5 * h, 0.5 * h, half[0], half[1], False)
    if code != 0:
        return code
    end = 0.0
    for k in range(bodies_awake(scene)):
        b = body_awake(scene, k)
        end = max(end, distance(scene, b, new, half[1]))
    number[END_OFF] = RICHARDSON * end
    return take_part(scene, S, t, h, y, new, True)

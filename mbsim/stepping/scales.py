"""By what velocities and lengths of a step are judged: those of the group of connected bodies.

What else there is in a model, however large or fast, changes nothing of them
(`compile_model.groups`).
"""

from __future__ import annotations

from mbsim.core.arrays import F2
from mbsim.core.jitable import jitable
from mbsim.stepping.arrays import LEFT, LEFT_SPEED, LENGTH, NOISE, SPEED, Stepping

#: Closing and slipping are none up to so many times what the solver may leave of a velocity at
#: most, however short a step.
NOISE_OF_SPEED = 30.0
#: What stands still is solved so many times closer, but not below this part of its group's speed.
CLOSER, ROUNDING = 0.001, 1e-11


@jitable
def speed_of(S: Stepping, b: int, v: F2) -> float:
    """Return the largest component of a body's velocity.

    Spins count by how fast they move what is the length of its group away.
    """
    length, most = S.plan.scale[S.plan.connected[b], LENGTH], 0.0
    for c in range(6):
        most = max(most, (1.0 if c < 3 else length) * abs(v[b, c]))
    return most


@jitable
def distance(S: Stepping, b: int, v: F2, w: F2) -> float:
    """Return `speed_of` of what two velocities of a body differ by."""
    length, most = S.plan.scale[S.plan.connected[b], LENGTH], 0.0
    for c in range(6):
        most = max(most, (1.0 if c < 3 else length) * abs(v[b, c] - w[b, c]))
    return most


@jitable
def group_at(S: Stepping, k: int) -> int:
    """Return the group of connected bodies that point k is of."""
    i, j = S.points.body[k, 0], S.points.body[k, 1]
    return S.plan.connected[i if i != len(S.plan.connected) - 1 else j]


@jitable
def left_of(S: Stepping, g: int, h: float) -> float:
    """Return what the solver may leave of a velocity of group g in a step h.

    What it moves in the step does not count then; nor, over the group's own time, what is left of a
    velocity behind an impact in a step that is very short.
    """
    scale = S.plan.scale[g]
    return min(scale[LEFT] / h, scale[LEFT_SPEED])


@jitable
def left_at_rest(S: Stepping, g: int, h: float) -> float:
    """Return `left_of` where nothing of an island moves by what counts: piles come to rest, sleep.

    What a loose solution leaves of velocities goes on from step to step, and lets stacks fall over.
    """
    left = left_of(S, g, h)
    return max(CLOSER * left, min(left, ROUNDING * S.plan.scale[g, SPEED]))


@jitable
def noise_of(S: Stepping, g: int, h: float) -> float:
    """Return the speed up to which closing and slipping of group g in a step h are none."""
    scale = S.plan.scale[g]
    return min(scale[NOISE] / h, NOISE_OF_SPEED * scale[LEFT_SPEED])

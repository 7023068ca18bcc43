"""Equations near a fold, where they follow from others for a moment: seen, and gone through."""

from __future__ import annotations

import math

from mbsim.arrays.codes import (
    AUDIT_TOL,
    FOLD_BEGINS,
    FOLD_ENDS,
    FOLD_HALT,
    FOLDS,
    KEPT,
    PIVOT,
    PIVOT_THEN,
    PIVOT_TIME,
    USUAL,
)
from mbsim.arrays.scene import Scene
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, cross, dot, vector
from mbsim.dynamics.constraints.in_use import active_count

#: Below this part of the usual pivots a state is near a position in which a loop can fold: how far
#: that is goes as the square root of the least pivot.
NEAR = 0.01
#: Below this part what multipliers do is foreseen, until the fold is as far behind. A loop whose
#: lengths are wrong by a rounding error e is accelerated by e/part**1.5 beside what it should.
FOLDING = 2.5e-4
#: Equations are released there whose pivots are below this part.
RELEASED = 0.05
#: From this part on steps go no farther than `CLOSER` of the way to the fold, so that there are
#: samples of accelerations from which what is ahead can be told.
WATCHED, CLOSER = 0.25, 0.3
#: And so much farther at a tolerance of 1e-3, where fewer samples are enough.
LOOSER = 0.2
#: Samples are taken where the least pivot has fallen to this part of the last one's.
SAMPLED = 0.6
#: It is foreseen from so many times as far from the fold as `FOLDING` is, or, where samples do not
#: tell it to this part of tol, from nearer up to this.
ENTERED, DOUBT, NEAREST = 1.5, 0.1, 0.4
#: What rounding makes of that.
NOISE = 1e-10
#: What is foreseen lasts at most so many times the time over which samples were taken.
REACH = 1.0


@jitable
def near_fold(scene: Scene) -> bool:
    """Return whether the factor at hand is of a state near a position in which a loop can fold."""
    quality = scene.sweep.quality
    return quality[PIVOT] < NEAR * quality[USUAL]


@jitable
def passes_fold(scene: Scene, t: float) -> bool:
    """Return whether at t a loop passes a fold.

    Steps begin and end where that does; times before are those of output rows.
    """
    quality = scene.sweep.quality
    return t >= quality[FOLD_BEGINS] and (t < quality[FOLD_ENDS] or quality[FOLDS] == 1.0)


@jitable
def is_sticking(scene: Scene, e: int, t: float) -> bool:
    """Return whether equation e holds at t: what is released does not while a fold is passed."""
    return scene.sweep.released[e] == 0 or not passes_fold(scene, t)


@jitable
def watch_fold(scene: Scene, t: float) -> None:
    """Look at the committed state how far ahead a fold is, and begin to pass one that is near.

    The time until there follows from how the square root of the least pivot falls. Through the
    fold, and as far behind it, equations whose pivots vanish there are released.
    """
    sweep, active, quality = scene.sweep, scene.equations.active, scene.sweep.quality
    least, before, since = quality[PIVOT], quality[PIVOT_THEN], t - quality[PIVOT_TIME]
    quality[PIVOT_THEN], quality[PIVOT_TIME], quality[FOLD_HALT] = least, t, math.inf
    if not (since > 0.0 and 0.0 < least < min(before, WATCHED * quality[USUAL])):
        return
    ahead = since / (math.sqrt(before / least) - 1.0)
    last, tol = int(quality[KEPT]) - 1, scene.audit.plan[AUDIT_TOL]
    within = math.sqrt(least / (FOLDING * quality[USUAL]))
    near = within <= ENTERED and last > 0 and 2.0 * ahead < REACH * (t - sweep.kept_at[last])
    # where samples are too few a nearer one makes up for that
    if near and (
        within <= NEAREST or 2.0 * ahead * doubted(scene, t + ahead) <= max(DOUBT * tol, NOISE)
    ):
        quality[FOLDS], quality[FOLD_BEGINS], quality[FOLD_ENDS] = 1.0, t, t + 2.0 * ahead
        quality[FOLD_HALT] = quality[FOLD_ENDS]
        for r in range(active_count(scene)):
            pivot = (sweep.A[r, r] / sweep.size[active[r]]) ** 2
            sweep.released[active[r]] = 1 if pivot < RELEASED * quality[USUAL] else 0
    elif within > NEAREST:
        part = CLOSER + LOOSER * min(max(0.25 * math.log10(tol) + 1.75, 0.0), 1.0)
        until = 1.0 if within > ENTERED else NEAREST
        quality[FOLD_HALT] = t + ahead * min(part, 1.0 - until / within)


@jitable
def doubted(scene: Scene, t: float) -> float:
    """Return by how much accelerations foreseen at t differ with one sample less, over V [1/T]."""
    sweep, scales, when, off = scene.sweep, scene.scales, scene.sweep.kept_at, 0.0
    count = int(sweep.quality[KEPT])
    for p in range(len(scene.tree.body)):
        for c in range(6):
            sweep.answer[p, c] = 0.0
    for i in range(count):
        # the divided difference times the product of distances: what the last one adds
        part = 1.0
        for j in range(count):
            if j < count - 1:
                part *= t - when[j]
            if j != i:
                part /= when[i] - when[j]
        for p in range(len(scene.tree.body)):
            for c in range(6):
                sweep.answer[p, c] += part * sweep.kept_a[i, p, c]
    for p in range(len(scene.tree.body)):
        g, D = scales.group[scene.tree.body[p]], sweep.answer[p]
        shift = add((D[3], D[4], D[5]), cross((D[0], D[1], D[2]), vector(sweep.arm[p])))
        off = max(off, math.sqrt(dot(shift, shift) / scene.work.squares[g]))
    return off


@jitable
def leave_fold(scene: Scene, t: float) -> bool:
    """Return whether a fold that was being passed is left behind at the committed time t."""
    quality = scene.sweep.quality
    begins, ends = quality[FOLD_BEGINS], quality[FOLD_ENDS]
    if t < ends - 1e-9 * (ends - begins):
        return False
    quality[FOLDS], quality[FOLD_ENDS] = 0.0, t
    quality[FOLD_HALT], quality[PIVOT_THEN] = math.inf, 0.0
    return True

"""Bodies at rest: an island of them sleeps until something touches or loads one of them.

An island is what contact points join, whether they press or not, but for ground. It sleeps where
every body of it was still for `CALM` steps and a quarter of its own time: slower than what
the solver may leave of a velocity (`scales.left_of`), nothing but weight acts on it, and no joint
holds it. Its velocities are 0 then; its forces are those of its last step, which nothing changes.

A sleeping body gives no contact points with what sleeps or is ground, so it is neither measured nor
solved. As soon as a point of it with anything that is awake may close within a step, or a force
beside its weight acts on it, its whole island is awake, before the step is solved: nothing is late.
What would have moved on at less than what the solver may leave stands: that is the error.

Kept points of what sleeps are the first rows of `Kept.table`, so that nobody goes through them; nor
does a step go through bodies, graphics and pairs that sleep (`stepping.awake`).
"""

from __future__ import annotations

from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1, I1
from mbsim.core.jitable import jitable
from mbsim.core.layout import AT_V, AT_W, BODY_SIZE
from mbsim.core.problem import GOES, WHOLE
from mbsim.core.rotation import norm, vector
from mbsim.dynamics.bodies.awake import bodies_awake, body_awake
from mbsim.stepping.arrays import (
    ASLEEP,
    CALM_STEPS,
    CHANGED,
    ISLAND,
    KEPT_BODY_I,
    KEPT_BODY_J,
    KEPT_CONTACT,
    KEPT_FORCE,
    MAY_SLEEP,
    OWN_TIME,
    POINTS,
    QUIET,
    SLEEPERS,
    SLEEPING_ROWS,
    WOKEN,
    Stepping,
)
from mbsim.stepping.free_motion import stand
from mbsim.stepping.kept import index_kept
from mbsim.stepping.scales import left_of, noise_of, speed_of

#: Steps in a row in which a body has to be still, and for how long, over its group's own time L/V.
CALM, LONG = 16, 0.25


@jitable
def both_sleep(S: Stepping, i: int, j: int) -> bool:
    """Return whether two bodies sleep, or one does and the other one is ground."""
    rest, ground = S.rest.body, len(S.rest.body)
    first = i == ground or rest[i, ASLEEP] == 1
    return first and (j == ground or rest[j, ASLEEP] == 1) and (i != ground or j != ground)


@jitable
def one_sleeps(S: Stepping, i: int, j: int) -> bool:
    """Return whether one of two bodies sleeps, and the other one is awake and moves."""
    rest, ground = S.rest.body, len(S.rest.body)
    if i == ground or j == ground:
        return False
    return rest[i, ASLEEP] != rest[j, ASLEEP]


@jitable
def sum_forces(scene: Scene, S: Stepping, rows: int) -> None:
    """Fill what the first rows of `Kept.spare`, those of what sleeps, do in all."""
    rest, ground, group = S.rest, len(S.rest.body), scene.scales.group
    for c in range(len(rest.net)):
        rest.net[c, 0] = rest.net[c, 1] = rest.net[c, 2] = 0.0
    for g in range(len(rest.grounded)):
        rest.grounded[g] = 0
    for row in range(rows):
        values = S.kept.spare[row]
        net = rest.net[int(values[KEPT_CONTACT])]
        for c in range(3):
            net[c] += values[KEPT_FORCE + c]
        i, j = int(values[KEPT_BODY_I]), int(values[KEPT_BODY_J])
        if i == ground or j == ground:
            rest.grounded[group[min(i, j)]] = 1


@jitable
def put_sleepers_first(scene: Scene, S: Stepping) -> None:
    """Put the kept points of what sleeps before all others; both keep their order."""
    kept, at = S.kept, 0
    for turn in range(2):
        for row in range(kept.count[0]):
            i, j = int(kept.table[row, KEPT_BODY_I]), int(kept.table[row, KEPT_BODY_J])
            if both_sleep(S, i, j) == (turn == 0):
                kept.spare_key[at] = kept.key[row]
                for c in range(kept.table.shape[1]):
                    kept.spare[at, c] = kept.table[row, c]
                at += 1
        if turn == 0:
            kept.count[SLEEPING_ROWS] = at
            sum_forces(scene, S, at)
    for row in range(at):
        kept.key[row] = kept.spare_key[row]
        for c in range(kept.table.shape[1]):
            kept.table[row, c] = kept.spare[row, c]
    index_kept(S)


@jitable
def note_others(scene: Scene, S: Stepping) -> None:
    """Note that others sleep than before: a step goes through everything until that is settled."""
    put_sleepers_first(scene, S)
    S.rest.count[CHANGED] = 1
    scene.awake.whole[GOES] = WHOLE


@jitable
def wake(scene: Scene, S: Stepping, b: int) -> None:
    """Wake the island of body b."""
    rest, island = S.rest, S.rest.body[b, ISLAND]
    for other in range(len(rest.body)):
        row = rest.body[other]
        if row[ASLEEP] == 1 and row[ISLAND] == island:
            row[ASLEEP] = row[CALM_STEPS] = 0
            rest.count[SLEEPERS] -= 1
    rest.count[WOKEN] = 1
    note_others(scene, S)


@jitable
def wake_all(scene: Scene, S: Stepping) -> None:
    """Wake everything, as where what acts is another from here on."""
    for b in range(len(S.rest.body)):
        S.rest.body[b, ASLEEP] = S.rest.body[b, CALM_STEPS] = 0
    if S.rest.count[SLEEPERS] > 0:
        S.rest.count[SLEEPERS] = 0
        note_others(scene, S)


@jitable
def wake_loaded(scene: Scene, S: Stepping) -> None:
    """Wake islands on a body of which anything but its weight acts."""
    if S.rest.count[SLEEPERS] == 0:
        return
    for b in scene.awake.loadable:
        if S.rest.body[b, ASLEEP] == 1 and is_loaded(scene, b):
            wake(scene, S, b)


@jitable
def is_loaded(scene: Scene, b: int) -> bool:
    """Return whether anything but its weight acts on body b."""
    work, mass, g = scene.work, scene.bodies.mass[b], scene.world.gravity
    for c in range(3):
        if work.force[b, c] != mass * g[c] or work.torque[b, c] != 0.0:
            return True
    return False


@jitable
def root_of(parent: I1, b: int) -> int:
    """Return the first body of the island of body b, and shorten the way to it."""
    while parent[b] != b:
        parent[b] = parent[parent[b]]
        b = parent[b]
    return b


@jitable
def find_islands(scene: Scene, S: Stepping) -> None:
    """Fill the island of each body that is awake: its first body."""
    P, parent, ground = S.points, S.rest.parent, len(S.rest.body)
    for row in range(bodies_awake(scene)):
        parent[body_awake(scene, row)] = body_awake(scene, row)
    for k in range(S.tally.count[POINTS]):
        i, j = P.body[k, 0], P.body[k, 1]
        if i != ground and j != ground:
            first, other = root_of(parent, i), root_of(parent, j)
            parent[max(first, other)] = min(first, other)


@jitable
def goes_nowhere(S: Stepping, b: int, h: float) -> bool:
    """Return whether a body goes no way in a step h that counts as closing or slipping."""
    return speed_of(S, b, S.motion.before) <= noise_of(S, S.plan.connected[b], h)


@jitable
def find_still(scene: Scene, S: Stepping, h: float) -> None:
    """Note the islands that go nowhere in a step, in `QUIET` of their first bodies."""
    rest = S.rest
    find_islands(scene, S)
    for row in range(bodies_awake(scene)):
        rest.body[body_awake(scene, row), QUIET] = 1
    for row in range(bodies_awake(scene)):
        b = body_awake(scene, row)
        if not goes_nowhere(S, b, h):
            rest.body[root_of(rest.parent, b), QUIET] = 0


@jitable
def is_still(S: Stepping, k: int) -> bool:
    """Return whether `find_still` noted the island of point k."""
    i, ground = S.points.body[k, 0], len(S.rest.body)
    b = i if i != ground else S.points.body[k, 1]
    return S.rest.body[root_of(S.rest.parent, b), QUIET] == 1


@jitable
def count_calm(scene: Scene, S: Stepping, t: float, h: float, y: F1) -> bool:
    """Count the steps in which each body was still; return whether one was for long enough."""
    some = False
    for k in range(bodies_awake(scene)):
        b = body_awake(scene, k)
        row = S.rest.body[b]
        if row[ASLEEP] == 1:
            continue
        at, length = BODY_SIZE * b, scene.scales.length[scene.scales.group[b]]
        speed = norm(vector(y, at + AT_V)) + length * norm(vector(y, at + AT_W))
        slow = left_of(S, S.plan.connected[b], h)
        still = speed <= slow and S.plan.group[b] < 0 and not is_loaded(scene, b)
        if not still:
            row[CALM_STEPS] = 0
            continue
        if row[CALM_STEPS] == 0:
            S.rest.since[b] = t
        row[CALM_STEPS] += 1
        some = some or is_calm(S, b, t)
    return some


@jitable
def is_calm(S: Stepping, b: int, t: float) -> bool:
    """Return whether a body was still for long enough."""
    long = t - S.rest.since[b] >= LONG * S.plan.scale[S.plan.connected[b], OWN_TIME]
    return S.rest.body[b, CALM_STEPS] >= CALM and long


@jitable
def let_sleep(scene: Scene, S: Stepping, t: float, h: float, y: F1) -> None:
    """Let islands sleep whose bodies all are still, at the end of a step that is taken."""
    if S.plan.number[MAY_SLEEP] == 0.0 or not count_calm(scene, S, t, h, y):
        return
    rest, parent = S.rest, S.rest.parent
    find_islands(scene, S)
    # an island with one body that is not still is awake
    for k in range(bodies_awake(scene)):
        rest.body[body_awake(scene, k), QUIET] = 1
    for k in range(bodies_awake(scene)):
        b = body_awake(scene, k)
        if rest.body[b, ASLEEP] == 0 and not is_calm(S, b, t):
            rest.body[root_of(parent, b), QUIET] = 0
    some = False
    for k in range(bodies_awake(scene)):
        b = body_awake(scene, k)
        row, first = rest.body[b], root_of(parent, b)
        if row[ASLEEP] == 0 and rest.body[first, QUIET] == 1:
            row[ASLEEP], row[ISLAND] = 1, first
            rest.count[SLEEPERS] += 1
            stop(S, y, b)
            some = True
    if some:
        note_others(scene, S)


@jitable
def stop(S: Stepping, y: F1, b: int) -> None:
    """Let body b have no velocity."""
    at = BODY_SIZE * b
    for c in range(3):
        y[at + AT_V + c] = y[at + AT_W + c] = 0.0
    stand(S, b)

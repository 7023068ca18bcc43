"""What changes twice within a step: a spring slips for a moment, or slip stops and goes on.

Neither end of the step tells of it: the driver looks into the step where it may be so. Slip that is
less in between than at both ends is told by how far it went: with both ends and the mean a parabola
has its least there, which is where the driver looks first.
"""

from __future__ import annotations

import math

from mbsim.arrays.codes import AUDIT_TOL, AXIS_TORQUE, SLIDES
from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1
from mbsim.core.jitable import jitable
from mbsim.core.problem import MILLIONTHS
from mbsim.dynamics.bodies.kinematics import place_bodies
from mbsim.dynamics.contact.forces import (
    ALONG_X,
    ALONG_Y,
    DEPTH,
    NORMAL,
    RATE,
    SLIP,
    STIFFNESS,
    UNIT,
    contact_of,
    pressing,
)
from mbsim.dynamics.contact.memory import slipping_mass
from mbsim.dynamics.forces.applied import displacement
from mbsim.dynamics.stiction.faces import holds_nothing
from mbsim.laws.catalog import BRANCHES, STICK
from mbsim.laws.catalog import SLIP as SLIPS
from mbsim.laws.friction.stiction import KEPT_MODE, KEPT_SPEED, KEPT_W, KEPT_Z, MU_STATIC

#: A load that changes by less of itself within a step passes no limit unseen.
EVEN = 1e-3
#: Over a shorter part of its length a spring that slips does not stick and slip unseen: it hardly
#: turns, and where slip is rounding its way has no direction.
SHORT_WAY = 0.01
#: Slip may stop within a step where its least is below this part of what it changes by there.
NEARLY = 0.5


@jitable
def dip(first: float, last: float, mean: float) -> tuple[float, float]:
    """Return where the parabola with these ends and this mean over 0 to 1 has its least, and that.

    The first is no number where it is least at an end, or far above 0.
    """
    bend = 3.0 * (first + last) - 6.0 * mean
    fall = last - first - bend
    if not (bend > 0.0 and -2.0 * bend < fall < 0.0):
        return math.nan, math.inf
    least = first - 0.25 * fall * fall / bend
    most = max(first, last)
    if most <= 0.0 or least >= NEARLY * (most - least):
        return math.nan, math.inf
    return -0.5 * fall / bend, least / most


@jitable
def follows(scene: Scene, s: int) -> bool:
    """Return whether friction in slot s follows the way of its slip in closed form."""
    slips = scene.state.touching[s] == 1 and scene.state.mode[s] % BRANCHES == SLIPS
    return slips and scene.contacts.carried[contact_of(scene, s)] > 0


@jitable
def counts_as(scene: Scene, s: int) -> float:
    """Return the part of the norm of errors that a change of friction in slot s by all of it is."""
    squares, group = scene.work.squares, scene.scales.of_contact[contact_of(scene, s)]
    return scene.work.slot[s, UNIT] / math.sqrt(squares[group])


@jitable
def bends_in(scene: Scene, s: int, y: F1, before: F1) -> bool:
    """Return whether the way of slip in slot s since y `before` is not friction's direction.

    By an angle that tol sees: less changes its direction by less.
    """
    if not follows(scene, s):
        return False
    row, z = scene.work.slot[s], scene.slots.z[s]
    mx, my = y[z] - before[z], y[z + 1] - before[z + 1]
    size = math.hypot(row[ALONG_X], row[ALONG_Y]) * math.hypot(mx, my)
    across = abs(row[ALONG_X] * my - row[ALONG_Y] * mx)
    return counts_as(scene, s) * across > scene.audit.plan[AUDIT_TOL] * size


@jitable
def bends(scene: Scene, y: F1, before: F1) -> bool:
    """Return whether the way of some slip since y `before` bends."""
    hit = scene.work.hit
    for k in range(hit[len(hit) - 1]):
        if bends_in(scene, hit[k], y, before):
            return True
    return False


@jitable
def may_turn(scene: Scene, s: int, h: float) -> bool:
    """Return whether slip without give in slot s may have gone back within h, and on again.

    So it is where friction alone could have stopped it.
    """
    kept, row = scene.state.memory[s], scene.work.slot[s]
    if kept[KEPT_MODE] != SLIPS or scene.work.touching[s] == 0 or holds_nothing(scene, s):
        return False
    most = scene.contacts.friction_par[contact_of(scene, s), MU_STATIC] * row[NORMAL]
    return slipping_mass(scene, s) * min(kept[KEPT_SPEED], row[SLIP]) <= h * most


@jitable
def growths(scene: Scene, s: int) -> tuple[float, float]:
    """Return N'/N in slot s at both ends of the step, which is below 0 no less than so.

    Where it falls the spring's stiffness may fall too.
    """
    row, state = scene.work.slot[s], scene.state
    steep = row[STIFFNESS] * row[DEPTH] / row[NORMAL]
    grew, grows = state.rate[s] / max(state.depth[s], 1e-300), row[RATE] / row[DEPTH]
    return grew * (steep if grew > 0.0 else 1.0), grows * (steep if grows > 0.0 else 1.0)


@jitable
def slows(scene: Scene, s: int, way: float) -> bool:
    """Return whether the spring in slot s, which slips at both ends of the step, may have stuck.

    `way` is how far it slipped within the step, in lengths of the spring.

    It sticks where w.e falls below the rate r by which its limit grows by itself. So it may have
    where w, e and r change by more within the step than is left of w.e - r at either end. One
    whose way is straight is not asked: `dip` sees what stops there.
    """
    row, state = scene.work.slot[s], scene.state
    then, now = state.memory[s], scene.work.memory[s]
    before = math.hypot(then[KEPT_Z], then[KEPT_Z + 1])
    after = math.hypot(now[KEPT_Z], now[KEPT_Z + 1])
    if before == 0.0 or after == 0.0 or row[DEPTH] <= 0.0 or way < SHORT_WAY:
        return False
    ax, ay = then[KEPT_Z] / before, then[KEPT_Z + 1] / before
    bx, by = now[KEPT_Z] / after, now[KEPT_Z + 1] / after
    ux, uy, vx, vy = then[KEPT_W], then[KEPT_W + 1], now[KEPT_W], now[KEPT_W + 1]
    grew, grows = growths(scene, s)
    left = min(ux * ax + uy * ay - grew, vx * bx + vy * by - grows)
    turned = max(math.hypot(ux, uy), math.hypot(vx, vy)) * math.hypot(bx - ax, by - ay)
    return left < math.hypot(vx - ux, vy - uy) + turned + abs(grows - grew)


@jitable
def dips_in(scene: Scene, s: int, y: F1, before: F1, h: float) -> tuple[float, float]:
    """Return `dip` of slip in slot s along its spring, less what that grows by itself, within h.

    The way M of the slip is integrated: its change over h is the mean.
    """
    state, none = scene.state, (math.nan, math.inf)
    if not follows(scene, s) or scene.work.touching[s] == 0:
        return none
    then, now = state.memory[s], scene.work.memory[s]
    long = math.hypot(then[KEPT_Z], then[KEPT_Z + 1])
    after, z = math.hypot(now[KEPT_Z], now[KEPT_Z + 1]), scene.slots.z[s]
    mx, my = y[z] - before[z], y[z + 1] - before[z + 1]
    if long == 0.0 or after == 0.0 or scene.work.slot[s, DEPTH] <= 0.0:
        return none
    if math.hypot(mx, my) < SHORT_WAY:
        return none
    ax, ay = then[KEPT_Z] / long, then[KEPT_Z + 1] / long
    bx, by = now[KEPT_Z] / after, now[KEPT_Z + 1] / after
    # along the mean of both directions, unless it turned back
    dx, dy = ax + bx, ay + by
    size = math.hypot(dx, dy)
    if size < 1.0:
        return none
    grew, grows = growths(scene, s)
    first = then[KEPT_W] * ax + then[KEPT_W + 1] * ay - grew
    last = now[KEPT_W] * bx + now[KEPT_W + 1] * by - grows
    return dip(first, last, (mx * dx + my * dy) / (size * h) - 0.5 * (grew + grows))


@jitable
def dips_of(scene: Scene, y: F1, before: F1, f: int, h: float) -> tuple[float, float]:
    """Return `dip` of slip of dry friction f within h; bodies are left placed at y."""
    if scene.applied.form[f] == AXIS_TORQUE and scene.applied.angle[f] < 0:
        return math.nan, math.inf
    way = scene.state.dry[f, SLIDES]
    _, x, last = displacement(scene, y, f)
    place_bodies(scene, before)
    _, began, first = displacement(scene, before, f)
    place_bodies(scene, y)
    return dip(way * first, way * last, way * (x - began) / h)


@jitable
def where_it_stops(scene: Scene, y: F1, before: F1, h: float) -> float:
    """Return the part of the step at which slip is least that may stop there, nan for none."""
    hit, part, lowest = scene.work.hit, math.nan, math.inf
    for k in range(hit[len(hit) - 1]):
        there, least = dips_in(scene, hit[k], y, before, h)
        if least < lowest:
            part, lowest = there, least
    for f in range(len(scene.applied.form)):
        if scene.applied.keeps[f] == 1 and abs(scene.state.dry[f, SLIDES]) == 1.0:
            there, least = dips_of(scene, y, before, f, h)
            if least < lowest:
                part, lowest = there, least
    return part


@jitable
def hides(scene: Scene, t: float, y: F1, before: F1) -> bool:
    """Return whether a spring that sticks may have slipped since y `before` and stick again.

    So it is where load and normal force change by more within the step than is left to the limit.
    Or whether what slips may have stuck within the step, and slip again.
    """
    state, hit, h = scene.state, scene.work.hit, t - scene.state.since[0]
    for k in range(hit[len(hit) - 1]):
        s = hit[k]
        row, z, c = scene.work.slot[s], scene.slots.z[s], contact_of(scene, s)
        if state.touching[s] == 1 and scene.contacts.rigid[c] == 1 and may_turn(scene, s, h):
            return True
        if scene.work.touching[s] == 1 and bends_in(scene, s, y, before):
            way = math.hypot(y[z] - before[z], y[z + 1] - before[z + 1])
            if slows(scene, s, way):
                return True
        if state.touching[s] == 0 or state.mode[s] % BRANCHES != STICK:
            continue
        most = scene.audit.cone[c] * pressing(scene, s)
        if scene.contacts.carried[c] == 0 or most == math.inf:
            continue
        stretch = math.hypot(y[z], y[z + 1])
        if most <= 0.0 or stretch == 0.0:
            continue
        closes = max(abs(row[RATE]) / row[DEPTH], abs(state.rate[s]) / max(state.depth[s], 1e-300))
        moves = abs(stretch - math.hypot(before[z], before[z + 1])) + h * row[SLIP]
        part, change = math.hypot(row[ALONG_X], row[ALONG_Y]) / most, h * closes + moves / stretch
        if part * (1.0 + change) > 1.0 and change > EVEN:
            return True
    return False


@jitable
def answer_hides(scene: Scene, t: float, y: F1, before: F1) -> int:
    """Return what the hook `switching` answers to HIDES."""
    part = where_it_stops(scene, y, before, t - scene.state.since[0])
    if not math.isnan(part):
        return 1 + max(1, int(part * MILLIONTHS))
    return 1 if hides(scene, t, y, before) else 0

"""The largest force, depth and slip of every contact, between the ends of steps too.

A step is looked into where one of them may have been above all before it: parabolas through what is
known of it lead to the peak, by the method's dense output, until another look would add less than
the tolerance. R. P. Brent, Algorithms for Minimization without Derivatives (1973), chapter 5.
"""

from __future__ import annotations

import math

from mbsim.arrays.codes import (
    END_BEFORE,
    END_LAST,
    PEAK_DEPTH,
    PEAK_FORCE,
    PEAK_FORCE_TIME,
    PEAK_SLIP,
    SAMPLE_COLUMNS,
    SAMPLE_RATE,
)
from mbsim.arrays.scene import Scene
from mbsim.core.jitable import jitable
from mbsim.core.rotation import norm, vector
from mbsim.dynamics.contact.forces import DEPTH, FORCE, NORMAL, RATE, SLIP, contact_of

#: Rows of `Log.samples`: the end of the step before, begin and end of this one, looks within it.
BEFORE, BEGIN, END, LOOKS = range(4)
#: What a look has to add, over the tolerance.
WORTH = 0.1
#: The first look is taken where a parabola has its top so far outside of the step at most.
OUTSIDE = 0.5
#: A touch is looked at so much of the way from it to the next sample: what is nearer may be apart.
BEHIND_TOUCH, FARTHER = 1e-3, 0.1
#: Slip lost between a touch and the end of its step is less than that: the step is short.
NEAR_RECORD = 0.9


@jitable
def sample(scene: Scene, row: int) -> None:
    """Write what contacts do at the point just evaluated into a row of samples."""
    work, net, hit, values = scene.work, scene.work.net, scene.work.hit, scene.log.samples
    for c in range(len(net)):
        for j in range(3):
            net[c, j] = 0.0
        values[row, c, PEAK_DEPTH] = values[row, c, PEAK_SLIP] = values[row, c, SAMPLE_RATE] = 0.0
    for k in range(hit[len(hit) - 1]):
        slot, c = work.slot[hit[k]], contact_of(scene, hit[k])
        for j in range(3):
            net[c, j] += slot[FORCE + j]
        if slot[DEPTH] > values[row, c, PEAK_DEPTH]:
            values[row, c, PEAK_DEPTH] = slot[DEPTH]
            values[row, c, SAMPLE_RATE] = slot[RATE]
        if slot[NORMAL] > 0.0:
            values[row, c, PEAK_SLIP] = max(values[row, c, PEAK_SLIP], slot[SLIP])
    for c in range(len(net)):
        values[row, c, PEAK_FORCE] = norm(vector(net[c]))


@jitable
def keep_largest(scene: Scene, row: int, t: float) -> None:
    """Keep what is larger in a row of samples than all before it."""
    log, values = scene.log.contacts, scene.log.samples
    for c in range(len(log)):
        if values[row, c, PEAK_FORCE] > log[c, PEAK_FORCE]:
            log[c, PEAK_FORCE_TIME] = t
        for q in (PEAK_FORCE, PEAK_DEPTH, PEAK_SLIP):
            log[c, q] = max(log[c, q], values[row, c, q])


@jitable
def touches(scene: Scene) -> bool:
    """Tell whether anything touches at the point just evaluated, or did at the last two ends."""
    hit, ends = scene.work.hit, scene.log.ends
    if hit[len(hit) - 1] > 0:
        return True
    for c in range(ends.shape[1]):
        if ends[END_LAST, c, PEAK_DEPTH] > 0.0 or ends[END_BEFORE, c, PEAK_DEPTH] > 0.0:
            return True
    return False


@jitable
def watch_end(scene: Scene, t: float) -> None:
    """Watch contacts at the accepted point just evaluated."""
    log = scene.log
    if not touches(scene):
        log.end_times[END_BEFORE], log.end_times[END_LAST] = log.end_times[END_LAST], t
        return
    sample(scene, END)
    keep_largest(scene, END, t)
    log.end_times[END_BEFORE], log.end_times[END_LAST] = log.end_times[END_LAST], t
    for c in range(len(log.contacts)):
        for q in range(SAMPLE_COLUMNS):
            log.ends[END_BEFORE, c, q], log.ends[END_LAST, c, q] = (
                log.ends[END_LAST, c, q],
                log.samples[END, c, q],
            )


@jitable
def watch_inside(scene: Scene, t: float) -> None:
    """Watch contacts at the inner point just evaluated, for which `next_look` asked."""
    row = scene.log.sampled[0] - 1
    sample(scene, row)
    keep_largest(scene, row, t)


@jitable
def top(x: tuple[float, float, float], y: tuple[float, float, float]) -> tuple[float, float, float]:
    """Return where the parabola through three points is largest, its value there and half its bend.

    The bend is negative; where it is not there is no top, and the place is NaN.
    """
    first = (y[1] - y[0]) / (x[1] - x[0])
    bend = ((y[2] - y[1]) / (x[2] - x[1]) - first) / (x[2] - x[0])
    if not bend < 0.0:
        return math.nan, math.nan, bend
    at = 0.5 * (x[0] + x[1] - first / bend)
    return at, y[0] + (at - x[0]) * (first + bend * (at - x[1])), bend


@jitable
def nearest(scene: Scene, c: int, q: int, at: float, way: float) -> int:
    """Return the sample of contact c nearest to part `at` on one side, way = 1 or -1; -1 for none.

    Only those where it touches count, and for what fades continuously also the end where it left.
    """
    parts, values, found = scene.log.parts, scene.log.samples, -1
    for r in range(scene.log.sampled[0]):
        known = values[r, c, PEAK_DEPTH] > 0.0 or (r == END and q != PEAK_SLIP)
        if known and way * (parts[r] - at) > 0.0:
            if found < 0 or way * (parts[r] - parts[found]) < 0.0:
                found = r
    return found


@jitable
def look_at_touch(scene: Scene, c: int, q: int, tol: float) -> float:
    """Return where to look in a step in which contact c began to touch, or -1."""
    log = scene.log
    parts, values, record = log.parts, log.samples, log.contacts[c, q]
    end, first = values[END, c, q], nearest(scene, c, q, 0.0, 1.0)
    depth, rate = values[first, c, PEAK_DEPTH], values[first, c, SAMPLE_RATE]
    if q == PEAK_SLIP:
        if end < NEAR_RECORD * record or end < tol * rate:
            return -1.0
    elif end < record:
        return -1.0
    if first != END:
        # a force that fades from the touch on has its peak at once; else three samples tell a top
        if q != PEAK_FORCE or nearest(scene, c, q, parts[first], 1.0) != END:
            return -1.0
        # where damping is full, or half way
        share = min(0.5, scene.contacts.dmax[c] / values[END, c, PEAK_DEPTH])
        return parts[first] + (share if share > 0.0 else 0.5) * (1.0 - parts[first])
    apart = 0.0
    for r in range(LOOKS, log.sampled[0]):
        if values[r, c, PEAK_DEPTH] == 0.0:
            apart = max(apart, parts[r])
    way = rate * log.span[0]
    part = 1.0 - (depth / way if way > depth else 1.0) * (1.0 - BEHIND_TOUCH)
    return max(part, apart + FARTHER * (1.0 - apart)) if apart > 0.0 else part


@jitable
def look_at_leave(scene: Scene, c: int, tol: float) -> float:
    """Return where to look for the slip at which contact c ceased to touch in the step, or -1."""
    parts, values = scene.log.parts, scene.log.samples
    last = nearest(scene, c, PEAK_SLIP, 1.0, -1.0)
    before = nearest(scene, c, PEAK_SLIP, parts[last], -1.0)
    if before < 0:
        return -1.0
    apart = 1.0
    for r in range(LOOKS, scene.log.sampled[0]):
        if values[r, c, PEAK_DEPTH] == 0.0:
            apart = min(apart, parts[r])
    slope = (values[last, c, PEAK_SLIP] - values[before, c, PEAK_SLIP]) / (
        parts[last] - parts[before]
    )
    reached = values[last, c, PEAK_SLIP] + slope * (apart - parts[last])
    grows = reached > (1.0 + WORTH * tol) * scene.log.contacts[c, PEAK_SLIP]
    return 0.5 * (parts[last] + apart) if grows else -1.0


@jitable
def look_at_top(scene: Scene, c: int, q: int, tol: float) -> float:
    """Return where to look for the largest of what contact c does within the step, or -1."""
    parts, values, best = scene.log.parts, scene.log.samples, -1
    if scene.log.sampled[0] == LOOKS and values[BEFORE, c, PEAK_DEPTH] > 0.0:
        # most steps end here: what their ends tell of a top adds nothing to what was before
        y0, y1, y2 = values[BEFORE, c, q], values[BEGIN, c, q], values[END, c, q]
        bend = ((y2 - y1) + (y1 - y0) / parts[BEFORE]) / (1.0 - parts[BEFORE])
        known = max(y0, max(y1, max(y2, scene.log.contacts[c, q])))
        if bend >= 0.0 or max(y1, y2) - 0.25 * bend <= (1.0 + WORTH * tol) * known:
            return -1.0
    for r in range(scene.log.sampled[0]):
        if values[r, c, PEAK_DEPTH] > 0.0 and (best < 0 or values[r, c, q] > values[best, c, q]):
            best = r
    left = nearest(scene, c, q, parts[best], -1.0)
    right = nearest(scene, c, q, parts[best], 1.0)
    if left < 0 and right >= 0:
        left = nearest(scene, c, q, parts[right], 1.0)
    elif right < 0 and left >= 0:
        right = nearest(scene, c, q, parts[left], -1.0)
    if left < 0 or right < 0:
        return -1.0
    largest = values[best, c, q]
    at, value, bend = top(
        (parts[left], parts[best], parts[right]), (values[left, c, q], largest, values[right, c, q])
    )
    worth = (1.0 + WORTH * tol) * max(largest, scene.log.contacts[c, q])
    if scene.log.sampled[0] > LOOKS:
        return at if value > worth and 0.0 < at < 1.0 else -1.0
    # from ends alone the top is hardly known
    if max(values[BEGIN, c, q], values[END, c, q]) - 0.25 * bend <= worth:
        return -1.0
    return min(max(at, 0.1), 0.9) if -OUTSIDE <= at <= 1.0 + OUTSIDE else -1.0


@jitable
def look_at_turn(scene: Scene, c: int, tol: float) -> float:
    """Return where to look for the place at which contact c is deepest within the step, or -1."""
    parts, values, low, high = scene.log.parts, scene.log.samples, -1, -1
    for r in range(BEGIN, scene.log.sampled[0]):
        if values[r, c, PEAK_DEPTH] == 0.0 and r != END:
            continue
        if values[r, c, SAMPLE_RATE] > 0.0:
            low = r if low < 0 or parts[r] > parts[low] else low
        else:
            high = r if high < 0 or parts[r] < parts[high] else high
    if low < 0 or high < 0 or values[high, c, PEAK_DEPTH] == 0.0 or parts[low] > parts[high]:
        return -1.0
    up, down = values[low, c, SAMPLE_RATE], values[high, c, SAMPLE_RATE]
    share = up / (up - down)
    gap = parts[high] - parts[low]
    # what the nearer of them misses to the top of a parabola
    if up < -down:
        near, missing = low, up * share
    else:
        near, missing = high, down * (share - 1.0)
    depth = values[near, c, PEAK_DEPTH] + 0.5 * missing * gap * scene.log.span[0]
    worth = (1.0 + WORTH * tol) * max(
        scene.log.contacts[c, PEAK_DEPTH], values[near, c, PEAK_DEPTH]
    )
    return parts[low] + share * gap if depth > worth else -1.0


@jitable
def next_look(scene: Scene, tol: float) -> float:
    """Return the part of the step at which to look next, -1 where nothing is to be found."""
    log, part = scene.log, -1.0
    for c in range(len(log.contacts)):
        begun, ended = log.samples[BEGIN, c, PEAK_DEPTH], log.samples[END, c, PEAK_DEPTH]
        if begun == 0.0 and ended == 0.0:
            continue
        for q in (PEAK_DEPTH, PEAK_FORCE, PEAK_SLIP):
            if q == PEAK_DEPTH:
                part = look_at_turn(scene, c, tol)
            elif begun == 0.0:
                part = look_at_touch(scene, c, q, tol)
            elif ended == 0.0 and q == PEAK_SLIP:
                part = look_at_leave(scene, c, tol)
            if part < 0.0 and q != PEAK_DEPTH:
                part = look_at_top(scene, c, q, tol)
            if part >= 0.0 and log.sampled[0] < len(log.parts):
                log.parts[log.sampled[0]] = part
                log.sampled[0] += 1
                return part
    last = -1
    for r in range(LOOKS, log.sampled[0]):
        if last < 0 or log.parts[r] > log.parts[last]:
            last = r
    if last >= 0:
        # nearer than the step's begin
        log.end_times[END_BEFORE] += log.parts[last] * log.span[0]
        for c in range(len(log.contacts)):
            for q in range(SAMPLE_COLUMNS):
                log.ends[END_BEFORE, c, q] = log.samples[last, c, q]
    return -1.0


@jitable
def first_look(scene: Scene, h: float, tol: float) -> float:
    """Return the part of a step of length h at which to look first, -1 for none.

    Called at its end, before that is committed.
    """
    log = scene.log
    if not touches(scene):
        return -1.0
    log.span[0] = h
    log.sampled[0] = LOOKS
    log.parts[BEFORE], log.parts[BEGIN], log.parts[END] = (
        (log.end_times[END_BEFORE] - log.end_times[END_LAST]) / h,
        0.0,
        1.0,
    )
    for row in range(2):
        for c in range(len(log.contacts)):
            for q in range(SAMPLE_COLUMNS):
                log.samples[row, c, q] = log.ends[row, c, q]
    sample(scene, END)
    return next_look(scene, tol)

"""Contacts of one step: Coulomb's law at every point, in the space of the bodies' velocities.

With v the velocities of the bodies, u = H v at a contact point and r its impulse,

    v = v_free + sum of answer r,   answer = M^-1 H',   W = H answer

    0 <= r_n  _|_  u_n + ahead >= 0,    |r_t| <= mu r_n, against u_t where that slips

block Gauss-Seidel goes through the points and solves each one exactly
(`stepping.one_point`), the others' impulses being as they are; v follows at once, so nothing is
assembled. Source: V. Acary, B. Brogliato, Numerical Methods for Nonsmooth Dynamical Systems (2008),
section 13.7. What sweeps leave, Newton's method on the same arrays finishes (`fclib.bodies`).
"""

from __future__ import annotations

import math

import numpy as np

from mbsim.core.arrays import F2, I1
from mbsim.core.jitable import jitable
from mbsim.fclib.bodies.factors import newton_work
from mbsim.fclib.bodies.solve import solve_contacts
from mbsim.stepping.arrays import ALONG, W_NN, W_XX, W_ZZ, Motion, Points
from mbsim.stepping.one_point import (
    apply,
    apply_farther,
    fill_directions,
    solve_point,
    velocity_of,
)

#: Sweeps before Newton's method of up to `FEW_POINTS` points, and of more points and behind it, at
#: most. An iteration of Newton's method takes as long as tens of sweeps: stacks want few of them,
#: piles of round bodies many, or it gets nowhere.
FEW_SWEEPS, MOST_SWEEPS, FEW_POINTS = 40, 400, 64
#: Sweeps between looks at how much the bodies' velocities change in the step.
LOOKS = 8
#: What impacts may leave at most, over what the solver may leave where nothing meets.
MOST_LEFT = 10.0
#: What sweeps change falls by a rate from one to the next, which is taken for less than the
#: largest: in a column of n bodies it is 1 - 1/n^2. What is left then may be so many times what may
#: be left; so many where Newton's method finishes.
LARGEST_RATE, SLACK, SLACK_OF_FEW = 0.99, 10.0, 3.0
#: The largest rate where this part of the points is of what goes nowhere: it sleeps by that.
RATE_AT_REST, MOST_STILL = 0.9999, 0.9
#: How often the points of a pair are solved in one sweep at most.
MOST_ROUNDS = 5
#: A single point may be left so many times worse than the mean of them.
WORST = 5.0
#: A velocity that changes by less than this part of what may be left asks no other pair.
STILL = 0.25
#: Points that press up to which Newton's method finishes in any case, and sweeps that an iteration
#: of it takes at most where more do, or part of those that were taken. In columns it takes 8, in
#: pyramids of 200 bodies 11, in heaps 15 to 33 (`tests/fclib/test_bodies.py`); warm starts go on
#: from step to step.
NEWTON_POINTS, MANY_SWEEPS, OF_SWEEPS = 300, 9.0, 0.1
#: The same at rest.
SWEEPS_AT_REST = 14.0
#: Seconds that a sweep takes for a point, as `fclib.factor.factor_work` counts; up to so many times
#: as many points an iteration is taken to cost as before.
SWEEP_WORK, ALIKE = 1e-7, 1.1
#: Newton iterations of a step at most, the part of what may be left that they go for, as the next
#: step starts from what they find, and the smallest error.
NEWTONS, FINISHED, SHARPEST = 40, 0.001, 1e-13


@jitable
def solve_pair(p: Points, v: F2, begin: int, end: int) -> tuple[float, float]:
    """Solve points of one pair in turn.

    Return the largest change over what may be left, and the sum of their squares.
    """
    largest, square = 0.0, 0.0
    for k in range(begin, end):
        change = solve_point(p, v, k) * p.counts[k]
        square += change * change
        if not change <= largest:
            largest = change
    return largest, square


@jitable
def pressing(p: Points, count: int) -> int:
    """Return how many points press."""
    some = 0
    for k in range(count):
        some += 1 if p.r[k, 0] > 0.0 else 0
    return some


@jitable
def note_change(p: Points, changed: I1, k: int, number: int) -> None:
    """Note that sweep `number` changed the bodies that point k moves; ground never changes."""
    if p.wide[k] >= 0:
        for row in range(p.wide[k], p.wide[k] + p.near[k]):
            changed[p.moved[row]] = number
        return
    ground = len(changed) - 1
    for side in range(2):
        if p.body[k, side] != ground:
            changed[p.body[k, side]] = number


@jitable
def change_all(p: Points, changed: I1, count: int, number: int) -> None:
    """Let sweep `number + 1` go to every pair; ground never changes."""
    for k in range(count):
        changed[p.body[k, 0]] = changed[p.body[k, 1]] = number
    changed[len(changed) - 1] = 0


@jitable
def sweep(p: Points, M: Motion, count: int, number: int) -> tuple[float, float]:
    """Go through the pairs whose bodies sweep `number - 1` changed, or this one before.

    Return the largest change of a velocity over what may be left, and the square mean over points
    that press. What changes by less than `STILL` of that wakes nobody: a sweep of all pairs has the
    last word (`sweep_on`). Points of one pair are solved a few times in turn: they bear on each
    other most, as corners of a face do.
    """
    largest, square, begin, changed = 0.0, 0.0, 0, M.changed
    while begin < count:
        end = begin + 1
        while end < count and p.key[end] == p.key[begin]:
            end += 1
        i, j = p.body[begin, 0], p.body[begin, 1]
        if changed[i] >= number - 1 or changed[j] >= number - 1:
            first, left, rounds = 0.0, 0.0, 0
            most = MOST_ROUNDS if end > begin + 1 else 1
            while rounds == 0 or (1.0 < left < math.inf and rounds < most):
                left, more = solve_pair(p, M.v, begin, end)
                if rounds == 0:
                    first = left
                    square += more
                rounds += 1
            if not first <= largest:
                largest = first
            if not first <= STILL:
                for k in range(begin, end):
                    note_change(p, changed, k, number)
                    if p.wide[k] < 0:
                        break
        begin = end
    return largest, math.sqrt(square / max(pressing(p, count), 1))


@jitable
def let_jumps_count(p: Points, M: Motion, count: int, sharp: float, part: float) -> None:
    """Let that part of what a step changes of a body's velocity be left at its points.

    Never less than `sharp` of what may be left, nor more than MOST_LEFT times that. An impact is
    taken by the step, which is off by far more.
    """
    for k in range(count):
        i, j = p.body[k, 0], p.body[k, 1]
        most = 0.0
        for b in (i, j):
            square = 0.0
            for c in range(3):
                square += (M.v[b, c] - M.before[b, c]) ** 2
            most = max(most, square)
        allowed = sharp * p.least[k]
        p.counts[k] = 1.0 / min(max(allowed, part * math.sqrt(most)), MOST_LEFT * allowed)


@jitable
def gradient(p: Points, count: int) -> float:
    """Return the square of what the last sweep changed of the impulses, in the norm of W."""
    square = 0.0
    for k in range(count):
        r, old, row = p.r[k], p.old[k], p.given[k]
        x, y, z = r[0] - old[0], r[1] - old[1], r[2] - old[2]
        if x != 0.0 or y != 0.0 or z != 0.0:
            square += row[W_NN] * x * x + row[W_XX] * y * y + row[W_ZZ] * z * z
    return square


@jitable
def go_on(p: Points, M: Motion, count: int, part: float, number: int) -> None:
    """Go on along the way of the sweeps before: a part of it, and let the way be that of all.

    The way of points that the last sweep left as they were ends.
    """
    for k in range(count):
        r, old, way, row = p.r[k], p.old[k], p.way[k], p.given[k]
        x, y, z = r[0] - old[0], r[1] - old[1], r[2] - old[2]
        if part < 0.0 or (x == 0.0 and y == 0.0 and z == 0.0):
            way[0] = way[1] = way[2] = 0.0
        elif part == 0.0:
            way[0], way[1], way[2] = x, y, z
        else:
            d = (part * way[0], part * way[1], part * way[2])
            way[0], way[1], way[2] = d[0] + x, d[1] + y, d[2] + z
            r[0] += d[0]
            r[1] += d[1]
            r[2] += d[2]
            apply(p, k, M.v, d)
            across = max(row[W_XX] * abs(d[1]), row[W_ZZ] * abs(d[2]))
            if max(row[W_NN] * abs(d[0]), across) * p.counts[k] > STILL:
                note_change(p, M.changed, k, number)
        old[0], old[1], old[2] = r[0], r[1], r[2]


@jitable
def rests(M: Motion, count: int) -> bool:
    """Return whether most points are of what goes nowhere."""
    return M.still[0] >= MOST_STILL * count


@jitable
def what_follows(square: float, before: float, largest: float) -> float:
    """Return what all sweeps to come change, over what the last one did: 1 / (1/rate - 1).

    The last one changed `square`, and the one before it `before`: rate^2 of that. In stacks the
    rate is near 1, and what a sweep still changes says little.
    """
    rate = math.sqrt(square / before) if 0.0 < before else 1.0
    rate = min(rate, largest)
    return rate / (1.0 - rate)


@jitable
def sweep_on(
    p: Points, M: Motion, count: int, may: tuple[float, float], most: int, newton: bool
) -> tuple[float, int, bool, bool]:
    """Improve r and v of `count` points.

    Return what a sweep still changes, sweeps, whether it is solved, and whether that is but for
    what sweeps to come would change.
    That is of a velocity, over what may be left of it, `least` of its point: `may` is a factor of
    that, and the part of jumps. Sweeps end where one of all pairs changes less than 1 in the square
    mean over what presses, and nowhere more than `WORST`, and those to come would change no more
    than `SLACK`; or with `most`. They go on for that with `newton`, as that finishes what they
    leave; else only for as long as they took before. Between them impulses go on along the way of
    the sweeps before, as conjugate gradients do, which is dropped where a sweep changes more than
    the last one.
    Source: M. Silcowitz, S. Niebe, K. Erleben, A nonsmooth nonlinear conjugate gradient method for
    interactive contact force problems, The Visual Computer 26 (2010) 893.
    """
    left, before, sweeps, whole, solved, first = 0.0, 0.0, 0, True, True, most
    slow, slack = False, SLACK_OF_FEW if newton else SLACK
    rate = RATE_AT_REST if rests(M, count) else LARGEST_RATE
    for k in range(count):
        p.counts[k] = 1.0 / (may[0] * p.least[k])
        for a in range(3):
            p.old[k, a] = p.r[k, a]
    change_all(p, M.changed, count, 0)
    while sweeps < most:
        sweeps += 1
        left, mean = sweep(p, M, count, sweeps)
        if sweeps % LOOKS == 1 and left > 1.0:
            let_jumps_count(p, M, count, may[0], may[1])
        solved = left <= 1.0 or (left <= WORST and mean <= 1.0)
        square = gradient(p, count)
        first = min(first, sweeps) if solved else most
        # a smaller change is no sign of a rate
        slow = solved and left > 0.5 * slack * (1.0 - rate)
        slow = slow and (sweeps == 1 or mean * what_follows(square, before, rate) > slack)
        solved = solved and not (slow and (newton or sweeps < 2 * first))
        if (solved and whole) or sweeps == most or not math.isfinite(left):
            break
        whole = solved or sweeps == most - 1
        part = -1.0
        if sweeps == 1:
            part = 0.0
        elif 0.0 < before and square <= before:
            part = square / before
        go_on(p, M, count, part, sweeps)
        before = square
        if whole:
            change_all(p, M.changed, count, sweeps)
    return left, sweeps, solved, slow


@jitable
def list_closed(p: Points, M: Motion, count: int) -> I1:
    """Return the points that press, and those that close as velocities are."""
    closed, some = np.empty(count, dtype=np.int64), 0
    for k in range(count):
        if p.r[k, 0] != 0.0 or velocity_of(p, k, 0, M.v) + p.ahead[k] < 0.0:
            closed[some] = k
            some += 1
    return closed[:some]


@jitable
def finish(p: Points, M: Motion, ground: int, closed: I1, sharp: float) -> int:
    """Let Newton's method go on from r, and fill v by what it finds; return its iterations.

    It works on the same arrays (`fclib.bodies`), on the points that are `closed`.
    """
    count = len(closed)
    bodies, w = np.empty((count, 2), dtype=np.int64), np.empty((count, 3))
    H, mu, r = np.zeros((count, 2, 3, 6)), np.empty(count), np.empty((count, 3))
    size, allowed = 0.0, math.inf
    for row in range(count):
        k = closed[row]
        allowed = min(allowed, sharp * p.least[k])
        i, j = p.body[k, 0], p.body[k, 1]
        bodies[row, 0], bodies[row, 1] = (-1 if i == ground else i), (-1 if j == ground else j)
        fill_directions(p, k, ground, H[row])
        mu[row] = p.mu[k]
        for a in range(3):
            w[row, a], r[row, a] = velocity_of(p, k, a, M.free), p.r[k, a]
        w[row, 0] += p.ahead[k]
        for a in range(3):
            size += w[row, a] ** 2
    tol = min(max(FINISHED * allowed / max(math.sqrt(size), 1e-300), SHARPEST), 1e-3)
    found = solve_contacts(M.inverse, bodies, H, mu, w, r, tol, 0, NEWTONS)
    for row in range(count):
        if not math.isfinite(r[row, 0] + r[row, 1] + r[row, 2]):
            return found[4]
    for row in range(count):
        k = closed[row]
        apply(p, k, M.v, (r[row, 0] - p.r[k, 0], r[row, 1] - p.r[k, 1], r[row, 2] - p.r[k, 2]))
        for a in range(3):
            p.r[k, a] = r[row, a]
    return found[4]


@jitable
def begin_anew(p: Points, M: Motion, count: int) -> None:
    """Forget all impulses: sweeps went off, as where a point's problem has no solution."""
    for b in range(len(M.v)):
        for c in range(6):
            M.v[b, c] = M.free[b, c]
    for k in range(count):
        p.r[k, 0] = p.r[k, 1] = p.r[k, 2] = 0.0


@jitable
def some_wide(p: Points, count: int) -> bool:
    """Return whether joints hold a body of any point: the bodies' masses are not all then."""
    for k in range(count):
        if p.wide[k] >= 0:
            return True
    return False


@jitable
def cost_of(p: Points, M: Motion, ground: int, closed: I1) -> float:
    """Return the estimated seconds of one of Newton's iterations; kept, as it takes a part of one.

    Of points that press: about as many cost as much from one step to the next.
    """
    count = len(closed)
    known = M.costs[0]
    if not (count <= ALIKE * known and known <= ALIKE * count):
        bodies = np.empty((count, 2), dtype=np.int64)
        for row in range(count):
            for side in range(2):
                b = p.body[closed[row], side]
                bodies[row, side] = -1 if b == ground else b
        M.costs[0], M.costs[1] = count, newton_work(bodies, ground)
    return M.costs[1]


@jitable
def is_costly(p: Points, M: Motion, ground: int, closed: I1, rest: bool, sweeps: int) -> bool:
    """Return whether Newton's method costs more than it brings, by the sweeps that were taken.

    `rest`: see `rests`.
    """
    many = SWEEPS_AT_REST if rest else MANY_SWEEPS
    most = max(many, OF_SWEEPS * sweeps) * SWEEP_WORK * len(closed)
    return cost_of(p, M, ground, closed) > most


@jitable
def solve_points(
    p: Points, M: Motion, ground: int, count: int, may: tuple[float, float]
) -> tuple[float, int, int, bool]:
    """Solve `count` points; return what a sweep still changes, sweeps, Newtons, if it is solved.

    See `sweep_on`. r and v are as a guess says: r of the last step, v with that. A few sweeps do
    where little changed; Newton's method does what they leave, and sweeps what it leaves.
    """
    most = FEW_SWEEPS if count <= FEW_POINTS else MOST_SWEEPS
    wide, newtons, rest = some_wide(p, count), 0, rests(M, count)
    newton = pressing(p, count) <= NEWTON_POINTS and not wide and not rest
    left, sweeps, solved, slow = sweep_on(p, M, count, may, most, newton)
    if solved and (wide or not slow):
        return left, sweeps, 0, solved
    if not math.isfinite(left):
        begin_anew(p, M, count)
    elif not wide:
        closed = list_closed(p, M, count)
        if solved and is_costly(p, M, ground, closed, rest, sweeps):
            if len(closed) > NEWTON_POINTS:
                return left, sweeps, 0, solved
            left, more, solved, _ = sweep_on(p, M, count, may, most, True)
            sweeps += more
            if solved:
                return left, sweeps, 0, solved
            closed = list_closed(p, M, count)
        few = len(closed) <= NEWTON_POINTS
        if len(closed) > 0 and (few or not is_costly(p, M, ground, closed, rest, sweeps)):
            newtons = finish(p, M, ground, closed, may[0])
    left, more, solved, _ = sweep_on(p, M, count, may, MOST_SWEEPS, False)
    if not math.isfinite(left):
        begin_anew(p, M, count)
        change_all(p, M.changed, count, 0)
        for number in range(1, FEW_SWEEPS + 1):
            left = sweep(p, M, count, number)[0]
    return left, sweeps + more, newtons, solved


@jitable
def move_farther(p: Points, M: Motion, count: int) -> None:
    """Fill velocities of bodies that joints or forces hold, and that have no points: v_free + r's.

    Until then they are v_free.
    """
    for k in range(count):
        if p.r[k, 0] != 0.0:
            apply_farther(p, k, M.v, (p.r[k, 0], p.r[k, 1], p.r[k, 2]))


@jitable
def project_positions(p: Points, shift: F2, count: int, h: float) -> int:
    """Change displacements over h so that no point ends deeper than its slop; return the sweeps.

    The least change in the norm of the mass: gap + h H_n shift >= 0 without friction, pushes start
    at 0. Where nothing ends so deep nothing changes. What begins deeper than its group goes in the
    step, as a deck may begin or a short step, comes out by no more than that: a jump in positions
    is no motion that a shorter step would find.
    """
    for k in range(count):
        p.push[k] = 0.0
    sweeps, worst = 0, math.inf
    while sweeps < MOST_SWEEPS and worst > 1.0:
        worst = 0.0
        for step in range(count):
            k = count - 1 - step if sweeps % 2 == 1 else step
            gap = max(p.gap[k], -h * p.speed[k]) + h * velocity_of(p, k, 0, shift)
            if gap >= -0.5 * p.slop[k] and p.push[k] == 0.0:
                continue
            along = p.given[k, ALONG]
            wanted = p.push[k] - gap * along / h if along > 0.0 else 0.0
            change = max(wanted, 0.0) - p.push[k]
            p.push[k] += change
            apply(p, k, shift, (change, 0.0, 0.0))
            worst = max(worst, abs(change) * p.given[k, W_NN] * h / p.slop[k])
        sweeps += 1
    for k in range(count):
        if p.push[k] != 0.0:
            apply_farther(p, k, shift, (p.push[k], 0.0, 0.0))
    return sweeps

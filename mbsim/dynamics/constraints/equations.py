"""Constraint equations that the tree does not hold: their rows, and the multipliers they need.

An equation g(q, t) = 0 is a sum of terms less a function of TIME or of the state, an expression, or
a user's relation of terms. For each its residual, the
rate G V - dg/dt and what of the second rate follows from velocities alone are taken; a term's
gradient is a wrench on the bodies of its markers. The tree answers a unit multiplier of equation
r with accelerations T G_r', and A = G T G' says how equations act on each other, so

    A lambda = -(gamma + G a),   a: accelerations of the tree without multipliers.

A is factored within its skyline: equations on different trees do not meet.
"""

from __future__ import annotations

import math

import numpy as np

from mbsim.arrays.codes import (
    ANGLE,
    ASKED,
    AXIS_I,
    AXIS_J,
    FOLD_POWER,
    GENERAL,
    HIGHER_PAIR,
    KEPT,
    KEPT_PIVOT,
    OFFSET,
    PAIR_RATE,
    PAIR_SECOND,
    PAIR_VALUE,
    PERP,
    PIVOT,
    TOUCHING,
    TWIST,
    USUAL,
    WHOLE,
)
from mbsim.arrays.hooks import Hook, Loops, Sticking, answer_of, note_failure
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int
from mbsim.core.arrays import F1, F2, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import cross, dot, vector
from mbsim.dynamics.constraints.folding import SAMPLED, is_sticking, near_fold, passes_fold
from mbsim.dynamics.constraints.in_use import active_count, is_friction
from mbsim.dynamics.constraints.terms import (
    angle_term,
    distance_term,
    general_term,
    offset_term,
    perp_term,
    touching_term,
    twist_term,
)
from mbsim.dynamics.constraints.tree import load, respond
from mbsim.dynamics.expressions.jets import jet

# columns of `Sweep.rate`
RESIDUAL, MISMATCH, GAMMA, FLOW = range(4)

#: Pivots of this part are none: there an equation fades out.
NAUGHT = 1e-8


@jitable
def higher_pair_of(scene: Scene, e: int) -> int:
    """Return the first term of the higher pair that equation e is of, -1 for none."""
    k = scene.equations.first[e]
    first = k - scene.equations.axis[k, AXIS_I]
    return first if scene.equations.kind[k] == HIGHER_PAIR else -1


@jitable
def fill_equation(scene: Scene, t: float, y: F1, e: int) -> None:
    """Fill gradient, residual and rates of equation e."""
    fill_terms(scene, t, y, e, 1)


@jitable
def plain_term(scene: Scene, y: F1, k: int, anew: int) -> V3:
    """Return value, rate and second rate of a term of poses alone, and fill its gradient."""
    eq, sweep = scene.equations, scene.sweep
    i, j, kind, G = eq.i[k], eq.j[k], eq.kind[k], sweep.G[k]
    if kind == OFFSET:
        return offset_term(scene, y, i, j, eq.axis[k, AXIS_J], G)
    if kind == PERP:
        return perp_term(scene, y, i, j, eq.axis[k, AXIS_I], eq.axis[k, AXIS_J], G)
    if kind == ANGLE:
        return angle_term(scene, y, i, j, eq.angle[k], G)
    if kind == TWIST:
        return twist_term(scene, y, i, j, G)
    if kind == HIGHER_PAIR:
        call_int(scene.world.hooks[Hook.HIGHER_PAIRS], (scene, k, anew, y))
        return sweep.pair[PAIR_VALUE], sweep.pair[PAIR_RATE], sweep.pair[PAIR_SECOND]
    return distance_term(scene, y, i, j, G)


@jitable
def fill_terms(scene: Scene, t: float, y: F1, e: int, anew: int) -> None:
    """Do the same; with `anew` 0 a higher pair touches where its equation before this found."""
    eq, sweep = scene.equations, scene.sweep
    value, flow, second, moved = -eq.constant[e], 0.0, 0.0, 0.0
    for k in range(eq.first[e], eq.first[e + 1]):
        i, j, factor, G = eq.i[k], eq.j[k], eq.factor[k], sweep.G[k]
        kind = eq.kind[k]
        if kind == GENERAL:
            moved += general_term(scene, t, y, i, eq.program[e], factor, G)
            continue
        if kind == TOUCHING:
            flow, second = touching_term(scene, y, i, j, eq.axis[k, AXIS_I], eq.axis[k, AXIS_J], G)
            continue
        g, dg, ddg = plain_term(scene, y, k, anew)
        if eq.user[e] > 0:
            of_term = sweep.related[k - eq.first[e]]
            of_term[PAIR_VALUE], of_term[PAIR_RATE], of_term[PAIR_SECOND] = g, dg, ddg
        value += factor * g
        flow += factor * dg
        second += factor * ddg
        if factor != 1.0:
            for c in range(12):
                G[c] *= factor
    if eq.user[e] > 0:
        note_failure(scene, call_int(scene.world.hooks[Hook.RELATIONS], (scene, t, y, e)))
        value, flow = sweep.pair[PAIR_VALUE], sweep.pair[PAIR_RATE]
        second = sweep.pair[PAIR_SECOND]
    rate = flow
    if eq.program[e] >= 0:
        f, df, ddf = jet(scene, t, y, eq.program[e])
        if eq.general[e] == WHOLE:
            value, rate, second = value + f, df, second + ddf
        elif eq.level[e] == 2:
            value, rate, second = value - f, rate - df, second - ddf
        elif eq.level[e] == 1:
            rate, second = rate - f, second - df
        else:
            second -= f
    sweep.rate[e, RESIDUAL] = value
    sweep.rate[e, MISMATCH] = rate
    sweep.rate[e, GAMMA] = second
    sweep.rate[e, FLOW] = flow + moved


def lasting(scene: Scene) -> np.ndarray:
    """Return which equations are of no friction, and of elements that take part, (ne,)."""
    equations = scene.equations
    return np.asarray((equations.dry < 0) & (equations.slot < 0) & (equations.off == 0))


@jitable
def fill_equations(scene: Scene, t: float, y: F1) -> None:
    """Fill gradient, residual and rates of the equations in use."""
    if scene.world.hooks[Hook.STICKING] != 0:
        answer_of(scene, call_int(scene.world.hooks[Hook.STICKING], (scene, Sticking.LOCATE, t, y)))
    before = -1
    for r in range(active_count(scene)):
        e = scene.equations.active[r]
        pair = higher_pair_of(scene, e)
        fill_terms(scene, t, y, e, 0 if pair >= 0 and pair == before else 1)
        before = pair


@jitable
def tree_index(scene: Scene, m: int) -> int:
    """Return the tree index of the body of marker m, -1 for none."""
    return scene.tree.of_body[scene.markers.body[m]]


@jitable
def add_wrench(scene: Scene, e: int, factor: float) -> None:
    """Take `factor` times the gradient of equation e from the forces p: it acts on the bodies."""
    eq, sweep = scene.equations, scene.sweep
    for k in range(eq.first[e], eq.first[e + 1]):
        for side in range(2):
            index = tree_index(scene, eq.i[k] if side == 0 else eq.j[k])
            if index >= 0:
                for c in range(6):
                    sweep.p[index, c] -= factor * sweep.G[k, 6 * side + c]


@jitable
def along(scene: Scene, e: int, motion: F2, stamp: int) -> float:
    """Return G_e times the spatial motions of all bodies of the tree.

    With stamp >= 0 only trees whose root carries that mark count.
    """
    eq, sweep, total = scene.equations, scene.sweep, 0.0
    for k in range(eq.first[e], eq.first[e + 1]):
        for side in range(2):
            index = tree_index(scene, eq.i[k] if side == 0 else eq.j[k])
            if index < 0 or (stamp >= 0 and sweep.mark[scene.tree.root[index]] != stamp):
                continue
            for c in range(6):
                total += sweep.G[k, 6 * side + c] * motion[index, c]
    return total


@jitable
def answer(scene: Scene, e: int, stamp: int) -> None:
    """Fill `answer` of the trees that equation e acts on with what a unit multiplier causes."""
    eq, sweep, tree = scene.equations, scene.sweep, scene.tree
    for k in range(eq.first[e], eq.first[e + 1]):
        for side in range(2):
            index = tree_index(scene, eq.i[k] if side == 0 else eq.j[k])
            if index >= 0 and sweep.mark[tree.root[index]] != stamp:
                root = tree.root[index]
                sweep.mark[root] = stamp
                for q in range(root, tree.end[root]):
                    for c in range(6):
                        sweep.p[q, c] = 0.0
    add_wrench(scene, e, 1.0)
    for k in range(eq.first[e], eq.first[e + 1]):
        for side in range(2):
            index = tree_index(scene, eq.i[k] if side == 0 else eq.j[k])
            if index < 0:
                continue
            root = tree.root[index]
            # a tree that two terms act on answers once: its mark says so
            if sweep.mark[root] == stamp:
                respond(scene, root, tree.end[root], 0, sweep.answer)
                sweep.mark[root] = -2 - stamp
    for k in range(eq.first[e], eq.first[e + 1]):
        for side in range(2):
            index = tree_index(scene, eq.i[k] if side == 0 else eq.j[k])
            if index >= 0:
                sweep.mark[tree.root[index]] = stamp


@jitable
def fill_matrix(scene: Scene) -> None:
    """Fill the lower part of A for the equations in use, within the skyline."""
    sweep, active = scene.sweep, scene.equations.active
    n = active_count(scene)
    for k in range(len(sweep.mark)):
        sweep.mark[k] = -1
    for r in range(n):
        answer(scene, active[r], r)
        for s in range(r, n):
            if sweep.skyline[s] <= r:
                sweep.A[s, r] = along(scene, active[s], sweep.answer, r)


@jitable
def pivot_of(scene: Scene, t: float, e: int, left: float, passing: bool) -> float:
    """Return the root of the pivot of equation e, of which so much is left; note the least.

    A pivot d stands as d (1 + 1/x^8), x being d over a part of the usual ones: itself where d
    is large, infinite where it is 0, smooth between.
    """
    quality, size = scene.sweep.quality, scene.sweep.size[e] ** 2
    released = passing and not is_sticking(scene, e, t)
    if not released:
        quality[PIVOT] = min(quality[PIVOT], left / size)
    part = left / (NAUGHT * quality[USUAL] * size) if quality[USUAL] > 0.0 else math.inf
    if part < 1e-4 or released:
        return math.inf
    return math.sqrt(left * (1.0 + 1.0 / part**8) if part < 100.0 else left)


@jitable
def factor_matrix(scene: Scene, t: float) -> None:
    """Replace A by L, A = L L'; an equation that those before it imply gets no multiplier."""
    A, first, n = scene.sweep.A, scene.sweep.skyline, active_count(scene)
    passing = passes_fold(scene, t)
    scene.sweep.quality[PIVOT] = 1.0
    for i in range(n):
        e = scene.equations.active[i]
        for j in range(first[i], i + 1):
            total = A[i, j]
            for k in range(max(first[i], first[j]), j):
                total -= A[i, k] * A[j, k]
            A[i, j] = total / A[j, j] if j < i else pivot_of(scene, t, e, total, passing)


@jitable
def solve_matrix(scene: Scene) -> None:
    """Return the multipliers of `rhs`, by the equations in use."""
    sweep = scene.sweep
    A, first, x, n = sweep.A, sweep.skyline, sweep.multiplier, active_count(scene)
    for i in range(n):
        total = sweep.rhs[i]
        for k in range(first[i], i):
            total -= A[i, k] * x[k]
        x[i] = total / A[i, i]
    for i in range(n - 1, -1, -1):
        x[i] /= A[i, i]
        for k in range(first[i], i):
            x[k] -= A[i, k] * x[i]


@jitable
def factor_equations(scene: Scene, t: float) -> None:
    """Make ready to solve for multipliers: of the equations in use, or of whole loops."""
    if scene.graph.in_use[0] == 1:
        call_int(scene.world.hooks[Hook.LOOPS], (scene, Loops.FACTOR, t, scene.sweep.rhs))
    else:
        fill_matrix(scene)
        factor_matrix(scene, t)


@jitable
def solve_equations(scene: Scene) -> None:
    """Return the multipliers of `rhs`, by the equations in use."""
    if scene.graph.in_use[0] == 1:
        call_int(scene.world.hooks[Hook.LOOPS], (scene, Loops.SOLVE, 0.0, scene.sweep.rhs))
    else:
        solve_matrix(scene)


@jitable
def hold(scene: Scene, t: float, y: F1) -> None:
    """Fill the accelerations of all bodies of the tree under joints and equations."""
    load(scene)
    respond(scene, 0, len(scene.tree.body), 1, scene.sweep.a)
    if active_count(scene) == 0:
        return
    fill_equations(scene, t, y)
    factor_equations(scene, t)
    impose(scene, t)


@jitable
def restick(scene: Scene, t: float) -> None:
    """Fill the accelerations anew after forces changed; all else is as `hold` left it."""
    load(scene)
    respond(scene, 0, len(scene.tree.body), 1, scene.sweep.a)
    if active_count(scene) > 0:
        impose(scene, t)


@jitable
def impose(scene: Scene, t: float) -> None:
    """Bend accelerations of the tree alone to those that the equations allow."""
    sweep, active = scene.sweep, scene.equations.active
    nt, n = len(scene.tree.body), active_count(scene)
    for r in range(n):
        e = active[r]
        sweep.rhs[r] = -sweep.rate[e, GAMMA] - along_motion(scene, e)
    solve_equations(scene)
    # what is foreseen stands in for what equations that are released no longer ask for
    ahead = passes_fold(scene, t)
    if ahead:
        foresee(scene, t)
        for r in range(n):
            sweep.wanted[r] = sweep.multiplier[r]
            sweep.rhs[r] = along(scene, active[r], sweep.answer, -1)
        solve_equations(scene)
    load(scene)
    for r in range(n):
        if ahead:
            add_wrench(scene, active[r], sweep.wanted[r] - sweep.multiplier[r])
            sweep.multiplier[r] = sweep.wanted[r]
        else:
            add_wrench(scene, active[r], sweep.multiplier[r])
    respond(scene, 0, nt, 1, sweep.a)
    if ahead:
        for p in range(nt):
            for c in range(6):
                sweep.a[p, c] += sweep.answer[p, c]


@jitable
def power_of_equations(scene: Scene) -> float:
    """Return the power of what moves with time: multiplier times the rate of its equation's sum."""
    sweep, power = scene.sweep, 0.0
    for r in range(active_count(scene)):
        e = scene.equations.active[r]
        if not is_friction(scene, e):
            power += sweep.multiplier[r] * sweep.rate[e, FLOW]
    return power


@jitable
def foresee(scene: Scene, t: float) -> None:
    """Fill `answer` with what multipliers do to accelerations, if that goes on as it did.

    It goes on as the polynomial through what was kept does (Lagrange's form).
    """
    sweep, nt = scene.sweep, len(scene.tree.body)
    count, when = int(sweep.quality[KEPT]), sweep.kept_at
    sweep.quality[FOLD_POWER] = 0.0
    for p in range(nt):
        for c in range(6):
            sweep.answer[p, c] = 0.0
    for i in range(count):
        part = 1.0
        for j in range(count):
            if j != i:
                part *= (t - when[j]) / (when[i] - when[j])
        sweep.quality[FOLD_POWER] += part * sweep.kept_power[i]
        for p in range(nt):
            for c in range(6):
                sweep.answer[p, c] += part * sweep.kept_a[i, p, c]


@jitable
def keep_accelerations(scene: Scene, t: float) -> None:
    """Keep what multipliers do to accelerations at the committed state.

    Their square, in the norm of the inertia, is w = m' A m. Where a loop passes through a fold it
    stays as it is while the least pivot d falls; where the loop cannot be closed beyond, what is
    asked of it stays, and w grows as 1/d at least. From 1/sqrt(d) on nothing is foreseen.
    """
    sweep, nt, most = scene.sweep, len(scene.tree.body), len(scene.sweep.kept_at)
    quality, when = sweep.quality, sweep.kept_at
    count = int(quality[KEPT])
    if count > 0 and not (t > when[0] and quality[PIVOT] < quality[KEPT_PIVOT]):
        count = 0
    if count > 0 and quality[PIVOT] > SAMPLED * quality[KEPT_PIVOT]:
        # too near to tell how they change
        return
    for i in range(min(count, most - 1), 0, -1):
        when[i], sweep.kept_power[i] = when[i - 1], sweep.kept_power[i - 1]
        for p in range(nt):
            for c in range(6):
                sweep.kept_a[i, p, c] = sweep.kept_a[i - 1, p, c]
    when[0], sweep.kept_power[0] = t, power_of_equations(scene)
    for p in range(nt):
        for c in range(6):
            sweep.p[p, c] = 0.0
    for r in range(active_count(scene)):
        add_wrench(scene, scene.equations.active[r], sweep.multiplier[r])
    respond(scene, 0, nt, 0, sweep.answer)
    for p in range(nt):
        for c in range(6):
            sweep.kept_a[0, p, c] = sweep.answer[p, c]
    square = 0.0
    for r in range(active_count(scene)):
        along_answer = along(scene, scene.equations.active[r], sweep.answer, -1)
        square += sweep.multiplier[r] * along_answer
    asked, fell = square * math.sqrt(quality[PIVOT]), quality[PIVOT] < quality[KEPT_PIVOT]
    if near_fold(scene) and fell and asked > quality[ASKED]:
        count = 0
    quality[ASKED], quality[KEPT_PIVOT] = asked, quality[PIVOT]
    quality[KEPT] = min(count + 1, most)


@jitable
def along_motion(scene: Scene, e: int) -> float:
    """Return G_e times the accelerations, less what G_e takes of velocities.

    The gradient acts on (alpha, a_cg) as a wrench about the cg does; about O the linear part of
    the spatial acceleration lacks w x v, which is a force's arm on velocities.
    """
    eq, sweep, total = scene.equations, scene.sweep, 0.0
    for k in range(eq.first[e], eq.first[e + 1]):
        for side in range(2):
            index = tree_index(scene, eq.i[k] if side == 0 else eq.j[k])
            if index < 0:
                continue
            b = scene.tree.body[index]
            G = sweep.G[k, 6 * side : 6 * side + 6]
            for c in range(6):
                total += G[c] * sweep.a[index, c]
            total += dot(
                (G[3], G[4], G[5]), cross(vector(scene.work.w[b]), vector(scene.work.v[b]))
            )
    return total

"""Which equations are used where some follow from others (a loop of revolutes in a plane).

The matrix A of all equations, each divided by what it would be if the bodies were free, is
factored with the largest pivot first; what has no pivot left is implied. The choice is kept while
its least pivot holds up: off the manifold implied equations differ from what implies them, so a
choice that changed within a step would be a switch.
"""

from __future__ import annotations

import math

from mbsim.arrays.codes import (
    AT_FAULT,
    CHOSEN,
    FOLDS,
    KEPT,
    KEPT_PIVOT,
    NEAR_FOLD,
    PIVOT,
    PIVOT_THEN,
    SLIDER,
    SLIDER_BEFORE,
    SLIDES,
    SLIDES_BEFORE,
    USUAL,
    WITHIN,
)
from mbsim.arrays.hooks import Hook, Loops
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int
from mbsim.core.arrays import F1, F2, I1
from mbsim.core.codes import Code
from mbsim.core.jitable import jitable
from mbsim.core.rotation import cross, dot, sub, vector
from mbsim.dynamics.constraints.equations import (
    RESIDUAL,
    factor_equations,
    fill_equation,
    fill_equations,
    fill_matrix,
    keep_accelerations,
    tree_index,
)
from mbsim.dynamics.constraints.folding import leave_fold, near_fold, watch_fold
from mbsim.dynamics.constraints.in_use import active_count, is_active, is_friction, is_off
from mbsim.laws.catalog import STICK
from mbsim.laws.friction.stiction import KEPT_MODE

#: What `keep_selection` returns where a fold was left behind.
LEFT = -1
#: What at most is left of an equation that others imply, as part of its size for free bodies.
IMPLIED = 1e-12
#: The same of friction at contact points. Those of a flat face lie in a plane but for their depths;
#: holding by lever arms of that size would take forces far above any limit.
LEVER = 1e-4
#: A choice is made anew when its least pivot falls below this part of what it was.
_WORN = 0.1
#: Another choice is better if its least pivot makes up for half of that.
_BETTER = 2.0
#: Residual of an implied equation, over its unit, from which it is asked whether it still is
#: implied, as in a position that folds it is, and from which it contradicts the others.
_DOUBT, _APART = 1e-11, 1e-6


@jitable
def fill_size(scene: Scene, e: int) -> None:
    """Fill the square root of what A would have for equation e if the bodies were free."""
    eq, sweep, total = scene.equations, scene.sweep, 0.0
    for k in range(eq.first[e], eq.first[e + 1]):
        for side in range(2):
            index = tree_index(scene, eq.i[k] if side == 0 else eq.j[k])
            if index < 0:
                continue
            b = scene.tree.body[index]
            G = sweep.G[k, 6 * side : 6 * side + 6]
            force = (G[3], G[4], G[5])
            torque = sub((G[0], G[1], G[2]), cross(vector(sweep.arm[index]), force))
            J = scene.bodies.inertia[b]
            total += dot(force, force) / scene.bodies.mass[b]
            total += dot(torque, torque) / (J[0, 0] + J[1, 1] + J[2, 2])
    sweep.size[e] = math.sqrt(total) if total > 0.0 else 1.0


@jitable
def share_tree(scene: Scene, e: int, f: int) -> bool:
    """Return whether two equations act on bodies of one tree."""
    eq, root = scene.equations, scene.tree.root
    for k in range(eq.first[e], eq.first[e + 1]):
        for s in range(2):
            index = tree_index(scene, eq.i[k] if s == 0 else eq.j[k])
            if index < 0:
                continue
            for q in range(eq.first[f], eq.first[f + 1]):
                for u in range(2):
                    other = tree_index(scene, eq.i[q] if u == 0 else eq.j[q])
                    if other >= 0 and root[other] == root[index]:
                        return True
    return False


@jitable
def fill_skyline(scene: Scene) -> None:
    """Set where the rows of the matrix of the equations in use begin."""
    active = scene.equations.active
    for r in range(active_count(scene)):
        first = 0
        while first < r and not share_tree(scene, active[first], active[r]):
            first += 1
        scene.sweep.skyline[r] = first
    if scene.world.hooks[Hook.LOOPS] != 0:
        call_int(scene.world.hooks[Hook.LOOPS], (scene, Loops.WEIGH, 0.0, scene.sweep.rhs))


@jitable
def sticks(scene: Scene, e: int) -> bool:
    """Return whether equation e is of friction that sticks at the point being evaluated."""
    s = scene.equations.slot[e]
    if s >= 0:
        if scene.world.past[0] == WITHIN:
            return scene.state.before[s, KEPT_MODE] == STICK and scene.state.touching[s] == 1
        return scene.state.memory[s, KEPT_MODE] == STICK
    f = scene.equations.dry[e]
    if f < 0:
        return False
    kept = scene.state.dry[f]
    if scene.world.past[0] == WITHIN:
        return kept[SLIDER_BEFORE] == 0.0 and kept[SLIDES_BEFORE] == 0.0
    return kept[SLIDER] == 0.0 and kept[SLIDES] == 0.0


@jitable
def use_all(scene: Scene, sticking: int) -> None:
    """Take all equations into use, of friction those that stick if that is wanted, or none."""
    active, count = scene.equations.active, 0
    n = len(active) - 1
    for e in range(n):
        if is_off(scene, e):
            continue
        if not is_friction(scene, e) or (sticking == 1 and sticks(scene, e)):
            active[count] = e
            count += 1
    active[n] = count
    fill_skyline(scene)


@jitable
def may_be_chosen(scene: Scene, e: int, pivot: float, friction: int) -> bool:
    """Return whether equation e with what is left of it may be chosen; 1: friction may, too."""
    if not is_friction(scene, e):
        return True
    return friction == 1 and (scene.equations.slot[e] < 0 or pivot > LEVER)


@jitable
def take_out(A: F2, best: int, active: I1, n: int) -> None:
    """Take an equation that is chosen out of those that are not."""
    for r in range(n):
        if active[r] < 0 and A[r, best] != 0.0:
            part = A[r, best] / A[best, best]
            for s in range(n):
                A[r, s] -= part * A[best, s]


@jitable
def use_chosen(scene: Scene, n: int) -> None:
    """Take those of n equations into use that are not below 0."""
    active, count = scene.equations.active, 0
    for r in range(n):
        if active[r] >= 0:
            active[count] = active[r]
            count += 1
    active[len(active) - 1] = count
    fill_skyline(scene)


@jitable
def choose(scene: Scene, t: float, y: F1) -> None:
    """Choose equations that are independent at y, where the tree has been prepared.

    Friction holds what nothing else does: it is asked last.
    """
    sweep, active = scene.sweep, scene.equations.active
    use_all(scene, 1)
    n = active_count(scene)
    fill_equations(scene, t, y)
    fill_matrix(scene)
    A = sweep.A
    for r in range(n):
        fill_size(scene, active[r])
    for r in range(n):
        for s in range(r + 1):
            size = sweep.size[active[r]] * sweep.size[active[s]]
            A[r, s] = A[s, r] = A[r, s] / size if s >= sweep.skyline[r] else 0.0
    # what is not chosen is below 0
    for r in range(n):
        active[r] = -1 - active[r]
    least, count, friction = 1.0, 0, 0
    while count < n:
        best, pivot = -1, 0.0
        for r in range(n):
            waits = active[r] < 0 and may_be_chosen(scene, -1 - active[r], A[r, r], friction)
            if waits and A[r, r] > 1.001 * pivot:
                best, pivot = r, A[r, r]
        if best < 0 or pivot <= IMPLIED:
            if friction == 1:
                break
            friction = 1
            continue
        active[best] = -1 - active[best]
        least = min(least, pivot)
        count += 1
        take_out(A, best, active, n)
    use_chosen(scene, n)
    if scene.graph.in_use[0] == 1:
        # its pivots are larger: joints that come later do not hold yet
        factor_equations(scene, t)
        least = sweep.quality[PIVOT]
    sweep.quality[CHOSEN] = least
    sweep.quality[USUAL] = max(sweep.quality[USUAL], least)


@jitable
def implied_residual(scene: Scene, t: float, y: F1) -> tuple[float, int]:
    """Return the largest residual of the equations not in use, over its unit, and whose it is."""
    largest, worst = 0.0, -1
    for e in range(len(scene.equations.active) - 1):
        waits = not is_active(scene, e) and not is_off(scene, e)
        if waits and scene.equations.level[e] == 2:
            fill_equation(scene, t, y, e)
            size = abs(scene.sweep.rate[e, RESIDUAL]) / scene.equations.unit[e]
            if not size <= largest:
                largest, worst = size, e
    return largest, worst


@jitable
def choose_better(scene: Scene, t: float, y: F1, least: float) -> None:
    """Choose anew, and keep to what was chosen if no other equations are better than those.

    `least` is their least pivot. Where a loop can fold it vanishes whatever is chosen.
    """
    active, chosen, last = scene.equations.active, scene.sweep.chosen, len(scene.sweep.chosen) - 1
    for r in range(last + 1):
        chosen[r] = active[r]
    choose(scene, t, y)
    worse = _BETTER * scene.sweep.quality[CHOSEN] < least / _WORN
    if active[last] < chosen[last] or (active[last] == chosen[last] and worse):
        for r in range(last + 1):
            active[r] = chosen[r]
        fill_skyline(scene)
    # how near a fold is goes by the pivots of what is in use
    quality = scene.sweep.quality
    fill_equations(scene, t, y)
    factor_equations(scene, t)
    if quality[PIVOT_THEN] > 0.0:
        quality[KEPT_PIVOT] *= quality[PIVOT] / quality[PIVOT_THEN]
        quality[PIVOT_THEN] = quality[PIVOT]


@jitable
def renew_selection(scene: Scene, t: float, y: F1) -> int:
    """Choose anew where the choice has worn; return 0, or a code if implied equations fail."""
    sweep, count = scene.sweep, active_count(scene)
    if count == 0:
        return 0
    least = sweep.quality[PIVOT]
    sweep.quality[NEAR_FOLD] = 1.0 if near_fold(scene) else 0.0
    if count == len(scene.equations.active) - 1:
        return 0
    apart, worst = implied_residual(scene, t, y)
    if apart > _DOUBT or least < _WORN * sweep.quality[CHOSEN]:
        choose_better(scene, t, y, least)
    if not apart <= _APART and active_count(scene) <= count:
        scene.work.diagnostics[AT_FAULT] = worst
        return Code.CONTRADICTION
    return 0


@jitable
def keep_selection(scene: Scene, t: float, y: F1) -> int:
    """Do the same, and look out for folds; return 0, or a code if implied equations fail.

    Or LEFT where a fold was left behind: what was released does not hold exactly then.
    """
    sweep = scene.sweep
    if active_count(scene) == 0:
        return 0
    if sweep.quality[FOLDS] == 1.0:
        return LEFT if leave_fold(scene, t) else 0
    sweep.quality[NEAR_FOLD] = 1.0 if near_fold(scene) else 0.0
    if sweep.quality[PIVOT] > sweep.quality[USUAL]:
        sweep.quality[KEPT] = 0.0
    else:
        keep_accelerations(scene, t)
    watch_fold(scene, t)
    return 0 if sweep.quality[FOLDS] == 1.0 else renew_selection(scene, t, y)

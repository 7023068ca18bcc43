"""The run's `commit` and `output`, which carry derivatives along.

Both are hooks of the run's problem in the place of its own, which they pass on to: a run without
sensitivities has nothing of this.
"""

from __future__ import annotations

import math

from mbsim.arrays.codes import NOW, WITHIN
from mbsim.arrays.hooks import Hook
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int, vector_at, view
from mbsim.core.arrays import F1, Pointer
from mbsim.core.codes import Code
from mbsim.core.jitable import jitable
from mbsim.core.problem import Problem, Taken
from mbsim.integrators.scheme import (
    EVALUATIONS,
    LAST_STEP,
    LAST_TIME,
    OWN_TIME,
    SHOWN,
    SWITCHED,
    TIME,
    Method,
    in_workspace,
)
from mbsim.sensitivity.along import project_end, remember_end, tell, value_within
from mbsim.sensitivity.arrays import (
    ALONG,
    ASKED,
    ATTEMPT,
    BEFORE,
    BENT,
    CHANGES,
    COMMIT,
    DOWN_SIDE,
    F_BEFORE,
    FIRST,
    FITTED,
    FOLLOWED,
    HIDES,
    JOINTS,
    LAST_ON,
    LAST_UNTIL,
    LENGTH,
    LINE_F,
    LINE_Y,
    LOST_FAILED,
    LOST_JUMP,
    LOST_LARGE,
    LOST_WORK,
    METHOD,
    MOST,
    ODD,
    ORDERED,
    OUTPUT,
    OWN,
    PLAIN,
    REMEMBERED,
    RHS,
    ROWS,
    SHOWN_AT,
    SHOWN_LATER,
    STEADY,
    STRAIGHT,
    TIMED,
    TWIN,
    UP,
    WORTH,
    Variations,
)
from mbsim.sensitivity.changes import is_bent, list_changes, order_changes, step_along
from mbsim.sensitivity.events import (
    SPAN,
    cross,
    list_asking,
    note_changed,
    note_jump,
    note_kept,
    note_shifts,
)
from mbsim.sensitivity.explicit import explicit_step, fit_beside, fit_path
from mbsim.sensitivity.generalised import fit_hermite, generalised_step, note_along
from mbsim.sensitivity.hidden import find_hidden
from mbsim.sensitivity.implicit import implicit_step
from mbsim.sensitivity.later import UNKNOWN, add, add_motion, give_up, go_on, is_steady, pays
from mbsim.sensitivity.reintegration import hold, make_sure
from mbsim.sensitivity.stretches import is_too_much
from mbsim.sensitivity.timed import begin_unseen, clear_time, look_behind, make_room
from mbsim.sensitivity.twin import (
    acts,
    feel,
    half_step,
    is_deep,
    keep_unit,
    one_side,
    reach_of,
    set_parameter,
    step_along_motion,
)

#: Where the packed `Variations` stand: where those of MOREAU would, which takes no part in this.
AT = Hook.STEPPING
#: A parameter that moves bodies by their usual sizes when it changes by 1e-9 of itself moves them
#: by chance.
LARGEST = 1e9
#: Where so many steps in a row bend the method's own is not tried any more but now and then.
OFTEN, NOW_AND_THEN = 3, 8
#: What derivatives may take is counted from so many evaluations of the run on.
AT_FIRST = 200


@jitable
def lose(V: Variations, k: int, t: float, why: int) -> None:
    """Know derivative k no more from time t on: nothing of it is carried along."""
    if V.lost[k] == math.inf:
        V.lost[k] = t
        V.why[k] = why
    for table in (V.d, V.next, V.kept):
        table[k, :] = 0.0
    for tables in (V.memory, V.before, V.end, V.dense):
        tables[k, :, :] = 0.0
    V.bends[k] = 0
    V.later[k, :] = 0.0


@jitable
def lose_behind(V: Variations, k: int, t: float, why: int) -> None:
    """Know derivative k no more from the end of a step on, at time t: rows within it are known."""
    if V.lost[k] == math.inf:
        V.lost[k] = t
        V.why[k] = why
    V.d[k, :] = 0.0
    for tables in (V.memory, V.before, V.end):
        tables[k, :, :] = 0.0


@jitable
def follow(V: Variations, scene: Scene, m: Method, t: float, h: float) -> int:
    """Fill the polynomial of the run's step, once for all parameters; return a code."""
    if V.words[FOLLOWED] == 1:
        return 0
    V.words[FOLLOWED] = 1
    if V.words[ATTEMPT] != 0:
        return fit_path(V, scene, m, t, h)
    if V.words[ALONG] == 1:
        fit_hermite(V, m, h)
        return 0
    for i in range(len(m.y)):
        V.path[0, i] = m.y[i]
        for j in range(3):
            V.path[1 + j, i] = m.ahead[j, i]
    return 0


@jitable
def own_step(V: Variations, scene: Scene, m: Method, t: float, h: float, k: int) -> int:
    """Fill derivative k at the end of the step as the run's method has it; return a code."""
    if V.close[k] == 1:
        # next to a jump of time: along the motion all that is evaluated keeps clear of it
        V.error[k] = math.inf
        return 0
    if V.words[ATTEMPT] != 0:
        if V.words[CHANGES] > 0 or (V.bent[k] >= OFTEN and V.bent[k] % NOW_AND_THEN != 0):
            V.error[k] = math.inf
            return 0
        return explicit_step(V, scene, m, t, h, k)
    if V.words[ALONG] == 1:
        code = generalised_step(V, scene, m, t, h, k)
    else:
        code = implicit_step(V, scene, m, t, h, k)
    if code == Code.NOT_CONVERGED:
        # with an old linearisation, where forces bend: not so along the motion
        V.error[k], code = math.inf, 0
    return code


@jitable
def bent_step(
    V: Variations, scene: Scene, m: Method, t: float, h: float, k: int, changes: bool
) -> int:
    """Fill derivative k, which is in `own`, at the end of a step in which forces bend."""
    if V.words[ALONG] == 0:
        V.smooth[k] = V.told[k] = 0
    if changes:
        V.ready[k] = 0
    if V.words[ORDERED] == 0:
        V.words[ORDERED] = 1
        if V.words[CHANGES] > 0:
            is_steady(V, scene, m, t, h)
        if not order_changes(V, scene, t, h):
            return Code.NOT_CONVERGED
    for i in range(len(m.y)):
        V.next[k, i] = V.own[i]
    e = step_along_motion(V, k)
    goes_on, later, V.parts[k] = V.words[ALONG] == 1, V.later[k, LAST_UNTIL], 0
    code, V.later[k, LAST_ON] = step_along(V, scene, t, h, k, (0.0, 1.0), goes_on, later)
    if not goes_on and not changes:
        tell(V, k)
    if code == 0 and V.words[JOINTS] == 1 and V.close[k] == 0:
        # next to a jump sides would be put where motions have them at another time
        code = project_end(V, scene, m, t + h, k, e)
    if V.words[ALONG] == 1 and not changes:
        note_along(V, h, k)
    unknown = changes or not V.error[k] < math.inf
    if code == 0 and (V.words[REMEMBERED] > 0 or unknown):
        code = remember_end(V, scene, m, t, h, k, e)
        V.reach[k] = reach_of(V, 2.0 * e, DOWN_SIDE)
    return code


@jitable
def carry(V: Variations, scene: Scene, m: Method, t: float, h: float, k: int) -> int:
    """Fill derivative k at the end of the step that is taken; return a code.

    In its place is D + s f meanwhile, where a touch begins later by s (`later`).
    """
    for s in range(len(V.seen)):
        V.seen[s] = 0
    if V.words[CHANGES] > 0:
        V.reach[k] = 0.0
    go_on(V, scene, m, t, h, k)
    later, d = V.later[k, LAST_UNTIL], V.d[k]
    for i in range(len(d)):
        V.own[i] = d[i]
    add(d, m.k[0], later)
    make_room(V, k, t, h)
    deep = V.words[ATTEMPT] != 0 and is_deep(V, k)
    e = half_step(V, k) if deep else one_side(V, m, k)
    code = own_step(V, scene, m, t, h, k)
    add(V.next[k], V.jump[F_BEFORE], -later)
    if code == 0:
        changes = V.words[CHANGES] > 0 or is_bent(V, scene)
        bends = changes or V.error[k] > V.enough[0]
        if changes:
            V.reach[k] = 0.0
        elif V.error[k] < math.inf:
            V.reach[k] = reach_of(V, e, OWN)
        V.bends[k] = 1 if bends else 0
        V.bent[k] = V.bent[k] + 1 if bends and not changes else 0
        V.words[BENT] += V.bends[k]
        shown = m.memory[SHOWN] == 1.0 and V.words[ATTEMPT] != 0
        # with the step of the differences that were taken: `reach` is the next one's
        if shown and not bends and deep:
            # before `follow`, which takes the place of one side
            code = fit_beside(V, scene, t, h, k, e, deep)
        if code == 0 and (bends or later != 0.0 or shown):
            code = follow(V, scene, m, t, h)
        if code == 0 and shown and not bends and not deep:
            code = fit_beside(V, scene, t, h, k, e, deep)
        if code == 0 and bends:
            code = bent_step(V, scene, m, t, h, k, changes)
    for i in range(len(d)):
        d[i] = V.own[i]
    return code


@jitable
def take_step(V: Variations, scene: Scene, m: Method, t: float, h: float) -> None:
    """Carry all derivatives over the step from t that is taken."""
    twin = view(V.words[TWIN], Scene)
    V.words[CHANGES] = V.words[ORDERED] = V.words[PLAIN] = V.words[FOLLOWED] = 0
    V.words[STEADY] = UNKNOWN
    if V.words[REMEMBERED] > 0:
        feel(V, scene)
    touches = scene.work.hit[len(scene.work.hit) - 1] > 0
    V.words[MOST] = V.words[WORTH] * len(V.size) * (m.counts[EVALUATIONS] + AT_FIRST)
    listed = len(scene.contacts.id) == 0 or list_changes(V, scene, t, h)
    V.words[FITTED] = 1 if m.memory[SHOWN] == 1.0 or V.words[ATTEMPT] == 0 else 0
    for k in range(len(V.size)):
        if V.lost[k] < math.inf:
            lose(V, k, t, V.why[k])
            continue
        if is_too_much(V):
            lose(V, k, t, LOST_WORK)
            continue
        V.words[ODD] = 0
        if not listed or carry(V, scene, m, t, h, k) != 0:
            lose(V, k, t, LOST_WORK if is_too_much(V) else LOST_FAILED)
        elif V.words[REMEMBERED] > 0 and V.words[ODD] == 1:
            if not note_kept(V, scene, t + h, V.line[0], k):
                lose(V, k, t + h, LOST_JUMP)
        if not (touches and pays(V, V.jump[F_BEFORE], k)):
            give_up(V, k)
        set_parameter(V, twin, scene, k, 0.0)


def rhs_hook(context: int, t: float, h: float, a: Pointer, b: Pointer) -> int:
    """F of the twin, and which slots touch there."""
    twin = view(context, Scene)
    V = view(twin.world.hooks[AT], Variations)
    if V.words[TIMED] == 1:
        t = clear_time(V, t)
    code = call_int(V.words[RHS], (context, t, h, a, b))
    V.words[ASKED] += 1
    hit, last = twin.work.hit, len(twin.work.hit) - 1
    for j in range(hit[last]):
        V.seen[hit[j]] += acts(V, twin, hit[j])
    V.seen[last] += 1
    return code


@jitable
def take_over(V: Variations, t: float, n: int, anew: bool, hops: bool) -> None:
    """Let what was found at the end of a step be committed; `reason` says what is not known."""
    for k in range(len(V.size)):
        if anew:
            V.smooth[k] = V.ready[k] = V.told[k] = 0
        for s in range(V.memory.shape[1]):
            for j in range(V.memory.shape[2]):
                V.before[k, s, j], V.memory[k, s, j] = V.memory[k, s, j], V.end[k, s, j]
        V.shown[k, SHOWN_AT], V.shown[k, SHOWN_LATER] = 0.0, V.later[k, LAST_UNTIL]
        for i in range(n):
            V.kept[k, i] = V.d[k, i]
            V.d[k, i] = V.next[k, i]
            if hops:
                V.d[k, i] += V.fall[k, i]
            effect = abs(V.d[k, i]) * V.size[k] / V.scale[i]
            V.largest[k] = max(V.largest[k], effect)
            if not effect <= LARGEST:
                V.reason[k] = LOST_LARGE
        if hops and not math.isfinite(V.fall[k, 0]):
            V.reason[k] = LOST_JUMP
        if V.reason[k] != 0.0:
            lose_behind(V, k, t, int(V.reason[k]))


@jitable
def lose_hidden(V: Variations, scene: Scene, m: Method, t: float, h: float) -> None:
    """Lose derivatives by what moves a jump within the step, where nothing ends one."""
    find_hidden(V, scene, m, h)
    for k in range(len(V.size)):
        if V.reason[k] != 0.0:
            lose(V, k, t - h, V.words[HIDES])
            V.reason[k] = 0.0


def commit_hook(context: int, t: float, h: float, a: Pointer, b: Pointer) -> int:
    """What follows from a step that is taken, and its derivatives."""
    scene = view(context, Scene)
    V = view(scene.world.hooks[AT], Variations)
    p, m = in_workspace(V.words[METHOD])
    if h == 0.0:
        return call_int(V.words[COMMIT], (context, t, h, a, b))
    n = len(m.y)
    y, f = vector_at(a, n), vector_at(b, n)
    switched = p.switching != 0 and m.memory[SWITCHED] > 0.0
    for i in range(n):
        V.jump[BEFORE, i], V.jump[F_BEFORE, i] = y[i], f[i]
        V.jump[LINE_Y, i], V.jump[LINE_F, i] = y[i], f[i]
    # of a very short step, as many end at a branch, the polynomial is all rounding
    V.line[0], V.line[LENGTH] = SPAN * m.memory[OWN_TIME], h
    V.shift[:] = math.nan
    list_asking(V, scene, switched)
    V.reason[:] = 0.0
    if V.words[HIDES] != 0:
        lose_hidden(V, scene, m, t, h)
    hops = V.words[TIMED] == 1 and look_for_jumps(V, scene, m, t)
    take_step(V, scene, m, t - h, h)
    make_sure(V, scene, m, t, switched)
    for k in range(len(V.size)):
        keep_unit(V.next[k], y, len(scene.bodies.mass))
    if switched:
        note_changes(V, scene, t)
    word = call_int(V.words[COMMIT], (context, t, h, a, b))
    if word >= 0 and (switched or word & (Taken.Y_CHANGED + Taken.BEGIN_ANEW)):
        cross(V, scene, t, y, switched)
    anew = hops or word & (Taken.Y_CHANGED + Taken.BEGIN_ANEW) != 0
    take_over(V, t, n, switched or anew, hops)
    hold(V, scene, t, y, switched or anew or V.words[CHANGES] > 0)
    return word


@jitable
def look_for_jumps(V: Variations, scene: Scene, m: Method, t: float) -> bool:
    """Find what jumps by time at both ends of a step; return whether something does at its end."""
    if begin_unseen(V, scene, m, t):
        # as at the begin of a run: where it jumps later only one side of a parameter does so at all
        for k in range(len(V.size)):
            if V.moves[k, FIRST] > 0.0 or not math.isfinite(V.fall[k, 0]):
                lose(V, k, m.memory[TIME], LOST_JUMP)
    return look_behind(V, scene, m, t)


@jitable
def note_changes(V: Variations, scene: Scene, t: float) -> None:
    """Find how the end of a step at which a branch changes moves with every parameter."""
    V.words[STRAIGHT] = 1
    note_jump(V, scene, t, V.line[0])
    for k in range(len(V.size)):
        if V.lost[k] == math.inf:
            note_shifts(V, scene, t, V.line[0], k)
            if V.words[REMEMBERED] > 0:
                note_changed(V, scene, t, V.line[0], k)
        else:
            V.shift[k, :] = 0.0
    V.words[STRAIGHT] = 0


@jitable
def bent_at(V: Variations, scene: Scene, m: Method, k: int, s: float, out: F1) -> int:
    """Write derivative k at a part of the last step, in which forces bend; return a code."""
    h, begin, done = m.memory[LAST_STEP], m.memory[LAST_TIME], V.shown[k]
    later = value_within(V, k, s)
    if math.isfinite(later):
        code = add_motion(V, scene, begin, h, s, k, -later)
        for i in range(len(out)):
            out[i] = V.next[k, i]
        return code
    twin, code = view(V.words[TWIN], Scene), 0
    twin.world.past[0] = WITHIN
    for i in range(len(out)):
        V.next[k, i] = V.kept[k, i]
    if s > done[SHOWN_AT]:
        # from the row before it in this step on, or a long step is gone over again for each
        span, later = (done[SHOWN_AT], s), done[SHOWN_LATER]
        code, done[SHOWN_LATER] = step_along(V, scene, begin, h, k, span, False, later)
        done[SHOWN_AT] = s
    twin.world.past[0] = NOW
    for i in range(len(out)):
        out[i] = V.kept[k, i] = V.next[k, i]
    return code


@jitable
def derivative_at(V: Variations, scene: Scene, m: Method, k: int, t: float, out: F1) -> int:
    """Write derivative k at a time within the last step, or at its end; return a code."""
    h, n = m.memory[LAST_STEP], len(out)
    if t >= m.memory[TIME] or h == 0.0 or V.words[FITTED] == 0:
        for i in range(n):
            out[i] = V.d[k, i]
        return 0
    s, code = min(1.0, (t - m.memory[LAST_TIME]) / h), 0
    if V.bends[k] == 1:
        return bent_at(V, scene, m, k, s, out)
    d, r = V.dense[k], 1.0 - s
    last = len(d) - 1
    for i in range(n):
        value = d[last, i]
        for j in range(last - 1, -1, -1):
            value = d[j, i] + (s if j % 2 == 0 else r) * value
        out[i] = value
    if V.later[k, LAST_UNTIL] != 0.0:
        for i in range(n):
            V.next[k, i] = out[i]
        code = add_motion(V, scene, m.memory[LAST_TIME], h, s, k, -V.later[k, LAST_UNTIL])
        for i in range(n):
            out[i] = V.next[k, i]
    return code


@jitable
def write_beside(
    V: Variations, scene: Scene, p: Problem, m: Method, t: float, h: float, k: int, y: Pointer
) -> None:
    """Write rows of results on either side for parameter k."""
    twin, x, n = view(V.words[TWIN], Scene), V.row[1], len(m.y)
    at = vector_at(y, n)
    e = half_step(V, k)
    V.step[V.words[ROWS], k] = e
    w = V.row[3]
    if derivative_at(V, scene, m, k, t, w) != 0:
        lose(V, k, t, LOST_FAILED)
    for side in range(2):
        sign = 1.0 if side == 0 else -1.0
        set_parameter(V, twin, scene, k, sign * e)
        for i in range(n):
            x[i] = at[i] + sign * e * w[i]
        clear = clear_time(V, t)
        code = call_int(p.project, (p.context, clear, 0.0, x, x))
        answer = call_int(V.words[OUTPUT], (p.context, clear, h, x, V.row[2]))
        if code != 0 or answer < 0:
            lose(V, k, t, LOST_FAILED)
            # the row is there all the same, so that rows are told by their number
            if answer < 0:
                twin.rows.used[0] += 1
    if V.lost[k] <= t:
        V.step[V.words[ROWS], k] = math.nan
    set_parameter(V, twin, scene, k, 0.0)


def output_hook(context: int, t: float, h: float, a: Pointer, b: Pointer) -> int:
    """A row of results, and those beside it."""
    scene = view(context, Scene)
    V = view(scene.world.hooks[AT], Variations)
    m = in_workspace(V.words[METHOD])[1]
    p = in_workspace(V.words[UP])[0]
    for k in range(len(V.size)):
        write_beside(V, scene, p, m, t, h, k, a)
    V.words[ROWS] += 1
    return call_int(V.words[OUTPUT], (context, t, h, a, b))

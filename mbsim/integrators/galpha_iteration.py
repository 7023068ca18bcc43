"""The unknowns of a step of generalised-alpha, and Newton's iteration for them: see `galpha`."""

from __future__ import annotations

from mbsim.core.address import call_float, call_int
from mbsim.core.arrays import F1
from mbsim.core.jitable import jitable
from mbsim.core.problem import STATE, VELOCITY, Problem
from mbsim.integrators.newton import (
    GO_ON,
    HOPELESS,
    OFF,
    QUARTER,
    SOLVED,
    as_failure,
    begin,
    is_rounding,
    judge,
    judged_by,
    linearise,
    may_help,
    note,
    stalls,
    target,
    unless_singular,
)
from mbsim.integrators.positions import bracket, is_rate, is_turned, retract
from mbsim.integrators.scheme import (
    EVALUATIONS,
    FACTORED_STEP,
    FACTORIZATIONS,
    FRESH,
    HAVE_JACOBIAN,
    LAST_STEP,
    RATE,
    RETRY,
    Method,
    factor_real,
    project,
)

#: What a step leaves of a vibration that is fast against it.
RHO = 0.8
AM, AF = (2.0 * RHO - 1.0) / (RHO + 1.0), RHO / (RHO + 1.0)
GAMMA = 0.5 - AM + AF
BETA = 0.25 * (GAMMA + 0.5) ** 2
#: a is v' + SHIFT h v'' + ...
SHIFT = AM - AF

#: Corrections in one step at most: with an old linearisation, which another may better, with one
#: of this step, and with a linearisation and a line search for each.
MOST_OLD, MOST_NEW, MOST_DAMPED = 6, 12, 20
#: The second correction may be larger than the first by so much: work and losses, which only sum
#: up what bodies do, are a correction late.
LATE = 3.0
#: The least part of a correction that a line search takes.
LEAST_PART = 1.0 / 128.0
#: A linearisation is kept for another step where the iteration converged so fast with it.
KEEP = 0.2

# rows of k: f at the iterate, residual, correction, the one that a line search extrapolates, a at
# begin and end, a before a line search, f at the trial point
F, R, D, D_NEXT, A0, A1, A_BEFORE, LAST = range(1, 9)
# rows of `kept`: a and v' at the end of the last step, and the mean v'' of that step
ALGORITHMIC, DOT, SLOPE = range(3)


@jitable
def evaluate(p: Problem, m: Method, t: float, h: float, anew: bool) -> int:
    """Evaluate f at the point that a leads to, and linearise it there if asked; return a code."""
    settle(p, m, t, h)
    if anew:
        return linearise(p, m, t + h, h, m.trial, m.k[F])
    m.counts[EVALUATIONS] += 1
    return call_int(p.rhs, (p.context, t + h, h, m.trial, m.k[F]))


@jitable
def correction(p: Problem, m: Method, t: float, h: float, d: F1) -> tuple[int, float]:
    """Write Newton's correction of y for the f evaluated last into d; return code and size."""
    if m.memory[FACTORED_STEP] != h:
        code = factor(p, m, t, h)
        if code != 0:
            return unless_singular(code), 0.0
    for i in range(len(m.y)):
        m.k[R, i] = m.k[F, i] - true_rate(m, i) if is_rate(m, i) else 0.0
    code = call_int(p.solve, (p.context, t, h, m.k[R], d))
    if code != 0:
        return code, 0.0
    return 0, call_float(p.norm, (p.context, t, 0.0, d, m.trial))


@jitable
def take(p: Problem, m: Method, h: float, part: float, d: F1) -> None:
    """Add a part of the correction d of y to a.

    The unknown is a, in turns as in shifts: with c1 dtheta - dtheta x w / 2 = dw of the linear
    system, a changes by dtheta / (beta h^2), not by dw / (gamma h).
    """
    step = part / (GAMMA * h)
    for i in range(len(m.y)):
        if is_rate(m, i):
            m.k[A1, i] += step * d[i]
    if p.difference != 0:
        half = 0.5 * BETA * h / GAMMA * step
        bracket(p, m.trial, d, m.error)
        for i in range(len(m.y)):
            if m.kinds[i] == VELOCITY:
                m.k[A1, i] += half * m.error[i]


@jitable
def iterate(p: Problem, m: Method, t: float, h: float, anew: bool) -> int:
    """Solve for a by Newton's simplified iteration; return a code, < 0 for no solution."""
    begin(m)
    most = MOST_NEW if anew else MOST_OLD
    before, rate, word, iteration = 0.0, 0.0, GO_ON, 0
    while word == GO_ON:
        iteration += 1
        code = evaluate(p, m, t, h, anew and iteration == 1)
        if code != 0:
            return code
        code, size = correction(p, m, t, h, m.k[D])
        if code != 0:
            return code
        take(p, m, h, 1.0, m.k[D])
        word, rate = judge(m, iteration, most, size, before, rate, LATE)
        before = size
    m.memory[RATE] = rate
    if word == HOPELESS and anew and stalls(m, before):
        word = SOLVED if is_rounding(p, m, t, h, before, m.k[D]) else word
    return 0 if word == SOLVED else -1


@jitable
def search(p: Problem, m: Method, t: float, h: float, size: float) -> int:
    """Take the largest part of a correction after which the next is smaller; return a code.

    That is Deuflhard's natural test: it does not depend on the scales of the equations.
    """
    for i in range(len(m.y)):
        m.k[A_BEFORE, i] = m.k[A1, i]
    part = 1.0
    while part >= LEAST_PART:
        for i in range(len(m.y)):
            m.k[A1, i] = m.k[A_BEFORE, i]
        take(p, m, h, part, m.k[D])
        code = evaluate(p, m, t, h, False)
        if not may_help(code):
            return code
        if code == 0:
            code, left = correction(p, m, t, h, m.k[D_NEXT])
            if code == 0 and left <= (1.0 - 0.25 * part) * size:
                return 0
        part *= 0.5
    return -1


@jitable
def iterate_damped(p: Problem, m: Method, t: float, h: float) -> int:
    """Solve for a with a linearisation and a line search for each correction; return a code."""
    m.memory[RETRY] = QUARTER
    for k in range(MOST_DAMPED):
        code = evaluate(p, m, t, h, True)
        if code != 0:
            return code
        code, size = correction(p, m, t, h, m.k[D])
        if code != 0:
            return code
        note(m, size)
        rounded = k > 0 and stalls(m, size) and is_rounding(p, m, t, h, size, m.k[D])
        if size <= target(m) or rounded:
            take(p, m, h, 1.0, m.k[D])
            m.memory[RATE] = 0.0
            return 0
        code = search(p, m, t, h, size)
        if code == -1 and is_rounding(p, m, t, h, size, m.k[D]):
            # nothing is better
            for i in range(len(m.y)):
                m.k[A1, i] = m.k[A_BEFORE, i]
            m.memory[RATE] = 0.0
            return 0
        if code != 0:
            return code
    return -1


@jitable
def arrive(p: Problem, m: Method, t: float, h: float) -> int:
    """Write the point that a leads to into m.trial, and f there; return a code."""
    if settle(p, m, t, h):
        show_drift(p, m, t, h)
    m.counts[EVALUATIONS] += 1
    return call_int(p.rhs, (p.context, t + h, h, m.trial, m.k[LAST]))


@jitable
def is_off(p: Problem, m: Method, t: float, h: float) -> bool:
    """Return whether f where a leads to is so far from what a says that it matters in the step.

    Corrections of a linearisation in touch are small where nothing is touched any more, however
    large a residual they leave. Of that, what is across joints is none.
    """
    e, w = m.error, m.k[D]
    for i in range(len(m.y)):
        e[i] = h * (m.k[LAST, i] - true_rate(m, i)) if is_rate(m, i) else 0.0
    most = OFF * judged_by(m)
    if call_float(p.norm, (p.context, t, h, e, m.trial)) <= most:
        return False
    for i in range(len(m.y)):
        w[i] = m.trial[i] if m.kinds[i] == STATE else m.trial[i] + e[i]
    project(p, m, t + h, h, w)
    for i in range(len(m.y)):
        if m.kinds[i] != STATE:
            e[i] = w[i] - m.trial[i]
    return not call_float(p.norm, (p.context, t, h, e, m.trial)) <= most


@jitable
def solve_step(p: Problem, m: Method, t: float, h: float) -> int:
    """Solve for a, with a linearisation kept if one is good, anew, then damped, and f there.

    Returns a code.
    """
    good = m.memory[HAVE_JACOBIAN] == 1.0 and m.memory[RATE] <= KEEP
    code = -1
    for level in range(0 if good else 1, 3):
        extrapolate(m, h)
        code = iterate_damped(p, m, t, h) if level == 2 else iterate(p, m, t, h, level == 1)
        if code == 0:
            code = arrive(p, m, t, h)
        if code == 0 and level < 2 and is_off(p, m, t, h):
            code = iterate_damped(p, m, t, h)
            if code == 0:
                code = arrive(p, m, t, h)
        if code == 0 or not may_help(code):
            return code
    # what fails may still be near a better one
    m.memory[HAVE_JACOBIAN] = 0.0
    return as_failure(code)


@jitable
def factor(p: Problem, m: Method, t: float, h: float) -> int:
    """Factor the system of a step of length h; return a code."""
    m.counts[FACTORIZATIONS] += 1
    part = (1.0 - AM) / (1.0 - AF)
    c = GAMMA / (BETA * h), part / (BETA * h * h), part / (GAMMA * h)
    code = factor_real(p, m, t, h, c, 1.0)
    m.memory[FACTORED_STEP] = h if code == 0 else 0.0
    return code


@jitable
def extrapolate(m: Method, h: float) -> None:
    """Write a at the begin for a step of length h, and as it is at the end if v'' stays."""
    before = step_before(m)
    for i in range(len(m.y)):
        slope, dot = m.kept[SLOPE, i], m.kept[DOT, i]
        a = m.kept[ALGORITHMIC, i] + SHIFT * (h - before) * slope
        m.k[A0, i] = a
        m.k[A1, i] = ((1.0 - AF) * (dot + h * slope) + AF * dot - AM * a) / (1.0 - AM)


@jitable
def true_rate(m: Method, i: int) -> float:
    """Return v' at the end of the step, of a at its begin and end."""
    a0, a1 = m.k[A0, i], m.k[A1, i]
    return ((1.0 - AM) * a1 + AM * a0 - AF * m.kept[DOT, i]) / (1.0 - AF)


@jitable
def mean_velocity(m: Method, h: float, i: int) -> float:
    """Return the velocity y[i] in the mean of the step, which positions see."""
    return m.y[i] + h * ((0.5 - BETA) * m.k[A0, i] + BETA * m.k[A1, i])


@jitable
def predict(p: Problem, m: Method, h: float) -> None:
    """Write the point that a leads to into m.trial."""
    y, w = m.y, m.trial
    for i in range(len(y)):
        w[i] = mean_velocity(m, h, i)
    retract(p, h, y, w)
    for i in range(len(y)):
        if is_rate(m, i):
            w[i] = y[i] + h * ((1.0 - GAMMA) * m.k[A0, i] + GAMMA * m.k[A1, i])


@jitable
def settle(p: Problem, m: Method, t: float, h: float) -> bool:
    """Write the point that a leads to into m.trial, where joints allow it, and let a follow.

    Returns whether it was projected twice: the norm has then not seen how far the first went.
    So a has across joints what velocities on them ask for, as in a formulation of index 2, and
    what is stiff does not come in. Of free bodies `project` leaves velocities as they are.
    """
    predict(p, m, h)
    for i in range(len(m.y)):
        m.error[i] = m.trial[i]
    project(p, m, t + h, h, m.trial)
    twice = is_turned(p, m.error, m.trial)
    if twice:
        # that turned velocities along joints as well, in body axes: only what is across counts
        for i in range(len(m.y)):
            if m.kinds[i] == VELOCITY:
                m.trial[i] = m.error[i]
        project(p, m, t + h, h, m.trial)
    for i in range(len(m.y)):
        if m.kinds[i] == VELOCITY:
            m.k[A1, i] += (m.trial[i] - m.error[i]) / (GAMMA * h)
    return twice


@jitable
def show_drift(p: Problem, m: Method, t: float, h: float) -> None:
    """Let the norm see by how much joints put the trial point right."""
    n = len(m.y)
    for i in range(n):
        m.k[D, i] = m.trial[i]
    predict(p, m, h)
    project(p, m, t + h, h, m.trial)
    for i in range(n):
        m.trial[i] = m.k[D, i]


@jitable
def step_before(m: Method) -> float:
    """Return the length of the last step; at the start `kept` is as after one of no length."""
    return 0.0 if m.memory[FRESH] == 1.0 else m.memory[LAST_STEP]

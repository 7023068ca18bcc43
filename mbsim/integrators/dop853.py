"""Explicit Runge-Kutta of order 8 with errors of order 5 and 3 and dense output of order 7.

Source: E. Hairer, S. P. Norsett, G. Wanner, Solving ODEs I (1993), section II.5, II.6 and II.10
(the method of Dormand and Prince as in their code DOP853, with its published coefficients).
Twelve stages; the thirteenth is the first of the next step and taken at the projected point.
A step with an output in it costs four evaluations more: three stages, and the end once again,
because a problem is committed at the point that it was evaluated at last.
The dense output has an error of its own. At the bound of stability, h r near 6 for f = -r y, it is
60 to 130 times the estimate of the step's: a step whose polynomial is off is too long for its rows.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from mbsim.core.address import call_float, call_int
from mbsim.core.arrays import F1, F2, Pointer
from mbsim.core.jitable import jitable
from mbsim.core.problem import POSITION, RATES, STATE, VELOCITY, Problem
from mbsim.integrators.positions import has_positions
from mbsim.integrators.scheme import (
    EVALUATIONS,
    KEEPS_TO_BOUND,
    LAST_ERROR,
    SHOWN,
    STIFFNESS,
    THIRD_AT,
    TOL,
    Method,
    Scheme,
    combine,
    in_workspace,
    interpolate,
    project,
)
from mbsim.integrators.stability import allowed, clear_differences, note_difference, rate_between


def _table(width: int, *rows: Any) -> F2:
    """Return rows of weights, given where they are not 0."""
    table = np.zeros((len(rows), width))
    for row, entries in zip(table, rows, strict=True):
        for column, weight in entries.items():
            row[column] = weight
    return table


# fmt: off
#: Nodes.
C = np.array((
    0.0, 0.05260015195876773, 0.0789002279381516, 0.1183503419072274,
    0.2816496580927726, 0.3333333333333333, 0.25, 0.3076923076923077,
    0.6512820512820513, 0.6, 0.8571428571428571, 1.0,
    1.0, 0.1, 0.2, 0.7777777777777778,
))
#: Of k: the first row behind the stages, which hold differences between them.
DIFFERENCES = 17
#: Stages 2..12; row 12 is the solution of order 8, row 13..15 stages of the dense output alone.
A = _table(
    16,
    {},
    {0: 0.05260015195876773},
    {0: 0.0197250569845379, 1: 0.0591751709536137},
    {0: 0.02958758547680685, 2: 0.08876275643042054},
    {0: 0.2413651341592667, 2: -0.8845494793282861, 3: 0.924834003261792},
    {0: 0.037037037037037035, 3: 0.17082860872947386, 4: 0.12546768756682242},
    {0: 0.037109375, 3: 0.17025221101954405, 4: 0.06021653898045596, 5: -0.017578125},
    {0: 0.03709200011850479, 3: 0.17038392571223998, 4: 0.10726203044637328,
     5: -0.015319437748624402, 6: 0.008273789163814023},
    {0: 0.6241109587160757, 3: -3.3608926294469414, 4: -0.868219346841726,
     5: 27.59209969944671, 6: 20.154067550477894, 7: -43.48988418106996},
    {0: 0.47766253643826434, 3: -2.4881146199716677, 4: -0.590290826836843,
     5: 21.230051448181193, 6: 15.279233632882423, 7: -33.28821096898486,
     8: -0.020331201708508627},
    {0: -0.9371424300859873, 3: 5.186372428844064, 4: 1.0914373489967295,
     5: -8.149787010746927, 6: -18.52006565999696, 7: 22.739487099350505,
     8: 2.4936055526796523, 9: -3.0467644718982196},
    {0: 2.273310147516538, 3: -10.53449546673725, 4: -2.0008720582248625, 5: -17.9589318631188,
     6: 27.94888452941996, 7: -2.8589982771350235, 8: -8.87285693353063, 9: 12.360567175794303,
     10: 0.6433927460157636},
    {0: 0.054293734116568765, 5: 4.450312892752409, 6: 1.8915178993145003,
     7: -5.801203960010585, 8: 0.3111643669578199, 9: -0.1521609496625161,
     10: 0.20136540080403034, 11: 0.04471061572777259},
    {0: 0.056167502283047954, 6: 0.25350021021662483, 7: -0.2462390374708025,
     8: -0.12419142326381637, 9: 0.15329179827876568, 10: 0.00820105229563469,
     11: 0.007567897660545699, 12: -0.008298},
    {0: 0.03183464816350214, 5: 0.028300909672366776, 6: 0.053541988307438566,
     7: -0.05492374857139099, 10: -0.00010834732869724932, 11: 0.0003825710908356584,
     12: -0.00034046500868740456, 13: 0.1413124436746325},
    {0: -0.42889630158379194, 5: -4.697621415361164, 6: 7.683421196062599, 7: 4.06898981839711,
     8: 0.3567271874552811, 12: -0.0013990241651590145, 13: 2.9475147891527724,
     14: -9.15095847217987},
)
#: Error of order 5.
E5 = _table(
    12,
    {0: 0.01312004499419488, 5: -1.2251564463762044, 6: -0.4957589496572502,
     7: 1.6643771824549864, 8: -0.35032884874997366, 9: 0.3341791187130175,
     10: 0.08192320648511571, 11: -0.022355307863886294},
)
#: Dense output, its coefficients of highest degree.
D = _table(
    16,
    {0: -8.428938276109013, 5: 0.5667149535193777, 6: -3.0689499459498917, 7: 2.38466765651207,
     8: 2.117034582445028, 9: -0.871391583777973, 10: 2.2404374302607883,
     11: 0.6315787787694688, 12: -0.08899033645133331, 13: 18.148505520854727,
     14: -9.194632392478356, 15: -4.436036387594894},
    {0: 10.427508642579134, 5: 242.28349177525817, 6: 165.20045171727028,
     7: -374.5467547226902, 8: -22.113666853125306, 9: 7.733432668472264,
     10: -30.674084731089398, 11: -9.332130526430229, 12: 15.697238121770845,
     13: -31.139403219565178, 14: -9.35292435884448, 15: 35.81684148639408},
    {0: 19.985053242002433, 5: -387.0373087493518, 6: -189.17813819516758,
     7: 527.8081592054236, 8: -11.57390253995963, 9: 6.8812326946963, 10: -1.0006050966910838,
     11: 0.7777137798053443, 12: -2.778205752353508, 13: -60.19669523126412,
     14: 84.32040550667716, 15: 11.99229113618279},
    {0: -25.69393346270375, 5: -154.18974869023643, 6: -231.5293791760455,
     7: 357.6391179106141, 8: 93.40532418362432, 9: -37.45832313645163, 10: 104.0996495089623,
     11: 29.8402934266605, 12: -43.53345659001114, 13: 96.32455395918828,
     14: -39.17726167561544, 15: -149.72683625798564},
)
# fmt: on
#: Error of order 3: the solution's weights less those of a method with stages 1, 9 and 12.
E3 = A[12:13, :12] - _table(12, {0: 31 / 127, 8: 0.7338466882816118, 11: 3 / 136})


def _polynomial(s: float) -> tuple[F1, F1]:
    """Return weights of the stages in (p - y) / h and in p' / h, p being the polynomial at s."""
    unit = np.eye(16)
    rise = A[12]
    d = (rise, unit[0] - rise, 2.0 * rise - unit[0] - unit[12], *D)
    value, slope = d[-1], np.zeros(16)
    for j in range(len(d) - 2, -1, -1):
        factor, sign = (1.0 - s, -1.0) if j % 2 == 0 else (s, 1.0)
        value, slope = d[j] + factor * value, sign * value + factor * slope
    return s * value, value + s * slope


#: What the polynomial passes by the points of its own stages, whose slopes it has there. Weighed so
#: that the largest is the polynomial's error within 1.3 for f = r y, r complex, h r up to the bound
#: of stability and every phase of y; in smooth steps one order lower than the step's.
PASSES = np.array([w * (A[s] - _polynomial(C[s])[0]) for w, s in ((10, 13), (50, 14), (1, 15))])
#: Parts of the step where its defect is looked at, and the slope's weights there. The larger one of
#: the two is 3.5 times the polynomial's error or more, whatever the phase; a single one may vanish.
INSIDE = (0.4, 0.6)
SLOPES = np.array([_polynomial(s)[1] for s in INSIDE])
#: From how much over tol the polynomial passes by its stages the defect is looked at, and how
#: large that may be: a step whose own error is within tol does not get there where f is smooth.
PASSED, DEFECT = 10.0, 20.0
#: Where the error of order 3 over h^4 is so many times what it was in either of the two steps
#: before, something bends sharply within the step, and this part of it counts: what is wrong then
#: is 0.004 to 0.08 of it, as the place in the step is, and at some that of order 5 sees nothing.
BENDS_SHARPLY, COUNTS = 100.0, 0.01


@jitable
def combined_error(fifth: float, third: float) -> float:
    """Return |e5|^2 / sqrt(|e5|^2 + 0.01 |e3|^2), of order 8 in h, from errors h e5 and h e3.

    Hairer, Norsett and Wanner, section II.10. The estimate of order 5 alone overrates the error of
    order 8, and vanishes by chance now and then; that of order 3 sees to that.
    """
    if fifth == 0.0:
        return 0.0
    return fifth * (fifth / math.sqrt(fifth * fifth + 0.01 * third * third))


@jitable
def keep_bent(m: Method, t: float, h: float) -> bool:
    """Leave in m.error, of errors of order 3, those that a force bends within the step.

    Returns whether there are any. That |e5|^2 / |e3| is small means much where both are smooth, and
    nothing there: e3 is large, and e5 may vanish by chance. Each body's velocity, its spin and each
    state of first order are looked at by themselves: what turns fast elsewhere would hide them.
    """
    e, kept, n = m.error, m.kept, len(m.y)
    taken = t != m.memory[THIRD_AT]
    m.memory[THIRD_AT] = t
    found, i = False, 0
    while i < n:
        # velocities stand in vectors; positions follow them
        width = 3 if m.kinds[i] == VELOCITY else 1
        square = 0.0
        for j in range(i, i + width):
            square += e[j] * e[j]
        if taken:
            kept[2, i], kept[1, i] = kept[1, i], kept[0, i]
        kept[0, i] = math.sqrt(square) / h**4
        smooth = min(kept[1, i], kept[2, i])
        bent = m.kinds[i] != POSITION and smooth > 0.0 and kept[0, i] > BENDS_SHARPLY * smooth
        for j in range(i, i + width):
            e[j] = e[j] if bent else 0.0
        found = found or bent
        i += width
    return found


@jitable
def stage(p: Problem, m: Method, t: float, h: float, s: int, out: F1) -> int:
    """Take stage s at its point, which is left in `out`; return a code."""
    combine(m.k, A[s], s, out)
    for i in range(len(out)):
        out[i] = m.y[i] + h * out[i]
    return call_int(p.rhs, (p.context, t + C[s] * h, C[s] * h, out, m.k[s]))


@jitable
def estimate(p: Problem, m: Method, t: float, h: float, weights: F1) -> float:
    """Return the norm of the error estimate with the given weights."""
    combine(m.k, weights, 12, m.error)
    for i in range(len(m.error)):
        m.error[i] *= h
    return call_float(p.norm, (p.context, t, h, m.error, m.trial))


@jitable
def attempt(p: Problem, m: Method, t: float, h: float) -> int:
    """Fill stages 2..12, trial point and error, and stage 13 if the error is small enough."""
    for s in range(1, 12):
        m.counts[EVALUATIONS] += 1
        code = stage(p, m, t, h, s, m.trial)
        if code != 0:
            return code
    combine(m.k, A[12], 12, m.trial)
    for i in range(len(m.y)):
        m.trial[i] = m.y[i] + h * m.trial[i]
    project(p, m, t + h, h, m.trial)
    third = estimate(p, m, t, h, E3[0])
    least = 0.0
    if keep_bent(m, t, h):
        least = COUNTS * call_float(p.norm, (p.context, t, h, m.error, m.trial))
    fifth = estimate(p, m, t, h, E5[0])
    m.memory[LAST_ERROR] = max(combined_error(fifth, third), least) / allowed(m)
    if not m.memory[LAST_ERROR] <= 1.0:
        return 0
    m.counts[EVALUATIONS] += 1
    code = call_int(p.rhs, (p.context, t + h, h, m.trial, m.k[12]))
    if code == 0 and m.memory[KEEPS_TO_BOUND] == 1.0:
        m.memory[STIFFNESS] = stiffness(p, m, t, h)
    return code


@jitable
def stiffness(p: Problem, m: Method, t: float, h: float) -> float:
    """Return the step times the rate of f between its last stages, in the measure of DOPRI5.

    See `dopri5.stiffness`: here, too, the last two stages are at the same time. For f = -r y
    stability ends at h r = 6.1 instead of 3.3.
    """
    k, n = m.k, len(m.y)
    d, first = k[DIFFERENCES:], not has_positions(m)
    clear_differences(m, d)
    for i in range(n):
        if m.kinds[i] == STATE and not first:
            continue
        shift, come = 0.0, 0.0
        for s in range(12):
            shift += (A[12, s] - A[11, s]) * k[s, i]
            come += (A[11, s] - A[10, s]) * k[s, i]
        note_difference(m, d, i, h * shift, h * come, 12)
    return (3.3 / 6.1) * rate_between(p, m, t, h, d)


@jitable
def weigh_dense(p: Problem, m: Method, t: float, h: float) -> int:
    """Raise the step's error to that of its polynomial, where this is not far below; return a code.

    By how much it passes by its stages costs no evaluation. Where that is much the defect
    h (p' - f), of order 8 as the step's error, decides.
    """
    k, n = m.k, len(m.y)
    for i in range(n):
        largest = 0.0
        for row in range(3):
            passed = 0.0
            for j in range(16):
                passed += PASSES[row, j] * k[j, i]
            largest = max(largest, abs(passed))
        m.error[i] = h * largest
    if call_float(p.norm, (p.context, t, h, m.error, m.trial)) > PASSED * m.memory[TOL]:
        for row in range(2):
            part = INSIDE[row] * h
            interpolate(m, INSIDE[row], m.error)
            m.counts[EVALUATIONS] += 1
            code = call_int(p.rhs, (p.context, t + part, part, m.error, k[16]))
            if code != 0:
                return code
            combine(k, SLOPES[row], 16, m.error)
            for i in range(n):
                m.error[i] = h * (m.error[i] - k[16, i])
            defect = call_float(p.norm, (p.context, t, h, m.error, m.trial)) / m.memory[TOL]
            m.memory[LAST_ERROR] = max(m.memory[LAST_ERROR], defect / DEFECT)
    # the norm is asked last for the step's own error, which the problem may keep
    estimate(p, m, t, h, E5[0])
    return 0


@jitable
def fit_dense(p: Problem, m: Method, t: float, h: float) -> int:
    """Take three stages and fill the polynomial of the step from y to trial; return a code."""
    k, d = m.k, m.dense
    for s in range(13, 16):
        m.counts[EVALUATIONS] += 1
        code = stage(p, m, t, h, s, m.error)
        if code != 0:
            return code
    for i in range(len(m.y)):
        rise = m.trial[i] - m.y[i]
        d[0, i] = m.y[i]
        d[1, i] = rise
        d[2, i] = h * k[0, i] - rise
        d[3, i] = 2.0 * rise - h * (k[0, i] + k[12, i])
    for j in range(4):
        combine(k, D[j], 16, d[4 + j])
        for i in range(len(m.y)):
            d[4 + j, i] *= h
    if m.memory[SHOWN] == 1.0:
        code = weigh_dense(p, m, t, h)
        if code != 0:
            return code
    m.counts[EVALUATIONS] += 1
    return call_int(p.rhs, (p.context, t + h, h, m.trial, k[12]))


def _attempt(context: int, t: float, h: float, a: Pointer, b: Pointer) -> int:
    """One step, tried."""
    problem, method = in_workspace(context)
    return attempt(problem, method, t, h)


def _fit_dense(context: int, t: float, h: float, a: Pointer, b: Pointer) -> int:
    """Dense output of the step tried last."""
    problem, method = in_workspace(context)
    return fit_dense(problem, method, t, h)


# stages and a row for the defect; kept: sizes of errors of order 3 over h^4, of the step tried
# last and of the two that were taken before
SCHEME = Scheme(
    _attempt,
    _fit_dense,
    stages=17,
    last=12,
    dense=8,
    order=8.0,
    memory=0.2,
    carried=3,
    longer=1.3,
    watched=DIFFERENCES + RATES,
)

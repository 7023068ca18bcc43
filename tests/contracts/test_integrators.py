"""What an integrator has to keep, on scalar equations that know no bodies."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numba import carray

from mbsim.core import jit
from mbsim.core.problem import DONE, HOOK, PAUSED, STEP_TOO_SMALL, Problem
from mbsim.integrators import dopri5


def _oscillator(context, t, h, a, b):
    y, f = carray(a, (2,)), carray(b, (2,))
    f[0] = y[1]
    f[1] = -y[0] + math.sin(2.0 * t)
    return 0.0


def _blows_up(context, t, h, a, b):
    y, f = carray(a, (2,)), carray(b, (2,))
    f[0] = y[0] * y[0]
    f[1] = 0.0
    return 0.0


def _norm(context, t, h, a, b):
    e = carray(a, (2,))
    return math.sqrt(e[0] * e[0] + e[1] * e[1])


def _zero(context, t, h, a, b):
    return 0.0


def _one(context, t, h, a, b):
    return 1.0


def _none(context, t, h, a, b):
    return -1.0


def _far(context, t, h, a, b):
    return 1e300


def exact(t):
    # y'' = -y + sin 2t, y(0) = 1, y'(0) = 0
    return math.cos(t) + 2.0 / 3.0 * math.sin(t) - math.sin(2.0 * t) / 3.0


def make_problem(rhs, context=0, output=_zero):
    hooks = (rhs, _zero, _norm, _one, _zero, _zero, _none, _far, output, _zero)
    return Problem(context, *[jit.address(hook, HOOK) for hook in hooks])


@pytest.fixture(scope="module")
def advance():
    return jit.function(dopri5.advance)


@pytest.fixture(scope="module")
def oscillator():
    return make_problem(_oscillator)


def run(advance, problem, tol, h_max=math.inf, y0=(1.0, 0.0), end=5.0, budget=10**8):
    method = dopri5.make(np.array(y0), 0.0)
    outcome = advance(problem, method, end, tol, h_max, 0.0, np.zeros(0), budget)
    return outcome, method


def test_observed_order_is_five(advance, oscillator):
    errors = []
    for n in (20, 40, 80):
        # a loose tolerance: h_max decides, so the step is fixed
        method = dopri5.make(np.array([1.0, 0.0]), 0.0)
        method.memory[dopri5.STEP] = 5.0 / n
        advance(oscillator, method, 5.0, 1e3, 5.0 / n, 0.0, np.zeros(0), 10**8)
        errors.append((5.0 / method.counts[dopri5.STEPS], abs(method.y[0] - exact(5.0))))
    (h0, e0), _, (h2, e2) = errors
    order = math.log(e0 / e2) / math.log(h0 / h2)
    assert order == pytest.approx(5.0, abs=0.3)


def test_observed_order_of_dense_output_is_at_least_four(advance, oscillator):
    errors = []
    for n in (16, 64):
        method = dopri5.make(np.array([1.0, 0.0]), 0.0)
        method.memory[dopri5.STEP] = 5.0 / n
        worst, before = 0.0, 0
        out = np.zeros(2)
        while method.memory[dopri5.TIME] < 5.0:
            advance(oscillator, method, 5.0, 1e3, 5.0 / n, 0.0, np.zeros(0), 1)
            if method.counts[dopri5.STEPS] == before:
                continue
            before = method.counts[dopri5.STEPS]
            t, h = method.memory[dopri5.LAST_TIME], method.memory[dopri5.LAST_STEP]
            for s in (0.2, 0.5, 0.7):
                dopri5.interpolate(method, s, out)
                worst = max(worst, abs(out[0] - exact(t + s * h)))
        errors.append((5.0 / method.counts[dopri5.STEPS], worst))
    (h0, e0), (h1, e1) = errors
    # local order 5 of the interpolant: 4 globally
    assert math.log(e0 / e1) / math.log(h0 / h1) > 3.9


def test_error_falls_with_the_tolerance_down_to_rounding(advance, oscillator):
    errors = []
    for tol in 10.0 ** -np.arange(3, 14):
        outcome, method = run(advance, oscillator, tol)
        assert outcome == DONE
        errors.append(abs(method.y[0] - exact(5.0)))
    assert errors[-1] < 1e-11
    assert errors[0] / errors[-1] > 1e7


def test_a_bounded_number_of_evaluations_a_call(advance, oscillator):
    outcome, method = run(advance, oscillator, 1e-12, budget=60)
    assert outcome == PAUSED
    assert method.counts[dopri5.EVALUATIONS] <= 60 + 8


def test_pauses_do_not_change_the_result(advance, oscillator):
    _, straight = run(advance, oscillator, 1e-8)
    method = dopri5.make(np.array([1.0, 0.0]), 0.0)
    while advance(oscillator, method, 5.0, 1e-8, math.inf, 0.0, np.zeros(0), 13) == PAUSED:
        pass
    assert method.y.tolist() == straight.y.tolist()
    assert method.counts[dopri5.STEPS] == straight.counts[dopri5.STEPS]


def test_ends_at_a_pole_instead_of_hanging(advance):
    # y' = y^2, y(0) = 1 has a pole at t = 1
    outcome, method = run(advance, make_problem(_blows_up), 1e-8, end=2.0)
    assert outcome == STEP_TOO_SMALL
    assert method.memory[dopri5.TIME] == pytest.approx(1.0, abs=1e-3)


def test_h_max_is_kept(advance, oscillator):
    _, method = run(advance, oscillator, 1e-2, h_max=0.05)
    assert method.memory[dopri5.H_LARGEST] <= 0.05

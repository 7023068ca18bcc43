"""What an implicit integrator has to keep, on stiff equations with a dense linear algebra."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

import numpy as np
import numpy.typing as npt
import pytest
from numba import carray

from mbsim.core import jit
from mbsim.core.address import pack, view
from mbsim.core.arrays import F1, F2, I1
from mbsim.core.jitable import jitable
from mbsim.core.problem import DONE, FAILED, HOOK, PAUSED, SINGULAR, STEP_TOO_SMALL, Problem
from mbsim.integrators import catalog, driver, radau5, scheme

RELAX, VAN_DER_POL, ROBERTSON, OSCILLATOR, DECAY, BLOWS_UP, HALF_LINE = range(7)
#: A body of mass 1 on a spring and a damper, driven, with a state z that follows it; a top whose
#: point is held, and that springs and dampers hold; a sphere that falls on a stiff floor.
BODY, TOP, FLOOR = range(7, 10)
INERTIA = (1.0, 1.2, 0.5)


class Box(NamedTuple):
    """What the hooks below know: an equation, its linearisation, inverses, rows written."""

    numbers: I1  # kind, rows used, 1: no step is rejected, 1: no system can be solved, bodies
    given: F1  # parameters of the equation
    scale: F1
    at: F1  # where it is linearised
    spread: F2  # y's change for one of positions, turns and states
    small: F2  # the inverse for these
    jacobian: F2
    real: F2
    pair: Annotated[npt.NDArray[np.complex128], "complex128", 2]
    rows: F2


@jitable
def rates(kind, given, t, y, f):
    """Write f(t, y); return a code."""
    if kind == RELAX:
        f[0] = -given[0] * (y[0] - math.cos(t)) - math.sin(t)
    elif kind == VAN_DER_POL:
        f[0] = y[1]
        f[1] = given[0] * given[0] * ((1.0 - y[0] * y[0]) * y[1] - y[0])
    elif kind == ROBERTSON:
        f[0] = -0.04 * y[0] + 1e4 * y[1] * y[2]
        f[2] = 3e7 * y[1] * y[1]
        f[1] = -f[0] - f[2]
    elif kind == OSCILLATOR:
        f[0] = y[1]
        f[1] = -y[0] + math.sin(2.0 * t)
    elif kind == DECAY:
        f[0] = -given[0] * y[0]
    elif kind == BLOWS_UP:
        f[0] = y[0] * y[0]
    elif kind == HALF_LINE:
        f[0] = 0.6 - y[0]
        return 7.0 if y[0] < 0.5 else 0.0
    elif kind >= BODY:
        body_rates(kind, given, t, y, f)
    return 0.0


@jitable
def body_rates(kind, given, t, y, f):
    """Write f(t, y) of a body of 13 numbers, and of a state behind it."""
    q, w = y[3:7], y[10:13]
    for i in range(3):
        f[i] = y[7 + i]
    f[3] = 0.5 * (-q[1] * w[0] - q[2] * w[1] - q[3] * w[2])
    f[4] = 0.5 * (q[0] * w[0] + q[2] * w[2] - q[3] * w[1])
    f[5] = 0.5 * (q[0] * w[1] + q[3] * w[0] - q[1] * w[2])
    f[6] = 0.5 * (q[0] * w[2] + q[1] * w[1] - q[2] * w[0])
    a, b, c = INERTIA
    for i in range(6):
        f[7 + i] = 0.0
    f[10] = (b - c) * w[1] * w[2] / a
    f[11] = (c - a) * w[2] * w[0] / b
    f[12] = (a - b) * w[0] * w[1] / c
    if kind == TOP:
        # weight 3 down along z, at 1 along its own z axis
        f[10] += 3.0 * 2.0 * (q[2] * q[3] + q[0] * q[1]) / a
        f[11] -= 3.0 * 2.0 * (q[1] * q[3] - q[0] * q[2]) / b
    elif kind == BODY:
        f[7] = -given[0] * y[0] - 0.1 * y[7] + math.sin(2.0 * t)
        f[8] = -y[1] - y[1] ** 3 + 0.2 * y[13]
        f[13] = y[1] - 2.0 * y[13]
    elif kind == FLOOR:
        depth = -y[2]
        f[9] = -9.81
        if depth > 0.0:
            f[9] += max(0.0, given[0] * depth - 0.02 * math.sqrt(given[0]) * y[9])


@jitable
def invert(a, out):
    """Write the inverse of `a`, which is spoilt, by Gauss and Jordan; return whether there is."""
    n = len(a)
    for i in range(n):
        for j in range(n):
            out[i, j] = 1.0 if i == j else 0.0
    for i in range(n):
        best = i
        for j in range(i + 1, n):
            if abs(a[j, i]) > abs(a[best, i]):
                best = j
        if not abs(a[best, i]) > 0.0:
            return False
        for j in range(n):
            a[i, j], a[best, j] = a[best, j], a[i, j]
            out[i, j], out[best, j] = out[best, j], out[i, j]
        pivot = a[i, i]
        for j in range(n):
            a[i, j] /= pivot
            out[i, j] /= pivot
        for k in range(n):
            part = a[k, i]
            if k != i:
                for j in range(n):
                    a[k, j] -= part * a[i, j]
                    out[k, j] -= part * out[i, j]
    return True


def _rhs(context, t, h, a, b):
    box = view(context, Box)
    n = len(box.scale)
    return rates(box.numbers[0], box.given, t, carray(a, (n,)), carray(b, (n,)))


def _norm(context, t, h, a, b):
    box = view(context, Box)
    n = len(box.scale)
    e, y, worst = carray(a, (n,)), carray(b, (n,)), 0.0
    if h > 0.0 and box.numbers[2] == 1:
        return 0.0
    for i in range(n):
        part = abs(e[i]) / max(abs(y[i]), box.scale[i])
        worst = worst if part <= worst else part
    return worst


def _linearise(context, t, h, a, b):
    box = view(context, Box)
    n = len(box.scale)
    y, f = carray(a, (n,)), carray(b, (n,))
    code = rates(box.numbers[0], box.given, t, y, f)
    box.at[:] = y
    near, there = y.copy(), f.copy()
    for j in range(n):
        step = 1e-7 * max(abs(y[j]), box.scale[j])
        near[j] = y[j] + step
        rates(box.numbers[0], box.given, t, near, there)
        near[j] = y[j]
        for i in range(n):
            box.jacobian[i, j] = (there[i] - f[i]) / step
    return code


@jitable
def spread_out(box, c):
    """Write how y changes with positions, turns in body axes and states, by the first rows."""
    q, w, s = box.at[3:7], box.at[10:13], box.spread
    s[:] = 0.0
    for i in range(3):
        s[i, i] = 1.0
        s[7 + i, i] = c
        # dq = q (0, dtheta) / 2, and c dq - d(q (0, w) / 2) = 0
        j, k = (i + 1) % 3, (i + 2) % 3
        s[3, 3 + i] = -0.5 * q[1 + i]
        s[4 + i, 3 + i] = 0.5 * q[0]
        s[4 + j, 3 + i] = 0.5 * q[1 + k]
        s[4 + k, 3 + i] = -0.5 * q[1 + j]
        s[10 + i, 3 + i] = c
        s[10 + j, 3 + i] = 0.5 * w[k]
        s[10 + k, 3 + i] = -0.5 * w[j]
    for i in range(13, len(box.at)):
        s[i, i - 7] = 1.0


def _factor(context, t, h, a, b):
    box, c = view(context, Box), carray(a, (4,))
    if c[3] == 1.0:
        # of second order: positions, turns and states are solved for
        bodies = box.numbers[4]
        if bodies == 1:
            spread_out(box, c[0])
        else:
            box.spread[:] = np.eye(len(box.at))
        first = 7 * bodies
        small = np.zeros(box.small.shape)
        for i in range(len(small)):
            small[i, i] = c[1] if i < 6 * bodies else c[2]
            for j in range(len(small)):
                for k in range(len(box.at)):
                    small[i, j] -= box.jacobian[first + i, k] * box.spread[k, j]
        box.real[:] = 0.0
        if not invert(small, box.small) or box.numbers[3] == 1:
            return SINGULAR
        for i in range(len(box.at)):
            for j in range(len(small)):
                for k in range(len(small)):
                    box.real[i, first + j] += box.spread[i, k] * box.small[k, j]
        return 0.0
    work = -box.jacobian
    for i in range(len(work)):
        work[i, i] += c[0]
    good = invert(work, box.real) and box.numbers[3] == 0
    return 0.0 if good and c[3] == 0.0 and c[1] == c[0] * c[0] and c[2] == c[0] else SINGULAR


def _solve(context, t, h, a, b):
    box = view(context, Box)
    n = len(box.scale)
    r, d = carray(a, (n,)), carray(b, (n,))
    for i in range(n):
        d[i] = 0.0
        for j in range(n):
            d[i] += box.real[i, j] * r[j]
    return 0.0


def _factor_pair(context, t, h, a, b):
    box, c = view(context, Box), carray(a, (7,))
    work = -box.jacobian + 0j
    number = c[0] + 1j * c[1]
    for i in range(len(work)):
        work[i, i] += number
    good = invert(work, box.pair) and abs(number * number - c[2] - 1j * c[3]) < 1e-9 * abs(c[2])
    return 0.0 if good and c[4] == c[0] and c[5] == c[1] and c[6] == 0.0 else SINGULAR


def _solve_pair(context, t, h, a, b):
    box = view(context, Box)
    n = len(box.scale)
    r, d = carray(a, (2, n)), carray(b, (2, n))
    for i in range(n):
        total = 0j
        for j in range(n):
            total += box.pair[i, j] * (r[0, j] + 1j * r[1, j])
        d[0, i], d[1, i] = total.real, total.imag
    return 0.0


def _unit(context, t, h, a, b):
    # quaternions back to unit length
    y = carray(a, (7,))
    length = math.sqrt(y[3] ** 2 + y[4] ** 2 + y[5] ** 2 + y[6] ** 2)
    for i in range(3, 7):
        y[i] /= length
    return 0.0


def _keep(context, t, h, a, b):
    box = view(context, Box)
    n = len(box.scale)
    y, row = carray(a, (n,)), box.rows[box.numbers[1]]
    row[0] = t
    for i in range(n):
        row[1 + i] = y[i]
    box.numbers[1] += 1
    return 0.0


def _zero(context, t, h, a, b):
    return 0.0


def _one(context, t, h, a, b):
    return 1.0


def _none(context, t, h, a, b):
    return -1.0


def _far(context, t, h, a, b):
    return 1e300


HOOKS = (_rhs, _zero, _norm, _one, _zero, _zero, _none, _far, _keep, _zero)
LINEAR = ("linearise", "factor", "solve", "factor_pair", "solve_pair")


class Run:
    """A method on one of the equations above."""

    def __init__(
        self, kind, y0, given=0.0, scale=1.0, step=0.0, fixed=False, rows=0, name="RADAU5"
    ):
        n, bodies = len(y0), int(kind >= BODY)
        freedoms = n - 7 * bodies
        self.box = Box(
            np.array([kind, 0, fixed, 0, bodies]),
            np.array([given]),
            np.full(n, 1.0) * scale,
            np.zeros(n),
            np.zeros((n, freedoms)),
            np.zeros((freedoms, freedoms)),
            np.zeros((n, n)),
            np.zeros((n, n)),
            np.zeros((n, n), dtype=complex),
            np.zeros((rows, n + 1)),
        )
        self._table = pack(self.box)
        named = list(HOOKS)
        named[1] = _unit if bodies else _zero
        plain = [jit.address(hook, HOOK) for hook in named]
        hooks = (_linearise, _factor, _solve, _factor_pair, _solve_pair)
        linear = dict(zip(LINEAR, (jit.address(f, HOOK) for f in hooks), strict=True))
        self.problem = Problem(int(self._table.ctypes.data), *plain, **linear)
        method = catalog.load(name)
        self.state = scheme.make(method, np.array(y0), 0.0, bodies)
        self.state.memory[scheme.STEP] = step
        self.steps, self._kept = scheme.bind(method, self.problem, self.state)

    def __call__(self, end, tol, h_max=math.inf, budget=10**8, times=()):
        advance = jit.function(driver.advance)
        times = np.array(times, dtype=float)
        return advance(self.steps, end, tol, h_max, 0.0, times, budget)

    def count(self, name):
        return int(self.state.counts[name])


def observed(errors):
    """Return the order between the first and the last of (h, error)."""
    (h0, e0), (h1, e1) = errors[0], errors[-1]
    return math.log(e0 / e1) / math.log(h0 / h1)


def oscillation(t):
    # y'' = -y + sin 2t, y(0) = 1, y'(0) = 0
    return np.cos(t) + 2.0 / 3.0 * np.sin(t) - np.sin(2.0 * t) / 3.0


def fixed_steps(kind, y0, n, end=5.0, tol=1e-12, **more):
    run = Run(kind, y0, step=end / n, fixed=True, **more)
    assert run(end, tol, h_max=end / n, times=more.get("times", ())) == DONE
    assert run.count(scheme.STEPS) == n
    return run


def test_the_transformation_is_that_of_the_method():
    values = radau5.TI @ np.linalg.inv(radau5.A) @ radau5.T
    g, re, im = radau5.G0, radau5.G_RE, radau5.G_IM
    expected = [[g, 0, 0], [0, re, -im], [0, im, re]]
    np.testing.assert_allclose(values, expected, rtol=0, atol=2e-14)
    np.testing.assert_allclose(radau5.TI @ radau5.T, np.eye(3), rtol=0, atol=1e-14)


def test_the_table_meets_the_conditions_of_its_order():
    A, c = radau5.A, radau5.C
    for k in range(1, 4):
        np.testing.assert_allclose(A @ c ** (k - 1), c**k / k, rtol=0, atol=1e-15)
    for k in range(1, 6):
        assert A[2] @ c ** (k - 1) == pytest.approx(1.0 / k, abs=1e-15)
    # at infinity a stage is one of the next step's: nothing of a fast part is left
    assert 1.0 - A[2] @ np.linalg.solve(A, np.ones(3)) == pytest.approx(0.0, abs=1e-14)


def test_observed_order_on_an_oscillator():
    errors = []
    for n in (20, 40, 80):
        run = fixed_steps(OSCILLATOR, (1.0, 0.0), n)
        errors.append((5.0 / n, abs(run.state.y[0] - oscillation(5.0))))
    assert observed(errors) == pytest.approx(5.0, abs=0.2), errors


def test_observed_order_of_dense_output():
    times, errors = np.linspace(0.0, 5.0, 1002)[1:], []
    for n in (20, 40, 80):
        run = Run(OSCILLATOR, (1.0, 0.0), step=5.0 / n, fixed=True, rows=len(times))
        assert run(5.0, 1e-12, h_max=5.0 / n, times=times) == DONE
        assert run.box.rows[:, 0].tolist() == times.tolist()
        errors.append((5.0 / n, np.abs(run.box.rows[:, 1] - oscillation(times)).max()))
    # of four coefficients; its error falls with the fourth power of the step
    assert observed(errors) > 3.8, errors


def test_error_falls_with_the_tolerance():
    errors = []
    for tol in 10.0 ** -np.arange(3, 12):
        run = Run(OSCILLATOR, (1.0, 0.0))
        assert run(5.0, tol) == DONE
        errors.append(abs(run.state.y[0] - oscillation(5.0)))
        assert errors[-1] < 10.0 * tol
    assert errors[-1] < 1e-10


def test_nothing_is_left_of_what_is_fast():
    # R(z) of the step's stability function falls as 1/z
    run = Run(DECAY, (1.0,), given=1e8, step=1.0, fixed=True)
    assert run(1.0, 1e-6, h_max=1.0) == DONE
    assert run.count(scheme.STEPS) == 1
    assert abs(run.state.y[0]) < 1e-6


@pytest.mark.parametrize("given", [1e2, 1e6, 1e9])
def test_steps_do_not_know_how_stiff_an_equation_is(given):
    run = Run(RELAX, (1.0,), given=given)
    assert run(10.0, 1e-7) == DONE
    assert run.state.y[0] == pytest.approx(math.cos(10.0), abs=1e-6)
    assert run.count(scheme.STEPS) < 150
    assert run.count(scheme.JACOBIANS) < 5


def test_a_fast_part_at_the_start_is_followed_then_left_behind():
    run = Run(RELAX, (2.0,), given=1e6, rows=1)
    assert run(10.0, 1e-6, times=[1e-6]) == DONE
    assert run.box.rows[0, 1] == pytest.approx(1.0 + math.exp(-1.0), abs=1e-5)
    assert run.state.y[0] == pytest.approx(math.cos(10.0), abs=1e-5)


def test_van_der_pol():
    # the solution at t = 2 for eps = 1e-6 of F. Mazzia, C. Magherini, Test Set for IVP Solvers
    run = Run(VAN_DER_POL, (2.0, 0.0), given=1e3, scale=1e-3)
    assert run(2.0, 1e-5) == DONE
    assert run.state.y[0] == pytest.approx(1.706167732170483, rel=1e-6)
    assert run.state.y[1] == pytest.approx(-0.8928097010247975, rel=1e-6)
    # Radau of scipy 1.14 takes as many
    assert run.count(scheme.EVALUATIONS) < 5500
    assert run.count(scheme.JACOBIANS) < 0.6 * run.count(scheme.STEPS)
    assert run.count(scheme.FACTORIZATIONS) < run.count(scheme.STEPS) + run.count(scheme.REJECTED)


def test_robertson():
    # y at t = 40 (Hairer and Wanner, IV.10)
    run = Run(ROBERTSON, (1.0, 0.0, 0.0), scale=np.array([1.0, 1e-5, 1.0]))
    assert run(40.0, 1e-8) == DONE
    expected = [0.7158270687193941, 0.9185534764557338e-5, 0.2841637457458413]
    np.testing.assert_allclose(run.state.y, expected, rtol=1e-7)


def test_counts():
    run = Run(OSCILLATOR, (1.0, 0.0), step=0.05, fixed=True)
    assert run(5.0, 1e-9, h_max=0.05) == DONE
    steps = run.count(scheme.STEPS)
    # linear, and all steps but the last of one length: one linearisation and factors for two
    assert run.count(scheme.JACOBIANS) == 1
    assert 1 <= run.count(scheme.FACTORIZATIONS) <= 3
    # one f at the new point, and three a correction; one for the linearisation and at the start
    assert (run.count(scheme.EVALUATIONS) - 2 - steps) % 3 == 0
    assert run.count(scheme.EVALUATIONS) < 9 * steps


def test_pauses_do_not_change_the_result():
    straight, paused = (Run(VAN_DER_POL, (2.0, -0.66), given=1e2, scale=1e-3) for _ in range(2))
    assert straight(2.0, 1e-6) == DONE
    while paused(2.0, 1e-6, budget=1) == PAUSED:
        pass
    assert straight.count(scheme.REJECTED) > 5
    assert paused.state.y.tolist() == straight.state.y.tolist()
    assert paused.state.counts.tolist() == straight.state.counts.tolist()


def test_a_run_goes_on_from_its_saved_arrays():
    def fresh():
        return Run(VAN_DER_POL, (2.0, -0.66), given=1e2, scale=1e-3)

    first = fresh()
    assert first(2.0, 1e-6, budget=500) == PAUSED
    # what the problem keeps is not saved
    first.state.memory[scheme.HAVE_JACOBIAN] = 0.0
    second = fresh()
    for array, saved in zip(second.state, first.state, strict=True):
        array[...] = saved
    assert first(2.0, 1e-6) == second(2.0, 1e-6) == DONE
    assert second.state.y.tolist() == first.state.y.tolist()
    assert second.state.counts.tolist() == first.state.counts.tolist()


def test_ends_at_a_pole_instead_of_hanging():
    run = Run(BLOWS_UP, (1.0,))
    assert run(2.0, 1e-8) == STEP_TOO_SMALL
    assert run.state.memory[scheme.TIME] == pytest.approx(1.0, abs=1e-3)


def test_a_failing_stage_is_tried_nearer():
    # no law was meant for y < 0.5, where no solution goes
    run = Run(HALF_LINE, (1.0,), step=40.0)
    assert run(5.0, 1e-6) == DONE
    assert run.state.y[0] == pytest.approx(0.6 + 0.4 * math.exp(-5.0), abs=1e-5)


def test_a_code_of_the_rhs_ends_the_run():
    run = Run(HALF_LINE, (0.4,))
    assert run(5.0, 1e-6) == FAILED
    assert run.count(scheme.CODE) == 7


def test_a_system_that_cannot_be_solved_is_tried_shorter_to_the_end():
    run = Run(DECAY, (1.0,), given=1.0)
    run.box.numbers[3] = 1
    assert run(5.0, 1e-6) == STEP_TOO_SMALL
    assert run.count(scheme.LAST_REASON) == 3
    assert run.count(scheme.STEPS) == 0


def test_a_problem_without_linearisation_is_refused():
    run = Run(DECAY, (1.0,))
    with pytest.raises(ValueError, match="no linearisation"):
        scheme.bind(catalog.load("RADAU5"), run.problem._replace(linearise=0), run.state)

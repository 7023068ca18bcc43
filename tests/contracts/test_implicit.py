"""What an implicit integrator has to keep, on stiff equations with a dense linear algebra."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

import numpy as np
import numpy.typing as npt
import pytest
from numba import carray

from helpers.equations import far, none, observed, one, oscillation, zero
from mbsim.core.address import pack, view
from mbsim.core.arrays import F1, F2, I1
from mbsim.core.codes import Code
from mbsim.core.jitable import jitable
from mbsim.core.problem import (
    BY_NEWTON,
    DONE,
    FAILED,
    FRICTION_ALONE,
    IMPACTS_ALONE,
    PAUSED,
    STEP_TOO_SMALL,
    Problem,
    addresses,
)
from mbsim.dynamics.bodies import configuration
from mbsim.integrators import (
    catalog,
    control,
    galpha,
    galpha_iteration,
    newton,
    radau5,
    scheme,
)
from mbsim.integrators.binding import advancing, bind

RELAX, VAN_DER_POL, ROBERTSON, OSCILLATOR, DECAY, BLOWS_UP, HALF_LINE = range(7)
#: A body of mass 1 on a spring and a damper, driven, with a state z that follows it; a top whose
#: point is held, and that springs and dampers hold; a sphere that falls on a stiff floor.
#: A mass 1 on a rod of length 1 in the xz plane, with the rod's force in f.
BODY, TOP, FLOOR, PENDULUM = range(7, 11)
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
        return 7 if y[0] < 0.5 else 0
    elif kind >= BODY:
        body_rates(kind, given, t, y, f)
    return 0


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
    elif kind == PENDULUM:
        # the rod keeps x.x = 1: its force along x is -(v.v + x.g)
        pull = -(y[7] * y[7] + y[9] * y[9] - 9.81 * y[2]) / (y[0] * y[0] + y[2] * y[2])
        f[7], f[9] = pull * y[0], pull * y[2] - 9.81
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
    if h in (FRICTION_ALONE, IMPACTS_ALONE) or (h > 0.0 and box.numbers[2] == 1):
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


@jitable
def keep_to_rod(box, small):
    """Let the mass of the pendulum move across its rod only; return what is left of a residual."""
    across = np.eye(len(small))
    if box.numbers[0] == PENDULUM:
        x, z = box.at[0], box.at[2]
        square = x * x + z * z
        across[0, 0], across[0, 2] = z * z / square, -x * z / square
        across[2, 0], across[2, 2] = -x * z / square, x * x / square
        small[:] = across @ small @ across + np.eye(len(small)) - across
    return across


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
        across = keep_to_rod(box, small)
        if not invert(small, box.small) or box.numbers[3] == 1:
            return Code.SINGULAR
        box.small[:] = box.small @ across
        for i in range(len(box.at)):
            for j in range(len(small)):
                for k in range(len(small)):
                    box.real[i, first + j] += box.spread[i, k] * box.small[k, j]
        return 0
    work = -box.jacobian
    for i in range(len(work)):
        work[i, i] += c[0]
    good = invert(work, box.real) and box.numbers[3] == 0
    return 0 if good and c[3] == 0.0 and c[1] == c[0] * c[0] and c[2] == c[0] else Code.SINGULAR


def _solve(context, t, h, a, b):
    box = view(context, Box)
    n = len(box.scale)
    r, d = carray(a, (n,)), carray(b, (n,))
    for i in range(n):
        d[i] = 0.0
        for j in range(n):
            d[i] += box.real[i, j] * r[j]
    return 0


def _factor_pair(context, t, h, a, b):
    box, c = view(context, Box), carray(a, (7,))
    work = -box.jacobian + 0j
    number = c[0] + 1j * c[1]
    for i in range(len(work)):
        work[i, i] += number
    good = invert(work, box.pair) and abs(number * number - c[2] - 1j * c[3]) < 1e-9 * abs(c[2])
    return 0 if good and c[4] == c[0] and c[5] == c[1] and c[6] == 0.0 else Code.SINGULAR


def _solve_pair(context, t, h, a, b):
    box = view(context, Box)
    n = len(box.scale)
    r, d = carray(a, (2, n)), carray(b, (2, n))
    for i in range(n):
        total = 0j
        for j in range(n):
            total += box.pair[i, j] * (r[0, j] + 1j * r[1, j])
        d[0, i], d[1, i] = total.real, total.imag
    return 0


def _unit(context, t, h, a, b):
    # quaternions back to unit length, pendulums onto their circle
    y = carray(a, (13,))
    if view(context, Box).numbers[0] == PENDULUM:
        length = math.sqrt(y[0] ** 2 + y[2] ** 2)
        y[0], y[2] = y[0] / length, y[2] / length
        along = y[7] * y[0] + y[9] * y[2]
        y[7], y[9] = y[7] - along * y[0], y[9] - along * y[2]
    length = math.sqrt(y[3] ** 2 + y[4] ** 2 + y[5] ** 2 + y[6] ** 2)
    for i in range(3, 7):
        y[i] /= length
    return 0


def _retract(context, t, h, a, b):
    n = len(view(context, Box).scale)
    configuration.move_on(carray(a, (n,)), h, 1, carray(b, (n,)))
    return 0


def _difference(context, t, h, a, b):
    n = len(view(context, Box).scale)
    return configuration.differ(carray(a, (n,)), t, 1, h, carray(b, (n,)))


def _keep(context, t, h, a, b):
    box = view(context, Box)
    n = len(box.scale)
    y, row = carray(a, (n,)), box.rows[box.numbers[1]]
    row[0] = t
    for i in range(n):
        row[1 + i] = y[i]
    box.numbers[1] += 1
    return 0


HOOKS = {
    "rhs": _rhs,
    "project": zero,
    "norm": _norm,
    "check": one,
    "commit": zero,
    "look": zero,
    "inner": none,
    "limit": far,
    "output": _keep,
    "reject": zero,
}
BOTH = pytest.mark.parametrize("name", ["RADAU5", "GALPHA"])
LINEAR = ("linearise", "factor", "solve", "factor_pair", "solve_pair")


class Run:
    """A method on one of the equations above."""

    def __init__(
        self,
        kind,
        y0,
        given=0.0,
        scale=1.0,
        step=0.0,
        fixed=False,
        rows=0,
        name="RADAU5",
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
        linear = (_linearise, _factor, _solve, _factor_pair, _solve_pair)
        hooks = HOOKS | dict(zip(LINEAR, linear, strict=True))
        hooks["project"] = _unit if bodies else zero
        if bodies:
            hooks |= {"retract": _retract, "difference": _difference}
        self.problem = Problem(int(self._table.ctypes.data), **addresses(hooks, hooks))
        method = catalog.load(name)
        self.state = scheme.make(method, np.array(y0), 0.0, configuration.kinds(bodies, n))
        self.state.memory[scheme.STEP] = step
        self.steps, self._kept = bind(method, self.problem, self.state)

    def __call__(self, end, tol, h_max=math.inf, budget=10**8, times=()):
        advance = advancing()
        times = np.array(times, dtype=float)
        return advance(self.steps, end, tol, h_max, 0.0, times, budget)

    def count(self, name):
        return int(self.state.counts[name])


def fixed_steps(kind, y0, n, end=5.0, tol=1e-10, **more):
    """Return a run of n steps of one length; of its tolerance only Newton's iteration knows."""
    run = Run(kind, y0, step=end / n, fixed=True, **more)
    assert run(end, tol, h_max=end / n) == DONE
    assert run.count(scheme.STEPS) == n
    return run


def body(x=(0.0, 0.0, 0.0), q=(1.0, 0.0, 0.0, 0.0), w=(0.0, 0.0, 0.0), z=()):
    """Return y of a body that does not move along."""
    return np.array([*x, *q, 0.0, 0.0, 0.0, *w, *z])


def test_the_transformation_is_that_of_the_method():
    values = radau5.TI @ np.linalg.inv(radau5.A) @ radau5.T
    g, re, im = radau5.G0, radau5.G_RE, radau5.G_IM
    expected = [[g, 0, 0], [0, re, -im], [0, im, re]]
    # |TI| |A^-1| |T| is 9 at most and A's condition 9, |TI| |T| 1.3; the tables have 17 digits
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
        run = fixed_steps(OSCILLATOR, (1.0, 0.0), n, tol=1e-12)
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
@BOTH
def test_steps_do_not_know_how_stiff_an_equation_is(name, given):
    run = Run(RELAX, (1.0,), given=given, name=name)
    tol, most = (1e-7, 150) if name == "RADAU5" else (1e-4, 190)
    assert run(10.0, tol) == DONE
    assert run.state.y[0] == pytest.approx(math.cos(10.0), abs=tol)
    assert run.count(scheme.STEPS) < most
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


@BOTH
def test_pauses_do_not_change_the_result(name):
    straight, paused = (
        Run(VAN_DER_POL, (2.0, 0.0), given=1e2, scale=1e-3, name=name) for _ in range(2)
    )
    assert straight(2.0, 1e-4) == DONE
    while paused(2.0, 1e-4, budget=1) == PAUSED:
        pass
    assert straight.count(scheme.REJECTED) > 5
    assert paused.state.y.tolist() == straight.state.y.tolist()
    assert paused.state.counts.tolist() == straight.state.counts.tolist()


@BOTH
def test_a_run_goes_on_from_its_saved_arrays(name):
    def fresh():
        return Run(VAN_DER_POL, (2.0, 0.0), given=1e2, scale=1e-3, name=name)

    first = fresh()
    assert first(2.0, 1e-4, budget=300) == PAUSED
    # what the problem keeps is not saved
    first.state.memory[scheme.HAVE_JACOBIAN] = 0.0
    second = fresh()
    for array, saved in zip(second.state, first.state, strict=True):
        array[...] = saved
    assert first(2.0, 1e-4) == second(2.0, 1e-4) == DONE
    assert second.state.y.tolist() == first.state.y.tolist()
    assert second.state.counts.tolist() == first.state.counts.tolist()


@BOTH
def test_ends_at_a_pole_instead_of_hanging(name):
    run = Run(BLOWS_UP, (1.0,), name=name)
    assert run(2.0, 1e-6) == STEP_TOO_SMALL
    assert run.state.memory[scheme.TIME] == pytest.approx(1.0, abs=1e-3)


@BOTH
def test_a_failing_stage_is_tried_nearer(name):
    # no law was meant for y < 0.5, where no solution goes
    run = Run(HALF_LINE, (1.0,), step=40.0, name=name)
    assert run(5.0, 1e-6) == DONE
    assert run.state.y[0] == pytest.approx(0.6 + 0.4 * math.exp(-5.0), abs=1e-5)


@BOTH
def test_a_code_of_the_rhs_ends_the_run(name):
    run = Run(HALF_LINE, (0.4,), name=name)
    assert run(5.0, 1e-6) == FAILED
    assert run.count(scheme.CODE) == 7


@BOTH
def test_a_system_that_cannot_be_solved_is_tried_shorter_to_the_end(name):
    run = Run(DECAY, (1.0,), given=1.0, name=name)
    run.box.numbers[3] = 1
    assert run(5.0, 1e-6) == STEP_TOO_SMALL
    assert run.count(scheme.LAST_REASON) == BY_NEWTON
    assert run.count(scheme.STEPS) == 0


def test_a_problem_without_linearisation_is_refused():
    run = Run(DECAY, (1.0,))
    with pytest.raises(ValueError, match="no linearisation"):
        bind(catalog.load("RADAU5"), run.problem._replace(linearise=0), run.state)


# GALPHA: bodies


def test_the_constants_of_galpha_are_those_of_its_order():
    # Chung and Hulbert: second order, and roots of size RHO at infinity
    am, af, gamma, beta = galpha_iteration.AM, galpha_iteration.AF, galpha.GAMMA, galpha.BETA
    assert gamma == pytest.approx(0.5 - am + af)
    assert beta == pytest.approx(0.25 * (1.0 - am + af) ** 2)
    assert af / (1.0 - af) == pytest.approx(galpha_iteration.RHO)
    assert (am + 1.0) / (2.0 - am) == pytest.approx(galpha_iteration.RHO)
    # one step on x = t^3/6 and on v = t^3/6, with what `a` is there
    shift = galpha.SHIFT
    curve = 0.5 * (1.0 - af) - (1.0 - am) * (0.5 + shift)
    found = (0.5 - beta) * shift + beta * (1.0 + shift) - 1.0 / 6.0
    assert found == pytest.approx(galpha.ERROR_X)
    at_end = 0.5 + shift + curve
    assert (1.0 - am) * at_end + am * curve == pytest.approx((1.0 - af) / 2.0)
    # what it is out of, by the estimate and in truth
    state = scheme.make(galpha.SCHEME, np.zeros(1), 0.0)
    state.k[galpha.A0, 0], state.k[galpha.A1, 0] = curve, at_end
    found = (1.0 - gamma) * curve + gamma * at_end - 1.0 / 6.0
    assert galpha.velocity_error(state, 1.0, 0, 0.5, 1.0) == pytest.approx(found)


def judged(sizes, most=7, tol=1e-4, rest=1.0, late=0.0):
    """Return what `judge` says of corrections of these sizes, and what is kept in memory."""
    state = scheme.make(galpha.SCHEME, np.zeros(1), 0.0)
    state.memory[scheme.TOL], state.memory[scheme.REST] = tol, rest
    words, before, rate = [], 0.0, 0.0
    for iteration, size in enumerate(sizes, 1):
        word, rate = newton.judge(state, iteration, most, size, before, rate, late)
        words.append(word)
        before = size
    return words, state.memory


def test_newtons_iteration_goes_on_while_it_is_worth_it():
    go_on, solved, hopeless = newton.GO_ON, newton.SOLVED, newton.HOPELESS
    state = scheme.make(galpha.SCHEME, np.zeros(1), 0.0)
    state.memory[scheme.TOL] = 1e-4
    assert newton.target(state) == pytest.approx(1e-6)
    # a rate of 0.01 leaves a hundredth of 9e-5: enough
    words, memory = judged([9e-3, 9e-5])
    assert words == [go_on, solved]
    assert memory[scheme.REST] == pytest.approx(0.01 / 0.99)
    # so much is known of the rate before there is one
    assert judged([9e-5], rest=0.01)[0] == [solved]
    # 0.6^4 / 0.4 of 0.36 is far from it; one rate alone is not believed
    words, memory = judged([1.0, 0.6, 0.36])
    assert words == [go_on, go_on, hopeless]
    assert memory[scheme.RETRY] == newton.HALF
    words, memory = judged([1.0, 3.0])
    assert words == [go_on, hopeless]
    assert memory[scheme.RETRY] == newton.QUARTER
    assert judged([math.nan])[0] == [hopeless]
    # but for what is a correction late, and once
    assert judged([1.0, 2.0], late=3.0)[0] == [go_on, go_on]
    assert judged([1.0, 2.0, 1e-9], late=3.0)[0] == [go_on, go_on, solved]
    assert judged([1.0, 3.0], late=3.0)[0] == [go_on, hopeless]
    assert judged([1.0, 2.0, 2.0], late=3.0)[0] == [go_on, go_on, hopeless]
    assert judged([1.0] + [1e-3] * 6, most=7, tol=1e9)[0][0] == solved
    # rounding does not fall any more
    assert judged([2e-6, 2.1e-6])[0] == [go_on, solved]
    assert judged([0.0])[0] == [solved]


def test_the_step_of_an_implicit_method_is_kept_where_it_would_hardly_grow():
    assert control.extrapolated_factor(0.5, 0.5, 4.0, 0.0) == 1.0
    assert control.extrapolated_factor(1e-20, 1.0, 4.0, 0.0) == control.GROW
    assert control.extrapolated_factor(0.1, 0.1, 4.0, 1.0) == pytest.approx(0.9 * 10**0.25)
    # the error grew by ten though the step did not: it will again
    assert control.extrapolated_factor(0.1, 0.01, 4.0, 1.0) == pytest.approx(0.9)
    assert control.extrapolated_factor(0.9, 0.1, 4.0, 1.0) < 0.6


MOVING = {
    "oscillator": (BODY, body(x=(1.0, 0.5, 0.0), w=(1.0, 0.1, 2.0), z=(0.3,)), 1.0),
    "top": (TOP, body(q=(0.9, math.sqrt(0.19), 0.0, 0.0), w=(0.0, 0.0, 8.0)), 0.0),
}


@pytest.fixture(scope="module")
def exact_motions():
    """Return y and f of both at t = 2 by RADAU5, with which an explicit method agrees (below)."""
    found = {}
    for motion, (kind, y0, given) in MOVING.items():
        run = Run(kind, y0, given=given)
        assert run(2.0, 1e-12) == DONE
        found[motion] = run.state.y.copy(), run.state.k[0].copy()
    return found


@pytest.mark.parametrize("motion", MOVING)
def test_radau5_agrees_with_an_explicit_method(exact_motions, motion):
    kind, y0, given = MOVING[motion]
    run = Run(kind, y0, given=given)
    other = catalog.load("DOP853")
    state = scheme.make(other, y0, 0.0)
    steps, _kept = bind(other, run.problem, state)
    advance = advancing()
    assert advance(steps, 2.0, 1e-13, math.inf, 0.0, np.zeros(0), 10**8) == DONE
    np.testing.assert_allclose(exact_motions[motion][0], state.y, rtol=0, atol=1e-10)


def test_radau5_is_of_order_5_on_a_top(exact_motions):
    (kind, y0, given), (y, _) = MOVING["top"], exact_motions["top"]
    errors = {"q": [], "w": []}
    for n in (64, 128, 256):
        off = np.abs(fixed_steps(kind, y0, n, end=2.0, tol=1e-11, given=given).state.y - y)
        errors["q"].append((2.0 / n, off[3:7].max()))
        errors["w"].append((2.0 / n, off[10:13].max()))
    for name, part in errors.items():
        assert observed(part) >= 4.5, (name, part)


@pytest.mark.parametrize("motion", MOVING)
def test_galpha_is_of_order_2_in_positions_velocities_and_accelerations(exact_motions, motion):
    (kind, y0, given), (y, f) = MOVING[motion], exact_motions[motion]
    errors = {"x": [], "q": [], "v": [], "w": [], "z": [], "a": [], "alpha": []}
    for n in (128, 256, 512):
        run = fixed_steps(kind, y0, n, end=2.0, given=given, name="GALPHA")
        h = 2.0 / run.count(scheme.STEPS)
        off, rate = np.abs(run.state.y - y), np.abs(run.state.k[0] - f)
        parts = off[:3], off[3:7], off[7:10], off[10:13], off[13:], rate[7:10], rate[10:13]
        for of_part, part in zip(errors.values(), parts, strict=True):
            of_part.append((h, part.max(initial=0.0)))
    moving = {name: part for name, part in errors.items() if part[-1][1] > 0.0}
    assert len(moving) == (7 if motion == "oscillator" else 3)
    for name, part in moving.items():
        assert observed(part) == pytest.approx(2.0, abs=0.1), (name, part)


def test_galpha_is_of_order_2_where_its_steps_change(exact_motions):
    # a step's error is of order 3: half the step at an eighth of the tolerance
    (kind, y0, given), (y, _) = MOVING["top"], exact_motions["top"]
    errors = []
    for tol in (1e-3, 1e-4, 1e-5, 1e-6):
        run = Run(kind, y0, given=given, name="GALPHA")
        assert run(2.0, tol) == DONE
        errors.append((tol, np.abs(run.state.y - y).max()))
        # two for Newton's iteration, one at the new point; one linearisation does
        assert run.count(scheme.EVALUATIONS) < 3.3 * run.count(scheme.STEPS)
        assert run.count(scheme.JACOBIANS) <= 2
    assert observed(errors) == pytest.approx(2.0 / 3.0, abs=0.05), errors


def test_observed_order_of_dense_output_of_galpha():
    times, errors = np.linspace(0.0, 5.0, 1002)[1:], []
    for n in (40, 80, 160):
        run = Run(OSCILLATOR, (1.0, 0.0), step=5.0 / n, fixed=True, rows=len(times), name="GALPHA")
        assert run(5.0, 1e-10, h_max=5.0 / n, times=times) == DONE
        errors.append((5.0 / n, np.abs(run.box.rows[:, 1] - oscillation(times)).max()))
    assert observed(errors) == pytest.approx(2.0, abs=0.1), errors


@pytest.mark.parametrize(("name", "order"), [("RADAU5", 4.5), ("GALPHA", 1.9)])
def test_orders_under_a_constraint(name, order):
    # accelerations say what the rod's force is
    y0 = body(x=(1.0, 0.0, 0.0))
    exact = Run(PENDULUM, y0)
    assert exact(2.0, 1e-12) == DONE
    errors = {"x": [], "v": [], "a": []}
    for n in (64, 128, 256) if name == "RADAU5" else (128, 256, 512):
        run = fixed_steps(PENDULUM, y0, n, end=2.0, name=name)
        assert math.hypot(run.state.y[0], run.state.y[2]) == pytest.approx(1.0, abs=3e-16)
        off = np.abs(run.state.y - exact.state.y)
        errors["x"].append((2.0 / n, off[:3].max()))
        errors["v"].append((2.0 / n, off[7:10].max()))
        errors["a"].append((2.0 / n, np.abs(run.state.k[0] - exact.state.k[0])[7:10].max()))
    for part in errors.values():
        assert observed(part) >= order, errors
    if name == "GALPHA":
        assert [observed(part) for part in errors.values()] == pytest.approx([2.0] * 3, abs=0.1)


def test_what_is_fast_fades():
    # 1250 radians a step: of the first amplitude RHO^n is left, times a power of n
    left = []
    for n in (30, 60):
        y0 = body(x=(1e-3, 0.0, 0.0), z=(0.0,))
        run = fixed_steps(BODY, y0, n, end=n / 16.0, given=4e8, name="GALPHA")
        left.append(abs(run.state.y[0]))
    assert left[1] < 1e-2 * left[0] < 1e-5, left


@BOTH
def test_a_bounce_on_a_stiff_floor(name):
    # falls 0.05 m onto 1e6 N/m a kg, damped: without loss it would be back at the top
    scale = np.array([0.1] * 3 + [1.0] * 10)
    y0, found = body(x=(0.0, 0.0, 0.05)), {}
    for tol in (1e-4, 1e-6, 1e-9):
        run = Run(FLOOR, y0, given=1e6, scale=scale, name="RADAU5" if tol == 1e-9 else name)
        assert run(0.18, tol, h_max=2e-3) == DONE
        found[tol] = run.state.y
    assert found[1e-9][2] > 0.02
    assert found[1e-9][9] > 0.1
    np.testing.assert_allclose(found[1e-4], found[1e-9], rtol=0, atol=5e-3)
    np.testing.assert_allclose(found[1e-6], found[1e-9], rtol=0, atol=2e-4)


def test_restart_after_a_change_begins_the_acceleration_anew():
    # the force changes at t = 1: with what was kept the next step would be of another motion
    y0 = body(x=(1.0, 0.5, 0.0), z=(0.3,))
    ends = []
    for name, tol in (("GALPHA", 1e-7), ("RADAU5", 1e-10)):
        run = Run(BODY, y0, given=1.0, name=name)
        assert run(1.0, tol) == DONE
        run.box.given[0] = 50.0
        run.state.memory[scheme.HAVE_F] = 0.0
        assert run(2.0, tol) == DONE
        ends.append(run.state.y)
    np.testing.assert_allclose(ends[0], ends[1], rtol=0, atol=5e-4)

"""What an integrator has to keep, on equations that know no bodies and on a free top."""

from __future__ import annotations

import math
from fractions import Fraction
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from numba import carray

import mbsim
from helpers.decks import run_model
from helpers.equations import far, none, observed, one, oscillation, zero
from helpers.folders import MODELS
from mbsim.core import jit
from mbsim.core.address import call_int, pack, view
from mbsim.core.arrays import F1, F2, I1
from mbsim.core.problem import DONE, FAILED, HOOK, PAUSED, STEP_TOO_SMALL, Problem, addresses
from mbsim.integrators import catalog, dop853, scheme
from mbsim.integrators.binding import advancing, bind


def is_explicit(method):
    """Return whether a method has an error estimate and needs no linearisation."""
    return method.order > 0.0 and not method.implicit


METHODS = [
    # the rigid one has the problem take its steps: tests/validation/test_moreau.py
    name
    for name in catalog.SCHEMES
    if name != catalog.RIGID and is_explicit(catalog.load(name))
]
#: Order of the step and of the dense output.
ORDERS = {"DOPRI5": (5, 4), "DOP853": (8, 7)}
BOTH = pytest.mark.parametrize("name", METHODS)


def _oscillator(context, t, h, a, b):
    y, f = carray(a, (2,)), carray(b, (2,))
    f[0] = y[1]
    f[1] = -y[0] + math.sin(2.0 * t)
    return 0


def _kepler(context, t, h, a, b):
    # y = x, y, x', y' of a planet round a sun of strength 1
    y, f = carray(a, (4,)), carray(b, (4,))
    cube = math.sqrt(y[0] * y[0] + y[1] * y[1]) ** 3
    f[0], f[1] = y[2], y[3]
    f[2], f[3] = -y[0] / cube, -y[1] / cube
    return 0


def _strikes(context, t, h, a, b):
    # a spring that is a hundred times as stiff from 0.5 on
    y, f = carray(a, (2,)), carray(b, (2,))
    f[0] = y[1]
    f[1] = -y[0] - 100.0 * max(0.0, y[0] - 0.5)
    return 0


def _strikes_beside(context, t, h, a, b):
    # the same beside something fast and smooth, whose errors of order 3 are far larger
    y, f = carray(a, (4,)), carray(b, (4,))
    f[0] = y[1]
    f[1] = -y[0] - 100.0 * max(0.0, y[0] - 0.5)
    f[2] = 40.0 * y[3]
    f[3] = -40.0 * y[2]
    return 0


def struck(speed, t):
    """Return y of `_strikes` at t from (0, speed), once it is back below 0.5."""
    touch = math.asin(0.5 / speed)
    w, rate = math.sqrt(101.0), speed * math.cos(touch)
    # beyond 0.5 it swings about 50/101, and comes back with the speed that it had
    back = t - touch - 2.0 * math.atan2(rate / w, 0.5 - 50.0 / 101.0) / w
    assert back > 0.0
    x, v = math.cos(back), math.sin(back)
    return np.array([0.5 * x - rate * v, -0.5 * v - rate * x])


def _blows_up(context, t, h, a, b):
    y, f = carray(a, (2,)), carray(b, (2,))
    f[0] = y[0] * y[0]
    f[1] = 0.0
    return 0


def _rough(context, t, h, a, b):
    y, f = carray(a, (2,)), carray(b, (2,))
    f[0] = y[1]
    f[1] = -y[0] + (1.0 if math.sin(7.0 * t) > 0.0 else -1.0)
    return 0


def _refuses(context, t, h, a, b):
    y, f = carray(a, (2,)), carray(b, (2,))
    f[0] = 0.6 - y[0]
    f[1] = 0.0
    return 7 if y[0] < 0.5 else 0


def _turns(context, t, h, a, b):
    y, f = carray(a, (2,)), carray(b, (2,))
    f[0], f[1] = -3.0 * y[1], 3.0 * y[0]
    return 0


def _to_the_circle(context, t, h, a, b):
    y = carray(a, (2,))
    length = math.sqrt(y[0] * y[0] + y[1] * y[1])
    y[0] /= length
    y[1] /= length
    return 0


def _norm2(context, t, h, a, b):
    e = carray(a, (2,))
    return math.sqrt(e[0] * e[0] + e[1] * e[1])


def _norm4(context, t, h, a, b):
    e = carray(a, (4,))
    return math.sqrt(e[0] * e[0] + e[1] * e[1] + e[2] * e[2] + e[3] * e[3])


class Table(NamedTuple):
    """Rows that `_keep` writes: t, y0, y1; and numbers of the equation."""

    rows: F2
    used: I1
    numbers: F1


def _keep(context, t, h, a, b):
    table, y = view(context, Table), carray(a, (2,))
    row = table.rows[table.used[0]]
    row[0], row[1], row[2] = t, y[0], y[1]
    table.used[0] += 1
    return 0


def _comes_to_rest(context, t, h, a, b):
    y, f = carray(a, (2,)), carray(b, (2,))
    numbers = view(context, Table).numbers
    f[0] = y[1]
    f[1] = -numbers[0] * y[0] - numbers[1] * y[1]
    return 0


def _speed(context, t, h, a, b):
    # as of a body on a stiff contact: its position counts next to nothing
    e = carray(a, (2,))
    return max(abs(e[1]), abs(e[0]))


ECCENTRICITY = 0.3
PERIHELION = (1.0 - ECCENTRICITY, 0.0, 0.0, math.sqrt((1 + ECCENTRICITY) / (1 - ECCENTRICITY)))


def planet(t):
    """Return the place of the planet that passed its perihelion at t = 0, by Kepler's equation."""
    anomaly = t
    for _ in range(60):
        anomaly = t + ECCENTRICITY * math.sin(anomaly)
    across = math.sqrt(1.0 - ECCENTRICITY**2) * math.sin(anomaly)
    return np.array([math.cos(anomaly) - ECCENTRICITY, across])


def make_problem(rhs, context=0, norm=_norm2, output=zero, project=zero):
    hooks = dict(
        rhs=rhs, project=project, norm=norm, check=one, commit=zero, look=zero, inner=none,
        limit=far, output=output, reject=zero,
    )  # fmt: skip
    return Problem(context, **addresses(hooks, hooks))


def _fails(context, t, h, a, b):
    return 77


def _answers_less_a_code(context, t, h, a, b):
    return -77


def _half(context, t, h, a, b):
    return 0.5


@pytest.fixture(scope="module")
def oscillator():
    return make_problem(_oscillator)


def empty_table(rows, numbers=()):
    """Return a table with room for so many rows, and its packed form."""
    table = Table(np.zeros((rows, 3)), np.zeros(1, dtype=np.int64), np.array(numbers, dtype=float))
    return table, pack(table)


class Run:
    """One method on one problem."""

    def __init__(self, name, problem, y0=(1.0, 0.0), step=0.0):
        method = catalog.load(name)
        self.problem, self.state = problem, scheme.make(method, np.array(y0), 0.0)
        self.state.memory[scheme.STEP] = step
        self.steps, self._kept = bind(method, problem, self.state)

    def __call__(self, end, tol, h_max=math.inf, budget=10**8, times=()):
        advance = advancing()
        times = np.array(times, dtype=float)
        return advance(self.steps, end, tol, h_max, 0.0, times, budget)


def at_least_the_order(order, name):
    # DOP853 has small coefficients: the next order shows as well
    return order == pytest.approx(5.0, abs=0.3) if name == "DOPRI5" else 7.5 <= order < 10.0


@BOTH
def test_observed_order_on_an_oscillator(oscillator, name):
    errors = []
    for n in (20, 40, 80) if name == "DOPRI5" else (8, 16, 32):
        # a loose tolerance: h_max decides, so the step is fixed
        run = Run(name, oscillator, step=5.0 / n)
        run(5.0, 1e9, h_max=5.0 / n)
        count = run.state.counts[scheme.STEPS]
        errors.append((5.0 / count, abs(run.state.y[0] - oscillation(5.0))))
    assert at_least_the_order(observed(errors), name), errors


@BOTH
def test_observed_order_on_a_planet(name):
    problem = make_problem(_kepler, norm=_norm4)
    errors = []
    for n in (128, 256, 512) if name == "DOPRI5" else (32, 64, 128):
        run = Run(name, problem, y0=PERIHELION, step=8.0 / n)
        run(8.0, 1e9, h_max=8.0 / n)
        assert run.state.counts[scheme.STEPS] == n
        errors.append((8.0 / n, np.abs(run.state.y[:2] - planet(8.0)).max()))
    assert at_least_the_order(observed(errors), name), errors


@BOTH
def test_observed_order_of_dense_output(name):
    times = np.linspace(0.0, 5.0, 1002)[1:]
    errors = []
    for n in (16, 64) if name == "DOPRI5" else (8, 16):
        table, packed = empty_table(len(times))
        run = Run(name, make_problem(_oscillator, int(packed.ctypes.data), output=_keep))
        run.state.memory[scheme.STEP] = 5.0 / n
        run(5.0, 1e9, h_max=5.0 / n, times=times)
        assert table.rows[:, 0].tolist() == times.tolist()
        worst = np.abs(table.rows[:, 1] - oscillation(times)).max()
        errors.append((5.0 / run.state.counts[scheme.STEPS], worst))
    assert observed(errors) > ORDERS[name][1] - 0.1, errors


@BOTH
@pytest.mark.parametrize("damping", [0.3, 0.5, 0.7, 1.0, 3.0])
def test_rows_at_the_bound_of_stability_are_as_good_as_the_steps(name, damping):
    # at rest stability bounds the step, and the polynomial is off by far more than the step is:
    # rows of DOP853 were off by 13 to 400 tol; it is largest where the rates are not real
    most, rate = (3.0 if damping >= 1.0 else 20.0), 100.0
    times = 5.0 + 0.53 * np.arange(100)
    for tol in (1e-3, 1e-5, 1e-7):
        table, packed = empty_table(len(times) + 1, (rate**2, 2.0 * damping * rate))
        hooks = {"norm": _speed, "output": _keep}
        problem = make_problem(_comes_to_rest, int(packed.ctypes.data), **hooks)
        run = Run(name, problem, y0=(0.0, 1.0))
        assert run(60.0, tol, times=times) == DONE
        assert np.abs(table.rows[:, 2]).max() < most * tol
        assert np.abs(table.rows[:, 1]).max() < 1.5 * most * tol / rate


@BOTH
def test_dense_output_costs_nothing_where_none_is_due(oscillator, name):
    silent, talking = Run(name, oscillator), Run(name, oscillator)
    silent(5.0, 1e-6)
    talking(5.0, 1e-6, times=[2.5])
    more = talking.state.counts - silent.state.counts
    assert more[scheme.STEPS] == 0
    assert more[scheme.EVALUATIONS] == (0 if name == "DOPRI5" else 4)
    assert talking.state.y.tolist() == silent.state.y.tolist()


@BOTH
def test_error_falls_with_the_tolerance_down_to_rounding(oscillator, name):
    errors = []
    for tol in 10.0 ** -np.arange(3, 15):
        run = Run(name, oscillator)
        assert run(5.0, tol) == DONE
        errors.append(abs(run.state.y[0] - oscillation(5.0)))
    assert errors[-1] < 1e-13
    assert errors[0] / errors[-1] > 1e7
    for looser, tighter in zip(errors, errors[2:], strict=False):
        assert tighter < max(looser, 1e-14), errors


@BOTH
def test_a_bounded_number_of_evaluations_a_call(oscillator, name):
    run = Run(name, oscillator)
    assert run(5.0, 1e-12, budget=60) == PAUSED
    assert run.state.counts[scheme.EVALUATIONS] <= 60 + 16


@BOTH
@pytest.mark.parametrize("rhs", [_oscillator, _rough])
def test_pauses_do_not_change_the_result(name, rhs):
    # the second has rejected steps: a pause may fall between one and the next try
    problem = make_problem(rhs)
    straight, paused = Run(name, problem), Run(name, problem)
    straight(5.0, 1e-8)
    while paused(5.0, 1e-8, budget=1) == PAUSED:
        pass
    assert (straight.state.counts[scheme.REJECTED] > 5) == (rhs is _rough)
    assert paused.state.y.tolist() == straight.state.y.tolist()
    assert paused.state.counts.tolist() == straight.state.counts.tolist()


@BOTH
def test_ends_at_a_pole_instead_of_hanging(name):
    # y' = y^2, y(0) = 1 has a pole at t = 1
    run = Run(name, make_problem(_blows_up))
    assert run(2.0, 1e-8) == STEP_TOO_SMALL
    assert run.state.memory[scheme.TIME] == pytest.approx(1.0, abs=1e-3)


@BOTH
def test_h_max_is_kept(oscillator, name):
    run = Run(name, oscillator)
    run(5.0, 1e-2, h_max=0.05)
    assert run.state.memory[scheme.H_LARGEST] <= 0.05


@BOTH
def test_a_failing_step_is_tried_nearer_and_told(name):
    # no law was meant for y < 0.5: the rhs refuses it, and the solution stays above
    run = Run(name, make_problem(_refuses), y0=(1.0, 0.0), step=4.0)
    assert run(5.0, 1e-6) == DONE
    assert run.state.counts[scheme.REJECTED] > 0
    assert run.state.y[0] == pytest.approx(0.6 + 0.4 * math.exp(-5.0), abs=1e-5)


@BOTH
def test_stays_on_the_manifold_and_begins_the_next_step_there(name):
    run = Run(name, make_problem(_turns, project=_to_the_circle))
    assert run(5.0, 1e-6) == DONE
    y0, y1 = run.state.y
    assert math.hypot(y0, y1) == pytest.approx(1.0, abs=3e-16)
    assert run.state.k[0].tolist() == [-3.0 * y1, 3.0 * y0]
    assert [y0, y1] == pytest.approx([math.cos(15.0), math.sin(15.0)], abs=1e-4)


def top_run(folder, name, steps_a_second):
    """Run the free top for 2 s with steps of one length; return its results."""
    text = (MODELS / "free_top.xml").read_text(encoding="utf-8")
    h_max = f'<Param_Transient h_max="{1 / steps_a_second!r}"/>'
    path = Path(folder) / "top.xml"
    path.write_text(text.replace("<Command>", f"<Command>{h_max}"), encoding="utf-8")
    deck = mbsim.read_model(path)
    return mbsim.simulate(deck, end_time=2.0, print_interval=0.01, tol=0.1, integrator=name)


@BOTH
def test_observed_orders_on_the_free_top(tmp_path, name):
    exact = run_model(
        "free_top.xml", end_time=2.0, print_interval=0.01, tol=1e-13, integrator="DOP853"
    )["bodies/2/quaternion"]
    at_end, dense = [], []
    for steps in (64, 128) if name == "DOPRI5" else (16, 32):
        results = top_run(tmp_path, name, steps)
        assert 2 * steps <= results.stats["steps"] <= 2 * steps + 8
        errors = np.abs(results["bodies/2/quaternion"] - exact).max(axis=1)
        at_end.append((1 / steps, errors[-1]))
        dense.append((1 / steps, errors.max()))
    assert at_least_the_order(observed(at_end), name), at_end
    assert observed(dense) > ORDERS[name][1] - 0.1, dense


def test_the_table_of_dop853_is_the_published_one():
    table = pytest.importorskip("scipy.integrate._ivp.dop853_coefficients")
    np.testing.assert_array_equal(dop853.A, table.A)
    np.testing.assert_array_equal(dop853.C, table.C)
    np.testing.assert_array_equal(dop853.D, table.D)
    np.testing.assert_array_equal(dop853.E5[0], table.E5[:12])
    np.testing.assert_allclose(dop853.E3[0], table.E3[:12], rtol=0, atol=1e-17)


def test_the_table_of_dop853_meets_the_conditions_of_its_order():
    # exactly, in rational numbers; what is left over is what rounding each coefficient leaves
    def exactly(row):
        return [Fraction(float(x)) for x in row]

    half = Fraction(1, 2**53)
    A, C = [exactly(row) for row in dop853.A], exactly(dop853.C)
    B = A[12]
    for row, c in zip(A, C, strict=True):
        assert abs(sum(row) - c) <= half * (sum(map(abs, row)) + abs(c))
    for k in range(8):
        powers = [c**k for c in C]
        terms = [b * power for b, power in zip(B, powers, strict=True)]
        assert abs(sum(terms) - Fraction(1, k + 1)) <= half * (k + 1) * sum(map(abs, terms))
        if k == 7:
            break
        # sum b_i a_ij c_j^k = 1 / ((k+1) (k+2)): the trees of height 2 up to order 8
        terms = [
            b * a * power
            for b, row in zip(B, A, strict=True)
            for a, power in zip(row, powers, strict=True)
        ]
        missing = abs(sum(terms) - Fraction(1, (k + 1) * (k + 2)))
        assert missing <= half * (k + 2) * sum(map(abs, terms))
    # an error estimate is blind to what its lower order integrates exactly
    for weights, orders in ((dop853.E5[0], 5), (dop853.E3[0], 3)):
        for k in range(orders):
            terms = [e * c**k for e, c in zip(exactly(weights), C[:12], strict=True)]
            # the weights themselves are differences from b
            room = sum(abs(b) * c**k for b, c in zip(B[:12], C[:12], strict=True))
            assert abs(sum(terms)) <= half * ((k + 1) * sum(map(abs, terms)) + room)


def test_error_of_dop853_joins_both_estimates():
    assert dop853.combined_error(0.0, 1.0) == 0.0
    assert dop853.combined_error(3.0, 0.0) == 3.0
    assert dop853.combined_error(3.0, 40.0) == pytest.approx(9.0 / 5.0)
    assert math.isnan(dop853.combined_error(math.inf, math.inf))


def _largest(context, t, h, a, b):
    # as the norm of a mechanism is
    e, largest = carray(a, (4,)), 0.0
    for i in range(4):
        largest = max(largest, abs(e[i]))
    return largest


@pytest.mark.parametrize(("beside", "tol"), [(False, 1e-7), (False, 1e-9), (True, 1e-9)])
def test_no_step_over_a_bend_is_taken_where_an_estimate_vanishes_by_chance(beside, tol):
    # two bends, at a thousand places in the steps: half of the errors are below 3 tol, the largest
    # is 32 to 35 tol, and was 170 and 4600 tol (beside what is fast more than 80)
    problem, worst = make_problem(_strikes), 0.0
    if beside:
        problem = make_problem(_strikes_beside, norm=_largest)
    for speed in np.linspace(1.0, 1.5, 1000):
        run = Run("DOP853", problem, y0=(0.0, speed, 0.0, 1.0)[: 4 if beside else 2])
        assert run(1.0, tol) == DONE
        worst = max(worst, np.abs(run.state.y[:2] - struck(speed, 1.0)).max())
    assert worst < 80.0 * tol


def _verlet(context, t, h, a, b):
    # velocity Verlet of (x, v): one evaluation a step, no error estimate
    p, m = scheme.in_workspace(context)
    m.counts[scheme.EVALUATIONS] += 1
    m.trial[0] = m.y[0] + h * (m.y[1] + 0.5 * h * m.k[0, 1])
    m.trial[1] = m.y[1]
    code = call_int(p.rhs, (p.context, t + h, h, m.trial, m.k[1]))
    m.trial[1] = m.y[1] + 0.5 * h * (m.k[0, 1] + m.k[1, 1])
    m.k[1, 0] = m.trial[1]
    return code


def _cubic(context, t, h, a, b):
    _, m = scheme.in_workspace(context)
    for i in range(2):
        rise = m.trial[i] - m.y[i]
        m.dense[0, i], m.dense[1, i] = m.y[i], rise
        m.dense[2, i] = h * m.k[0, i] - rise
        m.dense[3, i] = 2.0 * rise - h * (m.k[0, i] + m.k[1, i])
    return 0


def test_the_driver_serves_a_method_without_an_error_estimate(oscillator):
    errors = []
    attempt, cubic = (jit.address(f, HOOK) for f in (_verlet, _cubic))
    for n in (100, 200):
        run = Run("DOPRI5", oscillator)
        method = scheme.Scheme(_verlet, _cubic, stages=2, last=1, dense=4, order=0.0)
        run.state = scheme.make(method, np.array([1.0, 0.0]), 0.0)
        bound, run.kept = bind(catalog.load("DOPRI5"), oscillator, run.state)
        run.steps = bound._replace(attempt=attempt, fit_dense=cubic, last=1, order=0.0)
        assert run(5.0, 1e-5, h_max=5.0 / n, times=[0.33, 4.9]) == DONE
        assert run.state.counts[scheme.STEPS] == n
        assert run.state.counts[scheme.EVALUATIONS] == n + 1
        assert run.state.memory[scheme.H_LARGEST] == pytest.approx(5.0 / n)
        errors.append((5.0 / n, abs(run.state.y[0] - oscillation(5.0))))
    assert observed(errors) == pytest.approx(2.0, abs=0.1)


#: Hooks that act, and those that answer: their codes are negative.
ACT, ANSWER = (
    ("rhs", "project", "look", "reject"),
    (
        "switching",
        "happens",
        "commit",
        "arrive",
        "output",
    ),
)


@BOTH
@pytest.mark.parametrize("hook", [*ACT, *ANSWER])
def test_a_hook_that_fails_ends_the_run_with_its_code(name, hook):
    made = {hook: _fails if hook in ACT else _answers_less_a_code}
    if hook == "look":
        made["inner"] = _half
    # the other problems of this file have no events and no branches
    problem = make_problem(_rough if hook == "reject" else _oscillator)
    run = Run(name, problem._replace(**addresses(made, made)), step=0.1)
    assert run(5.0, 1e-8, times=[1.0, 2.0]) == FAILED
    assert run.state.counts[scheme.CODE] == 77

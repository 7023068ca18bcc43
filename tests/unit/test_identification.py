"""Fits of curves that are formulas: what is reported is what statistics say of them."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mbsim.errors import Interrupted, SolverError
from mbsim.results.units import POSITION, SPIN, TORQUE, UnitSystem, factor_from, in_si
from mbsim.studies.account import facts, lines_of, page
from mbsim.studies.differences import LADDER, NoDifference, checked_jacobian, jacobian
from mbsim.studies.identify import identify
from mbsim.studies.judge import UNSEEN
from mbsim.studies.outputs import Output
from mbsim.studies.problem import TIME, Problem, Unknown
from mbsim.studies.records import Record, between
from mbsim.studies.rounds import Rounds
from mbsim.studies.study import Study
from mbsim.studies.worker import FINISHED, Row, failed

T = np.linspace(0.0, 1.0, 101)


class Formulas:
    """A pool that needs no simulation: curves by name of record, of the parameters' values."""

    def __init__(self, curves, stop_after=math.inf):
        self.curves, self.stop_after, self.ran, self.closed = curves, stop_after, 0, False

    def share(self, cases, count):
        for case in cases:
            self.ran += 1
            if self.ran > self.stop_after:
                raise KeyboardInterrupt
            try:
                found = {name: of(**case.values) for name, of in self.curves.items()}
            except ArithmeticError as error:
                yield failed(case.run, str(error))
                continue
            outputs = {name: list(x) for name, x in found.items()}
            yield Row(case.run, FINISHED, "", {TIME: T.tolist(), **outputs}, 1, 1)

    def close(self):
        self.closed = True


def record(value, sd=0.1, name="x", **more):
    stated = None if sd is None else np.full(len(T), sd)
    usual = {"offset": 0.0, "unit": "m", "missing": 0, "weight": 1.0}
    return Record(name, Path("x.csv"), "s", "x", T, value, stated, **{**usual, **more})


def problem(unknowns, records, **more):
    study = Study(
        file=Path("s.toml"),
        model=Path("m.xml"),
        design="random",
        runs=1,
        seed=1,
        csv=None,
        keep=(),
        options={},
        spreads={},
        paths={},
        outputs=(Output(TIME, signal="time", reduce="curve"),),
    )
    usual = {"starts": 1, "most_iterations": 50}
    return Problem(study, tuple(unknowns), tuple(records), **{**usual, **more})


def line(a, b):
    return a + b * T


LINE = [Unknown("a", 4.0, -10.0, 10.0), Unknown("b", -5.0, -10.0, 10.0)]


def noise(seed, sd=0.1):
    return sd * np.random.default_rng(seed).standard_normal(len(T))


def test_a_line_has_the_estimate_and_covariance_of_linear_regression():
    y = line(1.0, 2.0) + noise(1)
    found = identify(problem(LINE, [record(y)]), Formulas({"x": line}))
    A = np.stack([np.ones_like(T), T], axis=1)
    exact = np.linalg.lstsq(A, y, rcond=None)[0]
    covariance = 0.1**2 * np.linalg.inv(A.T @ A)
    judged = found.judged
    assert [p.estimate for p in judged.parameters] == pytest.approx(exact, rel=1e-6)
    assert judged.covariance == pytest.approx(covariance, rel=1e-6)
    root = np.sqrt(np.diag(covariance))
    assert judged.correlation == pytest.approx(covariance / np.outer(root, root), rel=1e-6)
    chi_square = float(np.sum(((y - A @ exact) / 0.1) ** 2))
    assert judged.misfit.chi_square == pytest.approx(chi_square)
    assert judged.misfit.degrees_of_freedom == 99
    assert judged.misfit.explained
    band = 1.959964 * np.sqrt(np.einsum("ij,jk,ik->i", A, covariance, A))
    assert judged.records[0].band == pytest.approx(band, rel=1e-5)
    assert found.added == pytest.approx([1.0, 1.0], rel=1e-4)
    assert found.warnings == []


def test_without_a_stated_noise_it_follows_from_the_residuals():
    y = line(1.0, 2.0) + noise(1)
    found = identify(problem(LINE, [record(y, sd=None)]), Formulas({"x": line}))
    A = np.stack([np.ones_like(T), T], axis=1)
    left = y - A @ np.linalg.lstsq(A, y, rcond=None)[0]
    covariance = left @ left / 99 * np.linalg.inv(A.T @ A)
    assert found.judged.covariance == pytest.approx(covariance, rel=1e-5)
    assert found.judged.misfit.probability is None
    assert "not stated" in found.judged.misfit.text


def test_a_weight_is_no_smaller_noise():
    y, z = line(1.0, 2.0) + noise(1), 3.0 * line(1.0, 2.0) + noise(2, 0.5)
    records = [record(y), record(z, 0.5, "y", weight=4.0)]
    pool = Formulas({"x": line, "y": lambda a, b: 3.0 * line(a, b)})
    found = identify(problem(LINE, records), pool)
    A = np.stack([np.ones_like(T), T], axis=1)
    J = np.concatenate([A / 0.1, 3.0 * A / 0.5])
    W = np.repeat([1.0, 4.0], len(T))
    inverse = np.linalg.inv(J.T * W @ J)
    assert found.judged.covariance == pytest.approx(inverse @ (J.T * W**2 @ J) @ inverse, rel=1e-6)


def test_a_prior_draws_as_much_as_it_weighs():
    y = line(1.0, 2.0) + noise(1)
    unknowns = [LINE[0], replace(LINE[1], prior=(2.1, 0.05))]
    found = identify(problem(unknowns, [record(y)]), Formulas({"x": line}))
    A = np.stack([np.ones_like(T), T], axis=1)
    normal = A.T @ A / 0.1**2 + np.diag([0.0, 400.0])
    exact = np.linalg.solve(normal, A.T @ y / 0.1**2 + [0.0, 840.0])
    assert [p.estimate for p in found.judged.parameters] == pytest.approx(exact, rel=1e-5)
    assert found.judged.covariance == pytest.approx(np.linalg.inv(normal), rel=1e-5)


def test_the_truth_is_within_two_standard_deviations_as_often_as_it_should():
    def decay(a, k):
        return a * np.exp(-k * T)

    unknowns = [Unknown("a", 1.8, 0.1, 10.0), Unknown("k", 4.0, 0.1, 50.0, log=True)]
    hits, explained = np.zeros(2), 0
    for seed in range(100):
        y = decay(2.0, 5.0) + noise(seed)
        judged = identify(problem(unknowns, [record(y)]), Formulas({"x": decay})).judged
        explained += judged.misfit.explained
        for k, (p, true) in enumerate(zip(judged.parameters, (2.0, 5.0), strict=True)):
            hits[k] += p.interval[0] <= true <= p.interval[1]
    assert np.all((hits >= 90) & (hits <= 99)), hits
    assert explained >= 98


def test_a_parameter_that_the_record_does_not_see_has_no_number():
    y = line(1.0, 2.0) + noise(1)
    unknowns = [*LINE, Unknown("c", 0.3, 0.0, 1.0)]
    found = identify(problem(unknowns, [record(y)]), Formulas({"x": lambda a, b, c: line(a, b)}))
    parameter = found.judged.parameters[2]
    assert (parameter.why, parameter.estimate, parameter.sd) == ("not seen", None, None)
    assert "c: the record does not see it: it has no estimate" in found.warnings
    assert found.judged.parameters[0].sd == pytest.approx(0.0197, rel=0.01)
    about = facts(found)
    assert about["parameters"]["c"]["estimate"] is None
    assert about["covariance"][2] == [None, None, None]
    assert about["identifiability"][2]["sd"] is None
    assert any(text.startswith("c = - (not seen: held at") for text in lines_of(found))
    # nor one that it hardly sees
    pool = Formulas({"x": lambda a, b, c: line(a, b) + 0.01 * c * np.sin(40.0 * T)})
    found = identify(problem(unknowns, [record(y)]), pool)
    assert found.judged.parameters[2].why == "not seen"


def test_a_combination_that_is_not_seen_is_named():
    unknowns = [Unknown(name, 1.5, 0.1, 10.0, log=True) for name in "ab"]
    y = 2.0 * T + noise(1)
    found = identify(problem(unknowns, [record(y)]), Formulas({"x": lambda a, b: a * b * T}))
    assert [p.why for p in found.judged.parameters] == ["not seen", "not seen"]
    seen, unseen = found.judged.directions
    assert seen.seen
    assert not unseen.seen
    assert unseen.text in ("0.71 a - 0.71 b", "0.71 b - 0.71 a")
    assert f"not seen: {unseen.text} (in parts of the ranges)" in found.warnings
    values = found.problem.values(found.best.z)
    assert values["a"] * values["b"] == pytest.approx(2.0, rel=0.05)


def test_a_model_that_is_wrong_is_said_to_be():
    y = line(1.0, 2.0) + 0.15 * np.sin(9.0 * T) + noise(1)
    found = identify(problem(LINE, [record(y)]), Formulas({"x": line}))
    misfit = found.judged.misfit
    assert not misfit.explained
    assert misfit.probability < 1e-3
    assert misfit.text.startswith("the model does not explain the record: chi-square")
    assert misfit.s > 1.0
    assert misfit.text in found.warnings
    # where the noise is not stated, the residuals tell
    found = identify(problem(LINE, [record(y, sd=None)]), Formulas({"x": line}))
    assert not found.judged.misfit.explained
    assert "hang together" in found.judged.misfit.text


def test_an_estimate_at_a_bound_has_no_standard_deviation():
    y = line(1.0, 2.0) + noise(1)
    unknowns = [LINE[0], Unknown("b", 0.5, 0.0, 1.0)]
    judged = identify(problem(unknowns, [record(y)]), Formulas({"x": line})).judged
    assert judged.parameters[1].why == "at its upper bound"
    assert judged.parameters[1].estimate == pytest.approx(1.0, abs=0.01)
    assert judged.parameters[1].sd is None


def test_an_unknown_time_offset_is_found():
    def wave(a, shift):
        return a * np.sin(12.0 * T)

    late = record(2.0 * np.sin(12.0 * (T[10:-10] + 0.03)) + noise(1)[10:-10], offset="shift")
    late = replace(late, time=T[10:-10], sd=late.sd[10:-10])
    unknowns = [Unknown("a", 1.0, 0.1, 10.0), Unknown("shift", 0.0, -0.1, 0.1)]
    found = identify(problem(unknowns, [late]), Formulas({"x": wave}))
    for p, true in zip(found.judged.parameters, (2.0, 0.03), strict=True):
        assert abs(p.value - true) < 3.0 * p.sd


def test_more_starts_find_what_one_does_not():
    def wave(w):
        return np.sin(w * T)

    unknown = [Unknown("w", 5.0, 1.0, 60.0)]
    y = wave(40.0) + noise(1)
    one = identify(problem(unknown, [record(y)]), Formulas({"x": wave}))
    assert not one.judged.misfit.explained
    many = problem(unknown, [record(y)], starts=20)
    found = identify(many, Formulas({"x": wave}))
    assert found.judged.misfit.explained
    assert found.judged.parameters[0].value == pytest.approx(40.0, abs=0.2)
    assert len(found.fits) == 20
    # whichever thread is first
    assert np.array_equal(identify(many, Formulas({"x": wave})).best.z, found.best.z)


def test_another_minimum_that_is_as_good_is_said():
    unknown = [Unknown("a", 1.0, -3.0, 3.0)]
    pool = Formulas({"x": lambda a: a * a * T})
    found = identify(problem(unknown, [record(2.0 * T + noise(1))], starts=8), pool)
    assert any("another point fits as well: a = " in text for text in found.warnings)


def test_a_fit_steps_back_from_runs_that_fail():
    def root(a, b):
        if a < 0.9:
            raise ArithmeticError("a is too small")
        return line(a, b)

    y = line(1.0, 2.0) + noise(1)
    unknowns = [replace(LINE[0], start=9.0), LINE[1]]
    found = identify(problem(unknowns, [record(y)]), Formulas({"x": root}))
    assert found.best.ended == "converged"
    # the first trial point of a line is the end: beyond it nothing is asked for but differences
    tight = identify(
        problem([Unknown("a", 9.0, 0.0, 10.0)], [record(np.full(101, 0.95) + noise(1))]),
        Formulas({"x": lambda a: root(a, 0.0) ** 3}),
    )
    assert tight.best.ended == "converged"
    assert tight.judged.parameters[0].sd is not None

    def cliff(a):
        if a < 1.0:
            raise ArithmeticError("a is too small")
        return 0.2 / (a - 0.8) + 0.0 * T

    steep = identify(
        problem([Unknown("a", 5.0, 0.0, 10.0)], [record(0.2 / 0.25 + noise(1))]),
        Formulas({"x": cliff}),
    )
    assert steep.judged.parameters[0].value == pytest.approx(1.05, abs=0.02)
    failures = sum(count for count, _ in steep.reasons)
    assert steep.best.stepped_back == 0 or any("stepped back" in text for text in steep.warnings)
    assert failures == 0 or steep.reasons[0][1] == "a is too small"


def test_a_problem_whose_runs_all_fail_is_an_error():
    def nothing(a, b):
        raise ArithmeticError("no")

    with pytest.raises(SolverError, match="the run at every start failed: no"):
        identify(problem(LINE, [record(line(1.0, 2.0))], starts=3), Formulas({"x": nothing}))


def test_an_interrupted_fit_keeps_the_best_so_far():
    def decay(a, b):
        return a * np.exp(-b * T)

    y = decay(2.0, 5.0) + noise(1)
    whole = identify(problem(LINE, [record(y)]), Formulas({"x": decay}))
    with pytest.raises(Interrupted):
        identify(problem(LINE, [record(y)]), Formulas({"x": decay}, stop_after=0))
    pool = Formulas({"x": decay}, stop_after=whole.runs // 2)
    found = identify(problem(LINE, [record(y)]), pool)
    assert found.stopped
    assert pool.closed
    assert found.judged is None
    assert np.isfinite(found.best.cost)
    about = facts(found)
    assert about["status"] == "stopped"
    assert set(about["best"]) == {"a", "b"}
    assert "covariance" not in about
    assert "no covariance" in page(found)
    # and with it where Ctrl-C came after the runs beside the best point
    pool = Formulas({"x": decay}, stop_after=whole.runs - 1)
    found = identify(problem(LINE, [record(y)]), pool)
    assert found.stopped
    assert found.judged.parameters[0].sd == whole.judged.parameters[0].sd


def test_steps_of_differences_avoid_noise_and_curvature():
    rng = np.random.default_rng(1)

    def ask_of(curve, sd):
        return lambda points: [curve(p) + sd * rng.standard_normal(len(T)) for p in points]

    z = np.array([0.4, 0.6])

    def bent(z):
        return np.sin(30.0 * z[0] * T) + z[1] ** 2

    exact = np.stack([30.0 * T * np.cos(30.0 * z[0] * T), np.full_like(T, 2.0 * z[1])], axis=1)
    clean = checked_jacobian(ask_of(bent, 0.0), z, bent(z), None)
    rough = checked_jacobian(ask_of(bent, 1e-4), z, bent(z), None)
    for found in (clean, rough):
        for k in range(2):
            off = np.linalg.norm(found.columns[:, k] - exact[:, k])
            size = np.linalg.norm(exact[:, k])
            assert off < 3.0 * found.discrepancy[k] * size + 1e-9
            assert off < 0.02 * size
    assert np.all(rough.steps > clean.steps)
    # nothing but noise
    lost = checked_jacobian(ask_of(lambda p: 0.0 * T, 1e-4), z, 0.0 * T, None)
    assert np.all(lost.discrepancy > 0.3)


def test_differences_keep_within_the_bounds_and_away_from_what_fails():
    asked = []

    def ask(points):
        asked.extend(points)
        return [None if p[1] > 0.5 else p[0] ** 2 + p[1] * T for p in points]

    z = np.array([0.0, 0.5])
    found = jacobian(ask, z, 0.5 * T, np.full(2, LADDER[0]))
    assert found[:, 0] == pytest.approx(0.0, abs=1e-12)
    assert found[:, 1] == pytest.approx(T, abs=1e-9)
    assert min(p.min() for p in asked) >= 0.0
    with pytest.raises(NoDifference):
        jacobian(lambda points: [None] * len(points), z, 0.5 * T, np.full(2, LADDER[0]))


def test_rounds_hand_a_fault_of_a_fit_on():
    rounds = Rounds(problem(LINE, [record(line(1.0, 2.0))]), Formulas({"x": line}))

    def broken(ask):
        ask([np.array([0.5, 0.5])])
        raise ZeroDivisionError("ours")

    (one, two) = rounds.drive([broken, lambda ask: len(ask([np.array([0.5, 0.5])]))])
    assert isinstance(one, ZeroDivisionError)
    assert two == 1
    assert rounds.runs == 1


def test_between_rows_a_curve_is_smooth_and_a_jump_stays_one():
    t = np.linspace(0.0, 1.0, 51)
    wanted = np.linspace(0.0, 1.0, 333)
    assert between(t, np.sin(6.0 * t), wanted) == pytest.approx(np.sin(6.0 * wanted), abs=2e-4)
    jump = between(t, np.where(t < 0.5, 0.0, 1.0), wanted)
    assert jump.min() >= -1e-12
    assert jump.max() <= 1.0 + 1e-12


@pytest.mark.parametrize(
    ("unit", "quantity", "factor"),
    [
        ("mm", POSITION, 1e-3),
        ("in", POSITION, 0.0254),
        ("deg/s", SPIN, math.pi / 180.0),
        ("N*mm", TORQUE, 1e-3),
        ("kN m", TORQUE, 1e3),
    ],
)
def test_units_become_the_models(unit, quantity, factor):
    assert factor_from(unit, quantity, UnitSystem()) == pytest.approx(factor)


def test_units_that_do_not_fit_are_refused():
    assert in_si("m/s^2") == in_si("m/s\u00b2") == (1.0, (0, 1, -2, 0))
    assert factor_from("m", POSITION, UnitSystem(length="MILLIMETER")) == pytest.approx(1e3)
    with pytest.raises(ValueError, match=r"measured in units such as m$"):
        factor_from("N", POSITION, UnitSystem())
    with pytest.raises(ValueError, match="'furlong' is not known"):
        in_si("furlong/s")


def test_what_is_seen_is_better_than_the_bounds():
    assert pytest.approx(np.std(np.linspace(0.0, 1.0, 100001)), rel=1e-4) == UNSEEN


def test_the_page_needs_no_other_file_and_escapes_what_it_quotes():
    y = line(1.0, 2.0) + noise(1)
    found = identify(problem(LINE, [record(y, unit="<b>")]), Formulas({"x": line}))
    text = page(found)
    assert "http" not in text.replace("http-equiv", "")
    assert "&lt;b&gt;" in text
    assert "<b>" not in text
    for heading in ("Parameters", "Identifiability", "Misfit", "Jacobian", "Warnings"):
        assert f"<h2>{heading}</h2>" in text
    assert text.count("<svg") == 2
    assert 'class="band' in text

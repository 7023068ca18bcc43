"""`mbsim identify`: what the Jacobian of a fit is from, against closed forms and differences."""

from __future__ import annotations

import math

import numpy as np
import pytest

from helpers.measured import BELT, curve, noisy, text_of, write_record
from mbsim.errors import ModelError
from mbsim.studies.columns import Columns
from mbsim.studies.identify import identify
from mbsim.studies.problem import read_problem
from mbsim.studies.rounds import Rounds
from mbsim.studies.study import Case
from mbsim.studies.worker import Here, run_one

MASS, STIFFNESS, SPEED = 2.0, 8.0, 0.3
DECK = f"""<Deck><Model>
<Body_Rigid id="1" isground="TRUE"/>
<Body_Rigid id="2" cg_id="20" mass="{MASS}" inertia_xx="0.01" inertia_yy="0.02" inertia_zz="0.03"
 v_ic_x="{SPEED}" v_ic_x_flag="TRUE"/>
<Reference_Marker id="10" body_id="1"/>
<Reference_Marker id="20" body_id="2" pos_x="1.2"/>
<Force_SpringDamper id="4" type="TRANSLATIONAL" i_marker_id="20" j_marker_id="10"
 stiffness="{STIFFNESS}" length="1"/>
</Model><Command>
<Simulate analysis_type="Transient" end_time="5" print_interval="0.1"/>
</Command></Deck>"""
T = np.linspace(0.0, 4.0, 41)
PARAMETERS = """[parameters]
k = { path = "Force_SpringDamper[4].stiffness", start = 8.5, low = 4, high = 16, scale = "log" }
v = { path = "Body_Rigid[2].v_ic_x", start = 0.25, low = 0, high = 1 }
"""
SHIFT = "shift = { start = 0.1, low = 0, high = 0.5 }\n"
HALF = '[set]\n"Body_Rigid[2].v_ic_x" = "{2*half}"\n'


def place(k, v, shift=0.0, rest=1.0):
    """Return the displacement of the oscillator."""
    w = math.sqrt(k / MASS)
    return rest + (1.2 - rest) * np.cos(w * (T + shift)) + v / w * np.sin(w * (T + shift))


def problem_of(folder, parameters=PARAMETERS, way="auto", record="", run="", shift=0.0):
    """Return the problem of the oscillator's record with noise."""
    (folder / "spring.xml").write_text(DECK)
    y, sd = noisy(place(STIFFNESS, SPEED, shift), 3)
    write_record(folder / "x.csv", T, y)
    file = folder / "spring.toml"
    file.write_text(
        f'[study]\nmodel = "spring.xml"\njacobian = "{way}"\n[run]\ntol = 1e-9\n{run}\n'
        f'{parameters}[records.x]\nfile = "x.csv"\ncolumn = "x"\n'
        f'signal = "bodies/2/position/x"\nsd = {sd}\n{record}'
    )
    return read_problem(file)


def at_start(problem):
    """Return the columns' makers at the start, what they say there, and the columns after it."""
    rounds = Rounds(problem, Here(problem.study))
    columns, z = Columns(problem), problem.start_points()[0]
    sd = problem.sd

    def both(ask):
        curves = ask([z])[0]
        return columns.checked(ask, z, curves, sd), columns.at(ask, z, curves)

    (found,) = rounds.drive([both])
    if isinstance(found, Exception):
        raise found
    return columns, *found


def exact(problem, z):
    """Return the slopes of the closed form over the unit cube, by a complex step's equal."""
    columns = []
    for k in range(len(z)):
        h = 1e-5 * np.eye(len(z))[k]
        columns.append((place(**problem.values(z + h)) - place(**problem.values(z - h))) / 2e-5)
    return np.stack(columns, axis=1)


def test_sensitivities_are_the_closed_form_s_jacobian(tmp_path):
    problem = problem_of(tmp_path, way="sensitivities")
    columns, checked, after = at_start(problem)
    assert sorted(columns.paths) == [0, 1]
    assert all(source.startswith("sensitivities, which are off") for source in checked.sources)
    right = exact(problem, problem.start_points()[0])
    for found in (checked.columns, after):
        assert np.abs(found - right).max() < 1e-5 * np.abs(right).max()


def test_what_has_no_sensitivity_is_from_differences_and_this_is_said(tmp_path):
    problem = problem_of(
        tmp_path, PARAMETERS + SHIFT, "sensitivities", 'time_offset = "shift"\n', shift=0.1
    )
    columns, checked, after = at_start(problem)
    assert sorted(columns.paths) == [0, 1]
    assert checked.sources[2] == "differences: a time offset has no sensitivity"
    right = exact(problem, problem.start_points()[0])
    assert np.abs(after[:, :2] - right[:, :2]).max() < 2e-2 * np.abs(right).max()
    assert np.abs(after - checked.columns).max() < 1e-6 * np.abs(after).max()


def test_a_formula_and_a_method_without_sensitivities_have_differences(tmp_path):
    half = PARAMETERS.splitlines()
    half[2] = "half = { start = 0.1, low = 0, high = 0.5 }"
    problem = problem_of(tmp_path, "\n".join(half) + "\n" + HALF, "sensitivities")
    _, checked, _ = at_start(problem)
    assert checked.sources[0].startswith("sensitivities")
    assert checked.sources[1] == "differences: a formula of [set] has it"
    moreau = problem_of(tmp_path, way="sensitivities", run='integrator = "VERLET"')
    _, checked, _ = at_start(moreau)
    assert all("integrator VERLET has none" in source for source in checked.sources)


def test_estimates_and_covariance_are_those_by_differences(tmp_path):
    found = {}
    for way in ("sensitivities", "differences", "auto"):
        problem = problem_of(tmp_path, way=way)
        found[way] = identify(problem, Here(problem.study))
        assert found[way].best.ended == "converged"
    usual = found["differences"].judged
    assert usual.sources == ("differences: as asked",) * 2
    for way in ("sensitivities", "auto"):
        assert found[way].judged.covariance == pytest.approx(usual.covariance, rel=1e-3)
        for one, other in zip(found[way].judged.parameters, usual.parameters, strict=True):
            assert one.value == pytest.approx(other.value, abs=0.05 * other.sd)


def test_auto_takes_sensitivities_where_they_are_less_work(tmp_path, monkeypatch):
    counted = Rounds._slopes

    def fewer(rounds, row, point):
        found = counted(rounds, row, point)
        return found._replace(along={path: n // 10 for path, n in found.along.items()})

    monkeypatch.setattr(Rounds, "_slopes", fewer)
    rest = 'rest = { path = "Force_SpringDamper[4].length", start = 0.9, low = 0.5, high = 1.1 }\n'
    problem = problem_of(tmp_path, PARAMETERS + rest, run='integrator = "RADAU5"')
    columns, checked, after = at_start(problem)
    assert sorted(columns.paths) == [0, 1, 2], checked.sources
    right = exact(problem, problem.start_points()[0])
    assert np.abs(after - right).max() < 1e-5 * np.abs(right).max()


def test_sensitivities_that_end_before_the_record_are_not_taken(tmp_path):
    t, x = curve(BELT, {}, 4.0, 0.05)
    write_record(tmp_path / "x.csv", t, x)
    asked = {
        "mu_static": "start = 0.99, low = 0.5, high = 2",
        "mu_dynamic": "start = 0.48, low = 0.2, high = 1",
    }
    text = text_of(BELT, asked, {}, "sd = 0.01") + "[run]\nend_time = 4\n"
    text = text.replace("[parameters]", 'jacobian = "sensitivities"\n[parameters]')
    (tmp_path / "belt.toml").write_text(text)
    columns, checked, after = at_start(read_problem(tmp_path / "belt.toml"))
    assert np.all(np.isfinite(after))
    for k, source in enumerate(checked.sources):
        assert source.startswith("sensitivities" if k in columns.paths else "differences: ")
    assert np.abs(after - checked.columns).max() < 2e-2 * np.abs(after).max(), checked.sources


def test_auto_takes_differences_where_sensitivities_are_more_work(tmp_path, monkeypatch):
    worth = 1
    monkeypatch.setattr("mbsim.studies.problem.WORTH", worth)
    t, x = curve(BELT, {}, 4.0, 0.05)
    y, sd = noisy(x, 4)
    write_record(tmp_path / "x.csv", t, y)
    asked = {"mu_static": "start = 0.99, low = 0.5, high = 2"}
    text = text_of(BELT, asked, {}, f"sd = {sd}") + "[run]\nend_time = 4\n"
    (tmp_path / "belt.toml").write_text(text)
    problem = read_problem(tmp_path / "belt.toml")
    columns, checked, after = at_start(problem)
    assert columns.paths == {}
    assert "it takes far more evaluations than the run itself" in checked.sources[0]
    # that was found out for little
    derived = problem.study.set_by("mu_static")
    row = run_one(problem.study, Case(0, {"mu_static": 0.99}, derived, worth))
    took = row.slopes[derived[0]]["evaluations"]
    assert 0 < took < row.evaluations
    assert np.abs(after - checked.columns).max() <= 1e-12 * np.abs(after).max()


def test_a_column_that_is_far_off_differences_is_not_taken(tmp_path, monkeypatch):
    problem = problem_of(tmp_path, way="sensitivities")
    right = Rounds._slopes

    def wrong(rounds, row, point):
        found = right(rounds, row, point)
        off = {path: 1.1 * x if "v_ic_x" in path else x for path, x in found.columns.items()}
        return found._replace(columns=off)

    monkeypatch.setattr(Rounds, "_slopes", wrong)
    columns, checked, _ = at_start(problem)
    assert sorted(columns.paths) == [0]
    assert checked.sources[1].startswith("differences: sensitivities are off them by 0.09")
    found = identify(problem, Here(problem.study))
    assert any("v: sensitivities are off" in line for line in found.warnings)


def test_an_unknown_way_is_refused(tmp_path):
    with pytest.raises(ModelError, match=r"study\.jacobian = 'exact': must be one of auto, sensi"):
        problem_of(tmp_path, way="exact")

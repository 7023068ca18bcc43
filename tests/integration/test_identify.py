"""`mbsim identify`: what was put into a record is found in it, and what cannot be is said."""

from __future__ import annotations

import json
import math
import re

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.integrate import solve_ivp

from helpers.measured import (
    BELT,
    BELT_SETS,
    BELT_TRUE,
    CONTACT,
    LUGRE,
    LUGRE_SETS,
    LUGRE_TRUE,
    Kept,
    curve,
    noisy,
    text_of,
    write_record,
)
from helpers.minimal_deck import deck
from mbsim.cli.main import main
from mbsim.errors import ModelError, ResultsError
from mbsim.studies.identify import identify
from mbsim.studies.problem import read_problem
from mbsim.studies.stopping import Stop
from mbsim.studies.worker import Here, PoolLost

BELT_ASKED = {
    "mu_static": "start = 0.95, low = 0.5, high = 2",
    "mu_dynamic": "start = 0.48, low = 0.2, high = 1",
    "stribeck_vel": 'start = 0.11, low = 0.01, high = 1, scale = "log"',
}
LUGRE_ASKED = {
    "mu_static": "start = 1.45, low = 1, high = 3",
    "mu_dynamic": "start = 0.95, low = 0.3, high = 1.5",
    "stribeck_vel": 'start = 0.11, low = 0.01, high = 1, scale = "log"',
    "viscous_coef": 'start = 0.095, low = 0.005, high = 1, scale = "log"',
}

_START = re.compile(r"start = [\d.]+")


def record_of(deck, sets, true, end, step):
    """Return times and displacement of a run with the true values of a contact's parameters."""
    return curve(deck, {**sets, **{f"{CONTACT}.{n}": v for n, v in true.items()}}, end, step)


def study(folder, deck, asked, sets, sd, end, tol=1e-8):
    """Return the problem of the record in `folder`."""
    run = f"[run]\nend_time = {end}\ntol = {tol}\n"
    file = folder / "belt.toml"
    file.write_text(text_of(deck, asked, sets, f"sd = {sd}") + run)
    return read_problem(file)


def off(found, true):
    """Return by how many standard deviations each parameter is off the truth."""
    offs = {}
    for p, unknown in zip(found.judged.parameters, found.problem.unknowns, strict=True):
        assert p.sd is not None, p
        way = math.log(p.value / true[p.name]) * p.value if unknown.log else p.value - true[p.name]
        offs[p.name] = way / p.sd
    return offs


@pytest.mark.parametrize(
    ("deck", "asked", "sets", "true", "part"),
    [
        (BELT, BELT_ASKED, BELT_SETS, BELT_TRUE, 0.01),
        (LUGRE, LUGRE_ASKED, LUGRE_SETS, LUGRE_TRUE, 0.002),
    ],
    ids=["belt", "lugre"],
)
def test_friction_is_found_in_a_displacement_with_noise(tmp_path, deck, asked, sets, true, part):
    end = 8.0
    t, x = record_of(deck, sets, true, end, 0.05)
    y, sd = noisy(x, 4, part)
    write_record(tmp_path / "x.csv", t, y)
    # near the truth, from where few runs lead to the estimate
    near = {name: _START.sub(f"start = {1.002 * true[name]}", said) for name, said in asked.items()}
    problem = study(tmp_path, deck, near, sets, sd, end, tol=1e-5)
    found = identify(problem, Here(problem.study))
    assert found.best.ended == "converged"
    assert found.judged.misfit.explained
    assert all(abs(each) < 3.0 for each in off(found, true).values()), off(found, true)
    assert max(found.judged.discrepancy) < 0.05


@pytest.mark.slow
@pytest.mark.parametrize(
    ("deck", "asked", "sets", "true", "end", "step"),
    [
        (BELT, BELT_ASKED, BELT_SETS, BELT_TRUE, 20.0, 0.05),
        (LUGRE, LUGRE_ASKED, LUGRE_SETS, LUGRE_TRUE, 16.0, 0.01),
    ],
    ids=["belt", "lugre"],
)
def test_two_standard_deviations_hold_the_truth_as_often_as_they_should(
    tmp_path, deck, asked, sets, true, end, step
):
    t, x = record_of(deck, sets, true, end, step)
    hits = dict.fromkeys(true, 0)
    rows = {}
    for seed in range(100):
        y, sd = noisy(x, seed)
        write_record(tmp_path / "x.csv", t, y)
        problem = study(tmp_path, deck, asked, sets, sd, end)
        found = identify(problem, Kept(problem.study, rows))
        for name, each in off(found, true).items():
            hits[name] += abs(each) <= 2.0
    assert all(90 <= count <= 99 for count in hits.values()), hits


def other_belt(end, step):
    """Return the belt's displacement by SciPy with a friction law that is not ours.

    N mu(v) with mu falling as 1/(1 + (v/vs)^2), on a belt that is rougher here and there.
    """

    def slope(t, y):
        slip = y[1] - 0.2
        v = abs(slip)
        mu = 0.5 + 0.5 / (1.0 + (v / 0.08) ** 2)
        mu *= 1.0 + 0.15 * math.sin(8.0 * (y[0] - 0.2 * t))
        return [y[1], -y[0] - mu * math.tanh(slip / 0.01)]

    t = np.linspace(0.0, end, round(end / step) + 1)
    found = solve_ivp(slope, (0.0, end), [0.0, 0.0], "LSODA", t, rtol=1e-9, atol=1e-11)
    return t, found.y[0]


@pytest.mark.slow
def test_a_record_of_another_law_is_fitted_and_the_misfit_is_said(tmp_path):
    t, x = other_belt(9.0, 0.05)
    y, sd = noisy(x, seed=4, part=0.003)
    write_record(tmp_path / "x.csv", t, y)
    asked = {**BELT_ASKED, "mu_static": "start = 1.05, low = 0.5, high = 2"}
    problem = study(tmp_path, BELT, asked, BELT_SETS, sd, 9.0, tol=1e-6)
    found = identify(problem, Here(problem.study))
    assert found.best.ended == "converged"
    assert found.judged.records[0].rms < 0.1 * np.ptp(x)
    assert not found.judged.misfit.explained
    assert found.warnings[0].startswith("the model does not explain the record: chi-square")


def test_a_parameter_that_a_run_does_not_feel_is_said(tmp_path):
    t, x = record_of(BELT, BELT_SETS, BELT_TRUE, 6.0, 0.1)
    y, sd = noisy(x, seed=1)
    write_record(tmp_path / "x.csv", t, y)
    asked = {"mu_static": "start = 0.98, low = 0.5, high = 2", "damping": "low = 100, high = 900"}
    sets = {**BELT_SETS, f"{CONTACT}.mu_dynamic": 0.5, f"{CONTACT}.stribeck_vel": 0.1}
    problem = study(tmp_path, BELT, asked, sets, sd, 6.0, tol=1e-7)
    found = identify(problem, Here(problem.study))
    assert [p.why for p in found.judged.parameters] == ["", "not seen"]
    assert found.judged.parameters[0].value == pytest.approx(1.0, abs=0.02)
    assert "damping: the record does not see it: it has no estimate" in found.warnings


def test_the_command(tmp_path, monkeypatch):
    t, x = record_of(BELT, BELT_SETS, BELT_TRUE, 6.0, 0.1)
    y, sd = noisy(x, seed=1)
    # in millimetres and milliseconds, begun half a second late, with a gap
    lines = [f"{1e3 * (a - 0.5):.6f};{1e3 * b:.6f}" for a, b in zip(t, y, strict=True) if a >= 0.5]
    lines[7] = lines[7].split(";")[0] + ";"
    (tmp_path / "x.csv").write_text("# of a test\nt [ms];x [mm]\n" + "\n".join(lines) + "\n")
    sets = {**BELT_SETS, f"{CONTACT}.mu_dynamic": 0.5, f"{CONTACT}.stribeck_vel": 0.1}
    asked = {"mu_static": "start = 0.98, low = 0.5, high = 2"}
    text = text_of(BELT, asked, sets, f"sd = {1e3 * sd}").replace('"x"', '"x [mm]"')
    text += 'unit = "mm"\ntime = "t [ms]"\ntime_unit = "ms"\ntime_offset = 0.5\n'
    (tmp_path / "belt.toml").write_text(text + "[run]\nend_time = 6.0\ntol = 1e-7\n")
    monkeypatch.chdir(tmp_path)
    found = CliRunner().invoke(main, ["identify", "belt.toml", "--workers", "1", "--json"])
    assert found.exit_code == 0, found.output
    about = json.loads(found.stdout)
    assert about == json.loads((tmp_path / "belt" / "belt.json").read_text())
    estimate = about["parameters"]["mu_static"]
    assert abs(estimate["estimate"] - 1.0) < 3.0 * estimate["sd"]
    assert about["misfit"]["explained"]
    assert "1 rows without a number are left out" in found.stderr
    page = (tmp_path / "belt" / "belt.html").read_text()
    assert "<h2>Parameters</h2>" in page
    assert "--set Force_Contact[301].mu_static=" in page.replace("&#x27;", "").replace("'", "")
    # whoever runs it
    problem = read_problem(tmp_path / "belt.toml")
    here = identify(problem, Here(problem.study))
    assert here.best.cost == about["sum_of_squares"]
    assert here.judged.parameters[0].sd == estimate["sd"]


@pytest.mark.parametrize(
    ("factor", "sd", "said"),
    [
        (1e300, "", "column 'x' has values up to 1e+300 in the model's units"),
        (1e308, "sd = 1e300", "column 'x' has values up to 1e+308 in the model's units"),
        (1.0, "sd = 1e-200", "values of column 'x' are too large beside sd and weight"),
        (0.0, "sd = 1e-200", "values of column 'x' are too large beside sd and weight"),
        (1e10, "weight = 1e300", "values of column 'x' are too large beside sd and weight"),
    ],
)
def test_values_whose_squares_overflow_are_refused(tmp_path, monkeypatch, factor, sd, said):
    monkeypatch.chdir(tmp_path)
    t = np.linspace(0.0, 6.0, 61)
    write_record(tmp_path / "x.csv", t, factor * np.cos(t))
    asked = {"mu_static": "start = 0.98, low = 0.5, high = 2"}
    (tmp_path / "belt.toml").write_text(text_of(BELT, asked, BELT_SETS, sd))
    found = CliRunner().invoke(main, ["identify", "belt.toml", "--workers", "1"])
    assert found.exit_code == 2, found.output
    assert f"records.x: x.csv: {said}" in found.stderr


@pytest.mark.parametrize(
    ("end", "code", "said"),
    [
        (KeyboardInterrupt, 130, "interrupted: "),
        (Stop(15), 143, "interrupted: "),
        (PoolLost("nobody answers"), 5, "warning: nobody answers"),
    ],
)
def test_ctrl_c_leaves_the_best_so_far(tmp_path, monkeypatch, end, code, said):
    from mbsim.studies import identify as module

    class Stopping(Here):
        ran = 0

        def share(self, cases, count):
            for row in super().share(cases, count):
                Stopping.ran += 1
                if Stopping.ran > 8:
                    raise end
                yield row

    monkeypatch.setattr(module, "pool_of", lambda problem, *_: Stopping(problem.study))
    monkeypatch.chdir(tmp_path)
    t, x = record_of(BELT, BELT_SETS, BELT_TRUE, 2.0, 0.1)
    write_record(tmp_path / "x.csv", t, x)
    sets = {**BELT_SETS, f"{CONTACT}.mu_dynamic": 0.5, f"{CONTACT}.stribeck_vel": 0.1}
    study(tmp_path, BELT, {"mu_static": "start = 0.9, low = 0.5, high = 2"}, sets, 0.01, 2.0)
    found = CliRunner().invoke(main, ["identify", "belt.toml"])
    assert found.exit_code == code, found.output
    assert ": the best so far is in belt" in found.output
    assert said in found.output
    about = json.loads((tmp_path / "belt" / "belt.json").read_text())
    assert about["status"] == "stopped"
    assert 0.5 <= about["best"]["mu_static"] <= 2.0


FAULTY = """
[study]
model = "{model}"
starts = 0
[run]
tolerance = 3
[parameters]
mu_s = {{ path = "Force_Contact[302].mu_static", start = 3.8, low = 0.5, high = 2 }}
mu_d = {{ path = "Force_Contact[301].mu_dinamic", low = 2, high = 1 }}
vs = {{ path = "Force_Contact[301].stribeck_vel", low = 0.0, high = 1, scale = "log" }}
k = {{ path = "Force_Contact[301].stiffness", high = 1, prior = {{ mean = 1 }} }}
[records.x]
file = "x.csv"
time = "t"
column = "y"
unit = "N"
signal = "bodies/9/position/x"
[records.y]
file = "none.csv"
column = "x"
sd = -1
signal = "bodies/2/position/x"
[records.z]
file = "x.csv"
column = "x"
signal = "bodies/2/position"
time_offset = "late"
[records.w]
file = "x.csv"
column = "x"
sd = 1
signal = "bodies/2/velocity/x"
time_offset = 39.5
"""


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("low = 0.5, high = inf", "mu_s: high = inf: must be a finite number: the fit moves it"),
        ("low = -inf, high = 2", "mu_s: low = -inf: must be a finite number: the fit moves it"),
        ("low = 0.5, high = nan", "mu_s: high = nan: must be a finite number"),
        ("low = -inf, high = inf", "mu_s: high = inf: must be a finite number: the fit moves it"),
    ],
)
def test_a_bound_that_is_not_finite_is_refused_by_the_study_and_not_by_the_deck(
    tmp_path, given, said
):
    write_record(tmp_path / "x.csv", np.linspace(0.0, 1.0, 11), np.zeros(11))
    deck = f"[study]\nmodel = {str(BELT)!r}\n"
    law = 'path = "Force_Contact[301].mu_static"'
    record = 'file = "x.csv"\ncolumn = "x"\nsignal = "bodies/2/position/x"\nsd = 1\n'
    text = f"{deck}[parameters]\nmu_s = {{ {law}, {given} }}\n[records.x]\n{record}"
    (tmp_path / "s.toml").write_text(text)
    with pytest.raises(ModelError) as error:
        read_problem(tmp_path / "s.toml")
    assert said in str(error.value)
    assert "from --set" not in str(error.value)


def test_all_that_is_wrong_is_said_at_once(tmp_path):
    write_record(tmp_path / "x.csv", np.linspace(0.0, 1.0, 11), np.zeros(11))
    (tmp_path / "s.toml").write_text(FAULTY.format(model=BELT))
    with pytest.raises(ModelError) as error:
        read_problem(tmp_path / "s.toml")
    text = str(error.value)
    for wanted in (
        "study.starts = 0: must be a whole number from 1 to",
        "run: unknown tolerance; known: end_time",
        "parameters.mu_s: start = 3.8: must be from low = 0.5 to high = 2",
        "parameters.mu_s.path: Force_Contact[302].mu_static: no Force_Contact[302] in the deck; it",
        "parameters.mu_d.path: Force_Contact[301].mu_dinamic: Force_Contact has no attribute",
        "parameters.mu_d: low = 2, high = 1: low must be below high",
        'parameters.vs: low = 0: must be above 0 with scale = "log"',
        "parameters.k: needs low, the bounds of the fit",
        "records.x.time: ",
        "x.csv has no column 'y'; it has time, x",
        "records.x.unit: 'N' does not fit: position is measured in units such as m",
        "records: signal bodies/9/position/x: this model has no such signal; did you mean",
        "records.y.sd = -1: must be above 0",
        "records.z.time_offset = 'late': must be a number or a parameter: mu_s, mu_d, vs, k",
        "records.w: ",
        "goes from time 39.5 to 40.5; the run from 0 to 40: give from, to, or run.end_time",
    ):
        assert wanted in text, wanted
    assert all("toml: " in line for line in text.split("\n"))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("[records.y]", "[record.y]"), "unknown table record; known: study, run, parameters"),
        (('column = "x"', 'colum = "x"'), "records.y: needs column"),
        (("sd = 1", "sd = 1\nfrom = 5"), "0 rows of 11 are of use"),
        (("sd = 1", ""), "records: sd: needed where a parameter has a prior"),
        (("bodies/2/position/x", "bodies/2/position"), "is a vector: name one component"),
        (("none.csv", "bad.csv"), "bad.csv:3: x = 'one': must be a number"),
        (("none.csv", "back.csv"), "times must grow from row to row"),
        ((BELT.name, "none.xml"), "none.xml: no such file"),
    ],
)
def test_what_is_wrong_is_said_before_the_first_run(tmp_path, change, said):
    write_record(tmp_path / "x.csv", np.linspace(0.0, 1.0, 11), np.zeros(11))
    (tmp_path / "bad.csv").write_text("time,x\n0,1\n1,one\n")
    (tmp_path / "back.csv").write_text("time,x\n0,1\n1,1\n0.5,1\n2,1\n")
    text = f"""
[study]
model = "{BELT}"
[parameters]
mu = {{ path = "{CONTACT}.mu_static", low = 0.5, high = 2, prior = {{ median = 1, factor = 2 }} }}
[records.y]
file = "none.csv"
column = "x"
sd = 1
signal = "bodies/2/position/x"
"""
    text = text.replace(*change)
    if "none.csv" not in change[0]:
        text = text.replace("none.csv", "x.csv")
    (tmp_path / "s.toml").write_text(text)
    with pytest.raises(ModelError) as error:
        read_problem(tmp_path / "s.toml")
    assert said in str(error.value)


@pytest.mark.slow
def test_a_cluster_and_two_processes_find_the_same_bit_for_bit(tmp_path):
    distributed = pytest.importorskip("distributed")
    from mbsim.studies.identify import pool_of

    t, x = record_of(BELT, BELT_SETS, BELT_TRUE, 9.0, 0.05)
    y, sd = noisy(x, seed=4)
    write_record(tmp_path / "x.csv", t, y)
    problem = study(tmp_path, BELT, BELT_ASKED, BELT_SETS, sd, 9.0)
    one = identify(problem, Here(problem.study))
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None
    ) as cluster:
        pools = [pool_of(problem, scheduler=cluster.scheduler_address), pool_of(problem, workers=2)]
        for pool in pools:
            other = identify(problem, pool)
            assert np.array_equal(other.best.z, one.best.z)
            assert np.array_equal(other.judged.covariance, one.judged.covariance)


def test_what_is_found_is_said_before_a_full_disk_takes_the_files(tmp_path, monkeypatch):
    (tmp_path / "fall.xml").write_text(deck(('body_id="2" pos_z="0.108"', 'body_id="2" pos_z="9"')))
    rows = "".join(f"{t},{9.0 - 3.0 * t * t}\n" for t in np.arange(0.0, 1.01, 0.1))
    (tmp_path / "z.csv").write_text("time,z\n" + rows)
    (tmp_path / "fall.toml").write_text(
        '[study]\nmodel = "fall.xml"\n[run]\nend_time = 1.0\n'
        '[parameters]\ng = { path = "Force_Gravity.grav_z", low = -20, high = -1 }\n'
        '[records.z]\nfile = "z.csv"\ncolumn = "z"\nsd = 0.01\nsignal = "bodies/2/position/z"\n'
    )

    def full(*_: object) -> None:
        raise ResultsError("fall.json: results cannot be written: No space left on device")

    monkeypatch.setattr("mbsim.results.files.replace_bytes", full)
    monkeypatch.chdir(tmp_path)
    found = CliRunner().invoke(main, ["identify", "fall.toml", "--workers", "1"])
    assert found.exit_code == 5
    assert "g = -6" in found.stdout
    assert "No space left" in found.stderr

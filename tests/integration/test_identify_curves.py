"""`mbsim identify`: forces that nobody measured, as curves beside the parameters."""

from __future__ import annotations

import json

import numpy as np
import pytest
from click.testing import CliRunner

import mbsim
from mbsim.cli.main import main
from mbsim.errors import ModelError
from mbsim.studies.identify import identify
from mbsim.studies.problem import read_problem
from mbsim.studies.worker import Here

DECK = """<Deck><Model>
<Body_Rigid id="1" isground="TRUE"/>
<Body_Rigid id="2" cg_id="20" mass="2" inertia_xx="1" inertia_yy="1" inertia_zz="1"/>
<Reference_Marker id="10" body_id="1"/><Reference_Marker id="20" body_id="2"/>
<Reference_Spline id="9" x="0 1 2 3" y="0 0 0 0"/>
<Force_Vector_TwoBody id="5" type="ForceOnly" i_marker_id="20" j_floating_marker_id="10"
 ref_marker_id="10" fx_expression="{force}" fy_expression="0" fz_expression="0"/>
<Force_Vector_TwoBody id="6" type="ForceOnly" i_marker_id="20" j_floating_marker_id="10"
 ref_marker_id="10" fx_expression="-VARVAL(1)*DX(20,10)-1.5*VX(20,10)" fy_expression="0"
 fz_expression="0"/>
<Reference_Variable id="1" expr="40"/>
</Model><Command>
<Simulate analysis_type="Transient" end_time="3" print_interval="0.02"/>
</Command></Deck>"""
#: The force that was at work: no spline, zero at first, a push within.
PUSH = "10*EXP(-((TIME-1.2)/0.35)**2)*SIN(3*TIME)"
SD = 0.004

STUDY = """[study]
model = "deck.xml"
[parameters]
{parameters}
[curves.push]
spline = "Reference_Spline[9]"
from = 0
to = 3
count = {count}
low = -40
high = 40
curvature_sd = {curvature}
[records.x]
file = "x.csv"
column = "x"
sd = {sd}
signal = "bodies/2/position/x"
"""


def truth(t):
    return 10.0 * np.exp(-(((t - 1.2) / 0.35) ** 2)) * np.sin(3.0 * t)


def problem(folder, seed=0, parameters="", count=16, curvature=150.0, sd=SD):
    """Return the problem of a record with noise of a run under the push."""
    folder.mkdir(exist_ok=True)
    run = mbsim.simulate(DECK.format(force=PUSH), tol=1e-10)
    t, x = run["time"], run["bodies/2/position/x"]
    x = x + SD * np.random.default_rng(seed).standard_normal(len(x))
    np.savetxt(folder / "x.csv", np.c_[t, x], delimiter=",", header="time,x", comments="")
    (folder / "deck.xml").write_text(DECK.format(force="CUBSPL(TIME,0,9)"))
    file = folder / "push.toml"
    file.write_text(STUDY.format(parameters=parameters, count=count, curvature=curvature, sd=sd))
    return file


def test_a_force_that_nobody_measured_is_found_within_its_band(tmp_path):
    inside, offs, chances = 0, [], []
    for seed in range(3):
        made = read_problem(problem(tmp_path / str(seed), seed))
        found = identify(made, Here(made.study))
        assert found.best.ended == "converged"
        assert found.judged.misfit.explained
        chances.append(found.judged.misfit.probability)
        (curve,) = made.unknown_curves
        points = found.judged.parameters[curve.unknowns]
        assert all(p.sd is not None for p in points)
        off = np.array([p.value for p in points]) - truth(curve.at)
        sd = np.array([p.sd for p in points])
        offs.append(off / sd)
        inside += np.count_nonzero(np.abs(off) < 2.0 * sd)
        # the problem is linear: what takes iterations is how far the method trusts in that
        assert found.best.iterations <= 8
    assert inside >= 0.9 * 3 * 16
    assert np.std(offs) > 0.5
    assert max(chances) < 0.999


def test_a_stiffness_is_found_beside_a_force(tmp_path):
    k = 'k = { path = "Reference_Variable[1].expr", low = 10, high = 100 }'
    made = read_problem(problem(tmp_path, 1, k, curvature=60.0))
    found = identify(made, Here(made.study))
    assert found.best.ended == "converged"
    stiffness = found.judged.parameters[0]
    # a force makes up for a wrong stiffness, but for what may not bend
    assert stiffness.sd is None or abs(stiffness.value - 40.0) < 3.0 * stiffness.sd


def test_what_a_short_record_does_not_see_of_a_force_is_said(tmp_path):
    file = problem(tmp_path, 2, curvature=1e6)
    text = file.read_text().replace("[records.x]", "[records.x]\nto = 1.5")
    file.write_text(text)
    made = read_problem(file)
    found = identify(made, Here(made.study))
    points = found.judged.parameters[made.unknown_curves[0].unknowns]
    assert all(p.why == "not seen" for p in points[10:])


def test_the_command_writes_the_curve(tmp_path):
    file = problem(tmp_path, 3)
    out = tmp_path / "out"
    done = CliRunner().invoke(main, ["identify", str(file), "-o", str(out), "--workers", "1"])
    assert done.exit_code == 0, done.output
    assert "push = 16 points from 0 to 3" in done.output
    about = json.loads((out / "push.json").read_text())
    curve = about["curves"]["push"]
    assert len(curve["value"]) == len(curve["at"]) == 16
    assert "push" in (out / "push.html").read_text()
    # the values that were found are those of a run
    sets = dict(about["sets"])
    run = mbsim.simulate(tmp_path / "deck.xml", overrides=sets, tol=1e-8)
    x = np.interp(about["records"]["x"]["time"], run["time"], run["bodies/2/position/x"])
    assert x == pytest.approx(np.array(about["records"]["x"]["fitted"]), abs=1e-4)


@pytest.mark.parametrize(
    ("wrong", "right", "said"),
    [
        ("count = 3", "count = 16", "count = 3: must be a whole number from 4"),
        ('spline = "Body_Rigid[2]"', 'spline = "Reference_Spline[9]"', "must be one of the deck"),
        ("curvature_sd = 0.0", "curvature_sd = 150.0", "must be above 0"),
        ("to = 0", "to = 3", "from must be below to"),
        ("", "count = 16", "needs count"),
        ("count = 16\nknots = 3", "count = 16", "unknown knots"),
        ('spline = "Reference_Spline[8]"', 'spline = "Reference_Spline[9]"', r"no .*\[8\]"),
        ("low = 50", "low = -40", "low must be below high"),
        ("low = -inf", "low = -40", "finite number: the fit moves it between both bounds"),
        ("", "sd = 0.004\n", "sd: needed"),
    ],
)
def test_what_is_no_curve_is_refused(tmp_path, wrong, right, said):
    file = problem(tmp_path)
    text = file.read_text()
    assert right in text
    file.write_text(text.replace(right, wrong))
    with pytest.raises(ModelError, match=said):
        read_problem(file)

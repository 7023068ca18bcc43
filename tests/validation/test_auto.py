"""AUTO changes over where a model is stiff and back where it is not, and says so."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from decks_io import MODELS

import mbsim
from mbsim.errors import ModelError

STIFF = MODELS / "stiff"


def test_it_is_the_default_and_explicit_where_nothing_is_stiff():
    model = mbsim.read_model(MODELS / "free_top.xml")
    auto, explicit = mbsim.simulate(model), mbsim.simulate(model, integrator="DOPRI5")
    assert auto.attributes["integrator"] == "AUTO"
    assert auto.stats["method_changes"] == auto.stats["jacobians"] == 0
    np.testing.assert_array_equal(auto["bodies/2/quaternion"], explicit["bodies/2/quaternion"])


def test_a_block_that_creeps_is_stiff_from_soon_on(tmp_path):
    model = mbsim.read_model(STIFF / "incline_creep.xml")
    auto = mbsim.simulate(model, output=tmp_path)
    implicit = mbsim.simulate(model, integrator="RADAU5", tol=1e-8)
    assert auto.stats["method_changes"] >= 1
    assert auto.stats["steps"] < 2000
    here, there = (r["bodies/2/position"] for r in (auto, implicit))
    assert np.abs(here - there).max() < 1e-7
    log = (tmp_path / "incline_creep.log").read_text()
    assert "RADAU5 from here on" in log


@pytest.mark.parametrize("name", ["rolling_sphere", "overdamped", "preloaded_stop"])
def test_a_run_that_is_stiff_from_its_begin_changes_over_within_some_steps(name):
    model = mbsim.read_model(STIFF / f"{name}.xml")
    auto, implicit = (mbsim.simulate(model, integrator=name) for name in ("AUTO", "RADAU5"))
    assert auto.stats["method_changes"] == 1
    assert auto.stats["steps"] < implicit.stats["steps"] + 60


@pytest.mark.parametrize("name", ["drop_m", "bowling_ball", "incline_slip"])
def test_an_impact_or_a_short_stiff_run_changes_nothing(name):
    auto = mbsim.simulate(mbsim.read_model(MODELS / f"{name}.xml"))
    assert auto.stats["method_changes"] == auto.stats["jacobians"] == 0


@pytest.mark.parametrize(("name", "part"), [("torsion_top", 0.05), ("bushing_chain", 0.4)])
def test_radau5_takes_steps_for_which_newtons_iteration_converges(name, part):
    stats = mbsim.simulate(mbsim.read_model(STIFF / f"{name}.xml"), integrator="RADAU5").stats
    assert stats["rejected"] < part * stats["steps"]
    assert stats["steps"] < 600


def test_it_changes_back():
    model = mbsim.read_model(MODELS / "slider_crank_clearance.xml")
    auto = mbsim.simulate(model)
    assert auto.stats["method_changes"] >= 2


def test_motionsolve_names_run_their_kind(tmp_path):
    model = mbsim.read_model(MODELS / "free_top.xml")
    explicit = mbsim.simulate(model, integrator="ABAM", end_time=0.1)
    stiff = mbsim.simulate(model, integrator="DSTIFF", end_time=0.1)
    assert explicit.attributes["integrator"] == "DOPRI5"
    assert stiff.attributes["integrator"] == "RADAU5"
    assert stiff.stats["jacobians"] > 0


RAIL = """<Body_Rigid id="1" isground="TRUE"/><Reference_Marker id="10" body_id="1"/>
<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="1" inertia_yy="1" inertia_zz="1"/>
<Reference_Marker id="20" body_id="2"/>
<Constraint_Joint id="7" type="TRANSLATIONAL" i_marker_id="20" j_marker_id="10"/>
<Motion_Joint id="1" joint_id="7" motion_type="T" val_type="A" type="Expression"
 expr="10*SIN(10*TIME)"/>"""


@pytest.mark.parametrize("method", ["GALPHA", "RADAU5", "AUTO"])
def test_a_motion_of_accelerations_on_a_rail(tmp_path, method):
    path = tmp_path / "rail.xml"
    commands = '<Simulate analysis_type="Transient" end_time="1" print_interval="0.5"/>'
    path.write_text(
        f"<MotionSolve><Model>{RAIL}</Model><Command>{commands}</Command></MotionSolve>"
    )
    # z'' = 10 sin 10t from rest: z = t - sin(10t)/10
    found = mbsim.simulate(mbsim.read_model(path), integrator=method, tol=1e-7)
    assert found["bodies/2/position"][-1, 2] == pytest.approx(1 - np.sin(10) / 10, abs=1e-4)


def test_too_many_bodies_are_said(monkeypatch):
    from mbsim import methods

    monkeypatch.setattr(methods, "MOST_LINEARISED", 0)
    with pytest.raises(ModelError, match="1 bodies are more than the 0"):
        mbsim.simulate(mbsim.read_model(MODELS / "free_top.xml"), integrator="RADAU5")

"""Forces with kinks: steps end where an expression or a limit goes to another branch."""

from __future__ import annotations

import numpy as np
import pytest

import mbsim
from helpers.decks import run_deck
from mbsim.errors import SolverError

ALONG_X = 'psi="1.5707963267948966" theta="1.5707963267948966"'
SLIDER = f"""
<Body_Rigid id="1" isground="TRUE"/>
<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="0.1" inertia_yy="0.1" inertia_zz="0.1"
  v_ic_x="{{v}}" v_ic_x_flag="TRUE"/>
<Reference_Marker id="20" body_id="2"/><Reference_Marker id="21" body_id="2" {ALONG_X}/>
<Reference_Marker id="10" body_id="1" {ALONG_X}/>
<Constraint_Joint id="1" type="TRANSLATIONAL" i_marker_id="21" j_marker_id="10"/>
"""


def slide(folder, expr="", v=1.0, more="", **settings):
    """Run 1 kg on a rail along x under a force."""
    force = f"""<Force_Scalar_TwoBody id="1" type="Force" action_only="TRUE" i_marker_id="20"
      j_marker_id="10" expr="{expr}"/>"""
    return run_deck(folder, SLIDER.format(v=v) + more + (force if expr else ""), 1.0, **settings)


def gap_time(k, v=1.0):
    """Return half a period of 1 kg in a linear stop, and how deep it goes at speed v."""
    return np.pi / np.sqrt(k), v / np.sqrt(k)


def rattle(times, gap, k):
    """Return the place of 1 kg that starts at 1 m/s in the middle of a gap between springs k."""
    stay, deepest = gap_time(k)
    half = 2 * gap + stay
    phase = np.mod(times, 2 * half)
    turn = np.where(phase < gap + stay / 2, 0, np.where(phase < gap + stay / 2 + half, 1, 2))
    # from the middle of one stay to that of the next it is a mirror image
    s = np.abs(phase - turn * half)
    x = np.where(s < gap, s, gap + deepest * np.sin(np.minimum(s - gap, stay / 2) * np.sqrt(k)))
    return np.where(turn == 1, -1, 1) * np.sign(phase - turn * half) * x


STOPS = {
    "BISTOP": (
        "BISTOP(DX(20, 10), VX(20, 10), -0.01, 0.01, 1E5, 1, 0, 1E-4)",
        "",
    ),
    "IF": (
        "IF(ABS(DX(20, 10)) - 0.01: 0, 0, -1E5*(DX(20, 10) - SIGN(0.01, DX(20, 10))))",
        "",
    ),
    "DIM": ("1E5*(DIM(-0.01, DX(20, 10)) - DIM(DX(20, 10), 0.01))", ""),
    "MAX": ("1E5*(MAX(0, -0.01 - DX(20, 10)) + MIN(0, 0.01 - DX(20, 10)))", ""),
    "variable": (
        "VARVAL(7)",
        '<Reference_Variable id="7" expr="-1E5*DIM(VARVAL(8), 0.01)*SIGN(1, DX(20, 10))"/>'
        '<Reference_Variable id="8" expr="ABS(DX(20, 10))"/>',
    ),
    "limit": (
        "",
        '<Force_JointLimit id="5" joint_id="1" motion_type="T" lower="-0.01" upper="0.01" '
        'cnf_type="IMPACT" stiffness="1e5" exponent="1"/>',
    ),
}


@pytest.mark.parametrize("kind", STOPS)
def test_a_rattling_mass_keeps_time(kind, tmp_path):
    expr, more = STOPS[kind]
    errors, steps = [], []
    for tol in (1e-5, 1e-7, 1e-9):
        results = slide(tmp_path, expr, more=more, tol=tol)
        x = results["bodies/2/position/x"]
        errors.append(np.abs(x - rattle(results["time"], 0.01, 1e5)).max())
        steps.append(results.stats["steps"] + results.stats["rejected"])
    # 34 half swings, each with two kinks
    assert errors[0] < 5e-4 * 1.0
    assert errors[1] < errors[0] / 10
    assert errors[2] < errors[1] / 10
    assert steps[0] < 34 * 60


def test_a_limit_of_an_angle_ends_steps(tmp_path):
    deck = """
<Body_Rigid id="1" isground="TRUE"/>
<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="1" inertia_yy="1" inertia_zz="1"
  w_ic_z="1" w_ic_z_flag="TRUE"/>
<Reference_Marker id="20" body_id="2"/><Reference_Marker id="10" body_id="1"/>
<Constraint_Joint id="1" type="REVOLUTE" i_marker_id="20" j_marker_id="10"/>
<Force_JointLimit id="5" joint_id="1" motion_type="R" lower="-0.01" upper="0.01"
  cnf_type="IMPACT" stiffness="1e5" exponent="1"/>"""
    for tol, allowed in ((1e-5, 5e-4), (1e-9, 5e-7)):
        results = run_deck(tmp_path, deck, 1.0, tol=tol)
        q = results["bodies/2/quaternion"]
        angle = 2 * np.arctan2(q[:, 3], q[:, 0])
        assert np.abs(angle - rattle(results["time"], 0.01, 1e5)).max() < allowed


@pytest.mark.parametrize(
    "expr",
    [
        # comes to rest on a stop: infinitely many touches in the limit
        "-10 + IMPACT(DX(20, 10), VX(20, 10), 0, 1E6, 1.5, 300, 1E-5)",
        # shaken in a narrow gap
        "50*SIN(60*TIME) + BISTOP(DX(20,10), VX(20,10), -1E-3, 1E-3, 1E6, 1.5, 300, 1E-5)",
        # signs of what is rounding
        "-ABS(DY(20, 10)) - ABS(DZ(20, 10)) - 100*DX(20, 10)",
    ],
)
def test_branches_without_end_do_not_stall(expr, tmp_path):
    results = slide(tmp_path, expr, tol=1e-5)
    assert results.stats["steps"] + results.stats["rejected"] < 2000
    energy = results["energy/kinetic"] + results["energy/dissipated"]
    assert np.abs(energy - energy[0]).max() < 1e-3


def test_edges_of_time_are_met(tmp_path):
    # a saw, whose jumps bring the velocity back
    results = slide(tmp_path, "MOD(TIME, 0.1) - 0.05", v=0.0, tol=1e-8)
    s = np.mod(results["time"], 0.1)
    exact = s**3 / 6 - 0.025 * s**2 - np.floor(results["time"] / 0.1 + 1e-9) * 0.1**3 / 12
    inner = (s > 1e-9) & (s < 0.1 - 1e-9)
    x = results["bodies/2/position/x"]
    assert np.abs(x - exact)[inner].max() < 1e-6


POLES = {"1/(0.5-TIME)": "D", "TAN(PI*TIME)": "D", "1/(0.5-TIME)**2": "V"}


@pytest.mark.parametrize("expr", POLES)
def test_a_motion_with_a_pole_ends_with_one_message(expr, tmp_path):
    motion = f'<Motion_Joint id="4" joint_id="1" val_type="{POLES[expr]}" expr="{expr}"/>'
    with pytest.raises(SolverError) as error:
        slide(tmp_path, v=0.0, more=motion)
    message = str(error.value)
    assert message.count("\n") == 0
    # what looks at TIME alone is known ahead: steps towards the pole get shorter than rounding
    assert message.startswith(("no progress at", "the step fell"))
    assert "time 0.49" in message or "time 0.5" in message
    assert "Motion_Joint[4]" in message
    assert "velocity" in message or message.startswith("the step fell")


def test_sides_survive_commands_between_simulations(tmp_path):
    # the second law has more switches than the first
    deck = tmp_path / "deck.xml"
    force = '<Force_Scalar_TwoBody id="1" type="Force" action_only="TRUE" i_marker_id="20" '
    deck.write_text(
        f"<MotionSolve><Model>{SLIDER.format(v=1.0)}{force} j_marker_id='10' expr='0'/></Model>"
        '<Command><Simulate analysis_type="Transient" end_time="0.1" print_interval="0.01"/>'
        '<Force_Scalar_TwoBody id="1" expr="-1E5*DIM(DX(20, 10), 0.15)"/>'
        '<Simulate analysis_type="Transient" end_time="0.3" print_interval="0.01"/>'
        "</Command></MotionSolve>",
        encoding="utf-8",
    )
    stay, _ = gap_time(1e5)
    results = mbsim.simulate(mbsim.read_model(deck))
    exact = 0.15 - (results["time"][-1] - 0.15 - stay)
    assert results["bodies/2/position/x"][-1] == pytest.approx(exact, abs=2e-5)

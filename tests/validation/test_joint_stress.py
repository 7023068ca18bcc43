"""Decks that a careless or a hostile user would write: refused or ended by name, or right."""

from __future__ import annotations

import numpy as np
import pytest

from helpers import mechanics as mech
from helpers.mechanism_decks import Joint, Scene
from mbsim.errors import DeckError, SolverError

Z_TO_X = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
ARM = mech.Body(1.0, (0.01, 0.1, 0.1), (1.0, 0.0, 0.0))


def motion(joint, expr, val_type="D", extra=""):
    """Return a Motion_Joint."""
    return (
        f'<Motion_Joint id="1" joint_id="{joint}" val_type="{val_type}" type="EXPRESSION" '
        f'expr="{expr}" {extra}/>'
    )


def driven_arm(*args, **kwargs):
    """Return an arm on a revolute at the origin, driven."""
    return Scene([ARM], [Joint("REVOLUTE", 1, 0)], (0, -9.81, 0), motion(1, *args, **kwargs))


def slider_crank(expr):
    """Return crank and rod of sqrt(2) m each, whose slider is driven along x from 2 m."""
    bodies = [mech.Body(1.0, (0.1, 0.1, 0.1), p) for p in ((0.5, 0.5, 0), (1.5, 0.5, 0), (2, 0, 0))]
    joints = [
        Joint("REVOLUTE", 1, 0),
        Joint("REVOLUTE", 2, 1, (1, 1, 0)),
        Joint("REVOLUTE", 2, 3, (2, 0, 0)),
        Joint("TRANSLATIONAL", 3, 0, (2, 0, 0), R_i=Z_TO_X),
    ]
    return Scene(bodies, joints, (0, 0, 0), motion(4, expr))


@pytest.mark.parametrize("expr", ["STEP(TIME,0.2,0,0.4,1)", "STEP(TIME,0.2,0,0.21,1)"])
def test_a_step_does_not_leap_over_a_driven_move(expr, tmp_path):
    # all stages of a first long step may fall where the arm rests
    results = driven_arm(expr).run(tmp_path, 1.0, 0.1, 1e-7)
    total = sum(results[f"energy/{name}"] for name in ("kinetic", "potential", "dissipated"))
    lack = total - total[0] - results["energy/work_of_motions"]
    assert np.abs(lack).max() < 1e-6
    assert results["energy/work_of_motions"][-1] == pytest.approx(9.81 * np.sin(1.0), abs=1e-6)


@pytest.mark.parametrize("expr", ["IF(TIME-0.5:0,0,5)", "IF(TIME-0.5:0,0,-0.1)"])
@pytest.mark.parametrize("integrator", ["DOPRI5", "DOP853"])
def test_a_displacement_that_jumps_ends_the_run_by_name(expr, integrator, tmp_path):
    with pytest.raises(SolverError, match=r"time 0\.5 .*Motion_Joint\[1\]"):
        slider_crank(expr).run(tmp_path, 1.0, 0.1, 1e-7, integrator=integrator)


def test_a_rod_that_becomes_too_short_ends_the_run_in_time(tmp_path):
    # stretched at 2 sqrt(2) m
    with pytest.raises(SolverError, match=r"time 0\.8284271"):
        slider_crank("TIME").run(tmp_path, 2.0, 0.1, 1e-7)


@pytest.mark.parametrize("type", ["UNIVERSAL", "HOOKE"])
def test_a_cross_with_parallel_arms_is_refused(type, tmp_path):
    # UNIVERSAL: z and z; HOOKE: x of I and y of J
    R_i = np.eye(3) if type == "UNIVERSAL" else np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    scene = Scene([ARM], [Joint(type, 1, 0, R_i=R_i, R_j=np.eye(3))])
    with pytest.raises(DeckError, match=r"deck.xml:\d+: Constraint_Joint\[1\]: .* are parallel"):
        scene.run(tmp_path, 0.1, 0.1)


@pytest.mark.parametrize(
    ("val_type", "extra", "start", "rate"),
    [
        ("V", 'ic_disp="0.5"', 0.5, 0.3),
        ("V", 'ic_disp="6"', 6.0, 0.3),
        ("A", 'ic_vel="2"', 0.0, 2.0),
        ("A", 'ic_disp="-1" ic_vel="2"', -1.0, 2.0),
    ],
)
def test_initial_values_of_a_motion(val_type, extra, start, rate, tmp_path):
    scene = driven_arm("0.3" if val_type == "V" else "0", val_type, extra)
    results = scene.run(tmp_path, 1.0, 0.5)
    angle = start + rate * results["time"]
    p = results["bodies/2/position"]
    expected = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    np.testing.assert_allclose(p, expected, rtol=0, atol=1e-8)
    np.testing.assert_allclose(results["bodies/2/angular_velocity"][:, 2], rate, atol=1e-8)


@pytest.mark.parametrize("start", [6.0, -40.0])
def test_a_motion_may_begin_turns_away(start, tmp_path):
    scene = driven_arm(f"{start}+TIME")
    results = scene.run(tmp_path, 1.0, 0.5)
    angle = start + results["time"]
    expected = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    np.testing.assert_allclose(results["bodies/2/position"], expected, rtol=0, atol=1e-8)


def test_a_general_constraint_on_nothing_is_refused(tmp_path):
    scene = Scene([ARM], [], extra='<Constraint_General id="3" expr="TIME-1"/>')
    with pytest.raises(DeckError, match=r"Constraint_General\[3\]: .*where a moving body is"):
        scene.run(tmp_path, 0.1, 0.1)

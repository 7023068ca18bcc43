"""Forces by expressions of other forces and of reactions, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import mbsim
from helpers import mechanism_decks as decks
from helpers.decks import GROUND, run_deck, write_deck
from helpers.decks import sphere as free_sphere
from helpers.mechanics import Body
from mbsim.errors import DeckError, SolverError

G = 9.81
M = 2.0
#: Axes of markers by columns, z along the global x.
ALONG_X = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
INERTIA = (0.02, 0.03, 0.04)


def slider(extra, v=0.0, bodies=(), joints=(), type="TRANSLATIONAL", g=(0.0, 0.0, -G)):
    """Return a block on a guide along x; its marker 1000 and 1001 on ground have z along x."""
    block = Body(M, INERTIA, p=(0.0, 0.0, 0.0), v=(v, 0.0, 0.0))
    held = decks.Joint(type, 1, 0, (0, 0, 0), ALONG_X)
    return decks.Scene([block, *bodies], [held, *joints], g=g, extra=extra)


def scalar(id, expr, i=1000, j=1001, more='action_only="TRUE"', type="Force"):
    return (
        f'<Force_Scalar_TwoBody id="{id}" type="{type}" i_marker_id="{i}" j_marker_id="{j}" '
        f'expr="{expr}" {more}/>'
    )


def x_of(results, body=2):
    return results[f"bodies/{body}/position"][:, 0]


def imbalance(results):
    """Return how far the sum of energies less work goes from its start."""
    total = results["energy/kinetic"] + results["energy/potential"] + results["energy/dissipated"]
    return np.abs(total - total[0]).max()


def test_friction_by_an_expression_of_the_reaction_slows_a_block(tmp_path):
    mu, v0 = 0.3, 2.0
    run = slider(scalar(1, f"-{mu}*ABS(JOINT(1, 0, 4, 0))*TANH(1e3*VX(1000))"), v=v0).run(
        tmp_path, 0.6, 0.05
    )
    t = run["time"]
    # the block is fast: tanh is 1 to rounding
    np.testing.assert_allclose(x_of(run), v0 * t - 0.5 * mu * G * t**2, atol=1e-8)
    np.testing.assert_allclose(run["scalar_forces/1/force"][:, 0], -mu * M * G, rtol=1e-12)
    assert imbalance(run) < 1e-8


def test_friction_by_an_expression_equals_friction_of_the_joint(tmp_path):
    """A push F across the guide that grows with the friction itself: both runs settle it."""
    mu, speed = 0.2, 1e-3
    push = scalar(2, "7 + 5*SIN(9*TIME)", j=1002).replace("action_only", "action_only")
    markers = decks.marker(1002, 0, (0, 0, 0), np.eye(3))
    law = (
        f'<Force_JointFriction id="1" joint_id="1" cff_type="COULOMB_DYNAMICONLY" '
        f'mu_dynamic="{mu}" friction_trans_vel="{speed}"/>'
    )
    size = "SQRT(JOINT(1, 0, 3, 0)**2 + JOINT(1, 0, 4, 0)**2)"
    u = f"MIN(1, MAX(-1, VX(1000)/{speed}))"
    by_hand = scalar(1, f"-{mu}*{size}*{u}*(3 - {u}**2)/2")
    runs = []
    for k, extra in enumerate((law, by_hand)):
        folder = tmp_path / str(k)
        folder.mkdir()
        runs.append(slider(markers + extra + push, v=1.0).run(folder, 0.3, 0.01))
    np.testing.assert_allclose(x_of(runs[0]), x_of(runs[1]), atol=1e-8)
    np.testing.assert_allclose(
        runs[0]["joint_frictions/1/force"], runs[1]["scalar_forces/1/force"], atol=1e-6
    )


def test_a_force_is_twice_another_that_stands_behind_it(tmp_path):
    """SFORCE 1 looks at SFORCE 2, through a variable: -k x and -2 k x."""
    k = 30.0
    extra = (
        '<Reference_Variable id="5" expr="SFORCE(2, 0, 2, 0)"/>'
        + scalar(1, "2*VARVAL(5)")
        + scalar(2, f"-{k}*DX(1000)")
    )
    run = slider(extra, v=1.0).run(tmp_path, 1.0, 0.02)
    w = np.sqrt(3 * k / M)
    np.testing.assert_allclose(x_of(run), np.sin(w * run["time"]) / w, atol=1e-8)
    one, two = (run[f"scalar_forces/{id}/force"][:, 0] for id in (1, 2))
    np.testing.assert_allclose(one, 2 * two, atol=1e-12)
    np.testing.assert_allclose(two, -k * x_of(run), atol=1e-12)


@pytest.mark.parametrize("share", [0.5, -3.0, 3.0])
def test_a_force_that_is_a_share_of_the_reaction_it_causes(tmp_path, share):
    """A push inclined to the guide: N = m g + s c N, whether or not that alone would converge."""
    c, s = 0.6, 0.8
    axes = decks.marker(1002, 0, (0, 0, 0), np.array([[0, s, c], [1, 0, 0], [0, c, -s]]))
    run = slider(axes + scalar(1, f"{share}*JOINT(1, 0, 4, 0)", j=1002)).run(tmp_path, 0.5, 0.05)
    # F = share N along (c, 0, -s), N = m g + s F
    N = M * G / (1 - s * share)
    np.testing.assert_allclose(run["joints/1/force"][:, 2], N, rtol=1e-11)
    np.testing.assert_allclose(x_of(run), 0.5 * c * share * N / M * run["time"] ** 2, atol=1e-8)
    assert imbalance(run) < 1e-8


def test_components_of_a_vector_force_follow_from_the_reaction_and_each_other(tmp_path):
    """F_x = a R_z, F_z = b R_z + d R_y, F_y = e R_z: three unknowns, solved by hand."""
    a, b, d, e = 0.4, -0.7, 0.3, 2.0
    force = (
        '<Force_Vector_OneBody id="1" type="ForceOnly" i_marker_id="1000" '
        f'fx_expression="{a}*JOINT(1, 0, 4, 0)" fy_expression="{e}*JOINT(1, 0, 4, 0)" '
        f'fz_expression="{b}*FZ(1000, 1001) + {d}*JOINT(1, 0, 3, 0)"/>'
    )
    run = slider(force).run(tmp_path, 0.5, 0.05)
    # R_y = -e R_z, R_z = m g - b R_z - d R_y
    R = M * G / (1 + b - d * e)
    np.testing.assert_allclose(run["joints/1/force"][:, 2], R, rtol=1e-11)
    np.testing.assert_allclose(run["joints/1/force"][:, 1], -e * R, rtol=1e-11)
    np.testing.assert_allclose(x_of(run), 0.5 * a * R / M * run["time"] ** 2, atol=1e-8)
    assert imbalance(run) < 1e-8


def test_a_free_body_is_pushed_by_the_reaction_of_another(tmp_path):
    """The guide's reaction, -m g, on a body that no joint holds, and back by action = reaction."""
    other = Body(0.5, INERTIA, p=(0.0, 0.0, 3.0))
    extra = decks.marker(1003, 2, (0, 0, 3.0), np.eye(3)) + scalar(
        1, "JOINT(1, 1, 4, 0)", i=1003, j=1001, more=""
    )
    run = slider(extra, bodies=[other]).run(tmp_path, 0.2, 0.02)
    fall = run["bodies/3/position"][:, 2] - 3.0
    np.testing.assert_allclose(fall, -0.5 * (G + M * G / 0.5) * run["time"] ** 2, atol=1e-8)


def test_a_motor_that_is_helped_by_its_own_reaction(tmp_path):
    """x is driven as t^3; a force is half of the motor's: m x'' = F + F/2."""
    motion = '<Motion_Joint id="7" joint_id="1" joint_type="T" val_type="D" expr="TIME**3"/>'
    motion = motion.replace("joint_type", "motion_type")
    run = slider(motion + scalar(1, "0.5*MOTION(7, 0, 2, 0)")).run(tmp_path, 1.0, 0.05)
    needed = 6 * M * run["time"]
    np.testing.assert_allclose(run["motions/7/force"][:, 0], needed / 1.5, atol=1e-9)
    np.testing.assert_allclose(run["scalar_forces/1/force"][:, 0], needed / 3, atol=1e-9)


def test_brake_torque_by_the_pin_force_of_a_pendulum(tmp_path):
    """A torque mu r abs(F of the pin) TANH(w), settled with a JointFriction on the same pin."""
    mu, radius, length, inertia = 0.3, 0.05, 0.7, 0.05
    hinge = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    R = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
    body = Body(M, (0.06, inertia, 0.04), p=(length, 0.0, 0.0), R=R)
    size = "SQRT(JOINT(1, 0, 2, 0)**2 + JOINT(1, 0, 4, 0)**2)"
    brake = scalar(1, f"-{mu * radius}*{size}*TANH(WZ(1000, 1001, 1001))", type="Torque")
    friction = (
        '<Force_JointFriction id="1" joint_id="1" cff_type="COULOMB_DYNAMICONLY" '
        f'mu_dynamic="{mu}" friction_trans_vel="0.01" pin_radius="{radius}"/>'
    )
    run = decks.Scene(
        [body], [decks.Joint("REVOLUTE", 1, 0, (0, 0, 0), hinge)], extra=brake + friction
    ).run(tmp_path, 0.5, 0.01)

    def rates(t, y):
        # angle from hanging and its rate, against +y; N by the fixed point, which contracts
        th, w, alpha = y[0], y[1], 0.0
        u = np.clip(radius * w / 0.01, -1, 1)
        part = mu * radius * (np.tanh(w) + u * (3 - u * u) / 2)
        for _ in range(200):
            along = M * (length * w * w + G * np.cos(th))
            across = M * (length * alpha + G * np.sin(th))
            torque = -part * np.hypot(along, across)
            alpha = (torque - M * G * length * np.sin(th)) / (inertia + M * length**2)
        return [w, alpha]

    t = run["time"]
    own = solve_ivp(
        rates, (0, t[-1]), (np.pi / 2, 0.0), "DOP853", t_eval=t, rtol=1e-12, atol=1e-13,
        max_step=1e-3,
    )  # fmt: skip
    p = run["bodies/2/position"]
    np.testing.assert_allclose(p[:, 0], length * np.sin(own.y[0]), atol=1e-8)
    np.testing.assert_allclose(p[:, 2], -length * np.cos(own.y[0]), atol=1e-8)
    assert imbalance(run) < 1e-8


def test_a_force_follows_a_contact_and_a_state_follows_the_force(tmp_path):
    """A sphere rests on a plane; another is lifted by twice what it presses with.

    z' is that force: its integral is the impulse.
    """
    ball = free_sphere(0.1 - (2.0 * G / 1e5) ** (1 / 1.5), mass=2.0)
    other = free_sphere(3.0, mass=1.0, body=3, x=1.0)
    touch = (
        '<Force_Contact id="1" num_i_graphics="1" i_graphics_id="200" num_j_graphics="1" '
        'j_graphics_id="100" cnf_type="Impact" stiffness="1e5" exponent="1.5" damping="50" '
        'dmax="1e-3"/>'
    )
    lift = scalar(1, "2*CONTACT(1, 0, 4, 0)", i=30, j=10)
    state = '<Control_Diff id="5" expr="SFORCE(1, 0, 4, 0)" ic="0"/>'
    seen = '<Post_Request id="1" type="EXPRESSION" expr1="DIF(5)"/>'
    gravity = f'<Force_Gravity grav_z="{-G}"/>'
    run = run_deck(
        tmp_path, GROUND + ball + other + touch + lift + state + seen + gravity, 0.5, 0.1, tol=1e-9
    )
    t = run["time"]
    force = 2 * 2.0 * G
    np.testing.assert_allclose(
        run["bodies/3/position"][:, 2], 3.0 + 0.5 * (force - G) * t**2, atol=1e-8
    )
    np.testing.assert_allclose(run["requests/1"][:, 0], force * t, atol=1e-7)


def test_a_state_of_a_reaction_is_refused_by_name(tmp_path):
    state = '<Control_Diff id="5" expr="JOINT(1, 0, 4, 0)" ic="0"/>'
    with pytest.raises(DeckError, match=r"Control_Diff\[5\].*needs reactions"):
        slider(state).run(tmp_path, 0.1, 0.05)


def test_reactions_that_no_force_agrees_with_end_the_run_by_name(tmp_path):
    """N = m g + F, F = N: there is no such force."""
    axes = decks.marker(1002, 0, (0, 0, 0), np.diag([1.0, -1.0, -1.0]))
    scene = slider(axes + scalar(4, "JOINT(1, 0, 4, 0)", j=1002))
    with pytest.raises(SolverError, match=r"Force_Scalar_TwoBody\[4\].* does not settle at time 0"):
        scene.run(tmp_path, 0.1, 0.05)


def test_a_force_that_is_no_number_is_named(tmp_path):
    scene = slider(scalar(4, "SQRT(-JOINT(1, 0, 4, 0))"))
    with pytest.raises(SolverError, match=r"Force_Scalar_TwoBody\[4\] is not finite at time 0"):
        scene.run(tmp_path, 0.1, 0.05)


def test_two_rails_press_as_one(tmp_path):
    """Redundant: each takes half of the weight, and their frictions are those of one."""
    mu = 0.3
    size = "(ABS(JOINT(1, 0, 4, 0)) + ABS(JOINT(2, 0, 4, 0)))"
    rail = decks.Joint("TRANSLATIONAL", 1, 0, (0, 0, 0), ALONG_X)
    run = slider(scalar(1, f"-{mu}*{size}"), v=2.0, joints=[rail]).run(tmp_path, 0.3, 0.1)
    t = run["time"]
    np.testing.assert_allclose(x_of(run), 2 * t - 0.5 * mu * G * t**2, atol=1e-8)
    np.testing.assert_allclose(run["joints/2/force"][:, 2], 0.5 * M * G, rtol=1e-11)


def test_equilibrium_with_a_share_of_a_reaction(tmp_path):
    """k x = 0.5 N, N = m g."""
    path = write_deck(tmp_path, slider(scalar(1, "-100*DX(1000) + 0.5*JOINT(1, 0, 4, 0)")).xml())
    text = path.read_text(encoding="utf-8")
    at = text.index("<Simulate")
    end = text.index("/>", at)
    path.write_text(text[:at] + '<Simulate analysis_type="Static"' + text[end:], encoding="utf-8")
    run = mbsim.simulate(mbsim.read_model(path))
    np.testing.assert_allclose(x_of(run), [0.5 * M * G / 100], atol=1e-13)


@pytest.mark.parametrize(
    ("first", "second", "said"),
    [
        ("SFORCE(2, 0, 2, 0)", "SFORCE(1, 0, 2, 0)", "forces that need each other"),
        ("1", "3 + FX(1000)", "a force that needs itself"),
        ("SFORCE(2, 0, 2, 0)", "VARVAL(5) + JOINT(1, 0, 4, 0)", "forces that need each other"),
    ],
)
def test_forces_in_a_circle_are_refused_by_name(tmp_path, first, second, said):
    variable = '<Reference_Variable id="5" expr="2*SFORCE(1, 0, 2, 0)"/>'
    scene = slider(variable + scalar(1, first) + scalar(2, second))
    with pytest.raises(DeckError) as error:
        scene.run(tmp_path, 0.1, 0.05)
    assert said in str(error.value)
    assert "Force_Scalar_TwoBody[2]" in str(error.value)


def test_accelerations_stay_refused_in_forces(tmp_path):
    with pytest.raises(DeckError, match="ACCX looks at accelerations, which cannot be used here"):
        slider(scalar(1, "ACCX(1000)")).run(tmp_path, 0.1, 0.05)


def test_check_finds_the_circle_without_a_run(tmp_path):
    from click.testing import CliRunner

    from mbsim.cli.main import main

    good = slider(scalar(1, "JOINT(1, 0, 4, 0)") + scalar(2, "SFORCE(1, 0, 2, 0)"))
    circle = slider(scalar(1, "SFORCE(2, 0, 2, 0)") + scalar(2, "SFORCE(1, 0, 2, 0)"))
    for scene, code, said in ((good, 0, "ok"), (circle, 2, "forces that need each other")):
        path = write_deck(tmp_path, scene.xml())
        shown = CliRunner().invoke(main, ["check", str(path)])
        assert shown.exit_code == code
        assert said in shown.output

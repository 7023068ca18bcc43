"""Friction and limits of joints against closed forms and scipy solutions of their own."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from helpers import mechanism_decks as decks
from helpers.mechanics import Body
from mbsim.errors import SolverError

G = 9.81
#: Axes of joints by columns, z along the global y (a pendulum swings in the xz-plane), and along x.
HINGE = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
ALONG_X = HINGE.T
KINETIC, POTENTIAL, DISSIPATED = "energy/kinetic", "energy/potential", "energy/dissipated"


def friction(joint, mu, speed=1e-3, id=1, **more):
    """Return a Force_JointFriction with COULOMB_DYNAMICONLY."""
    given = " ".join(f'{name}="{value!r}"' for name, value in more.items())
    return (
        f'<Force_JointFriction id="{id}" joint_id="{joint}" cff_type="COULOMB_DYNAMICONLY" '
        f'mu_dynamic="{mu!r}" friction_trans_vel="{speed!r}" {given}/>'
    )


def limit(joint, direction, id=1, **more):
    """Return a Force_JointLimit with IMPACT."""
    given = " ".join(f'{name}="{value!r}"' for name, value in more.items())
    return (
        f'<Force_JointLimit id="{id}" joint_id="{joint}" motion_type="{direction}" '
        f'cnf_type="IMPACT" {given}/>'
    )


def ramp(v, mu, speed):
    """Return the coefficient of COULOMB_DYNAMICONLY, with the sign of v."""
    u = np.clip(v / speed, -1.0, 1.0)
    return mu * u * (3.0 - u * u) / 2.0


def imbalance(results):
    """Return how far the sum of energies goes from its start, over the largest kinetic energy."""
    total = results[KINETIC] + results[POTENTIAL] + results[DISSIPATED]
    return np.abs(total - total[0]).max() / results[KINETIC].max()


def spin_of(results, body):
    return results[f"bodies/{body}/angular_velocity"]


M, LENGTH, I_CG = 2.0, 0.7, 0.05


def pendulum(extra, angle=np.pi / 2, w=0.0):
    """Return a pendulum on a pin along y, at `angle` from hanging."""
    c, s = np.cos(angle), np.sin(angle)
    # at rest it hangs along -z; turned about -y by the angle its cg is at +x
    R = np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])
    p = LENGTH * np.array([s, 0.0, -c])
    omega = np.array([0.0, -w, 0.0])
    body = Body(M, (0.06, I_CG, 0.04), p=p, R=R, w=omega, v=np.cross(omega, p))
    return decks.Scene([body], [decks.Joint("REVOLUTE", 1, 0, (0, 0, 0), HINGE)], extra=extra)


def pin_solution(mu, radius, speed, preload, angle, times, w=0.0):
    """Return angle and rate of the pendulum; its normal force holds N = |F(theta'', theta', N)|."""
    inertia = I_CG + M * LENGTH**2

    def rates(t, y):
        th, om = y
        free = -M * G * LENGTH * np.sin(th)
        k = ramp(radius * om, mu, speed) * radius
        N = M * G
        for _ in range(200):
            # along the rod m (l om^2 + g cos), across it m (l alpha + g sin)
            alpha = (free - k * N) / inertia
            new = M * np.hypot(LENGTH * om**2 + G * np.cos(th), LENGTH * alpha + G * np.sin(th))
            new += preload
            if abs(new - N) < 1e-14 * new:
                break
            N = new
        return [om, (free - k * new) / inertia]

    return solve_ivp(
        rates, (0, times[-1]), [angle, w], "DOP853", times, rtol=1e-12, atol=1e-13, max_step=2e-3
    ).y


@pytest.mark.parametrize("preload", [0.0, 5.0])
def test_pin_friction_takes_a_pendulum_as_an_own_solution_says(tmp_path, preload):
    mu, radius, speed = 0.3, 0.05, 0.01
    text = friction(1, mu, speed, pin_radius=radius, preload=preload)
    results = pendulum(text).run(tmp_path, 3.0, 0.01, tol=1e-10)
    th, om = pin_solution(mu, radius, speed, preload, np.pi / 2, results["time"])
    position = results["bodies/2/position"]
    np.testing.assert_allclose(position[:, 0], LENGTH * np.sin(th), atol=1e-7)
    np.testing.assert_allclose(spin_of(results, 2)[:, 1], -om, atol=1e-6)
    # turning points: each half swing is shorter than the one before
    turns = np.abs(th[1:-1][(om[:-2] * om[2:] < 0)])
    assert len(turns) >= 2
    assert turns[-1] < np.pi / 2 - 0.1
    assert imbalance(results) < 1e-8
    # the torque is -mu N r against the spin, and the reaction is the constraint force alone
    force = np.linalg.norm(results["joints/1/force"], axis=1) + preload
    torque = results["joint_frictions/1/torque"][:, 1]
    np.testing.assert_allclose(torque, ramp(radius * om, mu, speed) * radius * force, atol=1e-6)
    assert np.abs(results["joints/1/torque"][:, 1]).max() < 1e-9


def slider(extra, side=0.0, rails=1, v=3.0):
    """Return a block that slides along x on rails, weight and a side force pressing on them."""
    body = Body(M, (0.1, 0.2, 0.25), (0, 0, 0), v=(v, 0, 0))
    joints = [decks.Joint("TRANSLATIONAL", 1, 0, (0, 0, 0), ALONG_X) for _ in range(rails)]
    return decks.Scene([body], joints, g=(0.0, side / M, -G), extra=extra)


@pytest.mark.parametrize("side", [0.0, 12.0])
@pytest.mark.parametrize("rails", [1, 2])
def test_a_block_on_rails_slows_down_by_mu_n_over_m(tmp_path, side, rails):
    mu = 0.25
    text = "".join(friction(k + 1, mu, id=k + 1) for k in range(rails))
    results = slider(text, side, rails).run(tmp_path, 0.8, 0.05, tol=1e-10)
    slow = mu * np.hypot(M * G, side) / M
    t = results["time"]
    np.testing.assert_allclose(results["bodies/2/velocity"][:, 0], 3.0 - slow * t, atol=1e-8)
    np.testing.assert_allclose(
        results["bodies/2/position"][:, 0], 3 * t - slow * t * t / 2, atol=1e-8
    )
    assert imbalance(results) < 1e-9
    for k in range(rails):
        force = results[f"joint_frictions/{k + 1}/force"][:, 0]
        np.testing.assert_allclose(force, -slow * M / rails, rtol=1e-9)


@pytest.mark.parametrize("arm", [0.4, 0.15, 0.079])
def test_an_arm_adds_the_bending_torque(tmp_path, arm):
    mu, high = 0.25, 0.3
    # the rail runs `high` above the cg: m a high is borne as torque, and presses
    scene = slider(friction(1, mu, bending_reaction_arm=arm))
    scene.joints[0].p = (0.0, 0.0, high)
    # a = mu (g + a high/arm): with the last arm nearly self-locking
    slow = mu * G / (1.0 - mu * high / arm)
    results = scene.run(tmp_path, 2.0 / slow, 0.2 / slow, tol=1e-10)
    velocity = results["bodies/2/velocity"][:, 0]
    np.testing.assert_allclose(velocity, 3.0 - slow * results["time"], atol=1e-8)


def test_friction_that_feeds_itself_jams_and_is_named(tmp_path):
    scene = slider(friction(1, 0.25, bending_reaction_arm=0.071))
    scene.joints[0].p = (0.0, 0.0, 0.3)
    with pytest.raises(SolverError, match=r"Force_JointFriction\[1\]: Constraint_Joint\[1\] jams"):
        scene.run(tmp_path, 0.5, 0.05)


def test_ball_friction_loses_what_it_says(tmp_path):
    rod = np.array([0.6, 0.0, -0.2])
    w = np.array([1.0, 2.0, 8.0])
    body = Body(M, (0.05, 0.06, 0.03), p=rod, w=w, v=np.cross(w, rod))
    text = friction(1, 0.2, 0.01, ball_radius=0.03)
    scene = decks.Scene([body], [decks.Joint("SPHERICAL", 1, 0)], extra=text)
    results = scene.run(tmp_path, 2.0, 0.02, tol=1e-10)
    assert imbalance(results) < 1e-9
    assert results[DISSIPATED][-1] > 0.05 * results[KINETIC][0]
    assert (np.diff(results[DISSIPATED]) > 0.0).all()
    spin, force = spin_of(results, 2), np.linalg.norm(results["joints/1/force"], axis=1)
    mu = ramp(0.03 * np.linalg.norm(spin, axis=1), 0.2, 0.01)
    along = spin / np.linalg.norm(spin, axis=1)[:, None]
    expected = -(mu * force * 0.03)[:, None] * along
    np.testing.assert_allclose(results["joint_frictions/1/torque"], expected, atol=1e-8)


def test_a_cylindrical_joint_has_one_friction_along_its_screw(tmp_path):
    """Bar on a horizontal pin: turning and sliding share mu N in the ratio of their speeds."""
    mu, radius, inertia = 0.2, 0.05, 0.3
    body = Body(M, (inertia, 0.2, 0.2), (0, 0, 0), v=(2.0, 0, 0), w=(30.0, 0, 0))
    joint = decks.Joint("CYLINDRICAL", 1, 0, (0, 0, 0), ALONG_X)
    scene = decks.Scene([body], [joint], extra=friction(1, mu, 1e-3, pin_radius=radius))
    results = scene.run(tmp_path, 0.5, 0.02, tol=1e-10)

    def rates(t, y):
        v, u = y[0], radius * y[1]
        pull = mu * M * G / np.hypot(u, v)
        return [-pull * v / M, -pull * u * radius / inertia]

    t = results["time"]
    v, w = solve_ivp(rates, (0, 0.5), [2.0, 30.0], "DOP853", t, rtol=1e-12, atol=1e-12).y
    np.testing.assert_allclose(results["bodies/2/velocity"][:, 0], v, atol=1e-8)
    np.testing.assert_allclose(spin_of(results, 2)[:, 0], w, atol=1e-7)
    assert imbalance(results) < 1e-9


@pytest.mark.parametrize("type", ["REVOLUTE", "TRANSLATIONAL", "CYLINDRICAL", "SPHERICAL"])
@pytest.mark.parametrize("swapped", [False, True])
def test_friction_takes_energy_and_keeps_momentum(tmp_path, type, swapped):
    """Two free bodies in a joint: whatever acts in it changes neither momentum."""
    bodies = [
        Body(1.5, (0.05, 0.08, 0.06), p=(-0.2, 0.1, 0), v=(0.3, 0, 0.1), w=(1.0, -2.0, 5.0)),
        Body(0.8, (0.03, 0.04, 0.02), p=(0.3, 0.0, 0.1), v=(-0.2, 0.5, 0.4), w=(-3.0, 1.0, -4.0)),
    ]
    lever = {"REVOLUTE": "pin", "CYLINDRICAL": "pin", "SPHERICAL": "ball", "TRANSLATIONAL": ""}
    more = {f"{lever[type]}_radius": 0.04} if lever[type] else {}
    i, j = (2, 1) if swapped else (1, 2)
    text = friction(1, 0.3, 0.01, preload=2.0, **more)
    scene = decks.Scene(bodies, [decks.Joint(type, i, j)], g=(0, 0, 0), extra=text).consistent()
    results = scene.run(tmp_path, 0.5, 0.01, tol=1e-11)
    assert imbalance(results) < 1e-9
    assert results[DISSIPATED][-1] > 1e-3 * results[KINETIC][0]
    assert (np.diff(results[DISSIPATED]) >= 0.0).all()
    momentum, turning = 0.0, 0.0
    for k, body in enumerate(scene.bodies, 2):
        p, v = results[f"bodies/{k}/position"], results[f"bodies/{k}/velocity"]
        q, w = results[f"bodies/{k}/quaternion"], spin_of(results, k)
        R = matrices(q)
        momentum = momentum + body.mass * v
        spun = np.einsum("nij,j,nkj,nk->ni", R, np.array(body.inertia), R, w)
        turning = turning + body.mass * np.cross(p, v) + spun
    np.testing.assert_allclose(momentum, momentum[:1].repeat(len(momentum), 0), atol=1e-8)
    np.testing.assert_allclose(turning, turning[:1].repeat(len(turning), 0), atol=1e-8)


def chain(closed, mu):
    """Return four links in a plane, all pins with friction; closed: the last pin is on ground."""
    turn = 0.3
    ends = np.array([[0, 0, 0], [1, 0, 0], [1.6, 0, -0.8], [0.9, 0, -1.5], [-0.1, 0, -1.2]], float)
    bodies = [
        Body(0.5 + 0.1 * k, (0.03, 0.04, 0.02), p=0.5 * (ends[k] + ends[k + 1])) for k in range(4)
    ]
    joints = [decks.Joint("REVOLUTE", k + 1, k, ends[k], HINGE) for k in range(4)]
    if closed:
        joints.append(decks.Joint("REVOLUTE", 4, 0, ends[4], HINGE))
    # out of plane weight is borne too
    pins = "".join(
        friction(k + 1, mu, 0.02, id=k + 1, pin_radius=0.02, bending_reaction_arm=turn)
        for k in range(len(joints))
    )
    return decks.Scene(bodies, joints, g=(0.5, 2.0, -9.81), extra=pins)


@pytest.mark.parametrize("closed", [False, True])
def test_many_frictions_settle_together(tmp_path, closed):
    """Each torque is what the law makes of the reaction as reported, loops and planes included."""
    mu, radius, speed, arm = 0.4, 0.02, 0.02, 0.3
    scene = chain(closed, mu)
    results = scene.run(tmp_path, 1.0, 0.02, tol=1e-9)
    assert imbalance(results) < 1e-7
    assert results[DISSIPATED][-1] > 0.02 * results[KINETIC].max()
    spins = {0: np.zeros(len(results["time"]))}
    spins |= {k: spin_of(results, k + 1)[:, 1] for k in range(1, 5)}
    for n, joint in enumerate(scene.joints, 1):
        # z of J stays along y
        force, torque = results[f"joints/{n}/force"], results[f"joints/{n}/torque"]
        normal = np.hypot(force[:, 0], force[:, 2]) + np.hypot(torque[:, 0], torque[:, 2]) / arm
        slip = radius * (spins[joint.i] - spins[joint.j])
        expected = -ramp(slip, mu, speed) * radius * normal
        given = results[f"joint_frictions/{n}/torque"]
        np.testing.assert_allclose(given[:, 1], expected, atol=1e-9)
        assert np.abs(given[:, [0, 2]]).max() < 1e-9


def matrices(q):
    """Return rotation matrices of quaternions, w first."""
    w, x, y, z = q.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


@pytest.mark.parametrize("text", [friction(1, 0.0, pin_radius=0.05), None])
def test_no_coefficient_is_no_friction(tmp_path, text):
    off = '<Force_JointFriction id="1" joint_id="1" cff_type="COULOMB_OFF" pin_radius="0.05"/>'
    for name in "ab":
        (tmp_path / name).mkdir()
    with_it = pendulum(text or off).run(tmp_path / "a", 1.0, 0.05)
    without = pendulum("").run(tmp_path / "b", 1.0, 0.05)
    for name in ("position", "velocity", "quaternion"):
        assert np.array_equal(with_it[f"bodies/2/{name}"], without[f"bodies/2/{name}"])
    assert with_it["joint_frictions/1/torque"].any() == np.False_


def impact(depth, closing, k, e, c, dmax):
    """Return the force of IMPACT, written out anew."""
    if depth <= 0.0:
        return 0.0
    u = min(depth / dmax, 1.0)
    return max(0.0, k * depth**e + c * u * u * (3 - 2 * u) * closing)


def test_a_pendulum_at_a_stop_is_as_one_degree_of_freedom(tmp_path):
    k, e, c, dmax, upper = 400.0, 1.5, 2.0, 0.02, 0.3
    # J's z is +y; at the start, marker I's axes are J's: its angle is 0 where it starts
    text = limit(1, "R", upper=upper, stiffness=k, exponent=e, damping=c, dmax=dmax)
    results = pendulum(text).run(tmp_path, 2.5, 0.005, tol=1e-10)
    inertia = I_CG + M * LENGTH**2

    def rates(t, y):
        # a: turn about +y since the start, th = pi/2 - a
        a, w = y
        push = impact(a - upper, w, k, e, c, dmax)
        return [w, (M * G * LENGTH * np.sin(np.pi / 2 - a) - push) / inertia]

    t = results["time"]
    a, w = solve_ivp(
        rates, (0, 2.5), [0.0, 0.0], "DOP853", t, rtol=1e-12, atol=1e-13, max_step=1e-3
    ).y
    assert a.max() > upper
    assert np.count_nonzero(w[:-1] * w[1:] < 0) >= 2
    np.testing.assert_allclose(spin_of(results, 2)[:, 1], w, atol=2e-6)
    np.testing.assert_allclose(results["bodies/2/position"][:, 0], LENGTH * np.cos(a), atol=1e-7)
    push = [-impact(x - upper, v, k, e, c, dmax) for x, v in zip(a, w, strict=True)]
    np.testing.assert_allclose(results["joint_limits/1/torque"][:, 1], push, atol=2e-3)
    assert imbalance(results) < 1e-7
    assert results[DISSIPATED][-1] > 0.01


@pytest.mark.parametrize("swapped", [False, True])
def test_a_slider_between_two_elastic_stops_keeps_its_energy(tmp_path, swapped):
    """Linear springs at both ends: the period is 2 (gap/v + pi sqrt(m/k))."""
    k, v, low, high = 5000.0, 2.0, -0.1, 0.2
    text = limit(1, "T", lower=low, upper=high, stiffness=k, exponent=1.0)
    scene = slider(text, v=v)
    if swapped:
        joint = scene.joints[0]
        joint.i, joint.j = joint.j, joint.i
        scene = slider(limit(1, "T", lower=-high, upper=-low, stiffness=k, exponent=1.0), v=v)
        scene.joints[0] = joint
    period = 2.0 * ((high - low) / v + np.pi * np.sqrt(M / k))
    results = scene.run(tmp_path, 3 * period, period, tol=1e-10)
    np.testing.assert_allclose(results["bodies/2/position"][:, 0], 0.0, atol=1e-6)
    np.testing.assert_allclose(results["bodies/2/velocity"][:, 0], v, atol=1e-6)
    assert imbalance(results) < 1e-7
    assert results[DISSIPATED][-1] == 0.0


@pytest.mark.parametrize("law", ["HUNT_CROSSLEY", "POISSON"])
def test_other_laws_serve_as_stops_and_close_the_balance(tmp_path, law):
    text = {
        "HUNT_CROSSLEY": 'stiffness="4e4" restitution_coef="0.6" ref_velocity="2"',
        "POISSON": 'penalty="4e4" restitution_coef="0.6" normal_trans_vel="0.01"',
    }[law]
    stop = (
        '<Force_JointLimit id="1" joint_id="1" motion_type="T" lower="-0.1" upper="0.1" '
        f'cnf_type="{law}" {text}/>'
    )
    results = slider(stop, v=2.0).run(tmp_path, 0.14, 0.002, tol=1e-9)
    assert imbalance(results) < 1e-6
    # one rebound: 2 -> -e 2
    assert results["bodies/2/velocity"][-1, 0] == pytest.approx(-1.2, rel=0.01)
    assert results["joint_limits/1/force"][:, 0].min() < -100.0
    assert results["joint_limits/1/force"][:, 0].max() == 0.0


def test_requests_and_info_know_friction_and_limits(tmp_path):
    """The force on J is the opposite; all that acts between the markers is reaction + friction."""
    asked = "".join(
        f'<Post_Request id="{k}" type="ELEMENTAL_FORCE" elem_type="{elem}" elem_id="1" {more}/>'
        for k, (elem, more) in enumerate(
            [("JOINTFRICTION", ""), ("JOINTFRICTION", 'jflag="TRUE"'), ("JOINTLIMIT", "")], 1
        )
    )
    all_of_it = '<Post_Request id="4" type="MARKER_FORCE" i_marker_id="1000" j_marker_id="1001"/>'
    stop = limit(1, "T", upper=0.2, stiffness=1e4, exponent=1.0)
    scene = slider(friction(1, 0.25) + stop + asked + all_of_it)
    results = scene.run(tmp_path, 0.1, 0.01)
    on_i, on_j = results["requests/1"][:, 1:4], results["requests/2"][:, 1:4]
    np.testing.assert_allclose(on_i, results["joint_frictions/1/force"])
    np.testing.assert_allclose(on_j, -on_i)
    np.testing.assert_allclose(results["requests/3"][:, 1:4], results["joint_limits/1/force"])
    parts = ("joints", "joint_frictions", "joint_limits")
    total = sum(results[f"{part}/1/force"] for part in parts)
    np.testing.assert_allclose(results["requests/4"][:, 1:4], total)
    assert results["joint_limits/1/force"][:, 0].min() < -100.0

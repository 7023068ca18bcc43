"""Mechanisms against published values, closed forms and an independent solver (`mechanics`)."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipj, ellipk

from helpers import mechanics as mech
from helpers import squeezer
from helpers.decks import run_deck
from helpers.known_mechanisms import (
    bricard,
    four_bars,
    heavy_top,
    passive,
    pendulum,
)
from helpers.mechanism_decks import (
    EYE,
    SIDE,
    SKEW,
    X_UP,
    Y_UP,
    Joint,
    Scene,
    apart,
    residual,
    rotation,
    states,
)


def balance(results, driven=True):
    """Return what the energy balance lacks at the rows [J]."""
    total = results["energy/kinetic"] + results["energy/potential"] + results["energy/dissipated"]
    if driven:
        total = total - results["energy/work_of_motions"]
    return total - total[0]


# --- published problems ---


@pytest.mark.parametrize("kind", ["REVOLUTE", "SPHERICAL", "DISTANCE"])
def test_planar_pendulum(kind, tmp_path):
    scene = pendulum(kind)
    results = scene.run(tmp_path, 10.0, 0.01)
    p = results["bodies/2/position"]
    # at 10 s, from the elliptic functions of the catalogue; its period 2.3678419475762 s
    np.testing.assert_allclose(p[-1, :2], (-0.2750874626, -0.9614192051), rtol=0, atol=1e-5)
    t = results["time"]
    # sin(half of the angle from below) = sn(K - sqrt(g) t, m) / sqrt 2 with m = 1/2
    sn = ellipj(ellipk(0.5) - np.sqrt(9.81) * t, 0.5)[0]
    half = np.arcsin(sn * np.sqrt(0.5))
    exact = np.column_stack([-np.sin(2 * half), -np.cos(2 * half)])
    assert np.abs(p[:, :2] - exact).max() < 1e-6
    period = 4 * ellipk(0.5) / np.sqrt(9.81)
    assert period == pytest.approx(2.3678419475762, rel=1e-13)
    # pull of the pivot: m (3 g h), h the depth below it; it points to the pivot
    force = results["joints/1/force"]
    pull = -3 * 9.81 * exact[:, 1]
    assert np.abs(force[:, :2] + pull[:, None] * exact).max() < 1e-4
    assert np.abs(passive(results)).max() < 1e-7
    assert residual(results, scene.mechanism())[0] < 1e-9


def test_pendulum_from_the_default_tolerance(tmp_path):
    results = run_deck(tmp_path, pendulum("REVOLUTE").xml(), 10.0, 0.01)
    p = results["bodies/2/position"][-1, :2]
    np.testing.assert_allclose(p, (-0.2750874626, -0.9614192051), rtol=0, atol=1e-3)


def test_errors_fall_by_decades_with_tol(tmp_path):
    end = np.array([-0.2750874626, -0.9614192051])
    errors = []
    for tol in (1e-5, 1e-7, 1e-9):
        results = pendulum("REVOLUTE").run(tmp_path, 10.0, 0.1, tol)
        errors.append(np.abs(results["bodies/2/position"][-1, :2] - end).max())
    assert errors[1] < errors[0] / 10
    assert errors[2] < errors[1] / 10


def test_heavy_top(tmp_path):
    scene = heavy_top()
    results = scene.run(tmp_path, 2.0, 0.5, 1e-10)
    expected = {
        1: (-0.7024683, -0.02116518, -0.71140026),
        2: (0.17334396, 0.64008859, -0.74849079),
        4: (-0.15041682, -0.72416559, -0.67302227),
    }
    for row, place in expected.items():
        np.testing.assert_allclose(results["bodies/2/position"][row], place, rtol=0, atol=2e-6)
    assert np.abs(passive(results)).max() < 1e-6 * results["energy/kinetic"][0]
    assert residual(results, scene.mechanism())[0] < 1e-9


def test_four_bars(tmp_path):
    # passes through four flat positions a turn, in which it could fold; joints are redundant
    scene = four_bars(2)
    results = scene.run(tmp_path, 20.0, 0.5, 1e-10)
    p, q = results["bodies/2/position"], results["bodies/2/quaternion"]
    tip = p + np.array([mech.matrix(x)[:, 1] for x in q]) * 0.5
    expected = {
        1.0: (-0.1950203019, -0.9807992057),
        5.0: (-0.8113104610, -0.5846155454),
        10.0: (0.3284581115, 0.9445185382),
        20.0: (0.8397465743, 0.5429785364),
    }
    for t, place in expected.items():
        row = np.searchsorted(results["time"], t - 1e-9)
        np.testing.assert_allclose(tip[row, :2], place, rtol=0, atol=1e-4)
    assert np.abs(passive(results)).max() < 1e-5
    assert residual(results, scene.mechanism())[0] < 1e-9


def test_errors_of_four_bars_fall_with_tol(tmp_path):
    """All links turn alike: th'' = g c sin th, c = ((n+1)/2 + n)/((n+1)/3 + n)."""
    n, end = 5, 3.0
    c = ((n + 1) / 2 + n) / ((n + 1) / 3 + n)
    exact = solve_ivp(
        lambda t, y: (y[1], 9.81 * c * np.sin(y[0])),
        (0.0, end),
        (0.0, 1.0),
        method="DOP853",
        rtol=1e-13,
        atol=1e-13,
    )
    tip = 0.5 * np.array((np.sin(exact.y[0, -1]), np.cos(exact.y[0, -1])))
    errors = []
    for tol in (1e-5, 1e-7, 1e-9):
        results = four_bars(n).run(tmp_path, end, 0.1, tol)
        places = [results[f"bodies/{k + 2}/position"][-1, :2] - (k, 0) for k in range(n + 1)]
        errors.append(np.abs(places - tip).max())
    assert errors[1] < errors[0] / 10
    assert errors[2] < errors[1] / 2
    assert errors[2] < 1e-7


def test_bricard(tmp_path):
    scene = bricard()
    results = scene.run(tmp_path, 10.0, 0.1, 1e-10)
    assert np.abs(passive(results)).max() < 1e-6
    assert residual(results, scene.mechanism())[0] < 1e-9
    # it moves: at the end of the first second by the independent solver
    assert np.ptp(results["bodies/4/position"], axis=0).max() > 0.5


def test_bricard_against_the_independent_solver(tmp_path):
    scene = bricard()
    results = scene.run(tmp_path, 2.0, 0.25, 1e-10)
    solution = scene.mechanism().solve(results["time"], 1e-10, 1e-11)
    for k in (1, 3, 5):
        assert np.abs(results[f"bodies/{k + 1}/position"] - solution.position(k)).max() < 1e-6


@pytest.mark.parametrize(("tol", "digits", "rate_digits"), [(None, 3, 2), (1e-9, 6, 5)])
def test_andrews_squeezer(tol, digits, rate_digits, tmp_path):
    scene, loads = squeezer.scene()
    settings = {} if tol is None else {"tol": tol}
    results = run_deck(tmp_path, scene.xml(), 0.03, 1e-4, **settings)
    found, found_rates = squeezer.correct_digits(results)
    assert found >= digits
    assert found_rates >= rate_digits
    assert residual(results, scene.mechanism(loads))[0] < 1e-9
    # spring and torque; the torque's work is applied work, as friction's is
    if tol is not None:
        assert np.abs(balance(results, False)).max() < 1e-6 * results["energy/kinetic"].max()


# --- every joint between two moving bodies, against the independent solver ---


BENT = SKEW @ rotation((1, 0, 0), 0.5)

PAIRS = {
    "FREE": {"rows": lambda I, J, t: []},
    "FIXED": {},
    "REVOLUTE": {},
    "TRANSLATIONAL": {},
    "CYLINDRICAL": {},
    "SPHERICAL": {"R_i": rotation((0, 1, 1), 0.4)},
    "UNIVERSAL": {"R_i": SIDE},
    "HOOKE": {"R_i": SKEW @ rotation((1, 0, 0), 0.4)},
    "PLANAR": {},
    "INLINE": {"R_i": rotation((0, 1, 1), 0.4)},
    "INPLANE": {"R_i": rotation((0, 1, 1), 0.4)},
    "ORIENTATION": {},
    "PARALLEL_AXES": {},
    "PERPENDICULAR": {"R_i": SIDE},
    "CONSTANT_VELOCITY": {"R_i": BENT},
    "DISTANCE": {"p_j": (0.9, 0.3, 0.2), "rows": mech.distance(np.sqrt(0.3**2 + 0.4**2 + 0.25**2))},
    "SCREW": {"attributes": 'pitch="0.3"', "rows": mech.screw(0.3)},
}


def pair(kind):
    """Return two bodies: the first on a ball joint to ground, the second on the joint to it."""
    first = mech.Body(
        2.0, [[0.3, 0.02, 0.01], [0.02, 0.4, -0.03], [0.01, -0.03, 0.25]], (0.5, 0.1, 0.2),
        rotation((1, 1, 0), 0.3), (0, 0, 0), (0.4, -1.1, 0.7),
    )  # fmt: skip
    second = mech.Body(
        1.0, (0.08, 0.1, 0.05), (1.5, -0.2, -0.3), rotation((0, 1, 2), -0.5),
        (0.3, 0.2, -0.4), (-0.5, 0.9, 1.3),
    )  # fmt: skip
    values = {"p": (1.2, -0.1, -0.05), "R_i": SKEW, "R_j": SKEW} | PAIRS[kind]
    joint = Joint(kind, 2, 1, **values)
    scene = Scene([first, second], [Joint("SPHERICAL", 1, 0), joint])
    return scene.consistent()


@pytest.mark.parametrize("kind", PAIRS)
def test_joint_between_moving_bodies(kind, tmp_path):
    scene = pair(kind)
    # at 0.9 s the shafts of this scene's homokinetic joint fold back
    results = scene.run(tmp_path, 1.0, 0.05, 1e-9)
    solution = scene.mechanism().solve(results["time"], 1e-11, 1e-12)
    for k in (1, 2):
        at = f"bodies/{k + 1}"
        assert np.abs(results[f"{at}/position"] - solution.position(k)).max() < 1e-6
        assert apart(results[f"{at}/quaternion"], solution.quaternion(k)) < 1e-6
        assert np.abs(results[f"{at}/velocity"] - solution.velocity(k)).max() < 1e-5
        assert np.abs(results[f"{at}/acceleration"] - solution.acceleration(k)).max() < 1e-4
    for n in (0, 1):
        load = np.hstack([results[f"joints/{n + 1}/force"], results[f"joints/{n + 1}/torque"]])
        expected = solution.reaction(n)
        assert np.abs(load - expected).max() < 1e-5 * max(1.0, np.abs(expected).max())
    values, rates = residual(results, scene.mechanism())
    assert values < 1e-9
    assert rates < 1e-7
    assert np.abs(passive(results)).max() < 1e-6


@pytest.mark.parametrize(("method", "tol"), [("RADAU5", 1e-9), ("GALPHA", 1e-7)])
def test_implicit_steps_through_shafts_that_fold_back(method, tol, tmp_path):
    scene = pair("CONSTANT_VELOCITY")
    results = scene.run(tmp_path, 1.0, 0.05, tol, integrator=method)
    expected = scene.run(tmp_path, 1.0, 0.05, 1e-10, integrator="DOP853")
    # a thousand local errors
    for k in (2, 3):
        names = (f"bodies/{k}/position", f"bodies/{k}/quaternion")
        assert np.abs(results[names[0]] - expected[names[0]]).max() < 1e3 * tol
        assert apart(results[names[1]], expected[names[1]]) < 1e3 * tol
    values, rates = residual(results, scene.mechanism())
    assert values < 1e-9
    assert rates < 1e-7


# --- closed forms ---


def test_bolt_driven_by_its_weight(tmp_path):
    # m a = m g - T 2 pi / p, T = J a 2 pi / p: a = g / (1 + (J / m) (2 pi / p)^2)
    bolt = mech.Body(2.0, (0.01, 0.01, 0.004), (0, 0, 0))
    scene = Scene([bolt], [Joint("SCREW", 1, 0, attributes='pitch="0.05"', rows=mech.screw(0.05))])
    results = scene.run(tmp_path, 2.0, 0.05)
    turn = 2 * np.pi / 0.05
    a = -9.81 / (1 + 0.004 / 2.0 * turn**2)
    t = results["time"]
    assert np.abs(results["bodies/2/position/z"] - a * t**2 / 2).max() < 1e-8
    assert np.abs(results["bodies/2/angular_velocity/z"] - a * t * turn).max() < 1e-6
    # the thread carries what the motion leaves of the weight, and turns the bolt
    assert np.abs(results["joints/1/force/z"] - 2.0 * (9.81 + a)).max() < 1e-6
    assert np.abs(results["joints/1/torque/z"] - 0.004 * a * turn).max() < 1e-6
    # twelve turns: whole turns count
    assert a * t[-1] ** 2 / 2 / 0.05 < -12


def test_left_handed_thread(tmp_path):
    bolt = mech.Body(2.0, (0.01, 0.01, 0.004), (0, 0, 0))
    scene = Scene(
        [bolt], [Joint("SCREW", 1, 0, attributes='pitch="-0.05"', rows=mech.screw(-0.05))]
    )
    results = scene.run(tmp_path, 1.0, 0.1)
    travel, w = results["bodies/2/velocity/z"], results["bodies/2/angular_velocity/z"]
    np.testing.assert_allclose(travel, -0.05 / (2 * np.pi) * w, rtol=0, atol=1e-9)


def test_rack_and_pinion(tmp_path):
    # the rack (3 kg) falls along z; pinion J = 0.02 about x, radius 0.1: a = m g / (m + J / r^2)
    pinion = mech.Body(1.0, (0.02, 0.02, 0.02), (0, 0, 0))
    rack = mech.Body(3.0, (0.05, 0.05, 0.05), (0, 0.1, 0))
    joints = [
        Joint("REVOLUTE", 1, 0, R_i=X_UP),
        Joint("TRANSLATIONAL", 2, 0, (0, 0.1, 0)),
        Joint("RACK_PINION", 1, 2, R_i=X_UP, R_j=EYE, attributes='pitch_diameter="0.2"'),
    ]
    results = Scene([pinion, rack], joints).run(tmp_path, 1.0, 0.05)
    a = -3.0 * 9.81 / (3.0 + 0.02 / 0.1**2)
    t = results["time"]
    assert np.abs(results["bodies/3/position/z"] - a * t**2 / 2).max() < 1e-8
    # turning about I's z moves I along J's z: here J moves, so the signs differ
    w = results["bodies/2/angular_velocity/x"]
    np.testing.assert_allclose(w, -a * t / 0.1, rtol=0, atol=1e-6)
    # of the rack's weight, what does not accelerate it goes through the teeth
    force = results["joints/3/force/z"]
    np.testing.assert_allclose(force, -3.0 * (9.81 + a), rtol=0, atol=1e-5)


def test_gear_pair(tmp_path):
    # a weight-like torque on gear 1 (0.5 N m), gear 2 turns at -r1/r2 = -1/3: J_eq = J1 + J2 / 9
    one = mech.Body(1.0, (0.02,) * 3, (0, 0, 0))
    two = mech.Body(1.0, (0.09,) * 3, (1, 0, 0))
    extra = (
        '<Constraint_Coupler id="1" joint_ids="1 2" motion_types="R R" scales="1 3"/>'
        '<Force_Scalar_TwoBody id="1" type="ROTATIONAL" i_marker_id="1000" j_marker_id="1001"'
        ' expr="0.5"/>'
    )
    joints = [Joint("REVOLUTE", 1, 0), Joint("REVOLUTE", 2, 0, (1, 0, 0))]
    results = Scene([one, two], joints, (0, 0, 0), extra).run(tmp_path, 2.0, 0.1)
    a = 0.5 / (0.02 + 0.09 / 9)
    t = results["time"]
    assert np.abs(results["bodies/2/angular_velocity/z"] - a * t).max() < 1e-6
    assert np.abs(results["bodies/3/angular_velocity/z"] + a * t / 3).max() < 1e-6
    # angle at the end: 33.3 rad, five turns
    q = results["bodies/2/quaternion"][-1]
    angle = 2 * np.arctan2(q[3], q[0])
    assert np.cos(angle - a * 2.0**2 / 2) == pytest.approx(1.0, abs=1e-10)


def test_coupler_of_a_winch(tmp_path):
    # drum J = 0.04, radius 0.2 (scale), lifts by rotation what slides: 2 kg on a rail
    drum = mech.Body(1.0, (0.04,) * 3, (0, 0, 0))
    load = mech.Body(2.0, (0.01,) * 3, (1, 0, 0))
    extra = '<Constraint_Coupler id="1" joint_ids="1 2" motion_types="R T" scales="0.2 -1"/>'
    joints = [Joint("CYLINDRICAL", 1, 0, R_i=X_UP), Joint("TRANSLATIONAL", 2, 0, (1, 0, 0))]
    results = Scene([drum, load], joints, extra=extra).run(tmp_path, 1.0, 0.05)
    a = -2.0 * 9.81 / (2.0 + 0.04 / 0.2**2)
    t = results["time"]
    assert np.abs(results["bodies/3/velocity/z"] - a * t).max() < 1e-7
    assert np.abs(results["bodies/2/angular_velocity/x"] - a * t / 0.2).max() < 1e-6


def shafts(kind, bend):
    """Return two shafts that meet at the origin, the second bent about x; the first is driven."""
    second = rotation((1, 0, 0), bend)
    axis = second[:, 2]
    one = mech.Body(1.0, (0.02,) * 3, (0, 0, -1.0), w=(0, 0, 3.0))
    two = mech.Body(1.0, (0.02,) * 3, axis, second)
    joints = [
        Joint("REVOLUTE", 1, 0, (0, 0, -1)),
        Joint("CYLINDRICAL", 2, 0, axis, second),
        Joint(kind, 2, 1, (0, 0, 0), second, EYE),
    ]
    extra = (
        '<Motion_Joint id="1" joint_id="1" motion_type="R" val_type="D" type="EXPRESSION"'
        ' expr="3*TIME"/>'
    )
    return Scene([one, two], joints, (0, 0, 0), extra), axis


@pytest.mark.parametrize("kind", ["CONSTANT_VELOCITY", "HOOKE"])
def test_speed_through_a_bend(kind, tmp_path):
    bend = 0.6
    scene, axis = shafts(kind, bend)
    # the other shaft's speed follows; its start too
    w0 = 3.0 if kind == "CONSTANT_VELOCITY" else 3.0 * hooke_ratio(0.0, bend)
    scene.bodies[1].w = w0 * axis
    results = scene.run(tmp_path, 3.0, 0.05)
    w = results["bodies/3/angular_velocity"] @ axis
    if kind == "CONSTANT_VELOCITY":
        ratio = np.ones(len(w))
    else:
        ratio = hooke_ratio(3.0 * results["time"], bend)
    np.testing.assert_allclose(w, 3.0 * ratio, rtol=0, atol=1e-6)


@pytest.mark.parametrize("turned", [0.0, 0.4, 3.0])
@pytest.mark.parametrize("method", ["DOPRI5", "DOP853", "RADAU5", "AUTO", "GALPHA"])
def test_shafts_that_fold_back_onto_each_other(method, turned, tmp_path):
    """A ball on a homokinetic joint goes round a great circle of quaternions without twist.

    Its kinetic energy is a multiple of |q'|^2: at angular speed w it goes round the sphere
    (w, x, y), z = 0, at w/2, also where the shafts are folded back on the way.
    """
    bend, speed, skew = 0.5, 3.0, 0.7
    q0 = np.array([np.cos(bend / 2), np.sin(bend / 2), 0.0, 0.0])
    along = np.array([-np.sin(bend / 2), np.cos(bend / 2), 0.0, 0.0]) * np.cos(skew)
    along[2] = np.sin(skew)
    back = q0 * (1, -1, -1, -1)
    spin = speed * product(along, back)[1:]
    ball = mech.Body(1.0, (0.02,) * 3, (0, 0, 0), w=spin)
    # how the markers are turned about their z at first does not matter
    axes = rotation((1, 0, 0), bend) @ rotation((0, 0, 1), turned)
    joint = Joint("CONSTANT_VELOCITY", 1, 0, R_i=axes, R_j=EYE)
    results = Scene([ball], [joint], g=(0, 0, 0)).run(tmp_path, 5.0, 0.05, integrator=method)
    half = 0.5 * speed * results["time"][:, None]
    path = np.cos(half) * q0 + np.sin(half) * along
    assert path[:, 0].min() < -0.9  # the shafts were folded back, and opened again
    expected = np.array([product(q, back) for q in path])
    # a thousand local errors of 1e-9
    assert apart(results["bodies/2/quaternion"], expected) < 1e-6


def product(p, q):
    """Return the product of two quaternions, w first."""
    vector = p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:])
    return np.array([p[0] * q[0] - p[1:] @ q[1:], *vector])


def hooke_ratio(turn, bend):
    """Return the ratio of speeds of a cross: cos b / (1 - sin^2 b cos^2 a).

    a counts from where the driver's arm, J's y, stands at right angles to the bend's axis x.
    With arms u = (-sin a, cos a, 0) on the driver and v on the driven shaft, v . u = 0:
    tan(a_out) = tan(a) cos(b), or tan(a) / cos(b) with the arm along the axis at a = 0.
    """
    s, c = np.sin(turn), np.cos(turn)
    # I's x = (cos o, sin o cos b, sin o sin b); J's y = (-sin a, cos a, 0): tan o = tan a / cos b
    return np.cos(bend) / (np.cos(bend) ** 2 * c**2 + s**2)


@pytest.mark.parametrize(
    ("val_type", "expr", "extra"),
    [
        ("D", "0.2*TIME + 0.5*TIME*TIME", ""),
        ("V", "0.2 + TIME", ""),
        ("A", "1", 'ic_vel="0.2"'),
    ],
)
def test_driven_arm(val_type, expr, extra, tmp_path):
    # a bar 0.8 kg, centre 0.5 m from the pivot, turned about y by 0.2 t + t^2/2
    w0 = 0.2
    bar = mech.Body(0.8, (0.01, 0.07, 0.07), (0.5, 0, 0), v=(0, 0, -0.5 * w0), w=(0, w0, 0))
    motion = (
        f'<Motion_Joint id="5" joint_id="1" motion_type="R" val_type="{val_type}" '
        f'type="EXPRESSION" expr="{expr}" {extra}/>'
    )
    scene = Scene([bar], [Joint("REVOLUTE", 1, 0, R_i=Y_UP)], extra=motion)
    results = scene.run(tmp_path, 2.0, 0.05)
    t = results["time"]
    # Y_UP has z along -y or y: take the turn's sense from the axis itself
    sense = Y_UP[1, 2]
    angle = sense * (0.2 * t + 0.5 * t**2) if sense > 0 else None
    assert angle is not None
    p = results["bodies/2/position"]
    expected = np.column_stack([0.5 * np.cos(angle), 0 * t, -0.5 * np.sin(angle)])
    assert np.abs(p - expected).max() < 1e-7
    # torque about y: J a - m g (d cos angle), with J about the pivot
    inertia = 0.07 + 0.8 * 0.5**2
    torque = inertia * 1.0 - 0.8 * 9.81 * 0.5 * np.cos(angle)
    assert np.abs(results["motions/5/torque/y"] - torque).max() < 1e-5
    w = 0.2 + t
    work = 0.5 * inertia * (w**2 - w0**2) - 0.8 * 9.81 * 0.5 * np.sin(angle)
    assert np.abs(results["energy/work_of_motions"] - work).max() < 1e-6
    assert np.abs(balance(results)).max() < 1e-6


def test_double_pendulum_against_lagrange(tmp_path):
    # two slender rods in the xz-plane, in angles from the horizontal downwards, by scipy
    length, m = 0.7, 1.3
    J = m * length**2 / 12
    rods = [mech.Body(m, (J / 50, J, J), (length * (k + 0.5), 0, 0)) for k in range(2)]
    joints = [
        Joint("REVOLUTE", 1, 0, R_i=Y_UP),
        Joint("REVOLUTE", 2, 1, (length, 0, 0), Y_UP),
    ]
    results = Scene(rods, joints).run(tmp_path, 3.0, 0.01, 1e-10)

    def rhs(t, y):
        a, b, u, v = y
        A = np.array(
            [
                [J + 1.25 * m * length**2, 0.5 * m * length**2 * np.cos(a - b)],
                [0.5 * m * length**2 * np.cos(a - b), J + 0.25 * m * length**2],
            ]
        )
        gyro = 0.5 * m * length**2 * np.sin(a - b)
        right = [
            1.5 * m * 9.81 * length * np.cos(a) - gyro * v**2,
            0.5 * m * 9.81 * length * np.cos(b) + gyro * u**2,
        ]
        return [u, v, *np.linalg.solve(A, right)]

    exact = solve_ivp(
        rhs, (0, 3), np.zeros(4), method="DOP853", t_eval=results["time"], rtol=1e-12, atol=1e-13
    ).y
    tip = 0.5 * length * np.array([np.cos(exact[1]), -np.sin(exact[1])])
    elbow = length * np.array([np.cos(exact[0]), -np.sin(exact[0])])
    p = results["bodies/3/position"][:, [0, 2]]
    assert np.abs(p - (elbow + tip).T).max() < 1e-6
    assert np.abs(passive(results)).max() < 1e-7


def test_ball_joint_of_a_body_on_a_fixed_stand_in_millimetres(tmp_path):
    # the same pendulum in mm: the same motion; force in N
    model = pendulum("SPHERICAL").xml().replace('pos_x="-1.0"', 'pos_x="-1000.0"')
    model = model.replace('grav_y="-9.81"', 'grav_y="-9810.0"').replace("1e-09", "0.001")
    unit = (
        '<Param_Unit force_unit="NEWTON" mass_unit="KILOGRAM" length_unit="MILLIMETER"'
        ' time_unit="SECOND"/>'
    )
    results = run_deck(tmp_path, unit + model, 10.0, 0.1, tol=1e-9)
    p = results["bodies/2/position"][-1, :2] / 1000
    np.testing.assert_allclose(p, (-0.2750874626, -0.9614192051), rtol=0, atol=1e-5)
    assert results["joints/1/force"][-1, :2] == pytest.approx(-3 * 9.81 * p[1] * -p, rel=1e-4)


def test_redundant_holds_share_the_load(tmp_path):
    # a door on two hinges: 2 x 5 equations, 5 of them needed; forces of least norm are equal
    panel = mech.Body(20.0, (1.0, 1.5, 0.6), (0.4, 0, 0))
    joints = [Joint("REVOLUTE", 1, 0, (0, 0, z)) for z in (-0.5, 0.5)]
    scene = Scene([panel], joints)
    results = scene.run(tmp_path, 0.5, 0.05)
    lower, upper = results["joints/1/force"], results["joints/2/force"]
    np.testing.assert_allclose((lower + upper)[:, 2], 20.0 * 9.81, rtol=1e-8)
    np.testing.assert_allclose(lower[:, 2], upper[:, 2], rtol=1e-8)
    # moments about the middle: weight at 0.4 m; torques of the hinges count too
    total = results["joints/1/torque"] + results["joints/2/torque"]
    total = total + np.cross((0, 0, -0.5), lower) + np.cross((0, 0, 0.5), upper)
    np.testing.assert_allclose(total[:, 1], -20.0 * 9.81 * 0.4, rtol=1e-8)
    assert np.abs(results["bodies/2/position"] - (0.4, 0, 0)).max() < 1e-9


def test_rows_of_a_run_are_states_of_the_mechanism(tmp_path):
    # the order of `states` is that of the independent solver: its start is the run's first row
    scene = pair("REVOLUTE")
    results = scene.run(tmp_path, 0.1, 0.05)
    y = states(results, 2)[0]
    start = scene.mechanism().y0()
    for k in (3, 16):
        y[k : k + 4] *= np.sign(y[k : k + 4] @ start[k : k + 4])
    np.testing.assert_allclose(y, start, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("val_type", "expr", "extra", "w0"),
    [("V", "0.7", 'ic_disp="0.4"', 0.7), ("A", "0", 'ic_disp="0.4" ic_vel="0.3"', 0.3)],
)
def test_a_motion_starts_where_it_says(val_type, expr, extra, w0, tmp_path):
    # the bar lies along x at rest; assembly turns it by 0.4 and gives it the speed
    bar = mech.Body(0.8, (0.01, 0.07, 0.07), (0.5, 0, 0))
    motion = (
        f'<Motion_Joint id="5" joint_id="1" motion_type="R" val_type="{val_type}" '
        f'type="EXPRESSION" expr="{expr}" {extra}/>'
    )
    results = Scene([bar], [Joint("REVOLUTE", 1, 0)], extra=motion).run(tmp_path, 1.0, 0.1)
    angle = 0.4 + w0 * results["time"]
    expected = 0.5 * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    assert np.abs(results["bodies/2/position"] - expected).max() < 1e-8

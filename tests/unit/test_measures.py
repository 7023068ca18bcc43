"""Measures of markers against plain formulas on random states, their jets against differences."""

from __future__ import annotations

import numpy as np
import pytest

from helpers import free_bodies as free
from helpers.free_bodies import rotation
from mbsim.compile_model.build import build
from mbsim.dynamics.bodies.angles import commit_angles, longest_turn
from mbsim.dynamics.bodies.kinematics import place_bodies
from mbsim.dynamics.expressions.jets import gradient, jet, value
from mbsim.expressions.parse import parse
from mbsim.model.elements import Marker, Request, ScalarForce


def random_rotation(rng):
    """Return some rotation matrix."""
    return rotation(rng.normal(size=3), rng.uniform(0.3, 2.8))


def quaternion(R):
    """Return the unit quaternion of a rotation matrix whose angle is not near pi."""
    w = 0.5 * np.sqrt(1 + np.trace(R))
    return np.array([w, *(np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]))]) / (
        np.array([1, 4 * w, 4 * w, 4 * w])
    )


class Moving:
    """Two bodies that move on without acceleration, a marker on each, and expressions of them.

    Markers 21 on body 2 and 31 on body 3 are off the cg and turned; 11 is on ground.
    """

    def __init__(self, *texts, seed=1, **elements):
        rng = np.random.default_rng(seed)
        markers = [
            Marker(10 * b + 1, body_id=b, pos=tuple(rng.normal(size=3)), R=random_rotation(rng))
            for b in (1, 2, 3)
        ]
        bodies = [free.body(b, p=rng.normal(size=3)) for b in (2, 3)]
        exprs = tuple(parse(text) for text in texts)
        model = free.model(
            *bodies,
            markers=markers,
            requests=[Request(1, "EXPRESSION", exprs=exprs)],
            **elements,
        )
        system = build(model)
        self.scene, self.y0 = system.scene, system.y0
        self.p = rng.normal(size=(2, 3))
        self.v = rng.normal(size=(2, 3))
        self.w = rng.normal(size=(2, 3))
        self.R = [random_rotation(rng) for _ in range(2)]
        self.frames = system.placement.markers
        self.program = len(self.scene.programs.start) - 1 - len(texts)

    def at(self, t, twists=None):
        """Place the bodies where they are at time t, moved by `twists` (2, 6) instead of v, w."""
        y = self.y0.copy()
        moved = np.hstack([self.v, self.w]) if twists is None else twists
        for b in range(2):
            w = moved[b, 3:]
            turn = rotation(w, t * np.linalg.norm(w)) if w.any() else np.eye(3)
            R = turn @ self.R[b]
            y[13 * b : 13 * b + 3] = self.p[b] + t * moved[b, :3]
            y[13 * b + 3 : 13 * b + 7] = quaternion(R)
            y[13 * b + 7 : 13 * b + 10] = moved[b, :3]
            y[13 * b + 10 : 13 * b + 13] = R.T @ w
        place_bodies(self.scene, y)
        return y

    def followed(self):
        """Return this with the angles of time 0 committed, so that none jumps nearby."""
        self.at(0.0)
        commit_angles(self.scene)
        return self

    def value(self, t=0.0, k=0, twists=None):
        """Return expression k at time t."""
        return value(self.scene, t, self.at(t, twists), self.program + k)

    def marker(self, id):
        """Return origin, axes, velocity and angular velocity of a marker at time 0."""
        frame = self.frames[id]
        if frame.body_id == 1:
            return frame.p_B, frame.R_B, np.zeros(3), np.zeros(3)
        b = frame.body_id - 2
        arm = self.R[b] @ frame.p_B
        v = self.v[b] + np.cross(self.w[b], arm)
        return self.p[b] + arm, self.R[b] @ frame.R_B, v, self.w[b]


def differences(f, h=0.008):
    """Return value, first and second derivative at 0 by central differences of order 8."""
    first = [(1, 4 / 5), (2, -1 / 5), (3, 4 / 105), (4, -1 / 280)]
    second = [(1, 8 / 5), (2, -1 / 5), (3, 8 / 315), (4, -1 / 560)]
    d1 = sum(c * (f(k * h) - f(-k * h)) for k, c in first) / h
    d2 = sum(c * (f(k * h) + f(-k * h)) for k, c in second)
    return f(0.0), d1, (d2 - 205 / 72 * f(0.0)) / h**2


DISPLACEMENTS = [
    *("DM(21,31)", "DM(21)", "DX(21,31,11)", "DY(21,31,21)", "DZ(21,31,31)", "DX(21)", "DZ(21,31)"),
    *("AX(21,31)", "AY(21,31)", "AZ(21,31)", "AZ(31)", "AX(11,21)"),
    *("PSI(21,31)", "THETA(21,31)", "PHI(21,31)", "YAW(21,31)", "PITCH(21,31)", "ROLL(21,31)"),
    *(f"ORIENT(27,{n},21,31)" for n in (1, 2, 3, 4)),
    *("INCANG(21,31,11)", "INCANG(11,21,31)", "INCANG(21,11,31)"),
    "DX(21,31,11)*SIN(AZ(21,31)) + TIME**2*DM(21,31)",
]


@pytest.mark.parametrize("text", DISPLACEMENTS)
@pytest.mark.parametrize("seed", [7, 12, 13])  # away from cuts of angles
def test_jets_of_displacements_are_their_derivatives(text, seed):
    moving = Moving(text, seed=seed).followed()
    wanted = differences(lambda t: moving.value(t))
    found = jet(moving.scene, 0.0, moving.at(0.0), 0)
    assert found[0] == wanted[0]
    scale = 1.0 + max(map(abs, wanted))
    assert found[1] == pytest.approx(wanted[1], abs=1e-7 * scale)
    assert found[2] == pytest.approx(wanted[2], abs=1e-6 * scale)


@pytest.mark.parametrize("text", DISPLACEMENTS)
def test_gradients_are_derivatives_along_twists(text):
    moving = Moving(text, seed=13).followed()
    for b in range(2):
        out = np.zeros(6)
        # velocities of the state are of no account, nor is TIME's rate
        gradient(moving.scene, 0.3, moving.at(0.0), 0, b, out)
        for way in range(6):
            twists = np.zeros((2, 6))
            twists[b, way] = 1.0

            def along(t, twists=twists):
                return value(moving.scene, 0.3, moving.at(t, twists), 0)

            assert out[way] == pytest.approx(differences(along)[1], abs=1e-7)


def test_rate_is_gradient_times_velocity():
    moving = Moving("DM(21,31)*AZ(21,31)")
    y = moving.at(0.0)
    rate = jet(moving.scene, 0.0, y, 0)[1]
    total = 0.0
    for b in range(2):
        out = np.zeros(6)
        gradient(moving.scene, 0.0, y, 0, b, out)
        total += out @ np.hstack([moving.v[b], moving.w[b]])
    assert rate == pytest.approx(total, rel=1e-13)


def measured(text, seed=1):
    """Return an expression's value at time 0 and the moving bodies."""
    moving = Moving(text, seed=seed)
    return moving.value(), moving


def test_distances_and_offsets():
    for text, axis in [("DX(21,31,11)", 0), ("DY(21,31,11)", 1), ("DZ(21,31,11)", 2)]:
        found, moving = measured(text)
        r = moving.marker(21)[0] - moving.marker(31)[0]
        assert found == pytest.approx(r @ moving.marker(11)[1][:, axis], rel=1e-12)
    found, moving = measured("DM(21,31)")
    r = moving.marker(21)[0] - moving.marker(31)[0]
    assert found == pytest.approx(np.linalg.norm(r), rel=1e-13)
    # what is left out is the global frame
    found, moving = measured("DY(21)")
    assert found == pytest.approx(moving.marker(21)[0][1], rel=1e-13)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_an_angle_about_one_axis_is_that_of_the_turn(axis):
    moving = Moving("AX(21,31)", "AY(21,31)", "AZ(21,31)", seed=2)
    R_J = moving.marker(31)[1]
    turned = R_J @ rotation(np.eye(3)[axis], 0.7)
    moving.R[0] = turned @ moving.frames[21].R_B.T
    found = [moving.value(0.0, k) for k in range(3)]
    wanted = np.zeros(3)
    wanted[axis] = 0.7
    assert found == pytest.approx(wanted, abs=1e-12)


def test_whole_turns_are_counted_and_steps_short_enough_for_it():
    moving = Moving("AZ(21,31)", seed=2)
    moving.w[1] = moving.v[1] = 0.0
    z = moving.marker(31)[1][:, 2]
    moving.w[0] = 3.0 * z
    moving.R[0] = moving.marker(31)[1] @ moving.frames[21].R_B.T
    start = moving.R[0].copy()
    for k in range(30):
        moving.R[0] = rotation(z, 0.6 * k) @ start
        assert moving.value() == pytest.approx(0.6 * k, abs=1e-12)
        commit_angles(moving.scene)
    assert longest_turn(moving.scene, 0.1) == 0.1
    assert longest_turn(moving.scene, 10.0) == pytest.approx(2.0 / 3.0)


def test_euler_angles_rebuild_the_rotation():
    names = ("PSI", "THETA", "PHI", "YAW", "PITCH", "ROLL")
    for seed in range(1, 6):
        moving = Moving(*(f"{name}(21,31)" for name in names), seed=seed)
        psi, theta, phi, yaw, pitch, roll = (moving.value(0.0, k) for k in range(6))
        x, y, z = np.eye(3)
        M = moving.marker(31)[1].T @ moving.marker(21)[1]
        np.testing.assert_allclose(
            rotation(z, psi) @ rotation(x, theta) @ rotation(z, phi), M, atol=1e-13
        )
        np.testing.assert_allclose(
            rotation(z, yaw) @ rotation(y, pitch) @ rotation(x, roll), M, atol=1e-13
        )


@pytest.mark.parametrize("angle", [0.0, 0.4, -2.0])
def test_euler_angles_where_two_of_them_are_one(angle):
    moving = Moving("PSI(21,31)", "THETA(21,31)", "PHI(21,31)", seed=3)
    moving.R[0] = moving.marker(31)[1] @ rotation((0, 0, 1), angle) @ moving.frames[21].R_B.T
    assert [moving.value(0.0, k) for k in range(3)] == pytest.approx([angle, 0, 0], abs=1e-12)
    for k in range(3):
        assert np.isfinite(jet(moving.scene, 0.0, moving.at(0.0), k)).all()


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 2, -3)])
@pytest.mark.parametrize("angle", [0.0, 0.3, 1.9, 3.0, -2.5])
def test_euler_parameters_are_those_of_the_turn(axis, angle):
    moving = Moving(*(f"ORIENT(27,{n},21,31)" for n in (1, 2, 3, 4)), seed=2)
    moving.R[0] = moving.marker(31)[1] @ rotation(axis, angle) @ moving.frames[21].R_B.T
    n = np.array(axis) / np.linalg.norm(axis)
    e = np.array([np.cos(angle / 2), *(np.sin(angle / 2) * n)])
    assert [moving.value(0.0, k) for k in range(4)] == pytest.approx(e, abs=1e-12)


def test_velocities():
    found, moving = measured("VX(21,31,11)")
    (P, _, v_i, w_i), (Q, _, v_j, w_j) = moving.marker(21), moving.marker(31)
    R_k = moving.marker(11)[1]
    assert found == pytest.approx((v_i - v_j) @ R_k[:, 0], rel=1e-12)
    assert measured("VY(21)")[0] == pytest.approx(v_i[1], rel=1e-12)
    assert measured("VM(21,31)")[0] == pytest.approx(np.linalg.norm(v_i - v_j), rel=1e-12)
    # seen from body 3, whose turning is not motion
    seen = v_i - v_j - np.cross(w_j, P - Q)
    assert measured("VZ(21,31,11,31)")[0] == pytest.approx(seen @ R_k[:, 2], rel=1e-12)
    assert measured("VM(21,31,31)")[0] == pytest.approx(np.linalg.norm(seen), rel=1e-12)
    assert measured("WY(21,31,11)")[0] == pytest.approx((w_i - w_j) @ R_k[:, 1], rel=1e-12)
    assert measured("WM(21)")[0] == pytest.approx(np.linalg.norm(w_i), rel=1e-12)


def test_included_angle():
    for text in ("INCANG(21,31,11)", "INCANG(31,11,21)"):
        found, moving = measured(text, seed=4)
        i, j, k = (moving.marker(int(id))[0] for id in text[7:-1].split(","))
        a, b = i - j, k - j
        cosine = a @ b / np.linalg.norm(a) / np.linalg.norm(b)
        assert found == pytest.approx(np.arccos(cosine), rel=1e-12)


@pytest.mark.parametrize("observer", [0, 11, 21, 31])
def test_accelerations_are_rates_of_velocities_resolved_in_the_observer(observer):
    """The derivative taken in l is that of the components along axes that l carries."""
    names = ("VX", "VY", "VZ", "WX", "WY", "WZ")
    velocities = [
        f"{name}(21,31,{observer}" + (f",{observer})" if name[0] == "V" else ")") for name in names
    ]
    accelerations = [
        f"{new}(21,31,{observer},{observer})"
        for new in ("ACCX", "ACCY", "ACCZ", "WDTX", "WDTY", "WDTZ")
    ]
    sizes = [f"ACCM(21,31,{observer})", f"WDTM(21,31,{observer})"]
    moving = Moving(*velocities, *accelerations, *sizes, seed=5)
    # bodies of `Moving` do not accelerate, so that their own accelerations are zero
    moving.at(0.0)
    wanted = [differences(lambda t, k=k: moving.value(t, k))[1] for k in range(6)]
    found = [moving.value(0.0, k) for k in range(6, 14)]
    assert found[:6] == pytest.approx(wanted, abs=1e-8)
    assert found[6] == pytest.approx(np.linalg.norm(wanted[:3]), rel=1e-8)
    assert found[7] == pytest.approx(np.linalg.norm(wanted[3:]), abs=1e-8)


def test_accelerations_of_bodies_count_with_their_arms():
    texts = ["ACCX(21,31,11)", "ACCX(21,0,0,31)", "WDTY(21,31,11)", "ACCM(21,11)"]
    moving = Moving(*texts, seed=5)
    rng = np.random.default_rng(3)
    given = rng.normal(size=12)
    moving.scene.rows.accel[0] = given
    (P, _, v, _), (_, _, _, w_3) = moving.marker(21), moving.marker(31)
    R_k = moving.marker(11)[1]
    a = {}
    for k, id in enumerate((21, 31)):
        arm = moving.R[k] @ moving.frames[id].p_B
        spin = np.cross(moving.w[k], np.cross(moving.w[k], arm))
        a[id] = given[6 * k : 6 * k + 3] + np.cross(given[6 * k + 3 : 6 * k + 6], arm) + spin
    alpha, alpha_3 = given[3:6], given[9:12]
    seen = a[21] - np.cross(alpha_3, P) - 2 * np.cross(w_3, v) + np.cross(w_3, np.cross(w_3, P))
    wanted = [
        (a[21] - a[31]) @ R_k[:, 0],
        seen[0],
        (alpha - alpha_3) @ R_k[:, 1],
        np.linalg.norm(a[21]),
    ]
    assert [moving.value(0.0, k) for k in range(4)] == pytest.approx(wanted, rel=1e-12)


@pytest.mark.parametrize(
    ("rate", "displacement"),
    [("VR(21,31)", "DM(21,31)"), ("VX(21,31,31,31)", "DX(21,31,31)"), ("VZ(31,0,0)", "DZ(31)")],
)
def test_velocities_are_rates_of_displacements(rate, displacement):
    moving = Moving(rate, displacement)
    wanted = jet(moving.scene, 0.0, moving.at(0.0), 1)[1]
    assert moving.value() == pytest.approx(wanted, rel=1e-12)


@pytest.mark.parametrize("text", ["DM(21,22)", "VR(21,22)", "PSI(21,21)", "AZ(21,21)"])
def test_coincident_markers_give_numbers(text):
    twin = Moving(text.replace("22", "21"), seed=1)
    assert np.isfinite(jet(twin.scene, 0.0, twin.at(0.0), 0)).all()
    assert abs(twin.value()) < 1e-15


def test_forces_between_markers_and_of_elements():
    texts = []
    for element in ("SFORCE(1,{},{},11)", "SPDP(2,{},{},11)"):
        texts += [element.format(side, comp) for side in (0, 1) for comp in range(1, 9)]
    texts += [f"{name}(21,31,11)" for name in ("FM", "FX", "FY", "FZ", "TM", "TX", "TY", "TZ")]
    texts += [f"{name}(31,21,11)" for name in ("FM", "FX", "FY", "FZ", "TM", "TX", "TY", "TZ")]
    texts += ["FX(21)", "FX(21,21)", "SFORCE(3,1,2)"]
    moving = Moving(
        *texts,
        scalar_forces=[
            ScalarForce(1, "TRANSLATIONAL", parse("2"), i_marker_id=21, j_marker_id=31),
            ScalarForce(3, "TRANSLATIONAL", parse("5"), "", 21, 11, action_only=True),
        ],
        marker_forces=[free.spring_damper(2, "ROTATIONAL", 31, 21)],
    )
    rng = np.random.default_rng(8)
    moving.at(0.0)
    moving.scene.work.applied[:] = rng.normal(size=moving.scene.work.applied.shape)
    R_k = moving.marker(11)[1]
    arm = moving.marker(21)[0] - moving.marker(31)[0]
    spring, line, alone = moving.scene.work.applied[:, :6]

    def shown(force, torque):
        F, T = R_k.T @ force, R_k.T @ torque
        return [np.linalg.norm(F), *F, np.linalg.norm(T), *T]

    def other(wrench, arm):
        return -wrench[:3], -wrench[3:] - np.cross(arm, wrench[:3])

    on_3 = other(line, arm)
    on_2 = other(spring, -arm)
    wanted = [
        *(*shown(line[:3], line[3:]), *shown(*on_3)),
        *(*shown(spring[:3], spring[3:]), *shown(*on_2)),
        *shown(line[:3] + on_2[0], line[3:] + on_2[1]),
        *shown(spring[:3] + on_3[0], spring[3:] + on_3[1]),
        *(alone[0], alone[0], 0.0),
    ]
    found = [moving.value(0.0, k) for k in range(len(texts))]
    np.testing.assert_allclose(found, wanted, rtol=1e-12, atol=1e-12)

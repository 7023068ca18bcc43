"""MOREAU where joints hold directions in which contacts push or rub: rails, planes, arms.

An impulse along such a direction moves nothing, so that rounding alone decided how much of it
there was: friction turned into it, or was on its cone though bodies stuck.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

import mbsim
from mbsim.bench import deck as text
from mbsim.bench.parameters import GRAVITY

EVEN = np.eye(3)
#: A turn by 2.2 rad about (1, 2, 3): no axis of a scene is one of the global frame.
AXIS = np.array([1.0, 2.0, 3.0]) / math.sqrt(14.0)
CROSS = np.array([[0.0, -AXIS[2], AXIS[1]], [AXIS[2], 0.0, -AXIS[0]], [-AXIS[1], AXIS[0], 0.0]])
ASLANT = EVEN + math.sin(2.2) * CROSS + (1.0 - math.cos(2.2)) * CROSS @ CROSS
TURNS = {"even": EVEN, "aslant": ASLANT}
#: Axes of a marker whose z is the global x, y or -x.
ALONG_X = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
ALONG_Y = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
AGAINST_X = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])


class Scene:
    """A deck that is written turned as a whole, and whose results are turned back."""

    def __init__(self, turn: np.ndarray) -> None:
        self.turn, self.parts, self.count = turn, [text.GROUND], 1000

    def body(self, number, mass, inertia, place, velocity=(0.0, 0.0, 0.0), spin=(0.0, 0.0, 0.0)):
        at, v, w = (self.turn @ np.array(x, float) for x in (place, velocity, spin))
        self.parts.append(text.body(number, mass, inertia, at, v, w, self.turn.tolist()))

    def marker(self, body, place, axes=EVEN) -> int:
        self.count += 1
        at = self.turn @ np.array(place, float)
        self.parts.append(text.marker(self.count, body, at, (self.turn @ axes).tolist()))
        return self.count

    def shape(self, number, kind, body, place, axes=EVEN, **sizes):
        where = "rm_id" if kind == "Plane" else "center_marker_id"
        sizes = {where: self.marker(body, place, axes), **sizes}
        self.parts.append(f"<Post_Graphic {text.attributes(id=number, type=kind, **sizes)}/>")

    def joint(self, number, kind, i, j, place, axes=EVEN):
        ends = self.marker(i, place, axes), self.marker(j, place, axes)
        self.parts.append(text.joint(number, kind, *ends))

    def motion(self, number, kind, rate):
        given = text.attributes(
            id=number, joint_id=number, motion_type=kind, val_type="V", expr=rate
        )
        self.parts.append(f"<Motion_Joint {given}/>")

    def run(self, mu, e=0.0, end=0.3, h=1e-3, pull=(0.0, 0.0, -GRAVITY), tol=1e-6):
        law = {"cnf_type": "POISSON", "penalty": 1e6, "restitution_coef": e}
        x, y, z = (float(c) for c in self.turn @ np.array(pull))
        gravity = text.attributes(grav_x=x, grav_y=y, grav_z=z)
        parts = [
            *self.parts,
            text.contact(301, [200], [100], **law, **text.coulomb(mu, 1e-3)),
            f"<Force_Gravity {gravity}/>",
            *text.fixed_step({} if h is None else {"h": h}),
        ]
        results = mbsim.simulate(text.deck("rails", parts, end), integrator="MOREAU", tol=tol)
        assert results.audit.warnings == ()
        return results

    def back(self, vectors):
        return np.asarray(vectors) @ self.turn


@pytest.fixture(params=list(TURNS), name="scene")
def one_scene(request) -> Scene:
    return Scene(TURNS[request.param])


def rebound(e: float, mu: float) -> tuple[np.ndarray, float]:
    """Return the velocity and spin of `thrown` behind its impact: Newton's e, Coulomb's mu."""
    mass, inertia, v, w = 0.5, 5.0e-4, np.array([1.0, 0.3]), 2.0
    low, high = 0.0, 1.0
    for _ in range(100):
        t = 0.5 * (low + high)
        c, s = math.cos(w * t), math.sin(w * t)
        arm = np.array([0.05 * c + 0.03 * s, 0.05 * s - 0.03 * c])
        low, high = (t, high) if t + arm[0] + 0.01 < 0.2 else (low, t)
    arm += [0.01, 0.0]
    J = np.array([[-1.0, 0.0, arm[1]], [0.0, 1.0, arm[0]]])
    inverse = np.diag([1.0 / mass, 1.0 / mass, 1.0 / inertia])
    W, u = J @ inverse @ J.T, J @ [*v, w]
    r = np.linalg.solve(W, [-(1.0 + e) * u[0], -u[1]])
    if abs(r[1]) > mu * r[0]:
        sign = math.copysign(1.0, r[1])
        r[0] = -(1.0 + e) * u[0] / (W[0, 0] + sign * mu * W[0, 1])
        r[1] = sign * mu * r[0]
    change = inverse @ J.T @ r
    return v + change[:2], w + change[2]


def thrown(scene: Scene, joint: bool) -> None:
    """Put a body with a knob at (0.05, -0.03), which turns about z as it flies to a wall."""
    scene.body(2, 0.5, (5e-4,) * 3, (0.0, 0.0, 0.0), (1.0, 0.3, 0.0), (0.0, 0.0, 2.0))
    if joint:
        scene.joint(1, "PLANAR", 2, 1, (0.0, 0.0, 0.0))
    scene.shape(200, "Sphere", 2, (0.05, -0.03, 0.0), radius=0.01)
    scene.shape(100, "Plane", 1, (0.2, 0.0, 0.0), AGAINST_X)


@pytest.mark.parametrize("h", [1e-3, None])
@pytest.mark.parametrize(("e", "mu"), [(0.0, 0.25), (0.5, 0.25), (0.5, 0.05), (0.8, 0.25)])
@pytest.mark.parametrize("joint", [True, False])
def test_a_body_in_a_plane_rebounds_as_a_free_one(scene, e, mu, joint, h) -> None:
    """In its plane nothing needs the joint, which holds one direction of friction."""
    thrown(scene, joint)
    results = scene.run(mu, e, 0.2, h, (0.0, 0.0, 0.0))
    v, w = rebound(e, mu)
    # where the knob is at the impact is known to the step's square
    error = 1e-4 if h is None else 5.0 * h
    assert scene.back(results["bodies/2/velocity"][-1]) == pytest.approx([*v, 0.0], abs=error)
    spin = scene.back(results["bodies/2/angular_velocity"][-1])
    assert spin == pytest.approx([0.0, 0.0, w], abs=30.0 * error)


def test_a_ball_on_a_rail_slides_along_a_wall_that_it_only_touches(scene) -> None:
    """It stopped, pressed by rounding on a wall towards which it cannot move."""
    scene.body(2, 1.0, (0.01,) * 3, (0.0, 0.0, 0.1))
    scene.joint(1, "TRANSLATIONAL", 2, 1, (0.0, 0.0, 0.1), ALONG_X)
    scene.shape(200, "Sphere", 2, (0.0, 0.0, 0.1), radius=0.1)
    scene.shape(100, "Plane", 1, (0.0, 0.0, 0.0))
    results = scene.run(0.5, pull=(5.0, 0.0, 0.0))
    place = scene.back(results["bodies/2/position"])[:, 0]
    assert place == pytest.approx(2.5 * results["time"] ** 2, abs=1e-9)
    assert np.abs(results["contacts/301/force"]).max() < 1e-9


def test_a_carriage_on_an_inclined_rail_rests_on_the_floor(scene) -> None:
    """Nothing rubs where nothing can slip: friction was on its cone, in any direction."""
    axes = np.array([[0.8, 0.0, 0.6], [0.0, 1.0, 0.0], [-0.6, 0.0, 0.8]])
    scene.body(2, 1.0, (0.01,) * 3, (0.0, 0.0, 0.15))
    scene.joint(1, "TRANSLATIONAL", 2, 1, (0.0, 0.0, 0.15), axes)
    scene.shape(200, "Sphere", 2, (0.0, 0.0, 0.15), radius=0.1)
    scene.shape(100, "Plane", 1, (0.0, 0.0, 0.0))
    results = scene.run(0.5)
    force = scene.back(results["contacts/301/force"])[-5:]
    assert force == pytest.approx(np.tile([0.0, 0.0, GRAVITY], (5, 1)), abs=1e-6)


@pytest.mark.parametrize("h", [1e-3, 2e-4])
@pytest.mark.parametrize("wheel", ["Sphere", "Cylinder"])
def test_a_wheel_that_an_arm_leads_round_is_not_held_along_the_arm(scene, wheel, h) -> None:
    """It rolls; its friction was mu N along the arm, where it does not slip."""
    r, far, turns = 0.1, 0.5, 3.0
    v, way = (0.0, turns * far, 0.0), (0.0, 0.0, turns)
    scene.body(2, 1.0, (0.05,) * 3, (0.0, 0.0, r), spin=way)
    scene.joint(1, "REVOLUTE", 2, 1, (0.0, 0.0, r))
    scene.motion(1, "R", turns)
    scene.body(3, 0.2, (1e-3,) * 3, (far, 0.0, r), v, way)
    scene.joint(2, "TRANSLATIONAL", 3, 2, (far, 0.0, r))
    scene.body(4, 2.0, (0.01,) * 3, (far, 0.0, r), v, (-turns * far / r, 0.0, turns))
    scene.joint(3, "REVOLUTE", 4, 3, (far, 0.0, r), ALONG_X)
    if wheel == "Sphere":
        scene.shape(200, wheel, 4, (far, 0.0, r), radius=r)
    else:
        scene.shape(200, wheel, 4, (far - 0.025, 0.0, r), ALONG_X, radius=r, length=0.05)
    scene.shape(100, "Plane", 1, (0.0, 0.0, 0.0))
    results = scene.run(0.5, end=0.5, h=h)
    force, place = (
        scene.back(results[name]) for name in ("contacts/301/force", "bodies/4/position")
    )
    assert force[-5:, 2] == pytest.approx(2.2 * GRAVITY, rel=1e-6)
    along = np.sum(force[-5:, :2] * place[-5:, :2], axis=1) / far
    assert np.abs(along).max() < 0.01 * GRAVITY
    at = turns * results["time"]
    arm = far * np.column_stack((np.cos(at), np.sin(at)))
    assert place[:, :2] == pytest.approx(arm, abs=5e-6)


@pytest.mark.parametrize("h", [1e-3, 2e-4])
@pytest.mark.parametrize("rate", ["0.5", "0.5*SIN(10*TIME)"])
def test_a_belt_across_shares_the_friction_of_what_slips(scene, h, rate) -> None:
    """A ball that cannot go with the belt is rubbed along its whole slip, along and across."""
    scene.body(2, 10.0, (1.0,) * 3, (0.0, 0.0, -0.5))
    scene.joint(1, "TRANSLATIONAL", 2, 1, (0.0, 0.0, -0.5), ALONG_Y)
    scene.motion(1, "T", rate)
    scene.body(3, 1.0, (0.01,) * 3, (0.0, 0.0, 0.1), (0.3, 0.0, 0.0))
    scene.joint(2, "PLANAR", 3, 1, (0.0, 0.0, 0.1), ALONG_Y)
    scene.shape(200, "Sphere", 3, (0.0, 0.0, 0.1), radius=0.1)
    scene.shape(100, "Plane", 2, (0.0, 0.0, 0.0))
    results = scene.run(0.1, end=0.3, h=h)
    t, state, dt = 0.0, np.array([0.3, 0.0]), 1e-5

    def slopes(t, state):
        across = 0.5 if rate == "0.5" else 0.5 * math.sin(10.0 * t)
        slip = np.array([state[0] - 0.1 * state[1], -across])
        force = -0.1 * GRAVITY * slip[0] / max(math.hypot(*slip), 1e-12)
        return np.array([force, -0.1 * force / 0.01])

    while t < 0.3 - 0.5 * dt:
        # the midpoint rule, with v and the spin about -y
        middle = state + 0.5 * dt * slopes(t, state)
        state = state + dt * slopes(t + 0.5 * dt, middle)
        t += dt
    speed = scene.back(results["bodies/3/velocity"])[-1]
    assert speed == pytest.approx([state[0], 0.0, 0.0], abs=1.5 * h)

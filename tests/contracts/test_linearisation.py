"""The linearised mechanism against differences of f over states that keep to the constraints.

With dx the change of such a state and df that of f, what an implicit method solves for the
residual c1 dx - df must be dx again, for any c1. X, work and losses are sums of what bodies do and
not unknowns: their rows are left out.
"""

from __future__ import annotations

import ctypes
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from decks_io import MODELS, write_deck
from mechanics import Body
from mechanism_decks import Joint, Scene, marker
from scipy.spatial.transform import Rotation

import mbsim
from mbsim.dynamics.implicit_hooks import implicit_hooks
from mbsim.settings import settle
from mbsim.simulation import Runner
from mbsim.system.build import build

COEFFICIENTS = (1.0, 10.0, 1e3)


class Silent:
    """A log that keeps nothing."""

    def line(self, text):
        pass


class Linearised:
    """A deck with the hooks of implicit methods, at its assembled state."""

    def __init__(self, path):
        model = mbsim.read_model(path)
        settings = settle(model)
        self.system = build(model, settings.stages[-1].simulation.end_time)
        self.runner = Runner(self.system, settings, None, Silent(), lambda text: None)
        self.runner.assemble()
        self.scene = self.system.scene
        self.problem, self.kept = implicit_hooks(self.scene, self.runner.problem, True)
        self.y = self.runner.method.y.copy()
        self.n, self.bodies = len(self.y), len(self.scene.bodies.mass)
        self.rows = np.r_[: 13 * self.bodies, self.scene.states.place].astype(int)

    def call(self, name, t, a, b):
        pointer = ctypes.c_void_p
        form = ctypes.CFUNCTYPE(
            ctypes.c_double, ctypes.c_int64, ctypes.c_double, ctypes.c_double, pointer, pointer
        )
        hook = form(getattr(self.problem, name))
        code = hook(self.problem.context, t, 0.0, a.ctypes.data, b.ctypes.data)
        assert code == 0, (name, code)

    def f(self, y, t):
        y, f = y.copy(), np.zeros(self.n)
        self.call("rhs", t, y, f)
        return f

    def on_manifold(self, y, t):
        y = y.copy()
        self.call("project", t, y, y.copy())
        return y

    def moved(self, t=0.0, seed=0, speed=1.0, move=0.05):
        """Return a state near the assembled one, at random."""
        rng, y = np.random.default_rng(seed), self.y.copy()
        for b in range(self.bodies):
            y[13 * b : 13 * b + 7] += move * rng.normal(size=7)
            y[13 * b + 7 : 13 * b + 13] += speed * rng.normal(size=6)
        for place in self.scene.states.place:
            y[place] += rng.normal()
        for _ in range(5):
            y = self.on_manifold(y, t)
        return y

    def linearise(self, y, t):
        self.call("linearise", t, y.copy(), self.f(y, t))

    def factor(self, c1):
        self.call("factor", 0.0, np.array([c1, c1 * c1, c1, 0.0]), np.zeros(4))

    def solve(self, r):
        d = np.zeros(self.n)
        self.call("solve", 0.0, np.ascontiguousarray(r), d)
        return d

    def solve_pair(self, c1, r):
        """Return the solution of the residual r with complex coefficients."""
        c = np.zeros(7)
        c[0::2] = c1.real, (c1 * c1).real, c1.real, 0.0
        c[1:6:2] = c1.imag, (c1 * c1).imag, c1.imag
        self.call("factor_pair", 0.0, c, np.zeros(4))
        given, d = np.concatenate([r.real, r.imag]), np.zeros(2 * self.n)
        self.call("solve_pair", 0.0, given, d)
        return d[: self.n] + 1j * d[self.n :]

    def changes(self, y, t, eps=1e-5):
        """Return dx and df for the change of every number of y, projected."""
        for k in self.rows:
            ends = []
            for sign in (1, -1):
                z = y.copy()
                z[k] += sign * eps
                ends.append(self.on_manifold(z, t))
            dx = (ends[0] - ends[1]) / (2 * eps)
            yield dx, (self.f(ends[0], t) - self.f(ends[1], t)) / (2 * eps)

    def misses(self, y, t=0.0, coefficients=COEFFICIENTS):
        """Return by how much dx is missed, over the largest dx, for every c1.

        Velocities count over c1 where that is above 1: an error of 1 in dx is one of c1 there.
        """
        weight = np.zeros(self.n, dtype=bool)
        for b in range(self.bodies):
            weight[13 * b + 7 : 13 * b + 13] = True
        changes = list(self.changes(y, t))
        self.linearise(y, t)
        worst = []
        for c1 in coefficients:
            self.factor(c1)
            misses, sizes = [], []
            for dx, df in changes:
                miss = self.solve(c1 * dx - df) - dx
                miss[weight] /= max(1.0, c1)
                misses.append(np.abs(miss[self.rows]).max())
                sizes.append(np.abs(dx[self.rows]).max())
            assert max(sizes) > 0.1
            worst.append(max(misses) / max(sizes))
        return np.array(worst)


def check(path, bound=1e-7, t=0.0, **moved):
    """Check a deck at two states at random."""
    it = Linearised(path)
    for seed in range(2):
        worst = it.misses(it.moved(t, seed, **moved), t)
        print(Path(path).stem, worst)
        assert worst.max() < bound, worst
    return it


@pytest.mark.parametrize("name", ["free_top", "slider_crank", "flyball_governor"])
def test_models(name):
    check(MODELS / f"{name}.xml", move=0.02)


# --- joints between moving bodies ---


def rotation(axis, angle):
    """Return a rotation about an axis."""
    axis = np.array(axis, float)
    return Rotation.from_rotvec(angle * axis / np.linalg.norm(axis)).as_matrix()


SKEW = rotation((1, 2, -1), 0.7)
SIDE = SKEW @ rotation((1, 0, 0), np.pi / 2)
ABOUT_Y = rotation((0, 1, 1), 0.4)
#: The joints that a tree or equations hold, and how marker I differs from J at the start.
JOINTS = {
    "FREE": {},
    "FIXED": {},
    "REVOLUTE": {},
    "TRANSLATIONAL": {},
    "CYLINDRICAL": {},
    "SPHERICAL": {"R_i": ABOUT_Y},
    "UNIVERSAL": {"R_i": SIDE},
    "HOOKE": {"R_i": SKEW @ rotation((1, 0, 0), 0.4)},
    "PLANAR": {},
    "INLINE": {"R_i": ABOUT_Y},
    "INPLANE": {"R_i": ABOUT_Y},
    "ORIENTATION": {},
    "PARALLEL_AXES": {},
    "PERPENDICULAR": {"R_i": SIDE},
    "CONSTANT_VELOCITY": {"R_i": SKEW @ rotation((1, 0, 0), 0.5)},
    "DISTANCE": {"p_j": (0.9, 0.3, 0.2)},
    "SCREW": {"attributes": 'pitch="0.3"'},
    "RACK_PINION": {"attributes": 'pitch_diameter="0.4"', "R_i": SIDE},
}
FIRST = Body(
    2.0, [[0.3, 0.02, 0.01], [0.02, 0.4, -0.03], [0.01, -0.03, 0.25]], (0.5, 0.1, 0.2),
    rotation((1, 1, 0), 0.3),
)  # fmt: skip
SECOND = Body(1.0, (0.08, 0.1, 0.05), (1.5, -0.2, -0.3), rotation((0, 1, 2), -0.5))
THIRD = Body(1.5, (0.2, 0.15, 0.1), (2.0, 0.5, 0.1), rotation((1, 0, 2), 0.8))
PLACE = (1.2, -0.1, -0.05)


def two(kind, hold="SPHERICAL", extra=""):
    """Return two bodies: the first held by ground, the second by the first, at PLACE."""
    values = {"p": PLACE, "R_i": SKEW, "R_j": SKEW} | JOINTS[kind]
    joints = [Joint(hold, 1, 0, R_i=SKEW)] if hold else []
    return Scene([FIRST, SECOND], [*joints, Joint(kind, 2, 1, **values)], extra=extra)


def of(scene, folder):
    """Return the path of a scene's deck."""
    return write_deck(folder, scene.xml())


def test_all_joints_are_here():
    from mbsim.joints.catalog import JOINTS as registered

    assert sorted(JOINTS) == sorted(registered)


@pytest.mark.parametrize("hold", ["SPHERICAL", None])
@pytest.mark.parametrize("kind", JOINTS)
def test_joint(kind, hold, tmp_path):
    check(of(two(kind, hold), tmp_path))


@pytest.mark.parametrize("kind", ["REVOLUTE", "UNIVERSAL", "CYLINDRICAL", "SPHERICAL", "PLANAR"])
def test_a_loop(kind, tmp_path):
    scene = two(kind)
    third = Joint("SPHERICAL", 3, 2, p=(1.8, 0.1, 0.2))
    last = Joint("SPHERICAL", 3, 0, p=(2.4, 0.6, 0.4))
    check(of(Scene([FIRST, SECOND, THIRD], [*scene.joints, third, last]), tmp_path), move=0.02)


def test_several_on_one_body(tmp_path):
    on = [Joint("REVOLUTE", 2, 1, p=PLACE, R_i=SKEW), Joint("HOOKE", 3, 1, p=(0.9, 0.3, 0.1))]
    check(of(Scene([FIRST, SECOND, THIRD], on), tmp_path))


#: Constraints beside the joint between body 2 and 1, whose markers are 1002 and 1003.
EQUATIONS = {
    "angle": (
        "REVOLUTE",
        '<Motion_Joint id="1" joint_id="2" joint_type="R" type="EXPRESSION" val_type="D" '
        'expr="0.3*SIN(2*TIME)"/>',
    ),
    "travel": (
        "CYLINDRICAL",
        '<Motion_Joint id="1" joint_id="2" joint_type="T" type="EXPRESSION" val_type="D" '
        'expr="0.1*TIME**2"/>',
    ),
    "coupler": (
        "CYLINDRICAL",
        '<Constraint_Coupler id="1" i_joint_id="2" j_joint_id="2" i_type="R" j_type="T" '
        'i_scale="1" j_scale="-2"/>',
    ),
}

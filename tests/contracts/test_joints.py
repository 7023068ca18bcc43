"""What every registered joint must do: the motion that it leaves, and what it does not do.

The equations are evaluated here from the catalogue's own words, in plain numpy, and their
derivatives taken by differences; what a joint lets through is compared with geometry
(`mechanics`), which knows nothing of the catalogue.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from helpers import mechanics as mech
from helpers.mechanism_decks import ROWS, Joint, Scene, apart
from mbsim.joints.catalog import JOINTS

SKEW = mech.euler313(20, 50, -35)
SIDE = SKEW @ mech.euler313(0, 90, 0)  # z at right angles
BENT = SKEW @ mech.euler313(0, 25, 0)
PLACE = np.array([0.4, -0.3, 0.2])

#: How many of the six relative motions a joint leaves.
FREEDOMS = {
    "CONSTANT_VELOCITY": 2,
    "CYLINDRICAL": 2,
    "DISTANCE": 5,
    "FIXED": 0,
    "FREE": 6,
    "HOOKE": 2,
    "INLINE": 4,
    "INPLANE": 5,
    "ORIENTATION": 3,
    "PARALLEL_AXES": 4,
    "PERPENDICULAR": 5,
    "PLANAR": 3,
    "RACK_PINION": 5,
    "REVOLUTE": 1,
    "SCREW": 1,
    "SPHERICAL": 3,
    "TRANSLATIONAL": 1,
    "UNIVERSAL": 2,
}
ATTRIBUTES = SimpleNamespace(pitch=0.3, pitch_diameter=0.2, length=None)
DECK_ATTRIBUTES = {"SCREW": 'pitch="0.3"', "RACK_PINION": 'pitch_diameter="0.2"'}


def rolling(I, J, t):
    """The rate of a pinion (axis z of I) on a rack (along z of J)."""
    d, w = I.p - J.p, I.w - J.w
    travel = mech.dot(d, J.z)
    turn = I.z.v @ w.a
    turn[-1] += w.d @ I.z.d
    return [mech.Jet(np.nan, travel.d - 0.1 * (w.d @ I.z.v), travel.a - 0.1 * turn)]


LENGTH = 0.5
GEOMETRY = ROWS | {
    "FREE": lambda I, J, t: [],
    "SCREW": mech.screw(0.3),
    "DISTANCE": mech.distance(LENGTH),
    "RACK_PINION": rolling,
}
AXES_OF_I = {"UNIVERSAL": SIDE, "PERPENDICULAR": SIDE, "CONSTANT_VELOCITY": BENT, "HOOKE": BENT}
AXES_OF_I |= {"RACK_PINION": SIDE}


def place_of_j(kind):
    return PLACE - np.array([0.3, 0.0, 0.4]) if kind == "DISTANCE" else PLACE


def value(row, I, J, start):
    """Return a row's value where I and J are (origin, axes); `start` is I's axes at the start."""
    (p, A), (q, B) = I, J
    column = {"x": 0, "y": 1, "z": 2}
    if row.kind == "offset":
        return B[:, column[row.j]] @ (p - q)
    if row.kind == "perp":
        return A[:, column[row.i]] @ B[:, column[row.j]]
    if row.kind == "angle":
        return np.arctan2(A[:, 0] @ B[:, 1], A[:, 0] @ B[:, 0])
    if row.kind == "distance":
        return np.linalg.norm(p - q)
    if row.kind == "twist":
        # of 2 z of the quaternion to first order, for rotation matrices to first order
        M = B.T @ A
        return (M[1, 0] - M[0, 1]) / np.sqrt(1 + np.trace(M))
    assert row.kind == "spin"
    # about its own z, from the attitude at the start; J stays here
    return start[:, 1] @ A[:, 0]


def equations(kind, I, J, start):
    """Return the values of a joint's equations."""
    return np.array(
        [
            sum(row.factor(ATTRIBUTES) * value(row, I, J, start) for row in rows)
            for rows in JOINTS[kind].equations
        ]
    )


def jacobian(kind):
    """Return the derivative of the equations by I's translation and rotation (J stays)."""
    A = AXES_OF_I.get(kind, SKEW)
    J = (place_of_j(kind), SKEW)
    step = 1e-6
    columns = []
    for k in range(6):
        ends = []
        for sign in (1.0, -1.0):
            move = np.zeros(6)
            move[k] = sign * step
            turn = mech.skew(move[3:])
            ends.append(equations(kind, (PLACE + move[:3], (np.eye(3) + turn) @ A), J, A))
        columns.append((ends[0] - ends[1]) / (2 * step))
    return np.array(columns).T.reshape(-1, 6)


def test_every_joint_is_known_here():
    assert sorted(JOINTS) == sorted(FREEDOMS)


@pytest.mark.parametrize("kind", sorted(FREEDOMS))
def test_equations_are_independent_and_leave_the_right_motion(kind):
    G = jacobian(kind)
    assert len(G) == 6 - FREEDOMS[kind]
    assert np.linalg.matrix_rank(G, tol=1e-4) == len(G)
    # the same motions pass as geometry lets pass: both Jacobians have one null space
    body = mech.Body(1.0, (1.0, 1.0, 1.0), PLACE)
    I = mech.Marker(1, PLACE, AXES_OF_I.get(kind, SKEW))
    J = mech.Marker(0, place_of_j(kind), SKEW)
    mechanism = mech.Mechanism([body], [mech.Constraint(I, J, GEOMETRY[kind])])
    jets, _ = mechanism.rows(mechanism.parts(mechanism.y0()), 0.0)
    H = np.array([jet.a[6:12] for jet in jets]).reshape(-1, 6)
    both = np.vstack([G, H])
    assert np.linalg.matrix_rank(both, tol=1e-4) == len(G)


@pytest.mark.parametrize("kind", sorted(FREEDOMS))
def test_equations_hold_as_assembled(kind):
    A = AXES_OF_I.get(kind, SKEW)
    values = equations(kind, (PLACE, A), (place_of_j(kind), SKEW), A)
    for rows, number in zip(JOINTS[kind].equations, values, strict=True):
        if len(rows) == 1 and rows[0].kind in ("offset", "perp"):
            assert abs(number) < 1e-12


def scene(kind, times):
    """Return a body on a joint to ground, thrown; the joint stands there `times` times."""
    body = mech.Body(
        1.5, (0.2, 0.3, 0.25), (0.9, 0.1, -0.2), SKEW, (0.5, -0.4, 0.3), (1.0, -0.7, 0.9)
    )
    joint = Joint(
        kind, 1, 0, PLACE, AXES_OF_I.get(kind, SKEW), SKEW, place_of_j(kind),
        DECK_ATTRIBUTES.get(kind, ""), GEOMETRY[kind],
    )  # fmt: skip
    start = Scene([body], [joint]).consistent() if kind != "FREE" else Scene([body], [joint])
    return Scene(start.bodies, [joint] * times)


@pytest.mark.parametrize("kind", sorted(FREEDOMS))
def test_a_joint_stated_twice_does_what_it_does_once_and_no_work(kind, tmp_path):
    once = scene(kind, 1).run(tmp_path, 0.5, 0.1)
    twice = scene(kind, 2).run(tmp_path, 0.5, 0.1)
    at = "bodies/2"
    assert np.abs(once[f"{at}/position"] - twice[f"{at}/position"]).max() < 1e-7
    assert apart(once[f"{at}/quaternion"], twice[f"{at}/quaternion"]) < 1e-7
    for what in ("force", "torque"):
        total = twice[f"joints/1/{what}"] + twice[f"joints/2/{what}"]
        single = once[f"joints/1/{what}"]
        assert np.abs(total - single).max() < 1e-5 * max(1.0, np.abs(single).max())
    for results in (once, twice):
        energy = results["energy/kinetic"] + results["energy/potential"]
        assert np.abs(energy - energy[0]).max() < 1e-7

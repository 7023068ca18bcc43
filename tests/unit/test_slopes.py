"""How measures change with one number of the state, against differences of their values."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from helpers import free_bodies as free
from mbsim.compile_model.build import build
from mbsim.dynamics.bodies.kinematics import place_bodies
from mbsim.dynamics.expressions.jets import run, value
from mbsim.dynamics.expressions.slopes import A_STATE, DIRECTIONS
from mbsim.expressions.parse import parse
from mbsim.model.elements import Differential, Marker, Request

STEP = 1e-3

TEXTS = [
    "DM(21, 31)",
    "DX(21, 31, 11)",
    "DY(31, 21, 31)",
    "AZ(21, 31)",
    "INCANG(21, 31, 11)",
    "YAW(21, 31)",
    "VM(21, 31)",
    "VM(21, 11, 31)",
    "VR(21, 31)",
    "VX(21, 31)",
    "VY(31, 21, 21)",
    "VZ(21, 31, 31, 21)",
    "WM(21, 31)",
    "WX(21, 31)",
    "WZ(31, 11, 21)",
    "-3*VX(21,31)*DM(21,31)**2 + SIN(WZ(21,31,31))/DX(21,31,11) + DIF(1)*VR(21,31)",
    "IF(VR(21,31): 0, 1, STEP(VM(21,31), 0, 0, 9, VY(21, 31)))",
    "IMPACT(DM(21,31), VR(21,31), 9, 1e3, 1.5, 20, 0.1)",
]


def turned(q, a):
    """Return unit quaternion q turned by the rotation vector a, global: exp(a/2) q."""
    angle = np.linalg.norm(a)
    c, u = np.cos(angle / 2), np.sinc(angle / (2 * np.pi)) / 2 * a
    return np.concatenate([[c * q[0] - u @ q[1:]], c * q[1:] + q[0] * u + np.cross(u, q[1:])])


def matrix(q):
    """Return the rotation of a unit quaternion."""
    w, v = q[0], q[1:]
    K = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return np.eye(3) + 2 * w * K + 2 * K @ K


def moved(y, body, direction, by):
    """Return y with one number of a body's pose or velocity changed, global axes."""
    y, at = y.copy(), 13 * body
    q, unit = y[at + 3 : at + 7].copy(), np.eye(3)[direction % 3]
    if direction < 3:
        y[at : at + 3] += by * unit
    elif direction < 6:
        w = matrix(q) @ y[at + 10 : at + 13]
        y[at + 3 : at + 7] = turned(q, by * unit)
        y[at + 10 : at + 13] = matrix(y[at + 3 : at + 7]).T @ w
    elif direction < 9:
        y[at + 7 : at + 10] += by * unit
    else:
        y[at + 10 : at + 13] += matrix(q).T @ (by * unit)
    return y


@pytest.mark.parametrize("text", TEXTS)
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_slope_is_the_limit_of_differences(text, seed):
    rng = np.random.default_rng(seed)
    markers = [Marker(11, body_id=1, pos=(0.3, -0.2, 0.4))]
    for b in (2, 3):
        R = free.rotation(rng.normal(size=3), rng.uniform(0.3, 2.8))
        markers.append(Marker(10 * b + 1, body_id=b, pos=tuple(rng.normal(size=3)), R=R))
    model = free.model(
        *(free.body(b) for b in (2, 3)),
        markers=markers,
        requests=[Request(1, "EXPRESSION", exprs=(parse(text),))],
        differentials=[Differential(1, parse("0"), ic=0.7)],
    )
    system = build(model)
    scene, y = system.scene, system.y0
    program = len(scene.programs.start) - 2
    y[:26] = rng.normal(size=26)
    for b in range(2):
        y[13 * b + 3 : 13 * b + 7] /= np.linalg.norm(y[13 * b + 3 : 13 * b + 7])

    def f(y):
        place_bodies(scene, y)
        return value(scene, 0.3, y, program)

    def difference(change):
        """Return the derivative by Richardson's extrapolation of central differences."""
        rows = [
            (f(change(h)) - f(change(-h))) / (2 * h) for h in (STEP, STEP / 2, STEP / 4, STEP / 8)
        ]
        for k in range(1, 4):
            rows = [(4**k * b - a) / (4**k - 1) for a, b in itertools.pairwise(rows)]
        return rows[0]

    def exact(body, direction):
        place_bodies(scene, y)
        run(scene, 0.3, y, program, body, direction)
        return scene.programs.stack[0, 1]

    found = [exact(b, direction) for b in range(2) for direction in range(DIRECTIONS)]
    asked = [
        difference(lambda h, b=b, direction=direction: moved(y, b, direction, h))
        for b in range(2)
        for direction in range(DIRECTIONS)
    ]
    np.testing.assert_allclose(found, asked, rtol=1e-8, atol=1e-8 * (1 + np.abs(asked).max()))
    place = scene.states.offset[0]

    def pushed(h):
        z = y.copy()
        z[place] += h
        return z

    np.testing.assert_allclose(exact(A_STATE, place), difference(pushed), rtol=1e-8, atol=1e-9)

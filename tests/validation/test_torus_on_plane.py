"""S9plane, with a law that rebounds, against an integration in SciPy, the mesh cut in NumPy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import mbsim
from mbsim.bench import parameters as p
from mbsim.bench.scenes import s09_tori
from mbsim.bench.scenes.s09_tori import SCENES, TRANSITION

LAW = s09_tori.LAW._replace(c=50.0)


def centre_below(triangles):
    """Return where depth below z = 0 has its centre, and the largest depth; none: (None, 0).

    Each triangle counts by its area seen along z, upward sides less: that is the overlap's own.
    """
    low = -triangles[:, :, 2].min()
    if low <= 0.0:
        return None, 0.0
    near = triangles[triangles[:, :, 2].min(axis=1) < 0.0]
    total, first = 0.0, np.zeros(2)
    for triangle in near:
        polygon = []
        for k in range(3):
            a, b = triangle[k], triangle[(k + 1) % 3]
            if a[2] <= 0.0:
                polygon.append(a)
            if (a[2] < 0.0) != (b[2] < 0.0):
                polygon.append(a + a[2] / (a[2] - b[2]) * (b - a))
        for k in range(1, len(polygon) - 1):
            q = np.array([polygon[0], polygon[k], polygon[k + 1]])
            u, v = q[1] - q[0], q[2] - q[0]
            depth, area = -q[:, 2], -0.5 * (u[0] * v[1] - u[1] * v[0])
            total += area * depth.mean()
            # of a product of linear functions: (sum of products + product of sums) / 12
            first += area * (depth @ q[:, :2] + depth.sum() * q[:, :2].sum(axis=0)) / 12.0
    return first / total, low


def step(x, x0, h0, x1, h1):
    """Return the cubic STEP of the deck language."""
    u = np.clip((x - x0) / (x1 - x0), 0.0, 1.0)
    return h0 + (h1 - h0) * u * u * (3.0 - 2.0 * u)


def rates(t, y, corners, inertia):
    place, turn, v, w = y[:3], Rotation.from_quat(y[3:7]), y[7:10], y[10:13]
    R = turn.as_matrix()
    force, torque = np.array([0.0, 0.0, -9.81 * p.S9.mass]), np.zeros(3)
    at, depth = centre_below(corners @ R.T + place)
    if depth > 0.0:
        arm = np.array([*at, -0.5 * depth]) - place
        slip = v + np.cross(w, arm)
        normal = LAW.k * depth**LAW.e - step(depth, 0.0, 0.0, LAW.dmax, LAW.c) * slip[2]
        normal, speed = max(normal, 0.0), np.hypot(*slip[:2])
        push = np.array([0.0, 0.0, normal])
        if speed > 0.0:
            mu = step(speed, -TRANSITION, -p.S9.mu, TRANSITION, p.S9.mu)
            push[:2] = -mu * normal * slip[:2] / speed
        force, torque = force + push, np.cross(arm, push)
    local = R.T @ w
    turning = R @ ((R.T @ torque - np.cross(local, inertia * local)) / inertia)
    x, y_, z, s = y[3:7]
    spin = 0.5 * np.array(
        [
            w[0] * s + w[1] * z - w[2] * y_,
            w[1] * s + w[2] * x - w[0] * z,
            w[2] * s + w[0] * y_ - w[1] * x,
            -w[0] * x - w[1] * y_ - w[2] * z,
        ]
    )
    return np.concatenate([v, spin, force / p.S9.mass, turning])


@pytest.mark.slow
def test_the_height_of_the_torus_is_that_of_its_law(tmp_path, monkeypatch):
    """Its law lets it bounce: at 1 s it is not at rest at the height of its tube."""
    vertices, faces = p.torus_mesh(p.S9)
    inertia = np.array(p.torus_inertia(p.S9))
    start = np.concatenate(
        [
            [0.0, 0.0, p.S9.height],
            Rotation.from_euler("x", p.S9.tilt).as_quat(),
            np.zeros(6),
        ]
    )
    exact = solve_ivp(
        rates, (0.0, p.S9.end_time), start, args=(vertices[faces], inertia), method="DOP853",
        rtol=1e-7, atol=1e-9, max_step=1e-3, t_eval=np.arange(101) * 0.01,
    )  # fmt: skip
    monkeypatch.setattr(s09_tori, "LAW", LAW)
    path = tmp_path / "deck.xml"
    path.write_text(SCENES[0].deck({}), encoding="utf-8")
    run = mbsim.simulate(mbsim.read_model(path), tol=1e-8, print_interval=0.01)
    z, t = run["bodies/2/position"][:, 2], run["time"]
    # found 0.8 mm: ours damps tilting on a patch and spreads friction over it
    assert np.abs(np.interp(exact.t, t, z) - exact.y[2]).max() < 2e-3
    assert exact.y[2, -1] > 2.0 * p.S9.tube
    assert z[-1] > 2.0 * p.S9.tube

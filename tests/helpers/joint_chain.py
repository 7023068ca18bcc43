"""A chain of rods on oblique hinges in joint coordinates, apart from mbsim's own equations.

The rods lie along x at the start; the axis of each hinge is the one before turned about the
rod by the golden angle, square to the rod or tilted towards it. The state is y = (angles,
rates); the accelerations are those of R. Featherstone, Rigid Body Dynamics Algorithms (2008),
table 7.1, with all spatial vectors about the origin of the global frame, so that none is
transformed. `problem` makes them a `Problem` for mbsim's integrators, `exact` integrates them
by scipy.
"""

from __future__ import annotations

import ctypes
import math
from typing import Any, NamedTuple

import numpy as np
from numba import carray
from scipy.integrate import solve_ivp

from helpers.equations import far, none, one, zero
from mbsim.bench import deck as text
from mbsim.bench import parameters as p
from mbsim.core.address import pack, view
from mbsim.core.arrays import F1, F2, F3, I1
from mbsim.core.jitable import jitable
from mbsim.core.problem import Problem, addresses
from mbsim.core.rotation import add, cross, dot, scale, sub, vector

GOLDEN_ANGLE = math.pi * (3.0 - math.sqrt(5.0))


class Chain(NamedTuple):
    """What the hooks see. Row k+1 of a pose is rod k, row 0 the ground; all in global axes."""

    axis: F2  # (n, 3) of the hinge, the same in the rod before and in the rod itself
    rod: F1  # (3,) length, mass, and inertia along over m l^2
    scale: F1  # (2,) length and speed that errors are divided by
    turn: F3  # (n + 1, 3, 3) columns: the rod's axes
    end: F2  # (n + 1, 3) the far end, where the next hinge is
    speed: F2  # (n + 1, 3) velocity of the far end
    spin: F2  # (n + 1, 3)
    way: F2  # (n, 6) spatial axis of the hinge (angular, linear at the origin)
    twist: F2  # (n, 6) spatial velocity of the rod
    drift: F2  # (n, 6) acceleration of the hinge without that of its rate
    inertia: F3  # (n, 6, 6) articulated
    bias: F2  # (n, 6) articulated
    push: F2  # (n, 6) inertia times way
    pull: F2  # (n, 2) inertia along the way, and the force left along it
    rise: F1  # (6,) spatial acceleration
    near: F1  # (2n,) a state near y
    pose: F2  # (n + 1, 18) of that state: centre, axes, velocity, spin
    rows: F2  # (times, 3) the free end
    used: I1  # (1,)


def axes(count: int, tilt: float) -> np.ndarray:
    """Return the axes of the hinges (count, 3) in the rods' own frames, tilted towards the rod."""
    turned, across = GOLDEN_ANGLE * np.arange(count), math.cos(tilt)
    along = np.full(count, math.sin(tilt))
    return np.stack([along, across * np.cos(turned), across * np.sin(turned)], axis=1)


def chain_deck(count: int, end_time: float, tilt: float = 0.0) -> str:
    """Return the deck of the same chain."""
    length = p.S8.length / count
    statements = [text.GROUND]
    for k, axis in enumerate(axes(count, tilt)):
        body, before, at = 2 + k, 1 + k, [k * length, 0.0, 0.0]
        inertia = p.rod_inertia(p.S8.mass, length)
        statements.append(text.body(body, p.S8.mass, inertia, [(k + 0.5) * length, 0.0, 0.0]))
        beside = np.cross(axis, [1.0, 0.0, 0.0]) / math.cos(tilt)
        hinge = np.stack([np.cross(beside, axis), beside, axis], axis=1).tolist()
        statements.append(text.marker(10 * body + 1, body, at, hinge))
        statements.append(text.marker(10 * before + 2, before, at, hinge))
        statements.append(text.joint(501 + k, "REVOLUTE", 10 * body + 1, 10 * before + 2))
    statements.append(text.gravity())
    return text.deck(f"A chain of {count} rods on oblique hinges", statements, end_time)


@jitable
def place(chain, y):
    """Fill turn, end, speed and spin from the state y."""
    n = len(chain.axis)
    for k in range(n):
        before, own = chain.turn[k], chain.turn[k + 1]
        a = turned(before, vector(chain.axis[k]))
        c, s = math.cos(y[k]), math.sin(y[k])
        for j in range(3):
            e = (before[0, j], before[1, j], before[2, j])
            # Rodrigues: e cos q + (a x e) sin q + a (a.e) (1 - cos q)
            e = add(add(scale(c, e), scale(s, cross(a, e))), scale((1.0 - c) * dot(a, e), a))
            own[0, j], own[1, j], own[2, j] = e
        along = scale(chain.rod[0], (own[0, 0], own[1, 0], own[2, 0]))
        w = add(vector(chain.spin[k]), scale(y[n + k], a))
        put(chain.spin[k + 1], 0, w)
        put(chain.end[k + 1], 0, add(vector(chain.end[k]), along))
        put(chain.speed[k + 1], 0, add(vector(chain.speed[k]), cross(w, along)))


@jitable
def put(row, at, v):
    """Write a vector into a row."""
    row[at], row[at + 1], row[at + 2] = v


@jitable
def turned(m, v):
    """Return m v for a matrix (3, 3)."""
    return (
        m[0, 0] * v[0] + m[0, 1] * v[1] + m[0, 2] * v[2],
        m[1, 0] * v[0] + m[1, 1] * v[1] + m[1, 2] * v[2],
        m[2, 0] * v[0] + m[2, 1] * v[1] + m[2, 2] * v[2],
    )


@jitable
def rigid_inertia(chain, k):
    """Write the spatial inertia of rod k about the origin."""
    length, mass = chain.rod[0], chain.rod[1]
    across = mass * length * length / 12.0
    along = chain.rod[2] * mass * length * length
    c = scale(0.5, add(vector(chain.end[k]), vector(chain.end[k + 1])))
    x = chain.turn[k + 1, :, 0]
    inertia = chain.inertia[k]
    square = dot(c, c)
    for i in range(3):
        for j in range(3):
            same = 1.0 if i == j else 0.0
            inertia[i, j] = (
                across * same
                + (along - across) * x[i] * x[j]
                + mass * (square * same - c[i] * c[j])
            )
            inertia[3 + i, 3 + j] = mass * same
            inertia[i, 3 + j] = 0.0
    inertia[0, 4], inertia[0, 5] = -mass * c[2], mass * c[1]
    inertia[1, 3], inertia[1, 5] = mass * c[2], -mass * c[0]
    inertia[2, 3], inertia[2, 4] = -mass * c[1], mass * c[0]
    for i in range(3):
        for j in range(3):
            inertia[3 + j, i] = inertia[i, 3 + j]


@jitable
def outward(chain, y):
    """Fill way, twist, drift, rigid inertias and biases: v = v before + S q', c = v x S q'."""
    n = len(chain.axis)
    for k in range(n):
        at, w = vector(chain.end[k]), vector(chain.spin[k + 1])
        a = turned(chain.turn[k], vector(chain.axis[k]))
        arm, v = cross(at, a), sub(vector(chain.speed[k]), cross(w, at))
        rate = y[n + k]
        put(chain.way[k], 0, a)
        put(chain.way[k], 3, arm)
        put(chain.twist[k], 0, w)
        put(chain.twist[k], 3, v)
        put(chain.drift[k], 0, scale(rate, cross(w, a)))
        put(chain.drift[k], 3, scale(rate, add(cross(w, arm), cross(v, a))))
        rigid_inertia(chain, k)
        times(chain.inertia[k], chain.twist[k], chain.bias[k])
        h, q = vector(chain.bias[k, 0:3]), vector(chain.bias[k, 3:6])
        put(chain.bias[k], 0, add(cross(w, h), cross(v, q)))
        put(chain.bias[k], 3, cross(w, q))


@jitable
def times(m, v, out):
    """Write m v into `out`, (6, 6) and (6,)."""
    for i in range(6):
        total = 0.0
        for j in range(6):
            total += m[i, j] * v[j]
        out[i] = total


@jitable
def inner(a, b):
    """Return a . b of six numbers."""
    total = 0.0
    for i in range(6):
        total += a[i] * b[i]
    return total


@jitable
def inward(chain):
    """Make inertias and biases articulated, from the free end to the ground."""
    for k in range(len(chain.axis) - 1, -1, -1):
        way, push, inertia, bias = chain.way[k], chain.push[k], chain.inertia[k], chain.bias[k]
        times(inertia, way, push)
        d, u = inner(way, push), -inner(way, bias)
        chain.pull[k, 0], chain.pull[k, 1] = d, u
        if k == 0:
            return
        for i in range(6):
            force = bias[i] + push[i] * u / d
            for j in range(6):
                left = inertia[i, j] - push[i] * push[j] / d
                chain.inertia[k - 1, i, j] += left
                force += left * chain.drift[k, j]
            chain.bias[k - 1, i] += force


@jitable
def accelerations(chain, y, out):
    """Write (rates, accelerations of the hinges) into `out`."""
    n = len(chain.axis)
    place(chain, y)
    outward(chain, y)
    inward(chain)
    # the ground rises with g instead of gravity
    a = chain.rise
    for i in range(6):
        a[i] = p.GRAVITY if i == 5 else 0.0
    for k in range(n):
        for i in range(6):
            a[i] += chain.drift[k, i]
        acceleration = (chain.pull[k, 1] - inner(chain.push[k], a)) / chain.pull[k, 0]
        out[k], out[n + k] = y[n + k], acceleration
        for i in range(6):
            a[i] += chain.way[k, i] * acceleration


@jitable
def pose_error(chain, e, y):
    """Return mbsim's measure of an error e of y: largest |dx|/L, |dtheta|, |dv|/V, |dw| L/V.

    Poses are taken at y and a millionth away along e, so that it is linear in e.
    """
    n = len(chain.axis)
    size = 0.0
    for i in range(2 * n):
        size = max(size, abs(e[i]))
    if size == 0.0:
        return 0.0
    part = 1e-6 / size
    for i in range(2 * n):
        chain.near[i] = y[i] + part * e[i]
    place(chain, chain.near)
    for k in range(n + 1):
        put(chain.pose[k], 0, vector(chain.end[k]))
        put(chain.pose[k], 12, vector(chain.speed[k]))
        put(chain.pose[k], 15, vector(chain.spin[k]))
        for j in range(9):
            chain.pose[k, 3 + j] = chain.turn[k, j // 3, j % 3]
    place(chain, y)
    length, speed, largest = chain.scale[0], chain.scale[1], 0.0
    for k in range(1, n + 1):
        dx = dv = dw = turn = 0.0
        for i in range(3):
            middle = 0.5 * (chain.pose[k - 1, i] + chain.pose[k, i])
            dx += (middle - 0.5 * (chain.end[k - 1, i] + chain.end[k, i])) ** 2
            middle = 0.5 * (chain.pose[k - 1, 12 + i] + chain.pose[k, 12 + i])
            dv += (middle - 0.5 * (chain.speed[k - 1, i] + chain.speed[k, i])) ** 2
            dw += (chain.pose[k, 15 + i] - chain.spin[k, i]) ** 2
        for j in range(9):
            turn += (chain.pose[k, 3 + j] - chain.turn[k, j // 3, j % 3]) ** 2
        # the matrices of a small turn differ by sqrt(2) times its angle
        largest = max(largest, dx / length**2, 0.5 * turn)
        largest = max(largest, dv / speed**2, dw * (length / speed) ** 2)
    return math.sqrt(largest) / part


def _rhs(context, t, h, a, b):
    chain = view(context, Chain)
    n = 2 * len(chain.axis)
    accelerations(chain, carray(a, (n,)), carray(b, (n,)))
    return 0


def _norm(context, t, h, a, b):
    chain = view(context, Chain)
    n = 2 * len(chain.axis)
    return pose_error(chain, carray(a, (n,)), carray(b, (n,)))


def _output(context, t, h, a, b):
    chain = view(context, Chain)
    place(chain, carray(a, (2 * len(chain.axis),)))
    put(chain.rows[chain.used[0]], 0, vector(chain.end[len(chain.axis)]))
    chain.used[0] += 1
    return 0


def make(count: int, samples: int, tilt: float = 0.0) -> Chain:
    """Return a chain of `count` rods with room for `samples` rows."""
    n = count
    length, along = p.S8.length, p.ROD_ALONG
    turn = np.zeros((n + 1, 3, 3))
    turn[0] = np.eye(3)
    return Chain(
        axis=axes(n, tilt),
        rod=np.array([length / n, p.S8.mass, along]),
        scale=np.array([length, math.sqrt(p.GRAVITY * length)]),
        turn=turn,
        end=np.zeros((n + 1, 3)),
        speed=np.zeros((n + 1, 3)),
        spin=np.zeros((n + 1, 3)),
        way=np.zeros((n, 6)),
        twist=np.zeros((n, 6)),
        drift=np.zeros((n, 6)),
        inertia=np.zeros((n, 6, 6)),
        bias=np.zeros((n, 6)),
        push=np.zeros((n, 6)),
        pull=np.zeros((n, 2)),
        rise=np.zeros(6),
        near=np.zeros(2 * n),
        pose=np.zeros((n + 1, 18)),
        rows=np.zeros((samples, 3)),
        used=np.zeros(1, dtype=np.int64),
    )


def problem(chain: Chain) -> tuple[Problem, Any]:
    """Return the chain as integrators see it, and what must live as long as it is used."""
    table = pack(chain)
    hooks = dict(
        rhs=_rhs, project=zero, norm=_norm, check=one, commit=zero, look=zero, inner=none,
        limit=far, output=_output, reject=zero,
    )  # fmt: skip
    return Problem(int(table.ctypes.data), **addresses(hooks, hooks)), (table, chain)


def exact(count: int, times: np.ndarray, tilt: float = 0.0) -> np.ndarray:
    """Return the free end (times, 3) by scipy's DOP853 at 1e-13; `times` begin with 0."""
    chain = make(count, len(times), tilt)
    found, _kept = problem(chain)
    pointer = ctypes.c_void_p
    signature = ctypes.c_int64, ctypes.c_double, ctypes.c_double, pointer, pointer
    rhs, output = (
        ctypes.CFUNCTYPE(ctypes.c_int64, *signature)(hook) for hook in (found.rhs, found.output)
    )

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        f = np.empty_like(y)
        rhs(found.context, t, 0.0, y.ctypes.data, f.ctypes.data)
        return f

    span = (0.0, float(times[-1]))
    start = np.zeros(2 * count)
    done = solve_ivp(rate, span, start, "DOP853", times, rtol=1e-13, atol=1e-14)
    assert done.success, done.message
    for y in np.ascontiguousarray(done.y.T):
        output(found.context, 0.0, 0.0, y.ctypes.data, y.ctypes.data)
    return chain.rows

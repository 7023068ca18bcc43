"""The problem of one contact, solved exactly: u = A r + b and Coulomb's law between u and r."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from mbsim.core.jitable import jitable
from mbsim.fclib.cone import cone_height

if TYPE_CHECKING:
    from mbsim.fclib.problem import Vector


@jitable
def contact_2d(
    a: Vector, k: int, bn: float, bt: float, mu: float, rn: float, rt: float
) -> tuple[float, float]:
    """Return (r_N, r_T) in the plane; A is a[k], open, stick and slip are tried in this order.

    The impulse given is kept where A has no normal part to solve with.
    """
    if bn >= 0.0:
        return 0.0, 0.0
    ann, ant, atn, att = a[k, 0, 0], a[k, 0, 1], a[k, 1, 0], a[k, 1, 1]
    if ann <= 0.0:
        return rn, rt
    determinant = ann * att - ant * atn
    if determinant > 1e-14 * ann * abs(att):
        rn_stick = (ant * bt - att * bn) / determinant
        rt_stick = (atn * bn - ann * bt) / determinant
        if rn_stick >= 0.0 and abs(rt_stick) <= mu * rn_stick:
            return rn_stick, rt_stick
    for sign in (1.0, -1.0):
        slope = ann + sign * mu * ant
        if slope > 0.0:
            rn_slip = -bn / slope
            velocity = bt + (atn + sign * mu * att) * rn_slip
            if sign * velocity <= 0.0:
                return rn_slip, sign * mu * rn_slip
    return -bn / ann, 0.0


@jitable
def contact_3d(
    a: Vector, k: int, bn: float, b1: float, b2: float, mu: float, rn: float, r1: float, r2: float
) -> tuple[float, float, float]:
    """Return (r_N, r_T1, r_T2); A is a[k].

    Slip is one scalar unknown s > 0: with S = A_TT - A_TN A_NT / A_NN, c = b_T - A_TN b_N / A_NN,
    (S + s I) r_T = -c, r_N = -(b_N + A_NT r_T) / A_NN, |r_T| = mu r_N. Once stick has failed,
    |r_T| - mu r_N is positive at s = 0 and negative at infinity, so that a root is bracketed.
    Newton runs on mu r_N / |r_T| - 1, which is nearly linear in s. The impulse given is kept where
    A has no normal part to solve with or admits no solution.
    """
    if bn >= 0.0:
        return 0.0, 0.0, 0.0
    ann = a[k, 0, 0]
    if ann <= 0.0:
        return rn, r1, r2
    w1, w2 = a[k, 0, 1] / ann, a[k, 0, 2] / ann
    v1, v2 = a[k, 1, 0], a[k, 2, 0]
    s11, s12 = a[k, 1, 1] - v1 * w1, a[k, 1, 2] - v1 * w2
    s21, s22 = a[k, 2, 1] - v2 * w1, a[k, 2, 2] - v2 * w2
    height = -bn / ann
    c1, c2 = b1 + v1 * height, b2 + v2 * height
    if mu <= 0.0:
        return height, 0.0, 0.0
    determinant = s11 * s22 - s12 * s21
    if determinant > 1e-14 * abs(s11 * s22):
        x1 = (s12 * c2 - s22 * c1) / determinant
        x2 = (s21 * c1 - s11 * c2) / determinant
        n = height - w1 * x1 - w2 * x2
        if n >= 0.0 and x1 * x1 + x2 * x2 <= mu * mu * n * n:
            return n, x1, x2
    size = math.sqrt(c1 * c1 + c2 * c2)
    if size == 0.0:
        return height, 0.0, 0.0
    low, high = 0.0, -1.0
    s = size / (mu * height) - 0.5 * (s11 + s22)
    if s <= 0.0:
        s = 1e-3 * (abs(s11) + abs(s22)) + 1e-300
    x1, x2, n, length = 0.0, 0.0, height, 1.0
    for _ in range(60):
        d11, d22 = s11 + s, s22 + s
        determinant = d11 * d22 - s12 * s21
        if determinant <= 0.0:
            low = s
            s = 2.0 * s + 1e-300 if high < 0.0 else 0.5 * (low + high)
            continue
        x1 = (s12 * c2 - d22 * c1) / determinant
        x2 = (s21 * c1 - d11 * c2) / determinant
        n = height - w1 * x1 - w2 * x2
        length = math.sqrt(x1 * x1 + x2 * x2)
        value = mu * n / length - 1.0
        if abs(value) < 1e-14:
            break
        if value < 0.0:
            low = s
        else:
            high = s
        # derivatives along s: (S + s I) r_T' = -r_T
        y1 = (s12 * x2 - d22 * x1) / determinant
        y2 = (s21 * x1 - d11 * x2) / determinant
        stretch = (x1 * y1 + x2 * y2) / length
        slope = mu * (-(w1 * y1 + w2 * y2) - n * stretch / length) / length
        step = s - value / slope if slope > 0.0 else -1.0
        if step <= low or (high >= 0.0 and step >= high):
            step = 2.0 * s if high < 0.0 else 0.5 * (low + high)
        if abs(step - s) <= 1e-15 * s:
            break
        s = step
    # exactly on the cone, the normal equation kept
    e1, e2 = x1 / length, x2 / length
    slope = 1.0 + mu * (w1 * e1 + w2 * e2)
    if not slope > 1e-9:
        return rn, r1, r2  # A is not positive, and no impulse of this contact alone will do
    n = height / slope
    return n, mu * n * e1, mu * n * e2


@jitable
def contact_rolling(
    tangent: tuple[int, ...],
    rolling: tuple[int, ...],
    a: Vector,
    k: int,
    b: Vector,
    mu: float,
    mu_r: float,
    r: Vector,
    first: int,
    work: Vector,
) -> None:
    """Improve r of one contact with rolling friction in place (no closed form is known).

    Fixed point r = P_K(r - rho (u + (mu |u_T| + mu_r |u_R|) e_N)) with the step rho adapted so that
    rho |change of u| <= 0.7 |change of r| (the rule of self-adaptive projection methods).
    `work` has room for 3 d numbers.
    """
    nt, nr = len(tangent), len(rolling)
    d = 1 + nt + nr
    trace = 0.0
    for c in range(d):
        trace += a[k, c, c]
    if trace <= 0.0:
        return
    u, trial = work[:d], work[d : 3 * d]
    rho = d / trace
    for _ in range(200):
        _shifted_velocity(tangent, rolling, a, k, b, mu, mu_r, r, first, u)
        size = 0.0
        change = 0.0
        for _ in range(30):
            slide = 0.0
            roll = 0.0
            for c in range(nt):
                slide += (r[first + 1 + c] - rho * u[1 + c]) ** 2
            for c in range(nr):
                roll += (r[first + 1 + nt + c] - rho * u[1 + nt + c]) ** 2
            slide = math.sqrt(slide)
            roll = math.sqrt(roll)
            height = cone_height(r[first] - rho * u[0], slide, roll, mu, mu_r)
            turn = min(1.0, mu * height / slide) if slide > 0.0 else 1.0
            twist = min(1.0, mu_r * height / roll) if roll > 0.0 else 1.0
            trial[0] = height
            for c in range(nt):
                trial[1 + c] = turn * (r[first + 1 + c] - rho * u[1 + c])
            for c in range(nr):
                at = 1 + nt + c
                trial[at] = twist * (r[first + at] - rho * u[at])
            _shifted_velocity(tangent, rolling, a, k, b, mu, mu_r, trial, 0, trial[d:])
            change = 0.0
            moved = 0.0
            size = 0.0
            for c in range(d):
                change += (trial[c] - r[first + c]) ** 2
                moved += (trial[d + c] - u[c]) ** 2
                size += trial[c] ** 2
            ratio = rho * math.sqrt(moved) / math.sqrt(change) if change > 0.0 else 0.0
            if ratio <= 0.7:
                break
            rho *= 0.7 / ratio if ratio < 10.0 else 0.1
        for c in range(d):
            r[first + c] = trial[c]
        if change <= 1e-30 * size or size == 0.0:
            return
        if ratio < 0.3:
            rho *= 1.5


@jitable
def _shifted_velocity(
    tangent: tuple[int, ...],
    rolling: tuple[int, ...],
    a: Vector,
    k: int,
    b: Vector,
    mu: float,
    mu_r: float,
    r: Vector,
    first: int,
    u: Vector,
) -> None:
    """Write De Saxce's velocity u = A r + b + (mu |u_T| + mu_r |u_R|) e_N."""
    nt, nr = len(tangent), len(rolling)
    d = 1 + nt + nr
    for row in range(d):
        u[row] = b[row]
        for c in range(d):
            u[row] += a[k, row, c] * r[first + c]
    speed = 0.0
    spin = 0.0
    for c in range(nt):
        speed += u[1 + c] ** 2
    for c in range(nr):
        spin += u[1 + nt + c] ** 2
    u[0] += mu * math.sqrt(speed) + mu_r * math.sqrt(spin)

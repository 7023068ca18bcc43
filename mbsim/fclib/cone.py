"""Coulomb's cone of one contact: projection and natural map, with rolling friction as well.

K = {|r_T| <= mu r_N, |r_R| <= mu_r r_N}. `tangent` and `rolling` are tuples whose *lengths* are the
numbers of tangential and rolling directions, so that compiled loops over them are unrolled.
"""

from __future__ import annotations

import math

from mbsim.core.jitable import jitable


@jitable
def cone_height(normal, slide, roll, mu, mu_r):
    """Return the normal part of the projection of a point on the cone.

    `slide` and `roll` are the lengths of its tangential and rolling parts. The projection is
    (t, min(1, mu t / slide) x_T, min(1, mu_r t / roll) x_R), with t >= 0 the minimum of

        (t - normal)^2 + max(0, slide - mu t)^2 + max(0, roll - mu_r t)^2.
    """
    t = normal
    if t >= 0.0 and slide <= mu * t and roll <= mu_r * t:
        return t
    t = (normal + mu * slide) / (1.0 + mu * mu)
    if slide > mu * t and roll <= mu_r * t and t > 0.0:
        return t
    t = (normal + mu_r * roll) / (1.0 + mu_r * mu_r)
    if slide <= mu * t and roll > mu_r * t and t > 0.0:
        return t
    t = (normal + mu * slide + mu_r * roll) / (1.0 + mu * mu + mu_r * mu_r)
    return max(t, 0.0)


@jitable
def natural_map(tangent, rolling, mu, mu_r, u, r, first, rho, out):
    """Write F = r - P_K(r - rho (u + (mu |u_T| + mu_r |u_R|) e_N)) of one contact, return |F|^2.

    The contact's numbers begin at `first` in u, r and `out`.
    """
    nt, nr = len(tangent), len(rolling)
    speed = 0.0
    spin = 0.0
    for k in range(nt):
        speed += u[first + 1 + k] ** 2
    for k in range(nr):
        spin += u[first + 1 + nt + k] ** 2
    lift = mu * math.sqrt(speed)
    if nr > 0:
        lift += mu_r * math.sqrt(spin)
    normal = r[first] - rho * (u[first] + lift)
    slide = 0.0
    roll = 0.0
    for k in range(nt):
        slide += (r[first + 1 + k] - rho * u[first + 1 + k]) ** 2
    for k in range(nr):
        roll += (r[first + 1 + nt + k] - rho * u[first + 1 + nt + k]) ** 2
    slide = math.sqrt(slide)
    roll = math.sqrt(roll)
    height = cone_height(normal, slide, roll, mu, mu_r)
    turn = min(1.0, mu * height / slide) if slide > 0.0 else 1.0
    out[first] = r[first] - height
    squares = out[first] ** 2
    for k in range(nt):
        at = first + 1 + k
        out[at] = r[at] - turn * (r[at] - rho * u[at])
        squares += out[at] ** 2
    if nr > 0:
        turn = min(1.0, mu_r * height / roll) if roll > 0.0 else 1.0
        for k in range(nr):
            at = first + 1 + nt + k
            out[at] = r[at] - turn * (r[at] - rho * u[at])
            squares += out[at] ** 2
    return squares


@jitable
def residual(tangent, rolling, mu, mu_r, u, r, out):
    """Write the natural map (rho = 1) of every contact and return its Euclidean norm."""
    d = 1 + len(tangent) + len(rolling)
    total = 0.0
    for a in range(len(mu)):
        total += natural_map(tangent, rolling, mu[a], mu_r[a], u, r, d * a, 1.0, out)
    return math.sqrt(total)


@jitable
def norm(vector):
    """Return the Euclidean norm."""
    total = 0.0
    for k in range(len(vector)):
        total += vector[k] * vector[k]
    return math.sqrt(total)


@jitable
def relative_errors(tangent, rolling, mu, mu_r, q, u, r, work):
    """Return the error |F| / max(|q|, |r|, |u|) and |F| / |q|; not divided by a scale of 0."""
    missing = residual(tangent, rolling, mu, mu_r, u, r, work)
    bound = norm(q)
    scale = max(bound, norm(r), norm(u))
    error = missing / scale if scale > 0.0 else missing
    return error, (missing / bound if bound > 0.0 else missing)


@jitable
def count_changes(tangent, mu, r, states):
    """Write whether contacts are open (0), stick (1) or slip (2); return how many were not before.

    Solvers that project on the cone leave impulses of slipping contacts on its edge.
    """
    d = 1 + len(tangent)
    changed = 0
    for a in range(len(mu)):
        first = d * a
        square = 0.0
        for k in range(len(tangent)):
            square += r[first + 1 + k] ** 2
        state = 0
        if r[first] > 0.0:
            state = 1 if math.sqrt(square) < (1.0 - 1e-6) * mu[a] * r[first] else 2
        if states[a] != state:
            changed += 1
        states[a] = state
    return changed

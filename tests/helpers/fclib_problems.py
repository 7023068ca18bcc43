"""Small problems of contact, and what they are by full matrices."""

from __future__ import annotations

import numpy as np

from mbsim.fclib.problem import Global, Local, matrix


def some_local(nc, d=3, seed=0, mu=0.4):
    """Return a problem with a regular W of contacts in a row, each coupled with its neighbours."""
    rng = np.random.default_rng(seed)
    m = d * nc
    w = np.zeros((m, m))
    for a in range(nc + 1):
        rows = slice(max(0, d * (a - 1)), min(m, d * (a + 1)))
        half = rng.normal(size=(rows.stop - rows.start, 6))
        w[rows, rows] += half @ half.T
    return Local(d, matrix(w), rng.normal(size=m) - 0.5, np.full(nc, mu))


def wedge():
    """Return two contacts that press on each other: no finite impulses keep both from closing."""
    w = np.zeros((6, 6))
    w[np.ix_([0, 3], [0, 3])] = [[1.0, -1.0], [-1.0, 1.0]]
    w[[1, 2, 4, 5], [1, 2, 4, 5]] = 1.0
    return Local(3, matrix(w), np.array([-1.0, 0, 0, -1.0, 0, 0]), np.full(2, 0.3))


def some_global(equalities=0):
    rng = np.random.default_rng(4)
    mass = np.kron(np.diag(rng.uniform(1, 2, 4)), np.eye(3))
    return Global(
        3,
        matrix(mass, "triplet"),
        matrix(rng.normal(size=(12, 6)), "triplet"),
        rng.normal(size=12),
        rng.normal(size=6),
        np.full(2, 0.4),
        matrix(rng.normal(size=(12, equalities)), "triplet") if equalities else None,
        rng.normal(size=equalities) if equalities else None,
    )


def dense(problem):
    """Return W and q after condensation and elimination, by full matrices."""
    m, h = problem.M.csr().toarray(), problem.H.csr().toarray()
    inverse = np.linalg.inv(m)
    w, q = h.T @ inverse @ h, h.T @ inverse @ problem.f + problem.w
    if problem.G is None:
        return w, q
    g = problem.G.csr().toarray()
    v, r = h.T @ inverse @ g, g.T @ inverse @ g
    s = g.T @ inverse @ problem.f + problem.b
    return w - v @ np.linalg.solve(r, v.T), q - v @ np.linalg.solve(r, s)


def rolling_heap(count, mu, mu_r, seed):
    """Return a heap of spheres of 0.05 m after a step of 10 ms, with friction against rolling.

    Contacts are where spheres of radii 0.7 to 1.3 times that touch, which were pushed apart from a
    dense random place above the floor; velocities are at random.
    """
    rng = np.random.default_rng(seed)
    radius = 0.05 * rng.uniform(0.7, 1.3, count)
    side = 0.1 * (0.86 * count) ** (1.0 / 3.0)
    x = rng.uniform(0.0, side, (count, 3))
    first, second = np.triu_indices(count, 1)
    wide = radius[first] + radius[second]
    for _ in range(400):
        x[:, 2] -= 1e-3
        line = x[first] - x[second]
        apart = np.linalg.norm(line, axis=1) + 1e-12
        push = 0.4 * np.maximum(wide - apart, 0.0)[:, None] * line / apart[:, None]
        np.add.at(x, first, push)
        np.add.at(x, second, -push)
        x[:, 2] = np.maximum(x[:, 2], radius)
        x[:, :2] = np.clip(x[:, :2], 0.0, side)
    line = x[first] - x[second]
    apart = np.linalg.norm(line, axis=1)
    touching = np.flatnonzero(apart < wide + 2e-3)
    pairs = [(first[k], second[k], line[k] / apart[k]) for k in touching]
    up = np.array([0.0, 0.0, 1.0])
    pairs += [(k, -1, up) for k in range(count) if x[k, 2] < radius[k] + 2e-3]
    h = np.zeros((6 * count, 5 * len(pairs)))
    for k, (i, j, n) in enumerate(pairs):
        across = np.linalg.svd(n[None])[2][1:]
        axes = np.vstack([n, across])
        for body, sign in ((i, 1.0), (j, -1.0)):
            if body >= 0:
                arm = -sign * radius[body] * n
                h[6 * body : 6 * body + 3, 5 * k : 5 * k + 3] = sign * axes.T
                h[6 * body + 3 : 6 * body + 6, 5 * k : 5 * k + 3] = sign * np.cross(arm, axes).T
                h[6 * body + 3 : 6 * body + 6, 5 * k + 3 : 5 * k + 5] = sign * across.T
    mass = 4000.0 * radius**3
    inertia = 0.4 * mass * radius**2
    weights = np.column_stack([mass, mass, mass, inertia, inertia, inertia]).ravel()
    v = 0.05 * rng.normal(size=6 * count)
    v[2::6] -= 0.0981
    friction, rolling = np.full(len(pairs), mu), np.full(len(pairs), mu_r)
    return Global(
        5, matrix(np.diag(weights), "triplet"), matrix(h, "triplet"), weights * v,
        np.zeros(h.shape[1]), friction, mu_r=rolling,
    )  # fmt: skip

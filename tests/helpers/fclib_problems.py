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

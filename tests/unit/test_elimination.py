"""Orders of elimination, and sparse factors against dense ones."""

from __future__ import annotations

import numpy as np
import pytest

from mbsim.compile_model import elimination
from mbsim.compile_model.elimination import coupled, eliminate, pattern, products
from mbsim.dynamics.loops import sparse_factor

RANDOM = np.random.default_rng(3)
#: Chain, ring, star and a net, by what belongs together.
GROUPS = {
    "chain": [(k, k + 1) for k in range(9)],
    "ring": [(k, (k + 1) % 10) for k in range(10)],
    "star": [(0, k) for k in range(1, 10)],
    "net": [(3 * i + j, 3 * i + j + d) for i in range(3) for j in range(3) for d in (1, 3)][:-2],
}


@pytest.mark.parametrize("kind", GROUPS)
def test_a_sparse_factor_solves_what_a_dense_one_does(kind):
    groups = [group for group in GROUPS[kind] if max(group) < 10]
    n = 1 + max(map(max, groups))
    rows = [int(m) for m in RANDOM.integers(1, 7, n)]
    order = eliminate(coupled(groups, n), rows)
    assert sorted(order.order) == list(range(n))
    place = order.place
    meets = [(place[a], place[b], 0, 0) for group in groups for a in group for b in group]
    P = pattern(order, meets)
    P.size[:] = [rows[k] for k in order.order]
    starts = np.concatenate([[0], np.cumsum(P.size)])
    A = np.zeros((starts[-1], starts[-1]))
    for i, j, _, _ in meets:
        part = RANDOM.standard_normal((P.size[i], P.size[j]))
        A[starts[i] : starts[i + 1], starts[j] : starts[j + 1]] += part
    A = A @ np.eye(len(A)) + A.T + 40.0 * np.eye(len(A))
    sparse_factor.clear(P)
    for k in range(n):
        P.block[k, : P.size[k], : P.size[k]] = A[
            starts[k] : starts[k + 1], starts[k] : starts[k + 1]
        ]
        for p in range(P.first[k], P.first[k + 1]):
            i = P.row[p]
            P.block[n + p, : P.size[i], : P.size[k]] = A[
                starts[i] : starts[i + 1], starts[k] : starts[k + 1]
            ]
    right = RANDOM.standard_normal(len(A))
    for k in range(n):
        P.x[k, : P.size[k]] = right[starts[k] : starts[k + 1]]
    at = 0
    for k in range(n):
        sparse_factor.factor_diagonal(P.block[k], P.size[k])
        at = sparse_factor.eliminate(P, k, at)
    assert at == len(P.target)
    sparse_factor.solve_factored(P)
    found = np.concatenate([P.x[k, : P.size[k]] for k in range(n)])
    np.testing.assert_allclose(found, np.linalg.solve(A, right), rtol=0, atol=1e-13)


def test_an_infinite_pivot_leaves_its_row_out():
    order = eliminate(coupled([(0, 1)], 2), [2, 2])
    P = pattern(order, [(0, 0, 0, 0), (1, 1, 0, 0), (1, 0, 0, 0)])
    P.size[:] = 2
    A = np.diag([4.0, 3.0, 5.0, 6.0]) + 0.5
    sparse_factor.clear(P)
    P.block[0, :2, :2], P.block[1, :2, :2], P.block[2, :2, :2] = A[:2, :2], A[2:, 2:], A[2:, :2]
    sparse_factor.factor_diagonal(P.block[0], 2)
    P.block[0, 1, 1] = np.inf
    at = sparse_factor.eliminate(P, 0, 0)
    sparse_factor.factor_diagonal(P.block[1], 2)
    sparse_factor.eliminate(P, 1, at)
    P.x[:, :2] = [(1.0, 2.0), (3.0, 4.0)]
    sparse_factor.solve_factored(P)
    left = np.ix_([0, 2, 3], [0, 2, 3])
    expected = np.linalg.solve(A[left], [1.0, 3.0, 4.0])
    np.testing.assert_allclose(P.x[:, :2].ravel(), [expected[0], 0.0, *expected[1:]], atol=1e-15)


def test_what_comes_after_others_does():
    near = coupled([(k, k + 1) for k in range(19)], 20)
    after = [set(range(k + 1, 20)) if k < 3 else set() for k in range(20)]
    order = eliminate(near, [1] * 20, after).order
    assert order[-3:] == [2, 1, 0]


@pytest.mark.parametrize("kind", ["chain", "ring"])
def test_factors_of_chains_grow_with_their_length(kind):
    counts = []
    for n in (50, 100, 200):
        groups = [(k, (k + 1) % n) for k in range(n if kind == "ring" else n - 1)]
        counts.append(products(eliminate(coupled(groups, n), [5] * n), [5] * n))
    assert counts[1] < 2.1 * counts[0]
    assert counts[2] < 2.1 * counts[1]


def test_a_factor_that_fills_in_too_much_is_none(monkeypatch):
    near = coupled([tuple(range(30))], 30)
    assert eliminate(near, [1] * 30) is not None
    monkeypatch.setattr(elimination, "MOST_UPDATES", 1000)
    assert eliminate(near, [1] * 30) is None

"""The error, MERIT_1 and the figures without scales, against closed forms and libfclib."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from helpers.fclib_folder import problem_file
from helpers.fclib_problems import dense, some_global
from mbsim.fclib import hdf5
from mbsim.fclib.cone import cone_height
from mbsim.fclib.merit import OPEN, SLIP, STICK, completed, judge
from mbsim.fclib.problem import Global, Local, Solution, matrix
from mbsim.fclib.reduction import globalised, local, reduce, times

MU = 0.5


def one_contact(q, mass=1.0):
    return Local(3, matrix(mass * np.eye(3)), np.array(q, dtype=float), np.array([MU]))


def natural_map(u, r, mu):
    """Return F of contacts in 3D, written anew with NumPy."""
    u, r = u.reshape(-1, 3), r.reshape(-1, 3)
    x = r - u
    x[:, 0] -= mu * np.linalg.norm(u[:, 1:], axis=1)
    p = np.zeros_like(x)
    for a, (n, *t) in enumerate(x):
        size = math.hypot(*t)
        if size <= mu[a] * n:
            p[a] = x[a]
        elif mu[a] * size > -n:
            height = (mu[a] * size + n) / (1 + mu[a] ** 2)
            p[a] = height, *(mu[a] * height * np.array(t) / size)
    return (r - p).ravel()


def test_an_exact_sliding_contact_has_no_error_and_slips():
    # m u = r + m q: the normal impulse stops the fall, friction brakes along -x
    q = np.array([-1.0, 3.0, 0.0])
    r = np.array([1.0, -MU, 0.0])
    figures = judge(one_contact(q), Solution(np.zeros(3), r))
    assert figures.error < 1e-15
    assert figures.states.tolist() == [SLIP]
    assert figures.max_cone_violation == 0.0
    assert figures.complementarity < 1e-15
    assert figures.max_impulse == pytest.approx(math.hypot(1.0, MU))


@pytest.mark.parametrize(
    ("q", "r", "state"),
    [
        ([1.0, 2.0, 0.0], [0.0, 0.0, 0.0], OPEN),
        ([-1.0, 0.2, 0.1], [1.0, -0.2, -0.1], STICK),
    ],
)
def test_open_and_sticking_contacts_have_no_error(q, r, state):
    figures = judge(one_contact(q), Solution(np.zeros(3), np.array(r)))
    assert figures.error < 1e-15
    assert figures.states.tolist() == [state]


def test_a_pulling_impulse_is_outside_the_cone():
    # the published page has |r_N| in the cone, which would allow it
    figures = judge(one_contact([1.0, 0.0, 0.0]), Solution(np.zeros(3), np.array([-1.0, 0.1, 0.0])))
    assert figures.max_cone_violation == pytest.approx(1.0 / math.hypot(1.0, 0.1))
    assert figures.error > 0.1


def test_error_and_merit_follow_their_definitions():
    rng = np.random.default_rng(3)
    w = matrix(rng.normal(size=(9, 9)))
    problem = Local(3, w, rng.normal(size=9), np.array([0.3, 0.5, 0.0]))
    r = rng.normal(size=9)
    u = times(w, r) + problem.q
    missing = np.linalg.norm(natural_map(u.copy(), r.copy(), problem.mu))
    figures = judge(problem, Solution(u, r))
    size = np.linalg.norm(problem.q)
    assert figures.error == pytest.approx(
        missing / max(size, np.linalg.norm(r), np.linalg.norm(u)), rel=1e-13
    )
    assert figures.error_q == pytest.approx(missing / size, rel=1e-13)
    assert figures.merit1 == pytest.approx(missing / (1 + math.sqrt(size)), rel=1e-13)
    assert figures.merit1_corrected == pytest.approx(missing / (1 + size), rel=1e-13)


def test_penetration_is_in_units_of_u_and_as_a_share():
    figures = judge(one_contact([-4.0, 0.0, 0.0]), Solution(np.zeros(3), np.array([1.0, 0, 0])))
    assert figures.max_penetration_velocity == pytest.approx(3.0)
    assert figures.relative_penetration == pytest.approx(0.75)


def test_all_zero_data_divide_by_nothing():
    figures = judge(one_contact([0.0, 0.0, 0.0]), Solution(np.zeros(3), np.zeros(3)))
    assert (figures.error, figures.error_q, figures.merit1) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("point", [(1.0, 0.2, 0.1), (-1.0, 0.2, 3.0), (0.2, 2.0, 0.0),
                                   (0.2, 0.0, 2.0), (0.1, 2.0, 3.0), (-9.0, 1.0, 1.0)])  # fmt: skip
def test_the_height_on_the_rolling_cone_is_the_minimum_of_the_distance(point):
    normal, slide, roll = point
    mu, mu_r = 0.5, 0.2

    def distance(t):
        return (
            (t - normal) ** 2 + np.maximum(0, slide - mu * t) ** 2
            + np.maximum(0, roll - mu_r * t) ** 2
        )  # fmt: skip

    t = np.linspace(0, 5, 200001)
    best = t[np.argmin(distance(t))]
    assert cone_height(normal, slide, roll, mu, mu_r) == pytest.approx(best, abs=5e-5)


def test_merit_equals_libfclib_where_that_is_right(libfclib, tmp_path):
    # libfclib multiplies with W, V and R only where they are compressed columns
    rng = np.random.default_rng(5)
    problem = hdf5.read(problem_file("Capsules-i125-1213")).problem
    stored = replace(problem, W=matrix(problem.W.csr(), "csc"))
    r = rng.uniform(0, 1e-2, len(problem.q))
    solution = Solution(np.zeros_like(r), r)
    hdf5.write(tmp_path / "p.hdf5", stored, solution)
    (theirs,) = libfclib("local", tmp_path / "p.hdf5", "solution")["merit"]
    assert judge(stored, solution).merit1 == pytest.approx(theirs, rel=1e-12)


def test_merit_with_equality_constraints_equals_libfclib(libfclib, tmp_path):
    rng = np.random.default_rng(6)
    full = rng.normal(size=(8, 8))
    problem = Local(
        3,
        matrix(full[:6, :6], "csc"),
        rng.normal(size=6),
        np.full(2, 0.4),
        matrix(full[:6, 6:], "csc"),
        matrix(full[6:, 6:], "csc"),
        rng.normal(size=2),
    )
    solution = Solution(np.zeros(6), rng.normal(size=6), l=rng.normal(size=2))
    hdf5.write(tmp_path / "p.hdf5", problem, solution)
    (theirs,) = libfclib("local", tmp_path / "p.hdf5", "solution")["merit"]
    assert judge(problem, solution).merit1 == pytest.approx(theirs, rel=1e-12)


def test_libfclib_leaves_out_compressed_rows_and_we_do_not(libfclib, tmp_path):
    rng = np.random.default_rng(7)
    w, q = rng.normal(size=(6, 6)), rng.normal(size=6)
    problem = Local(3, matrix(w, "csr"), q, np.full(2, 0.4))
    solution = Solution(np.zeros(6), np.array([9.0, 1.0, 2.0, 8.0, 0.0, -1.0]))
    hdf5.write(tmp_path / "p.hdf5", problem, solution)
    (theirs,) = libfclib("local", tmp_path / "p.hdf5", "solution")["merit"]
    without = replace(problem, W=matrix(np.zeros((6, 6))))
    assert judge(without, solution).merit1 == pytest.approx(theirs, rel=1e-12)
    assert judge(problem, solution).merit1 != pytest.approx(theirs, rel=1e-3)


def full(blocks):
    from scipy import sparse

    return sparse.bsr_array((blocks.val, blocks.col, blocks.ptr)).toarray()


@pytest.mark.parametrize("equalities", [0, 2])
def test_condensation_and_elimination_equal_full_matrices(equalities):
    problem = some_global(equalities)
    blocks = reduce(problem)
    w, q = dense(problem)
    assert np.allclose(full(blocks), w, atol=1e-13)
    assert np.allclose(blocks.q, q, atol=1e-13)
    # the way back: any r gives v, l and u that fulfil the linear equations
    found = completed(problem, np.arange(6.0), blocks)
    assert np.allclose(found.u, w @ np.arange(6.0) + q)
    figures = judge(problem, found, blocks)
    assert figures.dynamics < 1e-14
    assert figures.equalities < 1e-14


@pytest.mark.parametrize("equalities", [0, 2])
def test_a_global_problem_condenses_to_a_local_one_with_the_same_blocks(equalities):
    problem = some_global(equalities)
    condensed = local(problem)
    assert condensed.equalities == equalities
    one, other = reduce(problem), reduce(condensed)
    assert np.allclose(full(one), full(other), atol=1e-13)
    assert np.allclose(one.q, other.q, atol=1e-13)


def test_a_local_problem_with_regular_w_has_a_global_form():
    rng = np.random.default_rng(9)
    half = rng.normal(size=(6, 6))
    problem = Local(3, matrix(half @ half.T + np.eye(6)), rng.normal(size=6), np.full(2, 0.4))
    back = local(globalised(problem))
    assert np.allclose(back.W.csr().toarray(), problem.W.csr().toarray())
    assert np.allclose(back.q, problem.q)


def test_redundant_equality_constraints_are_eliminated_too():
    problem = some_global(2)
    g = problem.G.csr().toarray()
    doubled = replace(
        problem, G=matrix(np.hstack((g, g[:, :1])), "triplet"), b=np.append(problem.b, problem.b[0])
    )
    assert np.allclose(full(reduce(doubled)), full(reduce(problem)), atol=1e-9)


def test_a_large_elastic_part_is_condensed_as_a_sparse_matrix():
    rng = np.random.default_rng(10)
    n = 90
    chain = np.diag(np.full(n, 3.0)) - np.diag(np.ones(n - 3), 3) - np.diag(np.ones(n - 3), -3)
    h = np.zeros((n, 6))
    h[:6] = rng.normal(size=(6, 6))
    problem = Global(
        3, matrix(chain, "triplet"), matrix(h, "triplet"), rng.normal(size=n), np.zeros(6),
        np.full(2, 0.4),
    )  # fmt: skip
    w, q = dense(problem)
    blocks = reduce(problem)
    assert np.allclose(full(blocks), w, atol=1e-13)
    assert np.allclose(blocks.q, q, atol=1e-13)
    assert judge(problem, completed(problem, np.ones(6), blocks), blocks).dynamics < 1e-14

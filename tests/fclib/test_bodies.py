"""Problems of rigid bodies in their velocities: which they are, sweeps, Newton, plain arrays."""

from __future__ import annotations

import importlib.util

import numpy as np
import pytest
from scipy import sparse
from scipy.spatial import cKDTree

from helpers.folders import data_file
from mbsim.core import jit
from mbsim.errors import ModelError
from mbsim.fclib.bodies.factors import newton_work
from mbsim.fclib.bodies.solve import solve_contacts
from mbsim.fclib.merit import judge
from mbsim.fclib.problem import Global, Solution, matrix
from mbsim.fclib.reduction import local, reduce
from mbsim.fclib.solve import solve
from mbsim.stepping.solver import SWEEP_WORK


def pile(bodies, contacts, d=3, seed=0, size=6):
    """Return a global problem: random blocks of H, a diagonal M as spheres have, w = H' v."""
    rng = np.random.default_rng(seed)
    h = np.zeros((size * bodies, d * contacts))
    pairs = np.full((contacts, 2), -1, np.int32)
    for a in range(contacts):
        one = a % bodies
        pairs[a, 0] = one
        columns = slice(d * a, d * a + d)
        h[size * one : size * one + size, columns] = rng.normal(size=(size, d))
        other = int(rng.integers(-1, bodies))
        if other not in (-1, one):
            pairs[a, 1] = other
            h[size * other : size * other + size, columns] = rng.normal(size=(size, d))
    masses = rng.uniform(0.5, 2.0, size * bodies)
    f = masses * rng.normal(size=size * bodies)
    mu_r = np.full(contacts, 0.05) if d == 5 else None
    problem = Global(
        d, matrix(np.diag(masses), "triplet"), matrix(h, "triplet"), f, np.zeros(d * contacts),
        np.full(contacts, 0.4), mu_r=mu_r,
    )  # fmt: skip
    return problem, masses, h, pairs


def blocks_of(h, pairs, bodies):
    """Return H by contacts and sides (contacts, 2, 3, 6)."""
    found = np.zeros((len(pairs), 2, 3, 6))
    for a, pair in enumerate(pairs):
        for side, b in enumerate(pair):
            if b >= 0:
                found[a, side] = h[6 * b : 6 * b + 6, 3 * a : 3 * a + 3].T
    return found


@pytest.mark.parametrize(
    ("d", "solver"),
    [
        (3, "AUTO"),
        (3, "NSGS"),
        (5, "NSGS"),
        # what they solve is as large: a minute in all
        *(
            pytest.param(d, s, marks=pytest.mark.slow)
            for d, s in ((3, "PROX"), (5, "AUTO"), (5, "PROX"))
        ),
    ],
)
def test_piles_are_solved_in_their_bodies_velocities(solver, d):
    problem, *_ = pile(40, 110, d, seed=1) if d == 3 else pile(6, 15, d, seed=1)
    assert reduce(problem).rigid is not None
    result = solve(problem, 1e-8, solver)
    assert result.status == "solved"
    assert judge(problem, result.solution).error <= 1e-8
    assert judge(local(problem), Solution(result.u, result.r)).scale_free <= 1e-7


def test_bodies_are_told_from_what_is_no_body():
    problem, *_ = pile(4, 100)
    system, bodies = reduce(problem).rigid
    assert len(bodies.number) == 4
    assert system.own.shape == (100, 3, 3)
    # three bodies at one contact
    h = problem.H.csr().toarray()
    h[0, 0] = h[6, 0] = h[12, 0] = 1.0
    three = Global(3, problem.M, matrix(h, "triplet"), problem.f, problem.w, problem.mu)
    assert reduce(three).rigid is None
    # one elastic body of 24 unknowns
    full = sparse.csr_array(np.eye(24) + 0.01)
    elastic = Global(3, matrix(full, "triplet"), problem.H, problem.f, problem.w, problem.mu)
    assert reduce(elastic).rigid is None
    assert solve(elastic, 1e-8).status == "solved"


def test_rolling_friction_without_bodies_has_no_newton():
    problem, *_ = pile(4, 12, 5)
    full = matrix(np.eye(24) + 0.01, "triplet")
    elastic = Global(5, full, problem.H, problem.f, problem.w, problem.mu, mu_r=problem.mu_r)
    with pytest.raises(ModelError, match="not for rolling friction"):
        solve(elastic, 1e-8, "PROX")


def test_arrays_in_and_impulses_out():
    problem, masses, h, pairs = pile(8, 20, seed=3)
    inverse = np.zeros((9, 6, 6))  # the last one is not moved
    for b in range(8):
        inverse[b] = np.diag(1.0 / masses[6 * b : 6 * b + 6])
    blocks = blocks_of(h, pairs, 8)
    pairs[pairs[:, 1] < 0, 1] = 8
    whole = local(problem)
    w, r = whole.q.reshape(-1, 3).copy(), np.zeros((20, 3))
    run = jit.function(solve_contacts)
    error, free, speed, sweeps, _ = run(inverse, pairs, blocks, problem.mu, w, r, 1e-10, 30, 200)
    assert error <= 1e-10
    assert max(free, speed) <= 1e-9
    assert sweeps > 0
    figures = judge(whole, Solution(np.zeros(60), r.reshape(-1)))
    assert figures.error <= 1e-10
    assert figures.scale_free == pytest.approx(free, rel=0.1, abs=1e-13)
    # a warm start needs nothing
    again = run(inverse, pairs, blocks, problem.mu, w, r, 1e-9, 30, 200)
    assert again[3:] == (0, 0)
    # nor does a system without contacts
    none = run(inverse, pairs[:0], blocks[:0], problem.mu[:0], w[:0], r[:0], 1e-9, 30, 200)
    assert none[0] == 0.0


# bodies of three unknowns are compiled for this test alone: half a minute
@pytest.mark.slow
def test_bodies_in_the_plane_have_three_unknowns():
    problem, *_ = pile(40, 110, 2, seed=4, size=3)
    assert len(reduce(problem).rigid[1].number) == 40
    assert solve(problem, 1e-9).status == "solved"


def case(name):
    """Return a problem of `contact_problems.py` as it is given, and globally."""
    path = data_file("found/contact_problems.py")
    spec = importlib.util.spec_from_file_location("contact_problems", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    made = dict(module.cases())[name]()
    mass, h = made["M"], made["H"]
    return Global(
        3, matrix(sparse.diags_array(mass), "triplet"), matrix(h, "triplet"), mass * made["v"],
        np.zeros(h.shape[1]), made["mu"],
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["arch21", "wall10x6", "tower100_k16", "spheres200", "boxpile100", "boxpile300_mu1.5"]
)
def test_piles_come_to_1e_4(name):
    result = solve(case(name), 1e-4, max_seconds=60.0)
    assert result.status == "solved"


def column_of(count):
    """Return the bodies of each contact in a column of cubes: four corners on the one below."""
    return [(k, k - 1) for k in range(count) for _ in range(4)], count


def pyramid_of(layers):
    """Return those in a pyramid: each cube lies with two corners on either of two, or on ground."""
    number = {}
    for row in range(layers):
        for place in range(layers - row):
            number[row, place] = len(number)
    pairs = []
    for (row, place), body in number.items():
        below = [number[row - 1, place + side] for side in range(2)] if row else [-1, -1]
        pairs += [(body, other) for other in below for _ in range(4)]
    return pairs, len(number)


def heap_of(count, touching):
    """Return those in a heap of spheres at random places that touch so many others each."""
    places = np.random.default_rng(0).random((count, 3))
    # n spheres of radius d/2 at random places have n^2 / 2 * 4/3 pi d^3 pairs in a unit cube
    d = (1.5 * touching / (2.0 * np.pi * count)) ** (1.0 / 3.0)
    near = cKDTree(places).query_pairs(d)
    return sorted(near) + [(k, -1) for k in range(count // 5)], count


@pytest.mark.parametrize(
    ("pile", "least", "most"),
    [
        (column_of(10), 7, 9),
        (column_of(100), 7, 9),
        (pyramid_of(10), 8, 9),
        (pyramid_of(20), 11, 12),
        (heap_of(300, 4), 14, 15),
        (heap_of(1000, 4), 16, 17),
        (heap_of(1000, 6), 33, 34),
    ],
)
def test_what_newton_costs_tells_columns_from_heaps(pile, least, most):
    """In sweeps of MOREAU's solver: it is by factors' fill, and nothing is factorised for it."""
    pairs, count = pile
    bodies = np.array(pairs, dtype=np.int64)
    work = jit.function(newton_work)(bodies, count) / (SWEEP_WORK * len(bodies))
    assert least < work < most

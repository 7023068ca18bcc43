"""Solvers: one-contact closed forms, every solver on what it can take, honest failure."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from helpers.fclib_folder import NAMES, problem_file
from helpers.fclib_problems import rolling_heap, some_local, wedge
from mbsim.core import jit
from mbsim.errors import ModelError
from mbsim.fclib import clock, condensation, factor, hdf5, ordering
from mbsim.fclib.cone import count_changes
from mbsim.fclib.merit import SLIP, STICK, judge
from mbsim.fclib.one_contact import contact_2d, contact_3d, contact_rolling
from mbsim.fclib.problem import Global, Local, Solution, matrix
from mbsim.fclib.reduction import reduce
from mbsim.fclib.solve import solve
from mbsim.fclib.solvers import newton, proximal, splitting, sweeps
from mbsim.fclib.solvers.catalog import SOLVERS
from mbsim.fclib.solvers.task import Task

COULOMB = ("AUTO", "NSGS", "PROX", "ADMM", "NSN")


def law_error(a, b, mu, r):
    """Return the natural map of one contact."""
    problem = Local(len(b), matrix(a), np.asarray(b, float), np.array([mu]))
    return judge(problem, Solution(np.zeros(len(b)), np.asarray(r, float))).error


def test_one_contact_in_3d_is_solved_exactly_compiled_or_not():
    rng = np.random.default_rng(1)
    compiled = jit.function(contact_3d)
    for _ in range(100):
        half = rng.normal(size=(3, 3))
        a = (half @ half.T + 0.1 * np.eye(3) + 0.02 * rng.normal(size=(3, 3)))[None]
        b = rng.normal(size=3)
        mu = rng.uniform(0.0, 1.0)
        r = contact_3d(a, 0, *b, mu, 0.0, 0.0, 0.0)
        assert law_error(a[0], b, mu, r) < 1e-12
        assert compiled(a, 0, *b, mu, 0.0, 0.0, 0.0) == pytest.approx(r, rel=1e-10, abs=1e-12)


def test_one_contact_in_the_plane_is_solved_exactly():
    rng = np.random.default_rng(2)
    for _ in range(100):
        half = rng.normal(size=(2, 2))
        a = (half @ half.T + 0.05 * np.eye(2))[None]
        b = rng.normal(size=2)
        mu = rng.uniform(0.0, 0.3)
        r = contact_2d(a, 0, *b, mu, 0.0, 0.0)
        assert law_error(a[0], b, mu, r) < 1e-12


def test_one_contact_with_rolling_friction_converges():
    rng = np.random.default_rng(3)
    half = rng.normal(size=(5, 5))
    a = (half @ half.T + np.eye(5))[None]
    b = np.array([-2.0, 1.0, 0.3, 0.5, -0.7])
    r, work = np.zeros(5), np.zeros(15)
    for _ in range(10):
        contact_rolling((0, 0), (0, 0), a, 0, b, 0.4, 0.1, r, 0, work)
    problem = Local(5, matrix(a[0]), b, np.array([0.4]), mu_r=np.array([0.1]))
    assert judge(problem, Solution(np.zeros(5), r)).error < 1e-12


@pytest.mark.parametrize("d", [2, 3])
def test_factors_solve_what_full_matrices_solve(d):
    blocks = reduce(some_local(30, d))
    nc = blocks.contacts
    analysis = jit.function(ordering.analyse)(nc, blocks.ptr, blocks.col, d)
    back = jit.function(factor.transposed_places)(nc, blocks.ptr, blocks.col)
    factors = factor.room_for_factors(analysis, d * nc)
    jit.function(factor.factorise)(
        d, blocks.ptr, blocks.col, back, blocks.val, analysis, factors, clock.unlimited()
    )
    x = blocks.q.copy()
    jit.function(factor.solve)(d, analysis, factors, x)
    w = some_local(30, d).W.csr().toarray()
    assert np.allclose(w @ x, blocks.q, atol=1e-9)
    # every node is eliminated once
    pivots = analysis.pivots
    assert sum(pivots) == nc
    assert sorted(analysis.rank) == sorted(np.repeat(np.arange(len(pivots)), pivots))


@pytest.mark.parametrize("solver", COULOMB)
@pytest.mark.parametrize(("d", "nc"), [(2, 4), (3, 1), (3, 30), (3, 80)])
def test_every_solver_solves_and_says_so(solver, d, nc):
    problem = some_local(nc, d, mu=0.3)
    result = solve(problem, 1e-8, solver)
    assert result.status == "solved"
    figures = judge(problem, Solution(np.zeros_like(result.r), result.r))
    assert figures.error <= 1e-8
    assert figures.error == pytest.approx(result.error, rel=1e-6, abs=1e-14)
    assert result.solve_s > 0.0
    assert result.iterations == 0 or len(result.history) > 0


@pytest.mark.parametrize("storage", ["csr", "csc", "triplet"])
def test_storage_does_not_matter(storage):
    problem = some_local(5)
    stored = Local(3, matrix(problem.W.csr(), storage), problem.q, problem.mu)
    assert np.allclose(solve(stored, 1e-12).r, solve(problem, 1e-12).r, atol=1e-9)


@pytest.mark.parametrize("equalities", [0, 2])
@pytest.mark.parametrize("solver", ["AUTO", "NSGS", "ADMM"])
def test_global_problems_with_and_without_equality_constraints(equalities, solver):
    rng = np.random.default_rng(4)
    problem = Global(
        3,
        matrix(np.diag(rng.uniform(1, 2, 12)), "triplet"),
        matrix(rng.normal(size=(12, 6)), "triplet"),
        rng.normal(size=12),
        rng.normal(size=6),
        np.full(2, 0.4),
        matrix(rng.normal(size=(12, equalities)), "triplet") if equalities else None,
        rng.normal(size=equalities) if equalities else None,
    )
    result = solve(problem, 1e-9, solver)
    assert result.status == "solved"
    figures = judge(problem, result.solution)
    assert figures.error <= 1e-9
    assert figures.equalities < 1e-12
    assert 0.0 < result.condense_s <= result.solve_s


@pytest.mark.parametrize("solver", ["AUTO", "NSGS", "ADMM"])
@pytest.mark.parametrize("d", [3, 5])
def test_rolling_friction_in_the_plane_and_in_space(solver, d):
    rng = np.random.default_rng(5)
    half = rng.normal(size=(2 * d, 2 * d))
    problem = Local(
        d, matrix(half @ half.T + np.eye(2 * d)), rng.normal(size=2 * d) - 1.0, np.full(2, 0.4),
        mu_r=np.full(2, 0.1),
    )  # fmt: skip
    result = solve(problem, 1e-8, solver)
    assert result.status == "solved"
    assert judge(problem, result.solution).error <= 1e-8


def test_newton_refuses_rolling_friction_and_unknown_names_are_refused():
    rolling = Local(5, matrix(np.eye(5)), np.zeros(5), np.ones(1), mu_r=np.ones(1))
    with pytest.raises(ModelError, match="not for rolling friction"):
        solve(rolling, 1e-8, "PROX")
    with pytest.raises(ModelError, match="no such solver"):
        solve(some_local(1), 1e-8, "MAGIC")
    assert set(COULOMB) == set(SOLVERS)


def test_a_sliding_block_comes_out_as_the_closed_form_says():
    # mass m falling at 1 and sliding at 3: u_N = 0, u_T = 3 - mu
    problem = Local(3, matrix(np.eye(3)), np.array([-1.0, 3.0, 0.0]), np.array([0.5]))
    result = solve(problem, 1e-12)
    assert result.r == pytest.approx([1.0, -0.5, 0.0])
    assert result.u == pytest.approx([0.0, 2.5, 0.0])
    assert result.figures.states.tolist() == [SLIP]


def test_a_singular_w_is_solved_without_changing_it():
    # one block on four corners: four contacts with six degrees of freedom
    corners = np.array([[1, 1], [1, -1], [-1, 1], [-1, -1.0]])
    h = np.zeros((6, 12))
    for a, (x, y) in enumerate(corners):
        for k, axis in enumerate(([0, 0, 1.0], [1.0, 0, 0], [0, 1.0, 0])):
            h[:3, 3 * a + k] = axis
            h[3:, 3 * a + k] = np.cross([x, y, -1.0], axis)
    w = h.T @ h
    problem = Local(3, matrix(w), h.T @ np.array([0.1, 0, -1.0, 0, 0, 0]), np.full(4, 0.5))
    for solver in ("AUTO", "NSGS", "PROX", "ADMM"):
        result = solve(problem, 1e-10, solver)
        assert result.status == "solved", solver
        assert result.r[::3].sum() == pytest.approx(1.0, abs=1e-8)
        assert result.figures.states.tolist() == [STICK] * 4


def test_zero_blocks_and_no_contacts_are_problems_too():
    idle = Local(3, matrix(np.zeros((6, 6))), np.array([1.0, 0, 0, 2.0, 1.0, 0]), np.full(2, 0.3))
    assert solve(idle, 1e-8).status == "solved"
    empty = Local(3, matrix(np.zeros((0, 0))), np.zeros(0), np.zeros(0))
    assert solve(empty, 1e-8).status == "solved"


def test_a_wedge_is_not_called_solved():
    result = solve(wedge(), 1e-8, max_seconds=3.0)
    assert result.status == "not_solved"
    assert "jammed" in result.reason
    assert np.isfinite(result.r).all()


def test_out_of_time_is_not_called_solved():
    result = solve(some_local(80), 1e-300, max_seconds=0.05)
    assert result.status == "not_solved"
    assert result.reason
    assert math.isfinite(result.error)


def test_the_stricter_test_is_kept():
    # large impulses against a small q: the error is small long before |F|/|q| is
    rng = np.random.default_rng(6)
    w = 1e-4 * some_local(12).W.csr().toarray()
    problem = Local(3, matrix(w), rng.normal(size=36), np.full(12, 0.3))
    result = solve(problem, 1e-6, strict=True)
    assert result.status == "solved"
    assert judge(problem, result.solution).error_q <= 1e-6


def test_a_warm_start_needs_less():
    problem = some_local(80)
    cold = solve(problem, 1e-10)
    warm = solve(problem, 1e-8, guess=Solution(cold.u, cold.r))
    assert warm.iterations < cold.iterations
    with pytest.raises(ModelError, match="the guess has 3"):
        solve(problem, 1e-8, guess=Solution(np.zeros(3), np.zeros(3)))


def test_the_history_ends_with_the_goal():
    result = solve(some_local(80), 1e-8, "NSGS")
    name, rows = result.history[-1]
    assert name == "NSGS"
    assert rows[-1, 1] <= 1e-8
    assert (np.diff(rows[:, 0]) > 0).all()


def test_runs_repeat_bit_for_bit():
    problem = some_local(80, seed=3)
    one, other = (solve(problem, 1e-10) for _ in range(2))
    assert one.r.tobytes() == other.r.tobytes()
    assert one.iterations == other.iterations


def test_within_the_tolerance_impulses_must_not_grow():
    blocks = reduce(some_local(2))
    task = Task(blocks, np.ones(6), 1e-4, 1e-4)
    assert task.offer(np.ones(6), 1e-5, 1e-3)
    assert not task.offer(np.full(6, 1e6), 1e-9, 1e-4)
    assert task.offer(np.full(6, 1.5), 1e-6, 1e-4)


@pytest.mark.parametrize("solver", ["NSGS", "ADMM", "PROX"])
def test_a_method_goes_on_a_little_beyond_its_goal(solver):
    result = solve(some_local(80), 1e-5, solver)
    rows = np.concatenate([rows for _, rows in result.history])
    reached = rows[rows[:, 1:].max(axis=1) <= 1e-5][0]
    assert result.error_q < reached[2]
    # and no further than a third of the work, or one Newton step more
    assert result.iterations <= reached[0] + max(reached[0] / 3.0 + 1.0, proximal.FINAL)


def test_more_sweeps_are_undone_if_they_gain_nothing():
    problem = some_local(80)
    blocks = reduce(problem)
    best = solve(problem, 1e-13).r
    task = Task(blocks, best.copy(), 1e-5, 1e-5)
    after = sweeps.nsgs(task, 20)
    assert task.look(after)[1] <= task.look(best)[1] + 1e-15


def test_sweeps_go_on_from_where_they_are_and_not_from_the_best_again():
    # a contact that closes slowly is left when the published error is met
    result = solve(hdf5.read(problem_file("Capsules-i101-404")).problem, 1e-4, "NSGS")
    chunks = [rows[:, 1:].tobytes() for _, rows in result.history]
    assert len(chunks) > 2
    assert len(set(chunks)) == len(chunks)


def test_a_proximal_run_knows_the_mean_of_its_centres():
    task = Task(reduce(some_local(80)), np.zeros(240), 1e-12, 1e-12)
    run = newton.Proximal(task)
    assert run.advance(1)
    run.forget()
    centres = []
    for _ in range(3):
        assert run.advance(1)
        centres.append(run.centre.copy())
    assert run.mean == pytest.approx(np.mean(centres, axis=0), abs=1e-15)


#: A chute in which two rocks are wedged: against their impulses the published error is met soon,
#: and weak contacts elsewhere stay wrong by more than their own small size. Without any limit of
#: time AUTO stagnates at a scale-free residual of 2e-4 and |F|/|q| = 3.8e-8.
WEDGED = "Gen_chute-nc1035"
#: Of these, or of perturbed copies, the like is left at 1e-4, where the published error is met long
#: before; at 1e-8 all are solved.
WEAK = ("Gen_chute-nc787", "Gen_kapla-nc1204")


def is_solved(result, name):
    """Return whether a shared problem is solved as well as this one can be."""
    if name.startswith(WEDGED) or (name.startswith(WEAK) and result.tol >= 1e-4):
        return result.status in ("solved", "solved_relative")
    return result.status == "solved"


@pytest.mark.parametrize(
    ("name", "bound"),
    [
        # MERIT_1 of the fastest of Siconos' solvers at 1e-4 (shared/data/siconos_baseline.csv)
        ("LMGC_100_PR_PerioBox-i00361-60-03000", 2.1e-1),
        ("Confeti-ex03-Fc3D-SBM", 5.4),
        ("BoxStacks82-tied-eq-local", 3.1e-7),
        ("Capsules-i101-404", 8.2e-5),
        ("Capsules-i122-1617", 4.8e-5),
        ("Capsules-i125-1213", 3.9e-5),
        ("Gen_chute-nc1035-s350", 1.04e-4),
        ("Gen_spheres-nc133-s30", 3e-15),
        ("GFC3D_TwoRods1", 1e-15),
        ("Rover3865", 3.4e-7),
        ("Rover4516", 1.2e-6),
        ("Rover4609", 2.4e-6),
        ("Rover4622", 9.0e-7),
    ],
)
def test_merit_is_no_worse_than_that_of_siconos(name, bound):
    result = solve(hdf5.read(problem_file(name)).problem, 1e-4)
    assert is_solved(result, name)
    assert result.figures.merit1 <= min(bound, 1e-4)
    assert result.figures.error_q <= 1e-4


def test_a_few_weak_contacts_are_mended():
    problem = some_local(60)
    wanted = solve(problem, 1e-12)
    blocks = reduce(problem)
    size = np.linalg.norm(wanted.r.reshape(-1, 3), axis=1)
    order = np.argsort(np.where(size > 0.0, size, np.inf))
    for wrong, mended in ((order[:2], True), (order[:30], False)):
        r = wanted.r.copy().reshape(-1, 3)
        r[wrong] *= 1.01
        task = Task(blocks, r.ravel(), 1e-4, 1e-4)
        found = sweeps.mended(task)
        assert (found is not None) == mended
        if found is not None:
            assert judge(problem, Solution(found, found)).scale_free <= 1e-3
            # nothing else is touched
            assert np.count_nonzero(found - task.r) <= 3 * 4


@pytest.mark.parametrize("name", ["BoxesStack1-i100000-32", "Capsules-i125-1213"])
def test_weak_contacts_get_newtons_method_soon(name):
    result = solve(hdf5.read(problem_file(name)).problem, 1e-4)
    assert result.status == "solved"
    done = {method: rows[-1, 0] for method, rows in result.history}
    # what is left within the first goal is no work for ADMM, nor for the 350 sweeps that 40 Newton
    # iterations would cost; 25 and 78 iterations are needed
    assert "ADMM" not in done
    assert done["NSGS"] <= 100
    assert result.iterations <= 200


def test_a_newton_phase_ends_at_rounding():
    problem = some_local(60)
    blocks = reduce(problem)
    task = Task(blocks, np.zeros(180), 1e-4, 1e-4)
    sweeps.nsgs(task, 400)
    task.tol = task.tol_q = 1e-12
    before = task.error
    newton.Proximal(task, newton.PHASE_ALPHA).newton_phase()
    assert before > 1e-8
    assert task.error < 1e-13
    assert task.history[-1][0] == "NSN"
    assert len(task.history[-1][1]) == 1


def test_a_newton_phase_in_vain_leaves_no_trace():
    task = Task(reduce(some_local(60)), np.zeros(180), 1e-8, 1e-8)
    sweeps.nsgs(task, 1)
    r, work, rows = task.r, task.work, len(task.history)
    newton.Proximal(task, newton.PHASE_ALPHA).newton_phase()
    assert task.r is r
    assert task.work == work
    assert len(task.history) == rows


def test_no_impulses_within_the_tolerance_are_no_solution():
    w = np.eye(6)
    problem = Global(
        3, matrix(w), matrix(w), np.array([1.0, 0, 0, -5e-5, 0, 0]), np.zeros(6), np.full(2, 0.3)
    )
    at_rest = Solution(np.zeros(6), np.zeros(6))
    # neither for who brings them as a guess: the contact that closes slowly would get nothing
    for guess in (at_rest, None):
        assert solve(problem, 1e-4, guess=guess).r[3] == pytest.approx(5e-5)


def test_an_admm_run_can_be_continued_without_new_factors():
    blocks = reduce(some_local(40))
    runs = []
    for parts in ((60,), (30, 30)):
        task = Task(blocks, np.zeros(120), 1e-14, 1e-14)
        run = splitting.Splitting(task)
        for limit in parts:
            run.advance(limit)
        runs.append(run)
    whole, in_parts = runs
    assert np.array_equal(whole.iterates.z, in_parts.iterates.z)
    assert np.array_equal(whole.state, in_parts.state)


def test_changes_between_open_stick_and_slip_are_counted():
    counted = jit.function(count_changes)
    r = np.array([0.0, 0.0, 0.0, 1.0, 0.1, 0.0, 1.0, 0.3, 0.4])
    states = np.zeros(3, np.int8)
    assert counted((0, 0), np.full(3, 0.5), r, states) == 2
    assert list(states) == [0, 1, 2]
    assert counted((0, 0), np.full(3, 0.5), r, states) == 0


def perturbed(problem, seed):
    """Return a copy with other q, still in the range of W, and other friction."""
    rng = np.random.default_rng(seed)
    w = problem.W.csr()
    shift = w @ rng.normal(size=problem.W.m)
    size = (0.01, 0.02, 0.05)[seed % 3] * np.linalg.norm(problem.q) / np.linalg.norm(shift)
    q = problem.q * (1.0 + 0.02 * rng.normal()) + size * shift
    return Local(problem.spacedim, problem.W, q, problem.mu * (1.1 if seed % 2 else 0.9))


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize(
    "name",
    ["Gen_capsules-nc582-s260", "Gen_chute-nc787-s200", "Gen_chute-nc1035-s350",
     "Gen_kapla-nc1204-s40", "Gen_pyramid-nc1061-s20", "OneObject-i100000-316",
     "Gen_boxwall-nc1058-s20", "fc2d_granularflowonwall_02020_00213"],
)  # fmt: skip
def test_auto_solves_perturbed_copies_of_hard_problems(name, seed):
    problem = perturbed(hdf5.read(problem_file(name)).problem, seed)
    result = solve(problem, 1e-8, max_seconds=math.inf)  # a busy machine must not decide
    assert is_solved(result, name)
    assert judge(problem, result.solution).error <= 1e-8


@pytest.mark.slow
@pytest.mark.parametrize("tol", [1e-4, 1e-8])
@pytest.mark.parametrize("name", NAMES)
def test_auto_solves_the_shared_folder(name, tol):
    problem = hdf5.read(problem_file(name)).problem
    result = solve(problem, tol, max_seconds=math.inf)  # a busy machine must not decide
    if name.startswith("Gen_boxwall-nc1058") and tol < 1e-4:
        # the one that may be missed; then it must say so
        assert result.status == "solved" or result.reason
        return
    assert is_solved(result, name)
    assert judge(problem, result.solution).error <= tol


@pytest.mark.parametrize(
    "name",
    ["Rover4609", "Confeti-ex03-Fc3D-SBM", "Capsules-i101-404", "OneObject-i100000-316",
     "BoxStacks82-tied-eq-global", "GFC3D_TwoRods1", "Chute-ndof-768-nc-4-3",
     "FrictionContactProblem00237"],
)  # fmt: skip
def test_auto_solves_some_of_the_shared_problems(name):
    problem = hdf5.read(problem_file(name)).problem
    result = solve(problem, 1e-8)
    assert result.status == "solved"
    assert judge(problem, result.solution).error <= 1e-8


class Uncompiled(dict):
    """In place of the compiled functions: every function as it is."""

    def get(self, function, default=None):
        return function


@pytest.mark.parametrize("solver", COULOMB)
@pytest.mark.parametrize("make", ["local", "global"])
def test_no_solver_reads_memory_that_nothing_was_written_to(solver, make, monkeypatch):
    rng = np.random.default_rng(4)
    half = rng.normal(size=(9, 6))
    problem = Local(3, matrix(half @ half.T), half @ rng.normal(size=6), np.full(3, 0.4))
    if make == "global":
        mass = np.eye(12) + 0.1 * np.eye(12, k=3) + 0.1 * np.eye(12, k=-3)
        h = rng.normal(size=(12, 6))
        problem = Global(
            3, matrix(mass), matrix(h), -h[:, 0] - h[:, 3], np.zeros(6), np.full(2, 0.4),
            matrix(rng.normal(size=(12, 2))), rng.normal(size=2),
        )  # fmt: skip
        monkeypatch.setattr(condensation, "DENSE", 4)
    monkeypatch.setattr(clock, "_seen", Uncompiled())
    found = set()
    for begin in (0.01, 0.3, -0.01, -0.3):
        # what is allocated first looks like a later iterate of a method that converges
        junk = itertools.cycle(begin * 2.0 ** np.arange(12.0))

        def filled(shape, dtype=float, junk=junk):
            value = next(junk)
            return np.full(shape, value if dtype is float else value > 0.0, dtype)

        with monkeypatch.context() as patched:
            patched.setattr(np, "empty", filled)
            result = solve(problem, 1e-8, solver, max_seconds=math.inf)
        rows = [rows for _, rows in result.history]
        found.add((result.r.tobytes(), result.iterations, np.concatenate(rows).tobytes()))
    assert len(found) == 1


@pytest.mark.parametrize(
    ("seed", "mu", "mu_r"),
    [(0, 0.3, 0.005), (1, 0.3, 0.001), (5, 0.8, 0.02), (7, 0.8, 0.0003), (9, 0.3, 0.0003)],
)
def test_heaps_of_spheres_that_hardly_roll_are_solved(seed, mu, mu_r):
    # of the first and the fourth one AUTO's own methods go round in a circle
    problem = rolling_heap(30, mu, mu_r, seed)
    result = solve(problem, 1e-8)
    assert result.status == "solved"
    assert result.problem is problem
    assert judge(problem, result.solution).error <= 1e-8


def test_what_a_guess_does_not_lead_to_is_solved_all_the_same():
    problem = rolling_heap(30, 0.3, 0.005, 0)
    first = solve(problem, 1e-2)
    result = solve(problem, 1e-8, guess=Solution(first.u, first.r))
    assert result.status == "solved"
    assert judge(problem, result.solution).error <= 1e-8

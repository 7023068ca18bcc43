"""`mbsim fclib`: what the commands print, write and return."""

from __future__ import annotations

import csv
import json
import math

import numpy as np
import pytest
from click.testing import CliRunner

from helpers.fclib_problems import dense, some_global, some_local, wedge
from mbsim.cli.main import main
from mbsim.fclib import compare, hdf5, peers
from mbsim.fclib.merit import judge
from mbsim.fclib.problem import Info, Local, Solution, matrix
from mbsim.fclib.solve import solve


def run(*arguments):
    return CliRunner().invoke(main, ["fclib", *map(str, arguments)])


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "chain.hdf5"
    problem = some_local(3)
    told = Local(3, problem.W, problem.q, problem.mu, info=Info("Kiste \udca8", "", None))
    hdf5.write(path, told, guesses=[Solution(np.zeros(9), np.zeros(9))])
    return path


def test_info_says_what_is_there(file):
    done = run("info", file)
    assert done.exit_code == 0
    assert "contacts       3" in done.output
    assert "W 9 x 9 csr" in done.output
    (about,) = json.loads(run("info", file, "--json").stdout)
    assert (about["kind"], about["contacts"], about["guesses"]) == ("local", 3, 1)
    assert about["title"].startswith("Kiste ")


def test_merit_judges_what_is_stored(file):
    (entry,) = json.loads(run("merit", file, "--json").stdout)
    assert entry["place"] == "guesses/1"
    problem = hdf5.read(file).problem
    figures = judge(problem, Solution(np.zeros(9), np.zeros(9)))
    assert entry["error"] == pytest.approx(figures.error)
    assert entry["merit1"] == pytest.approx(figures.merit1)
    assert sum(entry["states"].values()) == 3


def test_solve_prints_the_documented_list_and_writes_the_solution(file, tmp_path):
    out = tmp_path / "solved.hdf5"
    done = run("solve", file, "--tol", "1e-9", "--json", "-o", out)
    assert done.exit_code == 0
    (entry,) = json.loads(done.stdout)
    documented = {
        "file", "kind", "contacts", "solver", "status", "iterations", "solve_s", "condense_s",
        "error", "merit1", "max_cone_violation", "max_penetration_velocity",
    }  # fmt: skip
    assert documented <= entry.keys()
    assert entry["status"] == "solved"
    contents = hdf5.read(out)
    assert len(contents.guesses) == 1
    assert judge(contents.problem, contents.solution).error <= 1e-9
    # and its merit is what was printed
    judged = json.loads(run("merit", out, "--json").stdout)
    assert judged[0]["error"] == pytest.approx(entry["error"], rel=1e-6, abs=1e-15)


def test_solve_ends_with_3_where_a_problem_is_not_solved(tmp_path):
    hdf5.write(tmp_path / "wedge.hdf5", wedge())
    done = run("solve", tmp_path / "wedge.hdf5", "--max-time", "2")
    assert done.exit_code == 3
    assert "not solved" in done.stdout
    assert "jammed" in done.stderr


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("solve", "{file}", "--solver", "MAGIC"), "MAGIC: no such solver"),
        (("solve", "{file}", "--guess", "2"), "there are 1"),
        (("solve", "{file}", "{file}", "-o", "x.hdf5"), "one problem only"),
        (("solve", "{file}", "--tol", "0"), "above 0"),
        (("info", "none.hdf5"), "none.hdf5: no such file"),
        (("compare", "{folder}/empty"), "no .hdf5 file"),
    ],
)
def test_wrong_usage_is_one_clear_line(arguments, message, file, tmp_path):
    (tmp_path / "empty").mkdir()
    done = run(*(text.format(file=file, folder=tmp_path) for text in arguments))
    assert done.exit_code == 2
    assert message in done.stderr
    assert "Traceback" not in done.output


def test_compare_writes_table_csv_and_profile(file, tmp_path):
    pytest.importorskip("matplotlib")
    hdf5.write(tmp_path / "other.hdf5", some_local(4, seed=2))
    (tmp_path / "broken.hdf5").write_text("no")
    out = tmp_path / "out"
    done = run(
        "compare", tmp_path, "--solver", "AUTO", "--solver", "NSGS", "--no-siconos",
        "--repeats", "1", "-o", out,
    )  # fmt: skip
    assert done.exit_code == 0
    assert "mbsim NSGS               solved   2 of 2" in done.stdout
    assert "left out" in done.stderr
    with (out / "compare.csv").open() as opened:
        rows = list(csv.DictReader(opened))
    assert len(rows) == 4
    assert {row["status"] for row in rows} == {"solved"}
    assert (out / "profile.png").read_bytes().startswith(b"\x89PNG")


def test_a_performance_profile_counts_ratios_to_the_best():
    def row(problem, solver, status, seconds):
        return compare.Row(problem, "local", 1, solver, status, seconds, 1, 0.0, 0.0, 0.0, 0.0)

    rows = [
        row("a", "mbsim AUTO", "solved", 1.0),
        row("a", "Siconos NSGS", "solved", 4.0),
        row("b", "mbsim AUTO", "solved", 6.0),
        row("b", "Siconos NSGS", "solved", 2.0),
        row("c", "mbsim AUTO", "solved", 1.0),
        row("c", "Siconos NSGS", "not_solved", 0.1),
    ]
    assert compare.profile(rows) == {"mbsim AUTO": [1.0, 1.0, 3.0], "Siconos NSGS": [1.0, 4.0]}
    summary = compare.summary(rows)
    assert "solved   3 of 3" in summary[0]
    assert "0.87 times" in summary[0]  # the root of 1/4 times 3
    rows += [row("a", "Siconos GLOBAL_ADMM", "solved", 16.0)]
    summary = compare.summary(rows)
    assert "0.87 times" in summary[0]
    assert "0.43 with its global solvers alone" in summary[0]  # the root of 1/16 times 3


@pytest.mark.parametrize("command", ["info", "merit", "solve"])
def test_a_file_that_cannot_be_read_does_not_keep_the_others_back(command, file, tmp_path):
    bad, worse = tmp_path / "bad.hdf5", tmp_path / "worse.hdf5"
    bad.write_bytes(b"not HDF5")
    done = run(command, bad, file, worse, "--json")
    assert done.exit_code == 2
    assert {entry["file"] for entry in json.loads(done.stdout)} == {str(file)}
    assert str(bad) in done.stderr
    assert str(worse) in done.stderr


def test_nothing_to_compare_is_an_error(tmp_path):
    bad = tmp_path / "bad.hdf5"
    bad.write_bytes(b"not HDF5")
    done = run("compare", bad, "--no-siconos", "-o", tmp_path / "out")
    assert done.exit_code == 2
    assert "bad.hdf5" in done.stderr


def test_siconos_solves_what_we_write_for_it():
    if peers.python() is None:
        pytest.skip(peers.why_not())
    from mbsim.fclib.reduction import reduce

    for d in (2, 3):
        problem = some_local(4, d, mu=0.3)
        runs = {run.solver: run for run in peers.run(problem, reduce(problem), 1e-8, 5.0, 1)}
        assert len(runs) == len(peers.SOLVERS[d])
        r = runs["Siconos NSGS"].r
        assert judge(problem, Solution(np.zeros_like(r), r)).error < 2e-8
        assert np.allclose(r, solve(problem, 1e-10).r, atol=1e-5)


def test_siconos_gets_global_problems_as_they_are():
    if peers.python() is None:
        pytest.skip(peers.why_not())
    from mbsim.fclib.reduction import reduce

    problem = some_global()
    runs = {run.solver: run for run in peers.run(problem, reduce(problem), 1e-8, 5.0, 2)}
    wanted = solve(problem, 1e-10)
    for name in peers.GLOBAL_SOLVERS:
        run = runs[f"Siconos {name}"]
        assert math.isfinite(run.seconds)
        assert np.allclose(run.r, wanted.r, atol=1e-5), name


@pytest.mark.parametrize(
    ("there", "reason"),
    [
        ((), "Siconos is not installed"),
        (("siconos.numerics",), "has Siconos but no SciPy"),
        (("siconos.numerics", "scipy.sparse.linalg"), ""),
    ],
)
def test_compare_says_why_it_lists_no_siconos(there, reason, file, tmp_path, monkeypatch):
    monkeypatch.setattr(peers, "_imports", lambda interpreter, module: module in there)
    peers._found.cache_clear()
    try:
        assert (peers.python() is None) == bool(reason)
        assert reason in peers.why_not()
        if reason:
            done = run("compare", file, "--solver", "NSGS", "--repeats", "1", "-o", tmp_path)
            assert done.exit_code == 0
            assert "Siconos is not compared" in done.stderr
            assert reason in done.stderr
    finally:
        peers._found.cache_clear()


@pytest.mark.parametrize("masses", [False, True])
def test_siconos_pays_for_the_condensation_that_scipy_does_there(masses):
    if peers.python() is None:
        pytest.skip(peers.why_not())
    from mbsim.fclib.reduction import local, reduce

    problem = some_global(2)
    problem = problem if masses else local(problem)
    blocks = reduce(problem)
    plain = Local(3, matrix(dense(problem)[0] if masses else np.eye(6)), blocks.q, problem.mu)
    wanted = solve(problem, 1e-10)
    runs = {run.solver: run for run in peers.run(problem, blocks, 1e-8, 5.0, 3)}
    bare = {run.solver: run for run in peers.run(plain, reduce(plain), 1e-8, 5.0, 3)}
    assert set(runs) == set(bare)
    assert np.allclose(runs["Siconos NSGS"].r, wanted.r, atol=1e-5)
    assert runs["Siconos NSGS"].seconds > bare["Siconos NSGS"].seconds


def test_a_matrix_of_no_known_storage_is_refused():
    with pytest.raises(Exception, match="no storage of FCLIB"):
        matrix(np.eye(2), "dense")

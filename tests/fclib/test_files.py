"""FCLIB files: exact round trip, atomic writing, one clear error, and libfclib as the judge."""

from __future__ import annotations

from dataclasses import fields, is_dataclass, replace

import h5py
import numpy as np
import pytest

from helpers.fclib_folder import NAMES, problem_file
from mbsim.errors import ModelError, ResultsError
from mbsim.fclib import hdf5
from mbsim.fclib.problem import (
    Global,
    Info,
    Local,
    MatrixInfo,
    Solution,
    matrix,
)
from mbsim.fclib.reduction import times, transposed_times


def same(a, b) -> bool:
    """Return whether two things hold the same bits, types and shapes."""
    if is_dataclass(a):
        return type(a) is type(b) and all(
            same(getattr(a, f.name), getattr(b, f.name)) for f in fields(a)
        )
    if isinstance(a, np.ndarray):
        return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(same(a[k], b[k]) for k in a)
    if isinstance(a, (tuple, list)):
        return len(a) == len(b) and all(map(same, a, b))
    return type(a) is type(b) and a == b


def shapes(path) -> dict:
    """Return type and shape of every data set, as libfclib sees them."""
    found = {}

    def look(name, item):
        if isinstance(item, h5py.Dataset):
            layout = item.id.get_create_plist().get_layout()
            found[name] = (item.dtype, item.shape, layout, item.maxshape)

    with h5py.File(path) as file:
        file.visititems(look)
    return found


@pytest.mark.parametrize("name", NAMES)
def test_every_shared_problem_reads_writes_and_reads_back_bit_equal(name, tmp_path):
    path = problem_file(name)
    first = hdf5.read(path)
    hdf5.write(tmp_path / "again.hdf5", first.problem, first.solution, first.guesses)
    assert same(hdf5.read(tmp_path / "again.hdf5"), first)
    assert shapes(tmp_path / "again.hdf5") == shapes(path)


def some_local(storage="csr", equalities=0, d=3, nc=2):
    rng = np.random.default_rng(7)
    m = d * nc
    half = rng.normal(size=(m + equalities, m + equalities))
    full = half @ half.T + np.eye(m + equalities)
    more = {}
    if equalities:
        more = {
            "V": matrix(full[:m, m:], storage),
            "R": matrix(full[m:, m:], storage),
            "s": rng.normal(size=equalities),
        }
    return Local(
        d,
        matrix(full[:m, :m], storage),
        rng.normal(size=m),
        np.full(nc, 0.5),
        info=Info("title", "", "grosse Kiste \udca8"),
        **more,
    )


def some_global(equalities=0, d=3, nc=2, mu_r=None, storage="triplet"):
    rng = np.random.default_rng(8)
    n, m = 12, d * nc
    return Global(
        d,
        matrix(np.diag(rng.uniform(1, 2, n)), storage),
        matrix(rng.normal(size=(n, m)), storage),
        rng.normal(size=n),
        rng.normal(size=m),
        np.full(nc, 0.4),
        matrix(rng.normal(size=(n, equalities)), storage) if equalities else None,
        rng.normal(size=equalities) if equalities else None,
        None if mu_r is None else np.full(nc, mu_r),
    )


@pytest.mark.parametrize("storage", ["csr", "csc", "triplet"])
@pytest.mark.parametrize("equalities", [0, 2])
@pytest.mark.parametrize("d", [2, 3])
def test_local_problems_of_every_storage_round_trip(storage, equalities, d, tmp_path):
    problem = some_local(storage, equalities, d)
    path = tmp_path / "p.hdf5"
    l = np.ones(equalities) if equalities else None
    solution = Solution(np.arange(2.0 * d), np.ones(2 * d), l=l)
    hdf5.write(path, problem, solution, [solution, solution])
    back = hdf5.read(path)
    assert same(back.problem, problem)
    assert same(back.solution, solution)
    assert same(back.guesses, (solution, solution))


@pytest.mark.parametrize("storage", ["csr", "csc", "triplet"])
@pytest.mark.parametrize(("d", "mu_r"), [(2, None), (3, None), (3, 0.1), (5, 0.1)])
def test_global_problems_round_trip(storage, d, mu_r, tmp_path):
    problem = some_global(2, d, 2, mu_r, storage)
    hdf5.write(tmp_path / "p.hdf5", problem)
    assert same(hdf5.read(tmp_path / "p.hdf5").problem, problem)


def test_remarks_on_a_matrix_are_kept(tmp_path):
    problem = some_local()
    told = replace(
        problem.W, info=MatrixInfo("dense", 12.0, 3.0, 6), attributes={"rank": np.int64(5)}
    )
    hdf5.write(tmp_path / "p.hdf5", replace(problem, W=told))
    assert same(hdf5.read(tmp_path / "p.hdf5").problem.W, told)


def test_matrices_of_every_storage_are_the_same_matrix():
    dense = some_local().W.csr().toarray()
    dense[0, 3] = 0.0
    dense[2, 5] = 9.0
    vector = np.arange(6.0)
    for storage in ("csr", "csc", "triplet"):
        stored = matrix(dense, storage)
        assert np.array_equal(stored.csr().toarray(), dense)
        assert np.allclose(times(stored, vector), dense @ vector)
        assert np.allclose(transposed_times(stored, vector), dense.T @ vector)


def test_triplet_entries_at_one_place_add_up_and_nzmax_may_exceed_nz():
    stored = replace(matrix([[1.0, 2.0], [0.0, 4.0]], "triplet"), nzmax=9)
    p, i, x = (np.append(a, a[0]) for a in (stored.p, stored.i, stored.x))
    doubled = replace(stored, nz=4, p=p, i=i, x=x)
    assert doubled.csr().toarray().tolist() == [[2.0, 2.0], [0.0, 4.0]]
    assert times(doubled, np.array([1.0, 1.0])).tolist() == [4.0, 4.0]


def test_solutions_and_guesses_are_appended_and_not_overwritten(tmp_path):
    path = tmp_path / "p.hdf5"
    problem = some_local()
    hdf5.write(path, problem)
    with h5py.File(path, "a") as file:
        file["notes"] = [1.0]
    solution = Solution(np.zeros(6), np.ones(6))
    hdf5.append_solution(path, solution)
    hdf5.append_guesses(path, [solution])
    with pytest.raises(ResultsError, match="/solution is there already"):
        hdf5.append_solution(path, solution)
    other = Solution(np.ones(6), np.ones(6))
    hdf5.append_solution(path, other, replace=True)
    back = hdf5.read(path)
    assert same(back.solution, other)
    assert same(back.guesses, (solution,))
    with h5py.File(path) as file:
        assert "notes" in file


def test_a_failed_write_leaves_the_old_file_and_no_other(tmp_path):
    path = tmp_path / "p.hdf5"
    hdf5.write(path, some_local())
    before = path.read_bytes()
    with pytest.raises(ModelError, match="shape"):
        hdf5.write(path, some_local(), Solution(np.zeros(5), np.zeros(6)))
    assert path.read_bytes() == before
    assert [entry.name for entry in tmp_path.iterdir()] == ["p.hdf5"]


def test_nowhere_to_write_is_one_clear_error(tmp_path):
    with pytest.raises(ResultsError, match="cannot be written"):
        hdf5.write(tmp_path / "nowhere" / "p.hdf5", some_local())


def test_local_rolling_has_no_group():
    rolling = Local(5, matrix(np.eye(5)), np.zeros(5), np.ones(1), mu_r=np.ones(1))
    with pytest.raises(ModelError, match="no group"):
        hdf5.write("unwritten.hdf5", rolling)


def broken(path, change):
    hdf5.write(path, some_local("csr", 1))
    with h5py.File(path, "a") as file:
        change(file["fclib_local"])
    return path


def put(name, value):
    def change(group):
        del group[name]
        if value is not None:
            group[name] = value

    return change


def claim(name):
    """Put a data set of 2^50 numbers that are not there in the place of a group."""

    def change(group):
        if name in group:
            del group[name]
        group.create_dataset(name, (2**50,), "f8", chunks=(2**16,))

    return change


@pytest.mark.parametrize(
    ("change", "message"),
    [
        *((claim(name), f"{name} is no group") for name in ("W", "vectors", "info", "V")),
        *((claim(f"/{name}"), f"/{name} is no group") for name in ("solution", "guesses")),
        (put("W", None), "/fclib_local/W is missing"),
        (put("vectors/mu", None), "vectors/mu is missing"),
        (put("vectors/mu", [0.5, 0.5, 0.5]), "mu names 3 contacts"),
        (put("vectors/mu", [0.5, -0.5]), "negative"),
        (put("vectors/q", [1.0] * 5), "q has shape"),
        (put("vectors/q", [float("nan")] * 6), "no finite numbers"),
        (put("W/nz", np.int32([-3])), "W/nz is -3"),
        (put("W/p", np.int32([0, 6, 12])), "pointers"),
        (put("W/p", np.int32([0, 9, 6, 12, 18, 24, 36])), "must rise"),
        (put("W/i", np.full(36, 6, np.int32)), "outside 0..5"),
        (put("W/m", np.int32([7])), "7 rows|7 x 6"),
        (put("W/x", np.zeros((6, 6))), "no list of numbers"),
        (put("spacedim", np.int32([4])), "spacedim 4"),
        (put("R", None), "belong together"),
    ],
)
def test_a_broken_file_is_one_clear_error_with_its_name(change, message, tmp_path):
    path = broken(tmp_path / "broken.hdf5", change)
    with pytest.raises(ModelError, match=message) as caught:
        hdf5.read(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


def test_no_file_another_file_and_half_a_file_are_clear_errors(tmp_path):
    with pytest.raises(ModelError, match="no such file"):
        hdf5.read(tmp_path / "none.hdf5")
    (tmp_path / "text.hdf5").write_text("hello")
    with pytest.raises(ModelError, match="no readable FCLIB file"):
        hdf5.read(tmp_path / "text.hdf5")
    hdf5.write(tmp_path / "whole.hdf5", some_local())
    raw = (tmp_path / "whole.hdf5").read_bytes()
    (tmp_path / "half.hdf5").write_bytes(raw[: len(raw) // 2])
    with pytest.raises(ModelError, match="no readable FCLIB file"):
        hdf5.read(tmp_path / "half.hdf5")
    with h5py.File(tmp_path / "other.hdf5", "w") as file:
        file["x"] = [1.0]
    with pytest.raises(ModelError, match="no FCLIB problem"):
        hdf5.read(tmp_path / "other.hdf5")


def test_one_of_several_problems_is_chosen_by_kind(tmp_path):
    hdf5.write(tmp_path / "a.hdf5", some_local())
    hdf5.write(tmp_path / "b.hdf5", some_global())
    with h5py.File(tmp_path / "a.hdf5", "a") as a, h5py.File(tmp_path / "b.hdf5") as b:
        b.copy("fclib_global", a)
    with pytest.raises(ModelError, match="several problems"):
        hdf5.read(tmp_path / "a.hdf5")
    assert hdf5.read(tmp_path / "a.hdf5", "global").problem.kind == "global"


def expected(stored):
    """Return what the C program prints of a matrix."""
    n = stored.entries
    k = np.arange(1, n + 1)
    return [stored.m, stored.n, stored.nz, stored.nzmax, int(stored.i[:n] @ k), stored.x[:n] @ k]


@pytest.mark.parametrize("storage", ["csr", "csc", "triplet"])
@pytest.mark.parametrize("equalities", [0, 2])
def test_libfclib_reads_our_local_files(libfclib, storage, equalities, tmp_path):
    problem = some_local(storage, equalities)
    hdf5.write(tmp_path / "p.hdf5", problem)
    seen = libfclib("local", tmp_path / "p.hdf5")
    for name in ("W", "V", "R")[: 3 if equalities else 1]:
        assert seen[name] == pytest.approx(expected(getattr(problem, name)), rel=1e-14)
    assert seen["q"] == pytest.approx([problem.q @ np.arange(1, 7)], rel=1e-14)


@pytest.mark.parametrize("equalities", [0, 2])
def test_libfclib_reads_our_global_files(libfclib, equalities, tmp_path):
    problem = some_global(equalities)
    l = np.ones(equalities) if equalities else None
    solution = Solution(np.zeros(6), np.zeros(6), np.arange(12.0), l)
    hdf5.write(tmp_path / "p.hdf5", problem, solution)
    seen = libfclib("global", tmp_path / "p.hdf5", "solution")
    for name in ("M", "H", "G")[: 3 if equalities else 2]:
        assert seen[name] == pytest.approx(expected(getattr(problem, name)), rel=1e-14)
    assert seen["v"] == pytest.approx([np.arange(12.0) @ np.arange(1, 13)])

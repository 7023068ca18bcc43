"""Run Siconos' solvers on one problem; started by `peers` with the Python that has Siconos.

Usage: python siconos_runs.py FOLDER TOL SECONDS REPEATS SOLVER...

Stands alone: nothing of mbsim is imported, for that Python does not have it. FOLDER holds local.dat
and, for a problem with masses or equality constraints, parts.npz. Every solver runs in a process of
its own, which an alarm ends. Writes FOLDER/SOLVER.npy (r) and prints a line of JSON a solver: name,
info, iterations, seconds (best of the repeats: the call of the solver and, where local.dat is not
the problem itself, what SciPy takes to get W and q).
"""

from __future__ import annotations

import json
import os
import signal
import sys
import time
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import siconos.numerics as sn
from scipy import sparse
from scipy.sparse import linalg

ITERATIONS = {
    "NSGS": 10**7, "GLOBAL_NSGS_WR": 10**7, "CPG": 10**6, "ADMM": 10**6, "GLOBAL_ADMM": 10**6,
    "PROX": 2000, "TFP": 10**4,
}  # fmt: skip
#: From so many unknowns on masses are not made a full matrix.
MANY = 4000
#: Repeats end when they have taken so long [s].
ENOUGH = 2.0


def parts_in(folder: str) -> dict[str, Any]:
    """Return matrices and vectors of the problem, none if local.dat is all."""
    path = os.path.join(folder, "parts.npz")
    if not os.path.isfile(path):
        return {}
    stored = dict(np.load(path))
    parts = {name: stored[name] for name in stored if "_" not in name}
    for name in "WVRMHG":
        if f"{name}_data" in stored:
            arrays = [stored[f"{name}_{part}"] for part in ("data", "indices", "indptr")]
            parts[name] = sparse.csc_matrix(tuple(arrays), shape=tuple(stored[f"{name}_shape"]))
    return parts


def condensation_time(parts: dict[str, Any], repeats: int) -> float:
    """Return the seconds in which SciPy gets W and q: the best of the repeats, full or sparse."""
    best, spent = float("inf"), 0.0
    for _ in range(repeats):
        for full in (True, False):
            if full and "M" in parts and parts["M"].shape[0] > MANY:
                continue
            began = time.perf_counter()
            condense(parts, full)
            seconds = time.perf_counter() - began
            best = min(best, seconds)
            spent += seconds
        if spent > ENOUGH:
            break
    return best


def condense(parts: dict[str, Any], full: bool) -> tuple[Any, Any]:
    """Return W and q of a problem with masses or equality constraints, by full matrices or not."""
    if "M" in parts:
        wide = sparse.hstack([parts["H"], parts["G"]]) if "G" in parts else parts["H"]
        wide = wide.tocsc()
        left = wide.T.tocsr()
        right = np.column_stack((wide.toarray(), parts["f"]))
        if full:
            solved = np.linalg.solve(parts["M"].toarray(), right)
        else:
            # SuperLU's way for symmetric matrices
            factors = linalg.splu(
                parts["M"], permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.01,
                options={"SymmetricMode": True},
            )  # fmt: skip
            solved = factors.solve(right)
        whole = left @ solved
        m = len(parts["w"])
        w, q = whole[:m, :m], whole[:m, -1] + parts["w"]
        if "G" not in parts:
            return w, q
        v, r, s = whole[:m, m:-1], whole[m:, m:-1], whole[m:, -1] + parts["b"]
    else:
        w, q, s = parts["W"].toarray(), parts["q"], parts["s"]
        v, r = parts["V"].toarray(), parts["R"].toarray()
    right = np.column_stack((v.T, s))
    try:
        solved = np.linalg.solve(r, right)
    except np.linalg.LinAlgError:
        solved = np.linalg.lstsq(r, right, rcond=None)[0]
    return w - v @ solved[:, :-1], q - v @ solved[:, -1]


def driven(name: str, folder: str) -> tuple[int, Callable[[Any], tuple[Any, Any]]]:
    """Return the number of Siconos' solver, and a function that makes a call of it ready.

    A global problem is built for each call: NSGS_WR dies when it gets one for the second time.
    """
    if name.startswith("GLOBAL_"):
        # Siconos takes the arrays as they are and does not keep them alive
        parts = parts_in(folder)
        for key in "MH":
            # set afterwards, for SciPy would shorten them; Siconos copies what is not long
            parts[key].indices = parts[key].indices.astype(np.int64)
            parts[key].indptr = parts[key].indptr.astype(np.int64)
        number = getattr(sn, "SICONOS_GLOBAL_FRICTION_3D_" + name[len("GLOBAL_") :])

        def prepare(options: Any) -> tuple[Any, Any]:
            problem = sn.GlobalFrictionContactProblem(3)
            problem.numberOfContacts = len(parts["mu"])
            problem.M, problem.H = parts["M"], parts["H"]
            problem.q, problem.b, problem.mu = parts["f"], parts["w"], parts["mu"]
            r, u = np.zeros(len(parts["w"])), np.zeros(len(parts["w"]))
            v = np.zeros(len(parts["f"]))
            return r, lambda: sn.gfc3d_driver(problem, r, u, v, options)

    else:
        problem = sn.frictionContact_new_from_filename(os.path.join(folder, "local.dat"))
        d = problem.dimension
        number = getattr(sn, f"SICONOS_FRICTION_{d}D_{name}")

        def prepare(options: Any) -> tuple[Any, Any]:
            driver = sn.fc2d_driver if d == 2 else sn.fc3d_driver
            r, u = np.zeros(d * problem.numberOfContacts), np.zeros(d * problem.numberOfContacts)
            return r, lambda: driver(problem, r, u, options)

    return number, prepare


def run(name: str, tol: float, repeats: int, folder: str) -> dict[str, Any]:
    """Solve with one solver and leave r in a file."""
    number, prepare = driven(name, folder)
    best = float("inf")
    spent = 0.0
    for _ in range(repeats):
        options = sn.SolverOptions(number)
        options.dparam[sn.SICONOS_DPARAM_TOL] = tol
        options.iparam[sn.SICONOS_IPARAM_MAX_ITER] = ITERATIONS.get(name, 1000)
        r, call = prepare(options)
        began = time.perf_counter()
        info = call()
        seconds = time.perf_counter() - began
        best = min(best, seconds)
        spent += seconds
        if spent > ENOUGH:
            break
    np.save(os.path.join(folder, f"{name}.npy"), r)
    iterations = int(options.iparam[sn.SICONOS_IPARAM_ITER_DONE])
    return {"solver": name, "info": int(info), "iterations": iterations, "seconds": best}


def in_a_process(
    name: str, tol: float, seconds: float, repeats: int, folder: str
) -> dict[str, Any]:
    """Run a solver in a process that an alarm ends; return what `run` does."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        signal.alarm(max(1, int(seconds) + 1))
        quiet = os.open(os.devnull, os.O_WRONLY)
        os.dup2(quiet, 1)
        os.dup2(quiet, 2)
        done = run(name, tol, repeats, folder)
        os.write(writing, json.dumps(done).encode())
        os._exit(0)
    os.close(writing)
    with os.fdopen(reading, "rb") as pipe:
        text = pipe.read()
    os.waitpid(child, 0)
    fallen = {"solver": name, "info": -99, "iterations": 0, "seconds": float("inf")}
    return json.loads(text) if text else fallen


def main() -> None:
    """Run every solver named on the command line."""
    folder, tol, seconds, repeats, *names = sys.argv[1:]
    warnings.simplefilter("ignore")
    parts = parts_in(folder)
    condensed = condensation_time(parts, int(repeats)) if parts else 0.0
    for name in names:
        done = in_a_process(name, float(tol), float(seconds), int(repeats), folder)
        if not name.startswith("GLOBAL_"):
            done["seconds"] += condensed
        sys.stdout.write(json.dumps(done) + "\n")
        sys.stdout.flush()


main()

"""Run Siconos' solvers on one problem; started by `peers` with the Python that has Siconos.

Usage: python siconos_runs.py FOLDER TOL SECONDS REPEATS SOLVER...

Stands alone: nothing of mbsim is imported, for that Python does not have it. FOLDER holds local.dat
and, for solvers GLOBAL_..., global.npz. Every solver runs in a process of its own, which an alarm
ends. Writes FOLDER/SOLVER.npy (r) and prints a line of JSON a solver: name, info, iterations,
seconds (best of the repeats, the call of the solver alone).
"""

import json
import os
import signal
import sys
import time
import warnings

import numpy as np
import siconos.numerics as sn
from scipy import sparse

ITERATIONS = {
    "NSGS": 10**7, "GLOBAL_NSGS_WR": 10**7, "CPG": 10**6, "ADMM": 10**6, "GLOBAL_ADMM": 10**6,
    "PROX": 2000, "TFP": 10**4,
}  # fmt: skip
#: Repeats end when they have taken so long [s].
ENOUGH = 2.0


def driven(name, folder):
    """Return the number of Siconos' solver, and a function that makes a call of it ready.

    A global problem is built for each call: NSGS_WR dies when it gets one for the second time.
    """
    if name.startswith("GLOBAL_"):
        # Siconos takes the arrays as they are and does not keep them alive
        stored = dict(np.load(os.path.join(folder, "global.npz")))
        matrices = {}
        for key in "MH":
            parts = [stored[f"{key}_{part}"] for part in ("data", "indices", "indptr")]
            found = sparse.csc_matrix(tuple(parts), shape=tuple(stored[f"{key}_shape"]))
            # set afterwards, for SciPy would shorten them; Siconos copies what is not long
            found.indices, found.indptr = (part.astype(np.int64) for part in parts[1:])
            matrices[key] = found
        number = getattr(sn, "SICONOS_GLOBAL_FRICTION_3D_" + name[len("GLOBAL_") :])

        def prepare(options):
            problem = sn.GlobalFrictionContactProblem(3)
            problem.numberOfContacts = len(stored["mu"])
            problem.M, problem.H = matrices["M"], matrices["H"]
            problem.q, problem.b, problem.mu = stored["f"], stored["w"], stored["mu"]
            r, u = np.zeros(len(stored["w"])), np.zeros(len(stored["w"]))
            v = np.zeros(len(stored["f"]))
            return r, lambda: sn.gfc3d_driver(problem, r, u, v, options)

    else:
        problem = sn.frictionContact_new_from_filename(os.path.join(folder, "local.dat"))
        d = problem.dimension
        number = getattr(sn, f"SICONOS_FRICTION_{d}D_{name}")

        def prepare(options):
            driver = sn.fc2d_driver if d == 2 else sn.fc3d_driver
            r, u = np.zeros(d * problem.numberOfContacts), np.zeros(d * problem.numberOfContacts)
            return r, lambda: driver(problem, r, u, options)

    return number, prepare


def run(name, tol, repeats, folder):
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


def in_a_process(name, tol, seconds, repeats, folder):
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


def main():
    """Run every solver named on the command line."""
    folder, tol, seconds, repeats, *names = sys.argv[1:]
    warnings.simplefilter("ignore")
    for name in names:
        done = in_a_process(name, float(tol), float(seconds), int(repeats), folder)
        sys.stdout.write(json.dumps(done) + "\n")
        sys.stdout.flush()


main()

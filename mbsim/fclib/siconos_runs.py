"""Run Siconos' solvers on one problem; started by `peers` with the Python that has Siconos.

Usage: python siconos_runs.py PROBLEM.dat FOLDER TOL SECONDS REPEATS SOLVER...

Stands alone: nothing of mbsim is imported, for that Python does not have it. Every solver runs in
a process of its own, which an alarm ends. Writes FOLDER/SOLVER.npy (r) and prints a line of JSON a
solver: name, info, iterations, seconds (best of the repeats, the call of the solver alone).
"""

import json
import os
import signal
import sys
import time

import numpy as np
import siconos.numerics as sn

ITERATIONS = {"NSGS": 10**7, "CPG": 10**6, "ADMM": 10**6, "PROX": 2000, "TFP": 10**4}


def run(problem, size, name, tol, repeats, folder):
    """Solve with one solver and leave r in a file."""
    d = problem.dimension
    driver = sn.fc2d_driver if d == 2 else sn.fc3d_driver
    best = float("inf")
    spent = 0.0
    for _ in range(repeats):
        options = sn.SolverOptions(getattr(sn, f"SICONOS_FRICTION_{d}D_{name}"))
        options.dparam[sn.SICONOS_DPARAM_TOL] = tol
        options.iparam[sn.SICONOS_IPARAM_MAX_ITER] = ITERATIONS.get(name, 1000)
        r, u = np.zeros(size), np.zeros(size)
        began = time.perf_counter()
        info = driver(problem, r, u, options)
        seconds = time.perf_counter() - began
        best = min(best, seconds)
        spent += seconds
        if spent > 2.0:
            break
    np.save(os.path.join(folder, f"{name}.npy"), r)
    iterations = int(options.iparam[sn.SICONOS_IPARAM_ITER_DONE])
    return {"solver": name, "info": int(info), "iterations": iterations, "seconds": best}


def main():
    """Run every solver named on the command line."""
    path, folder, tol, seconds, repeats, *names = sys.argv[1:]
    problem = sn.frictionContact_new_from_filename(path)
    size = problem.dimension * problem.numberOfContacts
    quiet = os.open(os.devnull, os.O_WRONLY)
    for name in names:
        reading, writing = os.pipe()
        child = os.fork()
        if child == 0:
            signal.alarm(max(1, int(float(seconds)) + 1))
            os.dup2(quiet, 1)
            os.dup2(quiet, 2)
            done = run(problem, size, name, float(tol), int(repeats), folder)
            os.write(writing, json.dumps(done).encode())
            os._exit(0)
        os.close(writing)
        text = b""
        while True:
            piece = os.read(reading, 4096)
            if not piece:
                break
            text += piece
        os.close(reading)
        os.waitpid(child, 0)
        fallen = {"solver": name, "info": -99, "iterations": 0, "seconds": float("inf")}
        done = json.loads(text) if text else fallen
        sys.stdout.write(json.dumps(done) + "\n")
        sys.stdout.flush()


main()

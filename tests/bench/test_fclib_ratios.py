"""FCLIB problems by AUTO against the times of Siconos in a table, printed and never judged.

    python -m pytest -m bench -s tests/bench/test_fclib_ratios.py

Siconos' time is that of the fastest of its solvers which solved the problem: of its G_ solvers for
global problems, with `prep_s` where equality constraints were eliminated before.
"""

from __future__ import annotations

import csv
import math

import pytest

from helpers.folders import SHARED
from mbsim.fclib.compare import TOO_SHORT, compare

pytestmark = pytest.mark.bench


def fastest(tol):
    """Return the shortest time of Siconos by problem, and |F|/|q| and MERIT_1 of that solver."""
    found = {}
    with (SHARED / "siconos_baseline.csv").open(newline="", encoding="utf-8") as file:
        for row in csv.DictReader(file):
            if row["solved"] != "1" or float(row["tol"]) != tol:
                continue
            if row["kind"] == "global" and not row["solver"].startswith("G"):
                continue
            prepared = float(row["prep_s"] or 0.0) if "+eq" in row["kind"] else 0.0
            time = float(row["time_s"]) + prepared
            figures = tuple(float(row[name] or math.inf) for name in ("err_q", "merit1"))
            found[row["problem"]] = min(found.get(row["problem"], (math.inf,)), (time, *figures))
    return found


@pytest.mark.skipif(not SHARED.is_dir(), reason=f"{SHARED} is not there")
@pytest.mark.parametrize("tol", [1e-4, 1e-8])
def test_times_over_those_of_siconos(tol):
    files, theirs, ratios = sorted((SHARED / "fclib").glob("*.hdf5")), fastest(tol), {}
    rows = compare(
        files,
        tol,
        ["AUTO"],
        repeats=20,
        max_seconds=20.0,
        siconos_seconds=0.0,
        say=lambda line: None,
    )
    print(f"\ntol {tol:g}")
    worse = []
    for row in rows:
        best, error_q, merit1 = theirs.get(row.problem, (math.nan, math.inf, math.inf))
        print(
            f"{row.problem}: {row.status}, {1e3 * row.seconds:.3g} ms, "
            f"Siconos {1e3 * best:.3g} ms, "
            f"error {row.error:.1e}, |F|/|q| {row.error_q:.1e}, MERIT_1 {row.merit1:.1e}"
        )
        # below 1e-14 both are rounding
        if row.error_q > max(1.001 * error_q, 1e-14) or row.merit1 > max(1.001 * merit1, 1e-14):
            worse.append(f"{row.problem} (theirs {error_q:.1e} and {merit1:.1e})")
        if best >= TOO_SHORT:
            ratios[row.problem] = row.seconds / best
    mean = math.exp(sum(map(math.log, ratios.values())) / len(ratios))
    slowest = sorted(ratios, key=ratios.__getitem__)[-4:]
    print(
        f"{sum(row.solved for row in rows)} of {len(rows)} solved; geometric mean of {len(ratios)} "
        f"ratios {mean:.2f}, slowest " + ", ".join(f"{name} {ratios[name]:.1f}" for name in slowest)
    )
    print("|F|/|q| or MERIT_1 above Siconos' fastest: " + ", ".join(worse))
    assert len(rows) == len(files)

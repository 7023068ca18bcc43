"""Contact problems of `contact_problems.py`, each to 1e-4 within 5 s and to 1e-8 within 20 s.

    python tests/bench/fclib_cases.py contact_problems.py [PART OF A NAME ...]

The file has `cases()`: pairs of a name and of what makes W, q and mu, or H, M and v. Problems of
bodies are given as global ones. Prints contacts, status, error and seconds of either
tolerance, one core; compiling does not count.
"""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from typing import Any

import numpy as np
from scipy import sparse

from mbsim.fclib.problem import Global, Local, matrix
from mbsim.fclib.solve import solve

#: Tolerances, and the seconds that they are given.
ASKED = ((1e-4, 5.0), (1e-8, 20.0))


def problem_of(made: dict[str, Any]) -> Local | Global:
    """Return a case as it is given: global where there are bodies."""
    if "H" not in made:
        return Local(made["d"], matrix(made["W"], "triplet"), made["q"], made["mu"])
    mass, h = made["M"], made["H"]
    return Global(
        3,
        matrix(sparse.diags_array(mass), "triplet"),
        matrix(h, "triplet"),
        mass * made["v"],
        np.zeros(h.shape[1]),
        made["mu"],
    )


def main() -> None:
    """Print the table."""
    file, *parts = sys.argv[1:]
    spec = importlib.util.spec_from_file_location("contact_problems", Path(file))
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    for name, make in module.cases():
        if parts and not any(part in name for part in parts):
            continue
        problem = problem_of(make())
        line = f"{name:22} {len(problem.mu):6d}"
        for tol, seconds in ASKED:
            found = solve(problem, tol, max_seconds=seconds)
            line += f"  {tol:g}: {found.status:10} {found.figures.error:8.1e} {found.solve_s:7.3f}"
        print(line, flush=True)


if __name__ == "__main__":
    main()

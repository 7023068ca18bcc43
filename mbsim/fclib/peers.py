"""Debian's python3-siconos beside ours: the same problem, the same clock, our error.

Its local solvers take no equality constraints and no masses. They get what our condensation leaves,
and to their time comes that which SciPy takes for the same, in Siconos' Python: what one would do
there. A global problem without equality constraints goes to its global solvers as well, as it is.
Its Python need not be ours: it is asked through files.
"""

from __future__ import annotations

import functools
import json
import math
import os
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from mbsim.fclib.problem import Global, Local, Vector
    from mbsim.fclib.reduction import Blocks

#: Local solvers asked by spacedim, those that are fastest on some problem.
SOLVERS = {
    2: ("NSGS", "CPG", "LEMKE"),
    3: ("NSGS", "ADMM", "NSN_AC", "PROX", "TFP"),
}
#: Global ones; NSGS_WR condenses by itself.
GLOBAL_SOLVERS = ("GLOBAL_NSGS_WR", "GLOBAL_ADMM", "GLOBAL_NSN_AC")
_PYTHONS = ("/usr/bin/python3", "python3")


class Run(NamedTuple):
    """One run of a Siconos solver: its r (None if it was stopped), iterations, seconds."""

    solver: str
    r: Vector | None
    iterations: int
    seconds: float


@functools.cache
def _found() -> tuple[str | None, str]:
    """Return a Python that has all that `siconos_runs` imports, or None and why there is none."""
    reason = "Siconos is not installed; Debian's python3-siconos has it"
    for candidate in _PYTHONS:
        found = shutil.which(candidate)
        if found is None or not _imports(found, "siconos.numerics"):
            continue
        if _imports(found, "scipy.sparse.linalg"):
            return found, ""
        reason = f"{found} has Siconos but no SciPy, which it needs; Debian's python3-scipy has it"
    return None, reason


def _imports(interpreter: str, module: str) -> bool:
    """Return whether a Python can import a module; ours must not lend it any."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    asked = subprocess.run(
        [interpreter, "-c", f"import {module}"], capture_output=True, check=False, env=environment
    )
    return asked.returncode == 0


def python() -> str | None:
    """Return a Python that can run Siconos' solvers, or None."""
    return _found()[0]


def why_not() -> str:
    """Return why no Python can run Siconos' solvers; nothing if one can."""
    return _found()[1]


def run(
    problem: Local | Global, blocks: Blocks, tol: float, seconds: float, repeats: int
) -> list[Run]:
    """Run Siconos' solvers on a problem, given in blocks too, each at most `seconds` long."""
    d = 1 + len(blocks.tangent)
    found = python()
    if found is None or blocks.rolling or not blocks.contacts:
        return []
    with tempfile.TemporaryDirectory() as folder:
        _write(blocks, Path(folder) / "local.dat")
        names = SOLVERS[d]
        if problem.kind == "global" or problem.equalities:
            _write_parts(problem, Path(folder) / "parts.npz")
        if problem.kind == "global" and not problem.equalities and d == 3:
            names += GLOBAL_SOLVERS
        script = Path(__file__).with_name("siconos_runs.py")
        command = [found, str(script), folder, repr(tol), repr(seconds), str(repeats), *names]
        environment = dict(os.environ, OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")
        environment.pop("PYTHONPATH", None)
        done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
        return [
            _outcome(json.loads(line), Path(folder))
            for line in done.stdout.splitlines()
            if line.startswith("{")
        ]


def _outcome(line: dict[str, Any], folder: Path) -> Run:
    """Return a run from what was printed."""
    name, seconds = str(line["solver"]), float(line["seconds"])
    file = folder / f"{name}.npy"
    r = np.load(file) if file.is_file() and math.isfinite(seconds) else None
    return Run(f"Siconos {name}", r, int(line["iterations"]), seconds)


def _write_parts(problem: Local | Global, path: Path) -> None:
    """Write a problem's matrices by columns, and its vectors."""
    from scipy import sparse

    arrays: dict[str, Any] = {}
    for name in ("W", "V", "R", "M", "H", "G", "q", "s", "f", "w", "b", "mu"):
        part = getattr(problem, name, None)
        if isinstance(part, np.ndarray):
            arrays[name] = part
        elif part is not None:
            stored = sparse.csc_array(part.csr())
            stored.sort_indices()
            arrays |= {
                f"{name}_data": stored.data, f"{name}_indices": stored.indices,
                f"{name}_indptr": stored.indptr, f"{name}_shape": np.array(stored.shape),
            }  # fmt: skip
    np.savez(path, **arrays)


def _write(blocks: Blocks, path: Path) -> None:
    """Write Siconos' text format, W as a matrix of blocks (each by columns)."""
    nc, count = blocks.contacts, len(blocks.col)
    d = 1 + len(blocks.tangent)
    ends = " ".join(str(d * (k + 1)) for k in range(nc))
    lines = [
        f"{d}\n{nc}\n1\n{d * nc} {d * nc}\n{count}\n{nc} {nc}\n{ends}\n{ends}",
        f"{len(blocks.ptr)} {count}",
        " ".join(map(str, blocks.ptr)),
        " ".join(map(str, blocks.col)),
    ]
    for k in range(count):
        lines.append(f"{k}\n" + "\n".join(f"{x:.17e}" for x in blocks.val[k].T.ravel()))
    lines.append(" ".join(f"{x:.17e}" for x in blocks.q))
    lines.append(" ".join(f"{x:.17e}" for x in blocks.mu))
    path.write_text("\n".join(lines) + "\n", encoding="ascii")

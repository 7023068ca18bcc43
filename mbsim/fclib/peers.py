"""Debian's python3-siconos beside ours: the same problem, the same clock, our error.

Siconos gets the problem as our condensation leaves it (it takes no equality constraints), so its
time is that of its solver and of our condensation. Its Python need not be ours: it is asked
through files.
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
    from mbsim.fclib.problem import Vector
    from mbsim.fclib.reduction import Blocks

#: Solvers asked by spacedim, those that are fastest on some problem.
SOLVERS = {
    2: ("NSGS", "CPG", "LEMKE"),
    3: ("NSGS", "ADMM", "NSN_AC", "PROX", "TFP"),
}
_PYTHONS = ("/usr/bin/python3", "python3")


class Run(NamedTuple):
    """One run of a Siconos solver: its r (None if it was stopped), iterations, seconds."""

    solver: str
    r: Vector | None
    iterations: int
    seconds: float


@functools.cache
def python() -> str | None:
    """Return a Python that has Siconos, or None."""
    for candidate in _PYTHONS:
        found = shutil.which(candidate)
        if found is None:
            continue
        asked = subprocess.run(
            [found, "-c", "import siconos.numerics"], capture_output=True, check=False
        )
        if asked.returncode == 0:
            return found
    return None


def run(blocks: Blocks, tol: float, seconds: float, repeats: int) -> list[Run]:
    """Run Siconos' solvers on a problem in blocks, each at most `seconds` long."""
    d = 1 + len(blocks.tangent)
    found = python()
    if found is None or blocks.rolling or not blocks.contacts:
        return []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "problem.dat"
        _write(blocks, path)
        script = Path(__file__).with_name("siconos_runs.py")
        command = [found, str(script), str(path), folder, repr(tol), repr(seconds), str(repeats)]
        environment = dict(os.environ, OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")
        environment.pop("PYTHONPATH", None)
        done = subprocess.run(
            [*command, *SOLVERS[d]], capture_output=True, text=True, env=environment, check=False
        )
        return [
            _outcome(json.loads(line), Path(folder))
            for line in done.stdout.splitlines()
            if line.startswith("{")
        ]


def _outcome(line: dict[str, Any], folder: Path) -> Run:
    """Return a run from what was printed."""
    name = str(line["solver"])
    file = folder / f"{name}.npy"
    r = np.load(file) if file.is_file() and math.isfinite(line["seconds"]) else None
    return Run(f"Siconos {name}", r, int(line["iterations"]), float(line["seconds"]))


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

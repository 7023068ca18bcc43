"""References that are our own: a deck's paths at a tight tolerance, where no closed form exists."""

from __future__ import annotations

import functools
import tempfile
from pathlib import Path

import numpy as np


@functools.lru_cache(maxsize=8)
def paths(text: str, integrator: str, tol: float) -> tuple[np.ndarray, ...]:
    """Return the centres of a deck's bodies [m] at its rows, by rising id, shape (n, 3) each."""
    from mbsim.reader.xml import read_model
    from mbsim.run.simulation import simulate

    with tempfile.TemporaryDirectory() as folder:
        deck = Path(folder) / "deck.xml"
        deck.write_text(text, encoding="utf-8")
        results = simulate(read_model(deck), integrator=integrator, tol=tol)
    return tuple(np.asarray(results[f"bodies/{n}/position"]) for n in sorted(results.ids("bodies")))

"""References that are our own: a deck's path at a tight tolerance, where no closed form exists."""

from __future__ import annotations

import functools
import tempfile
from pathlib import Path

import numpy as np


@functools.lru_cache(maxsize=8)
def path(text: str, integrator: str, tol: float, body: int) -> np.ndarray:
    """Return a body's centre [m] at the rows of a deck, shape (n, 3)."""
    from mbsim.reader.xml import read_model
    from mbsim.run.simulation import simulate

    with tempfile.TemporaryDirectory() as folder:
        deck = Path(folder) / "deck.xml"
        deck.write_text(text, encoding="utf-8")
        results = simulate(read_model(deck), integrator=integrator, tol=tol)
    return np.asarray(results[f"bodies/{body}/position"])

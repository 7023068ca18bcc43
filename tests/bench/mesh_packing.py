"""What it takes to prepare the meshes of decks: before the first run ever, in a process, again.

    python tests/bench/mesh_packing.py [DECK ...]

prints processor time [s] of a run of 1 ns without what is kept, with the files of another process,
and with what this process has kept.
"""

from __future__ import annotations

import shutil
import sys
import time
from pathlib import Path

import mbsim
from mbsim.compile_model import kept_surfaces
from mbsim.core.code_cache import trusted_root

MODELS = Path(__file__).parents[2] / "models"
DECKS = [MODELS / name for name in ("gear_pair.xml", "bolt_on_plate.xml", "balls_in_bowl.xml")]


def timed(model: mbsim.Model) -> float:
    """Return processor time of a run that hardly moves [s]."""
    began = time.process_time()
    mbsim.simulate(model, end_time=1e-9)
    return time.process_time() - began


def main() -> None:
    """Print the table."""
    print(f"{'':24} {'first':>8} {'files':>8} {'kept':>8}")
    for deck in [Path(name) for name in sys.argv[1:]] or DECKS:
        model = mbsim.read_model(deck)
        timed(model)  # compiles, or loads what was
        figures = []
        for kept in ("nothing", "files", "all"):
            if kept == "nothing":
                shutil.rmtree(trusted_root() / "surfaces", ignore_errors=True)
            if kept != "all":
                kept_surfaces.forget()
            figures.append(timed(model))
        print(f"{deck.name:24} " + " ".join(f"{figure:8.3f}" for figure in figures), flush=True)


if __name__ == "__main__":
    main()

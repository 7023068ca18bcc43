"""What it takes to prepare the meshes of decks: before the first run ever, in a process, again.

    python tests/bench/mesh_packing.py [DECK ...]

prints processor time [s] of a run of 1 ns without what is kept, with the files of another process,
and with what this process has kept. Then for a box and balls, what one mesh takes to be packed and
to be read from its file [ms], with a layer and without.
"""

from __future__ import annotations

import shutil
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import trimesh

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


def least(call: Callable[[], object], repeats: int = 3) -> float:
    """Return the least processor time of a call [ms]."""
    times = []
    for _ in range(repeats):
        began = time.process_time()
        call()
        times.append(time.process_time() - began)
    return 1e3 * min(times)


def of_one_mesh() -> None:
    """Print what packing and reading take, by the number of triangles."""
    print(f"{'triangles':>10} {'layer':>6} {'packed':>8} {'read':>8}")
    balls = [trimesh.creation.icosphere(subdivisions=level) for level in (0, 1, 2)]
    for shape in [trimesh.creation.box(), *balls]:
        vertices, faces = np.asarray(shape.vertices), np.asarray(shape.faces)
        for layered in (True, False):

            def packed(mesh: tuple = (vertices, faces, layered)) -> None:
                kept_surfaces.pack_mesh(*mesh)

            def read(mesh: tuple = (vertices, faces, layered)) -> None:
                kept_surfaces.forget()
                kept_surfaces.kept_surface(*mesh)

            figures = f"{least(packed):8.3f} {least(read):8.3f}"
            print(f"{len(faces):10} {'yes' if layered else 'no':>6} {figures}", flush=True)


def main() -> None:
    """Print the tables."""
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
    of_one_mesh()


if __name__ == "__main__":
    main()

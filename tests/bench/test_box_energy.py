"""What elastic hits of two boxes keep of their energy and what flat pairs cost, printed.

python -m pytest -m bench -s tests/bench/test_box_energy.py
"""

from __future__ import annotations

import time

import numba
import numpy as np
import pytest

from helpers.decks import FLOATING, contact, cube, run_deck
from helpers.polyhedra import CUBE, box, box_mesh, mesh, rotation
from mbsim.compile_model.contacts import pair_address
from mbsim.core.address import call_int
from mbsim.geometry.catalog import PAIRS, POINT

pytestmark = pytest.mark.bench


def hits(kind, count, rng):
    """Yield orientations of two cubes about to hit."""
    for _ in range(count):
        a, b = rng.uniform(-3, 3, (2, 3))
        if kind == "face on face":
            a[0], b[1] = b[0], 0.0
            a[1] = rng.uniform(-0.02, 0.02)
        elif kind == "edge on edge":
            a, b = np.array([a[0], np.pi / 4, 0.0]), np.array([0.0, np.pi / 4, 0.0])
            a[1] += rng.uniform(-0.02, 0.02)
        yield a, b


def test_energy_of_elastic_hits(tmp_path):
    rng = np.random.default_rng(1)
    law = {"stiffness": 1e6, "exponent": 1.5, "damping": 0, "dmax": 1e-3}
    every = []
    print()
    for kind in ("random", "face on face", "edge on edge"):
        lost = []
        for a, b in hits(kind, 20, rng):
            p = (*rng.uniform(-0.12, 0.12, 2), 0.36)
            model = FLOATING + contact(300, 200, **law) + cube(2, (0, 0, 0), b)
            model += cube(3, p, a, v=(0.0, 0.0, -3.0), w=rng.uniform(-3, 3, 3))
            results = run_deck(tmp_path, model, end_time=0.15, tol=1e-8)
            if results["contacts/301/peak_force"] > 0.0:
                energy = results["energy/kinetic"]
                lost.append(abs(energy[-1] / energy[0] - 1.0))
        every += lost
        print(f"{kind}: {len(lost)} hits, median {np.median(lost):.1e}, worst {max(lost):.1e}")
    print(f"all: median {np.median(every):.1e}, 95 % below {np.percentile(every, 95):.1e}")


@numba.njit
def repeat(address, frame_i, size_i, frame_j, size_j, points, times):
    """Call a pair many times."""
    total = 0
    for _ in range(times):
        total += call_int(address, (frame_i, size_i, frame_j, size_j, points))
    return total


def test_cost_of_flat_pairs():
    place = {
        "lying": ([0.03, 0.02, 0.1999], np.eye(3)),
        "turned": ([0.0, 0.0, 0.1999], rotation([0, 0, 0.3])),
        "apart": ([0.0, 0.0, 0.21], np.eye(3)),
    }
    shapes = {"BOX": box(CUBE), "MESH": mesh(*box_mesh(CUBE))}
    print()
    for name in ("BOX-BOX", "MESH-BOX", "MESH-MESH"):
        i, j = (shapes[kind] for kind in name.split("-"))
        points = np.zeros((PAIRS[name].slots, POINT))
        costs = []
        for p, R in place.values():
            frames = [
                np.concatenate([p, R.ravel()]),
                np.concatenate([np.zeros(3), np.eye(3).ravel()]),
            ]
            arguments = (pair_address(PAIRS[name]), frames[0], i.size, frames[1], j.size, points)
            repeat(*arguments, 10)
            best = np.inf
            for _ in range(20):
                begin = time.perf_counter()
                repeat(*arguments, 2000)
                best = min(best, time.perf_counter() - begin)
            costs.append(f"{best / 2000 * 1e9:.0f}")
        print(f"{name}: {', '.join(place)}: {', '.join(costs)} ns")

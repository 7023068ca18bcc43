"""Print what one call of a closed-form pair costs, at rest and apart, in a compiled loop."""

from __future__ import annotations

import time

import numpy as np
from numba import njit

from helpers.pairs import LYING, ROLLER, SIZES, SLAB, UPRIGHT, frame, turned
from mbsim.compile_model.contacts import pair_address, region_address
from mbsim.core.address import call_int
from mbsim.geometry.catalog import AREA, PAIRS, POINT, REGION_ROWS, REGIONS

SHAPES = {
    **SIZES,
    "CYLINDER": ROLLER,
    "BOX": SLAB[1],
    "ELLIPSOID": np.array([0.1, 0.07, 0.05]),
    "SPHERE": np.array([0.1, 0.0, 0.0]),
}
ORIGIN = frame(np.zeros(3), UPRIGHT)
SIDE = frame(np.zeros(3), LYING)
LEAN = turned((0.3, 1, 0), 1e-3)
CALLS = 20_000
CASES = [
    ("sphere on the side of a cylinder", "SPHERE-CYLINDER", frame([0.199, 0, 0], UPRIGHT), ORIGIN),
    ("box on plane", "BOX-PLANE", frame([0, 0, SLAB[1][2] - 1e-3], LEAN), ORIGIN),
    ("box on box", "BOX-BOX", frame([0.3, 0.1, SLAB[1][2] - 1e-3], LEAN), SLAB[0]),
    ("cylinder on plane", "CYLINDER-PLANE", frame([0, 0, 0.099], LEAN), ORIGIN),
    ("ellipsoid on plane", "ELLIPSOID-PLANE", frame([0, 0, 0.0499], LEAN), ORIGIN),
    ("ellipsoid on ellipsoid", "ELLIPSOID-ELLIPSOID", frame([0.02, 0.01, 0.095], LEAN), ORIGIN),
    ("ellipsoid on box", "ELLIPSOID-BOX", frame([0.02, 0.01, 0.0499], LEAN), SLAB[0]),
    ("ellipsoid on the edge of a box", "ELLIPSOID-BOX", frame([1.06, 0.01, 0.02], LEAN), SLAB[0]),
    ("cylinder stands on box", "CYLINDER-BOX", frame([0, 0, 0.099], LEAN), SLAB[0]),
    ("cylinder stands over an edge", "CYLINDER-BOX", frame([0.95, 0, 0.099], LEAN), SLAB[0]),
    ("cylinder lies on box", "CYLINDER-BOX", frame([0, 0, 0.099], LEAN @ LYING), SLAB[0]),
    ("cylinder over box, apart", "CYLINDER-BOX", frame([0, 0, 0.3], LEAN @ LYING), SLAB[0]),
    ("cylinder on cylinder", "CYLINDER-CYLINDER", frame([0.03, 0, 0.199], LEAN), ORIGIN),
    ("cylinders side by side", "CYLINDER-CYLINDER", frame([0, 0.03, 0.199], LEAN @ LYING), SIDE),
    ("cylinders crossed", "CYLINDER-CYLINDER",
     frame([0, 0, 0.199], turned((0, 0, 1), 1.0) @ LYING), SIDE),
    ("rim on rim", "CYLINDER-CYLINDER",
     frame([0.15, 0.05, 0.18], turned((0.3, 1, 0), 0.6)), ORIGIN),
    ("cylinders apart", "CYLINDER-CYLINDER", frame([0.4, 0, 0.3], LEAN), ORIGIN),
]  # fmt: skip


@njit
def call_often(address, arrays, count):
    """Call a pair `count` times."""
    total = 0
    for _ in range(count):
        total += call_int(address, arrays)
    return total


def cost_of(address, arrays):
    """Return the time of a call [ns]."""
    call_often(address, arrays, 10)
    times = []
    for _ in range(5):
        begin = time.perf_counter()
        call_often(address, arrays, CALLS)
        times.append(time.perf_counter() - begin)
    return min(times) / CALLS * 1e9


def main():
    for label, name, frame_i, frame_j in CASES:
        size_i, size_j = (SHAPES[shape] for shape in name.split("-"))
        points = np.zeros((PAIRS[name].slots + REGION_ROWS, POINT))
        arrays = (frame_i, size_i, frame_j, size_j, points)
        region = ""
        if name in REGIONS:
            cost = cost_of(region_address(name), arrays)
            region = f", as one region {cost:.0f} ns, area {points[1, AREA]:.3g}"
        cost = cost_of(pair_address(PAIRS[name]), arrays)
        touching = int((points[: PAIRS[name].slots, 0] > 0.0).sum())
        print(f"{label:34s}{cost:8.0f} ns, {touching} points touch{region}")


if __name__ == "__main__":
    main()

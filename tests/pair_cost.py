"""Print what one call of a pair costs, of closed forms and of meshes, in a compiled loop.

Of meshes twice: where both trees are walked, and where what the walk found is kept.
"""

from __future__ import annotations

import time

import numpy as np
from numba import njit

from helpers.mesh_parts import gear
from helpers.pairs import LYING, ROLLER, SIZES, SLAB, UPRIGHT, frame, turned
from helpers.surfaces import PLANE, Meshed, sphere, torus
from mbsim.compile_model.contacts import pair_address, region_address
from mbsim.core.address import call_int
from mbsim.geometry.catalog import AREA, PAIRS, POINT, REGION_ROWS, REGIONS
from mbsim.model.flat_parts import fewer_triangles
from mbsim.model.mesh import merge_vertices
from mbsim.model.surface import LISTS

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
MESHES = "SURFACE-SURFACE"
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


@njit
def call_anew(address, arrays, rows, count):
    """Call a pair `count` times with other rows each time, so that no walk is kept for it."""
    total = 0
    for k in range(count):
        total += call_int(address, (*arrays, rows[k % len(rows)]))
    return total


def cost_of(call, *arguments, calls=CALLS):
    """Return the time of a call [ns]."""
    call(*arguments, 10)
    times = []
    for _ in range(5):
        begin = time.perf_counter()
        call(*arguments, calls)
        times.append(time.perf_counter() - begin)
    return min(times) / calls * 1e9


def mesh_cases():
    """Return label, pair, frame and size of both sides; and the meshes, whose memory these use."""
    tori = Meshed(*torus(0.1, 0.03, 64, 32))
    ball = Meshed(*sphere(0.1, 6), layered=False)
    ring = Meshed(*torus(0.1, 0.03, 100, 50), layered=False)
    pinion, wheel = (
        Meshed(*fewer_triangles(*merge_vertices(*gear(teeth, 2.0, 10.0, points))))
        for teeth, points in ((20, 60), (30, 40))
    )
    crossed = [frame([0.1, 0, 0.16 - depth], LYING) for depth in (5e-4, 3e-3)]
    # 0.04 mm of backlash, and 4 um of depth on the line of action
    facing = turned((0, 0, 1), np.pi / 30 + (0.04 + 0.004) / 30)
    tiny = np.array([0.02, 0.0, 0.0])
    return [
        (
            "two tori of 4096, crossed, 0.5 mm deep",
            MESHES,
            crossed[0],
            tori.size,
            ORIGIN,
            tori.size,
        ),
        ("the same 3 mm deep", MESHES, crossed[1], tori.size, ORIGIN, tori.size),
        (
            "the same 50 mm apart",
            MESHES,
            frame([0.1, 0, 0.21], LYING),
            tori.size,
            ORIGIN,
            tori.size,
        ),
        (
            "gears of 10^4 each, in touch",
            MESHES,
            frame([50, 0, 0], facing),
            wheel.size,
            ORIGIN,
            pinion.size,
        ),
        (
            "ball of 81920 on a plane, 1 % below",
            "SURFACE-PLANE",
            frame([0, 0, 0.098], UPRIGHT),
            ball.size,
            *PLANE,
        ),
        (
            "sphere on 10000",
            "SPHERE-SURFACE",
            frame([0.1499, 0, 0], UPRIGHT),
            tiny,
            ORIGIN,
            ring.size,
        ),
    ], (tori, ball, ring, pinion, wheel)


def print_meshes():
    cases, _meshes = mesh_cases()
    for label, name, *arrays in cases:
        rows = np.zeros((LISTS + 1, PAIRS[name].slots, POINT))
        address = pair_address(PAIRS[name])
        anew = cost_of(call_anew, address, tuple(arrays), rows, calls=50)
        kept = cost_of(call_often, address, (*arrays, rows[0]), calls=50)
        step = REGION_ROWS if PAIRS[name].patches else 1
        touching = int((rows[0, ::step, 0] > 0.0).sum())
        print(
            f"{label:38s}{anew / 1e3:8.1f} us, {kept / 1e3:.1f} us again in the same pose,"
            f" {touching} points touch"
        )


def main():
    for label, name, frame_i, frame_j in CASES:
        size_i, size_j = (SHAPES[shape] for shape in name.split("-"))
        points = np.zeros((PAIRS[name].slots + REGION_ROWS, POINT))
        arrays = (frame_i, size_i, frame_j, size_j, points)
        region = ""
        if name in REGIONS:
            cost = cost_of(call_often, region_address(name), arrays)
            region = f", as one region {cost:.0f} ns, area {points[1, AREA]:.3g}"
        cost = cost_of(call_often, pair_address(PAIRS[name]), arrays)
        touching = int((points[: PAIRS[name].slots, 0] > 0.0).sum())
        print(f"{label:34s}{cost:8.0f} ns, {touching} points touch{region}")
    print_meshes()


if __name__ == "__main__":
    main()

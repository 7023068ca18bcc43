"""A drum that turns about y, of the scenes `drum_300` and `drum_3000`, its spheres; SI, z up.

Its wall are the inner faces of a regular prism; its ends turn with it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mbsim.bench import parameters as p

SIDES = 24
PITCH, JITTER = 0.045, 0.002  # m, of the grid that the spheres start from
#: Of the drum, kg and kg m^2 about any axis: so heavy that nothing slows it.
HEAVY = 1e6
THICK = 0.1  # m, of the boxes that stand for faces where an engine has no moving plane


@dataclass(frozen=True)  # a NamedTuple has a method `count` of its own
class Drum:
    """Spheres fall into the drum, which turns from the start."""

    count: int
    apothem: float  # m, from the axis to a face
    across: int  # spheres along the axis
    radius: float = 0.02  # m
    density: float = 2500.0  # kg/m^3
    mu: float = 0.5
    spin: float = 3.0  # rad/s, about y
    end_time: float = 1.0  # s
    sample: float = 0.02  # s
    damping: float = 20.0  # N s/m, of our law

    @property
    def mass(self) -> float:
        """Of one sphere (kg)."""
        return self.density * 4.0 / 3.0 * math.pi * self.radius**3

    @property
    def half_length(self) -> float:
        """From the middle to an end (m)."""
        return self.across / 2.0 * PITCH + 0.05

    @property
    def face(self) -> float:
        """Width (m) of a box whose inner side covers a face, corners of the outside included."""
        return 2.0 * (self.apothem + THICK) * math.tan(math.pi / SIDES)


DRUMS = {300: Drum(300, 0.3, 8), 3000: Drum(3000, 0.6, 20)}


def angles() -> np.ndarray:
    """Where the faces are about the axis, from x towards z (SIDES,), rad."""
    return 2.0 * math.pi * np.arange(SIDES) / SIDES


def outward() -> np.ndarray:
    """Outward normals of the faces on the drum (SIDES, 3)."""
    at = angles()
    return np.column_stack([np.cos(at), np.zeros(SIDES), np.sin(at)])


def places(drum: Drum) -> np.ndarray:
    """Centres of the spheres at t = 0 (count, 3), m: a jittered grid, filled from below.

    The jitter is drawn by ``RandomState(0)``.
    """
    reach = drum.apothem - drum.radius - 2.0 * JITTER
    steps = int(reach / PITCH) + 1
    cells = (np.arange(-steps, steps) + 0.5) * PITCH
    y = (np.arange(drum.across) - (drum.across - 1) / 2.0) * PITCH
    grid = np.stack(np.meshgrid(cells, cells, y, indexing="ij"), axis=-1).reshape(-1, 3)
    grid = grid[np.hypot(grid[:, 0], grid[:, 1]) < reach][: drum.count, [1, 2, 0]]
    if len(grid) < drum.count:
        raise ValueError(f"count = {drum.count}: the drum holds {len(grid)}")
    moved: np.ndarray = np.random.RandomState(0).uniform(-JITTER, JITTER, grid.shape)
    return np.asarray(grid + moved)


def deepest(drum: Drum, centre: np.ndarray, quaternion: np.ndarray, spheres: np.ndarray) -> float:
    """Return the largest penetration over radius, of spheres (n, 3) in each other and the drum.

    `centre` and `quaternion` are the drum's in the same row; infinite where a place is not finite.
    """
    from scipy.spatial import cKDTree

    if not np.isfinite(spheres).all():
        return math.inf
    r = drum.radius
    inside = (spheres - centre) @ p.axes_of(quaternion)
    wall = float((inside @ outward().T).max()) - (drum.apothem - r)
    end = float(np.abs(inside[:, 1]).max()) - (drum.half_length - r)
    depth = max(wall, end, 0.0)
    pairs = cKDTree(spheres).query_pairs(2.0 * r, output_type="ndarray")
    if len(pairs):
        gaps = np.linalg.norm(spheres[pairs[:, 0]] - spheres[pairs[:, 1]], axis=1)
        depth = max(depth, float(2.0 * r - gaps.min()))
    return depth / r

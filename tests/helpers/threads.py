"""A bolt and a nut with a metric thread, as meshes (parts of `mesh_parts`)."""

from __future__ import annotations

import numpy as np

Mesh = tuple[np.ndarray, np.ndarray]
#: Where the profile's corners are along a pitch, the middle of the groove at 0, and their height
#: as a part of the thread's (ISO 68-1: crest P/8 wide, groove P/4, flanks of 30 degrees).
ALONG, UP = np.array([1 / 8, 7 / 16, 9 / 16, 7 / 8]), np.array([0.0, 1.0, 1.0, 0.0])


def _screw(
    pitch: float, end: float, root: float, crest: float, low: float, high: float, around: int
) -> np.ndarray:
    """Return the points of a screw's surface, (rows, around, 3) [L], that run along its helix.

    Radii go from `root` to `crest` along the profile; towards both ends, within 0.7 of the pitch,
    they go to the radius `end`. Row j closes with row j + 4 after a turn.
    """
    turns = np.arange(np.floor(low / pitch) - 2, np.ceil(high / pitch) + 2)
    s = (turns[:, None] + ALONG).ravel()
    radius = root + (crest - root) * np.tile(UP, len(turns))
    t = 2.0 * np.pi * np.arange(around) / around
    z = np.clip(pitch * (s[:, None] + t / (2.0 * np.pi)), low, high)
    part = np.clip(np.minimum(z - low, high - z) / (0.7 * pitch), 0.0, 1.0)
    r = end + part * (radius[:, None] - end)
    return np.stack([r * np.cos(t), r * np.sin(t), z], axis=2)


def _sides(rows: int, around: int) -> np.ndarray:
    """Return the triangles between the rows of a screw, seen from outside."""
    j, i = np.meshgrid(np.arange(rows - 5), np.arange(around), indexing="ij")
    on = np.where(i + 1 < around, j, j + 4)
    after = (i + 1) % around
    a, b = j * around + i, on * around + after
    c, d = (on + 1) * around + after, (j + 1) * around + i
    return np.concatenate(
        [np.stack([a, b, c], axis=2).reshape(-1, 3), np.stack([a, c, d], axis=2).reshape(-1, 3)]
    )


def _solid(vertices: np.ndarray, faces: np.ndarray) -> Mesh:
    """Return a mesh with equal points made one and without the triangles that then are none."""
    unique, index = np.unique(np.round(vertices, 9), axis=0, return_inverse=True)
    faces = index.reshape(-1)[faces]
    a, b, c = faces.T
    return unique, faces[(a != b) & (b != c) & (c != a)]


def _caps(inner: np.ndarray, outer: np.ndarray, upwards: bool) -> np.ndarray:
    """Return triangles between two rings of points (indices) in one plane."""
    i, o = inner, outer
    faces = np.concatenate(
        [
            np.column_stack([i, o, np.roll(o, -1)]),
            np.column_stack([i, np.roll(o, -1), np.roll(i, -1)]),
        ]
    )
    return faces if upwards else faces[:, ::-1]


def bolt(
    diameter: float, pitch: float, low: float, high: float, around: int, gap: float = 0.0
) -> Mesh:
    """Return a threaded rod about z from `low` to `high`, its radii greater by `gap`.

    Sizes [L]; `around` points on each turn.
    """
    crest = 0.5 * diameter + gap
    root = crest - 5 / 16 * np.sqrt(3.0) * pitch
    points = _screw(pitch, root, root, crest, low, high, around)
    t = 2.0 * np.pi * np.arange(around) / around
    ring = np.column_stack([root * np.cos(t), root * np.sin(t)])
    ends = [np.column_stack([ring, np.full(around, z)]) for z in (low, high)]
    vertices = np.vstack([points.reshape(-1, 3), *ends, [[0.0, 0.0, low], [0.0, 0.0, high]]])
    first = points.size // 3
    k = np.arange(around)
    middle = np.full(around, first + 2 * around)
    faces = np.concatenate(
        [
            _sides(len(points), around),
            np.column_stack([first + np.roll(k, -1), first + k, middle]),
            np.column_stack([first + around + k, first + around + np.roll(k, -1), middle + 1]),
        ]
    )
    return _solid(vertices, faces)


def nut(
    diameter: float,
    pitch: float,
    low: float,
    high: float,
    around: int,
    flat: float,
    gap: float,
) -> Mesh:
    """Return a six-sided nut about z, the thread of which stands `gap` off that of `bolt`.

    `flat` is half its width across flats [L]; `around` is a multiple of 6.
    """
    wide = 0.5 * diameter + gap
    root = wide - 5 / 16 * np.sqrt(3.0) * pitch
    points = _screw(pitch, wide, root, wide, low, high, around)
    t = 2.0 * np.pi * np.arange(around) / around
    off = (t + np.pi / 6) % (np.pi / 3) - np.pi / 6
    across = flat / np.cos(off)
    rings = [np.column_stack([r * np.cos(t), r * np.sin(t)]) for r in (wide, across)]
    vertices = np.vstack(
        [
            points.reshape(-1, 3),
            *(np.column_stack([ring, np.full(around, z)]) for ring in rings for z in (low, high)),
        ]
    )
    k = np.arange(around) + points.size // 3
    bore_low, bore_high, low_rim, high_rim = (k + n * around for n in range(4))
    outside = np.concatenate(
        [
            np.column_stack([low_rim, np.roll(low_rim, -1), np.roll(high_rim, -1)]),
            np.column_stack([low_rim, np.roll(high_rim, -1), high_rim]),
        ]
    )
    faces = np.concatenate(
        [
            _sides(len(points), around)[:, ::-1],
            outside,
            _caps(bore_low, low_rim, upwards=False),
            _caps(bore_high, high_rim, upwards=True),
        ]
    )
    return _solid(vertices, faces)

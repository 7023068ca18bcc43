"""Parts of the mesh decks in `models/`, and the script that writes their STL files.

``python tests/helpers/mesh_parts.py models`` writes all of them.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

Mesh = tuple[np.ndarray, np.ndarray]

#: Part of the space between two teeth that a gear's foot takes at its root; a mating tip passes by.
FOOT = 0.1


def circle(radius: float, z: float, count: int) -> np.ndarray:
    """Return `count` points (count, 3) [L] on a circle about z."""
    t = 2.0 * np.pi * np.arange(count) / count
    return np.column_stack([radius * np.cos(t), radius * np.sin(t), np.full(count, z)])


def polygon(sides: int, flat: float, z: float, count: int) -> np.ndarray:
    """Return `count` points on a regular polygon about z, `flat` [L] from its centre to a side.

    `count` must be a multiple of `sides`, so that its corners are among them.
    """
    t = 2.0 * np.pi * np.arange(count) / count
    off = (t + np.pi / sides) % (2.0 * np.pi / sides) - np.pi / sides
    ring = circle(1.0, 0.0, count) * (flat / np.cos(off))[:, None]
    # corners lie half a side from the x axis: turned so that one is on it
    return ring + np.array([0.0, 0.0, z])


def bands(rings: list[np.ndarray], closed: bool) -> Mesh:
    """Return triangles between rings of equally many points, each counter-clockwise about z.

    `closed` joins the last ring with the first; else both are closed by their centres. Rings run
    so that the solid is on the left of the way from one to the next as seen in (radius, z).
    """
    count = len(rings[0])
    vertices = np.concatenate(rings)
    k, after = np.arange(count), (np.arange(count) + 1) % count
    faces = []
    last = len(rings) if closed else len(rings) - 1
    for r in range(last):
        low, high = count * r, count * ((r + 1) % len(rings))
        faces.append(np.column_stack([low + k, low + after, high + after]))
        faces.append(np.column_stack([low + k, high + after, high + k]))
    if not closed:
        centres = [rings[0].mean(axis=0), rings[-1].mean(axis=0)]
        first, end = len(vertices), count * (len(rings) - 1)
        vertices = np.vstack([vertices, *centres])
        faces.append(np.column_stack([after, k, np.full(count, first)]))
        faces.append(np.column_stack([end + k, end + after, np.full(count, first + 1)]))
    return vertices, np.concatenate(faces)


def prism(outline: np.ndarray, height: float) -> Mesh:
    """Return the solid between two copies of an outline (n, 2) [L] that is a star about 0."""
    low, high = (
        np.column_stack([outline, np.full(len(outline), z)]) for z in (-height / 2, height / 2)
    )
    return bands([low, high], closed=False)


def gear(teeth: int, module: float, width: float, points: int, backlash: float = 0.02) -> Mesh:
    """Return an involute gear about z, a tooth on the x axis.

    Parameters
    ----------
    teeth : int
    module, width : float
        [L].
    points : int
        On each flank.
    backlash : float
        What the tooth is thinner than half the pitch, in modules.

    Notes
    -----
    Pressure angle 20 degrees, addendum 1 module, dedendum 1.25. At radius r the flank is
    pi/2z + inv(20) - inv(a) from the tooth's middle, cos a = r_b/r, inv a = tan a - a.
    """
    pressure = np.deg2rad(20.0)
    pitch = 0.5 * module * teeth
    base, tip, root = pitch * np.cos(pressure), pitch + module, pitch - 1.25 * module

    def inv(angle: np.ndarray | float) -> np.ndarray | float:
        return np.tan(angle) - angle

    # flanks of gears of 17 teeth and more touch above this
    low = max(base, root) + 0.1 * module
    # equal steps of the roll angle: the chords' height above the flank is then nearly one
    roll = np.linspace(np.sqrt((low / base) ** 2 - 1.0), np.sqrt((tip / base) ** 2 - 1.0), points)
    angle = np.arctan(roll)
    flank = base / np.cos(angle)
    half = np.pi / (2 * teeth) - 0.5 * backlash * module / pitch + inv(pressure) - inv(angle)
    # the foot widens towards the root, as a fillet does
    space = np.pi / teeth - half[0]
    radii = np.concatenate([[root], flank, flank[::-1], [root]])
    foot = half[0] + FOOT * space
    angles = np.concatenate([[-foot], -half, half[::-1], [foot]])
    turns = 2.0 * np.pi * np.arange(teeth) / teeth
    t = (turns[:, None] + angles).ravel()
    r = np.tile(radii, teeth)
    return prism(np.column_stack([r * np.cos(t), r * np.sin(t)]), width)


def ratchet(teeth: int, outer: float, inner: float, width: float) -> Mesh:
    """Return a ratchet wheel about z: teeth begin with a steep flank that faces clockwise."""
    fall = np.linspace(0.0, 0.98, 4)
    t = 2.0 * np.pi / teeth * (np.arange(teeth)[:, None] + fall).ravel()
    r = np.tile(outer - (outer - inner) * fall / fall[-1], teeth)
    return prism(np.column_stack([r * np.cos(t), r * np.sin(t)]), width)


def cam(base: float, lift: float, width: float, points: int) -> Mesh:
    """Return the convex cam that lifts a flat follower twice a turn.

    Its support function is h(t) = base + lift (1 - cos 2t)/2, its points are h n + h' n'.
    """
    t = 2.0 * np.pi * np.arange(points) / points
    h, slope = base + 0.5 * lift * (1.0 - np.cos(2.0 * t)), lift * np.sin(2.0 * t)
    n, across = np.array([np.cos(t), np.sin(t)]), np.array([-np.sin(t), np.cos(t)])
    return prism((h * n + slope * across).T, width)


def bolt(shank: float, length: float, flat: float, head: float, count: int = 48) -> Mesh:
    """Return a bolt about z: the underside of its hexagonal head at z = 0, its shank below."""
    return bands(
        [
            circle(shank, -length, count),
            circle(shank, 0.0, count),
            polygon(6, flat, 0.0, count),
            polygon(6, flat, head, count),
        ],
        closed=False,
    )


def plate(side: float, hole: float, height: float, count: int = 48) -> Mesh:
    """Return a square plate about z, its upper side at z = 0, with a round hole."""
    return bands(
        [
            polygon(4, 0.5 * side, -height, count),
            polygon(4, 0.5 * side, 0.0, count),
            circle(hole, 0.0, count),
            circle(hole, -height, count),
        ],
        closed=True,
    )


def bowl(radius: float, thick: float, around: int, down: int) -> Mesh:
    """Return half a spherical shell about z, open upwards; its centre is the origin."""
    outer = np.linspace(0.0, np.pi / 2, down + 1)[1:]
    rings = [
        circle((radius + thick) * np.sin(t), -(radius + thick) * np.cos(t), around) for t in outer
    ]
    rings += [circle(radius * np.sin(t), -radius * np.cos(t), around) for t in outer[::-1]]
    vertices, faces = bands(rings, closed=False)
    # the centres of the end rings become the lowest points of both spheres
    vertices[-2:, 2] = (-(radius + thick), -radius)
    return vertices, faces


def angle_piece(leg: float, thick: float, width: float) -> Mesh:
    """Return an L, its inner corner at the origin, legs along +x and +y."""
    a, b, w = leg, thick, 0.5 * width
    # eight points of the outline, so that each face of a leg has corners of its own
    outline = np.array(
        [[-b, -b], [0, -b], [a, -b], [a, 0], [0, 0], [0, a], [-b, a], [-b, 0]], dtype=float
    )
    return prism_of(outline, [[0, 1, 4], [0, 4, 7], [1, 2, 3], [1, 3, 4], [7, 4, 5], [7, 5, 6]], w)


def prism_of(outline: np.ndarray, caps: list[list[int]], half: float) -> Mesh:
    """Return the solid between z = -half and half of an outline with given triangles."""
    n = len(outline)
    vertices = np.concatenate([np.column_stack([outline, np.full(n, z)]) for z in (-half, half)])
    k, after = np.arange(n), (np.arange(n) + 1) % n
    top = np.array(caps)
    return vertices, np.concatenate(
        [
            np.column_stack([k, after, after + n]),
            np.column_stack([k, after + n, k + n]),
            top[:, ::-1],
            top + n,
        ]
    )


def pawl(length: float, thick: float, width: float) -> Mesh:
    """Return a pawl about z: a bar along -x from its pin at the origin, with a hook at its end."""
    b = 0.5 * thick
    outline = np.array(
        [[-length, -2 * b], [-length + thick, -b], [b, -b], [b, b], [-length, b]], dtype=float
    )
    return prism_of(outline, [[0, 1, 4], [1, 2, 4], [2, 3, 4]], 0.5 * width)


def octahedron(radius: float) -> Mesh:
    """Return a regular octahedron, its corners on the axes."""
    vertices = radius * np.array(
        [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], dtype=float
    )
    upper = np.array([[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4]])
    lower = upper[:, ::-1].copy()
    lower[lower == 4] = 5
    return vertices, np.concatenate([upper, lower])


def hexagon_ring(flat: float, hole: float, height: float, count: int = 24) -> Mesh:
    """Return a six-sided ring about z, the origin in its middle: a nut without a thread."""
    low, high = -0.5 * height, 0.5 * height
    return bands(
        [
            polygon(6, flat, low, count),
            polygon(6, flat, high, count),
            circle(hole, high, count),
            circle(hole, low, count),
        ],
        closed=True,
    )


PARTS: dict[str, Callable[[], Mesh]] = {
    "gear20.stl": lambda: gear(20, 2.0, 10.0, 60),
    "gear30.stl": lambda: gear(30, 2.0, 10.0, 40),
    "ratchet_wheel.stl": lambda: ratchet(16, 40.0, 34.0, 10.0),
    "ratchet_pawl.stl": lambda: pawl(30.0, 6.0, 8.0),
    "bolt.stl": lambda: bolt(5.0, 20.0, 8.0, 6.0),
    "plate.stl": lambda: plate(40.0, 5.5, 8.0),
    "bowl.stl": lambda: bowl(100.0, 5.0, 64, 16),
    "disc_cam.stl": lambda: cam(30.0, 10.0, 10.0, 360),
    "pile_angle.stl": lambda: angle_piece(16.0, 8.0, 14.0),
    "pile_ring.stl": lambda: hexagon_ring(14.0, 7.0, 10.0),
    "pile_octahedron.stl": lambda: octahedron(14.0),
    "angle_piece.stl": lambda: angle_piece(30.0, 10.0, 20.0),
}


def write_stl(path: Path, mesh: Mesh) -> None:
    """Write a binary STL file."""
    vertices, faces = mesh
    corners = vertices[faces].astype("<f4")
    rows = np.zeros(
        len(faces), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("more", "<u2")]
    )
    rows["corners"] = corners
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    rows["normal"] = normal / np.linalg.norm(normal, axis=1)[:, None]
    head = b"mbsim tests/helpers/mesh_parts.py".ljust(80)
    path.write_bytes(head + np.uint32(len(faces)).tobytes() + rows.tobytes())


if __name__ == "__main__":
    for name, make in PARTS.items():
        write_stl(Path(sys.argv[1]) / name, make())

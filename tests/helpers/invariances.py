"""Changes of a deck that must not change its motion, and what they make of the poses.

A change takes a random generator and the deck's root and alters it in place; it returns a function
from the bodies' poses of the plain deck to those of the changed one. Poses are a dictionary from a
body's id to positions (rows, 3), in the deck's unit of length, and rotations (rows, 3, 3) whose
columns are the axes of its frame.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

AXES = "xyz"
GRAVITY = ("grav_x", "grav_y", "grav_z")


def numbers(entry, names, empty=0.0):
    """Return attributes as an array."""
    return np.array([float(entry.get(name, empty)) for name in names])


def write(entry, names, values):
    """Write attributes."""
    for name, value in zip(names, values, strict=True):
        entry.set(name, repr(float(value)))


def markers(root):
    """Yield markers with their position and axes."""
    for entry in root.iter("Reference_Marker"):
        axes = np.eye(3)
        if "a00" in entry.attrib:
            axes = np.array([[float(entry.get(f"a{i}{j}")) for j in range(3)] for i in range(3)])
        yield entry, numbers(entry, [f"pos_{n}" for n in AXES]), axes


def write_marker(entry, position, axes):
    """Write a marker's position and axes."""
    write(entry, [f"pos_{n}" for n in AXES], position)
    for i in range(3):
        write(entry, [f"a{i}{j}" for j in range(3)], axes[i])


def moved(root, Q, d, mirror=None):
    """Turn all by Q and shift it by d; with `mirror` (a reflection) it is mirrored before.

    A mirrored frame is right-handed by turning its own x round: planes keep the normal along z,
    and shapes the end at which they are.
    """
    plain = mirror is None
    way = Q if plain else Q @ mirror
    own = np.eye(3) if plain else np.diag([-1.0, 1.0, 1.0])
    for entry, position, axes in markers(root):
        write_marker(entry, way @ position + d, way @ axes @ own)
    for entry in root.iter("Force_Gravity"):
        write(entry, GRAVITY, way @ numbers(entry, GRAVITY))
    turn = way * np.linalg.det(way)  # angular velocities are axial vectors
    for entry in root.iter("Body_Rigid"):
        for kind, T in (("v", way), ("w", turn)):
            names = [f"{kind}_ic_{n}" for n in AXES]
            if any(name in entry.attrib for name in names):
                write(entry, names, T @ numbers(entry, names))
                for name in names:
                    entry.set(f"{name}_flag", "TRUE")
    if not plain:
        mirror_meshes(root, own)
        joints = {e.get("id"): e.get("type") for e in root.iter("Constraint_Joint")}
        for entry in root.iter("Motion_Joint"):
            if joints[entry.get("joint_id")] == "REVOLUTE":
                entry.set("expr", f"-({entry.get('expr')})")

    def expected(poses):
        return {b: (p @ way.T + d, way @ R @ own) for b, (p, R) in poses.items()}

    return expected


def mirror_meshes(root, own):
    """Mirror the nodes of meshes in their own frames, and turn their faces over."""
    for graphic in root.iter("Post_Graphic"):
        nodes, faces = graphic.find("Nodes"), graphic.find("Faces")
        if nodes is None or faces is None:
            continue
        points = np.array(nodes.text.split(), dtype=float).reshape(-1, 3) @ own
        nodes.text = " ".join(repr(float(x)) for x in points.ravel())
        ids = np.array(faces.text.split(), dtype=int).reshape(-1, 3)
        faces.text = " ".join(map(str, ids[:, ::-1].ravel()))


def rotated(rng, root, size):
    """Turn the whole scene about the origin, gravity with it."""
    return moved(root, Rotation.random(random_state=rng).as_matrix(), np.zeros(3))


def shifted(rng, root, size):
    """Put the whole scene ten thousand sizes away."""
    way = rng.normal(size=3)
    return moved(root, np.eye(3), 1e4 * size * way / np.linalg.norm(way))


def mirrored(rng, root, size):
    """Mirror the scene in a plane of the axes."""
    S = np.eye(3)
    k = int(rng.integers(3))
    S[k, k] = -1.0
    return moved(root, np.eye(3), np.zeros(3), S)


def renumbered(rng, root, size):
    """Number all statements backwards and write them in another order."""
    given = [e for e in root.iter() if isinstance(e.tag, str)]
    ids = [int(v) for e in given for n, v in e.attrib.items() if n == "id" or n.endswith("_id")]
    top = 2 * max(ids) + 1
    for entry in given:
        for name, value in entry.attrib.items():
            if name == "id" or name.endswith("_id"):
                entry.set(name, str(top - int(value)))
    model = root.find("Model")
    entries = list(model)
    for entry in entries:
        model.remove(entry)
    for k in rng.permutation(len(entries)):
        model.append(entries[k])
    return lambda poses: {top - body: pose for body, pose in poses.items()}


def swapped(rng, root, size):
    """Let I and J of contacts and springs change places."""
    for entry in root.iter("Force_Contact", "Force_SpringDamper"):
        names = [n for n in entry.attrib if n.startswith("i_") or n.startswith("num_i_")]
        for one in names:
            other = one.replace("num_i_", "num_j_") if one.startswith("num") else "j" + one[1:]
            here, there = entry.get(one), entry.get(other)
            entry.set(one, there)
            entry.set(other, here)
    return lambda poses: poses


def idle(rng, root, size):
    """Add a free body that turns, far off and untouched."""
    model = root.find("Model")
    taken = [int(v) for e in root.iter() for n, v in e.attrib.items() if n == "id"]
    body = max(taken) + 1
    at = {f"pos_{n}": repr(float(x)) for n, x in zip(AXES, 300.0 * size * np.ones(3), strict=True)}
    sub = model.makeelement
    model.append(sub("Reference_Marker", {"id": str(body), "body_id": str(body), **at}))
    inertia = {f"inertia_{n}{n}": "1" for n in AXES}
    spin = {}
    for n, x in zip(AXES, rng.normal(size=3), strict=True):
        spin |= {f"w_ic_{n}": repr(float(x)), f"w_ic_{n}_flag": "TRUE"}
    facts = {"id": str(body), "cg_id": str(body), "mass": "1", **inertia, **spin}
    model.append(sub("Body_Rigid", facts))
    return lambda poses: poses


def rows(rng, root, size):
    """Write rows at other times, every third of them one of the plain deck."""
    run = next(root.iter("Simulate"))
    run.set("print_interval", repr(float(run.get("print_interval")) / 3.0))
    return lambda poses: poses


def longer(rng, root, size):
    """Let the run go on for half as long."""
    run = next(root.iter("Simulate"))
    step = float(run.get("print_interval"))
    count = round(float(run.get("end_time")) / step)
    run.set("end_time", repr(step * (count + count // 2)))
    return lambda poses: poses


#: What may be done to a deck.
CHANGES = {
    change.__name__: change
    for change in (rotated, shifted, mirrored, renumbered, swapped, idle, rows, longer)
}

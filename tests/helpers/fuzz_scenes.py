"""Scenes of the standing fuzz: those of `random_decks`, and ones of several bodies and drives."""

from __future__ import annotations

from copy import deepcopy

import numpy as np

from helpers import random_decks
from helpers.random_decks import SHAPES, SIZE, Writer, contact, gravity, inertia_of, rotation, shape

METHODS = ("AUTO", "DOPRI5", "DOP853", "RADAU5", "GALPHA")


def heap(rng, writer):
    """Two to four bodies fall onto a plane and onto each other."""
    count = int(rng.integers(2, 5))
    writer.marker(100, 1, (0, 0, 0))
    writer.add("Post_Graphic", id=100, type="Plane", rm_id=100)
    kinds = [str(rng.choice(SHAPES)) for _ in range(count)]
    for k, kind in enumerate(kinds):
        id, mass = 2 + k, float(10.0 ** rng.uniform(-1.0, 1.0))
        p = (*rng.normal(scale=0.2 * SIZE, size=2), (1.9 + 3.6 * k) * SIZE)
        writer.marker(10 * id, id, p, rotation(rng))
        spin = rng.normal(scale=2.0, size=3)
        writer.body(id, mass, inertia_of(rng, mass), rng.normal(scale=0.2, size=3), spin)
        shape(rng, writer, kind, 200 + k, 10 * id)
    gravity(writer)
    pairs = [(200 + k, 100) for k in range(count)]
    pairs += [(200 + k, 199 + k) for k in range(1, count)]
    laws = deepcopy(rng)
    for k, (i, j) in enumerate(pairs):
        # all of the same laws
        said = contact(rng if k == 0 else deepcopy(laws), writer, i, j, id=1 + k)
    return f"{' '.join(kinds)} {said[0]} {said[1]}", 0.6


def slide(rng, writer):
    """A box or a cylinder on its end slides along a slope and may come to rest on it."""
    angle, mass = float(rng.uniform(0.0, 0.6)), float(rng.uniform(0.3, 3.0))
    writer.marker(100, 1, (0, 0, 0))
    writer.add("Post_Graphic", id=100, type="Plane", rm_id=100)
    flat = SIZE * float(rng.uniform(0.2, 0.5))
    kind = str(rng.choice(["BoxDefinedFromCenter", "Cylinder"]))
    # it stands on the plane; a cylinder's marker is in the middle of its end face
    writer.marker(20, 2, (0.0, 0.0, flat))
    writer.marker(21, 2, (0.0, 0.0, 0.0))
    turn = (0.0, 0.0, float(rng.normal(scale=3.0)))
    writer.body(2, mass, inertia_of(rng, mass), (float(rng.normal(scale=0.5)), 0.1, 0.0), turn)
    facts = {"id": 200, "type": kind, "center_marker_id": 21 if kind == "Cylinder" else 20}
    if kind == "Cylinder":
        facts |= {"radius": writer.length(SIZE), "length": writer.length(2.0 * flat)}
    else:
        facts |= {
            f"length_{n}": writer.length(2.0 * x)
            for n, x in zip("xyz", (SIZE, 0.8 * SIZE, flat), strict=True)
        }
    writer.add("Post_Graphic", **facts)
    gravity(writer, 9.81 * np.array([np.sin(angle), 0.0, -np.cos(angle)]))
    said = contact(rng, writer, 200, 100)
    return f"{kind} {said[0]} {said[1]}", 0.5


def driven(rng, writer):
    """A crank with a motion shakes a body on a spring over a plane; a force of time on it."""
    F, L, T = writer.F, writer.L, writer.T
    mass, rate = float(rng.uniform(0.3, 3.0)), float(rng.uniform(3.0, 20.0)) * T
    writer.marker(11, 1, (0, 0, 4.0 * SIZE))
    writer.marker(20, 2, (0, 0, 4.0 * SIZE))
    writer.marker(21, 2, (SIZE, 0, 4.0 * SIZE))
    writer.body(2, 1.0, inertia_of(rng, 1.0), at_rest=True)
    axes = rotation(rng)
    writer.marker(12, 1, (0, 0, 4.0 * SIZE), axes)
    writer.marker(22, 2, (0, 0, 4.0 * SIZE), axes)
    writer.add("Constraint_Joint", id=1, type="REVOLUTE", i_marker_id=22, j_marker_id=12)
    expr = str(
        rng.choice([f"{rate!r}*TIME", f"0.8*SIN({rate!r}*TIME)", f"STEP(TIME,0,0,{0.3 / T!r},2)"])
    )
    writer.add("Motion_Joint", id=1, joint_id=1, val_type="D", expr=expr)
    kind = str(rng.choice(SHAPES))
    writer.marker(30, 3, (0.0, 0.0, 1.6 * SIZE), rotation(rng))
    writer.body(3, mass, inertia_of(rng, mass), rng.normal(scale=0.3, size=3), rng.normal(size=3))
    shape(rng, writer, kind, 200, 30)
    writer.marker(100, 1, (0, 0, 0))
    writer.add("Post_Graphic", id=100, type="Plane", rm_id=100)
    writer.add(
        "Force_SpringDamper",
        id=1,
        type="TRANSLATIONAL",
        i_marker_id=21,
        j_marker_id=30,
        stiffness=10.0 ** rng.uniform(1.0, 3.0) * L / F,
        damping=float(rng.choice([0.0, 1.0])) * L / (F * T),
        length=writer.length(2.0 * SIZE),
    )
    gravity(writer)
    said = contact(rng, writer, 200, 100)
    return f"{kind} {said[0]} {said[1]}", 0.6


SCENES = (random_decks.collision, random_decks.drop, random_decks.tree, heap, slide, driven)


def deck_of(seed, units=None):
    """Return the text of a seed's deck, what it holds, its units and its method.

    With `units` the same bodies are written in another of `random_decks.UNITS`.
    """
    rng = np.random.default_rng([seed, 24])
    own = int(rng.integers(len(random_decks.UNITS)))
    number = own if units is None else units
    writer = Writer(random_decks.UNITS[number])
    writer.add("Body_Rigid", id=1, isground="TRUE")
    writer.marker(10, 1, (0, 0, 0))
    scene = SCENES[int(rng.integers(len(SCENES)))]
    said, end = scene(rng, writer)
    method = str(rng.choice(METHODS))
    return writer.text(end, 20), f"{scene.__name__} {said}", number, method

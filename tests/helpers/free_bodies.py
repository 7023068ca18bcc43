"""Models of free bodies without graphics, made of elements and not of a deck's text."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from mbsim.compile_model.build import build
from mbsim.forces.catalog import FORCES
from mbsim.model.elements import Body, Gravity, Marker, MarkerForce, Model, Simulation, Units
from mbsim.run.loop import Runner
from mbsim.run.settings import settle
from mbsim.run.start import settle_contacts


def rotation(axis, angle):
    """Return the matrix that turns by `angle` about `axis` (Rodrigues)."""
    n = np.asarray(axis, dtype=float)
    n = n / np.linalg.norm(n)
    K = np.array([[0, -n[2], n[1]], [n[2], 0, -n[0]], [-n[1], n[0], 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


#: Axes that are no axes of anything else.
TILTED = rotation((1, 2, -1), 0.7)


def body(id, mass=1.0, inertia=(0.1, 0.1, 0.1), p=(0, 0, 0), v=(0, 0, 0), w=(0, 0, 0)):
    """Return a body and its cg marker, whose id is ten times that of the body."""
    made = Body(
        id,
        mass=mass,
        inertia=(*inertia, 0.0, 0.0, 0.0),
        cg_id=10 * id,
        v_ic=tuple(v),
        w_ic=tuple(w),
    )
    return made, Marker(10 * id, body_id=id, pos=tuple(p))


def force(kind, id, i, j, **values):
    """Return a force of a kind of `forces.catalog`, what is not given being its default."""
    known = {each.name: each.default for each in FORCES[kind].parameters}
    assert values.keys() <= known.keys(), values
    return MarkerForce(id, kind, "", i, j, tuple((known | values).items()))


def spring_damper(id, type, i, j, *numbers, **values):
    """Return a spring-damper: stiffness, damping, length, preload."""
    names = ("stiffness", "damping", "length", "preload")
    given = dict(zip(names, map(float, numbers), strict=False)) | values
    return force("SPRINGDAMPER", id, i, j, type=type, **given)


def bushing(id, i, j, stiffness=(0,) * 6, damping=(0,) * 6, preload=(0,) * 6):
    """Return a bushing: six stiffnesses, dampings and preloads."""
    axes = ("x", "y", "z", "tx", "ty", "tz")
    names = (f"{prefix}{axis}" for prefix in ("k", "c", "preload_") for axis in axes)
    values = map(float, (*stiffness, *damping, *preload))
    return force("BUSHING", id, i, j, **dict(zip(names, values, strict=True)))


def model(*bodies, markers=(), end_time=1.0, print_interval=0.01, g=(0, 0, 0), **elements):
    """Return a model of ground (1), bodies with their markers, more markers and elements."""
    made = [Body(1, is_ground=True), *(b for b, _ in bodies)]
    frames = [Marker(10, body_id=1), *(m for _, m in bodies), *markers]
    tables = {kind: {e.id: e for e in given} for kind, given in elements.items()}
    for element in tables.pop("marker_forces", {}).values():
        tables.setdefault("marker_forces", {}).setdefault(element.kind, {})[element.id] = element
    return Model(
        name="free",
        file="free.xml",
        sha256="",
        units=Units(),
        bodies={b.id: b for b in made},
        markers={m.id: m for m in frames},
        graphics={},
        contacts={},
        gravity=Gravity(tuple(map(float, g))),
        simulations=(Simulation(end_time=end_time, print_interval=print_interval),),
        **tables,
    )


class Kept:
    """A recorder that keeps output rows as compiled code leaves them, whatever results become."""

    FIELDS = ("time", "y", "accel", "energy", "applied", "joint", "value")

    def __init__(self, rows):
        self.rows, self.blocks, self.marked, self.flushes = rows, [], 0, 0

    def take(self):
        """Take the rows away."""
        n = self.rows.used[0]
        self.blocks.append([getattr(self.rows, field)[:n].copy() for field in self.FIELDS])
        self.rows.used[:] = 0

    def mark(self):
        """Keep in mind which rows are the run's for sure."""
        self.marked = len(self.blocks)

    def settle(self):
        """Let all be the run's."""

    def go_back(self):
        """Drop those since the mark."""
        del self.blocks[self.marked :]
        self.rows.used[:] = 0

    def due(self):
        """Return that nothing is to be written."""
        return False


def run(model, tol=1e-9, integrator=None):
    """Run a model; return its rows by field, and the runner."""
    settings = settle(model, None, None, integrator, tol)
    system = build(model)
    kept = Kept(system.scene.rows)
    runner = Runner(system, settings, kept, SimpleNamespace(line=print), print)
    y, f = runner.method.y, runner.method.k[0]
    settle_contacts(system, runner.hooks, settings, y, f, False, print, print)
    runner.run(None, False)
    kept.take()
    joined = [np.concatenate(parts) for parts in zip(*kept.blocks, strict=True)]
    return dict(zip(Kept.FIELDS, joined, strict=True)), runner


def imbalance(rows):
    """Return how far the sum of energies goes from its start, over the largest kinetic energy."""
    total = rows["energy"][:, :3].sum(axis=1)
    return np.abs(total - total[0]).max() / rows["energy"][:, 0].max()


class Silent:
    """A log that keeps nothing."""

    def line(self, text):
        pass

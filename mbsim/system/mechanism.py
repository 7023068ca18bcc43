"""Joints, motions and other constraints as a tree of bodies and equations that close its loops."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mbsim.model.elements import Model
from mbsim.system import arrays as a
from mbsim.system.markers import MarkerTable
from mbsim.system.programs import ProgramTable


@dataclass
class Mechanism:
    """The constraints of a model as arrays; `elements` has (statement, id) of each connection."""

    tree: a.Tree
    equations: a.Equations
    connections: a.Connections
    elements: list[tuple[str, int]]


def constrain(model: Model, markers: MarkerTable, programs: ProgramTable) -> Mechanism:
    """Return the constraints of a model."""
    nb = markers.ground
    none = np.zeros(0, dtype=np.int64)
    tree = a.Tree(
        none,
        none,
        np.full(nb + 1, -1, dtype=np.int64),
        none,
        none,
        none,
        np.zeros((0, 3), dtype=np.int64),
        np.zeros((0, 2), dtype=np.int64),
        np.zeros((0, 3)),
        np.zeros((0, 3, 3)),
        np.zeros((0, 3)),
        np.zeros((0, 3, 3)),
        none,
    )
    equations = a.Equations(
        np.zeros(1, dtype=np.int64),
        none,
        none,
        none,
        np.zeros(0),
        np.zeros(0),
        none,
        none,
        none,
        none,
        np.zeros((0, 2), dtype=np.int64),
        np.zeros(0),
        none,
        np.zeros(1, dtype=np.int64),
    )
    return Mechanism(tree, equations, a.Connections(none, none, none, none), [])


def sweep(mechanism: Mechanism) -> a.Sweep:
    """Return scratch for the recursion and the equations."""
    nt, ne = len(mechanism.tree.body), len(mechanism.equations.program)
    terms = len(mechanism.equations.kind)
    return a.Sweep(
        H=np.zeros((nt, 6, 6)),
        S=np.zeros((nt, 6, 6)),
        W=np.zeros((nt, 6, 6)),
        L=np.zeros((nt, 6, 6)),
        c=np.zeros((nt, 6)),
        p=np.zeros((nt, 6)),
        a=np.zeros((nt, 6)),
        push=np.zeros((nt, 6)),
        bias=np.zeros((nt, 6)),
        answer=np.zeros((nt, 6)),
        G=np.zeros((terms, 12)),
        rate=np.zeros((ne, 3)),
        A=np.zeros((ne, ne)),
        multiplier=np.zeros(ne),
        rhs=np.zeros(ne),
        skyline=np.zeros(ne, dtype=np.int64),
    )

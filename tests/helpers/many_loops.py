"""Mechanisms of many loops, and a choice of the factors that find their multipliers."""

from __future__ import annotations

import numpy as np

from helpers import mechanics as mech
from helpers.mechanism_decks import Joint, Scene
from mbsim.compile_model import build
from mbsim.compile_model.graph import make_graph

ROD, DOWN = 1.0 / 12.0, (0, -9.81, 0)
LONG_X, LONG_Y = (1e-2, ROD, ROD), (ROD, 1e-2, ROD)


def ladder(n, turn=0.5, mass=1.0, rung=1.0):
    """Two rails of n rods of 1 m hang from ground, joined by n rungs, and turn at a rate."""
    bodies, joints, above = [], [], [0, 0]
    for k in range(n):
        for x in (0.0, 1.0):
            v, inertia = (turn * (k + 0.5), 0, 0), np.array(LONG_Y) * mass
            bodies.append(mech.Body(mass, inertia, (x, -k - 0.5, 0), v=v, w=(0, 0, turn)))
        v = (turn * (k + 1.0), 0, 0)
        bodies.append(mech.Body(rung, np.array(LONG_X) * rung, (0.5, -k - 1.0, 0), v=v))
        left, right, bar = 3 * k + 1, 3 * k + 2, 3 * k + 3
        joints.append(Joint("REVOLUTE", left, above[0], (0, -k, 0)))
        joints.append(Joint("REVOLUTE", right, above[1], (1, -k, 0)))
        joints.append(Joint("REVOLUTE", bar, left, (0, -k - 1.0, 0)))
        joints.append(Joint("REVOLUTE", bar, right, (1, -k - 1.0, 0)))
        above = [left, right]
    return Scene(bodies, joints, DOWN)


def net(m, n):
    """Balls at m by n knots, tied by rods with a ball joint at each end; the first row is held."""
    bodies = [mech.Body(1.0, (1e-2,) * 3, (i, -j, 0)) for i in range(m) for j in range(n)]
    joints = [Joint("SPHERICAL", n * i + 1, 0, (i, 0, 0)) for i in range(m)]
    for i in range(m):
        for j in range(n):
            for di, dj in ((1, 0), (0, 1)):
                if i + di == m or j + dj == n:
                    continue
                middle = (i + 0.5 * di, -j - 0.5 * dj, 0)
                bodies.append(mech.Body(0.5, LONG_X if di else LONG_Y, middle))
                for a, b in ((i, j), (i + di, j + dj)):
                    joints.append(Joint("SPHERICAL", len(bodies), n * a + b + 1, (a, -b, 0)))
    return Scene(bodies, joints, (2.0, -9.81, 1.0))


def separate(n):
    """Four-bars that have nothing in common, n of them."""
    bodies, joints = [], []
    for k in range(n):
        x, first = 3.0 * k, 3 * k + 1
        for end in (0.0, 1.0):
            place = (x + end, 0.5, 0)
            bodies.append(mech.Body(1.0, LONG_Y, place, v=(0.5, 0, 0), w=(0, 0, -1)))
        bodies.append(mech.Body(1.0, LONG_X, (x + 0.5, 1, 0), v=(1, 0, 0)))
        joints.append(Joint("REVOLUTE", first, 0, (x, 0, 0)))
        joints.append(Joint("REVOLUTE", first + 1, 0, (x + 1, 0, 0)))
        joints.append(Joint("REVOLUTE", first + 2, first, (x, 1, 0)))
        joints.append(Joint("REVOLUTE", first + 2, first + 1, (x + 1, 1, 0)))
    return Scene(bodies, joints, DOWN)


def prefer(patch, sparse):
    """Let scenes that have many loops use sparse factors whatever these cost, or never."""

    def made(*given):
        graph = make_graph(*given)
        graph.cost[0] = 0.0 if sparse else np.inf
        return graph

    patch.setattr(build, "make_graph", made)

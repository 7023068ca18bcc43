"""Mechanisms of the IFToMM benchmark and of Exudyn, whose solutions are published."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from helpers import mechanics as mech
from helpers.mechanism_decks import Joint, Scene

EYE = np.eye(3)
X_UP = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])  # z of a marker along x
Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])  # z of a marker along y


def passive(results):
    """Return the change of kinetic and potential energy (nothing drives, nothing damps)."""
    total = results["energy/kinetic"] + results["energy/potential"]
    return total - total[0]


def pendulum(kind):
    """A01 of the IFToMM benchmark: 1 kg on 1 m, from the horizontal, in the xy-plane."""
    bob = mech.Body(1.0, (1e-9,) * 3, (-1, 0, 0))
    if kind == "DISTANCE":
        joint = Joint(kind, 1, 0, (-1, 0, 0), p_j=(0, 0, 0), rows=mech.distance(1.0))
    else:
        joint = Joint(kind, 1, 0)
    return Scene([bob], [joint], (0, -9.81, 0))


def heavy_top():
    """A top of 15 kg on its tip; start x = (0, 1, 0), spin 150 rad/s (Exudyn's heavyTop)."""
    w = (0.0, 150.0, -4.61538)
    top = mech.Body(15.0, (0.234375, 0.46875, 0.234375), (0, 1, 0), v=np.cross(w, (0, 1, 0)), w=w)
    return Scene([top], [Joint("SPHERICAL", 1, 0)])


def four_bars(n):
    """A02 of the IFToMM benchmark: n windows of links of 1 m, 1 kg, in the xy-plane."""
    bodies, joints = [], []
    rod = 1.0 / 12.0
    for k in range(n + 1):
        inertia = (rod, 1e-4 + 0 * rod, rod)
        v = (0.5, 0.0, 0.0)
        bodies.append(mech.Body(1.0, inertia, (k, 0.5, 0), v=v, w=(0, 0, -1)))
        joints.append(Joint("REVOLUTE", k + 1, 0, (k, 0, 0)))
    for k in range(n):
        bodies.append(mech.Body(1.0, (1e-4, rod, rod), (k + 0.5, 1, 0), v=(1, 0, 0)))
        joints.append(Joint("REVOLUTE", n + 2 + k, k + 1, (k, 1, 0)))
        joints.append(Joint("REVOLUTE", n + 2 + k, k + 2, (k + 1, 1, 0)))
    return Scene(bodies, joints, (0, -9.81, 0))


def bricard():
    """A04 of the IFToMM benchmark: five rods of 1 m, 1 kg, six hinges; one degree of freedom."""
    points = np.array(
        [(0, 0, 0), (1, 0, 0), (1, -1, 0), (1, -1, 1), (0, -1, 1), (0, 0, 1)], dtype=float
    )
    long, cross = 1 / 600, (1 + 0.01) / 12  # square section of 0.1 m
    bodies, joints = [], []
    for start, end in pairwise(points):
        along = np.abs(end - start) > 0.5
        inertia = np.where(along, long, cross)
        bodies.append(mech.Body(1.0, inertia, (start + end) / 2))
    axes = {"X": X_UP, "Y": Y_UP, "Z": EYE}
    for n, (point, axis) in enumerate(zip(points, "YZXYZX", strict=True)):
        joints.append(Joint("REVOLUTE", n + 1 if n < 5 else 0, n, point, axes[axis]))
    return Scene(bodies, joints, (0, -9.81, 0))

"""The walker of the scene `quadruped`: its legs, what drives them, and its law; all SI, z up.

Twelve hinges: in each leg one about x at the trunk, then hip and knee about y. Each is driven to a
target by a spring and a damper; that of a hip swings by `swing` sin(`rate` t), that of a knee by
-2 times as much, so that the feet push off the ground in one beat.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from mbsim.bench import parameters as p

_FOOT = p.LinearLaw(k=1e5, c=1e3)  # it lands without a rebound


@dataclass(frozen=True)
class Quadruped:
    """Dimensions and drives; a link's inertia is the same about all its axes."""

    trunk_mass: float = 10.0  # kg
    trunk_inertia: tuple[float, float, float] = (0.1, 0.25, 0.3)  # kg m^2
    height: float = 0.36  # m, of the trunk's centre at t = 0
    hip: tuple[float, float] = (0.2, 0.1)  # m, of a leg's first hinge along x and y
    shoulder: float = 0.06  # m, from the first hinge to the hip, along y
    length: float = 0.2  # m, of thigh and shank
    bend: float = 0.6  # rad, of a thigh from the vertical, backward; the shank is bent forward
    masses: tuple[float, float, float] = (0.5, 0.8, 0.2)  # kg, shoulder, thigh, shank
    inertias: tuple[float, float, float] = (2.5e-4, 0.0083 / 3.0, 0.0023 / 3.0)  # kg m^2
    foot: float = 0.02  # m, radius
    stiffness: float = 80.0  # N m/rad, of a drive
    damping: float = 2.0  # N m s/rad
    swing: float = 0.2  # rad
    rate: float = 12.566  # rad/s
    mu: float = 0.8
    law: p.LinearLaw = _FOOT
    end_time: float = 2.0  # s


WALKER = Quadruped()


class Link(NamedTuple):
    """A link at t = 0: where its hinge and its centre are [m], global, and the hinge's axis."""

    mass: float  # kg
    inertia: float  # kg m^2
    hinge: tuple[float, float, float]
    centre: tuple[float, float, float]
    axis: tuple[float, float, float]
    swing: float  # rad, of its drive's target
    parent: int  # in the list of links, -1 for the trunk


def legs() -> list[Link]:
    """The links in the order of the scene, a leg's shoulder, thigh and shank in turn."""
    w = WALKER
    x_axis, y_axis = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
    back, down = w.length * math.sin(w.bend), w.length * math.cos(w.bend)
    links: list[Link] = []
    for front in (1.0, -1.0):
        for left in (1.0, -1.0):
            x, inner = front * w.hip[0], left * w.hip[1]
            y = inner + left * w.shoulder
            first, hip = (x, inner, w.height), (x, y, w.height)
            knee = (x - back, y, w.height - down)
            middles = (
                (x, inner + left * w.shoulder / 2.0, w.height),
                (x - back / 2.0, y, w.height - down / 2.0),
                (x - back / 2.0, y, w.height - 1.5 * down),
            )
            swings = (0.0, w.swing, -2.0 * w.swing)
            axes = (x_axis, y_axis, y_axis)
            for k, hinge in enumerate((first, hip, knee)):
                parent = len(links) - 1 if k else -1
                links.append(
                    Link(w.masses[k], w.inertias[k], hinge, middles[k], axes[k], swings[k], parent)
                )
    return links


def foot_of(link: Link) -> tuple[float, float, float]:
    """Return where the foot at the end of a shank is at t = 0 [m]: the hip is above it."""
    x, y, z = link.hinge
    back, down = (WALKER.length * f(WALKER.bend) for f in (math.sin, math.cos))
    return (x + back, y, z - down)


def targets(times: np.ndarray) -> np.ndarray:
    """Return the drives' targets [rad] at times (n,), shape (n, 12)."""
    swings = np.array([link.swing for link in legs()])
    return np.outer(np.sin(WALKER.rate * times), swings)

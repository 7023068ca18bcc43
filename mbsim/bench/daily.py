"""Constants of the scenes of daily work but the walker: a chain on a box, and what rolls; SI, z up.

The walker's are in `quadruped`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mbsim.bench import linkages
from mbsim.bench import parameters as p


@dataclass(frozen=True)
class DrapedChain:
    """Links hinged about y fall straight onto a box, whose top is z = 0, and hang over it.

    A link touches with a ball at its end of larger x; links do not touch each other.
    """

    count: int
    length: float  # m, of a link
    mass: float  # kg, of a link
    inertia: tuple[float, float, float]  # kg m^2
    ball: float  # m
    height: float  # m, of all links at t = 0
    box: tuple[float, float, float]  # m, full edges
    floor: float  # m, height of the floor
    mu: float
    law: p.LinearLaw
    end_time: float  # s

    @property
    def start(self) -> float:
        """Where the first link begins along x [m]."""
        return -self.count * self.length / 2.0

    def centres(self) -> np.ndarray:
        """Centres of the links along x at t = 0, (count,), m."""
        return self.start + (np.arange(self.count) + 0.5) * self.length


#: The damper is that of a ball that hardly rebounds: c / (2 sqrt(k m)) = 1.1.
CHAIN = DrapedChain(
    count=50,
    length=0.05,
    mass=0.02,
    inertia=(5e-7, 0.02 * 0.05**2 / 12.0, 0.02 * 0.05**2 / 12.0),
    ball=0.012,
    height=0.1,
    box=(0.6, 1.0, 0.2),
    floor=-0.6,
    mu=0.3,
    law=p.LinearLaw(k=1e5, c=100.0),
    end_time=1.0,
)


def draped(
    place: np.ndarray, speed: np.ndarray, hinge: np.ndarray, rate: np.ndarray
) -> linkages.Poses:
    """Return the links from where the chain begins and from the angles of its hinges.

    Parameters
    ----------
    place, speed : ndarray (n, 2)
        x and z of the first link's free end [m], and their rates.
    hinge, rate : ndarray (n, count)
        Angle of the first link against x, then of each link against the one before, from x
        towards z [rad], and their rates.
    """
    angle, turn = np.cumsum(hinge, axis=1), np.cumsum(rate, axis=1)
    along = CHAIN.length * linkages.direction(angle)
    rates = CHAIN.length * linkages.turned(angle, turn)
    centres = place[:, None] + np.cumsum(along, axis=1) - along / 2.0
    moved = speed[:, None] + np.cumsum(rates, axis=1) - rates / 2.0
    return linkages.planar(centres, angle, moved, turn)


@dataclass(frozen=True)
class Train:
    """Equal cylinders along y roll down a slope one behind the other until a wall stops them.

    The slope is the plane z = 0 under tilted gravity g (sin, 0, -cos); the first is at x = 0, the
    others behind it.
    """

    count: int
    radius: float  # m
    length: float  # m
    mass: float  # kg
    pitch: float  # m, from axis to axis at t = 0
    tilt: float  # rad
    wall: float  # m, its place along x
    mu: float
    law: p.LinearLaw
    end_time: float  # s

    @property
    def inertia(self) -> tuple[float, float]:
        """About the axis, and across (kg m^2)."""
        along = self.mass * self.radius**2 / 2.0
        return along, along / 2.0 + self.mass * self.length**2 / 12.0

    def centres(self) -> np.ndarray:
        """Centres along x at t = 0, (count,), m; all at the height of a radius."""
        return -self.pitch * np.arange(self.count)

    def pull(self) -> tuple[float, float, float]:
        """Gravity (m/s^2)."""
        return (p.GRAVITY * math.sin(self.tilt), 0.0, -p.GRAVITY * math.cos(self.tilt))


#: The damper is that of an impact that hardly rebounds: c / (2 sqrt(k m)) = 0.7.
TRAIN = Train(
    count=10,
    radius=0.1,
    length=0.3,
    mass=5.0,
    pitch=0.25,
    tilt=math.radians(10.0),
    wall=3.0,
    mu=0.4,
    law=p.LinearLaw(k=1e6, c=3e3),
    end_time=3.0,
)

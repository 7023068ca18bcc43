"""The scenes of SimBenchmark, SI, z up, with the best of its published errors.

Source: D. Kang, J. Hwangbo, SimBenchmark: physics engine benchmark for robotics applications
(leggedrobotics.github.io/SimBenchmark, 2018). Its errors are means over time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mbsim.bench import parameters as p


@dataclass(frozen=True)
class Balls:
    """Equal balls without friction that fall onto a floor, and onto each other."""

    side: tuple[int, int, int]
    pitch: float  # m
    height: float  # m, of the lowest centres
    jitter: float  # m, across
    restitution: float
    end_time: float  # s
    published: str
    radius: float = 0.1  # m
    mass: float = 10.0  # kg

    def centres(self) -> np.ndarray:
        """Centres at t = 0, shape (n, 3), m."""
        axes = [np.arange(n) * self.pitch for n in self.side]
        grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        grid[:, 2] += self.height
        random = np.random.RandomState(0)
        grid[:, :2] += random.uniform(-self.jitter, self.jitter, (len(grid), 2))
        return grid

    def energy(self) -> float:
        """Energy of all at t = 0 over the floor [J]; it is never lost where `restitution` is 1."""
        return float(self.mass * p.GRAVITY * self.centres()[:, 2].sum())


BOUNCING = Balls((7, 7, 1), 0.42, 5.0, 0.0, 1.0, 20.0, "RaiSim 1.9e-10, dt 1e-5 s")
PILE = Balls((6, 6, 6), 0.21, 0.101, 0.001, 0.0, 10.0, "DART 2.0e-7, dt 1e-4 s")
ELASTIC = Balls((6, 6, 6), 0.21, 1.101, 0.001, 1.0, 10.0, "RaiSim 1.1e-3, dt 1e-4 s")


@dataclass(frozen=True)
class Rolling:
    """A box that a force pushes over the floor, and balls that roll on it."""

    box: tuple[float, float, float] = (20.0, 20.0, 1.0)  # m, full edges
    box_mass: float = 10.0  # kg
    balls: int = 5  # along a side
    pitch: float = 2.0  # m
    radius: float = 0.5  # m
    mass: float = 1.0  # kg
    mu_floor: float = 0.4
    mu_balls: float = 0.8
    force: float = 150.0  # N
    direction: tuple[float, float] = (0.5, 0.8660254037844386)
    end_time: float = 4.0  # s
    published: str = "Bullet 7.3e-28, ODE 7.6e-9, RaiSim 4.1e-7, MuJoCo 2.0e-3, dt 1e-3 s"

    def centres(self) -> np.ndarray:
        """Centres of the balls at t = 0, shape (n, 3), m."""
        line = (np.arange(self.balls) - (self.balls - 1) / 2.0) * self.pitch
        x, y = np.meshgrid(line, line, indexing="ij")
        z = np.full(x.size, self.box[2] + self.radius)
        return np.column_stack([x.ravel(), y.ravel(), z])

    def accelerations(self) -> tuple[float, float]:
        """Accelerations of the box and of a ball along the force [m/s^2].

        A ball that rolls without slip is pushed by f = m a, and a_box = a + f r^2/I = 3.5 f/m.
        """
        count = self.balls**2
        floor = self.mu_floor * (self.box_mass + count * self.mass) * p.GRAVITY
        push = (self.force - floor) / self.box_mass / (3.5 / self.mass + count / self.box_mass)
        return 3.5 * push / self.mass, push / self.mass


ROLLING = Rolling()

"""Where the bodies of S8_n and S8b are, from their angles; all in the plane x-z.

Angles count from x towards z, so a rotation by a is one by a about -y.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mbsim.bench import parameters as p


class Poses(NamedTuple):
    """Rows of bodies in the global frame, as an outcome has them."""

    position: np.ndarray  # (n, bodies, 3), m
    quaternion: np.ndarray  # (n, bodies, 4), w first
    velocity: np.ndarray  # (n, bodies, 3), m/s
    angular_velocity: np.ndarray  # (n, bodies, 3), rad/s


def planar(place: np.ndarray, angle: np.ndarray, velocity: np.ndarray, rate: np.ndarray) -> Poses:
    """Return poses from places and velocities (n, bodies, 2) in x and z, angles and rates."""
    shape = angle.shape
    position, spatial, spin = (np.zeros((*shape, 3)) for _ in range(3))
    quaternion = np.zeros((*shape, 4))
    position[..., ::2], spatial[..., ::2] = place, velocity
    spin[..., 1] = -rate
    quaternion[..., 0], quaternion[..., 2] = np.cos(angle / 2.0), -np.sin(angle / 2.0)
    return Poses(position, quaternion, spatial, spin)


def direction(angle: np.ndarray) -> np.ndarray:
    """Return unit vectors (..., 2) in x and z at an angle."""
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def turned(angle: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Return the rates of `direction`."""
    return np.stack([-np.sin(angle) * rate, np.cos(angle) * rate], axis=-1)


def chain(angle: np.ndarray, rate: np.ndarray) -> Poses:
    """Return the rods of S8_n from their angles and rates against x, (n, rods)."""
    length = p.S8.length / angle.shape[-1]
    along, rates = length * direction(angle), length * turned(angle, rate)
    place = np.cumsum(along, axis=-2) - along / 2.0
    return planar(place, angle, np.cumsum(rates, axis=-2) - rates / 2.0, rate)


def hinged_chain(hinge: np.ndarray, rate: np.ndarray) -> Poses:
    """Return the rods of S8_n from the angles of their hinges, (n, rods)."""
    return chain(np.cumsum(hinge, axis=-1), np.cumsum(rate, axis=-1))


def slider_crank(
    angle: np.ndarray, rate: np.ndarray, slider: np.ndarray, speed: np.ndarray
) -> Poses:
    """Return crank, rod and slider of S8b.

    Parameters
    ----------
    angle, rate : ndarray (n, 2)
        Of crank and rod against x, and their rates.
    slider, speed : ndarray (n,)
        Its place along x and its rate.
    """
    half = np.array([p.S8B.crank_length, p.S8B.rod_length])[:, None] / 2.0
    reach, reach_rate = half * direction(angle), half * turned(angle, rate)
    place = np.zeros((len(angle), 3, 2))
    velocity = np.zeros_like(place)
    for out, step in ((place, reach), (velocity, reach_rate)):
        out[:, 0] = step[:, 0]
        out[:, 1] = 2.0 * step[:, 0] + step[:, 1]
    place[:, 2, 0], velocity[:, 2, 0] = slider, speed
    still = np.zeros((len(angle), 1))
    return planar(place, np.hstack([angle, still]), velocity, np.hstack([rate, still]))


class CrankStart(NamedTuple):
    """S8b at t = 0: angles (rad) against x, the slider's place (m), and their rates."""

    crank: float
    rod: float
    slider: float
    crank_rate: float
    rod_rate: float
    slider_rate: float


def crank_start() -> CrankStart:
    """Return the start of S8b, whose loop is closed: l1 sin(a) + l2 sin(b) = 0."""
    s = p.S8B
    rod = -math.asin(s.crank_length * math.sin(s.angle) / s.rod_length)
    rod_rate = -s.crank_length * math.cos(s.angle) * s.speed / (s.rod_length * math.cos(rod))
    return CrankStart(
        s.angle,
        rod,
        s.crank_length * math.cos(s.angle) + s.rod_length * math.cos(rod),
        s.speed,
        rod_rate,
        -s.crank_length * math.sin(s.angle) * s.speed - s.rod_length * math.sin(rod) * rod_rate,
    )


def crank_poses() -> Poses:
    """Return the bodies of S8b at t = 0, one row."""
    start = crank_start()
    return slider_crank(
        np.array([[start.crank, start.rod]]),
        np.array([[start.crank_rate, start.rod_rate]]),
        np.array([start.slider]),
        np.array([start.slider_rate]),
    )

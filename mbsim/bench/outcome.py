"""What one run of one scene gives, whichever engine made it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Outcome(NamedTuple):
    """Timed run of a scene; SI units, global frame, bodies in the order of the scene.

    Attributes
    ----------
    wall_s
        Seconds spent in the stepping loop alone, warm, storing of the rows included; scaled to
        the whole scene where a long run was cut short.
    time
        (n,) times of the rows, s; every 10 ms unless the scene says otherwise.
    position
        (n, bodies, 3) centres of mass, m.
    quaternion
        (n, bodies, 4) unit quaternions body to world, w first.
    velocity
        (n, bodies, 3) of the centres of mass, m/s.
    angular_velocity
        (n, bodies, 3) in the global frame, rad/s.
    extra
        Numbers that rows cannot give, e.g. `pen_max_over_r`, `steps`, `evaluations`.
    note
        What a reader of the table must know about this run; empty where nothing.
    """

    wall_s: float
    time: np.ndarray
    position: np.ndarray
    quaternion: np.ndarray
    velocity: np.ndarray
    angular_velocity: np.ndarray
    extra: dict[str, float]
    note: str

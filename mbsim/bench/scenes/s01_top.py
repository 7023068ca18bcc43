"""S1 and S10c: a body free of torque turns over and over; its end attitude shows any error."""

from __future__ import annotations

from functools import partial

import numpy as np

from mbsim.bench import deck as text
from mbsim.bench import parameters as p
from mbsim.bench.outcome import Outcome
from mbsim.bench.scene import Scene, Target, Variation
from mbsim.core.rotation import matrix_from_quaternion


def _deck(top: p.FreeBody, variation: Variation) -> str:
    """Return the deck: one body and nothing that acts on it."""
    return text.deck(
        "A top free of torque, spun about its middle axis",
        [text.GROUND, text.body(2, top.mass, top.inertia, spin=top.spin)],
        top.end_time,
    )


def _errors(top: p.FreeBody, outcome: Outcome, variant: str) -> dict[str, float]:
    """Return angle of the end attitude [rad] and drift of angular momentum and energy."""
    R = rotations(outcome.quaternion[:, 0])
    w = outcome.angular_velocity[:, 0]
    I = np.diag(top.inertia)  # noqa: E741
    L = np.einsum("nij,jk,nlk,nl->ni", R, I, R, w)
    energy = 0.5 * (w * L).sum(axis=1)
    L0 = I @ np.array(top.spin)
    energy0 = 0.5 * float(L0 @ top.spin)
    return {
        "angle": attitude_error(outcome.quaternion[-1, 0], np.array(top.end_quaternion)),
        "L_rel": float(np.linalg.norm(L - L0, axis=1).max() / np.linalg.norm(L0)),
        "E_rel": float(np.abs(energy / energy0 - 1.0).max()),
    }


def rotations(q: np.ndarray) -> np.ndarray:
    """Return rotation matrices (n, 3, 3) of unit quaternions (n, 4), w first."""
    R = np.empty((len(q), 3, 3))
    for row, place in zip(q, R, strict=True):
        matrix_from_quaternion(row, place)
    return R


def attitude_error(q: np.ndarray, reference: np.ndarray) -> float:
    """Return the angle [rad] between two attitudes; q and -q are the same one."""
    w, v = reference[0], reference[1:]
    # vector part of conj(reference) q: its length is the sine of half the angle
    part = w * q[1:] - q[0] * v - np.cross(v, q[1:])
    length = np.linalg.norm(part) / (np.linalg.norm(q) * np.linalg.norm(reference))
    return float(2.0 * np.arcsin(min(1.0, float(length))))


def _scene(name: str, title: str, top: p.FreeBody, ratio: float) -> Scene:
    """Return one of the two scenes."""
    return Scene(
        name=name,
        title=title,
        end_time=top.end_time,
        measure="angle",
        unit="angle between end attitude and reference [rad]",
        deck=partial(_deck, top),
        errors=partial(_errors, top),
        targets=(Target(ratio),),
    )


SCENES = (
    _scene("S1", "free top, 10 rad/s, turns over repeatedly, 10 s", p.S1, 1 / 3),
    _scene("S10c", "free top, 1000 rad/s, 1 s", p.S10C, 1 / 3),
)

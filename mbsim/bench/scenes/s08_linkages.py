"""S8_n and S8b: a chain of hinged rods swings; a slider-crank runs free, its loop closed."""

from __future__ import annotations

from functools import partial

import numpy as np

from mbsim.bench import deck as text
from mbsim.bench import linkages, oracle
from mbsim.bench import parameters as p
from mbsim.bench.outcome import Outcome
from mbsim.bench.scene import Scene, Target, Variation
from mbsim.bench.scenes.s01_top import rotations

#: Axes of markers: z along global y for a hinge, along x for a slider.
HINGE = ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0))
ALONG_X = ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))

#: Errors that are compared; the references are good to 1e-11, by the shared ones.
COMPARED = (1e-10, 1e-3)
TOLERANCES = (1e-2, *(10.0**-k for k in range(3, 14)))


def _rods(poses: linkages.Poses, masses: list[float], lengths: list[float]) -> list[str]:
    """Return bodies 2, 3, ... as rods along their own x, at the first row of `poses`."""
    axes = rotations(poses.quaternion[0])
    return [
        text.body(
            2 + k,
            mass,
            p.rod_inertia(mass, length),
            poses.position[0, k].tolist(),
            poses.velocity[0, k].tolist(),
            poses.angular_velocity[0, k].tolist(),
            (axes[k] + 0.0).tolist(),  # no -0.0
        )
        for k, (mass, length) in enumerate(zip(masses, lengths, strict=True))
    ]


def _hinge(number: int, i: int, j: int, place: list[float]) -> list[str]:
    """Return a REVOLUTE joint of bodies i and j about y, and its markers."""
    mine, other = 10 * i + 1, 10 * j + 2
    return [
        text.marker(mine, i, place, HINGE),
        text.marker(other, j, place, HINGE),
        text.joint(number, "REVOLUTE", mine, other),
    ]


def chain_deck(count: int, end_time: float) -> str:
    """Return the deck: each rod hinged to the one before, the first one to ground."""
    length, flat = p.S8.length / count, np.zeros((1, count))
    rods = _rods(linkages.chain(flat, flat), [p.S8.mass] * count, [length] * count)
    hinges = [
        line for k in range(count) for line in _hinge(501 + k, 2 + k, 1 + k, [k * length, 0.0, 0.0])
    ]
    return text.deck(
        f"A chain of {count} hinged rods swings down from the horizontal",
        [text.GROUND, *rods, *hinges, text.gravity()],
        end_time,
    )


def _ends(outcome: Outcome, bodies: slice, length: float) -> tuple[np.ndarray, np.ndarray]:
    """Return both ends of rods along their own x, (n, rods, 3) each."""
    place, q = outcome.position[:, bodies], outcome.quaternion[:, bodies]
    x = rotations(q.reshape(-1, 4))[:, :, 0].reshape(place.shape)
    return place - length / 2.0 * x, place + length / 2.0 * x


def _at_rows(reference: np.ndarray, outcome: Outcome) -> np.ndarray:
    """Return a reference that is sampled as the rows are asked for, at the rows there are."""
    return np.asarray(reference[np.rint(outcome.time / p.SAMPLE).astype(int)])


def _chain_errors(count: int, outcome: Outcome, variant: str) -> dict[str, float]:
    """Return errors of the free end [m], of energy over the weight times 1 m, and gaps [m]."""
    length = p.S8.length / count
    near, far = _ends(outcome, slice(None), length)
    away = np.linalg.norm(far[:, -1, ::2] - _at_rows(oracle.s8_tip(count), outcome), axis=1)
    hinge = np.concatenate([np.zeros_like(far[:, :1]), far[:, :-1]], axis=1)
    energy = _chain_energy(outcome, length)
    weight = count * p.S8.mass * p.GRAVITY
    return {
        "tip_max": float(away.max()),
        "tip_rms": float(np.sqrt(np.mean(away**2))),
        "tip_end": float(away[-1]),
        "E_rel": float(np.abs(energy - energy[0]).max() / weight),
        "joint_drift": float(np.linalg.norm(near - hinge, axis=2).max()),
    }


def _chain_energy(outcome: Outcome, length: float) -> np.ndarray:
    """Return the energy of rods in the plane x-z at every row (n,), J."""
    across = p.ROD_ACROSS * length**2
    speed2 = (outcome.velocity**2).sum(axis=2) + across * outcome.angular_velocity[..., 1] ** 2
    each = speed2 / 2.0 + p.GRAVITY * outcome.position[..., 2]
    return np.asarray(p.S8.mass * each.sum(axis=1))


def _crank_deck(variation: Variation) -> str:
    """Return the deck: crank 2, rod 3, slider 4; three hinges and a slide."""
    s, poses = p.S8B, linkages.crank_poses()
    # a slider does not turn: its inertia moves nothing
    bodies = _rods(
        poses,
        [s.crank_mass, s.rod_mass, s.slider_mass],
        [s.crank_length, s.rod_length, s.crank_length],
    )
    pin = (2.0 * poses.position[0, 0]).tolist()
    at = poses.position[0, 2].tolist()
    return text.deck(
        "A slider-crank runs free",
        [
            text.GROUND,
            *bodies,
            *_hinge(501, 2, 1, [0.0, 0.0, 0.0]),
            *_hinge(502, 3, 2, pin),
            *_hinge(503, 4, 3, at),
            text.marker(43, 4, at, ALONG_X),
            text.marker(13, 1, [0.0, 0.0, 0.0], ALONG_X),
            text.joint(504, "TRANSLATIONAL", 43, 13),
            text.gravity(),
        ],
        s.end_time,
    )


def _crank_errors(outcome: Outcome, variant: str) -> dict[str, float]:
    """Return the largest error of the crank's angle [rad] and the largest gap in a joint [m]."""
    middle = outcome.position[:, 0]
    angle = np.unwrap(np.arctan2(middle[:, 2], middle[:, 0]))
    centre, pin = _ends(outcome, slice(0, 1), p.S8B.crank_length)
    start, end = _ends(outcome, slice(1, 2), p.S8B.rod_length)
    slider = outcome.position[:, 2:3]
    gaps = (centre, pin - start, end - slider, slider[..., 1:])
    return {
        "crank_angle_max": float(np.abs(angle - _at_rows(oracle.s8b_angle(), outcome)).max()),
        "loop_gap": max(float(np.linalg.norm(gap, axis=-1).max()) for gap in gaps),
    }


def _chain_scene(count: int, ratio: float) -> Scene:
    """Return the scene of a chain."""
    end_time = p.S8.end_time[count]
    return Scene(
        name=f"S8_{count}",
        title=f"chain of {count} hinged rods, 2 m, swings from the horizontal, {end_time:g} s",
        end_time=end_time,
        measure="tip_max",
        unit="largest error of the free end [m]",
        deck=lambda variation: chain_deck(count, end_time),
        errors=partial(_chain_errors, count),
        targets=(Target(ratio),),
        compared=COMPARED,
        tolerances=TOLERANCES,
    )


SCENES = (
    _chain_scene(2, 1 / 3),
    _chain_scene(10, 1 / 3),
    _chain_scene(40, 1 / 3),
    Scene(
        name="S8b",
        title="slider-crank, 45 degrees and 10 rad/s at the start, free, 2 s",
        end_time=p.S8B.end_time,
        measure="crank_angle_max",
        unit="largest error of the crank angle [rad]",
        deck=_crank_deck,
        errors=_crank_errors,
        targets=(Target(1 / 3),),
        compared=COMPARED,
        tolerances=TOLERANCES,
    ),
)

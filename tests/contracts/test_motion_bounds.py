"""Motion bounds of pairs with meshes: nothing has gone through a wall before their time."""

from __future__ import annotations

import numpy as np
import pytest

from helpers.pairs import random_rotation
from helpers.surfaces import Meshed, box
from mbsim.core.layout import AT_Q, BODY_SIZE
from mbsim.dynamics.bodies.kinematics import turn_travel
from mbsim.geometry.mesh.motion import ball_time, mesh_time
from mbsim.geometry.motion import (
    ACCELERATION,
    ALLOWED,
    ASKED,
    MORE,
    MOTION,
    OVERLAP,
    SPIN,
    VELOCITY,
    time_for,
)
from mbsim.geometry.pairs.surface import pose_of

STILL = np.concatenate([np.zeros(3), np.eye(3).ravel()])
PLATE = Meshed(*box(2.0, 2.0, 0.02))
BLOCK = Meshed(*box(0.2, 0.1, 0.05))


def motion(v=(0, 0, 0), a=(0, 0, 0), w=(0, 0, 0), asked=1.0, allowed=0.01, overlap=0.0, more=0.0):
    made = np.zeros(MOTION)
    made[ASKED], made[ALLOWED], made[OVERLAP], made[MORE] = asked, allowed, overlap, more
    made[VELOCITY : VELOCITY + 3], made[ACCELERATION : ACCELERATION + 3] = v, a
    made[SPIN : SPIN + 3] = w
    return made


def at(x, y, z, turn=None):
    return np.concatenate([[x, y, z], (np.eye(3) if turn is None else turn).ravel()])


def times(frame, moves, block=BLOCK, radius=0.025):
    """Return what the bounds of a block, and of a ball in its place, say over the plate."""
    of_mesh = mesh_time(moves, block.data, PLATE.data, pose_of(frame, STILL))
    return of_mesh, ball_time(moves, tuple(frame[:3]), radius, PLATE.data)


@pytest.mark.parametrize("depth", [-1e-3, 0.0, 1e-4])
def test_sliding_along_a_plate_is_no_approach(depth):
    # from x = 0 to 0.5, the rim of the plate at 1
    overlap = 1.01 * max(depth, 0.0)
    moves = motion(v=(50.0, 0, 0), w=(0, 0, 3.0), asked=0.01, allowed=1e-3, overlap=overlap)
    assert times(at(0.0, 0.0, 0.035 - depth), moves) == (0.01, 0.01)


@pytest.mark.parametrize("gap", [0.3, 1e-3, 0.0])
def test_what_comes_head_on_has_its_gap_and_what_is_allowed(gap):
    for push in (0.0, 9.81):
        moves = motion(v=(1.0, 0, -5.0), a=(0, 0, -push), allowed=2e-3)
        for time in times(at(0.0, 0.0, 0.035 + gap), moves):
            assert time == pytest.approx(time_for(gap + 2e-3, 5.0, push), rel=1e-12)


def test_a_wall_beside_is_seen_whatever_lies_below():
    """Beside the plate, 0.4 from its rim, and over another mesh that it may touch."""
    block, moves = at(-1.5, 0.0, 0.0), motion(v=(2.0, 0, 0), overlap=1e-3)
    assert times(block, moves)[0] == pytest.approx((0.4 + 0.01) / 2.0, rel=1e-12)
    vertices, faces = box(6.0, 2.0, 0.02)
    floor = vertices - [0.0, 0.0, 0.035 - 1e-4]
    both = np.vstack([box(2.0, 2.0, 0.02)[0], floor])
    whole = Meshed(both, np.vstack([box(2.0, 2.0, 0.02)[1], faces + len(floor)]))
    time = mesh_time(moves, BLOCK.data, whole.data, pose_of(block, STILL))
    assert time == pytest.approx((0.4 + 0.01) / 2.0, rel=1e-12)
    ball = ball_time(moves, (-1.5, 0.0, 0.0), 0.025, whole.data)
    assert ball == pytest.approx((0.5 - 0.025 + 0.01) / 2.0, rel=1e-9)


def test_no_corner_goes_deeper_than_allowed_before_its_time():
    """A block that flies and spins at a plate: by then no corner is more than that through it."""
    rng, hit = np.random.default_rng(3), 0
    for _ in range(120):
        turn, w = random_rotation(rng), 3.0 * rng.normal(size=3)
        corners = BLOCK.vertices @ turn.T
        z = 0.01 - corners[:, 2].min() + 10.0 ** rng.uniform(-6, -1)
        v, allowed = rng.normal(size=3), 10.0 ** rng.uniform(-4, -2)
        more = float(w @ w) * np.linalg.norm(corners, axis=1).max()
        moves = motion(v=v, w=w, allowed=allowed, more=more)
        time = mesh_time(moves, BLOCK.data, PLATE.data, pose_of(at(0, 0, z, turn), STILL))
        angle_, axis = np.linalg.norm(w) * time, w / np.linalg.norm(w)
        turned = (
            corners * np.cos(angle_) + np.cross(axis, corners) * np.sin(angle_)
            + np.outer(corners @ axis, axis) * (1.0 - np.cos(angle_))
        )  # fmt: skip
        if time < 0.3:
            hit += 1
            assert (turned[:, 2] + z + v[2] * time).min() > 0.01 - allowed * (1.0 + 1e-9)
    assert hit > 30


@pytest.mark.parametrize("angle", [0.0, 1e-12, 3e-9, 1e-7, 1e-3, 1.0, 3.0])
def test_the_smallest_turn_counts(angle):
    """The bound of a turn is how far the farthest point goes, of the smallest turns as well."""
    rng = np.random.default_rng(5)
    before = rng.normal(size=4)
    before /= np.linalg.norm(before)
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    w, x, y, z = before
    c, (a, b, d) = np.cos(angle / 2), np.sin(angle / 2) * axis
    turned = [
        c * w - a * x - b * y - d * z,
        c * x + a * w + b * z - d * y,
        c * y + b * w + d * x - a * z,
        c * z + d * w + a * y - b * x,
    ]
    for length in (1.0, 1.2):
        state = np.zeros(2 * BODY_SIZE)
        state[BODY_SIZE + AT_Q : BODY_SIZE + AT_Q + 4] = length * np.array(turned)
        travel = turn_travel(state, 1, before, 0.3)
        assert travel == pytest.approx(0.6 * np.sin(angle / 2), rel=1e-6, abs=1e-15)

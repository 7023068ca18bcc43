"""How friction is shared out over contact points: forces and slips against each other's bounds."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mbsim.dynamics.stiction import cones


def points(rng, count):
    """Return the slip of so many points of a block that moves along x, y and turns, (2 n, 3)."""
    p = rng.uniform(-1.0, 1.0, (count, 2))
    S = np.zeros((2 * count, 3))
    S[0::2, 0] = S[1::2, 1] = 1.0
    S[0::2, 2], S[1::2, 2] = -p[:, 1], p[:, 0]
    return S


def solved(S, limits, load, inertia):
    """Return what `solve_cones` finds: level, eps, forces and slips of points, motion."""
    count, r = S.shape
    V, K = np.zeros((9, max(count, r))), np.zeros((r, r))
    V[cones.CAPACITY, : len(limits)], V[cones.LOAD, :r] = limits, load
    level, eps = cones.solve_cones(S, count, r, V, K, inertia)
    forces = V[cones.FORCE, :count].reshape(-1, 2)
    return level, eps, forces, V[cones.SLIDE, :count].reshape(-1, 2), V[cones.MOTION, :r]


def least_part(S, limits, load):
    """Return the largest part of a limit that holds the load, forces in balance checked."""
    level, _, forces, slips, motion = solved(S, limits, load, cones.SHARED)
    held = forces / level
    np.testing.assert_allclose(S.T @ held.ravel(), load, rtol=0, atol=1e-7 * np.abs(load).max())
    part = (np.linalg.norm(held, axis=1) / limits).max()
    # any motion bounds the part from below: what it asks for over what friction can take
    bound = (load @ motion) / (limits @ np.linalg.norm(slips, axis=1))
    assert bound * (1.0 - 1e-7) <= part <= bound * (1.0 + 1e-7)
    return part


@pytest.mark.parametrize("count", range(2, 9))
def test_forces_and_motion_bound_each_other(count):
    rng = np.random.default_rng(count)
    for _ in range(4):
        limits = 10.0 ** rng.uniform(-2.0, 0.0, count)
        least_part(points(rng, count), limits, rng.normal(size=3))


def test_a_push_without_a_moment_is_shared_by_limits():
    # about the centre of the limits: all points at the same part of theirs
    rng = np.random.default_rng(1)
    S, limits = points(rng, 4), np.array([5.2, 5.2, 4.0, 4.0])
    arm = np.array([S[0::2, 2] @ limits, S[1::2, 2] @ limits]) / limits.sum()
    load = np.array([1.0, 2.0, arm[0] + 2.0 * arm[1]])
    part = least_part(S, limits, load)
    assert part == pytest.approx(math.sqrt(5.0) / limits.sum(), rel=1e-9)


def test_a_load_that_is_passed_moves_what_it_can_and_no_more():
    # a bar of two points, of which one holds 10 times as much, pushed across beside the weaker
    S = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, -1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 1.0]])
    limits, load = np.array([10.0, 1.0]), np.array([0.0, 1.5, 1.5])
    assert least_part(S, limits, load) == pytest.approx(1.5, rel=1e-9)
    _, eps, forces, slips, motion = solved(S, limits, load, cones.SLIPPING)
    # it turns about the stronger: 2 a = 3 - 2 for a = y_1 = y_2
    moves = np.linalg.norm(slips, axis=1) > cones.MOVES * eps
    assert moves.tolist() == [False, True]
    np.testing.assert_allclose(motion, [0.0, 0.5, 0.5], atol=1e-7)
    np.testing.assert_allclose(forces[1], [0.0, 1.0], atol=1e-7)


@pytest.mark.parametrize("count", range(2, 9))
@pytest.mark.parametrize(("spread", "above"), [(0.0, 1.6), (2.0, 30.0)])
def test_the_bound_of_a_load_is_never_below_it_nor_far_above(count, spread, above):
    rng = np.random.default_rng(count)
    for _ in range(10):
        S, limits = points(rng, count), 10.0 ** rng.uniform(-spread, 0.0, count)
        load = rng.normal(size=3)
        V, K = np.zeros((9, max(2 * count, 3))), np.zeros((3, 3))
        V[cones.CAPACITY, :count], V[cones.LOAD, :3] = limits, load
        bound = cones.part_at_most(S, 2 * count, 3, V, K)
        part = least_part(S, limits, load)
        assert part * (1.0 - 1e-7) <= bound < above * part


def test_a_load_that_nothing_holds_has_no_bound():
    S, load = np.zeros((4, 3)), np.array([0.0, 1.0, 1.0])
    S[0, 0] = S[1, 1] = S[2, 0] = S[3, 1] = 1.0
    V, K = np.zeros((9, 4)), np.zeros((3, 3))
    V[cones.CAPACITY, :2], V[cones.LOAD, :3] = 1.0, load
    assert cones.part_at_most(S, 4, 3, V, K) > 1e3

"""What every kind of force between markers must keep: slopes, energy, bounds, its names."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import mbsim
from mbsim.arrays import codes
from mbsim.forces.catalog import FORCES, Wrench, of_form
from mbsim.forces.formula import Motion

#: Half of the difference of displacements and velocities, and rounding over it.
STEP = 1e-5
MOTIONS = [0.0, 1e-5, 0.3, 2.0]
WRENCHES = [kind.name for kind in of_form(Wrench)]


def constants(kind, seed):
    """Return constants of a kind whose attributes are numbers from 0.5 to 2, as they allow."""
    rng = np.random.default_rng(seed)
    values = {
        each.name: each.default if each.count > 1 else rng.uniform(0.5, 2.0)
        for each in kind.parameters
    }
    assert not [finding for finding in kind.check(values) if not finding.warns]
    return np.array(kind.form.constants(values), dtype=float)


def motion(size, seed):
    """Return a motion at random, the angle `size`."""
    rng = np.random.default_rng(seed)
    d, v, w, axis = rng.normal(size=(4, 3))
    theta = size * axis / np.linalg.norm(axis)
    return Motion(*(tuple(map(float, each)) for each in (d, theta, v, w)))


def moved(at, shift, turn):
    """Return the motion behind a displacement of I and a turn of it, along and about J's axes."""
    theta = (Rotation.from_rotvec(turn) * Rotation.from_rotvec(at.theta)).as_rotvec()
    return at._replace(d=tuple(np.add(at.d, shift)), theta=tuple(theta))


def wrench(kind, at, par):
    """Return force and torque as one array, stored energy, lost power."""
    force, torque, stored, lost = kind.form.wrench(at, par)
    return np.array([*force, *torque]), stored, lost


def differences(kind, at, par):
    """Return -d(force, torque) by displacement and turn, and by velocity and spin."""
    by_place, by_rate = np.zeros((6, 6)), np.zeros((6, 6))
    for k, e in enumerate(np.eye(6) * STEP):
        ends = [wrench(kind, moved(at, s * e[:3], s * e[3:]), par)[0] for s in (1, -1)]
        by_place[:, k] = (ends[1] - ends[0]) / (2 * STEP)
        ends = []
        for s in (1, -1):
            faster = at._replace(v=tuple(at.v + s * e[:3]), w=tuple(at.w + s * e[3:]))
            ends.append(wrench(kind, faster, par)[0])
        by_rate[:, k] = (ends[1] - ends[0]) / (2 * STEP)
    return by_place, by_rate


@pytest.mark.parametrize("size", MOTIONS)
@pytest.mark.parametrize("name", WRENCHES)
def test_slopes_are_the_differences_of_the_wrench(name, size):
    kind = FORCES[name]
    for seed in range(5):
        par, at = constants(kind, seed), motion(size, seed)
        K, D = np.zeros((6, 6)), np.zeros((6, 6))
        kind.form.slopes(at, par, K, D)
        by_place, by_rate = differences(kind, at, par)
        most = max(np.abs(by_place).max(), np.abs(by_rate).max())
        # rounding over STEP is 1e-11, over a kind's own differences of angles 1e-9
        np.testing.assert_allclose(K, by_place, rtol=0, atol=2e-8 * most)
        np.testing.assert_allclose(D, by_rate, rtol=0, atol=2e-8 * most)


@pytest.mark.parametrize("size", MOTIONS)
@pytest.mark.parametrize("name", WRENCHES)
def test_power_is_what_is_stored_and_lost(name, size):
    kind, h = FORCES[name], STEP
    for seed in range(5):
        par, at = constants(kind, seed), motion(size, seed)
        force, _, lost = wrench(kind, at, par)
        ends = [
            wrench(kind, moved(at, s * h * np.array(at.v), s * h * np.array(at.w)), par)[1]
            for s in (1, -1)
        ]
        rate = (ends[0] - ends[1]) / (2 * h)
        power = force @ np.array([*at.v, *at.w])
        size_of_all = abs(power) + abs(rate) + abs(lost)
        assert power + rate + lost == pytest.approx(0.0, abs=2e-8 * size_of_all)


@pytest.mark.parametrize("name", WRENCHES)
def test_bounds_are_no_less_than_stiffness_damping_and_force(name):
    kind = FORCES[name]
    for seed in range(5):
        par = constants(kind, seed)
        bounds = kind.form.bounds(par)
        at = Motion(bounds.rest, (0.0,) * 3, (0.0,) * 3, (0.0,) * 3)
        K, D = np.zeros((6, 6)), np.zeros((6, 6))
        kind.form.slopes(at, par, K, D)
        for matrix, along, about in (
            (K, bounds.stiffness, bounds.turning_stiffness),
            (D, bounds.damping, bounds.turning_damping),
        ):
            whole = np.diag([along] * 3 + [about] * 3)
            # as quadratic forms
            assert np.linalg.eigvalsh(whole - (matrix + matrix.T) / 2)[0] > -1e-6 * along
        force, _, _ = wrench(kind, at, par)
        assert np.linalg.norm(force[:3]) <= bounds.force * (1 + 1e-12)


@pytest.mark.parametrize("name", WRENCHES)
def test_nothing_of_a_kind_is_lost_where_it_does_not_move(name):
    kind = FORCES[name]
    at = motion(0.3, 1)._replace(v=(0.0,) * 3, w=(0.0,) * 3)
    _, stored, lost = wrench(kind, at, constants(kind, 1))
    assert lost == 0.0
    assert math.isfinite(stored)


def test_kinds_have_names_of_their_own():
    kinds = [FORCES[name] for name in FORCES]
    for names in (
        [kind.statement for kind in kinds],
        [kind.path for kind in kinds],
        [name for kind in kinds for name in kind.functions.split()],
        [kind.adams.name for kind in kinds if kind.adams],
    ):
        assert len(names) == len(set(names))
    for kind in kinds:
        known = [each.name for each in kind.parameters]
        assert len(known) == len(set(known))
        for words in kind.adams.words.values() if kind.adams else ():
            assert set(words) <= set(known)


def test_the_numbers_of_forms_have_no_order():
    names = "|".join(
        (
            *("LINE_FORCE", "AXIS_FORCE", "AXIS_FORCE_AT_I", "AXIS_TORQUE", "VECTOR_FORCE"),
            *("WRENCH", "RESIDUAL"),
            *("SLIDE_FRICTION", "TURN_FRICTION", "SCREW_FRICTION", "BALL_FRICTION"),
        )
    )
    assert all(hasattr(codes, name) for name in names.split("|"))
    ordered = re.compile(rf"[<>]=?\s*(codes\.)?({names})\b|\b({names})\s*([<>+\-%]|\.\.)")
    for file in Path(mbsim.__file__).parent.rglob("*.py"):
        assert not ordered.search(file.read_text(encoding="utf-8")), file


def test_what_is_no_force_knows_no_kind_by_name():
    """Outside their files kinds are found in the registry: none is named where they act."""
    names = "|".join([*FORCES, *(FORCES[name].statement for name in FORCES)])
    known = re.compile(rf"[\"'](applied/)?({names})[\"']")
    package = Path(mbsim.__file__).parent
    found = [
        f"{file.relative_to(package)}: {match.group()}"
        for folder in ("arrays", "compile_model", "dynamics", "results", "run")
        for file in (package / folder).rglob("*.py")
        for match in known.finditer(file.read_text(encoding="utf-8"))
    ]
    assert not found

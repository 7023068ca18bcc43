"""MOREAU with joints in steps that are long for the motion: no energy is made, momentum stays."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import mbsim
from helpers.folders import MODELS
from mbsim.bench import deck as text
from mbsim.bench.scenes import s14_chain_box
from mbsim.results.reading import Results

LINKS, LENGTH, MASS, SPIN = 8, 0.2, 0.5, 10.0
ACROSS = [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]
ROUND, SLENDER = (0.0017, 0.0017, 0.0017), (1e-5, 0.0017, 0.0017)


def thrown(joint: str, inertia: tuple[float, float, float], h: float, held: bool) -> str:
    """Return a deck: links that spin at random, SPIN rad/s, on joints; no force acts on them."""
    spins = np.random.default_rng(0).normal(size=(LINKS, 3)) * SPIN
    if joint == "REVOLUTE":
        spins[:, :2] = 0.0
    end, velocity = np.zeros(3), np.zeros(3)
    parts = [text.GROUND, text.marker(10, 1, (0.0, 0.0, 0.0))]
    for k, w in enumerate(spins):
        half = np.array([LENGTH / 2.0, 0.0, 0.0])
        moves = velocity + np.cross(w, half)
        parts += [
            text.body(
                2 + k, MASS, inertia, tuple(end + half), velocity=tuple(moves), spin=tuple(w)
            ),
            text.marker(1000 + k, 2 + k, tuple(end), *([ACROSS] if joint == "UNIVERSAL" else [])),
            text.marker(2000 + k, 2 + k, tuple(end + 2.0 * half)),
        ]
        if k > 0 or held:
            before = 2000 + k - 1 if k > 0 else 10
            parts.append(text.joint(500 + k, joint, 1000 + k, before))
        end, velocity = end + 2.0 * half, velocity + np.cross(w, 2.0 * half)
    parts.append(f'<Param_Transient h_max="{h}" h_min="{h}"/>')
    return text.deck("links that are thrown", parts, 100.0 * h)


def momentum(results: Results) -> np.ndarray:
    """Return the links' linear momentum at every row."""
    return MASS * sum(results[f"bodies/{b}/velocity"] for b in results.ids("bodies"))


@pytest.mark.parametrize("joint", ["SPHERICAL", "REVOLUTE", "UNIVERSAL"])
@pytest.mark.parametrize("held", [False, True])
@pytest.mark.parametrize("inertia", [ROUND, SLENDER])
@pytest.mark.parametrize("h", [0.002, 0.02])
def test_joints_make_no_energy(
    joint: str, held: bool, inertia: tuple[float, float, float], h: float
) -> None:
    """h 0.02 s turns a link by up to 0.5 rad; what projections take is of order 3 over a run."""
    results = mbsim.simulate(thrown(joint, inertia, h, held), integrator="MOREAU")
    kinetic = results["energy/kinetic"]
    assert kinetic.max() <= kinetic[0] * (1.0 + 1e-3)
    assert kinetic.min() >= kinetic[0] * (1.0 - (1e-4 if h == 0.002 else 0.25))
    if not held:
        p = momentum(results)
        assert np.abs(p - p[0]).max() < 1e-9 * MASS * LINKS * SPIN * LENGTH


@pytest.mark.parametrize("inertia", [ROUND, SLENDER])
@pytest.mark.parametrize("h", [0.1, 0.3])
def test_a_step_that_is_far_too_long_ends_in_rest_and_not_in_nothing(
    inertia: tuple[float, float, float], h: float
) -> None:
    """Links turn by up to a whole turn in a step: the run goes on, and says what it took."""
    results = mbsim.simulate(thrown("REVOLUTE", inertia, h, True), integrator="MOREAU")
    kinetic = results["energy/kinetic"]
    assert kinetic.max() <= kinetic[0] * (1.0 + 1e-9)
    assert any("energy" in warning for warning in results.audit.warnings)


@pytest.mark.parametrize(("h", "away"), [(2e-3, 0.03), (5e-3, 0.06), (1e-2, 0.15)])
def test_a_chain_that_is_whipped_down(h: float, away: float) -> None:
    """50 links fall on a box and hang over it, against RADAU5 with stiff contact; rms [m]."""
    scene = s14_chain_box.SCENES[0]
    exact = mbsim.simulate(scene.deck({}), integrator="AUTO", tol=1e-4)
    results = mbsim.simulate(scene.deck({"h": h}), integrator="MOREAU")
    energy = results["energy/kinetic"] + results["energy/potential"]
    assert energy.max() <= energy[0] + 1e-2 * results["energy/kinetic"].max()
    apart = [
        results[f"bodies/{b}/position"] - exact[f"bodies/{b}/position"]
        for b in results.ids("bodies")
    ]
    assert np.sqrt(np.mean(np.sum(np.square(apart), axis=2))) < away


@pytest.mark.parametrize("deck", ["flyball_governor", "stiff/stiff_governor"])
def test_stiff_rods_turn_without_a_moment_of_their_own(deck: str) -> None:
    """Forces of theta > 1/2 in steps whose joints hold at 1/2: angular momentum stays."""
    model = mbsim.read_model(MODELS / f"{deck}.xml")
    exact = mbsim.simulate(model, integrator="RADAU5", tol=1e-8, end_time=1.0)
    results = mbsim.simulate(model, integrator="MOREAU", tol=1e-4, end_time=1.0)
    spin = results["bodies/2/angular_velocity"] - exact["bodies/2/angular_velocity"]
    assert np.abs(spin).max() < 2e-3 * np.abs(exact["bodies/2/angular_velocity"]).max()
    total = sum(results[f"energy/{kind}"] for kind in ("kinetic", "potential", "dissipated"))
    assert np.abs(total - total[0]).max() < 1e-3 * results.audit.of


def test_stiff_springs_between_held_bodies_leave_angular_momentum() -> None:
    """Three bodies on a ball joint and a hinge, and springs far shorter in period than steps."""
    bodies = {
        2: (1.0, (0.01, 0.02, 0.015), (0.0, 0.0, 0.0), (1.0, 0.0, 0.3), (5.0, 3.0, 8.0)),
        3: (2.0, (0.02, 0.012, 0.02), (0.3, 0.1, 0.0), (1.0, 1.0, 0.0), (5.0, 3.0, 8.0)),
        4: (0.5, (0.003, 0.004, 0.005), (0.3, 0.4, 0.1), (1.0, 1.0, -1.0), (1.0, -3.0, 2.0)),
    }
    parts = [text.GROUND]
    for b, (mass, inertia, place, velocity, spin) in bodies.items():
        parts += [
            text.body(b, mass, inertia, place, velocity, spin),
            text.marker(10 * b + 1, b, (0.15, 0.05, 0.0)),
            text.marker(10 * b + 2, b, (0.3, 0.25, 0.1), ACROSS),
        ]
    for n, (i, j, length) in enumerate(((30, 22, 0.2), (40, 31, 0.4)), 1):
        names = text.attributes(id=n, i_marker_id=i, j_marker_id=j, stiffness=1e5, length=length)
        parts.append(f'<Force_SpringDamper type="TRANSLATIONAL" {names}/>')
    parts += [text.joint(1, "SPHERICAL", 31, 21), text.joint(2, "REVOLUTE", 42, 32)]
    parts.append('<Param_Transient h_max="0.001" h_min="0.001"/>')
    results = mbsim.simulate(text.deck("held by springs", parts, 0.5), integrator="MOREAU")
    total = 0.0
    for b, (mass, inertia, *_) in bodies.items():
        names = ("position", "velocity", "angular_velocity", "quaternion")
        x, v, w, q = (results[f"bodies/{b}/{name}"] for name in names)
        turn = Rotation.from_quat(q, scalar_first=True)
        own = turn.apply(np.array(inertia) * turn.inv().apply(w))
        total = total + mass * np.cross(x, v) + own
    assert np.abs(total - total[0]).max() < 0.02 * np.abs(total[0]).max()


def pendulum(step: str) -> str:
    """Return a deck: a body swings down from level about y."""
    parts = [
        text.GROUND,
        text.marker(10, 1, (0.0, 0.0, 0.0), ACROSS),
        text.body(2, 1.0, (0.01, 0.01, 0.01), (0.5, 0.0, 0.0)),
        text.marker(21, 2, (0.0, 0.0, 0.0), ACROSS),
        text.joint(1, "REVOLUTE", 21, 10),
        text.gravity(),
        step,
    ]
    return text.deck("a pendulum", parts, 1.0)


@pytest.mark.parametrize("h", [0.02, 0.005])
def test_rows_within_a_step_are_as_good_as_its_ends(h: float) -> None:
    """Rows every ms are on parabolas within steps of the deck's length."""
    exact = mbsim.simulate(pendulum(""), integrator="DOP853", tol=1e-11, print_interval=0.001)
    results = mbsim.simulate(
        pendulum(f'<Param_Transient h_max="{h}" h_min="{h}"/>'),
        integrator="MOREAU",
        print_interval=0.001,
    )
    off = np.abs(results["bodies/2/position"] - exact["bodies/2/position"]).max(axis=1)
    assert off.max() < 1.1 * off[:: round(h * 1000)].max()


def chain(first: int, count: int, z: float, speed: float, joint: str) -> list[str]:
    """Return links with a ball each in their middle, thrown along z, the farther the faster."""
    parts = []
    for k in range(count):
        b, begin, along = first + k, np.array([k * LENGTH, 0.01 * first, z]), np.eye(3)[0]
        middle, end = begin + 0.5 * LENGTH * along, begin + LENGTH * along
        ball = text.attributes(id=100 * b, type="Sphere", center_marker_id=10 * b + 3, radius=0.09)
        parts += [
            text.body(b, MASS, ROUND, tuple(middle), velocity=(0.0, 0.0, speed * (1.0 + k))),
            text.marker(10 * b + 1, b, tuple(begin), ACROSS),
            text.marker(10 * b + 2, b, tuple(end), ACROSS),
            text.marker(10 * b + 3, b, tuple(middle)),
            f"<Post_Graphic {ball}/>",
        ]
        if k > 0:
            parts.append(text.joint(500 + b, joint, 10 * b + 1, 10 * b - 8))
    return parts


@pytest.mark.parametrize("joint", ["SPHERICAL", "REVOLUTE"])
def test_mechanisms_that_collide_keep_their_momentum(joint: str) -> None:
    """Two chains, a ball, and the first chain's own ends: impulses move all that joints hold."""
    law = text.impact(1e5, 1.5, 10.0, 1e-4) | text.coulomb(0.3, 0.01)
    one, other = [100 * b for b in range(2, 7)], [100 * b for b in range(20, 24)]
    parts = [
        text.GROUND,
        *chain(2, 5, 0.4, -1.0, joint),
        *chain(20, 4, 0.0, 1.0, joint),
        text.sphere(40, MASS, 0.1, (0.5, 0.1, -0.3), velocity=(0.0, 0.0, 5.0)),
        text.contact(301, one, other, **law),
        text.contact(302, one + other, [4000], **law),
        text.contact(303, one[:2], one[3:], **law),
        '<Param_Transient h_max="0.002" h_min="0.002"/>',
    ]
    results = mbsim.simulate(text.deck("chains collide", parts, 1.0), integrator="MOREAU")
    assert results.stats["contact_points"] > 10
    p, kinetic = momentum(results), results["energy/kinetic"]
    assert np.abs(p - p[0]).max() < 1e-10 * MASS * 5.0
    assert kinetic.max() < kinetic[0] * (1.0 + 1e-6)


@pytest.mark.parametrize("method", ["MOREAU", "DOPRI5", "DOP853", "RADAU5", "GALPHA"])
@pytest.mark.parametrize("step", ["", '<Param_Transient h_max="0.02" h_min="0.02"/>'])
@pytest.mark.parametrize("held", [False, True])
def test_quaternions_of_rows_have_unit_length(method: str, step: str, held: bool) -> None:
    """Rows within steps are interpolated, number by number."""
    parts = [
        text.GROUND,
        text.marker(10, 1, (0.0, 0.0, 0.0)),
        text.body(2, 1.0, (0.01, 0.02, 0.03), (0.0, 0.0, 0.0), spin=(5.0, 3.0, 8.0)),
        *([text.joint(1, "SPHERICAL", 20, 10)] if held else []),
        step if method == "MOREAU" else "",
    ]
    results = mbsim.simulate(
        text.deck("a body spins", parts, 0.5), integrator=method, tol=1e-3, print_interval=0.001
    )
    sizes = np.linalg.norm(results["bodies/2/quaternion"], axis=1)
    assert np.abs(sizes - 1.0).max() < 1e-14

"""What every friction law has to keep, and the closed forms of each."""

from __future__ import annotations

import ctypes
import itertools
import math

import numpy as np
import pytest
from scipy.integrate import quad

from mbsim.laws import abi
from mbsim.laws.catalog import BEGUN, FRICTION_LAWS, SLIP, STICK, FrictionInput

VALUES = {
    "mu_static": 0.5,
    "mu_dynamic": 0.3,
    "stiction_trans_vel": 0.01,
    "friction_trans_vel": 0.05,
    "stribeck_vel": 0.02,
    "bristle_stiffness": 1e4,
    "tangential_stiffness": 1e4,
    "tangential_damping": 5.0,
    "rolling_arm": 0.01,
    "patch_radius": 0.1,
}
#: Laws that know only slip velocities.
PLAIN = [name for name in FRICTION_LAWS if FRICTION_LAWS[name].memory == 0]
KEEPING = [name for name in FRICTION_LAWS if FRICTION_LAWS[name].memory > 0]
POINTER = ctypes.c_void_p
ZERO = (0.0, 0.0, 0.0)


def parameters(law, **values):
    given = {own.name: own.default for own in law.own} | VALUES | values
    return [given[name] for name in law.parameters]


def slip(
    x, y, spin=0.0, nforce=10.0, at=ZERO, rolling=(0.0, 0.0), frozen=0.0, stiffness=1e5, **others
):
    inputs = FrictionInput(
        *(0.0, 0.0, at, (x, y, spin), rolling, nforce, 0.0, 0.0, ZERO, ZERO),
        *(0.0, frozen, stiffness, 1.0, math.nan, 0.0, *(math.nan,) * 3),
    )
    return inputs._replace(**others)


def flat(inputs):
    """Return a FrictionInput as the numbers of the internal signature."""
    values = []
    for field in inputs:
        values.extend(field if isinstance(field, tuple) else [field])
    return np.array(values)


class Slider:
    """A law that is rubbed along a given way under a given load, and the work that it takes."""

    def __init__(self, law, *par):
        self.law, self.par = law, par
        self.time = 0.0
        self.memory, self.at, self.taken, self.force = (0.0,) * law.memory, np.zeros(3), 0.0, None
        self.mode = BEGUN

    def ask(self, v, nforce, at, memory, ahead=0.0):
        inputs = slip(*v, nforce=nforce, at=tuple(at), time=self.time + ahead)
        if self.law.memory == 0:
            return np.array(self.law.force(inputs, *self.par)), ()
        out, new = self.law.force(inputs, memory, *self.par)
        self.mode = out[6]
        return np.array(out[:5]), new

    def go(self, dt, v, nforce):
        """Go on with a slip (x, y, spin) for a time; return the force at its end."""
        v = np.asarray(v, dtype=float)
        n, carried = self.law.memory, self.law.carried
        memory = self.memory
        if carried > 0:
            z, rest = np.array(memory[:carried]), memory[carried:]

            def rates(part, k):
                z_there = tuple(z + part * dt * k)
                return np.array(self.ask(v, nforce, self.at, z_there + rest, part * dt)[1][n:])

            k1 = rates(0.0, np.zeros(carried))
            k2 = rates(0.5, k1)
            k3 = rates(0.5, k2)
            k4 = rates(1.0, k3)
            memory = tuple(z + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)) + rest
        self.at, self.time = self.at + dt * v, self.time + dt
        force, new = self.ask(v, nforce, self.at, memory)
        self.memory = new[:n]
        before = force if self.force is None else self.force
        mean = 0.5 * (before + force)[[0, 1, 4]]
        self.taken -= dt * float(mean @ v)
        self.force = force
        return force


@pytest.fixture(params=PLAIN)
def plain(request):
    return FRICTION_LAWS[request.param]


@pytest.fixture(params=list(FRICTION_LAWS))
def friction(request):
    return FRICTION_LAWS[request.param]


def test_plain_friction_opposes_slip_and_is_isotropic(plain):
    par = parameters(plain)
    for speed in (1e-12, 1e-4, 0.01, 0.03, 0.05, 1.0):
        ahead = plain.force(slip(speed, 0.0), *par)
        assert ahead[0] < 0.0
        assert ahead[1] == 0.0
        angle = 0.7
        turned = plain.force(slip(speed * math.cos(angle), speed * math.sin(angle)), *par)
        assert turned[0] == pytest.approx(ahead[0] * math.cos(angle), rel=1e-12)
        assert turned[1] == pytest.approx(ahead[0] * math.sin(angle), rel=1e-12)


def test_friction_is_zero_at_rest_from_the_start(friction):
    force = Slider(friction, *parameters(friction)).go(1.0, ZERO, 10.0)
    assert not force.any()


def test_friction_stays_within_the_cone(friction):
    rng = np.random.default_rng(3)
    slider = Slider(friction, *parameters(friction))
    for vx, vy, vr in rng.normal(scale=0.05, size=(300, 3)):
        force = slider.go(1e-4, (vx, vy, vr), 7.0)
        assert math.hypot(force[0], force[1]) <= 0.5 * 7.0 * (1 + 1e-12)


def test_friction_is_nothing_without_a_normal_force(friction):
    assert not Slider(friction, *parameters(friction)).go(1e-3, (0.3, -0.2, 0.1), 0.0).any()


def test_compiled_friction_equals_plain_python(friction):
    par = np.array(parameters(friction))
    call = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64, POINTER, POINTER, POINTER)(
        abi.friction_address(friction)
    )
    rng, keeps = np.random.default_rng(4), friction.memory > 0
    n = friction.memory
    out = np.zeros(abi.MEMORY_OUT + n + friction.carried if keeps else 5)
    memory = (0.0,) * friction.memory
    for vx, vy in rng.normal(scale=0.05, size=(200, 2)):
        inputs = slip(vx, vy, 0.1, at=(1e-4 * vx, 1e-4 * vy, 0.0), frozen=float(vx > 0.0))
        given = np.concatenate([flat(inputs), memory])
        assert call(1, given.ctypes.data, par.ctypes.data, out.ctypes.data) == 0
        if keeps:
            found, new = friction.force(inputs, memory, *par)
            expected = (*found, *new)
            carried = np.array(new[: friction.carried]) + 1e-3 * np.array(new[n:])
            memory = (*carried, *new[friction.carried : n])
        else:
            expected = friction.force(inputs, *par)
        np.testing.assert_allclose(out, expected, rtol=1e-13, atol=1e-300)


def closed_way(rng, steps):
    """Return slips (steps, 3) that come back to where they began, and loads, at random."""
    s = np.linspace(0.0, 2.0 * np.pi, steps, endpoint=False)
    v, load = np.zeros((steps, 3)), np.full(steps, 6.0)
    for k in range(1, 5):
        # no constant part: the way is closed
        a, b = rng.normal(size=(2, 3)) * [1.0, 1.0, 5.0] / k
        v += np.outer(np.sin(k * s), a) + np.outer(np.cos(k * s), b)
        load += 1.4 * rng.uniform(-1, 1) * np.sin(k * s + rng.uniform(0, 6))
    return 10.0 ** rng.uniform(-3, -1) * v, np.maximum(load, 0.0)


def energy_taken(friction, seed, ways, **own):
    """Return what a law takes over random closed ways under changing loads, over all work done."""
    rng, steps, span = np.random.default_rng(seed), 400, 0.05
    own = {"bristle_damping": 1.0, "damping_trans_vel": 0.01, **own}
    found = []
    for _ in range(ways):
        slider = Slider(friction, *parameters(friction, **own))
        v, load = closed_way(rng, steps)
        work = 0.0
        for each, nforce in zip(v, load, strict=True):
            force = slider.go(span / steps, each, nforce)
            work += span / steps * abs(force[[0, 1, 4]] @ each)
        found.append(slider.taken / work)
    return np.array(found)


@pytest.mark.parametrize("seed", range(4))
def test_no_law_gives_energy_over_closed_ways_under_changing_loads(friction, seed):
    taken = energy_taken(friction, seed, 50 if friction.memory else 250)
    assert taken.min() >= -1e-3


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4, 20))
@pytest.mark.parametrize("name", KEEPING)
def test_no_law_with_memory_gives_energy_over_a_thousand_closed_ways(name, seed):
    assert energy_taken(FRICTION_LAWS[name], seed, 50).min() >= -1e-3


def test_coulomb_on_is_the_step_curve_of_the_manual():
    from mbsim.core.blend import step

    law = FRICTION_LAWS["COULOMB_ON"]
    mu_s, mu_d, vs, vd = 0.5, 0.3, 0.01, 0.05
    for speed in np.linspace(1e-5, 0.08, 400):
        if speed >= vd:
            mu = mu_d
        elif speed > vs:
            mu = step(speed, vs, mu_s, vd, mu_d)
        else:
            mu = step(speed, -vs, -mu_s, vs, mu_s)
        force = law.force(slip(speed, 0.0, nforce=1.0), mu_s, mu_d, vs, vd)
        assert force[0] == pytest.approx(-mu, rel=1e-12)


def test_coulomb_on_with_equal_transition_velocities():
    law = FRICTION_LAWS["COULOMB_ON"]
    below = law.force(slip(0.0099999999, 0.0, nforce=1.0), 0.3, 0.3, 0.01, 0.01)
    above = law.force(slip(0.0100000001, 0.0, nforce=1.0), 0.3, 0.3, 0.01, 0.01)
    assert below[0] == pytest.approx(-0.3, rel=1e-9)
    assert above[0] == pytest.approx(-0.3, rel=1e-9)


def test_limit_of_the_ratio_at_rest():
    # mu(v)/v -> 1.5 mu_s / vs
    law = FRICTION_LAWS["COULOMB_ON"]
    force = law.force(slip(1e-200, 0.0, nforce=2.0), 0.4, 0.3, 0.01, 0.02)
    assert force[0] == pytest.approx(-1.5 * 0.4 / 0.01 * 2.0 * 1e-200, rel=1e-12)


def test_smooth_laws_are_their_formulas():
    g = {"mu_static": 0.5, "mu_dynamic": 0.3}
    for v in (1e-9, 1e-4, 5e-3, 0.01, 0.03, 0.2, 3.0):
        tanh = FRICTION_LAWS["TANH"]
        assert -tanh.force(slip(v, 0.0, nforce=2.0), *parameters(tanh))[0] == pytest.approx(
            2.0 * 0.3 * math.tanh(v / 0.05), rel=1e-8
        )
        law = FRICTION_LAWS["STRIBECK"]
        par = parameters(law, viscous_coef=0.7, **g)
        curve = 0.3 + 0.2 * math.exp(-((v / 0.02) ** 2))
        expected = 2.0 * curve * math.tanh(v / 0.01) + 0.7 * v
        assert -law.force(slip(0.0, v, nforce=2.0), *par)[1] == pytest.approx(expected, rel=1e-8)
        law = FRICTION_LAWS["BROWN_MCPHEE"]
        par = parameters(law, viscous_coef=0.7, **g)
        u = v / 0.01
        curve = 0.3 * math.tanh(4 * u) + 0.2 * u / ((u / 2) ** 2 + 0.75) ** 2
        assert -law.force(slip(v, 0.0, nforce=2.0), *par)[0] == pytest.approx(
            2.0 * curve + 0.7 * v, rel=1e-8
        )


def test_brown_mcphee_peaks_at_the_transition():
    law = FRICTION_LAWS["BROWN_MCPHEE"]
    par = parameters(law, mu_dynamic=0.0)
    pulls = [-law.force(slip(v, 0.0, nforce=1.0), *par)[0] for v in np.linspace(0.009, 0.011, 21)]
    assert int(np.argmax(pulls)) == 10
    assert max(pulls) == pytest.approx(0.5, rel=1e-12)


def disc(e):
    """Return friction and torque of a disc of radius 1 that slides at e and spins at 1."""

    def ring(r, turns):
        def at(angle):
            speed = math.sqrt(e * e + r * r + 2 * e * r * math.cos(angle))
            part = r * (r + e * math.cos(angle)) if turns else e + r * math.cos(angle)
            return part / speed if speed > 0.0 else 0.0

        return quad(at, 0.0, math.pi, epsabs=1e-11, limit=200)[0] * 2 * r / math.pi

    # a ring whose speed is that of the middle has a kink
    ends = sorted({0.0, min(e, 1.0), 1.0})
    return [
        sum(
            quad(ring, a, b, args=(turns,), epsabs=1e-11, limit=200)[0]
            for a, b in itertools.pairwise(ends)
        )
        for turns in (False, True)
    ]


def test_contensou_is_friction_over_a_disc():
    law = FRICTION_LAWS["CONTENSOU"]
    for e in (1e-3, 0.1, 0.653, 0.97, 1.03, 3.0, 30.0, 70.0, 1e3):
        force = law.force(slip(e, 0.0, 1.0, nforce=1.0), 1.0, 1e-9, 1.0)
        f, m = disc(e)
        assert -force[0] == pytest.approx(f, rel=1e-8)
        assert -force[4] == pytest.approx(m, rel=1e-8)
    # the ratio with which a disc of inertia m R^2/2 comes to rest: f = 2 e m
    force = law.force(slip(0.6530017892, 0.0, 1.0, nforce=1.0), 1.0, 1e-9, 1.0)
    assert force[0] == pytest.approx(2 * 0.6530017892 * force[4], rel=1e-9)
    # spin alone, slip alone
    assert -law.force(slip(0.0, 0.0, 2.0, nforce=3.0), 0.4, 1e-9, 0.1)[4] == pytest.approx(
        2 / 3 * 0.4 * 3.0 * 0.1
    )
    assert -law.force(slip(0.5, 0.0, 0.0, nforce=3.0), 0.4, 1e-9, 0.1)[0] == pytest.approx(1.2)


def test_rolling_resistance_is_a_lever_arm():
    law = FRICTION_LAWS["COULOMB_ROLLING"]
    out = law.force(slip(0.0, 0.0, rolling=(3.0, 4.0), nforce=2.0), *parameters(law))
    assert out[2:] == pytest.approx((-0.01 * 2.0 * 0.6, -0.01 * 2.0 * 0.8, 0.0))
    at_rest = law.force(slip(0.0, 0.0, nforce=2.0), *parameters(law))
    assert not np.any(at_rest)


def test_dahl_follows_its_closed_form_and_its_loop():
    # one way: F = -Fc + (F0 + Fc) exp(-k x/Fc)
    law, k, limit = FRICTION_LAWS["DAHL"], 1e4, 0.3 * 10.0
    slider, n = Slider(law, *parameters(law)), 2000
    length = 5.0 * limit / k
    for j in range(1, n + 1):
        force = slider.go(1.0 / n, (length, 0.0, 0.0), 10.0)[0]
        assert force == pytest.approx(limit * (math.exp(-k * length * j / n / limit) - 1), rel=1e-9)
    # a settled loop of +- a: the force at its ends is Fc tanh(k a/Fc) (from the closed form both
    # ways), and it takes 4 Fc a - 4 Fc^2/k tanh(k a/Fc)
    a = 2.0 * limit / k
    for _ in range(8):
        taken = slider.taken
        for sign in (-1, 1):
            for _ in range(n):
                end = slider.go(1.0 / n, (sign * 2 * a, 0.0, 0.0), 10.0)[0]
                # the trapezoid rule would take the jump at the turn for a slope
    assert -end == pytest.approx(limit * math.tanh(k * a / limit), rel=1e-9)
    loop = 4 * limit * a - 4 * limit**2 / k * math.tanh(k * a / limit)
    assert slider.taken - taken == pytest.approx(loop, rel=1e-6)


def test_stiction_loop_takes_what_a_jenkins_element_does():
    # 4 Fc (X - Fc/k) a cycle of amplitude X
    law, k, limit = FRICTION_LAWS["STICTION"], 1e4, 0.3 * 10.0
    slider = Slider(law, *parameters(law, mu_static=0.3, tangential_damping=0.0))
    X, n = 4.0 * limit / k, 400
    for _ in range(n):
        slider.go(1.0, (X / n, 0.0, 0.0), 10.0)
    for _ in range(3):
        taken = slider.taken
        for sign in (-1, 1):
            for _ in range(n):
                slider.go(1.0, (sign * 2 * X / n, 0.0, 0.0), 10.0)
    assert slider.taken - taken == pytest.approx(4 * limit * (X - limit / k), rel=1e-12)


def test_stiction_holds_up_to_its_static_limit_and_then_slips():
    law, k = FRICTION_LAWS["STICTION"], 1e4
    slider = Slider(law, *parameters(law, tangential_damping=0.0))
    step = 0.05 * 5.0 / k
    for j in range(1, 30):
        force = slider.go(1.0, (0.6 * step, 0.8 * step, 0.0), 10.0)
        pull = math.hypot(force[0], force[1])
        if j == 20:
            # at the limit itself rounding decides
            continue
        if j < 20:
            assert pull == pytest.approx(0.25 * j, rel=1e-12)
            assert slider.mode == STICK
        else:
            assert pull == pytest.approx(3.0, rel=1e-12)
            assert slider.mode == SLIP
    # back a little: it holds again, with the spring at its dynamic limit
    force = slider.go(1.0, (-0.6 * step, -0.8 * step, 0.0), 10.0)
    assert slider.mode == STICK
    assert math.hypot(force[0], force[1]) == pytest.approx(3.0 - 0.25, rel=1e-12)


def test_stiction_keeps_its_mode_within_a_step():
    law = FRICTION_LAWS["STICTION"]
    par, k = parameters(law, tangential_damping=0.0), 1e4
    # z and M are integrated by whoever asks
    out, kept = law.force(slip(1.0, 0.0), (1e-5, *(0.0,) * (law.memory - 1)), *par)
    assert out[6] == STICK
    # beyond the limit: the force of a step that sticks stays at it, the mode tells
    beyond = 2.0 * 5.0 / k
    out, _ = law.force(slip(1.0, 0.0, frozen=1.0), (beyond, *kept[1:12]), *par)
    assert -out[0] == pytest.approx(5.0)
    assert out[6] == SLIP
    out, kept = law.force(slip(1.0, 0.0), (beyond, *kept[1:12]), *par)
    assert -out[0] == pytest.approx(3.0)
    # and that of one that slips goes on where it turns
    out, _ = law.force(slip(-1.0, 0.0, frozen=1.0, time=1.0), kept[:12], *par)
    assert out[6] == STICK
    assert out[0] < 0.0
    # how fast the normal force changes decides: a spring that has to follow it sticks, or goes on
    # to slip though it turned
    for v, rate, mode in ((1e-3, 1e3, STICK), (1e-3, -1e3, SLIP), (-1e-3, -1e3, SLIP)):
        asked = slip(v, 0.0, frozen=1.0, time=1.0, nforce_rate=rate)
        out, _ = law.force(asked, kept[:12], *par)
        assert out[6] == mode
        assert out[0] == pytest.approx(-3.0)


@pytest.mark.parametrize("rate", [-2e7, 0.0, 2e7])
@pytest.mark.parametrize("nforce_rate", [-1e3, 0.0, 1e3])
def test_stick_and_slip_are_decided_by_the_same_rate_of_the_limit(rate, nforce_rate):
    """A patch grows stiffer whatever its depth does: what sticks must not ask to slip at once."""
    law, k = FRICTION_LAWS["STICTION"], 1e4
    of_depth = {"tangential_stiffness": math.nan, "poisson_ratio": 0.3}
    par = parameters(law, tangential_damping=0.0, mu_static=0.3, mu_dynamic=0.3, **of_depth)
    stiffness = k * (2.0 - 0.3) / (2.0 * (1.0 - 0.3))
    most, stretch = 3.0, 3.0 / k
    own = 0.3 * nforce_rate / k - stretch * rate / stiffness
    rates = {"nforce_rate": nforce_rate, "stiffness_rate": rate, "stiffness": stiffness}
    for v, mode in ((own + 1e-3, SLIP), (own - 1e-3, STICK)):
        asked = slip(v, 0.0, frozen=1.0, time=1.0, **rates)
        # it slips in the direction of z, or has just come to stick, a rounding beyond the limit
        slips = (0.0, 0.0, stretch, 0.0, 0.0, 0.0, v / stretch, 0.0, 1.0, 0.0, 0.0, SLIP)
        sticks = (stretch * (1.0 + 1e-12), *slips[1:11], STICK)
        for memory in (slips, sticks):
            out, _ = law.force(asked, memory, *par)
            assert out[6] == mode
            assert -out[0] == pytest.approx(most)


@pytest.mark.parametrize("damping", [0.3, 30.0, 3000.0])
def test_stiction_has_the_same_force_before_and_behind_a_change(damping):
    """Slip that turns comes to stick with any velocity across, or back where N falls."""
    law, k, rng = FRICTION_LAWS["STICTION"], 1e4, np.random.default_rng(5)
    par = parameters(law, tangential_damping=damping, mu_static=0.3, mu_dynamic=0.3)
    for N, speed in itertools.product((10.0, 1e-3, 1e-9), (1e-6, 1e-2, 10.0)):
        most, angle, way = 0.3 * N, *rng.uniform(0.0, 2.0 * math.pi, 2)
        e, v = (np.array([math.cos(a), math.sin(a)]) for a in (angle, way))
        asked = slip(*speed * v, nforce=N, frozen=1.0, time=1.0)
        slips = (0.0, 0.0, *most / k * e, 0.0, 0.0, *speed * v * k / most, 1.0, 0.0, 0.0, SLIP)
        moved, _ = law.force(asked, slips, *par)
        assert moved[:2] == pytest.approx(-most * e, rel=1e-12)
        for part in (1.0 - 1e-9, 1.0 + 1e-9):
            held, _ = law.force(asked, (*part * most / k * e, *slips[2:11], STICK), *par)
            # near the limit by x the damper has up to 2 (2 most) 4 x, and the spring is x shorter
            assert np.hypot(*(np.array(held[:2]) - moved[:2])) < 1.8e-8 * most


def test_what_holds_damps_by_what_the_limit_has_room_for():
    law, k, c, rng = FRICTION_LAWS["STICTION"], 1e4, 30.0, np.random.default_rng(6)
    par = parameters(law, tangential_damping=c, mu_static=0.3, mu_dynamic=0.3)
    for _ in range(200):
        N, part, speed = 10.0 ** rng.uniform(-3.0, 3.0), rng.uniform(), 10.0 ** rng.uniform(-9.0, 1)
        angle, way = rng.uniform(0.0, 2.0 * math.pi, 2)
        z = 0.3 * N * part / k * np.array([math.cos(angle), math.sin(angle)])
        v = speed * np.array([math.cos(way), math.sin(way)])
        out, _ = law.force(slip(*v, nforce=N, frozen=1.0), (*z, *(0.0,) * 9, STICK), *par)
        damper = -(np.array(out[:2]) + k * z)
        fades = min(1.0, 4.0 * (1.0 - part))
        fades *= 2.0 - fades
        # all of c v, or as much as reaches the limit
        whole = c * v
        if np.hypot(*(k * z + whole)) > 0.3 * N:
            assert np.hypot(*(k * z + damper / fades)) == pytest.approx(0.3 * N, rel=1e-9)
            assert damper / np.hypot(*damper) == pytest.approx(v / speed, abs=1e-6)
        else:
            assert damper == pytest.approx(fades * whole, rel=1e-9, abs=1e-12 * N)


def test_a_twist_is_held_up_to_its_limit():
    law = FRICTION_LAWS["STICTION"]
    par = parameters(law, tangential_damping=0.0, rotational_stiffness=100.0, torsion_radius=0.1)
    slider = Slider(law, *par)
    # limit mu_s N r = 0.5
    assert slider.go(1.0, (0.0, 0.0, 0.004), 10.0)[4] == pytest.approx(-0.4)
    assert slider.go(1.0, (0.0, 0.0, 0.004), 10.0)[4] == pytest.approx(-0.5)
    assert slider.go(1.0, (0.0, 0.0, -0.004), 10.0)[4] == pytest.approx(-0.1)
    # nor is there any damping left at the limit; half of the limit below it is as much as there is
    par = parameters(law, tangential_damping=1e6, rotational_stiffness=100.0, torsion_radius=0.1)
    for twist, torque in ((0.005, 0.5), (0.0025, -0.5)):
        back = slip(0.0, 0.0, spin=-1.0, at=(0.0, 0.0, twist), frozen=1.0)
        out, _ = law.force(back, (*(0.0,) * 11, STICK, 0.0), *par)
        assert -out[4] == pytest.approx(torque)


def test_springs_lose_and_never_win_where_the_normal_stiffness_changes():
    law = FRICTION_LAWS["STICTION"]
    par = parameters(law, tangential_stiffness=math.nan, tangential_damping=0.0)
    # as a force at touch, then as a stretch
    out, kept = law.force(slip(0.0, 0.0, stiffness=1e5), (1e-2, *(0.0,) * (law.memory - 1)), *par)
    change, stiffness = 1e-3, 1e5
    for growth in (0.7, 1.6, -1.2, -3.4, 2.3):
        before, z = out[5], np.array(kept[:2])
        for _ in range(1000):
            # Euler's method, in which the spring eases by exp(-growth) but for a part of 1e-3
            asked = slip(0.0, 0.0, stiffness=stiffness, growth=growth)
            rates = law.force(asked, (*z, *kept[2 : law.memory]), *par)[1][law.memory :]
            z, stiffness = z + change * np.array(rates), stiffness * math.exp(change * growth)
        out, kept = law.force(
            slip(0.0, 0.0, stiffness=stiffness), (*z, *kept[2 : law.memory]), *par
        )
        assert out[5] <= before * math.exp(-abs(growth)) * (1 + 5e-3)


def test_lugre_slides_at_its_steady_curve():
    law = FRICTION_LAWS["LUGRE"]
    par = parameters(law, bristle_damping=10.0, viscous_coef=0.4)
    for v in (1e-3, 0.02, 0.1):
        slider = Slider(law, *par)
        for _ in range(4000):
            force = slider.go(5e-6 / v, (v, 0.0, 0.0), 10.0)
        g = 10.0 * (0.3 + 0.2 * math.exp(-((v / 0.02) ** 2)))
        assert -force[0] == pytest.approx(g + 0.4 * v, rel=1e-6)


def test_a_limit_of_the_users_own_takes_the_place_of_the_dynamic_one():
    law = FRICTION_LAWS["STICTION"]
    par = parameters(law, tangential_damping=0.0)
    given = slip(1.0, 0.0)._replace(limit=1.7)
    out, kept = law.force(given, (1.0, *(0.0,) * (law.memory - 1)), *par)
    assert -out[0] == pytest.approx(1.7)
    assert 1e4 * kept[2] == pytest.approx(1.7)

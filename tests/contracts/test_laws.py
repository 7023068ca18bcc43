"""What every law has to keep: run over all that are registered."""

from __future__ import annotations

import ctypes
import math

import numpy as np
import pytest

from mbsim.laws import abi
from mbsim.laws.catalog import FRICTION_LAWS, NORMAL_LAWS, FrictionInput
from mbsim.model.elements import Contact

SHARED = {"stiffness": 1e5, "damping": 50.0, "dmax": 1e-3, "penalty": 1e4}
NORMAL_CASES = {
    **{f"IMPACT {e}": ("IMPACT", {"exponent": e}) for e in (1.0, 1.5, 2.0, 2.2)},
    "IMPACT undamped": ("IMPACT", {"damping": 0.0, "dmax": None}),
    **{f"HUNT_CROSSLEY {e}": ("HUNT_CROSSLEY", {"exponent": e}) for e in (1.0, 1.5, 2.0, 2.2)},
    "HUNT_CROSSLEY by rebound": (
        "HUNT_CROSSLEY",
        {"damping": 0.0, "restitution_coef": 0.3, "ref_velocity": 2.0},
    ),
    "HERTZ": ("HERTZ", {"damping": 0.0}),
    "HERTZ of materials": (
        "HERTZ",
        {
            **{"i_elastic_modulus": 7e7, "i_poisson_ratio": 0.3, "i_radius": 0.1},
            **{"j_radius": math.inf, "restitution_coef": 0.8, "ref_velocity": 1.0, "damping": 0.0},
        },
    ),
    **{f"POISSON {e}": ("POISSON", {"restitution_coef": e}) for e in (0.0, 0.5, 1.0)},
    "POISSON wide": ("POISSON", {"restitution_coef": 0.2, "normal_trans_vel": 0.5}),
}
FRICTION_VALUES = {
    "mu_static": 0.5,
    "mu_dynamic": 0.3,
    "stiction_trans_vel": 0.01,
    "friction_trans_vel": 0.05,
}
POINTER = ctypes.c_void_p


def friction_parameters(law):
    return [FRICTION_VALUES[name] for name in law.parameters]


def slip(x, y, spin=0.0, nforce=10.0):
    zero = (0.0, 0.0, 0.0)
    return FrictionInput(0.0, 0.0, zero, (x, y, spin), (0.0, 0.0), nforce, 0.0, 0.0, zero, zero)


def flat(inputs):
    """Return a FrictionInput as the 19 numbers of the internal signature."""
    values = []
    for field in inputs:
        values.extend(field if isinstance(field, tuple) else [field])
    return np.array(values)


@pytest.fixture(params=list(NORMAL_CASES))
def normal(request):
    """A normal law with its constants: ``(law, constants)``."""
    name, attributes = NORMAL_CASES[request.param]
    law = NORMAL_LAWS[name]
    return law, abi.normal_constants(law, Contact(id=1, cnf_type=name, **(SHARED | attributes)))


@pytest.fixture(params=list(FRICTION_LAWS))
def friction(request):
    return FRICTION_LAWS[request.param]


def states(seed, count=500):
    """Return depths and rates, some of them small, as pairs."""
    rng = np.random.default_rng(seed)
    depths = rng.uniform(-1e-3, 5e-3, count)
    rates = rng.uniform(-50, 50, count) * 10.0 ** rng.uniform(-6, 0, count)
    return zip(depths.tolist(), rates.tolist(), strict=True)


def test_every_normal_law_is_tested_here():
    assert {name for name, _ in NORMAL_CASES.values()} == set(NORMAL_LAWS)


def test_normal_force_is_zero_when_apart(normal):
    law, constants = normal
    for depth in (0.0, -1e-9, -1.0):
        for rate in (-1.0, 0.0, 1.0):
            assert law.law(depth, rate, *constants) == (0.0, 0.0, 0.0)


def test_normal_force_never_pulls(normal):
    law, constants = normal
    for depth, rate in states(1):
        assert min(law.law(depth, rate, *constants)) >= 0.0


def test_elastic_part_is_the_force_at_rate_zero(normal):
    law, constants = normal
    for depth, rate in states(5):
        elastic, stored = law.law(depth, rate, *constants)[1:]
        assert law.law(depth, 0.0, *constants) == pytest.approx((elastic, elastic, stored))


def test_stored_energy_is_the_integral_of_the_force_at_rest(normal):
    law, constants = normal
    for depth in (1e-5, 2e-3):
        eps = 1e-4 * depth
        above, below = (law.law(depth + d, 0.0, *constants)[2] for d in (eps, -eps))
        force = law.law(depth, 0.0, *constants)[1]
        assert (above - below) / (2 * eps) == pytest.approx(force, rel=1e-7)


def test_normal_law_never_makes_energy(normal):
    law, constants = normal
    for depth, rate in states(6):
        force, elastic, _ = law.law(depth, rate, *constants)
        assert (force - elastic) * rate >= 0.0


def test_normal_force_is_continuous(normal):
    # a jump would not shrink with the distance of two points; slopes here are below 1e9
    law, constants = normal
    for depth, rate in states(7):
        force = law.law(depth, rate, *constants)[0]
        assert law.law(depth + 1e-13, rate, *constants)[0] == pytest.approx(force, abs=1e-4)
        assert law.law(depth, rate + 1e-13, *constants)[0] == pytest.approx(force, abs=1e-4)
    for rate in (-1.0, 0.0, 1.0):
        assert law.law(1e-13, rate, *constants)[0] < 1e-4


def test_compiled_normal_law_equals_plain_python(normal):
    law, constants = normal
    call = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_double, ctypes.c_double, POINTER, POINTER)(
        abi.normal_address(law)
    )
    out = np.zeros(3)
    for depth, rate in states(2, 200):
        assert call(depth, rate, constants.ctypes.data, out.ctypes.data) == 0
        expected = law.law(depth, rate, *constants.tolist())
        assert out == pytest.approx(expected, rel=1e-14, abs=1e-300)


@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.0])
def test_exponents_without_pow_are_as_exact_as_pow(exponent):
    from mbsim.laws.spring import power_spring

    for depth in 10.0 ** np.random.default_rng(8).uniform(-15, 2, 300):
        force, energy = power_spring(float(depth), 1e5, exponent)
        assert force == pytest.approx(1e5 * depth**exponent, rel=5e-16)
        assert energy == pytest.approx(1e5 * depth ** (exponent + 1) / (exponent + 1), rel=1e-15)


def test_damping_of_a_restitution_solves_the_relation():
    from mbsim.laws.restitution import dimensionless_damping

    # A: e from A (1 + e) = ln((1 + A) / (1 - e A)), to ten digits
    table = {0.01: 0.9933774544, 0.1: 0.9374755799, 1.0: 0.5936242600, 5.0: 0.1969802453}
    for A, restitution in table.items():
        assert dimensionless_damping(restitution) == pytest.approx(A, rel=1e-7)
    assert dimensionless_damping(1.0) == 0.0
    # small damping: e = 1 - 2/3 A
    assert dimensionless_damping(1.0 - 1e-10) == pytest.approx(1.5e-10, rel=1e-6)
    # strong damping: the rebound speed tends to 1/a
    assert dimensionless_damping(0.01) == pytest.approx(100.0, rel=1e-12)


def test_friction_opposes_slip_and_is_isotropic(friction):
    par = friction_parameters(friction)
    for speed in (1e-12, 1e-4, 0.01, 0.03, 0.05, 1.0):
        ahead = friction.force(slip(speed, 0.0), *par)
        assert ahead[0] < 0.0
        assert ahead[1] == 0.0
        angle = 0.7
        turned = friction.force(slip(speed * math.cos(angle), speed * math.sin(angle)), *par)
        assert turned[0] == pytest.approx(ahead[0] * math.cos(angle), rel=1e-12)
        assert turned[1] == pytest.approx(ahead[0] * math.sin(angle), rel=1e-12)


def test_friction_is_finite_and_zero_at_rest(friction):
    assert friction.force(slip(0.0, 0.0), *friction_parameters(friction)) == (0, 0, 0, 0, 0)


def test_friction_stays_within_the_cone(friction):
    rng = np.random.default_rng(3)
    par = friction_parameters(friction)
    for vx, vy in rng.normal(scale=0.05, size=(300, 2)):
        force = friction.force(slip(vx, vy, nforce=7.0), *par)
        assert math.hypot(force[0], force[1]) <= 0.5 * 7.0 * (1 + 1e-12)


def test_compiled_friction_equals_plain_python(friction):
    par = np.array(friction_parameters(friction))
    call = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64, POINTER, POINTER, POINTER)(
        abi.friction_address(friction)
    )
    out = np.zeros(5)
    rng = np.random.default_rng(4)
    for vx, vy in rng.normal(scale=0.05, size=(200, 2)):
        inputs = slip(vx, vy)
        given = flat(inputs)
        assert call(1, given.ctypes.data, par.ctypes.data, out.ctypes.data) == 0
        np.testing.assert_allclose(out, friction.force(inputs, *par), rtol=1e-14, atol=0)


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

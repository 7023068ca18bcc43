"""What every law has to keep: run over all that are registered."""

from __future__ import annotations

import ctypes
import math

import numpy as np
import pytest

from mbsim.laws import abi
from mbsim.laws.catalog import FRICTION_LAWS, NORMAL_LAWS, FrictionInput

NORMAL_VALUES = {"stiffness": 1e5, "exponent": 1.5, "damping": 50.0, "dmax": 1e-3}
FRICTION_VALUES = {
    "mu_static": 0.5,
    "mu_dynamic": 0.3,
    "stiction_trans_vel": 0.01,
    "friction_trans_vel": 0.05,
}
POINTER = ctypes.c_void_p


def normal_parameters(law):
    return [NORMAL_VALUES[name] for name in law.parameters]


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


@pytest.fixture(params=list(NORMAL_LAWS))
def normal(request):
    return NORMAL_LAWS[request.param]


@pytest.fixture(params=list(FRICTION_LAWS))
def friction(request):
    return FRICTION_LAWS[request.param]


def test_normal_force_is_zero_when_apart(normal):
    for depth in (0.0, -1e-9, -1.0):
        assert normal.force(depth, 1.0, *normal_parameters(normal)) == 0.0
        assert normal.energy(depth, *normal_parameters(normal)) == 0.0


def test_normal_force_never_pulls(normal):
    rng = np.random.default_rng(1)
    for depth, rate in zip(rng.uniform(-1e-3, 5e-3, 500), rng.uniform(-50, 50, 500), strict=True):
        assert normal.force(depth, rate, *normal_parameters(normal)) >= 0.0


def test_stored_energy_is_the_integral_of_the_force_at_rest(normal):
    par = normal_parameters(normal)
    depth, eps = 2e-3, 1e-7
    slope = (normal.energy(depth + eps, *par) - normal.energy(depth - eps, *par)) / (2 * eps)
    assert slope == pytest.approx(normal.force(depth, 0.0, *par), rel=1e-7)


def test_compiled_normal_law_equals_plain_python(normal):
    par = np.array(normal_parameters(normal))
    call = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_double, ctypes.c_double, POINTER, POINTER)(
        abi.normal_address(normal)
    )
    out = np.zeros(3)
    rng = np.random.default_rng(2)
    for depth, rate in zip(rng.uniform(-1e-3, 5e-3, 200), rng.uniform(-2, 2, 200), strict=True):
        assert call(depth, rate, par.ctypes.data, out.ctypes.data) == 0
        expected = normal.force(depth, rate, *par)
        assert out[0] == pytest.approx(expected, rel=1e-14, abs=1e-300)
        assert out[1] == pytest.approx(normal.force(depth, 0.0, *par), rel=1e-14, abs=1e-300)
        assert out[2] == pytest.approx(normal.energy(depth, *par), rel=1e-14, abs=1e-300)


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

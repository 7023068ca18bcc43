"""What every normal law has to keep: run over all that are registered."""

from __future__ import annotations

import ctypes
import math

import numpy as np
import pytest

from mbsim.laws import abi
from mbsim.laws.catalog import NORMAL_LAWS
from mbsim.laws.constants import normal_constants
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
    **{
        f"VOLUME {e}": (
            "VOLUME",
            {
                **{"i_elastic_modulus": 1e3, "i_poisson_ratio": 0.3, "i_layer_depth": 0.01},
                **{"j_elastic_modulus": 2e3, "j_poisson_ratio": 0.2, "j_layer_depth": 0.02},
                "exponent": e,
            },
        )
        for e in (1.0, 1.4)
    },
    **{f"POISSON {e}": ("POISSON", {"restitution_coef": e}) for e in (0.0, 0.5, 1.0)},
    "POISSON wide": ("POISSON", {"restitution_coef": 0.2, "normal_trans_vel": 0.5}),
}
POINTER = ctypes.c_void_p


@pytest.fixture(params=list(NORMAL_CASES))
def normal(request):
    """A normal law with its constants: ``(law, constants)``."""
    name, attributes = NORMAL_CASES[request.param]
    law = NORMAL_LAWS[name]
    return law, normal_constants(law, Contact(id=1, cnf_type=name, **(SHARED | attributes)))


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
        # a root or product, two products more; here a power to one unit, and what follows it
        assert force == pytest.approx(1e5 * depth**exponent, rel=6 * 2.0**-53)
        expected = 1e5 * depth ** (exponent + 1) / (exponent + 1)
        assert energy == pytest.approx(expected, rel=9 * 2.0**-53)


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

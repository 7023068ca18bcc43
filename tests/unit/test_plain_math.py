"""Powers, and numbers taken apart, in compiled code: Numba's bits without its runtime."""

from __future__ import annotations

import math
import sys

import numpy as np
import pytest
from numba import njit

from mbsim.core import compiling, jit, linking
from mbsim.core.signature import FLOAT, INT

pytestmark = pytest.mark.skipif(linking.POLICY == "all", reason="Numba's own linking")


def power(x, n):
    return x**n


def rounded(x):
    digits, exponent = math.frexp(x)
    return math.ldexp(math.floor(64.0 * digits) / 64.0, exponent)


def as_numba_has_it(x, n):
    """Return a power as `int_power_impl` of Numba computes it."""
    exponent, found = abs(n), 1.0
    while exponent:
        if exponent & 1:
            found *= x
        exponent >>= 1
        x *= x
    return 1.0 / found if n < 0 else found


def test_powers_have_numbas_bits():
    compiled = FLOAT(FLOAT, INT).at(jit.address(power, FLOAT(FLOAT, INT)))
    draw = np.random.default_rng(1)
    for x, n in zip(draw.normal(size=2000), draw.integers(-40, 41, size=2000), strict=True):
        assert compiled(x, n) == as_numba_has_it(float(x), int(n))
    assert compiled(1.00001, -70_000) == math.pow(1.00001, -70_000.0)
    assert [compiled(0.0, n) for n in (-3, 0, 3)] == [math.inf, 1.0, 0.0]
    assert compiled(2.0, -(2**63)) == 0.0


def test_numbers_are_taken_apart_as_c_does():
    compiled = FLOAT(FLOAT).at(jit.address(rounded, FLOAT(FLOAT)))
    values = [*(10.0**k for k in range(-323, 309, 7)), 0.0, -1.5, 5e-324]
    assert [compiled(x) for x in values] == [*map(rounded, values)]


def quotient(a, b, c, d, which):
    z = complex(a, b) / complex(c, d)
    return z.real if which == 0 else z.imag


@pytest.mark.skipif(sys.version_info >= (3, 14), reason="Numba's own")
def test_complex_quotients_have_pythons_bits_and_those_by_zero_raise_nothing():
    signature = FLOAT(FLOAT, FLOAT, FLOAT, FLOAT, INT)
    compiled = signature.at(jit.address(quotient, signature))
    draw = np.random.default_rng(2).normal(size=(2000, 4))
    for a, b, c, d in [*draw.tolist(), (1.0, 2.0, 0.0, 3.0), (1.0, 2.0, 3.0, 0.0)]:
        exact = complex(a, b) / complex(c, d)
        assert [compiled(a, b, c, d, k) for k in (0, 1)] == [exact.real, exact.imag]
    assert math.isnan(compiled(1.0, 2.0, 0.0, 0.0, 0))
    code = compiling.code_of(compiling.c_function(quotient, signature, False))
    assert code.calls == ()


@pytest.mark.parametrize(("function", "signature"), [(power, FLOAT(FLOAT, INT)),
                                                     (rounded, FLOAT(FLOAT))])  # fmt: skip
def test_nothing_of_numbas_runtime_is_called(function, signature):
    code = compiling.code_of(compiling.c_function(function, signature, False))
    assert set(code.calls) <= {"pow", "frexp", "ldexp", "floor"}


def test_what_is_found_to_raise_nothing_has_no_error_to_handle():
    @njit(error_model="numpy")
    def inner(x, n):
        total = 0.0
        for k in range(0, n, 1 if n > 3 else 2):
            total += x * k
        return total

    def root(x, n):
        return inner(x, n)

    code = compiling.code_of(compiling.c_function(root, FLOAT(FLOAT, INT), False))
    assert code.calls == ()

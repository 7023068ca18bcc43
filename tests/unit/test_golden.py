"""The least value of a function of one number."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from mbsim.core.golden import minimum


@pytest.mark.parametrize(
    "f", [lambda x: (x - 0.123) ** 2, lambda x: abs(x - 0.123)], ids=["round", "corner"]
)
@pytest.mark.parametrize("end", [0.123, 0.2, 3.0])
def test_it_is_found_between_the_ends(f: Callable[[float], float], end: float) -> None:
    for precision in ({"absolute": 1e-9}, {"relative": 1e-8}):
        value, x = minimum(f, -0.7, end, **precision)
        assert value == f(x)
        assert value < 2e-9
        # a round minimum is known to the root of rounding
        assert x == pytest.approx(0.123, abs=2e-8)


def test_it_may_lie_at_an_end() -> None:
    assert minimum(lambda x: x, 1.0, 2.0, absolute=1e-9)[1] == pytest.approx(1.0, abs=1e-9)
    assert minimum(lambda x: -x, -2.0, -1.0, relative=1e-9)[1] == pytest.approx(-1.0, abs=1e-9)

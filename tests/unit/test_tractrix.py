"""The direction of a spring that is dragged along, against closed forms and integration."""

from __future__ import annotations

import cmath
import math

import pytest
from scipy.integrate import solve_ivp

from mbsim.laws.tractrix import dragged


def behind(e, a, m, b):
    """Return what `dragged` gives for complex numbers."""
    return complex(*dragged(e.real, e.imag, a.real, a.imag, m.real, m.imag, b.real, b.imag))


@pytest.mark.parametrize("way", [1e-9, 0.01, 0.3, 1.0, 5.0, 12.0, 40.0, 1e6])
@pytest.mark.parametrize("angle", [0.0, 1e-8, 0.3, 1.6])
def test_a_straight_way_has_its_closed_form(way, angle):
    # tan(a/2) = tan(a0/2) exp(-M)
    ahead = cmath.exp(0.4j)
    found = behind(ahead * cmath.exp(1j * angle), 0.7 * way * ahead, way * ahead, 1.3 * way * ahead)
    left = 2.0 * math.atan(math.tan(angle / 2) * math.exp(-way))
    # what lies more than 31 lengths back is forgotten
    assert abs(found - ahead * cmath.exp(1j * left)) < 1e-12
    assert abs(abs(found) - 1.0) < 1e-15


def circled(way, turn, angle):
    """Return e behind a circle's arc through M's integral, and the cubic of its ends."""

    def rate(s, p):
        return [way * math.sin(turn * s - p[0])]

    found = solve_ivp(rate, (0.0, 1.0), [angle], method="Radau", rtol=1e-11, atol=1e-12)
    m = way * (cmath.exp(1j * turn) - 1.0) / (1j * turn)
    return cmath.exp(1j * found.y[0, -1]), way, m, way * cmath.exp(1j * turn)


@pytest.mark.parametrize("way", [0.1, 1.0, 4.0, 15.0, 60.0])
@pytest.mark.parametrize("angle", [0.0, 0.8, -1.0])
def test_a_curved_way_is_followed(way, angle):
    # at the end of the cubic through an arc's ends the curvature misses the arc's by turn^2/12 of
    # it, and e lags behind by the curvature over the way
    misses = []
    for turn in (0.4, 0.2):
        right, a, m, b = circled(way, turn, angle)
        misses.append(abs(behind(cmath.exp(1j * angle), complex(a), m, b) - right))
        assert misses[-1] < turn**3 / 12 * min(way, 1 / way)
    assert misses[1] < misses[0] / 6 + 1e-9


def test_without_a_direction_it_takes_that_of_the_slip():
    assert behind(0j, 1 + 0j, 1 + 1j, 3j) == pytest.approx(1j)
    assert behind(0j, 0j, 0j, 0j) == 0.0


def test_a_spring_that_is_pushed_back_does_not_come_round():
    # as it would by rounding alone, while what slips has long stuck
    assert behind(-1 + 0j, 2 + 0j, 2 + 0j, 2 + 0j) == -1.0
    for way in (50.0, 1e6):
        assert behind(-1 + 1e-15j, way + 0j, way + 0j, way + 0j).real == pytest.approx(-1.0)
    # there and back, which is what a step past the turn of a swing does
    assert behind(1 + 1e-16j, 1e5 + 0j, -2e4 + 1e-9j, -1.3e5 + 0j).real == pytest.approx(1.0)

"""Bounds of expressions of TIME: everything that a function is lies within them."""

from __future__ import annotations

import numpy as np
import pytest

from helpers import free_bodies as free
from mbsim.compile_model import time_functions as tf
from mbsim.compile_model import timetable as tt
from mbsim.compile_model.build import build
from mbsim.compile_model.splines import pieces
from mbsim.dynamics.expressions.jets import jet
from mbsim.expressions import bounds, intervals
from mbsim.expressions.elementary import CODES
from mbsim.expressions.functions import FUNCTIONS, Kind
from mbsim.expressions.parse import parse
from mbsim.model.elements import Request

TEXTS = [
    "TIME + 2 - TIME**2",
    "-TIME*3/(1 + TIME)",
    "(TIME + 1)**(TIME*2)",
    "(TIME - 1)**3 + (TIME + 1)**2.5 + TIME**(-2)",
    "2**SIN(TIME) + COS(3*TIME)",
    "ABS(TIME - 1) - SIGN(TIME, SIN(9*TIME))",
    "TAN(TIME/2) + ATAN(5*TIME - 4)",
    "ASIN(SIN(TIME)/2) + ACOS(COS(TIME)/2)",
    "SINH(TIME) - COSH(TIME - 1) + TANH(9*(TIME - 1))",
    "LOG(TIME) + LOG10(2*TIME) + SQRT(TIME)",
    "AINT(3*TIME) - ANINT(2*TIME)",
    "ATAN2(SIN(5*TIME), COS(5*TIME))",
    "MOD(TIME, 0.3) + MOD(-TIME, 0.7)",
    "DIM(TIME, 1) + MIN(TIME, 1, SIN(3*TIME)) + MAX(0, COS(7*TIME))",
    "IF(TIME - 1: 0, 1, TIME)",
    "STEP(TIME, .5, 0, .7, 1) * STEP5(TIME, .9, 1, 1.4, -2) + HAVSIN(TIME, .5, 0, .7, 1)",
    "STEP(SIN(9*TIME), -.5, 1, .5, 3)",
    "SHF(TIME, .1, 3, 2, 1, 4) + SHF(TIME, .1, 3, 2)",
    "POLY(TIME, 1, 1, 2, 3) + CHEBY(TIME, 1, 1, 2, 3, 4)",
    "FORSIN(TIME, .1, 3, 1, 2, 3) - FORCOS(TIME, .1, 3, 1, 2, 3)",
    "SWEEP(TIME, 1, .2, 1, 1.5, 7, .2)",
    "SWEEP(TIME, 1, 1, 2, 1, 5, 0)",
    "SWEEP(TIME, 1, 1, 2, 0.5, 5, -1)",
    "IMPACT(TIME, 1, 1.1, 10, 1.5, 2, .1)",
    "BISTOP(TIME, 1, .5, 1.2, 10, 1.5, 2, .1)",
    "100*SIN(2*PI*TIME)**400",
    "EXP(-((TIME - 1)/.1)**2)",
]


def group_of(text):
    """Return a scene whose first program is the text, and its only function as a group."""
    request = Request(1, "EXPRESSION", exprs=(parse(text),))
    system = build(free.model(free.body(2), requests=[request]), 1.0)
    (code,), whole, blind = tf.parts(system.scene, 0)
    assert whole
    assert not blind
    return system, tt._Group([tf.Function(code, 0, tf.UNKNOWN)], {})


def test_every_elementary_function_has_bounds():
    names = {name for name, entry in FUNCTIONS.items() if entry.kind is Kind.ELEMENTARY}
    assert {CODES[name] for name in names} <= set(intervals._BY_CODE)
    assert all(any(f"{name}(" in text for text in TEXTS) for name in names)


@pytest.mark.parametrize("text", TEXTS)
def test_values_and_derivatives_lie_within_the_bounds(text):
    system, group = group_of(text)
    chance = np.random.default_rng(8)
    n = 120
    lo, w = chance.uniform(0.05, 1.9, n), 10.0 ** chance.uniform(-5, -0.3, n)
    with np.errstate(all="ignore"):
        bound = group.bound(np.zeros(n, dtype=int), lo, lo + w)
    for k in range(n):
        for part in np.linspace(0.0, 1.0, 7):
            found = jet(system.scene, lo[k] + part * w[k], system.y0, 0)
            for value, interval in zip(found, bound[:3], strict=True):
                low, high = (np.broadcast_to(end, (n,))[k] for end in interval)
                slack = 1e-12 * (1.0 + abs(value)) * (1.0 + 1.0 / w[k] * 1e-6)
                assert low - slack <= value <= high + slack


@pytest.mark.parametrize("text", TEXTS)
def test_a_level_above_0_means_that_values_and_slopes_are_those_of_one_curve(text):
    # over a cell in which slopes do not jump the value changes as the bounds of the slope say
    system, group = group_of(text)
    chance = np.random.default_rng(9)
    lo = chance.uniform(0.05, 1.9, 200)
    hi = lo + 1e-3
    with np.errstate(all="ignore"):
        bound = group.bound(np.zeros(200, dtype=int), lo, hi)
    level = np.broadcast_to(bound.level, (200,))
    slopes = [np.broadcast_to(end, (200,)) for end in bound.slope]
    for k in np.flatnonzero(level >= 1):
        rise = jet(system.scene, hi[k], system.y0, 0)[0] - jet(system.scene, lo[k], system.y0, 0)[0]
        slack = 1e-12 * (1.0 + abs(rise))
        assert 1e-3 * slopes[0][k] - slack <= rise <= 1e-3 * slopes[1][k] + slack


@pytest.mark.parametrize("method", ["AKISPL", "CUBSPL", "LINSPL"])
@pytest.mark.parametrize("order", [0, 1, 2])
def test_a_curve_lies_within_its_bounds(method, order):
    chance = np.random.default_rng(10)
    x = np.cumsum(chance.uniform(0.05, 0.3, 12))
    piece = pieces(method, x, chance.normal(size=12), method == "LINSPL")
    curve = tt.Curve(piece, order)
    n = 200
    lo, w = chance.uniform(x[0] - 0.3, x[-1] + 0.1, n), 10.0 ** chance.uniform(-4, 0.2, n)
    bound = curve.bound(bounds.time(lo, lo + w))
    for part in np.linspace(0.0, 1.0, 9):
        at = lo + part * w
        row = np.searchsorted(curve.knots, at, "right")
        value = curve._point(row, at - curve.begin[row], 0)
        slack = 1e-9 * (1.0 + np.abs(value))
        assert np.all(bound.value.lo - slack <= value)
        assert np.all(value <= bound.value.hi + slack)
    # what goes on outside is another curve; a line has no curvature that could jump
    highest = {"AKISPL": 2, "CUBSPL": 3, "LINSPL": 1}[method] - order
    inner = 3 if highest < 0 else highest
    assert np.all(curve.levels[1:-1] == inner)
    assert np.all(curve.levels >= min(max(1 - order, 0), inner))


def parts_of(text, **more):
    request = Request(1, "EXPRESSION", exprs=(parse(text),))
    return tf.parts(build(free.model(free.body(2), requests=[request]), 1.0).scene, 0)


@pytest.mark.parametrize(
    ("text", "count", "blind"),
    [
        ("DX(20)*3", 0, False),
        ("SIN(TIME)*DX(20) - 2*COS(TIME)", 2, False),
        ("DX(20)/(2 + SIN(TIME))", 1, False),
        ("STEP(TIME, 1, 0, 2, DX(20))", 2, False),  # TIME itself, and what it chooses
        ("IF(TIME - 1: DX(20), 0, VX(20))", 2, False),
        ("EXP(-(TIME + DX(20))**2)", 1, True),
        ("MAX(0, SIN(TIME) - DX(20))", 1, True),
    ],
)
def test_what_stands_beside_states_is_told_apart(text, count, blind):
    found, whole, unseen = parts_of(text)
    assert not whole
    assert (len(found), unseen) == (count, blind)

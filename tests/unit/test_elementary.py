"""Elementary functions against closed forms, and their jets against high-order differences."""

from __future__ import annotations

import math

import numpy as np
import pytest

from helpers import free_bodies as free
from mbsim.arrays.scene import Scene
from mbsim.compile_model.build import build
from mbsim.core import jit
from mbsim.core.address import pack, view
from mbsim.core.blend import step, step5_derivative, step_derivative
from mbsim.dynamics.expressions.jets import jet, value
from mbsim.dynamics.pipeline.force_hooks import open_expressions, open_jets
from mbsim.expressions.functions import FUNCTIONS, Kind
from mbsim.expressions.parse import parse
from mbsim.model.elements import Request


def scene_of(*texts):
    """Return a scene of which program k is the k-th text."""
    exprs = tuple(parse(text) for text in texts)
    model = free.model(free.body(2), requests=[Request(1, "EXPRESSION", exprs=exprs)])
    return build(model)


def jet_of(text, t):
    """Return the jet of an expression of TIME, in plain Python."""
    system = scene_of(text)
    return jet(system.scene, t, system.y0, 0)


def differences(f, t, h=0.02):
    """Return value, first and second derivative by central differences of order 8."""
    first = [(1, 4 / 5), (2, -1 / 5), (3, 4 / 105), (4, -1 / 280)]
    second = [(1, 8 / 5), (2, -1 / 5), (3, 8 / 315), (4, -1 / 560)]
    d1 = sum(c * (f(t + k * h) - f(t - k * h)) for k, c in first) / h
    d2 = sum(c * (f(t + k * h) + f(t - k * h)) for k, c in second)
    return f(t), d1, (d2 - 205 / 72 * f(t)) / h**2


CLOSED_FORMS = [
    ("TIME + 2 - TIME**2", lambda t: t + 2 - t * t),
    ("-TIME*3/(1 + TIME)", lambda t: -3 * t / (1 + t)),
    ("(TIME + 1)**(TIME*2)", lambda t: (t + 1) ** (2 * t)),
    ("(TIME + 1)**2.5", lambda t: (t + 1) ** 2.5),
    ("(TIME - 1)**3", lambda t: (t - 1) ** 3),
    ("2**SIN(TIME)", lambda t: 2 ** math.sin(t)),
    ("ABS(TIME - 1)", lambda t: abs(t - 1)),
    ("SIN(TIME**2)", lambda t: math.sin(t * t)),
    ("COS(3*TIME)", lambda t: math.cos(3 * t)),
    ("TAN(TIME)", math.tan),
    ("ASIN(TIME**2)", lambda t: math.asin(t * t)),
    ("ACOS(TIME**2)", lambda t: math.acos(t * t)),
    ("ATAN(2*TIME)", lambda t: math.atan(2 * t)),
    ("ATAN2(SIN(TIME), TIME - 2)", lambda t: math.atan2(math.sin(t), t - 2)),
    ("SINH(TIME)", math.sinh),
    ("COSH(2*TIME)", lambda t: math.cosh(2 * t)),
    ("TANH(TIME)", math.tanh),
    ("EXP(-TIME**2)", lambda t: math.exp(-t * t)),
    ("LOG(TIME + 0.1)", lambda t: math.log(t + 0.1)),
    ("LOG10(TIME*5)", lambda t: math.log10(5 * t)),
    ("SQRT(1 + TIME**3)", lambda t: math.sqrt(1 + t**3)),
    ("MIN(SIN(TIME), 3, TIME**2)", lambda t: min(math.sin(t), 3, t * t)),
    ("MAX(SIN(TIME), TIME**2)", lambda t: max(math.sin(t), t * t)),
    ("MOD(-5.5*TIME, 0.9 + TIME)", lambda t: math.fmod(-5.5 * t, 0.9 + t)),
    ("SIGN(TIME, TIME - 5)", lambda t: -t),
    ("AINT(TIME - 3.5)", lambda t: math.trunc(t - 3.5)),
    ("ANINT(2.5 + 0*TIME) + ANINT(TIME - 3.5)", lambda t: 3 + round(t - 3.5)),
    ("DIM(TIME, 0.1)", lambda t: t - 0.1),
    ("DIM(0.1, TIME)", lambda t: 0.0),
    ("IF(TIME - 5: SIN(TIME), 1, 2)", math.sin),
    ("STEP(TIME, 0.2, 1, 1.1, SIN(TIME))", lambda t: step(t, 0.2, 1, 1.1, math.sin(t))),
    ("STEP5(TIME, 0.2, 1, 1.1, 3)", lambda t: step5_derivative(t, 0.2, 1, 1.1, 3, 0)),
    (
        "HAVSIN(TIME, 0.2, 1, 1.1, 3)",
        lambda t: 2 + math.sin((t - 0.2) / 0.9 * math.pi - math.pi / 2),
    ),
    ("SHF(TIME, 0.1, 2, 5, 0.3, 7)", lambda t: 2 * math.sin(5 * (t - 0.1) - 0.3) + 7),
    ("SHF(TIME, 0.1, 2, 5)", lambda t: 2 * math.sin(5 * (t - 0.1))),
    ("POLY(TIME, 0.3, 1, -2, 3, 4)", lambda t: np.polyval([4, 3, -2, 1], t - 0.3)),
    (
        "CHEBY(TIME, 0.3, 1, -2, 3, 4, 5)",
        lambda t: np.polynomial.chebyshev.chebval(t - 0.3, [1, -2, 3, 4, 5]),
    ),
    (
        "FORCOS(TIME, 0.1, 2, 1, 3, 4)",
        lambda t: 1 + 3 * math.cos(2 * (t - 0.1)) + 4 * math.cos(4 * (t - 0.1)),
    ),
    (
        "FORSIN(TIME, 0.1, 2, 1, 3, 4)",
        lambda t: 1 + 3 * math.sin(2 * (t - 0.1)) + 4 * math.sin(4 * (t - 0.1)),
    ),
    (
        "IMPACT(TIME, -3, 1, 100, 1.5, 2, 0.9)",
        lambda t: 100 * (1 - t) ** 1.5 + 3 * step(1 - t, 0, 0, 0.9, 2),
    ),
    (
        "SWEEP(TIME, 2, 0.1, 0.5, 2, 1.5, 0.15)",
        lambda t: (
            2
            * step5_derivative(t, 0.1, 0, 0.25, 1, 0)
            * math.sin(2 * math.pi * (0.5 * (t - 0.1) + (t - 0.1) ** 2 / 3.8 + 0.05))
        ),
    ),
    (
        "SWEEP(TIME, 2, 0, 0.5, 0.2, 1.5, 0.1)",
        lambda t: 2 * math.sin(math.pi * (3 * t - 0.2)),
    ),
    ("SWEEP(TIME, 2, 3, 0.5, 4, 1.5, 0.1)", lambda t: 0.0),
    (
        "BISTOP(TIME, -3, 1, 2, 100, 1.5, 2, 0.9)",
        lambda t: 100 * (1 - t) ** 1.5 + 3 * step(1 - t, 0, 0, 0.9, 2),
    ),
    (
        "BISTOP(TIME, 3, -2, 0.1, 100, 2.2, 5, 0.9)",
        lambda t: -100 * (t - 0.1) ** 2.2 - 3 * step(t - 0.1, 0, 0, 0.9, 5),
    ),
]


@pytest.mark.parametrize(("text", "closed"), CLOSED_FORMS)
def test_jets_are_the_closed_form_and_its_derivatives(text, closed):
    for t in (0.37, 0.61):
        found, wanted = jet_of(text, t), differences(closed, t)
        assert found[0] == pytest.approx(wanted[0], rel=1e-14, abs=1e-14)
        assert found[1] == pytest.approx(wanted[1], rel=2e-8, abs=2e-8)
        assert found[2] == pytest.approx(wanted[2], rel=2e-7, abs=2e-7)


def test_every_elementary_function_is_in_the_list():
    names = {name for name, f in FUNCTIONS.items() if f.kind is Kind.ELEMENTARY}
    assert {name for name in names if not any(f"{name}(" in text for text, _ in CLOSED_FORMS)} == (
        set()
    )


def test_compiled_jets_are_those_of_plain_python():
    system = scene_of(*(text for text, _ in CLOSED_FORMS))
    open_expressions(system.scene)
    open_jets(system.scene)
    many = jit.function(_all_jets)
    found = np.zeros((len(CLOSED_FORMS), 3))
    address, table = _context(system.scene)
    many(address, 0.37, system.y0, found)
    assert len(table)
    wanted = [jet(system.scene, 0.37, system.y0, k) for k in range(len(CLOSED_FORMS))]
    np.testing.assert_allclose(found, wanted, rtol=1e-13, atol=1e-13)


def test_compiled_values_are_those_of_plain_python():
    system = scene_of(*(text for text, _ in CLOSED_FORMS))
    open_expressions(system.scene)
    found = np.zeros(len(CLOSED_FORMS))
    address, table = _context(system.scene)
    jit.function(_all_values)(address, 0.37, system.y0, found)
    assert len(table)
    wanted = [value(system.scene, 0.37, system.y0, k) for k in range(len(CLOSED_FORMS))]
    np.testing.assert_allclose(found, wanted, rtol=1e-13, atol=1e-13)


def _all_values(address, t, y, out):
    scene = view(address, Scene)
    for k in range(len(out)):
        out[k] = value(scene, t, y, k)


def _all_jets(address, t, y, out):
    scene = view(address, Scene)
    for k in range(len(out)):
        out[k, 0], out[k, 1], out[k, 2] = jet(scene, t, y, k)


def _context(scene):
    table = pack(scene)
    return int(table.ctypes.data), table


@pytest.mark.parametrize(
    ("text", "t", "wanted"),
    [
        # where a polynomial ends, the blend is constant
        ("STEP(TIME, 0.2, 1, 1.1, 3)", 0.2, (1, 0, 0)),
        ("STEP(TIME, 0.2, 1, 1.1, 3)", 1.1, (3, 0, 0)),
        ("STEP5(TIME, 0.2, 1, 1.1, 3)", 1.2, (3, 0, 0)),
        ("HAVSIN(TIME, 0.2, 1, 1.1, 3)", 0.1, (1, 0, 0)),
        ("HAVSIN(TIME, 0.2, 1, 1.1, 3)", 5.0, (3, 0, 0)),
        ("STEP(TIME, 1, 5, 1, 7)", 1.0, (5, 0, 0)),
        ("STEP(TIME, 1, 5, 1, 7)", 1.1, (7, 0, 0)),
        # powers, roots and angles where a derivative has no limit
        ("SQRT(TIME)", 0.0, (0, 0, 0)),
        ("TIME**0.5", 0.0, (0, 0, 0)),
        ("TIME**1.5", 0.0, (0, 0, 0)),
        ("TIME**1", 0.0, (0, 1, 0)),
        ("TIME**2", 0.0, (0, 0, 2)),
        ("TIME**3", 0.0, (0, 0, 0)),
        ("TIME**0", 0.0, (1, 0, 0)),
        ("ATAN2(TIME, TIME)", 0.0, (0, 0, 0)),
        ("ASIN(TIME)", 1.0, (math.pi / 2, 0, 0)),
        ("ACOS(TIME)", -1.0, (math.pi, 0, 0)),
        # one-sided springs without depth, and those that would pull
        ("IMPACT(TIME, 1, 1, 100, 1.5, 2, 0.1)", 1.0, (0, 0, 0)),
        ("IMPACT(TIME, 1000, 1, 100, 1.5, 2, 0.1)", 0.9, (0, 0, 0)),
        ("BISTOP(TIME, 1, 1, 2, 100, 1.5, 2, 0.1)", 1.5, (0, 0, 0)),
        ("IF(TIME - 1: 2, TIME**2, 4)", 1.0, (1, 2, 2)),
        ("IF(TIME - 1: 2, TIME**2, 4*TIME)", 3.0, (12, 4, 0)),
        ("IF(TIME: SQRT(TIME), 0, 1)", 1.0, (1, 0, 0)),
        ("SIGN(-3*TIME, 0)", 1.0, (3, 3, 0)),
        ("MOD(7*TIME, 2)", 1.0, (1, 7, 0)),
        ("ANINT(-2.5*TIME)", 1.0, (-3, 0, 0)),
    ],
)
def test_ends_of_domains_give_numbers(text, t, wanted):
    assert jet_of(text, t) == pytest.approx(wanted, abs=1e-12)


def test_step_is_that_of_the_laws():
    for t in (0.3, 0.9):
        found = jet_of("STEP(TIME, 0.2, 1, 1.1, 3)", t)
        wanted = [step_derivative(t, 0.2, 1.0, 1.1, 3.0, order) for order in range(3)]
        assert found == pytest.approx(wanted, rel=1e-13)


def test_time_is_the_only_variable_of_a_value():
    system = scene_of("3*TIME")
    assert value(system.scene, 2.0, system.y0, 0) == 6.0

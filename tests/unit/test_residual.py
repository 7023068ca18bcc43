"""Kinds of a residual's unknowns, derivatives that Python numbers carry, how r = 0 is solved."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from mbsim.laws.residual import ALGEBRAIC, DIFFERENTIAL, KINDS, SWITCHING
from mbsim.plugins.compile.dual import Dual, slope
from mbsim.plugins.compile.residual_trials import sort_unknowns
from mbsim.plugins.types import Unknown


def kinds(residual, count=1, sizes=(), axes=1):
    """Return the kinds of a residual's unknowns."""

    def asked(given):
        first = 1 + 2 * axes
        f, fdot = given[first : first + count], given[first + count :]
        return residual(given[1 : 1 + axes], given[1 + axes : first], f, fdot, given[0])

    unknowns = tuple(Unknown(f"u{k}") for k in range(count))
    return [u.kind for u in sort_unknowns(unknowns, asked, list(sizes), axes, "it")]


def friction(x, v, f, g, t):
    return [f[0] - max(-1e3, min(1e3, f[0] + v[0] - 1e-3 * g[0]))]


@pytest.mark.parametrize(
    ("residual", "wanted"),
    [
        (lambda x, v, f, g, t: [g[0] / 1e9 + f[0] - v[0]], DIFFERENTIAL),
        (lambda x, v, f, g, t: [f[0] - 3.0 * x[0]], ALGEBRAIC),
        (lambda x, v, f, g, t: [f[0] - 3.0 * x[0] + 0.0 * g[0]], ALGEBRAIC),
        (lambda x, v, f, g, t: [math.sinh(1e-3 * g[0]) - v[0]], DIFFERENTIAL),
        (lambda x, v, f, g, t: [abs(g[0]) - f[0]], DIFFERENTIAL),
        (friction, SWITCHING),
    ],
)
def test_kinds_are_found(residual, wanted):
    assert kinds(residual, sizes=[1e3, 1e-3]) == [wanted], KINDS[wanted]


def test_each_unknown_has_its_own_kind():
    def both(x, v, f, g, t):
        return [f[0] - f[1] - x[0], g[1] - v[0] + f[1]]

    assert kinds(both, 2) == [ALGEBRAIC, DIFFERENTIAL]


@pytest.mark.parametrize(
    ("function", "derivative"),
    [
        (lambda a: 3.0 + 2.0 * a - a / 4.0 + (1 - a) * a, 2.0 - 0.25 + 1.0 - 2.0 * 1.7),
        (lambda a: 5.0 / a, -5.0 / 1.7**2),
        (lambda a: a**3 + 2.0**a, 3.0 * 1.7**2 + 2.0**1.7 * math.log(2.0)),
        (lambda a: abs(-a) + max(a, 1.0) + min(a, 1.0), 2.0),
        (lambda a: +a - -a, 2.0),
        (lambda a: float(a) + 1.0, 0.0),
    ],
)
def test_numbers_carry_their_derivatives(function, derivative):
    found = function(Dual(1.7, 1.0))
    assert float(found) == function(1.7)
    assert slope(found) == pytest.approx(derivative, rel=1e-14)


class Scene:
    """One element of a residual in Python, as much of a scene as the solver looks at."""

    def __init__(self, residual, kinds, scale=1.0):
        n = len(kinds)
        self.residual = residual
        most = np.zeros(n)
        self.residuals = SimpleNamespace(
            first=np.array([0, 1]), begin=np.array([0, n]), kind=np.array(kinds),
            scale=np.full(n, scale), interpreted=np.array([1]), unsolved=np.array([-1]),
            given=np.zeros(3 + 2 * n), out=most.copy(), base=most.copy(), start=most.copy(),
            z=most.copy(), step=most.copy(), size=most.copy(), rows=most.copy(),
            by=np.zeros((2, n, n)), A=np.zeros((n, n)), swap=np.zeros(n, dtype=int),
            rise=most.copy(),
        )  # fmt: skip
        self.world = SimpleNamespace(scale=np.ones(3))

    def solve(self, h, base, start=0.0):
        """Return code, f and f' of the solution."""
        from mbsim.dynamics.forces import residual_solver as residual

        R, n = self.residuals, len(self.residuals.z)
        R.base[:], R.start[:] = base, start

        def ask(scene, e):
            R.out[:] = self.residual(R.given[1], R.given[2], R.given[3 : 3 + n], R.given[3 + n :])
            return 0

        kept, residual.ask = residual.ask, ask
        try:
            code = residual.solve(self, 0, h)
        finally:
            residual.ask = kept
        return code, R.given[3 : 3 + n].copy(), R.given[3 + n :].copy()


def jenkins(x, v, f, g):
    return [f[0] - max(-1.0, min(1.0, f[0] + v - 1e-3 * g[0]))]


@pytest.mark.parametrize("h", [1e-14, 1e-6, 1.0, 1e3])
@pytest.mark.parametrize("before", [-1.0, -0.3, 0.0, 0.999999, 1.0])
@pytest.mark.parametrize("move", [-5e-3, -1e-4, 0.0, 1e-9, 2e-3, 7.0])
def test_what_is_found_is_the_return_mapping(move, before, h):
    scene = Scene(jenkins, [SWITCHING])
    scene.residuals.given[2] = move / h
    code, f, _ = scene.solve(h, before)
    assert code == 0
    # f + (x' - f'/k) is rounded to 1e-16, which is as much of x', and k h times that of f
    close = max(1e-12, 3e-16 * 1e3 * h)
    assert f[0] == pytest.approx(min(1.0, max(-1.0, before + 1e3 * move)), abs=close)


def test_several_unknowns_and_roots_that_newton_misses():
    def two(x, v, f, g):
        return [f[0] - 2.0 * f[1] - 1.0, math.atan(5.0 * f[1]) + f[0] - 1.5]

    scene = Scene(two, [ALGEBRAIC, ALGEBRAIC])
    code, f, _ = scene.solve(1.0, 0.0, 3.0)
    assert code == 0
    assert max(map(abs, two(0, 0, f, 0))) < 1e-12
    scene = Scene(lambda x, v, f, g: [math.atan(20.0 * (f[0] - 3.0))], [ALGEBRAIC])
    assert scene.solve(1.0, 0.0, 50.0)[1][0] == pytest.approx(3.0, abs=1e-12)
    scene = Scene(lambda x, v, f, g: [(f[0] - 0.25) ** 3], [ALGEBRAIC])
    assert scene.solve(1.0, 0.0, 1.0)[1][0] == pytest.approx(0.25, abs=1e-3)


@pytest.mark.parametrize(
    "residual",
    [
        lambda x, v, f, g: [1.0 + f[0] ** 2],
        lambda x, v, f, g: [1.0],
        lambda x, v, f, g: [1.0 if f[0] > 0.7 else -1.0],
    ],
)
def test_what_has_no_root_is_said(residual):
    from mbsim.core.codes import Code

    scene = Scene(residual, [ALGEBRAIC])
    assert scene.solve(1.0, 0.0)[0] == Code.UNSOLVED_ELEMENT
    assert scene.residuals.unsolved[0] == 0

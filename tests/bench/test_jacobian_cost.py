"""What a Jacobian and its factorisation cost on chains of rods.

python -m pytest -q -m bench -s tests/bench/test_jacobian_cost.py
"""

from __future__ import annotations

import ctypes
import time

import numpy as np
import pytest

import mbsim
from helpers import joint_chain
from helpers.free_bodies import Silent
from mbsim.compile_model.build import build
from mbsim.dynamics.pipeline.problem import implicit_hooks
from mbsim.run.loop import Runner
from mbsim.run.settings import settle
from mbsim.run.start import assemble_model

pytestmark = pytest.mark.bench

#: Of a chain of 40: evaluations that a Jacobian with its factorisation may cost, and by how much
#: this may grow from a chain of 10.
MOST, GROWTH = 30.0, 5.0
ROUNDS = 200


def costs(folder, count):
    """Return the least times [s] of an evaluation, a linearisation, and both factorisations."""
    deck = folder / "chain.xml"
    deck.write_text(joint_chain.chain_deck(count, 1.0, 0.3), encoding="utf-8")
    model = mbsim.read_model(deck)
    settings = settle(model)
    system = build(model)
    runner = Runner(system, settings, None, Silent(), lambda text: None)
    assemble_model(system, runner.hooks, 0.0, runner.method.y, print, print)
    problem, _kept = implicit_hooks(system.scene, runner.problem, True)
    y = runner.method.y.copy()
    y[np.arange(len(y)) % 13 >= 7] += 0.1
    f, real, pair = np.zeros(len(y)), np.array([1e3, 1e6, 1e3, 0.0]), np.zeros(7)
    pair[0::2], pair[1:6:2] = (1e3, 0.0, 1e3, 0.0), (1e3, 2e6, 1e3)
    pointer = ctypes.c_void_p
    form = ctypes.CFUNCTYPE(
        ctypes.c_int64, ctypes.c_int64, ctypes.c_double, ctypes.c_double, pointer, pointer
    )

    def least(name, a, b):
        hook, given = form(getattr(problem, name)), (a.ctypes.data, b.ctypes.data)
        times = []
        for _ in range(ROUNDS):
            began = time.perf_counter()
            code = hook(problem.context, 0.0, 0.0, *given)
            times.append(time.perf_counter() - began)
            assert code == 0
        return min(times)

    return [
        least("rhs", y, f),
        least("linearise", y, f),
        least("factor", real, f),
        least("factor_pair", pair, f),
    ]


def test_cost_of_a_jacobian(tmp_path):
    print("\nrods  f [us]  linearised  factored  complex   Jacobian in f   with complex")
    jacobians = {}
    for count in (10, 20, 40, 80):
        f, linear, real, pair = costs(tmp_path, count)
        jacobians[count] = linear + real
        print(
            f"{count:4} {1e6 * f:7.1f} {1e6 * linear:11.1f} {1e6 * real:9.1f} {1e6 * pair:8.1f} "
            f"{(linear + real) / f:15.1f} {(linear + real + pair) / f:14.1f}"
        )
        if count == 40:
            assert linear + real <= MOST * f
    growth = jacobians[40] / jacobians[10]
    print(f"from 10 rods to 40 it grows {growth:.2f} times")
    assert growth <= GROWTH

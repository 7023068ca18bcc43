"""What a controller in Python costs a step, beside the simulation's own time."""

from __future__ import annotations

import time

import numpy as np
import pytest

import mbsim
from helpers.folders import MODELS

STEPS, DT = 140, 0.01


class Spent:
    """Seconds that a function takes from one look to the next."""

    def __init__(self, function):
        self.function, self.seconds = function, 0.0

    def __call__(self, *given):
        began = time.perf_counter()
        answer = self.function(*given)
        self.seconds += time.perf_counter() - began
        return answer

    def taken(self):
        """Return what was spent since this was asked last."""
        seconds, self.seconds = self.seconds, 0.0
        return seconds


@pytest.mark.bench
def test_cost_of_a_controller():
    with mbsim.open(MODELS / "pendulum_wheel.xml") as sim:
        sim.inputs["torque"] = 1e-12
        sim.step(0.5)
        sim.inputs["torque"] = sim.signals["requests/1"][1]  # what is needed once
        advance = sim._advance = Spent(sim._advance)
        write = sim._write = Spent(sim._write)
        rows = []
        for _ in range(STEPS):
            began = time.perf_counter()
            seen = sim.signals["requests/1"]
            asked = time.perf_counter()
            _, lean, rate, x, _, speed, _, _ = seen
            torque = 20 * lean + 4 * rate + 0.5 * x + 1.0 * speed
            decided = time.perf_counter()
            sim.inputs["torque"] = torque
            sim.step(DT)
            ended = time.perf_counter()
            evaluated, own = write.taken(), advance.taken()
            rows.append((asked - began - evaluated, evaluated, ended - decided - own, own))
    signals, evaluated, step, own = 1e6 * np.median(rows, axis=0)
    print(f"\nsignals {signals:.1f} us, step {step:.1f} us, both {signals + step:.1f} us a step")
    print(f"compiled: the row that signals are read from {evaluated:.1f} us, the run {own:.1f} us")
    assert signals + step > 0.0

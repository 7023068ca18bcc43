"""What a friction law gives where a surface is rubbed along a straight way: plain Python.

`steady` is friction over slip speed after a long slide, `cycle` a slip to and fro.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from mbsim.laws.catalog import BEGUN, FrictionInput, FrictionLaw

Memory = tuple[float, ...]

#: A slide is steady after so many times the way over which friction builds up.
LONG = 15.0
#: Parts of that way, and of a quarter of a cycle, that are gone at once.
FINE, QUARTER = 0.02, 500

#: Parameters that show what a law does, where nobody gives others and it has none of its own.
USUAL = {
    "mu_static": 0.5,
    "mu_dynamic": 0.3,
    "stiction_trans_vel": 2e-3,
    "friction_trans_vel": 1e-2,
    "stribeck_vel": 5e-3,
    "bristle_stiffness": 1e4,
    "rolling_arm": 0.01,
    "patch_radius": 0.1,
}


class Conditions(NamedTuple):
    """Under which a law is rubbed, in one consistent set of units."""

    nforce: float = 10.0  # normal force
    stiffness: float = 1e4  # dF/d(depth) of the normal force
    mass: float = 1.0  # that slips
    amplitude: float = 2e-3  # of the slip to and fro
    speed: float = 0.05  # the fastest, at x = 0
    spin: float = 0.0  # about the normal
    radius: float = 0.0  # of the contact's area


class Sample(NamedTuple):
    """A law with its parameters, ready to be rubbed."""

    name: str
    #: Of inputs and memory: forces and torques and what follows them, and new memory or its rates.
    ask: Callable[[FrictionInput, Memory], tuple[Sequence[float], Memory]]
    memory: int = 0
    carried: int = 0  # how many numbers of memory are integrated
    way: float = 0.0  # over which friction builds up


def usual_parameters(law: FrictionLaw) -> dict[str, float | None]:
    """Return a law's parameters: its defaults but for 0, else those of USUAL, else None."""
    own = {each.name: each.default for each in law.own}
    return {name: own.get(name) or USUAL.get(name, own.get(name)) for name in law.parameters}


def sample_of(law: FrictionLaw, values: dict[str, float], at: Conditions) -> Sample:
    """Return a registered law with parameters by name."""
    par = [values[name] for name in law.parameters]

    def ask(inputs: FrictionInput, memory: Memory) -> tuple[Sequence[float], Memory]:
        if law.memory == 0:
            return law.force(inputs, *par), ()
        found: tuple[Sequence[float], Memory] = law.force(inputs, memory, *par)
        return found

    stiffness = values.get("bristle_stiffness", values.get("tangential_stiffness", math.nan))
    if not stiffness > 0.0:
        stiffness = 0.8 * at.stiffness
    most = max(values.get("mu_static", 0.0), values.get("mu_dynamic", 0.0))
    way = most * at.nforce / stiffness if law.memory else 0.0
    return Sample(law.name, ask, law.memory, law.carried, way)


class Slider:
    """A surface on its way: slip, and what the law keeps of it."""

    def __init__(self, sample: Sample, at: Conditions) -> None:
        self.sample, self.at = sample, at
        self.memory: Memory = (BEGUN,) * sample.memory
        self.time, self.x = 0.0, 0.0

    def _ask(self, dt: float, v: float, x: float, memory: Memory) -> tuple[Sequence[float], Memory]:
        at, none = self.at, (0.0, 0.0, 0.0)
        inputs = FrictionInput(
            time=self.time + dt,
            step=dt,
            x=(x, 0.0, at.spin * (self.time + dt)),
            xdot=(v, 0.0, at.spin),
            rolling=(0.0, 0.0),
            nforce=at.nforce,
            area=math.pi * at.radius**2,
            radius=at.radius,
            loci=none,
            locj=none,
            dflag=0.0,
            frozen=0.0,
            stiffness=at.stiffness,
            mass=at.mass,
            limit=math.nan,
            growth=0.0,
            nforce_rate=math.nan,
            limit_rate=math.nan,
            stiffness_rate=math.nan,
        )
        return self.sample.ask(inputs, memory)

    def go(self, dt: float, v: float, dx: float) -> float:
        """Go on by a time and a way to where the slip velocity is v; return the force there."""
        x, sample = self.x + dx, self.sample
        memory = self._integrated(dt, v) if sample.carried > 0 else self.memory
        force, kept = self._ask(dt, v, x, memory)
        self.memory = kept[: sample.memory]
        self.time += dt
        self.x = x
        return float(force[0])

    def _integrated(self, dt: float, v: float) -> Memory:
        """Return the memory after a time, by the classical method of Runge and Kutta."""
        n, first = self.sample.memory, self.sample.carried

        def moved(by: float, rates: Memory) -> Memory:
            carried = zip(self.memory[:first], rates, strict=True)
            return (*(z + by * rate for z, rate in carried), *self.memory[first:])

        a = self._ask(0.0, v, self.x, self.memory)[1][n:]
        b = self._ask(0.5 * dt, v, self.x, moved(0.5 * dt, a))[1][n:]
        c = self._ask(0.5 * dt, v, self.x, moved(0.5 * dt, b))[1][n:]
        d = self._ask(dt, v, self.x, moved(dt, c))[1][n:]
        mean = tuple((p + 2 * q + 2 * r + s) / 6 for p, q, r, s in zip(a, b, c, d, strict=True))
        return moved(dt, mean)


def steady(sample: Sample, at: Conditions, speeds: Sequence[float]) -> list[float]:
    """Return friction against the slip, over the normal force, after a long slide at each speed."""
    found = []
    for v in speeds:
        slider, force = Slider(sample, at), 0.0
        if v == 0.0 or sample.memory == 0:
            found.append(-slider.go(0.0, v, 0.0) / at.nforce)
            continue
        step = FINE * (sample.way or at.amplitude)
        for _ in range(round(LONG / FINE)):
            force = slider.go(step / v, v, step)
        found.append(-force / at.nforce)
    return found


def cycle(sample: Sample, at: Conditions) -> tuple[list[float], list[float]]:
    """Return slip and force over normal force along x = A sin(w t), one cycle and a quarter."""
    slider = Slider(sample, at)
    w = at.speed / at.amplitude
    dt = 0.5 * math.pi / w / QUARTER
    x, force = [0.0], [slider.go(0.0, at.speed, 0.0) / at.nforce]
    for k in range(1, 5 * QUARTER + 1):
        there = at.amplitude * math.sin(w * k * dt)
        # the velocity of its middle, as integrated memory takes it
        v = at.speed * math.cos(w * (k - 0.5 if sample.carried else k) * dt)
        force.append(slider.go(dt, v, there - slider.x) / at.nforce)
        x.append(there)
    return x, force


def samples(sample: Sample, at: Conditions, count: int = 200) -> list[float]:
    """Return speeds at which `steady` shows a law: from 0 to the fastest, dense near 0."""
    few = count if sample.memory == 0 else count // 5
    return [at.speed * (k / few) ** 2 for k in range(few + 1)]


def described(values: dict[str, Any]) -> str:
    """Return parameters as a note."""
    return ", ".join(f"{name} {value:g}" for name, value in values.items() if value == value)

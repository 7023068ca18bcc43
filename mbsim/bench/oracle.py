"""References that are computed anew: exact flight; contact and linkages by DOP853 at its finest.

They use none of mbsim's own simulation code, so that they can judge it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from mbsim.bench import parameters as p

#: Normal force [N] from penetration [m] and its rate [m/s].
Force = Callable[[float, float], float]

RELATIVE, ABSOLUTE = 1e-13, 1e-17
#: Longest step over the longest contact, so that no kink of a law is stepped over: halving it moves
#: the ten bounces of S2a by 2e-9 m.
SHARE = 1.0 / 4000.0


class Flight(NamedTuple):
    """Free flight: height and velocity at the time `start`."""

    start: float
    height: float
    velocity: float

    def at(self, t: np.ndarray) -> np.ndarray:
        """Return heights at `t`."""
        s = t - self.start
        return np.asarray(self.height + self.velocity * s - 0.5 * p.GRAVITY * s**2)

    def landing(self) -> float:
        """Return when the height is 0 again; `height` >= 0."""
        v, g = self.velocity, p.GRAVITY
        return self.start + (v + math.sqrt(v * v + 2.0 * g * self.height)) / g


class Touch(NamedTuple):
    """One contact: the dense solution of depth and its rate from `start` to `end`."""

    start: float
    end: float
    solution: Any

    def at(self, t: np.ndarray) -> np.ndarray:
        """Return heights at `t`; below 0 in contact."""
        return np.asarray(-self.solution(t - self.start)[0])


class Bounces(NamedTuple):
    """A dropped sphere: flights and contacts in turn."""

    phases: tuple[Flight | Touch, ...]

    def height(self, times: np.ndarray) -> np.ndarray:
        """Return the gap between sphere and plane at `times`, shape (n,), m."""
        starts = np.array([phase.start for phase in self.phases])
        which = np.maximum(np.searchsorted(starts, times, side="right") - 1, 0)
        out = np.empty(len(times))
        for k in np.unique(which):
            chosen = which == k
            out[chosen] = self.phases[k].at(times[chosen])
        return out


def bounces(drop: p.Drop, force: Force, scale_time: float) -> Bounces:
    """Return the exact motion of a dropped sphere.

    Parameters
    ----------
    drop : Drop
        Mass, gap and end time.
    force : callable
        Normal force of the law; it acts while the depth is positive.
    scale_time : float
        Upper limit of a contact's duration [s].
    """
    phases: list[Flight | Touch] = [Flight(0.0, drop.gap, 0.0)]
    while True:
        flight = phases[-1]
        assert isinstance(flight, Flight)
        lands = flight.landing()
        if lands >= drop.end_time:
            return Bounces(tuple(phases))
        speed = -(flight.velocity - p.GRAVITY * (lands - flight.start))
        touch, leaving = _touch(lands, speed, drop.mass, force, scale_time)
        phases += [touch, Flight(touch.end, 0.0, leaving)]


def _touch(
    start: float, speed: float, mass: float, force: Force, limit: float
) -> tuple[Touch, float]:
    """Return one contact that begins with `speed` down, and the speed up at its end."""
    from scipy.integrate import solve_ivp

    def rate(t: float, y: np.ndarray) -> list[float]:
        return [y[1], p.GRAVITY - force(y[0], y[1]) / mass]

    def apart(t: float, y: np.ndarray) -> float:
        # the touch itself is no event: depth only leaves 0 there
        return float(y[0]) if t > 0.0 else 1.0

    apart.terminal, apart.direction = True, -1  # type: ignore[attr-defined]
    done = solve_ivp(
        rate,
        (0.0, limit),
        [0.0, speed],
        method="DOP853",
        rtol=RELATIVE,
        atol=[ABSOLUTE, 1e-13],
        max_step=limit * SHARE,
        dense_output=True,
        events=apart,
    )
    end = float(done.t_events[0][0])
    return Touch(start, start + end, done.sol), -float(done.y_events[0][0][1])


#: Rate of a state at a time.
Rate = Callable[[float, np.ndarray], np.ndarray]


def sampled(rate: Rate, start: np.ndarray, end_time: float) -> np.ndarray:
    """Return states every `SAMPLE` seconds, shape (n + 1, len(start)).

    Every sample ends a step, because between its steps DOP853 is less exact than at them.
    """
    from scipy.integrate import solve_ivp

    rows = [start]
    step = 1e-4
    for k in range(round(end_time / p.SAMPLE)):
        done = solve_ivp(
            rate,
            (k * p.SAMPLE, (k + 1) * p.SAMPLE),
            rows[-1],
            method="DOP853",
            rtol=RELATIVE,
            atol=1e-14,
            first_step=step,
        )
        # the last step is cut at the sample; the first of the next may be as long as any
        step = min(float(np.diff(done.t).max()), p.SAMPLE)
        rows.append(done.y[:, -1])
    return np.array(rows)


def chain_rate(count: int) -> Rate:
    """Return the rate of angles and their rates of S8_n, in minimal coordinates.

    With a the rods' angles from x towards z and all over m l^2:
    sum_j c_ij (cos(a_i - a_j) a_j'' + sin(a_i - a_j) a_j'^2) = -g/l (n - i + 1/2) cos a_i,
    c_ij = n - max(i, j) + 1/2, c_ii = n - i + 1/3, counted from 1 (Lagrange).
    """
    i = np.arange(1, count + 1)
    c = count - np.maximum.outer(i, i) + 0.5
    c[np.diag_indices(count)] = count - i + 1.0 / 3.0
    weight = p.GRAVITY * count / p.S8.length * (count - i + 0.5)

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        angle, w = y[:count], y[count:]
        between = np.subtract.outer(angle, angle)
        pull = (c * np.sin(between)) @ (w * w) + weight * np.cos(angle)
        return np.concatenate([w, -np.linalg.solve(c * np.cos(between), pull)])

    return rate


@lru_cache
def s8_tip(count: int) -> np.ndarray:
    """Return x and z of the free end of S8_n every `SAMPLE` seconds, shape (n, 2), m."""
    angles = sampled(chain_rate(count), np.zeros(2 * count), p.S8.end_time[count])[:, :count]
    length = p.S8.length / count
    return length * np.stack([np.cos(angles).sum(axis=1), np.sin(angles).sum(axis=1)], axis=1)


def crank_rate(t: float, y: np.ndarray) -> np.ndarray:
    """Return the rate of the crank's angle a and its rate w in S8b: M a'' + M' w^2 / 2 + V' = 0.

    The rod's angle b follows from l1 sin a + l2 sin b = 0; x of the slider, and x and z of the
    rod's middle, from both. A rate by a is written with one stroke: b1 = db/da, b2 = d2b/da2.
    """
    s = p.S8B
    a, w = y
    l1, l2 = s.crank_length, s.rod_length
    sin_a, cos_a = math.sin(a), math.cos(a)
    sin_b = -l1 / l2 * sin_a
    cos_b = math.sqrt(1.0 - sin_b * sin_b)
    b1 = -l1 * cos_a / (l2 * cos_b)
    b2 = (l1 * sin_a / l2 + sin_b * b1 * b1) / cos_b
    # first and second rates of l2 cos b
    reach1 = -l2 * sin_b * b1
    reach2 = -l2 * (cos_b * b1 * b1 + sin_b * b2)
    x1, x2 = -l1 * sin_a + reach1, -l1 * cos_a + reach2
    mid_x1, mid_x2 = -l1 * sin_a + reach1 / 2.0, -l1 * cos_a + reach2 / 2.0
    mid_z1, mid_z2 = l1 * cos_a / 2.0, -l1 * sin_a / 2.0
    across = p.ROD_ACROSS * s.rod_mass * l2 * l2
    mass = s.crank_mass * l1 * l1 / 3.0 + s.slider_mass * x1 * x1
    mass += s.rod_mass * (mid_x1 * mid_x1 + mid_z1 * mid_z1) + across * b1 * b1
    slope = s.slider_mass * x1 * x2 + s.rod_mass * (mid_x1 * mid_x2 + mid_z1 * mid_z2)
    slope += across * b1 * b2
    torque = p.GRAVITY * (s.crank_mass * l1 / 2.0 * cos_a + s.rod_mass * mid_z1)
    return np.array([w, -(slope * w * w + torque) / mass])


@lru_cache
def s8b_angle() -> np.ndarray:
    """Return the crank's angle in S8b every `SAMPLE` seconds, shape (n,), rad."""
    start = np.array([p.S8B.angle, p.S8B.speed])
    return sampled(crank_rate, start, p.S8B.end_time)[:, 0]


def _linear(law: p.LinearLaw) -> Force:
    return lambda d, v: max(0.0, law.k * d + law.c * v) if d > 0.0 else 0.0


def _linear_noclip(law: p.LinearLaw) -> Force:
    return lambda d, v: law.k * d + law.c * v if d > 0.0 else 0.0


def _soft_constraint(law: p.LinearLaw, mass: float) -> Force:
    # the limit of a soft constraint: it also carries the weight while in contact
    weight = mass * p.GRAVITY
    return lambda d, v: max(0.0, law.k * d + law.c * v + weight) if d > 0.0 else 0.0


def _impact(law: p.ImpactLaw) -> Force:
    def force(d: float, v: float) -> float:
        if d <= 0.0:
            return 0.0
        s = min(d / law.dmax, 1.0)
        damper = law.c * s * s * (3.0 - 2.0 * s) * v
        return max(0.0, law.k * math.pow(d, law.e) + damper)

    return force


def _hunt_crossley(law: p.HuntCrossleyLaw) -> Force:
    return lambda d, v: law.k * d * max(0.0, 1.0 + law.dissipation * v) if d > 0.0 else 0.0


#: Law variant -> its force, for S2 and S10a.
S2_FORCES: dict[str, Force] = {
    "impact": _impact(p.S2A_LAW),
    "linear": _linear(p.S2B_LAW),
    "linear_noclip": _linear_noclip(p.S2B_LAW),
    "mujoco": _soft_constraint(p.S2B_LAW, p.S2.mass),
    "hc": _hunt_crossley(p.S2C_LAW),
}
S10A_FORCES: dict[str, Force] = {
    "linear": _linear(p.S10A_LAW),
    "linear_noclip": _linear_noclip(p.S10A_LAW),
    "mujoco": _soft_constraint(p.S10A_LAW, p.S10A.mass),
}


@lru_cache
def s2(variant: str) -> Bounces:
    """Return the reference motion of S2 under a law."""
    # the slowest law and the softest bounce last 6 ms
    return bounces(p.S2, S2_FORCES[variant], 0.02)


@lru_cache
def s10a_rebound(variant: str) -> float:
    """Return rebound height over drop height of S10a under a law."""
    phases = bounces(p.S10A, S10A_FORCES[variant], 1e-4).phases
    first = phases[2]
    assert isinstance(first, Flight)
    return float(first.velocity**2 / (2.0 * p.GRAVITY * p.S10A.gap))

"""What the peers' modules share: silence, timing, rows, and rotations."""

from __future__ import annotations

import contextlib
import math
import os
import statistics
import sys
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from mbsim.bench import parameters as p
from mbsim.bench.measurement import LONG_RUN
from mbsim.bench.outcome import Outcome

#: One run of S7 stops after this much wall time (s); its note says where.
WALL_CAP = 60.0


class Rows(NamedTuple):
    """States at the stored times, angular velocity in the global frame."""

    time: np.ndarray  # (n,)
    position: np.ndarray  # (n, bodies, 3)
    quaternion: np.ndarray  # (n, bodies, 4), w first
    velocity: np.ndarray  # (n, bodies, 3)
    angular_velocity: np.ndarray  # (n, bodies, 3)


class Plan(NamedTuple):
    """Fixed steps: `rows` rows after t = 0, one every `steps_per_row` steps of `dt` (s)."""

    dt: float
    steps_per_row: int
    rows: int

    @property
    def times(self) -> np.ndarray:
        """Times of the rows (s), t = 0 included; shape (rows + 1,)."""
        return np.arange(self.rows + 1) * (self.steps_per_row * self.dt)


def plan(dt: float, end_time: float, sample: float = p.SAMPLE) -> Plan:
    """Rows at multiples of `sample` (s), or of the next multiple that steps of `dt` can meet."""
    for multiple in range(1, 101):
        steps = round(multiple * sample / dt)
        if steps >= 1 and abs(steps * dt - multiple * sample) < 1e-9 * sample:
            return Plan(dt, steps, round(end_time / (steps * dt)))
    raise ValueError(f"dt = {dt}: no row time is a multiple of it")


@contextlib.contextmanager
def silence() -> Iterator[None]:
    """Send what compiled code prints to nowhere; Python's own streams are put back after."""
    sys.stdout.flush()
    sys.stderr.flush()
    saved = os.dup(1), os.dup(2)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 1)
        os.dup2(nowhere, 2)
        yield
        sys.stdout.flush()
        sys.stderr.flush()
    finally:
        os.dup2(saved[0], 1)
        os.dup2(saved[1], 2)
        for descriptor in (*saved, nowhere):
            os.close(descriptor)


def measure(once: Callable[[], tuple[float, Any]], repeats: int) -> tuple[float, Any]:
    """Median wall time (s) of `repeats` runs after one that is thrown away, and the last run.

    `once` returns the wall time of its stepping loop and what it stored. A run of more than
    `LONG_RUN` is not repeated: its own noise is small beside it, and a warm-up changes nothing.
    With `repeats` 0 the first run is all.
    """
    wall, stored = once()
    if wall > LONG_RUN or repeats == 0:
        return wall, stored
    walls = []
    for _ in range(repeats):
        wall, stored = once()
        walls.append(wall)
    return statistics.median(walls), stored


def outcome(
    wall_s: float, rows: Rows, note: str, end_time: float, extra: dict[str, float] | None = None
) -> Outcome:
    """An outcome whose wall time is scaled to `end_time` where a run had to stop early."""
    reached = float(rows.time[-1])
    if reached < end_time * (1 - 1e-9):
        stopped = f"stopped at t = {reached:.2f} s after {wall_s:.0f} s, wall time scaled"
        note = f"{note}; {stopped}" if note else stopped
        wall_s *= end_time / reached
    return Outcome(wall_s, *rows, extra=dict(extra or {}), note=note)


def rotate(quaternion: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Vectors (..., 3) turned by unit quaternions (..., 4): v + 2w u x v + 2 u x (u x v)."""
    w, u = quaternion[..., :1], quaternion[..., 1:]
    twice = 2.0 * np.cross(u, vector)
    return vector + w * twice + np.cross(u, twice)


def quaternion_of(rotation_vector: np.ndarray) -> np.ndarray:
    """Unit quaternions (..., 4) of rotation vectors (..., 3)."""
    half = np.linalg.norm(rotation_vector, axis=-1, keepdims=True) / 2
    # sin(h) / (2h), whose limit at 0 is 1/2: np.sinc(x) is sin(pi x) / (pi x)
    return np.concatenate([np.cos(half), rotation_vector * np.sinc(half / math.pi) / 2], axis=-1)


def hermite(time: np.ndarray, x: np.ndarray, v: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Cubic through values and slopes at the steps (n,), read at the times `at`.

    Exact in free flight, whose path is a parabola; in contact the steps are short.
    """
    i = np.clip(np.searchsorted(time, at, side="right") - 1, 0, len(time) - 2)
    h = time[i + 1] - time[i]
    s = (at - time[i]) / h
    left = (1 + 2 * s) * (1 - s) ** 2 * x[i] + s * (1 - s) ** 2 * h * v[i]
    right = s**2 * (3 - 2 * s) * x[i + 1] + s**2 * (s - 1) * h * v[i + 1]
    values: np.ndarray = left + right
    return values


def through_four(
    time: np.ndarray, x: np.ndarray, v: np.ndarray, at: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Polynomials through values and slopes (n, k) at the four steps around each of `at`.

    They have degree 7, so that a solution of order 5 is not less exact between its steps; `time`
    has at least four of them. Values and slopes (len(at), k), by Hermite's divided differences.
    """
    first = np.clip(np.searchsorted(time, at, side="right") - 2, 0, len(time) - 4)
    nodes = first[:, None] + np.arange(4)
    t = np.repeat(time[nodes], 2, axis=1)  # (m, 8), each twice
    table = np.repeat(x[nodes], 2, axis=1)  # (m, 8, k), differences of growing order
    slopes = np.repeat(v[nodes], 2, axis=1)
    for order in range(1, 8):
        span = (t[:, order:] - t[:, : 8 - order])[..., None]
        same = span == 0.0
        rise = np.diff(table[:, order - 1 :], axis=1) / np.where(same, 1.0, span)
        table[:, order:] = np.where(same, slopes[:, order:], rise)
    value = np.zeros((len(at), x.shape[1]))
    slope = np.zeros_like(value)
    for k in reversed(range(8)):  # Horner, with the slope of each product
        step = (at - t[:, k])[:, None]
        slope = slope * step + value
        value = value * step + table[:, k]
    return value, slope


def s7_measures(position: np.ndarray) -> dict[str, float]:
    """Penetrations and losses of S7 over the rows of positions (n, spheres, 3).

    A sphere that left the box counts as deep as it is beyond a wall or the floor, so a value near
    or above 1 is tunnelling.
    """
    depths = [_deepest(row) for row in position]
    count = position.shape[1]
    beyond = np.abs(position[-1, :, :2]).max(axis=1) > p.s7_half_width(count)
    escaped = beyond | (position[-1, :, 2] < 0)
    return {
        "pen_max_over_r": max(depths) / p.S7.radius,
        "pen_end_over_r": depths[-1] / p.S7.radius,
        "escaped": float(escaped.sum()),
    }


def _deepest(position: np.ndarray) -> float:
    """Largest penetration (m) of spheres (n, 3) in each other, the walls and the floor."""
    from scipy.spatial import cKDTree

    radius, half = p.S7.radius, p.s7_half_width(len(position))
    if not np.isfinite(position).all():
        return math.inf
    walls = float(np.abs(position[:, :2]).max() - (half - radius))
    floor = float(radius - position[:, 2].min())
    pairs = cKDTree(position).query_pairs(2 * radius, output_type="ndarray")
    if not len(pairs):
        return max(walls, floor, 0.0)
    gap = np.linalg.norm(position[pairs[:, 0]] - position[pairs[:, 1]], axis=1)
    return max(walls, floor, float(2 * radius - gap.min()))

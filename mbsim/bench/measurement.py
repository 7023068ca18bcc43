"""`Measurement`: one line of the benchmark's table, and how outcomes become one."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from mbsim.bench.outcome import Outcome
from mbsim.bench.scene import Scene

#: A run that takes longer than this [s] is not repeated.
LONG_RUN = 2.0
#: One that takes less than this [s] is repeated so many times as often: else the whole set would
#: fit into a moment when the machine does something else.
SHORT_RUN, OFTEN = 0.01, 3

OURS = "mbsim"


class Measurement(NamedTuple):
    """One engine with one setting on one scene.

    Attributes
    ----------
    wall_s, wall_per_sim_s
        Seconds in the stepping loop, median of `repeats`; per simulated second. NaN where the
        run failed, and `note` says why.
    errors
        Measures of the scene; empty where the run failed.
    counts
        The engine's own numbers, e.g. steps and evaluations, `rows_ms`, and `reached_s` of
        a run that ended early.
    """

    scene: str
    engine: str
    version: str
    setting: str
    repeats: int
    wall_s: float
    wall_per_sim_s: float
    errors: dict[str, float]
    counts: dict[str, float]
    note: str


def measured(
    scene: Scene,
    engine: str,
    version: str,
    setting: str,
    run: Callable[[int], Outcome],
    repeats: int,
) -> Measurement:
    """Run one setting; `run` takes the number of repeats and returns their median.

    A run is tried once first: where that takes long it is the measurement.
    """
    wanted = repeats if scene.repeats is None else min(repeats, scene.repeats)
    done, outcome = 1, run(1)
    if outcome.wall_s < SHORT_RUN and wanted > 1:
        wanted *= OFTEN
    if outcome.wall_s < LONG_RUN and wanted > 1:
        done, outcome = wanted, run(wanted)
    reached = float(outcome.time[-1])
    complete = abs(reached - scene.end_time) < 1e-6 * scene.end_time
    # where the measure is a largest value, a run that was cut short still gives a lower bound
    judged = complete or scene.pass_below is not None
    counts = outcome.extra | {"rows_ms": rows_apart(outcome)}
    counts |= {} if complete else {"reached_s": reached}
    errors = scene.errors(outcome, scene.variant(outcome.note)) if judged else {}
    note = outcome.note
    if not judged:
        note = "; ".join(filter(None, (note, f"ended at {reached:.4g} s, not judged")))
    return Measurement(
        scene.name,
        engine,
        version,
        setting,
        done,
        outcome.wall_s,
        outcome.wall_s / scene.end_time,
        errors,
        counts,
        note,
    )


def rows_apart(outcome: Outcome) -> float:
    """Return the largest time between two rows [ms]: who stores less does less work."""
    return float(f"{1e3 * np.diff(outcome.time).max(initial=0.0):.4g}")


def failed(scene: Scene, engine: str, version: str, setting: str, reason: str) -> Measurement:
    """Return the line of a run that gave nothing."""
    note = f"failed: {reason}"
    return Measurement(scene.name, engine, version, setting, 0, math.nan, math.nan, {}, {}, note)

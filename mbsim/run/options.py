"""What a run is asked for, beside the model: the options of `mbsim run` and of `simulate`."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mbsim.errors import MbsimError

Progress = Callable[[float, float, float], None]
Notify = Callable[[str], None]


@dataclass(frozen=True)
class Options:
    """As `simulation.simulate` says of its arguments of these names."""

    end_time: float | None = None
    print_interval: float | None = None
    integrator: str | None = None
    tol: float | None = None
    plugins: tuple[str | Path, ...] = ()
    output: str | Path | None = None
    resume: bool = False
    detector: str = "auto"
    interpret_plugins: bool = False
    allow_overlap: bool = False
    dump_fclib: int | None = None
    dump_hardest: int | None = None
    signals: tuple[str, ...] = ()
    contact_points: bool = False
    scripts: bool = True
    plugin_timeout: float | None = None
    progress: Progress | None = None
    notify: Notify | None = None
    verify: bool | str = False
    # parameters, Element[id].attribute, of which derivatives are carried along; what they are read
    # from, None for the model's file
    sensitivity: tuple[str, ...] = ()
    source: Any = None
    # how many times the run's evaluations each of them may take, 0 for no bound
    sensitivity_worth: int = 0
    # of a rerun that verifies: what tolerances are multiplied by, and what bounds steps and work
    tighter: float = 1.0
    least_steps: float = 0.0
    h_most: float = math.inf
    most_evaluations: int | None = None
    # of a run of a study, in memory: without what only files and pictures need
    bare: bool = False


class TooMuchWork(MbsimError):
    """A rerun took more evaluations than it is worth."""

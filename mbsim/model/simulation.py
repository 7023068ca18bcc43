"""What a deck's commands say: simulations, their settings, and changes between them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from mbsim.model.forces import Gravity
from mbsim.model.source import NO_RESULT, Source


@dataclass(frozen=True)
class Transient:
    """Param_Transient; None where the deck says nothing."""

    integrator_type: str | None = None
    integr_tol: float | None = None
    h_max: float | None = None
    h_min: float | None = None
    h0_max: float | None = None
    sleep: bool | None = None
    source: Source = Source()


@dataclass(frozen=True)
class Static:
    """Param_Static; None where the deck says nothing."""

    max_num_iter: int | None = None
    imbalance: float | None = None  # [F]
    source: Source = Source()


@dataclass(frozen=True)
class Plant:
    """Control_PlantInput, Control_PlantOutput: variables in their order."""

    id: int
    variable_ids: tuple[int, ...]
    label: str = ""
    source: Source = Source()


@dataclass(frozen=True)
class Linear:
    """Param_Linear; `inputs` and `outputs` are the ids of the variables that it means."""

    pinput_id: int | None = None
    poutput_id: int | None = None
    eigen_analysis: bool = True
    inputs: tuple[int, ...] = ()
    outputs: tuple[int, ...] = ()
    source: Source = Source()


@dataclass(frozen=True)
class Change:
    """An element as a statement of <Command> leaves it; `table` is what `Model.table` takes."""

    table: str
    element: Any
    text: str = field(metadata=NO_RESULT)  # for the log


@dataclass(frozen=True)
class Simulation:
    """One Simulate statement: from the end of the one before (or `start_time`) to `end_time`.

    STATIC, LINEAR and ASSEMBLY take no time: they are where they stand. KINEMATIC is a TRANSIENT
    of a model that has no degree of freedom.
    """

    analysis_type: str = "TRANSIENT"
    start_time: float = 0.0
    end_time: float = 0.0
    print_interval: float = 0.0
    transient: Transient | None = None  # a Param_Transient that stood before it in <Command>
    gravity: Gravity | None = None  # a Force_Gravity that stood before it in <Command>
    static: Static = Static()
    changes: tuple[Change, ...] = ()  # all that stood before it in <Command>
    # elements that take no part, by what `Model.table` or `Model` calls their table, and by id
    inactive: tuple[tuple[str, int], ...] = ()
    linear: Linear = Linear()
    later: bool = False  # STATIC after another of the same statement, at its own start_time
    source: Source = Source()

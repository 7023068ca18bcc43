"""Measured curves made of runs, with noise, and pools that keep what they ran."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from helpers.folders import PACKAGES
from mbsim import read_model, simulate
from mbsim.studies.study import Case, Study
from mbsim.studies.worker import Here, Row

BELT = PACKAGES / "models" / "belt_stick_slip.xml"
LUGRE = PACKAGES / "models" / "lugre_stick_slip.xml"
CONTACT = "Force_Contact[301]"
X = "bodies/2/position/x"
#: The belt with friction that falls with speed: what is set beside the fitted parameters.
BELT_SETS = {f"{CONTACT}.cff_type": "STRIBECK", f"{CONTACT}.stiction_trans_vel": 0.01}
BELT_TRUE = {"mu_static": 1.0, "mu_dynamic": 0.5, "stribeck_vel": 0.1}
#: The block with bristles, its spring's end going to and fro so that it slips at all speeds up to
#: 1.2; `stribeck_vel` is of their order. Bristles as in the deck are too stiff to be seen.
LUGRE_SETS = {"Force_Vector_TwoBody[401].fx_expression": "2*(3*SIN(0.4*TIME)-DX(20,11))"}
LUGRE_TRUE = {"mu_static": 1.5, "mu_dynamic": 1.0, "stribeck_vel": 0.1, "viscous_coef": 0.1}


@dataclass
class Kept:
    """A pool that is the process itself and runs nothing twice, whatever study asks."""

    study: Study
    rows: dict[str, Row] = field(default_factory=dict)
    runs: int = 0

    def share(self, cases: Iterable[Case], count: int) -> Iterator[Row]:
        """Yield the row of each run in turn."""
        here = Here(self.study)
        for case in cases:
            key = repr((self.study.overrides(case.values), self.study.options, case.sensitivity))
            if key not in self.rows:
                self.runs += 1
                (self.rows[key],) = here.share([case], 1)
            yield self.rows[key]._replace(run=case.run)

    def close(self) -> None:
        """Keep what was run."""


def curve(deck: Path, sets: dict[str, object], end: float, step: float) -> tuple[np.ndarray, ...]:
    """Return times and displacement of a block, (rows,) each, of a tight run."""
    model = read_model(deck, {name: str(value) for name, value in sets.items()})
    results = simulate(model, end_time=end, print_interval=step, tol=1e-8)
    return results["time"], results[X]


def write_record(file: Path, t: np.ndarray, x: np.ndarray) -> None:
    """Write a measured curve as a CSV."""
    np.savetxt(file, np.c_[t, x], delimiter=",", header="time,x", comments="", fmt="%.17g")


def noisy(x: np.ndarray, seed: int, part: float = 0.01) -> tuple[np.ndarray, float]:
    """Return a curve with noise of a part of its range, and its standard deviation."""
    sd = part * float(np.ptp(x))
    return x + sd * np.random.default_rng(seed).standard_normal(len(x)), sd


def text_of(deck: Path, parameters: dict[str, str], sets: dict[str, object], record: str) -> str:
    """Return a study file of a contact's parameters, by attribute."""
    lines = ["[study]", f'model = "{deck}"', "[parameters]"]
    for name, said in parameters.items():
        lines.append(f'{name} = {{ path = "{CONTACT}.{name}", {said} }}')
    lines.append("[set]")
    for path, value in sets.items():
        lines.append(f'"{path}" = {value!r}'.replace("'", '"'))
    lines += ["[records.x]", 'file = "x.csv"', 'column = "x"', f'signal = "{X}"', record]
    return "\n".join(lines) + "\n"

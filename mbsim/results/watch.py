"""`Watch`: what a run's log says of all output rows, kept while they pass."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mbsim.arrays.codes import OF_MOTIONS
from mbsim.model.elements import Array

if TYPE_CHECKING:
    from mbsim.compile_model.build import System

#: Names in the group `energy`, by the column of `Rows.energy`.
ENERGIES = ("kinetic", "potential", "dissipated", "work_of_motions")


def energies(system: System) -> tuple[str, ...]:
    """Return which energies a system has: the work of motions only where something drives it."""
    driven = system.model.motions or system.scene.world.accumulators[OF_MOTIONS] >= 0
    return ENERGIES if driven else ENERGIES[:3]


@dataclass
class Watch:
    """First and last energies, and the largest force and torque of every element between markers.

    Parameters
    ----------
    elements : sequence of (str, int)
        Statement and id, as `results.elements.acting` has them.
    """

    elements: Sequence[tuple[str, int]]
    first: Array | None = None  # (4,) as `Rows.energy`
    last: Array | None = None

    def __post_init__(self) -> None:
        #: Force and torque, and when: (elements, 4); NaN before there is a row.
        self.peaks = np.full((len(self.elements), 4), np.nan)

    def add(self, time: Array, energy: Array, wrenches: Array) -> None:
        """Look at rows.

        Parameters
        ----------
        time : ndarray, shape (n,)
        energy : ndarray, shape (n, 4)
        wrenches : ndarray, shape (n, 6 elements)
            Force and torque of every element.
        """
        if not len(time):
            return
        if self.first is None:
            self.first = energy[0].copy()
        self.last = energy[-1].copy()
        each = wrenches.reshape(len(time), len(self.elements), 2, 3)
        # of a not finite force the rest is still worth telling
        with np.errstate(all="ignore"):
            sizes = np.sqrt(each[..., 0] ** 2 + each[..., 1] ** 2 + each[..., 2] ** 2)
        np.nan_to_num(sizes, copy=False, nan=-1.0)
        rows = sizes.argmax(axis=0)
        for kind in range(2):
            size = sizes[rows[:, kind], np.arange(len(self.elements)), kind]
            above = (size >= 0.0) & ~(size <= self.peaks[:, 2 * kind])
            self.peaks[above, 2 * kind] = size[above]
            self.peaks[above, 2 * kind + 1] = time[rows[above, kind]]

    def saved(self) -> dict[str, Array]:
        """Return tables for a checkpoint."""
        none = np.zeros(0)
        first, last = (none if value is None else value for value in (self.first, self.last))
        return {"watch/first": first, "watch/last": last, "watch/peaks": self.peaks.copy()}

    def restore(self, tables: dict[str, Array]) -> None:
        """Go on from those tables, which are taken out."""
        first, last = tables.pop("watch/first"), tables.pop("watch/last")
        self.first, self.last = (value if value.size else None for value in (first, last))
        self.peaks[:] = tables.pop("watch/peaks")

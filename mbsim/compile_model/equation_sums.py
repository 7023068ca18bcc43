"""Equations of joints as sums of terms, see `constraints.equations`, while they are gathered."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from mbsim.arrays.model import Equations
from mbsim.core.prototypes import copies


@dataclass
class Sums:
    """Equations and their terms as they are found."""

    first: list[int] = field(default_factory=lambda: [0])
    program: list[int] = field(default_factory=list)
    level: list[int] = field(default_factory=list)
    general: list[int] = field(default_factory=list)
    user: list[int] = field(default_factory=list)
    constant: list[float] = field(default_factory=list)
    start: list[tuple[float, float]] = field(default_factory=list)
    unit: list[float] = field(default_factory=list)
    connection: list[int] = field(default_factory=list)
    dry: list[int] = field(default_factory=list)
    slot: list[int] = field(default_factory=list)
    terms: list[tuple[int, int, int, int, int, float, int]] = field(default_factory=list)
    names: list[str] = field(default_factory=list)

    def close(
        self,
        connection: int,
        name: str,
        constant: float,
        unit: float,
        program: int = -1,
        level: int = 2,
        general: int = 0,
        start: tuple[float | None, float | None] = (None, None),
    ) -> None:
        """End an equation whose terms have been added."""
        self.first.append(len(self.terms))
        self.program.append(program)
        self.level.append(level)
        self.general.append(general)
        self.user.append(0)
        self.constant.append(constant)
        position, rate = (np.nan if value is None else value for value in start)
        self.start.append((position, rate))
        self.unit.append(unit)
        self.connection.append(connection)
        self.dry.append(-1)
        self.slot.append(-1)
        self.names.append(name)

    def arrays(self) -> Equations:
        """Return the equations as arrays, all in use."""
        return self._arrays() if self.program else _no_equations()

    def _arrays(self) -> Equations:
        n = len(self.program)

        def ints(values: Iterable[int]) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
            return np.array(list(values), dtype=np.int64)

        return Equations(
            first=ints(self.first),
            program=ints(self.program),
            level=ints(self.level),
            general=ints(self.general),
            user=ints(self.user),
            constant=np.array(self.constant, dtype=np.float64),
            start=np.array(self.start, dtype=np.float64).reshape(-1, 2),
            unit=np.array(self.unit, dtype=np.float64),
            connection=ints(self.connection),
            dry=ints(self.dry),
            off=np.zeros(n, dtype=np.int64),
            slot=ints(self.slot),
            kind=ints(t[0] for t in self.terms),
            i=ints(t[1] for t in self.terms),
            j=ints(t[2] for t in self.terms),
            axis=np.array([t[3:5] for t in self.terms], dtype=np.int64).reshape(-1, 2),
            factor=np.array([t[5] for t in self.terms], dtype=np.float64),
            angle=ints(t[6] for t in self.terms),
            active=np.append(np.arange(n), n),
        )


@copies
def _no_equations() -> Equations:
    return Sums()._arrays()

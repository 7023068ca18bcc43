"""Differences of runs: steps that neither noise of the runs nor curvature spoils, and the check.

Runs carry an error that jumps as step sizes and events do, about the runs' tol: a difference over
h has an error of noise/h + curvature*h^2. Two steps are compared, and where they differ by more
than `GOOD` a whole ladder of them, of which the pair that agrees best is taken.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from mbsim.studies.distributions import Numbers
from mbsim.studies.rounds import Ask

#: Steps as parts of the range between the bounds, each a quarter of the one before.
LADDER = tuple(1.6e-2 / 4.0**k for k in range(6))
#: The pair that is tried first: its place on the ladder.
_FIRST = 2
#: Two steps that differ by less, as a part of the column, need no better ones.
GOOD = 1e-3
#: Two differences of less than so many standard deviations of the noise over a whole range are
#: alike: nothing that is reported would change.
_NOTHING = 0.3
#: How often a step is shortened where a run of it fails.
_SHORTENED = 3


class NoDifference(Exception):
    """Runs on all sides of a point fail."""


@dataclass(frozen=True)
class Checked:
    """A Jacobian and its check.

    Attributes
    ----------
    columns : array, (rows, unknowns)
        Slopes of the curves over the unit cube, in the curves' units.
    steps : array, (unknowns,)
        As parts of the range.
    discrepancy : array, (unknowns,)
        By how much two steps differ, as a part of the column; 0 of a column that is 0.
    sources : tuple of str
        What each column is from, and why; see `mbsim.studies.columns`.
    """

    columns: Numbers
    steps: Numbers
    discrepancy: Numbers
    sources: tuple[str, ...] = ()


class _Stencil(NamedTuple):
    """A difference over h: points beside z along an axis as multiples of h, and their weights."""

    places: tuple[float, ...]
    weights: tuple[float, ...]
    centre: float  # weight of the point itself

    def fits(self, z: float, h: float) -> bool:
        """Return whether all its points are between the bounds."""
        return all(0.0 <= z + place * h <= 1.0 for place in self.places)


_CENTRAL = _Stencil((-1.0, 1.0), (-0.5, 0.5), 0.0)
_FORWARD = _Stencil((1.0, 2.0), (2.0, -0.5), -1.5)
_BACKWARD = _Stencil((-1.0, -2.0), (-2.0, 0.5), 1.5)
_STENCILS = (_CENTRAL, _FORWARD, _BACKWARD)


def slopes(
    ask: Ask, z: Numbers, curves: Numbers, wanted: Sequence[tuple[int, float]]
) -> list[Numbers]:
    """Return differences along axes, each (rows,).

    Parameters
    ----------
    ask : callable
    z : array, (unknowns,)
    curves : array, (rows,)
        Those at z.
    wanted : sequence of (int, float)
        Axis and step of each; where a run fails another side is tried, then a shorter step.

    Raises
    ------
    NoDifference
        If there is none along an axis.
    Stopped
    """
    ways = [
        [
            (stencil, step / 4.0**turn)
            for turn in range(_SHORTENED + 1)
            for stencil in _STENCILS
            if stencil.fits(float(z[axis]), step / 4.0**turn)
        ]
        for axis, step in wanted
    ]
    found: list[Numbers | None] = [None] * len(wanted)
    while left := [k for k, each in enumerate(found) if each is None]:
        tried = []
        for k in left:
            if not ways[k]:
                raise NoDifference(f"runs beside the point fail along axis {wanted[k][0]}")
            tried.append((k, *ways[k].pop(0)))
        points = []
        for k, stencil, h in tried:
            for place in stencil.places:
                point = z.copy()
                point[wanted[k][0]] += place * h
                points.append(point)
        answers = iter(ask(points))
        for k, stencil, h in tried:
            beside = [next(answers) for _ in stencil.places]
            there = [each for each in beside if each is not None]
            if len(there) == len(beside):
                total = stencil.centre * curves
                for weight, each in zip(stencil.weights, there, strict=True):
                    total = total + weight * each
                found[k] = total / h
    return [each for each in found if each is not None]


def jacobian(ask: Ask, z: Numbers, curves: Numbers, steps: Numbers) -> Numbers:
    """Return the slopes of the curves over the unit cube, (rows, unknowns), without a check."""
    return np.stack(slopes(ask, z, curves, list(enumerate(steps.tolist()))), axis=1)


def checked_jacobian(ask: Ask, z: Numbers, curves: Numbers, sd: Numbers | None) -> Checked:
    """Return the slopes of the curves at z, by the steps that agree best.

    Parameters
    ----------
    ask : callable
    z : array, (unknowns,)
    curves : array, (rows,)
        Those at z.
    sd : array, (rows,), optional
        The noise of the records where it is known: what is far below it needs no better steps.

    Raises
    ------
    NoDifference, Stopped
    """
    count = len(z)
    made: list[dict[int, Numbers]] = [{} for _ in range(count)]
    missing = [(k, rung) for k in range(count) for rung in (_FIRST, _FIRST + 1)]
    while missing:
        columns = slopes(ask, z, curves, [(k, LADDER[rung]) for k, rung in missing])
        for (k, rung), column in zip(missing, columns, strict=True):
            made[k][rung] = column
        missing = []
        for k in range(count):
            if not _good(made[k], sd):
                low, high = min(made[k]), max(made[k])
                missing += [(k, r) for r in (low - 1, high + 1) if 0 <= r < len(LADDER)]
    best = [min(_pairs(each).items(), key=lambda item: item[1]) for each in made]
    return Checked(
        columns=np.stack([made[k][rung + 1] for k, (rung, _) in enumerate(best)], axis=1),
        steps=np.array([LADDER[rung + 1] for rung, _ in best]),
        discrepancy=np.array([part for _, part in best]),
    )


def _pairs(made: dict[int, Numbers]) -> dict[int, float]:
    """Return by how much each step and the next differ, as a part of the column."""
    found = {}
    for rung in sorted(made):
        if rung + 1 in made:
            size = float(np.linalg.norm(made[rung + 1]))
            off = float(np.linalg.norm(made[rung + 1] - made[rung]))
            found[rung] = off / size if size > 0.0 else float(off > 0.0)
    return found


def _good(made: dict[int, Numbers], sd: Numbers | None) -> bool:
    """Return whether two steps agree well enough."""
    if min(_pairs(made).values()) <= GOOD:
        return True
    if sd is None:
        return False
    return any(
        float(np.linalg.norm((made[rung + 1] - made[rung]) / sd)) <= _NOTHING
        for rung in _pairs(made)
    )

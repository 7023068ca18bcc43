"""One deck under stress, and what its motion must not do."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

#: By name what was measured and what is allowed.
Measures = dict[str, tuple[float, float]]
#: Returns measures from a run's rows and its tolerance.
Check = Callable[["Motion", float], Measures]

TOLS = (1e-3, 1e-5, 1e-7)
EXPLICIT = ("DOPRI5", "DOP853")
IMPLICIT = ("AUTO", "RADAU5", "GALPHA")
COMPLIANT = ("AUTO", "DOPRI5", "DOP853", "RADAU5", "GALPHA")
ALL = (*COMPLIANT, "MOREAU")


class Motion(NamedTuple):
    """Rows of a run, SI, global axes; bodies in the order of their ids.

    Attributes
    ----------
    time
        (n,) s.
    x, v, w
        (n, bodies, 3): places of mass centres, their velocities, angular velocities.
    R
        (n, bodies, 3, 3): body to global axes.
    kinetic, weight
        (n,) J: 1/2 m v^2 + 1/2 w.I w, and -m g.x, from these rows and the deck alone.
    load
        Weight of all bodies, N.
    steps
        How many it took.
    """

    time: np.ndarray
    x: np.ndarray
    v: np.ndarray
    w: np.ndarray
    R: np.ndarray
    kinetic: np.ndarray
    weight: np.ndarray
    load: float
    steps: int

    def errors(self, tol: float) -> float:
        """Return what steps leave that are each right to tol, over what moves."""
        return (10.0 + self.steps) * tol

    @property
    def energy(self) -> np.ndarray:
        """(n,) kinetic energy and that of weight, J."""
        energy: np.ndarray = self.kinetic + self.weight
        return energy

    @property
    def size(self) -> float:
        """The largest energy that moved, J."""
        return float(max(self.kinetic.max(), np.ptp(self.weight)))


class Deck(NamedTuple):
    """A deck, whom it is given to, and how its motion is judged.

    Attributes
    ----------
    stored
        Energy that springs and overlaps hold at the start, J.
    """

    family: str
    name: str
    text: str
    methods: Sequence[str]
    check: Check | None = None
    stored: float = 0.0
    tols: Sequence[float] = TOLS


class Case(NamedTuple):
    """A deck with one method and one tolerance."""

    deck: Deck
    integrator: str
    tol: float

    @property
    def name(self) -> str:
        """As in the table."""
        return f"{self.deck.family} {self.deck.name} {self.integrator} {self.tol:g}"


def cases_of(decks: Sequence[Deck]) -> Iterator[Case]:
    """Yield every method and tolerance of every deck."""
    for deck in decks:
        for integrator in deck.methods:
            for tol in deck.tols:
                yield Case(deck, integrator, tol)

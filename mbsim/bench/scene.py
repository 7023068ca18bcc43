"""`Scene`: what a benchmark scene is made of."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from mbsim.bench.outcome import Outcome
from mbsim.bench.parameters import SAMPLE

#: Tolerances of our runs where a scene does not say otherwise.
TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12)

#: Errors of the peers' front at which we are compared where a scene does not say otherwise.
COMPARED = (1e-7, 1e-2)

Variation = Mapping[str, float]
Deck = Callable[[Variation], str]
Errors = Callable[[Outcome, str], dict[str, float]]


@dataclass(frozen=True)
class Target:
    """Our time shall be at most `ratio` times the best peer's at errors up to `up_to`."""

    ratio: float
    up_to: float = float("inf")


@dataclass(frozen=True)
class Scene:
    """A scene as data, with the function that writes its deck and the one that judges a run.

    Attributes
    ----------
    name, title
        As in tables and file names; one line for the plot.
    end_time
        Simulated seconds.
    measure, unit
        The error that is plotted and compared, one of those that `errors` returns.
    deck
        From a variation, e.g. ``{"vs": 1e-3}``, to the deck as XML text; SI.
    errors
        From an outcome and the variant of the law that it solves to named error measures.
    own_measure
        What ours is held to in place of `measure`, if there is such; the peers never are.
    targets
        By rising `up_to`; empty where there is none.
    compared
        Smallest and largest error of the peers' front at which ours is compared with it.
    variations
        What is varied besides integrator and tolerance.
    variants
        Laws that engines may solve here, ours first; a peer names its own in its note.
    second
        A further measure of our runs that belongs into the plot, dashed, and its label.
    pass_below
        Where set, runs are compared by the time of the fastest one with a smaller error.
    integrators, tolerances
        Of our runs, tolerances from loose to tight; no `integrators` means all that can run it.
    sample
        Time between the rows that every engine stores [s]; who stores fewer is not compared.
    repeats
        Largest number of repeats of any run, where runs are long.
    limit
        Seconds after which a run of ours is given up.
    patience
        A method whose run took longer [s] has no tighter runs, unless tolerances are asked for.
    """

    name: str
    title: str
    end_time: float
    measure: str
    unit: str
    deck: Deck
    errors: Errors
    own_measure: str | None = None
    targets: tuple[Target, ...] = ()
    compared: tuple[float, float] = COMPARED
    variations: tuple[Variation, ...] = ({},)
    variants: tuple[str, ...] = ("",)
    second: tuple[str, str] | None = None
    pass_below: float | None = None
    integrators: tuple[str, ...] = ()
    tolerances: tuple[float, ...] = TOLERANCES
    sample: float = SAMPLE
    repeats: int | None = None
    limit: float = 120.0
    patience: float = 5.0

    def held_to(self, ours: bool) -> str:
        """Return the measure that counts for our runs or for the peers'."""
        return self.own_measure if ours and self.own_measure is not None else self.measure

    def target(self, error: float) -> float | None:
        """Return the ratio that is asked for at this error; None where there is no target."""
        return next((t.ratio for t in self.targets if error <= t.up_to), None)

    def variant(self, note: str) -> str:
        """Return which law's reference a run with this note is held to."""
        words = note.replace(",", " ").replace(";", " ").replace(":", " ").split()
        return next((name for name in self.variants if name in words), self.variants[0])

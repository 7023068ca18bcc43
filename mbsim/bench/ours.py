"""Our side: decks through `read_model` and `simulate`, as a user runs them."""

from __future__ import annotations

import functools
import math
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mbsim import __version__
from mbsim.bench.measurement import OURS, Measurement, failed, measured
from mbsim.bench.outcome import Outcome
from mbsim.bench.scene import Scene, Variation
from mbsim.errors import Interrupted, MbsimError, ModelError
from mbsim.run.settings import INTEGRATORS, settle

if TYPE_CHECKING:
    from mbsim.model.elements import Model
    from mbsim.results.reading import Results

_COUNTS = (
    "steps",
    "rejected",
    "rhs_evaluations",
    "output_evaluations",
    "normal_calls",
    "friction_calls",
    "jacobians",
    "factorizations",
)


class TookTooLong(MbsimError):
    """A run was given up after the limit of its scene."""


class Setting(NamedTuple):
    """Integrator, tolerance and what the scene varies."""

    integrator: str
    tol: float
    variation: Variation

    @property
    def text(self) -> str:
        """As in the tables."""
        varied = "".join(f" {name}={value:g}" for name, value in self.variation.items())
        return f"{self.integrator} tol={self.tol:g}{varied}"


def settings(
    scene: Scene, integrators: Sequence[str], tolerances: Sequence[float]
) -> list[Setting]:
    """Return all settings of a scene; no `integrators` or `tolerances` means the scene's own.

    A variation with a step `h` is MOREAU's alone, which takes fixed steps. Of those that differ in
    the stiffness `k` alone it runs the first: contacts are rigid to it.
    """
    found, rigid = list[Setting](), set[frozenset[tuple[str, float]]]()
    for variation in scene.variations:
        those = frozenset((name, value) for name, value in variation.items() if name != "k")
        for integrator in integrators or scene.integrators or able(scene.deck(variation)):
            nonsmooth = integrator == "MOREAU"
            if those in rigid if nonsmooth else "h" in variation:
                continue
            if nonsmooth:
                rigid.add(those)
            found += [Setting(integrator, tol, variation) for tol in tolerances or scene.tolerances]
    return found


@functools.lru_cache(maxsize=64)
def able(text: str) -> tuple[str, ...]:
    """Return the methods that can run a deck, e.g. not VERLET where it has joints."""
    from mbsim.reader.xml import read_model

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "deck.xml"
        path.write_text(text, encoding="utf-8")
        try:
            deck = read_model(path)
        except MbsimError:
            return INTEGRATORS  # what is wrong is said where it is run
    return tuple(name for name in INTEGRATORS if _can_run(deck, name))


def _can_run(deck: Model, integrator: str) -> bool:
    """Return whether a method takes a model."""
    try:
        settle(deck, integrator=integrator)
    except ModelError:
        return False
    return True


def deck_file(scene: Scene, variation: Variation, folder: Path) -> Path:
    """Write the deck of a scene, so that `mbsim run` runs it too, and return its path."""
    folder.mkdir(parents=True, exist_ok=True)
    varied = "".join(f"_{name}_{value:g}" for name, value in variation.items())
    path = folder / f"{scene.name}{varied}.xml"
    path.write_text(scene.deck(variation), encoding="utf-8")
    return path


def run(deck: Model, setting: Setting, repeats: int, limit: float) -> Outcome:
    """Run a deck and return its outcome with the median time of `repeats`.

    The time is `loop_s`: all calls of the compiled stepping loop, which also writes the rows.
    A run is given up after `limit` seconds.
    """
    from mbsim.run.simulation import simulate

    walls = []
    for _ in range(repeats):
        results = simulate(
            deck, integrator=setting.integrator, tol=setting.tol, progress=_stop_after(limit)
        )
        walls.append(float(results.stats["loop_s"]))
    note = "rigid contacts" if setting.integrator == "MOREAU" else ""
    return outcome(results, statistics.median(walls), note)


def _stop_after(limit: float) -> Callable[[float, float, float], None]:
    """Return a progress function that ends a run after `limit` seconds."""
    began = time.perf_counter()

    def progress(t: float, step: float, end_time: float) -> None:
        if time.perf_counter() - began > limit:
            raise TookTooLong(f"given up after {limit:g} s at time {t:.4g} of {end_time:g}")

    return progress


def outcome(results: Results, wall_s: float, note: str = "") -> Outcome:
    """Return results as an outcome, bodies by id; the note says what law a method solves."""
    bodies = sorted(results.ids("bodies"))

    def rows(name: str) -> np.ndarray:
        return np.stack([results[f"bodies/{body}/{name}"] for body in bodies], axis=1)

    extra = {name: float(results.stats[name]) for name in _COUNTS if name in results.stats}
    contacts = results.ids("contacts")
    if contacts:
        depths = [float(results[f"contacts/{contact}/peak_penetration"]) for contact in contacts]
        extra["peak_penetration"] = max(depths)
        last = [float(results[f"contacts/{contact}/incidents"][-1]) for contact in contacts]
        extra["incidents_end"] = sum(last)
    return Outcome(
        wall_s,
        results["time"],
        rows("position"),
        rows("quaternion"),
        rows("velocity"),
        rows("angular_velocity"),
        extra,
        note=note,
    )


def _repeat(deck: Model, setting: Setting, limit: float, count: int) -> Outcome:
    """`run` with the number of repeats last, as `measured` calls it."""
    return run(deck, setting, count, limit)


class Ladders:
    """How far down the tolerances each method is worth trying on a scene.

    A run that takes longer than `patience` seconds is the last of its method, for tighter ones
    take longer yet; one that was given up is not tried again with another variation either.
    """

    def __init__(self, patience: float):
        self.patience = patience
        self.last: dict[str, tuple[float, float]] = {}  # tolerance and seconds of such a run

    def note(self, setting: Setting, seconds: float) -> None:
        """Remember a run that took long; inf is one that was given up."""
        if seconds > self.patience or seconds == math.inf:
            known = self.last.get(setting.integrator, (0.0, 0.0))
            self.last[setting.integrator] = max(known, (setting.tol, seconds))

    def too_long(self, setting: Setting) -> str:
        """Return why a setting is left out; empty where it is not."""
        if setting.integrator not in self.last:
            return ""
        tol, seconds = self.last[setting.integrator]
        if setting.tol < tol:
            took = "was given up" if seconds == math.inf else f"took {seconds:.0f} s"
            return f"left out: {setting.integrator} {took} at a looser tolerance"
        if setting.tol == tol and seconds == math.inf:
            return f"left out: {setting.integrator} was given up at this tolerance"
        return ""


def measure(
    scene: Scene,
    integrators: Sequence[str],
    tolerances: Sequence[float],
    repeats: int,
    folder: Path,
) -> Iterator[Measurement]:
    """Yield a measurement for every setting; a run that fails says why in its note."""
    from mbsim.reader.xml import read_model

    warm: set[tuple[Path, str]] = set()
    ladders = Ladders(math.inf if tolerances else scene.patience)
    for setting in settings(scene, integrators, tolerances):
        if why_not := ladders.too_long(setting):
            row = failed(scene, OURS, __version__, setting.text, why_not)
            yield row._replace(note=why_not)
            continue
        path = deck_file(scene, setting.variation, folder)
        try:
            deck = read_model(path)
        except MbsimError as error:
            yield failed(scene, OURS, __version__, setting.text, _first_line(error))
            continue
        settle(deck, integrator=setting.integrator, tol=setting.tol)  # a wrong tol ends it all
        try:
            if (path, setting.integrator) not in warm:
                # what this deck needs is compiled or loaded; its first millisecond is enough
                simulate_once(deck, setting)
                warm.add((path, setting.integrator))
            row = measured(
                scene,
                OURS,
                __version__,
                setting.text,
                functools.partial(_repeat, deck, setting, scene.limit),
                repeats,
            )
            ladders.note(setting, row.wall_s)
            yield row
        except Interrupted:
            raise
        except TookTooLong as error:
            ladders.note(setting, math.inf)
            yield failed(scene, OURS, __version__, setting.text, _first_line(error))
        except MbsimError as error:
            yield failed(scene, OURS, __version__, setting.text, _first_line(error))


def _first_line(error: MbsimError) -> str:
    """Return what a table says of an error."""
    return str(error).splitlines()[0]


def simulate_once(deck: Model, setting: Setting) -> None:
    """Run the first millisecond of a deck."""
    from mbsim.run.simulation import simulate

    simulate(deck, integrator=setting.integrator, tol=setting.tol, end_time=1e-3)

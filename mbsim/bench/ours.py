"""Our side: decks through `read_model` and `simulate`, as a user runs them."""

from __future__ import annotations

import functools
import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mbsim import __version__
from mbsim.bench.measurement import OURS, Measurement, failed, measured
from mbsim.bench.outcome import Outcome
from mbsim.bench.scene import Scene, Variation
from mbsim.errors import Interrupted, MbsimError
from mbsim.settings import settle

if TYPE_CHECKING:
    from mbsim.model.elements import Model
    from mbsim.results.reading import Results

_COUNTS = ("steps", "rejected", "rhs_evaluations", "output_evaluations", "normal_calls")


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
    """Return all settings of a scene; no `integrators` or `tolerances` means the scene's own."""
    return [
        Setting(integrator, tol, variation)
        for variation in scene.variations
        for integrator in (integrators or scene.integrators)
        for tol in (tolerances or scene.tolerances)
    ]


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
    from mbsim.simulation import simulate

    walls = []
    for _ in range(repeats):
        results = simulate(
            deck, integrator=setting.integrator, tol=setting.tol, progress=_stop_after(limit)
        )
        walls.append(float(results.stats["loop_s"]))
    return outcome(results, statistics.median(walls))


def _stop_after(limit: float) -> Callable[[float, float, float], None]:
    """Return a progress function that ends a run after `limit` seconds."""
    began = time.perf_counter()

    def progress(t: float, step: float, end_time: float) -> None:
        if time.perf_counter() - began > limit:
            raise TookTooLong(f"given up after {limit:g} s at time {t:.4g} of {end_time:g}")

    return progress


def outcome(results: Results, wall_s: float) -> Outcome:
    """Return results as an outcome, bodies by id."""
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
        note="",
    )


def _repeat(deck: Model, setting: Setting, limit: float, count: int) -> Outcome:
    """`run` with the number of repeats last, as `measured` calls it."""
    return run(deck, setting, count, limit)


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
    for setting in settings(scene, integrators, tolerances):
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
            yield measured(
                scene,
                OURS,
                __version__,
                setting.text,
                functools.partial(_repeat, deck, setting, scene.limit),
                repeats,
            )
        except Interrupted:
            raise
        except MbsimError as error:
            yield failed(scene, OURS, __version__, setting.text, _first_line(error))


def _first_line(error: MbsimError) -> str:
    """Return what a table says of an error."""
    return str(error).splitlines()[0]


def simulate_once(deck: Model, setting: Setting) -> None:
    """Run the first millisecond of a deck."""
    from mbsim.simulation import simulate

    simulate(deck, integrator=setting.integrator, tol=setting.tol, end_time=1e-3)

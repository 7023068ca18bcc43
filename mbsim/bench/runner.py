"""Runs scenes on our side and on every peer there is; what was measured is kept as it comes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

from mbsim.bench import ours, peers, report
from mbsim.bench.front import Cell, compare
from mbsim.bench.machine import describe
from mbsim.bench.measurement import Measurement, failed, measured
from mbsim.bench.scene import Scene
from mbsim.bench.scenes import all_scenes
from mbsim.errors import ModelError
from mbsim.run.settings import INTEGRATORS

Tell = Callable[[str], None]


class Options(NamedTuple):
    """What to run: our integrators and tolerances are the scene's own where there are none."""

    scenes: Sequence[Scene]
    integrators: Sequence[str]
    tolerances: Sequence[float]
    repeats: int
    peers: Sequence[str]


class Report(NamedTuple):
    """All measurements, the comparisons with the peers, and where and when."""

    machine: dict[str, str]
    rows: list[Measurement]
    cells: list[Cell]


def choose_scenes(names: Sequence[str]) -> list[Scene]:
    """Return scenes by name, whatever the case; all of them if there is no name.

    Raises
    ------
    ModelError
        If there is no such scene.
    """
    known = all_scenes()
    by_lower = {name.lower(): scene for name, scene in known.items()}
    for name in names:
        if name.lower() not in by_lower:
            raise ModelError(f"scene {name}: not known; there are {', '.join(known)}")
    return [by_lower[name.lower()] for name in names] or list(known.values())


def choose_integrators(names: Sequence[str]) -> list[str]:
    """Return integrators by name, whatever the case; none means those of each scene.

    Raises
    ------
    ModelError
        If there is no such integrator; other names that a deck may use are run by one of these.
    """
    for name in names:
        if name.upper() not in INTEGRATORS:
            raise ModelError(f"integrator={name} is not known; there are {', '.join(INTEGRATORS)}")
    return [name.upper() for name in names]


def run(options: Options, folder: Path, tell: Tell) -> Report:
    """Run all scenes; `bench.csv` in `folder` grows with every scene."""
    machine = describe()
    engines = {name: peers.load(name) for name in options.peers}
    rows: list[Measurement] = []
    cells: list[Cell] = []
    total = sum(_count(scene, options, engines) for scene in options.scenes)
    for scene in options.scenes:
        for row in _scene_rows(scene, options, engines, folder):
            rows.append(row)
            tell(f"[{len(rows)}/{total}] {report.line(scene, row)}")
        cells += compare(scene, rows)
        report.write_csv(folder / "bench.csv", machine, options.scenes, rows)
    return Report(machine, rows, cells)


def _count(scene: Scene, options: Options, engines: dict[str, ModuleType]) -> int:
    """Return how many measurements a scene gives."""
    mine = ours.settings(scene, options.integrators, options.tolerances)
    return len(mine) + sum(len(engine.settings(scene.name)) for engine in engines.values())


def _scene_rows(
    scene: Scene, options: Options, engines: dict[str, ModuleType], folder: Path
) -> Iterator[Measurement]:
    """Yield all measurements of one scene, ours first."""
    yield from ours.measure(
        scene, options.integrators, options.tolerances, options.repeats, folder / "decks"
    )
    for name, engine in engines.items():
        for setting in engine.settings(scene.name):
            yield _peer_row(scene, name, engine, setting, options.repeats)


def _peer_row(
    scene: Scene, name: str, engine: ModuleType, setting: str, repeats: int
) -> Measurement:
    """Return the measurement of one setting of a peer."""
    version = ""
    try:
        version = engine.version()
        return measured(
            scene,
            name,
            version,
            setting,
            lambda count: engine.run(scene.name, setting, count),
            repeats,
        )
    except Exception as error:
        # another project's engine may raise anything: its line says so, the others go on
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        return failed(scene, name, version, setting, reason)

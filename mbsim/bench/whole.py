"""What a whole run takes, start and end of its process included: time, and the most memory."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from mbsim.bench.front import Cell, candidates, fronts
from mbsim.bench.measurement import OURS, Measurement
from mbsim.bench.scene import Scene
from mbsim.bench.scenes import all_scenes


class Whole(NamedTuple):
    """A run in a process of its own."""

    scene: str
    engine: str
    setting: str
    error: float  # of the run in the table of all measurements
    loop_s: float  # s, of the loop there
    whole_s: float  # s, from the start of the process to its end
    memory_mb: float | None  # MB, the most at one time; None where the system does not say
    note: str = ""  # why there is none


def chosen(
    scenes: Sequence[Scene], rows: Sequence[Measurement], cells: Sequence[Cell]
) -> list[Measurement]:
    """Return whose whole runs are measured: of each scene ours and the best peer's at one error.

    That is the smallest error of the peers' front that ours reaches too; without peers it is our
    fastest run.
    """
    found = []
    for scene in scenes:
        mine = candidates(scene, rows, ours=True)
        reached = [c for c in cells if c.scene == scene.name and c.ours_s is not None]
        reached = [c for c in reached if c.held_to == scene.held_to(ours=True)]
        cell = min(reached, key=lambda c: c.error, default=None)
        own, _ = fronts(scene, rows)
        limit = own[0].error if cell is None and own else 0.0 if cell is None else cell.error
        if scene.pass_below is not None and cell is not None:
            limit = scene.pass_below
        measure = scene.held_to(ours=True)
        good = [row for row in mine if row.errors.get(measure, limit + 1.0) <= limit]
        found += sorted(good, key=lambda row: row.wall_s)[:1]
        if cell is not None:
            peers = candidates(scene, rows, ours=False)
            found += [r for r in peers if (r.engine, r.setting) == (cell.peer, cell.setting)][:1]
    return found


def measure(scenes: Sequence[Scene], rows: Sequence[Measurement], folder: Path) -> list[Whole]:
    """Run each of these rows in a process of its own; ours as `mbsim run` from a warm cache."""
    known = {scene.name: scene for scene in scenes}
    return [_measured(known[row.scene], row, folder) for row in rows]


def _measured(scene: Scene, row: Measurement, folder: Path) -> Whole:
    error = row.errors[scene.held_to(row.engine == OURS)]
    facts = (row.scene, row.engine, row.setting, error, row.wall_s)
    with tempfile.TemporaryDirectory() as results:
        command = _command(scene, row, folder, results)
        if row.engine == OURS:
            _timed(command)  # what it needs is compiled then
        code, wall, memory = _timed(command)
    return Whole(*facts, wall, memory, "" if code == 0 else f"ended with {code}")


def _command(scene: Scene, row: Measurement, folder: Path, results: str) -> list[str]:
    """Return the command line of a run."""
    if row.engine != OURS:
        return [sys.executable, "-m", "mbsim.bench.whole", row.scene, row.engine, row.setting]
    from mbsim.bench import ours

    method, tol, *_ = row.setting.split()
    tol = tol.removeprefix("tol=")
    every = ours.settings(scene, (method,), (float(tol),))
    variation = next(s.variation for s in every if s.text == row.setting)
    deck = ours.deck_file(scene, variation, folder)
    run = [sys.executable, "-m", "mbsim", "run", str(deck), "--integrator", method]
    return [*run, "--tol", tol, "-o", results]


def _timed(command: Sequence[str]) -> tuple[int, float, float | None]:
    """Return exit code, wall time [s] and the most memory [MB] of a process."""
    script = Path(__file__).with_name("timed.py")
    done = subprocess.run(
        [sys.executable, "-I", "-S", str(script), *command],
        capture_output=True,
        text=True,
        check=True,
    )
    code, wall, most = done.stdout.split()
    # the kernel of macOS counts bytes, others kilobytes
    memory = float(most) / (1e6 if sys.platform == "darwin" else 1e3)
    return int(code), float(wall), memory if memory > 0.0 else None


def main(scene: str, engine: str, setting: str) -> None:
    """Run a peer's setting once."""
    from mbsim.bench import peers

    assert scene in all_scenes()
    peers.load(engine).run(scene, setting, 0)


if __name__ == "__main__":
    main(*sys.argv[1:])

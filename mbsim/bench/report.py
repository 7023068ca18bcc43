"""What a benchmark leaves: `bench.csv`, and tables that a reader and a terminal can show."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from mbsim.bench.front import (
    Cell,
    candidates,
    excluded,
    front,
    fronts,
    own_fronts,
    points,
    time_at,
    winner,
)
from mbsim.bench.measurement import OURS, Measurement
from mbsim.bench.scene import Scene
from mbsim.bench.whole import Whole
from mbsim.errors import ResultsError

#: Columns of `bench.csv` before those of the error measures and counts.
FIRST_COLUMNS = ("scene", "engine", "version", "setting", "repeats", "wall_s", "wall_per_sim_s")
#: Columns after them.
LAST_COLUMNS = ("note", "date", "cpu", "python")

#: Errors at which our own times are listed.
DECADES = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7)

#: Between these numbers of spheres the time for one body or contact shall grow so much at most.
SCALING_BETWEEN, LARGEST_GROWTH = (125, 8000), 1.5

#: Between these numbers of rods an evaluation shall grow so much at most.
CHAIN_BETWEEN, CHAIN_GROWTH = (10, 40), 5.0


def write_text(path: Path, text: str) -> None:
    """Write a file, or raise why not as `ResultsError`."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise ResultsError(f"{path}: cannot be written: {error.strerror}") from None


def write_csv(
    path: Path, machine: Mapping[str, str], scenes: Iterable[Scene], rows: Sequence[Measurement]
) -> None:
    """Write one line a measurement; measures that a scene does not have stay empty."""
    measures = _names(row.errors for row in rows)
    # an engine's own count of what is an error measure anyway is not listed twice
    counts = [name for name in _names(row.counts for row in rows) if name not in measures]
    header = [*FIRST_COLUMNS, "measure", *measures, *counts, *LAST_COLUMNS]
    known = {scene.name: scene for scene in scenes}
    lines = []
    for row in rows:
        scene = known[row.scene]
        values = {**row._asdict(), **machine, "measure": scene.held_to(row.engine == OURS)}
        why_not = excluded(scene, row) if row.errors else ""
        values["note"] = "; ".join(filter(None, (row.note, why_not and f"not compared: {why_not}")))
        values |= {name: _number(value) for name, value in (row.counts | row.errors).items()}
        values |= {name: _number(values[name]) for name in ("wall_s", "wall_per_sim_s")}
        lines.append([values.get(name, "") for name in header])
    try:
        with path.open("w", newline="", encoding="utf-8") as file:
            csv.writer(file).writerows([header, *lines])
    except OSError as error:
        raise ResultsError(f"{path}: cannot be written: {error.strerror}") from None


def _names(tables: Iterable[Mapping[str, float]]) -> list[str]:
    """Return all keys in the order of their first use."""
    return list(dict.fromkeys(name for table in tables for name in table))


def _number(value: float) -> str:
    """Return six digits; empty where there is no number."""
    return "" if math.isnan(value) else f"{value:.6g}"


def line(scene: Scene, row: Measurement) -> str:
    """Return a measurement as one line for people."""
    name = f"{row.scene} {row.engine} {row.setting}"
    if not row.errors:
        return f"{name}: {row.note}"
    measure = scene.held_to(row.engine == OURS)
    took = f"{row.wall_per_sim_s:.3g} s per simulated second"
    why_not = excluded(scene, row)
    end = f" (not compared: {why_not})" if why_not else ""
    return f"{name}: {took}, {measure} {row.errors[measure]:.2g}{end}"


def table(header: Sequence[str], lines: Iterable[Sequence[str]]) -> str:
    """Return a Markdown table whose columns also line up on a terminal."""
    cells = [list(header), *(list(entry) for entry in lines)]
    widths = [max(len(entry[k]) for entry in cells) for k in range(len(header))]
    first, *rest = (
        "| "
        + " | ".join(text.ljust(width) for text, width in zip(entry, widths, strict=True))
        + " |"
        for entry in cells
    )
    rule = "|" + "|".join("-" * (width + 2) for width in widths) + "|"
    return "\n".join([first, rule, *rest])


def markdown(
    machine: Mapping[str, str],
    scenes: Sequence[Scene],
    rows: Sequence[Measurement],
    cells: Sequence[Cell],
    absent: Sequence[str],
    wholes: Sequence[Whole] = (),
) -> str:
    """Return the whole report as text."""
    versions = dict.fromkeys(f"{row.engine} {row.version}" for row in rows)
    where = (
        f"{', '.join(versions)}; Python {machine['python']}; {machine['cpu']}; {machine['date']}"
    )
    parts = ["# Run time against error", where]
    if absent:
        parts.append(f"Not compared: {', '.join(absent)}.")
    parts += ["Times are wall seconds of the stepping loop per simulated second."]
    if cells:
        parts += ["## Time to reach the error of the best peer", comparison(cells)]
        parts.append(_summary(cells))
    parts += ["## Our time to reach an error", own_times(scenes, rows)]
    parts += ["## Which of our methods is first, by how many times", winners(scenes, rows)]
    many = scaling(rows)
    parts += ["## Our time with the number of spheres", many] if many else []
    long = chain_growth(rows)
    parts += ["## Our time with the number of rods", long] if long else []
    if wholes:
        parts += ["## Whole runs: from the start of a process to its end", whole_table(wholes)]
    for scene in scenes:
        parts += [f"## {scene.name}: {scene.title}", front_table(scene, rows)]
    failures = _failures(scenes, rows)
    parts += ["## Runs that are not compared", failures] if failures else []
    return "\n\n".join(parts) + "\n"


def comparison(cells: Sequence[Cell]) -> str:
    """Return the table of comparisons: our time to each error on the peers' front."""
    header = (
        *("scene", "error", "best peer", "peer [s]", "ours, error by", "ours [s]"),
        *("ours / peer", "target", ""),
    )
    return table(header, [_cell_line(cell) for cell in cells])


def _cell_line(cell: Cell) -> list[str]:
    """Return one comparison as text."""
    verdict = {True: "met", False: "lost", None: ""}[cell.met]
    return [
        cell.scene,
        f"{cell.error:.1e}",
        f"{cell.peer} {cell.setting}",
        f"{cell.peer_s:.3g}",
        cell.held_to,
        "not reached" if cell.ours_s is None else f"{cell.ours_s:.3g}",
        "" if cell.ratio is None else _ratio(cell.ratio),
        "" if cell.target is None else _ratio(cell.target),
        verdict,
    ]


def _ratio(value: float) -> str:
    """Return a ratio below one as 1/n."""
    return f"1/{1.0 / value:.3g}" if 0.0 < value < 1.0 else f"{value:.3g}"


def _summary(cells: Sequence[Cell]) -> str:
    """Return how many targets are met."""
    judged = [cell for cell in cells if cell.met is not None]
    met = sum(cell.met is True for cell in judged)
    return f"{met} of {len(judged)} targets met."


def own_times(scenes: Sequence[Scene], rows: Sequence[Measurement]) -> str:
    """Return our time for every decade of error, between measured points."""
    lines = []
    for scene in scenes:
        for measure in dict.fromkeys((scene.held_to(ours=True), scene.measure)):
            ours = front(points(candidates(scene, rows, ours=True), measure))
            times = [time_at(ours, error) for error in DECADES]
            shown = ["" if time is None else f"{time:.3g}" for time in times]
            lines.append([scene.name, measure, *shown])
    return table(("scene", "measure", *(f"{error:.0e}" for error in DECADES)), lines)


def winners(scenes: Sequence[Scene], rows: Sequence[Measurement]) -> str:
    """Return for every decade of error our fastest method, and the second's time over its time."""
    lines = []
    for scene in scenes:
        each = own_fronts(scene, rows)
        found = [winner(each, error) for error in DECADES]
        shown = ["" if first is None else _first(*first, len(each)) for first in found]
        lines.append([scene.name, *shown])
    return table(("scene", *(f"{error:.0e}" for error in DECADES)), lines)


def _first(name: str, factor: float, methods: int) -> str:
    """Return a winner as text: alone where there is nobody to beat."""
    if math.isinf(factor):
        return name if methods == 1 else f"{name} only"
    return f"{name} {factor:.2g}x"


def front_table(scene: Scene, rows: Sequence[Measurement]) -> str:
    """Return our front with all measures, then the peers'."""
    mine = [row for row in rows if row.scene == scene.name]
    held_to = list(dict.fromkeys((scene.measure, scene.held_to(ours=True))))
    measures = [*held_to, *(n for n in _names(row.errors for row in mine) if n not in held_to)]
    keys = {(point.engine, point.setting) for both in fronts(scene, rows) for point in both}
    chosen = [row for row in mine if (row.engine, row.setting) in keys]
    chosen.sort(key=lambda row: (row.engine != OURS, row.wall_per_sim_s))
    return table(
        ("engine", "setting", "time [s]", *measures),
        [
            [
                row.engine,
                row.setting,
                f"{row.wall_per_sim_s:.3g}",
                *(f"{row.errors[name]:.2g}" if name in row.errors else "" for name in measures),
            ]
            for row in chosen
        ],
    )


def whole_table(wholes: Sequence[Whole]) -> str:
    """Return what whole runs took beside their loops, and the most memory of each."""
    return table(
        ("scene", "engine", "setting", "error", "loop [s]", "whole [s]", "memory [MB]", ""),
        [
            [
                *(whole.scene, whole.engine, whole.setting, f"{whole.error:.2g}"),
                *(f"{whole.loop_s:.3g}", f"{whole.whole_s:.3g}"),
                "" if whole.memory_mb is None else f"{whole.memory_mb:.0f}",
                whole.note,
            ]
            for whole in wholes
        ],
    )


def scaling(rows: Sequence[Measurement]) -> str:
    """Return our time for one body or contact and step, for each number of spheres.

    The contacts are their mean over the run: calls of the normal law over evaluations, a row
    being one more evaluation in thousands. Settings are compared with themselves only.
    """
    each: dict[str, dict[int, float]] = {}
    for row, bodies in _counted(rows, "S7_"):
        contacts = row.counts["normal_calls"] / row.counts["rhs_evaluations"]
        each.setdefault(row.setting, {})[bodies] = (
            1e9 * row.wall_s / (row.counts["steps"] * (bodies + contacts))
        )
    first = "ns each body or contact a step"
    return _growth_table(first, each, SCALING_BETWEEN, LARGEST_GROWTH)


def chain_growth(rows: Sequence[Measurement]) -> str:
    """Return our time for one evaluation, all included, for each number of rods of S8_n.

    A row is one evaluation more.
    """
    each: dict[str, dict[int, float]] = {}
    for row, rods in _counted(rows, "S8_"):
        evaluations = row.counts["rhs_evaluations"] + row.counts["output_evaluations"]
        each.setdefault(row.setting, {})[rods] = 1e9 * row.wall_s / evaluations
    return _growth_table("ns an evaluation", each, CHAIN_BETWEEN, CHAIN_GROWTH)


def _counted(rows: Sequence[Measurement], prefix: str) -> list[tuple[Measurement, int]]:
    """Return our runs with a result of scenes that are called `prefix` and a number, and that."""
    return [
        (row, int(row.scene.removeprefix(prefix)))
        for row in rows
        if row.engine == OURS and row.scene.startswith(prefix) and row.errors
    ]


def _growth_table(
    first: str, each: Mapping[str, Mapping[int, float]], between: tuple[int, int], largest: float
) -> str:
    """Return times by setting and number of bodies, and their growth; empty if there is none."""
    counts = sorted({bodies for found in each.values() for bodies in found})
    header = (first, *map(str, counts), "growth", "target", "")
    lines = [
        _growth_line(setting, found, counts, between, largest) for setting, found in each.items()
    ]
    return table(header, lines) if lines else ""


def _growth_line(
    setting: str,
    found: Mapping[int, float],
    counts: Sequence[int],
    between: tuple[int, int],
    largest: float,
) -> list[str]:
    """Return the times of one setting, and their growth from the fewest bodies to the most."""
    shown = [f"{found[n]:.0f}" if n in found else "" for n in counts]
    few, many = between
    if few not in found or many not in found:
        return [setting, *shown, "", "", ""]
    growth = found[many] / found[few]
    verdict = "met" if growth <= largest else "lost"
    return [setting, *shown, f"{growth:.2f}", f"{largest:g}", verdict]


def _failures(scenes: Sequence[Scene], rows: Sequence[Measurement]) -> str:
    """Return what failed or is not compared, each reason once."""
    known = {scene.name: scene for scene in scenes}
    reasons: dict[tuple[str, str, str], int] = {}
    for row in rows:
        why_not = excluded(known[row.scene], row) if row.errors else row.note
        if why_not:
            key = (row.scene, row.engine, why_not)
            reasons[key] = reasons.get(key, 0) + 1
    return "\n".join(
        f"- {scene}, {engine}, {count} settings: {note}"
        for (scene, engine, note), count in reasons.items()
    )

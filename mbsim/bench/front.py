"""Fronts of time against error, and the time to reach an error."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from mbsim.bench.measurement import OURS, Measurement
from mbsim.bench.scene import Scene


class Point(NamedTuple):
    """An error, the time that it took, and who took it."""

    error: float
    time: float
    engine: str
    setting: str


class Cell(NamedTuple):
    """One comparison: our time to reach a peer's error, and the verdict.

    `ours_s` and `ratio` are None where none of our runs has so small an error; `met` is
    None where there is no target or no run of ours. `held_to` is the measure of our error.
    """

    scene: str
    error: float
    peer: str
    setting: str
    peer_s: float
    ours_s: float | None
    ratio: float | None
    target: float | None
    met: bool | None
    held_to: str


def excluded(scene: Scene, row: Measurement) -> str:
    """Return why a run with a result is not compared; empty where it is.

    A run that was cut short has not shown its largest error, and rows that are further apart
    than asked are less work.
    """
    if "reached_s" in row.counts:
        return "cut short, so its error is a lower bound"
    if row.counts.get("rows_ms", 0.0) > 1.1e3 * scene.sample:
        return f"rows {row.counts['rows_ms']:.3g} ms apart, {1e3 * scene.sample:.3g} asked"
    return ""


def candidates(scene: Scene, rows: Iterable[Measurement], ours: bool) -> list[Measurement]:
    """Return the runs of a scene that are compared: ours, or those of all peers."""
    mine = (row for row in rows if row.scene == scene.name and (row.engine == OURS) == ours)
    return [row for row in mine if not excluded(scene, row)]


def points(rows: Iterable[Measurement], measure: str) -> list[Point]:
    """Return the finite points of measurements for one measure."""
    found = [
        Point(row.errors[measure], row.wall_per_sim_s, row.engine, row.setting)
        for row in rows
        if measure in row.errors
    ]
    return [p for p in found if math.isfinite(p.error) and math.isfinite(p.time)]


def fronts(scene: Scene, rows: Sequence[Measurement]) -> tuple[list[Point], list[Point]]:
    """Return our front of a scene and the common one of the peers, each by what it is held to."""
    mine, theirs = (
        front(points(candidates(scene, rows, ours), scene.held_to(ours))) for ours in (True, False)
    )
    return mine, theirs


def method(row: Measurement) -> str:
    """Return the integrator of a run of ours."""
    return row.setting.split()[0]


def own_fronts(scene: Scene, rows: Sequence[Measurement]) -> dict[str, list[Point]]:
    """Return the front of each of our methods on a scene, by what ours are held to."""
    mine = candidates(scene, rows, ours=True)
    measure = scene.held_to(ours=True)
    names = dict.fromkeys(map(method, mine))
    found = {n: front(points((r for r in mine if method(r) == n), measure)) for n in names}
    return {name: each for name, each in found.items() if each}


def winner(each: Mapping[str, Sequence[Point]], error: float) -> tuple[str, float] | None:
    """Return the method that reaches an error first and by how many times, None if none does.

    The factor is the second's time over its time; infinite where no other reaches the error.
    """
    times = {name: time_at(points, error) for name, points in each.items()}
    reached = sorted((t, name) for name, t in times.items() if t is not None)
    if not reached:
        return None
    second = reached[1][0] if len(reached) > 1 else math.inf
    return reached[0][1], second / reached[0][0]


def front(all_points: Iterable[Point]) -> list[Point]:
    """Return the points that no other point beats in error and time, by falling error."""
    kept: list[Point] = []
    for point in sorted(all_points, key=lambda p: (p.time, p.error)):
        if not kept or point.error < kept[-1].error:
            kept.append(point)
    return kept


def time_at(ours: Sequence[Point], error: float) -> float | None:
    """Return the time to reach an error, between measured points of a front only.

    Between two points log time is linear in log error. At errors above the largest one the
    cheapest point counts, whose error is smaller; below the smallest one there is None.
    """
    if not ours or error < ours[-1].error:
        return None
    if error >= ours[0].error:
        return ours[0].time
    k = next(k for k, point in enumerate(ours) if point.error <= error)
    loose, tight = ours[k - 1], ours[k]
    if tight.error == 0.0:
        return tight.time
    share = math.log(error / tight.error) / math.log(loose.error / tight.error)
    return math.exp((1.0 - share) * math.log(tight.time) + share * math.log(loose.time))


def compare(scene: Scene, rows: Sequence[Measurement]) -> list[Cell]:
    """Return the comparisons of a scene with the peers' front; none without peers.

    Where ours is held to a measure of its own, the peers' is compared too but not judged.
    """
    ours, peers = fronts(scene, rows)
    shown = _compared_peers(scene, peers)
    held_to = scene.held_to(ours=True)
    cells = [_cell(scene, p, ours, held_to, scene.target(p.error)) for p in shown]
    if held_to != scene.measure:
        same = front(points(candidates(scene, rows, ours=True), scene.measure))
        cells += [_cell(scene, p, same, scene.measure, None) for p in shown]
    return cells


def _compared_peers(scene: Scene, peers: list[Point]) -> list[Point]:
    """Return the peers' points that ours is compared with; the fastest one that passes."""
    if scene.pass_below is None:
        smallest, largest = scene.compared
        return [p for p in peers if smallest <= p.error <= largest]
    return [p for p in peers if p.error < scene.pass_below][:1]


def _cell(scene: Scene, peer: Point, ours: list[Point], held_to: str, target: float | None) -> Cell:
    """Return one comparison with our front; a target that none of our runs reaches is lost."""
    if scene.pass_below is None:
        ours_s = time_at(ours, peer.error)
    else:
        ours_s = next((p.time for p in ours if p.error < scene.pass_below), None)
    ratio = None if ours_s is None else ours_s / peer.time
    met = None if target is None or not ours else ratio is not None and ratio <= target
    return Cell(
        scene.name,
        peer.error,
        peer.engine,
        peer.setting,
        peer.time,
        ours_s,
        ratio,
        target,
        met,
        held_to,
    )

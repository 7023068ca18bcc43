"""Fronts of time against error, and the time to reach an error."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from mbsim.bench.measurement import OURS, Measurement
from mbsim.bench.scene import Scene

#: Errors of the peers' front at which we are compared.
LARGEST, SMALLEST = 1e-2, 1e-7


class Point(NamedTuple):
    """An error, the time that it took, and who took it with rows how far apart [ms]."""

    error: float
    time: float
    engine: str
    setting: str
    rows_ms: float = 0.0


class Cell(NamedTuple):
    """One comparison: our time to reach a peer's error, and the verdict.

    `ours_s` and `ratio` are None where none of our runs has so small an error; `met` is
    None where there is no target or no run of ours. `rows_ms` is how far apart the peer's rows
    are: some of its settings cannot store one every 10 ms, which is less work than ours.
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
    rows_ms: float


def points(rows: Iterable[Measurement], measure: str) -> list[Point]:
    """Return the finite points of measurements for one measure."""
    found = [
        Point(
            row.errors[measure],
            row.wall_per_sim_s,
            row.engine,
            row.setting,
            row.counts.get("rows_ms", 0.0),
        )
        for row in rows
        if measure in row.errors
    ]
    return [p for p in found if math.isfinite(p.error) and math.isfinite(p.time)]


def front(candidates: Iterable[Point]) -> list[Point]:
    """Return the points that no other point beats in error and time, by falling error."""
    kept: list[Point] = []
    for point in sorted(candidates, key=lambda p: (p.time, p.error)):
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
    """Return the comparisons of a scene with the peers' front; none without peers."""
    all_points = points((row for row in rows if row.scene == scene.name), scene.measure)
    ours = front(p for p in all_points if p.engine == OURS)
    peers = front(p for p in all_points if p.engine != OURS)
    if scene.pass_below is not None:
        return _compare_passing(scene, ours, peers)
    return [
        _cell(scene, p, time_at(ours, p.error), bool(ours))
        for p in peers
        if SMALLEST <= p.error <= LARGEST
    ]


def _compare_passing(scene: Scene, ours: list[Point], peers: list[Point]) -> list[Cell]:
    """Return the one comparison between the fastest runs with an error below the scene's."""
    assert scene.pass_below is not None
    fastest = next((p for p in peers if p.error < scene.pass_below), None)
    if fastest is None:
        return []
    mine = next((p.time for p in ours if p.error < scene.pass_below), None)
    return [_cell(scene, fastest, mine, bool(ours))]


def _cell(scene: Scene, peer: Point, ours_s: float | None, ran: bool) -> Cell:
    """Return one comparison; a target that none of our runs reaches is lost."""
    target = scene.target(peer.error)
    ratio = None if ours_s is None else ours_s / peer.time
    met = None if target is None or not ran else ratio is not None and ratio <= target
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
        peer.rows_ms,
    )

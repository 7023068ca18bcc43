"""One picture a scene: time per simulated second against error, ours against the peers."""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

from mbsim.bench.front import (
    Point,
    candidates,
    excluded,
    front,
    method,
    own_fronts,
    points,
    winner,
)
from mbsim.bench.measurement import OURS, Measurement
from mbsim.bench.scene import Scene
from mbsim.run.settings import INTEGRATORS

_COLOURS = {"mujoco": "tab:blue", "exudyn": "tab:green", "pybullet": "tab:purple"}
_OWN_COLOURS = ("tab:red", "tab:orange", "tab:brown", "black", "tab:cyan", "tab:pink", "tab:olive")
_MARKERS = {"mujoco": "s", "exudyn": "^", "pybullet": "D"}

#: Pieces of the strip that says which method is first.
_STRIP = 200

#: Errors beyond these say no more: exact on one side, wrong on the other.
_RANGE = (1e-12, 10.0)


def available() -> bool:
    """Return whether matplotlib is installed."""
    return importlib.util.find_spec("matplotlib") is not None


def draw(scene: Scene, rows: Sequence[Measurement], path: Path) -> None:
    """Draw the work-precision picture of a scene into a PNG file."""
    from matplotlib.figure import Figure

    mine = [row for row in rows if row.scene == scene.name and row.errors]
    figure = Figure(figsize=(8.0, 5.6), layout="constrained")
    axes = figure.add_subplot()
    peers = [row for row in mine if row.engine != OURS]
    for engine in dict.fromkeys(row.engine for row in peers):
        theirs = [row for row in peers if row.engine == engine]
        style = {"color": _COLOURS.get(engine, "tab:gray"), "marker": _MARKERS.get(engine, "v")}
        _series(axes, scene, theirs, engine, style)
    own = [row for row in mine if row.engine == OURS]
    for name in dict.fromkeys(map(method, own)):
        chosen = [row for row in own if method(row) == name]
        style = {"color": own_colour(name), "marker": "o"}
        _series(axes, scene, chosen, f"mbsim {name}", style | {"linewidth": 2.0})
        _label_ends(axes, front(points(chosen, scene.measure)), str(style["color"]))
        if scene.second is not None:
            measure, label = scene.second
            dashed = style | {"linestyle": "--"}
            _line(axes, front(points(chosen, measure)), f"mbsim {name}, {label}", dashed)
    _targets(axes, scene, front(points(candidates(scene, mine, ours=False), scene.measure)))
    _winners(axes, own_fronts(scene, mine))
    axes.margins(y=0.1)
    axes.set(xscale="log", yscale="log", title=f"{scene.name}: {scene.title}")
    axes.set_xlabel(f"{scene.unit}   (better: left; strip: our fastest method)")
    axes.set_ylabel("wall seconds per simulated second   (better: down)")
    axes.grid(True, which="major", alpha=0.3)
    if mine:
        figure.legend(loc="outside lower center", ncols=3, fontsize=8)
    figure.savefig(path, dpi=110)


def own_colour(name: str) -> str:
    """Return the colour of one of our methods, the same in every picture."""
    place = INTEGRATORS.index(name) if name in INTEGRATORS else len(_OWN_COLOURS) - 1
    return _OWN_COLOURS[place % len(_OWN_COLOURS)]


def _winners(axes: Any, each: dict[str, list[Point]]) -> None:
    """Draw a strip along the bottom: at each error the colour of our fastest method."""
    errors = [_clipped(p.error) for shown in each.values() for p in _visible(shown)]
    if len(each) < 2 or min(errors, default=0.0) == max(errors, default=0.0):
        return
    low, high = math.log10(min(errors)), math.log10(max(errors))
    edges = [low + (high - low) * k / _STRIP for k in range(_STRIP + 1)]
    for left, right in pairwise(edges):
        first = winner(each, 10.0 ** (0.5 * (left + right)))
        if first is not None:
            place = {"ymin": 0.0, "ymax": 0.015, "linewidth": 0.0}
            axes.axvspan(10.0**left, 10.0**right, color=own_colour(first[0]), **place)


def _series(
    axes: Any, scene: Scene, rows: Sequence[Measurement], label: str, style: dict[str, Any]
) -> None:
    """Draw all runs of one engine faintly and the front of those that are compared as a line."""
    visible = _visible(points(rows, scene.measure))
    axes.plot(
        [_clipped(p.error) for p in visible],
        [p.time for p in visible],
        linestyle="none",
        alpha=0.25,
        markersize=4,
        **{key: value for key, value in style.items() if key in ("color", "marker")},
    )
    compared = points((row for row in rows if not excluded(scene, row)), scene.measure)
    _line(axes, front(_visible(compared)), label, style)


def _visible(shown: list[Point]) -> list[Point]:
    """Return the points that are not wrong altogether."""
    return [p for p in shown if p.error <= _RANGE[1]]


def _line(axes: Any, shown: list[Point], label: str, style: dict[str, Any]) -> None:
    """Draw a front."""
    xs, ys = [_clipped(p.error) for p in shown], [p.time for p in shown]
    axes.plot(xs, ys, label=label, markersize=5, **style)


def _label_ends(axes: Any, shown: list[Point], colour: str) -> None:
    """Write the settings at both ends of our front."""
    for point, away in zip(shown[:1] + shown[1:][-1:], (-14, 8), strict=False):
        text = point.setting.split(" ", 1)[1]
        place = (_clipped(point.error), point.time)
        style = {"textcoords": "offset points", "ha": "center", "fontsize": 8, "color": colour}
        axes.annotate(text, place, (0, away), **style)


def _targets(axes: Any, scene: Scene, peers: list[Point]) -> None:
    """Draw the peers' common front times the ratio that is asked for."""
    asked = [(p, scene.target(p.error)) for p in peers if p.error <= _RANGE[1]]
    shown = [(_clipped(p.error), p.time * ratio) for p, ratio in asked if ratio is not None]
    if shown:
        label = "asked: " + ", ".join(f"1/{1 / t.ratio:.3g}" for t in scene.targets)
        label += " of the best peer"
        axes.plot(*zip(*shown, strict=True), color="black", linestyle=":", label=label)


def _clipped(error: float) -> float:
    """Return an error that a logarithmic axis can show."""
    return max(error, _RANGE[0])

"""One picture a scene: time per simulated second against error, ours against the peers."""

from __future__ import annotations

import importlib.util
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mbsim.bench.front import Point, candidates, excluded, front, points
from mbsim.bench.measurement import OURS, Measurement
from mbsim.bench.scene import Scene

_COLOURS = {"mujoco": "tab:blue", "exudyn": "tab:green", "pybullet": "tab:purple"}
_OWN_COLOURS = ("tab:red", "tab:orange", "tab:brown", "tab:pink")
_MARKERS = {"mujoco": "s", "exudyn": "^", "pybullet": "D"}

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
    integrators = list(dict.fromkeys(row.setting.split()[0] for row in own))
    for k, name in enumerate(integrators):
        chosen = [row for row in own if row.setting.split()[0] == name]
        style = {"color": _OWN_COLOURS[k % len(_OWN_COLOURS)], "marker": "o"}
        _series(axes, scene, chosen, f"mbsim {name}", style | {"linewidth": 2.0})
        _label_ends(axes, front(points(chosen, scene.measure)), str(style["color"]))
        if scene.second is not None:
            measure, label = scene.second
            dashed = style | {"linestyle": "--"}
            _line(axes, front(points(chosen, measure)), f"mbsim {name}, {label}", dashed)
    _targets(axes, scene, front(points(candidates(scene, mine, ours=False), scene.measure)))
    axes.set(xscale="log", yscale="log", title=f"{scene.name}: {scene.title}")
    axes.set_xlabel(f"{scene.unit}   (better: left)")
    axes.set_ylabel("wall seconds per simulated second   (better: down)")
    axes.grid(True, which="major", alpha=0.3)
    if mine:
        figure.legend(loc="outside lower center", ncols=3, fontsize=8)
    figure.savefig(path, dpi=110)


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

"""`collect`: signals of result files as curves in panels, with all that is said about them.

Only numbers and words: `results.drawing` makes a picture of it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.errors import ModelError, ResultsError, UnknownSignal
from mbsim.results.elements import GROUPS
from mbsim.results.names import PARTS, of_slope
from mbsim.results.quantities import quantity_of
from mbsim.results.units import TIME, Quantity, UnitSystem

if TYPE_CHECKING:
    from mbsim.results.reading import Results

Array = np.ndarray[Any, Any]

#: What one of a group is called.
_ONE_OF = {
    "bodies": "body",
    "requests": "request",
    **{group.path: group.one for group in GROUPS.values()},
}
#: Characters of a column's name that a label shows; an expression may be of any length.
_LONGEST = 40
#: Signals of a contact whose largest value is kept over all steps, and where.
_PEAKS = {"force/mag": "force", "penetration": "penetration", "slip_speed": "slip_speed"}
#: A peak so much above the rows is worth a note.
_PEAK_WORTH_SAYING = 1.02
#: Rows of two runs belong together if their times differ by less than this, relative.
_SAME_TIME = 1e-9


@dataclass(frozen=True)
class Choice:
    """What shall be drawn.

    `names` may have wildcards; a name without component stands for all of them. Times are in
    the unit of the first file.
    """

    names: tuple[str, ...]
    over: str = "time"
    start: float | None = None
    end: float | None = None
    log: bool = False
    events: bool = False


@dataclass(frozen=True)
class Curve:
    """One line: `x` and `y`, shape (n,), in the units of the picture."""

    file: int  # which of the picture's files
    name: str  # as in the result file, with its component
    label: str
    x: Array
    y: Array
    band: Array | None = None  # error bar of y, where the run has one


@dataclass
class Panel:
    """Curves of one quantity, on one pair of axes."""

    quantity: Quantity
    unit: str
    curves: list[Curve] = field(default_factory=list)
    #: The quantity with its unit, as it stands on the axis.
    axis: str = ""
    #: What this panel is drawn over, where it has an axis of its own.
    over: str = ""
    #: Until when derivatives are known that are not to the end: what is said of each, and the time.
    until: dict[str, float] = field(default_factory=dict)


@dataclass
class Picture:
    """Panels over one common axis, and the words around them."""

    title: str
    files: list[str]  # what the result files are called in legends
    axis: str  # of all panels, with its unit
    log: bool
    span: tuple[float, float] | None  # of time, where it is the common axis
    warnings: list[str]  # files that are not of finished runs
    notes: list[str] = field(default_factory=list)
    panels: list[Panel] = field(default_factory=list)
    #: Kind of event -> its times.
    events: dict[str, Array] = field(default_factory=dict)


@dataclass(frozen=True)
class Component:
    """One column of a signal."""

    name: str
    dataset: str
    part: str  # empty for a scalar signal

    @property
    def column(self) -> int:
        """Return the column; 0 for a magnitude, which is of the first one's kind."""
        is_request = of_slope(self.dataset)[1].startswith("requests/")
        for parts in PARTS.values():
            if self.part in parts and is_request == (len(parts) == 8):
                return parts[self.part]
        return 0


def components(results: Results, name: str) -> list[Component]:
    """Return all components that a name or pattern stands for, in their order.

    Raises
    ------
    UnknownSignal
        If there are none.
    """
    columns = results.signals()
    found: list[Component] = []
    for each in results.find(name):
        if each not in columns:
            dataset, _, part = each.rpartition("/")
            found.append(Component(each, dataset, part))
        elif columns[each] == 1:
            found.append(Component(each, each, ""))
        else:
            found += [Component(f"{each}/{p}", each, p) for p in PARTS[columns[each]]]
    return found


def collect(files: Sequence[Results], choice: Choice, minus: Results | None = None) -> Picture:
    """Return the curves of signals, ready to be drawn.

    Parameters
    ----------
    files : sequence of Results
        Drawn over each other, in the units of the first.
    choice : Choice
    minus : Results, optional
        What is drawn are differences from this one, at output times that both have.

    Raises
    ------
    UnknownSignal
        If no file has one of the names, or one is not what can be drawn.
    ModelError
        If nothing is left to draw: no rows in the range, no positive value on a log axis.
    ResultsError
        If a file has no rows, or cannot be read.
    """
    # one row of `tracks` a file; all are in the units of the first
    units = UnitSystem.of(files[0].attributes)
    tracks = [_Track(results, units, choice, minus) for results in files]
    # the run that is taken off is not drawn, but whoever judges must know of it too
    others = [] if minus is None else [_Track(minus, units, Choice(choice.names), None)]
    runs = [*tracks, *others]
    called = names_of([track.path for track in runs])
    picture = Picture(
        title=_title(called[: len(tracks)], called[len(tracks) :]),
        files=called[: len(tracks)],
        axis=tracks[0].axis,
        log=choice.log,
        span=_span(tracks, choice),
        warnings=[
            f"{name}: {text}" if len(runs) > 1 else text
            for track, name in zip(runs, called, strict=True)
            if (text := _unfinished(track, units))
        ],
    )
    for name in choice.names:
        _add(picture, tracks, name)
    for panel in picture.panels:
        _describe(panel, units, minus is not None, choice.log)
    if minus is None and choice.start is None and choice.end is None:
        picture.notes += _peaks(picture, tracks)
    if choice.events:
        picture.events = _events(tracks[0], choice)
    if choice.log:
        _keep_positive(picture)
    picture.notes += [_source(track, name) for track, name in zip(runs, called, strict=True)]
    return picture


class _Track:
    """Rows of one file that are drawn, and what they are drawn over."""

    left_out = 0

    def __init__(
        self, results: Results, units: UnitSystem, choice: Choice, minus: Results | None
    ) -> None:
        self.results = results
        self.path = results.path or Path("in memory")
        self.from_units, self.units = UnitSystem.of(results.attributes), units
        time = self._rows_of(results, "time", TIME)
        if not len(time):
            raise ResultsError(f"{self.path}: has no output rows ({results.status})")
        self.first_time, self.last_time = float(time[0]), float(time[-1])
        self.rows = np.flatnonzero(_between(time, choice.start, choice.end))
        self.minus = minus
        if minus is not None:
            self._pair(time, minus)
        over = self._over(choice.over)
        quantity = quantity_of(results, over.dataset, over.column)
        self.over_time = over.name == "time"
        self.x = self._rows_of(results, over.name, quantity)[self.rows]
        what = quantity.name if self.over_time else f"{quantity.name}, {label_of(results, over)}"
        self.axis = with_unit(what, units.text(quantity))

    def _rows_of(self, results: Results, name: str, quantity: Quantity) -> Array:
        """Return a signal in the units of the picture."""
        values = np.asarray(results[name], dtype=float)
        own = UnitSystem.of(results.attributes)
        return values if own == self.units else values * own.factor_to(self.units, quantity)

    def _over(self, name: str) -> Component:
        """Return the one component that the others are drawn over."""
        found = components(self.results, name)
        if len(found) > 1:
            some = ", ".join(component.name for component in found[:8])
            raise UnknownSignal(f"--x: {name} is more than one signal; choose one of {some}")
        return found[0]

    def _pair(self, time: Array, minus: Results) -> None:
        """Keep the rows whose times the other run has too, and find them there."""
        other = self._rows_of(minus, "time", TIME)
        if not len(other):
            raise ResultsError(f"{minus.path}: has no output rows ({minus.status})")
        mine = time[self.rows]
        at = np.clip(np.searchsorted(other, mine), 1, max(1, len(other) - 1))
        before = np.abs(other[at - 1] - mine) < np.abs(other[np.minimum(at, len(other) - 1)] - mine)
        at = np.minimum(at - before, len(other) - 1)
        scale = max(np.abs(time).max(), np.abs(other).max())
        same = np.abs(other[at] - mine) <= _SAME_TIME * scale
        if len(mine) and not same.any():
            raise ModelError(
                f"--minus: {minus.path} has no output time in common with {self.path}; "
                "run both with the same --print-interval"
            )
        self.left_out = int(len(mine) - same.sum())
        self.rows, self.other_rows = self.rows[same], at[same]

    def values(self, component: Component, quantity: Quantity) -> Array:
        """Return a component in the rows that are drawn."""
        values = self._rows_of(self.results, component.name, quantity)[self.rows]
        if self.minus is None:
            return values
        if component.name not in self.minus:
            # says what there is
            self.minus.find(component.name)
        others = self._rows_of(self.minus, component.name, quantity)[self.other_rows]
        return np.asarray(values - others)

    def band(self, component: Component, quantity: Quantity) -> Array | None:
        """Return the error bar of a component in the rows that are drawn, if there is one."""
        name, errors = component.name, self.results.errors
        if self.minus is not None or name not in errors:
            return None
        bar = np.asarray(errors[name], dtype=float)[self.rows]
        return bar * self.from_units.factor_to(self.units, quantity)


def _between(time: Array, start: float | None, end: float | None) -> Array:
    keep = np.ones(len(time), dtype=bool)
    if start is not None:
        keep &= time >= start
    if end is not None:
        keep &= time <= end
    return keep


def _span(tracks: Sequence[_Track], choice: Choice) -> tuple[float, float] | None:
    """Return the range of time that is drawn, None if it is not the axis."""
    drawn = [track.x for track in tracks if len(track.x)]
    if not drawn:
        first = min(track.first_time for track in tracks)
        last = max(track.last_time for track in tracks)
        raise ModelError(
            f"--from, --to: no output row in this range; rows go from {first:.6g} to {last:.6g}"
        )
    if not tracks[0].over_time:
        return None
    low = min(float(x[0]) for x in drawn) if choice.start is None else choice.start
    high = max(float(x[-1]) for x in drawn) if choice.end is None else choice.end
    return low, high


def _add(picture: Picture, tracks: Sequence[_Track], name: str) -> None:
    """Add the curves of one name; files that do not have it are noted, if others do."""
    missing: list[tuple[int, UnknownSignal]] = []
    for k, track in enumerate(tracks):
        try:
            found = components(track.results, name)
        except UnknownSignal as error:
            missing.append((k, error))
            continue
        for component in found:
            _add_component(picture, k, track, component)
    if len(missing) == len(tracks):
        raise missing[0][1]
    picture.notes += [f"{picture.files[k]} has no {name}" for k, _ in missing]


def _add_component(picture: Picture, k: int, track: _Track, component: Component) -> None:
    """Add one curve to the panel of its quantity, once."""
    quantity = quantity_of(track.results, component.dataset, component.column)
    unit = track.units.text(quantity)
    for panel in picture.panels:
        if (panel.quantity.name, panel.unit) == (quantity.name, unit):
            break
    else:
        panel = Panel(quantity, unit)
        picture.panels.append(panel)
    if any((curve.file, curve.name) == (k, component.name) for curve in panel.curves):
        return
    label = label_of(track.results, component)
    values = track.values(component, quantity)
    band = track.band(component, quantity)
    panel.curves.append(Curve(k, component.name, label, track.x, values, band))
    _add_until(picture, k, track, component, panel)


def _add_until(picture: Picture, k: int, track: _Track, component: Component, panel: Panel) -> None:
    """Say until when a derivative is known, where that is not to the end."""
    parameter, _ = of_slope(component.dataset)
    about = track.results.parameters.get(parameter, {})
    until = float(about.get("known_until", math.inf))
    if not math.isfinite(until):
        return
    until *= track.from_units.factor_to(track.units, TIME)
    run = f"{picture.files[k]}: " if len(picture.files) > 1 else ""
    time = f"{until:.6g} {track.units.text(TIME)}".rstrip()
    note = f"{run}derivatives by {parameter} are not known from {time} on: {about.get('why', '')}"
    if note not in picture.notes:
        picture.notes.append(note)
    if track.over_time:
        panel.until[f"{run}{parameter} known until {time}"] = until


def label_of(results: Results, component: Component) -> str:
    """Return what a curve is called: ``body 2 (ball), z``."""
    parameter, signal = of_slope(component.dataset)
    if parameter:
        plain = label_of(results, Component(component.name, signal, component.part))
        return f"{plain} by {parameter}"
    group, *rest = component.dataset.split("/")
    part = {"mag": "magnitude"}.get(component.part, component.part)
    if group not in _ONE_OF or not rest:
        return ", ".join(filter(None, ("/".join(rest) or group, part)))
    element = f"{group}/{rest[0]}"
    label = results.label(element)
    columns = results.attribute(component.dataset, "columns")
    what = str(columns[component.column]) if group == "requests" and columns is not None else ""
    if what and part:
        part = f"{part} = {what if len(what) <= _LONGEST else what[:_LONGEST] + '...'}"
    who = f"{_ONE_OF[group]} {rest[0]}" + (f" ({label})" if label else "")
    return ", ".join(filter(None, (who, part)))


def with_unit(what: str, unit: str) -> str:
    """Return a text for an axis: ``Position [m]``."""
    return f"{what} [{unit}]" if unit else what


def _describe(panel: Panel, units: UnitSystem, difference: bool, log: bool) -> None:
    """Write the text of a panel's axis; a difference on a log axis is drawn without sign."""
    what = panel.quantity.name
    if difference:
        what = f"Δ {what.lower()}"
        if log:
            what = f"|{what}|"
            panel.curves = [Curve(c.file, c.name, c.label, c.x, np.abs(c.y)) for c in panel.curves]
    panel.axis = with_unit(what, panel.unit)


def names_of(paths: Sequence[Path]) -> list[str]:
    """Return short names that tell files apart: their stems, with folders where needed."""
    depth = 1
    deepest = max(len(path.parts) for path in paths)
    while True:
        short = ["/".join((*path.parts[-depth:-1], path.stem)) for path in paths]
        if len(set(short)) == len(short) or depth >= deepest:
            break
        depth += 1
    # runs of one model in several folders: the folders say it all
    same = depth > 1 and len({path.stem for path in paths}) == 1
    return [name.rpartition("/")[0] or name for name in short] if same else short


def _title(files: Sequence[str], minus: Sequence[str]) -> str:
    """Return the names of the runs."""
    text = ", ".join(files[:3]) + (f" and {len(files) - 3} more" if len(files) > 3 else "")
    return " minus ".join([text, *minus])


def _unfinished(track: _Track, units: UnitSystem) -> str:
    """Return what a reader must know of a run that did not come to its end."""
    status = track.results.status
    if status == "finished":
        return ""
    end = track.results.attributes.get("end_time")
    what = {"running": "not finished (still running, or killed)"}.get(status, status)
    text = f"{what} at {track.last_time:.6g}"
    if isinstance(end, (int, float)):
        text += f" of {end * track.from_units.factor_to(units, TIME):.6g}"
    return f"{text} {units.text(TIME)}"


def _peaks(picture: Picture, tracks: Sequence[_Track]) -> list[str]:
    """Return notes on peaks that output rows do not show, of contacts."""
    notes = []
    for panel in picture.panels:
        for curve in panel.curves:
            group, _, rest = curve.name.partition("/")
            id, _, signal = rest.partition("/")
            track = tracks[curve.file]
            name = f"contacts/{id}/peak_{_PEAKS.get(signal, '')}"
            if group != "contacts" or name not in track.results or not len(curve.y):
                continue
            factor = track.from_units.factor_to(track.units, panel.quantity)
            peak = float(track.results[name]) * factor
            if peak > _PEAK_WORTH_SAYING * np.nanmax(np.abs(curve.y)):
                run = f"{picture.files[curve.file]}: " if len(tracks) > 1 else ""
                what = panel.quantity.name.lower()
                notes.append(
                    f"{run}{what} of {curve.label.removesuffix(', magnitude')} reaches "
                    f"{peak:.4g} {panel.unit} between output rows"
                )
    return notes


def _events(track: _Track, choice: Choice) -> dict[str, Array]:
    """Return times of events in the range that is drawn, by kind."""
    table = track.results["events"]
    time = table["time"] * track.from_units.factor_to(track.units, TIME)
    keep = _between(time, choice.start, choice.end)
    kinds: Mapping[str, None] = dict.fromkeys(table["kind"][keep].tolist())
    return {kind: time[keep & (table["kind"] == kind)] for kind in kinds}


def _keep_positive(picture: Picture) -> None:
    """Take what a log axis cannot show out of the curves, and say so."""
    for panel in picture.panels:
        left = sum(int((curve.y > 0).sum()) for curve in panel.curves)
        total = sum(int(np.isfinite(curve.y).sum()) for curve in panel.curves)
        if not left:
            raise ModelError(f"--log: {panel.axis} has no value above 0 here; leave --log out")
        if left < total:
            lost = f"{total - left} of {total} values are not above 0 and not drawn"
            picture.notes.append(f"{panel.quantity.name}: {lost}")
        panel.curves = [
            Curve(c.file, c.name, c.label, c.x, np.where(c.y > 0, c.y, np.nan))
            for c in panel.curves
        ]


def _source(track: _Track, called: str) -> str:
    """Return where the numbers are from."""
    about = track.results.attributes
    facts = [
        track.path.name if called == track.path.stem else f"{called}: {track.path.name}",
        f"mbsim {about.get('mbsim_version', '')}".strip(),
        str(about.get("integrator", "")),
        f"tol {about['tol']:g}" if isinstance(about.get("tol"), float) else "",
        f"{len(track.rows)} rows",
    ]
    if track.from_units != track.units:
        facts.append(f"converted to {track.units.summary}")
    if track.minus is not None and track.left_out:
        facts.append(f"{track.left_out} without a row at their time in {track.minus.path}")
    return " · ".join(filter(None, facts))

"""The parts of a report: tables and curves of a result file as HTML. Texts of decks are escaped."""

from __future__ import annotations

import platform
import shlex
import sys
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np

from mbsim.model.elements import Model
from mbsim.results.elements import APPLIED, CONSTRAINTS, GROUPS
from mbsim.results.quantities import quantity_of
from mbsim.results.reading import Results
from mbsim.results.units import (
    ENERGY,
    FORCE,
    POSITION,
    TIME,
    TORQUE,
    VELOCITY,
    Quantity,
    UnitSystem,
)
from mbsim.view.plot_svg import Curve, drawn

#: Rows of a table, and pictures of curves, at most.
MOST_ROWS, MOST_PICTURES = 60, 40
#: Packages whose versions a report tells.
_PACKAGES = ("numpy", "scipy", "numba", "h5py", "python-fcl", "trimesh")


def number(value: Any) -> str:
    """Return a number for reading, a dash where there is none."""
    if value is None or (isinstance(value, float) and not np.isfinite(value)):
        return "-"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def table(head: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    """Return a table; all cells are escaped, numbers stand at the right."""
    if not rows:
        return ""
    shown = [
        "".join(
            f'<td class="n">{escape(number(cell))}</td>'
            if isinstance(cell, (int, float))
            else f"<td>{escape(str(cell))}</td>"
            for cell in row
        )
        for row in rows[:MOST_ROWS]
    ]
    top = "".join(f"<th>{escape(name)}</th>" for name in head)
    body = "".join(f"<tr>{row}</tr>" for row in shown)
    more = len(rows) - MOST_ROWS
    note = f'<p class="note">and {more} rows more</p>' if more > 0 else ""
    return f'<div class="wide"><table><tr>{top}</tr>{body}</table></div>{note}'


def facts(rows: Mapping[str, Any]) -> str:
    """Return a table of names and values; what is empty is left out."""
    cells = "".join(
        f"<tr><th>{escape(name)}</th><td>{escape(number(value))}</td></tr>"
        for name, value in rows.items()
        if value not in ("", None)
    )
    return f'<table class="facts">{cells}</table>'


def summary(results: Results) -> str:
    """Return what was run and how it ended."""
    time, stats, units = results["time"], results.stats, UnitSystem.of(results.attributes)
    unit = units.text(TIME)
    return facts(
        {
            "model": results.attributes.get("model_file", ""),
            "status": results.status,
            "end time": f"{time[-1]:.9g} {unit}" if len(time) else "no row",
            "output rows": len(time),
            "steps": stats.get("steps"),
            "rejected steps": stats.get("rejected"),
            "wall time": f"{stats['wall_s']:.2f} s" if "wall_s" in stats else "",
            "units": units.summary,
        }
    )


def warnings(results: Results, told: Sequence[str]) -> str:
    """Return what the run and this report warn of."""
    audit = results.audit
    lines = [*(audit.warnings if audit is not None else ()), *told]
    if audit is None:
        lines.insert(0, "The run has not judged itself: it was ended before that.")
    if results.status != "finished":
        reason = str(results.stats.get("reason", "")).strip()
        lines.insert(0, f"The run is {results.status}: what is shown ends where it did. {reason}")
    if not lines:
        return '<p class="good">None.</p>'
    return "<ul>" + "".join(f'<li class="warning">{escape(line)}</li>' for line in lines) + "</ul>"


def requests(results: Results) -> Iterator[str]:
    """Yield the curves of all requests; where the deck has none, of what is usually looked at."""
    ids = results.ids("requests")
    units = UnitSystem.of(results.attributes)
    for id in ids[:MOST_PICTURES]:
        yield from _request(results, id, units)
    if len(ids) > MOST_PICTURES:
        yield f'<p class="note">and {len(ids) - MOST_PICTURES} requests more</p>'
    if not ids:
        yield '<p class="note">The deck has no request: speeds and contact forces are shown.</p>'
        for group, signal in (("bodies", "velocity"), ("contacts", "force")):
            names = [f"{group}/{id}/{signal}" for id in results.ids(group)[:8]]
            names = [name for name in names if name in results]
            if names:
                quantity = quantity_of(results, names[0])
                curves = [_curve(results, f"{name}/mag", results[f"{name}/mag"]) for name in names]
                yield _figure(curves, quantity, units, "")


def _request(results: Results, id: int, units: UnitSystem) -> Iterator[str]:
    """Yield the curves of a request, those of one quantity in one picture."""
    name = f"requests/{id}"
    columns = list(results.attribute(name, "columns") or [""] * 8)
    values, label = results[name], results.label(name)
    pictures: dict[Quantity, list[Curve]] = {}
    for k, text in enumerate(columns):
        if not text or not np.any(values[:, k]):
            continue  # a column that is not asked for, or nothing but zeros
        curve = _curve(results, f"F{k + 1} {text}", values[:, k], f"{name}/F{k + 1}")
        pictures.setdefault(quantity_of(results, name, k), []).append(curve)
    title = f"Request {id}" + (f": {label}" if label else "")
    if not pictures:
        yield f"<h3>{escape(title)}</h3><p>All its numbers are 0.</p>"
    for quantity, curves in pictures.items():
        yield _figure(curves, quantity, units, title)
        title = ""


def _curve(results: Results, name: str, values: Any, signal: str = "") -> Curve:
    """Return a curve, of a run with error bars with those, whose largest its name says."""
    signal, time = signal or name, np.asarray(results["time"], float)
    if signal not in results.errors:
        return Curve(name, time, np.asarray(values, float))
    error = np.asarray(results.errors[signal], float)
    until = results.errors.reproducible_until(signal)
    known = error[np.isfinite(error) & (time < until)]
    said = f" \u00b1 {known.max():.2g}" if len(known) else ""
    if np.isfinite(until):
        said += f", not reproducible from {until:.4g}"
    return Curve(name + said, time, np.asarray(values, float), error)


def _figure(curves: Sequence[Curve], quantity: Quantity, units: UnitSystem, title: str) -> str:
    """Return curves with a heading."""
    unit, time = units.text(quantity), units.text(TIME)
    axis = f"{quantity.name} [{unit}]" if unit else quantity.name
    head = f"<h3>{escape(title)}</h3>" if title else ""
    return f"<figure>{head}{drawn(curves, axis, f'Time [{time}]')}</figure>"


def contacts(results: Results) -> str:
    """Return what contacts did: largest values of the run, touches, work of friction."""
    units = UnitSystem.of(results.attributes)
    events, audit = results["events"], results.audit
    rows = []
    for id in results.ids("contacts"):
        touch = [float(e["time"]) for e in events if e["kind"] == "touch" and e["element"] == id]
        share = audit.contacts.get(id) if audit is not None else None
        peaks = [
            float(results[f"contacts/{id}/{name}"]) if f"contacts/{id}/{name}" in results else None
            for name in ("peak_force", "peak_penetration", "peak_slip_speed")
        ]
        rows.append(
            [
                f"{id} {results.label(f'contacts/{id}')}".rstrip(),
                *(number(peak) if peak is None else peak for peak in peaks),
                touch[0] if touch else "never",
                len(touch),
                share.friction if share is not None else "-",
            ]
        )
    quantities = (FORCE, POSITION, VELOCITY, TIME)
    force, length, speed, time = (units.text(quantity) for quantity in quantities)
    head = (
        *("contact", f"largest force [{force}]", f"deepest [{length}]"),
        *(f"fastest slip [{speed}]", f"first touch [{time}]", "touches"),
        f"work of friction [{units.text(ENERGY)}]",
    )
    return table(head, rows) or "<p>The deck has no contacts.</p>"


def connections(results: Results) -> str:
    """Return the largest force and torque of joints, motions and forces over output rows."""
    rows = []
    for statement in (*CONSTRAINTS, *APPLIED):
        group = GROUPS[statement]
        for id in results.ids(group.path):
            name = f"{group.path}/{id}"
            if f"{name}/force" not in results:
                continue
            sizes = [results[f"{name}/{kind}/mag"] for kind in ("force", "torque")]
            largest = [float(size.max()) if len(size) else None for size in sizes]
            kind = str(results.attribute(name, "type") or "")
            label = f"{group.one} {id} {results.label(name)}".rstrip()
            rows.append([label, kind, *(number(x) if x is None else x for x in largest)])
    units = UnitSystem.of(results.attributes)
    force, torque = units.text(FORCE), units.text(TORQUE)
    return table(("element", "type", f"force [{force}]", f"torque [{torque}]"), rows)


def energy(results: Results) -> str:
    """Return the audit: its line, curves of energies and of their balance, and its entries."""
    audit, units = results.audit, UnitSystem.of(results.attributes)
    names = [n for n in ("kinetic", "potential", "dissipated", "work_of_motions")]
    there = [name for name in names if f"energy/{name}" in results]
    parts = [f"<p><strong>{escape(audit.line)}</strong></p>"] if audit is not None else []
    if there and len(results["time"]):
        curves = [_curve(results, n.replace("_", " "), results[f"energy/{n}"]) for n in there]
        parts.append(_figure(curves, ENERGY, units, ""))
        signs = {"work_of_motions": -1.0}
        total = sum(signs.get(name, 1.0) * results[f"energy/{name}"] for name in there)
        if len(there) >= 3:
            off = _curve(
                results, "change of kinetic + potential + dissipated - work", total - total[0]
            )
            parts.append(_figure([off], Quantity("Balance", force=1, length=1), units, ""))
    if audit is not None:
        rows = [
            [name.replace("_", " "), e.value, e.allowed, e.time, e.element or "-"]
            for name, e in audit.entries.items()
        ]
        parts.append(table(("judged by", "largest", "allowed", "at time", "element"), rows))
    return "".join(parts)


def settings(results: Results) -> str:
    """Return how it was run."""
    shown = ("integrator", "tol", "tol_from", "end_time", "print_interval", "detector")
    more = ("overrides", "plugins", "interpret_plugins", "signals", "model_sha256")
    found = {name.replace("_", " "): results.attributes.get(name) for name in (*shown, *more)}
    return facts({name: value for name, value in found.items() if value is not None})


def versions(results: Results) -> str:
    """Return the versions of what ran, and of what made this report."""
    found = {"mbsim of the run": results.attributes.get("mbsim_version", "")}
    for name in _PACKAGES:
        try:
            found[f"{name} now"] = version(name)
        except PackageNotFoundError:
            continue
    found["Python now"] = sys.version.split()[0]
    found["system now"] = f"{platform.system()} {platform.machine()}"
    return facts(found)


def counters(results: Results) -> str:
    """Return counters and times of the run."""
    numbers = {name: value for name, value in results.stats.items() if name != "reason"}
    return facts({name.replace("_", " "): value for name, value in numbers.items()})


def command(results: Results, model: Model | None) -> str:
    """Return the command line that runs this again."""
    said = results.attributes
    words = ["mbsim", "run", str(said.get("model_file", "MODEL.xml"))]
    for option, name in (("--plugin", "plugins"), ("--set", "overrides"), ("--signals", "signals")):
        for value in str(said.get(name, "")).splitlines():
            words += ["--contact-points"] if value == "contact_points" else [option, value]
    words += ["--integrator", str(said.get("integrator", "AUTO")), "--tol", repr(said.get("tol"))]
    last = model.simulations[-1] if model is not None and model.simulations else None
    for option, name in (("--end-time", "end_time"), ("--print-interval", "print_interval")):
        if last is None or getattr(last, name) != said.get(name):
            words += [option, repr(said.get(name))]
    if said.get("detector") == "fcl":
        words += ["--detector", "fcl"]
    for option in ("interpret_plugins", "allow_overlap"):
        if said.get(option):
            words.append("--" + option.replace("_", "-"))
    return shlex.join(words)

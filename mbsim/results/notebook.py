"""What a notebook shows of results: a short table and one small curve, as HTML without scripts."""

from __future__ import annotations

import html
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.results.curves import components
from mbsim.results.names import compact
from mbsim.results.quantities import quantity_of
from mbsim.results.units import TIME, UnitSystem

if TYPE_CHECKING:
    from mbsim.results.reading import Results

#: Size of the curve [px], and its most points: of more the extremes of so many intervals are drawn.
_WIDTH, _HEIGHT, _POINTS = 360, 90, 240
#: What the curve is of, the first that there is.
_PREFERRED = ("energy/kinetic",)
#: Most names of signals that are listed.
_LISTED = 12


def summary(results: Results) -> str:
    """Return results as HTML; all that comes from the deck is escaped."""
    if results.closed:
        return f"<pre>{html.escape(repr(results))}</pre>"
    rows = [("run", f"{results.place}, {results.status}")]
    times = results.get("time", np.zeros(0))
    system = UnitSystem.of(results.attributes)
    if len(times):
        unit = system.text(TIME)
        rows.append(("time", f"{times[0]:g} to {times[-1]:g} {unit}, {len(times)} rows"))
    counts = {group: len(results.ids(group)) for group in ("bodies", "joints", "contacts")}
    rows.append(("has", ", ".join(f"{n} {group}" for group, n in counts.items() if n) or "nothing"))
    names = list(compact(results.signals()))
    more = f" and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
    rows.append(("signals", ", ".join(names[:_LISTED]) + more))
    audit = results.audit
    rows += [("warning", text) for text in (audit.warnings if audit is not None else ())]
    lines = "".join(
        f"<tr><th style='text-align:left'>{html.escape(what)}</th>"
        f"<td style='text-align:left'>{html.escape(said)}</td></tr>"
        for what, said in rows
    )
    return f"<div><table>{lines}</table>{_curve(results, times, system)}</div>"


def _curve(results: Results, times: Any, system: UnitSystem) -> str:
    """Return one signal over time as SVG; nothing where a line needs more than there is."""
    signals = results.signals()
    name = next(
        (each for each in (*_PREFERRED, *signals) if each in signals and each != "time"), ""
    )
    if not name or len(times) < 2:
        return ""
    first = components(results, name)[0]
    values = np.asarray(results[first.name], dtype=np.float64)
    low, high = _ends(values)
    if not low <= high:
        return ""
    unit = system.text(quantity_of(results, first.dataset, first.column))
    x = (times - times[0]) / ((times[-1] - times[0]) or 1.0) * _WIDTH
    y = _HEIGHT - 2.0 - (values - low) / ((high - low) or 1.0) * (_HEIGHT - 4.0)
    lines = "".join(
        f"<polyline fill='none' stroke='currentColor' points='{points}'/>"
        for points in _pieces(x, y)
    )
    said = html.escape(f"{first.name}: {low:.4g} to {high:.4g} {unit}".rstrip())
    return (
        f"<svg width='{_WIDTH}' height='{_HEIGHT}' viewBox='0 0 {_WIDTH} {_HEIGHT}' "
        f"role='img' aria-label='{said}'>{lines}</svg><div><small>{said}</small></div>"
    )


def _ends(values: Any) -> tuple[float, float]:
    """Return the least and the largest finite value; (inf, -inf) where there is none."""
    there = values[np.isfinite(values)]
    return (float(there.min()), float(there.max())) if len(there) else (np.inf, -np.inf)


def _pieces(x: Any, y: Any) -> list[str]:
    """Return the points of a line between its gaps, of long ones the extremes of intervals."""
    if len(x) > _POINTS:
        kept = []
        for part in np.array_split(np.arange(len(x)), _POINTS // 2):
            there = part[np.isfinite(y[part])]
            ends = {there[y[there].argmin()], there[y[there].argmax()]} if len(there) else {part[0]}
            kept += sorted(ends)
        x, y = x[kept], y[kept]
    gaps = np.flatnonzero(~np.isfinite(y))
    runs = np.split(np.arange(len(y)), gaps)
    pieces = [[k for k in run if np.isfinite(y[k])] for run in runs]
    return [" ".join(f"{x[k]:.1f},{y[k]:.1f}" for k in piece) for piece in pieces if piece]

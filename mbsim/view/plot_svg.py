"""Curves as SVG, for pages that print well and need no other library."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape
from typing import NamedTuple

import numpy as np

from mbsim.model.elements import Array

#: Of curves in turn; `report.css` has them for light and dark.
COLOURS = 8
_WIDTH, _HEIGHT = 720, 230
_LEFT, _RIGHT, _TOP, _BOTTOM = 66, 12, 12, 36
#: Points of a curve: smallest and largest of so many spans of rows.
_SPANS = 700


class Curve(NamedTuple):
    """A line and what it is called; with `error`, by how much y may be off to either side."""

    name: str
    x: Array
    y: Array
    error: Array | None = None


def ticks(low: float, high: float, count: int = 5) -> list[float]:
    """Return round values from low to high, about so many."""
    span = high - low
    if not (span > 0.0 and math.isfinite(span)):
        return [low]
    power = 10.0 ** math.floor(math.log10(span / count))
    step = next(k * power for k in (1.0, 2.0, 5.0, 10.0) if k * power * count >= span * 0.999)
    first = math.ceil(low / step - 1e-9)
    values = (k * step for k in range(first, first + 3 * count + 2))
    return [0.0 if abs(v) < 1e-9 * span else v for v in values if v <= high + 1e-9 * span]


def drawn(curves: Sequence[Curve], y_axis: str, x_axis: str) -> str:
    """Return an SVG element of curves over a common axis; empty without a finite number."""
    finite = [c.y[np.isfinite(c.y)] for c in curves]
    kept = [y for y in finite if len(y)]
    if not kept:
        return ""
    low, high = float(min(y.min() for y in kept)), float(max(y.max() for y in kept))
    if high - low <= 1e-9 * max(abs(low), abs(high), 1e-300):
        room = 0.1 * abs(high) or 1.0
        low, high = low - room, high + room
    start, end = (float(f([f(c.x) for c in curves])) for f in (min, max))
    if end <= start:
        end = start + 1.0
    wide, tall = _WIDTH - _LEFT - _RIGHT, _HEIGHT - _TOP - _BOTTOM

    def at_x(x: Array) -> Array:
        return _LEFT + wide * (x - start) / (end - start)

    def at_y(y: Array) -> Array:
        return _TOP + tall * (high - y) / (high - low)

    parts = [f'<svg viewBox="0 0 {_WIDTH} {_HEIGHT}" role="img" aria-label="{escape(y_axis)}">']
    for value in ticks(low, high):
        y = float(at_y(np.float64(value)))
        parts.append(f'<path class="grid" d="M{_LEFT} {y:.1f}H{_WIDTH - _RIGHT}"/>')
        parts.append(f'<text x="{_LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{value:.6g}</text>')
    for value in ticks(start, end, 8):
        x, y = float(at_x(np.float64(value))), _TOP + tall
        parts.append(f'<path class="grid" d="M{x:.1f} {y}v4"/>')
        parts.append(f'<text x="{x:.1f}" y="{y + 16}" text-anchor="middle">{value:.6g}</text>')
    parts.append(f'<path class="axis" d="M{_LEFT} {_TOP}V{_TOP + tall}H{_WIDTH - _RIGHT}"/>')
    parts.append(
        f'<text x="{_WIDTH - _RIGHT}" y="{_HEIGHT - 4}" text-anchor="end">{escape(x_axis)}</text>'
    )
    parts.append(
        f'<text transform="translate(12 {_TOP + tall / 2:.0f}) rotate(-90)" text-anchor="middle">'
        f"{escape(y_axis)}</text>"
    )
    for k, curve in enumerate(curves):
        for t, middle, error in _bars(curve):
            above, below = (np.clip(middle + side * error, low, high) for side in (1.0, -1.0))
            points = np.column_stack([at_x(np.r_[t, t[::-1]]), at_y(np.r_[above, below[::-1]])])
            text = " ".join(f"{a:.1f},{b:.1f}" for a, b in points)
            parts.append(f'<polygon class="band b{k % COLOURS}" points="{text}"/>')
        for piece in _pieces(curve):
            points = np.column_stack([at_x(piece[0]), at_y(piece[1])])
            text = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
            parts.append(f'<polyline class="curve c{k % COLOURS}" points="{text}"/>')
    keys = "".join(
        f'<span><i class="c{k % COLOURS}"></i>{escape(curve.name)}</span>'
        for k, curve in enumerate(curves)
    )
    return "".join(parts) + f'</svg><p class="keys">{keys}</p>'


def _bars(curve: Curve) -> list[tuple[Array, Array, Array]]:
    """Return x, y and error of the parts of a curve where both are finite, in few points."""
    if curve.error is None:
        return []
    good = np.isfinite(curve.y) & np.isfinite(curve.error)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], good.astype(np.int8), [0]])))
    found = []
    for first, end in edges.reshape(-1, 2):
        x, y, error = (each[first:end] for each in (curve.x, curve.y, curve.error))
        span = max(1, -(-len(y) // _SPANS))
        rows = np.unique(np.append(np.arange(0, len(y), span), len(y) - 1))
        largest = np.maximum.reduceat(error, np.arange(0, len(y), span))
        wide = np.append(largest, largest[-1])[: len(rows)]
        found.append((x[rows], y[rows], wide))
    return found


def _pieces(curve: Curve) -> list[tuple[Array, Array]]:
    """Return the parts of a curve between numbers that are not finite, in few points."""
    good = np.isfinite(curve.y)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], good.astype(np.int8), [0]])))
    found = []
    for first, end in edges.reshape(-1, 2):
        x, y = curve.x[first:end], curve.y[first:end]
        span = -(-len(y) // _SPANS)
        if span > 2:
            kept = {0, len(y) - 1}
            for at in range(0, len(y), span):
                part = y[at : at + span]
                kept |= {at + int(part.argmin()), at + int(part.argmax())}
            rows = np.array(sorted(kept))
            x, y = x[rows], y[rows]
        found.append((x, y))
    return found

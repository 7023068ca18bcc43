"""Bounds of a curve of cubic pieces over spans of its argument."""

from __future__ import annotations

import numpy as np

from mbsim.expressions.bounds import SMOOTH, Array, Bound, Range, chain, either_range


class Curve:
    """A curve of cubic pieces, as `compile_model.splines` makes them, and its bounds."""

    def __init__(self, piece: Array, order: int) -> None:
        factors = np.array(piece[:, 1:], dtype=np.float64)
        for _ in range(order):
            factors = np.column_stack(
                (factors[:, 1:] * np.arange(1.0, factors.shape[1]), np.zeros(len(factors)))
            )
        self.factors = factors
        # where each piece begins; the first goes on backwards from the first knot
        self.begin = np.array(piece[:, 0])
        self.knots = np.array(piece[1:, 0])
        self.levels = self._levels()
        ends = np.append(self.knots[1:], self.knots[-1]) - self.begin[1:]
        whole = np.zeros(len(ends))
        inner = [self._of_piece(np.arange(1, len(piece)), whole, ends, k) for k in range(3)]
        self.inner = [Range(r.lo[:-1], r.hi[:-1]) for r in inner]

    def _levels(self) -> Array:
        """Return which derivative jumps at each knot."""
        at = np.arange(1, len(self.factors))
        left = np.where(at == 1, 0.0, self.begin[at] - self.begin[at - 1])
        found = np.full(len(at), SMOOTH)
        for k in reversed(range(SMOOTH)):
            one, other = self._point(at - 1, left, k), self._point(at, np.zeros(len(at)), k)
            size = np.max(np.abs(np.concatenate([one, other])))
            found[np.abs(one - other) > 1e-9 * size] = k
        return found

    def _derived(self, rows: Array, order: int) -> Array:
        c = self.factors[rows]
        for _ in range(order):
            c = np.column_stack((c[:, 1:] * np.arange(1.0, c.shape[1]), np.zeros(len(c))))
        return c

    def _point(self, rows: Array, s: Array, order: int) -> Array:
        c = self._derived(rows, order)
        return c[:, 0] + s * (c[:, 1] + s * (c[:, 2] + s * c[:, 3]))

    def _of_piece(self, rows: Array, low: Array, high: Array, order: int) -> Range:
        """Return the bounds of a derivative over a part of a piece: its ends and extremes."""
        c = self._derived(rows, order)
        found = [self._point(rows, s, order) for s in (low, high)]
        # c1 + 2 c2 s + 3 c3 s^2 = 0
        root = np.sqrt(np.maximum(c[:, 2] ** 2 - 3.0 * c[:, 1] * c[:, 3], 0.0))
        with np.errstate(divide="ignore", invalid="ignore"):
            places = [(-c[:, 2] + root) / (3.0 * c[:, 3]), (-c[:, 2] - root) / (3.0 * c[:, 3])]
            places.append(-c[:, 1] / (2.0 * c[:, 2]))
        for s in places:
            inside = np.where(np.isfinite(s), np.clip(s, low, high), low)
            found.append(self._point(rows, inside, order))
        return Range(np.minimum.reduce(found), np.maximum.reduce(found))

    def bound(self, x: Bound) -> Bound:
        """Return the bound of the curve at a bound."""
        shape = np.broadcast(x.value.lo, x.value.hi).shape
        lo, hi = (np.broadcast_to(part, shape).ravel() for part in x.value)
        # the last knot belongs to the piece before it
        first = np.searchsorted(self.knots, lo, "right")
        last = np.searchsorted(self.knots, hi, "left")
        last = np.maximum(last, np.minimum(first, last + 1))
        # a span that begins or ends at a knot has it, or neither of its neighbours may
        first = np.where(lo < hi, np.searchsorted(self.knots, lo, "left"), np.minimum(first, last))
        last = np.where(lo < hi, np.searchsorted(self.knots, hi, "right"), last)
        right = np.where(first == last, hi, self.knots[np.minimum(first, len(self.knots) - 1)])
        left = np.where(first == last, lo, self.begin[last])
        parts = []
        for k in range(3):
            found = either_range(
                self._of_piece(first, lo - self.begin[first], right - self.begin[first], k),
                self._of_piece(last, left - self.begin[last], hi - self.begin[last], k),
            )
            parts.append(self._between(first, last, found, k))
        # knot k lies between pieces k and k + 1
        pairs = np.column_stack((first, np.maximum(last, first + 1))).ravel()
        lowest = np.minimum.reduceat(np.append(self.levels, [SMOOTH, SMOOTH]), pairs)[::2]
        level = np.where(first == last, SMOOTH, lowest)
        value, slope, bend = (Range(r.lo.reshape(shape), r.hi.reshape(shape)) for r in parts)
        return chain(x, value, slope, bend, level.reshape(shape))

    def _between(self, first: Array, last: Array, found: Range, k: int) -> Range:
        """Return the bounds with all whole pieces between the first and the last."""
        many = last - first > 1
        if not many.any():
            return found
        # rows of `inner` are those of pieces from 1 on
        pairs = np.column_stack((first[many], last[many] - 1)).ravel()
        end = len(self.inner[k].lo)
        low, high = (np.append(part, fill) for part, fill in
                     zip(self.inner[k], (np.inf, -np.inf), strict=True))  # fmt: skip
        pairs = np.minimum(pairs, end)
        least, most = np.minimum.reduceat(low, pairs)[::2], np.maximum.reduceat(high, pairs)[::2]
        lo, hi = found.lo.copy(), found.hi.copy()
        lo[many], hi[many] = np.minimum(lo[many], least), np.maximum(hi[many], most)
        return Range(lo, hi)

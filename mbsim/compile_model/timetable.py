"""Where expressions of TIME must be looked at: bounds on the step, and switches to end it at.

A method sees a force at its stages only; a pulse between them leaves no trace in its error
estimate. So time is divided into cells, for each expression (or part of one that looks at TIME
alone) by halving until it holds no more in a cell than samples there show:

* what may be hidden is the largest distance d of the function from the line between the ends of a
  cell of width w: max|g''| w^2/8, or a quarter of w times the range of g', or the range of g, by
  interval arithmetic (`expressions.intervals`), so that nothing is overlooked;
* a cell is good where the first two are small against the range of samples in and near it, or where
  as much in every cell could not change the motion by more than PART tol: of a force over a time T,
  d T / m against V and d w T / m against L;
* a cell with a switch, at which a slope jumps, is no larger than a step whose error is PART tol;
* where a value jumps the halving goes on to rounding: the step ends just before that, and the run
  goes on just behind it.

A step may go as far as the end of the cell behind that in which it begins, if both are alike, else
to the end of its own. Cells are parts 2^k of time itself, so they do not depend on
where a run begins or ends.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mbsim.arrays.codes import CODE_OPERATION
from mbsim.arrays.scene import Scene
from mbsim.compile_model.force_elements import STATEMENT
from mbsim.compile_model.instructions import SPLINE
from mbsim.compile_model.time_functions import GLANCED, PART, Function, functions
from mbsim.core.problem import TIMETABLE_ENDS, TIMETABLE_HORIZON
from mbsim.expressions import bounds, intervals
from mbsim.expressions.bounds import Bound
from mbsim.expressions.curve_bounds import Curve
from mbsim.expressions.elementary import NUMBER, TIME

if TYPE_CHECKING:
    from mbsim.compile_model.build import System

#: Part of what samples of a cell show that may be hidden between them, and of what samples show
#: that reach as far again: then a pulse is as long as the largest gap between stages of a step
#: over two cells, half of it.
HIDDEN, HIDDEN_NEAR = 1.5, 0.3
#: Where samples are taken, in parts of a cell.
SAMPLES = (-0.5, 0.0, 0.5, 1.0, 1.5)
#: Cells whose widths have at most this ratio may be gone through in one step.
ALIKE = 2.0
#: Rows of the table: where each ends, and how far a step may go from it. A switch, over which a
#: run hops, is a row from which no step may go.
ROWS = 4096
#: Cells of one function that are halved at a time.
MOST_CELLS = 2048
#: Where TIME stands beside what is known only when it is reached, a run has so many steps at least.
LOOKS = 100


class _Group:
    """Functions that differ in their numbers alone, so that they are bounded together."""

    def __init__(self, members: Sequence[Function], curves: dict[tuple[int, ...], Any]) -> None:
        self.code, self.curves = members[0].code, curves
        numbers = [k for k, code in enumerate(self.code) if code.op == NUMBER]
        self.numbers = {k: np.array([member.code[k].value for member in members]) for k in numbers}
        self.role = np.array([member.role for member in members])
        self.sizes = np.array([member.sizes for member in members])
        self.known: Any = self.sizes.any(axis=1)
        self.count = len(members)

    def bound(self, member: Any, lo: Any, hi: Any) -> Bound:
        """Return the bounds of members over spans."""
        stack: list[Bound] = []
        for k, (op, rows, _) in enumerate(self.code):
            if op == NUMBER:
                stack.append(bounds.number(self.numbers[k][member]))
            elif op == TIME:
                stack.append(bounds.time(lo, hi))
            elif op == SPLINE:
                stack.pop()
                stack.append(self.curves[rows].bound(stack.pop()))
            else:
                at = len(stack) - rows[0]
                stack[at:] = [intervals.apply(op, stack[at:])]
        (whole,) = stack
        return whole

    def judge(self, member: Any, lo: Any, w: Any, usual: Any, run: tuple[float, bool]) -> Any:
        """Return which cells are good, and which hold a jump.

        `run`: the time over which errors add up, and whether the method estimates its error.
        """
        whole, estimates = run
        n = len(lo)
        with np.errstate(all="ignore"):
            bound = self.bound(member, lo, lo + w)
            at = np.concatenate([lo + part * w for part in SAMPLES])
            points = self.bound(np.tile(member, len(SAMPLES)), at, at).value.lo
        shown = np.broadcast_to(points, at.shape).reshape(len(SAMPLES), n)
        level = np.broadcast_to(bound.level, (n,))
        with np.errstate(all="ignore"):
            span, slopes = bound.value.hi - bound.value.lo, bound.slope.hi - bound.slope.lo
            bend = np.maximum(np.abs(bound.bend.lo), np.abs(bound.bend.hi))
            bent = np.fmin(
                np.where(level >= 1, 0.25 * w * slopes, np.inf),
                np.where(level >= 2, 0.125 * w * w * bend, np.inf),
            )
            hidden = np.fmin(bent, span)
            seen, near = np.ptp(shown[1:-1], axis=0), np.ptp(shown, axis=0)
            s = self.sizes[member].T
            size = hidden * (s[0] / w + s[1] + whole * (s[2] + s[3] * w))
            small = np.where(self.known[member], size <= 1.0, hidden <= usual[member])
            kinked = (level == 1) & (bent * w * (s[2] + s[3] * w) > 1.0)
        broken = level <= np.maximum(self.role[member], 0)
        good = small | (hidden == 0.0)
        if estimates:
            # the range alone does not tell a peak from a step
            shows = (bent <= HIDDEN * seen) & (bent <= HIDDEN_NEAR * near)
            good |= ~broken & ~kinked & shows
        return good, broken

    def usual(self, lo: float, hi: float, tol: float) -> Any:
        """Return what is nothing beside all that each member is between two times."""
        t = np.linspace(lo, hi, 65)
        found = np.zeros(self.count)
        for member in range(self.count):
            with np.errstate(all="ignore"):
                value = self.bound(np.full(65, member), t, t).value.lo + 0.0 * t
                whole = self.bound(np.array([member]), t[:1], t[-1:]).value
            value = value[np.isfinite(value)]
            width = float(np.ravel(whole.hi)[0] - np.ravel(whole.lo)[0])
            if not math.isfinite(width):
                width = float(np.ptp(value)) if len(value) else 0.0
            found[member] = PART * tol * width
        return found


class _Cells(NamedTuple):
    """Cells of a function in order: begin, width, which hold a jump; its role."""

    lo: Any
    w: Any
    jump: Any
    role: int


class Timetable:
    """The bounds of a run's steps by TIME.

    Attributes
    ----------
    timed : bool
        Whether anything follows TIME.
    looks : bool
        Whether a run needs so many steps as `LOOKS` says.
    """

    def __init__(
        self,
        system: System,
        tol: float,
        span: float,
        estimates: bool,
        samples: int,
        shortest: float = 0.0,
    ) -> None:
        """Look at what acts in a system, for a Simulate over a time `span`.

        `estimates` says whether the method estimates its error, `samples` into how many parts of a
        step it must divide what others see in one, and `shortest` what no step is below [T].
        """
        scene, self.run = system.scene, (span, estimates)
        self.shortest = shortest
        found, blind = functions(scene, tol if estimates else 0.1 * tol)
        self.looks = blind or asks_time(system)
        self.tol, self.samples = tol, samples
        groups: dict[Any, list[Function]] = {}
        curves: dict[tuple[int, ...], Any] = {}
        for function in found:
            for code in function.code:
                if code.op == SPLINE:
                    first, _, order = code.rows
                    ends = scene.programs.curve[first : first + 2]
                    curves[code.rows] = Curve(scene.programs.piece[ends[0] : ends[1]], order)
            key = tuple((code.op, code.rows) for code in function.code)
            groups.setdefault(key, []).append(function)
        self.groups = [_Group(members, curves) for members in groups.values()]
        self.timed = bool(self.groups)

    @property
    def longest(self) -> float:
        """The longest step where pulses may be missed."""
        return self.run[0] / LOOKS if self.looks else math.inf

    def write(self, table: Any, t: float, end: float) -> None:
        """Write the rows from time t on, as far as they go, at most up to `end`.

        How long the rows before were says with how coarse cells to begin.
        """
        top = 2.0 ** math.ceil(math.log2(max(end - t, 1e-300)))
        before = table[np.isfinite(table[:, TIMETABLE_ENDS]), TIMETABLE_ENDS]
        if len(before) > 1:
            usual = 4.0 * (before[-1] - before[0]) / (len(before) - 1)
            top = min(top, 2.0 ** math.ceil(math.log2(usual)))
        horizon, cells = min(end, t + 0.5 * MOST_CELLS * top), list[_Cells]()
        for group in self.groups:
            horizon, made = self._divide(group, t, horizon, end, top)
            cells += made
        rows, horizon = self._rows(cells, t, horizon, end)
        table[...] = -math.inf
        table[: len(rows)] = rows
        if horizon >= end:
            table[len(rows) - 1, TIMETABLE_ENDS] = math.inf
            if table[len(rows) - 1, TIMETABLE_HORIZON] >= end:
                table[len(rows) - 1, TIMETABLE_HORIZON] = math.inf

    def _divide(
        self, group: _Group, t: float, horizon: float, end: float, top: float
    ) -> tuple[float, list[_Cells]]:
        """Return the time up to which the cells of a group go, and those of each member."""
        first = math.floor(t / top) * top
        begins = np.arange(first, horizon, top)
        usual = group.usual(first, float(begins[-1]) + top, self.tol)
        member = np.repeat(np.arange(group.count), len(begins))
        lo, w, most = np.tile(begins, group.count), top, max(MOST_CELLS, 8 * group.count)
        known = np.zeros(len(lo), dtype=bool)
        kept: list[tuple[Any, Any, Any, Any]] = []
        while len(lo):
            good, broken = group.judge(member, lo, np.full(len(lo), w), usual, self.run)
            # a jump that counts in a long step is found to rounding
            good &= ~(broken & known)
            # two cells are no longer than any step, so that smaller ones would bound none
            good |= ~broken & (2.0 * w <= self.shortest)
            done = good | (w <= _least(lo + w, end))
            kept.append((member[done], lo[done], np.full(done.sum(), w), (broken & ~good)[done]))
            w *= 0.5
            member, known = np.repeat(member[~done], 2), np.repeat(broken[~done], 2)
            lo = (lo[~done][:, None] + np.array([0.0, w])).ravel()
            inside = (lo + w > t) & (lo < horizon)
            if np.count_nonzero(inside) > most:
                # those that come first come first
                horizon = min(horizon, float(np.sort(lo[inside])[most]))
                inside &= lo < horizon
            member, lo, known = member[inside], lo[inside], known[inside]
        members, begin, width, jump = (np.concatenate(column) for column in zip(*kept, strict=True))
        inside = (begin < horizon) & (begin + width > t)
        order = np.lexsort((begin[inside], members[inside]))
        found = (column[inside][order] for column in (members, begin, width, jump))
        members, begin, width, jump = self._merge(group, usual, *found)
        made = []
        for k in range(group.count):
            mine = members == k
            made.append(_Cells(begin[mine], width[mine], jump[mine], int(group.role[k])))
        return horizon, made

    def _merge(self, group: _Group, usual: Any, *cells: Any) -> Any:
        """Return cells with neighbours put together where that is good too."""
        member, lo, w, jump = cells
        idle, first = 0, 0
        while idle < 2 and len(lo) > 1:
            i = np.arange(first, len(lo) - 1, 2)
            i = i[(member[i] == member[i + 1]) & ~jump[i] & ~jump[i + 1]]
            i = i[lo[i] + w[i] == lo[i + 1]]
            both = lo[i + 1] + w[i + 1] - lo[i]
            good, broken = group.judge(member[i], lo[i], both, usual, self.run)
            i, both = i[good & ~broken], both[good & ~broken]
            w = w.copy()
            w[i] = both
            stays = np.ones(len(lo), dtype=bool)
            stays[i + 1] = False
            member, lo, w, jump = member[stays], lo[stays], w[stays], jump[stays]
            idle = 0 if len(i) else idle + 1
            first = 1 - first
        return member, lo, w, jump

    def _rows(self, cells: list[_Cells], t: float, horizon: float, end: float) -> tuple[Any, float]:
        """Return the rows of the table, and the time up to which they go."""
        moving = [np.column_stack((c.lo, c.lo + c.w))[c.jump] for c in cells if c.role >= 0]
        jumps = np.concatenate([np.zeros((0, 2)), *moving])
        jumps = jumps[np.argsort(jumps[:, 0])]
        stops: list[list[float]] = []
        for a_jump, behind in jumps:
            # a stage at the end of a step may round to behind it; sines of a run round otherwise
            least = float(_least(behind, end))
            before, behind = float(a_jump) - 0.5 * least, float(behind) + 0.5 * least
            if stops and before <= stops[-1][1] + least:
                stops[-1][1] = behind
            else:
                stops.append([before, behind])
        ends, reaches = [], []
        for c in cells:
            lo, w = c.lo[~c.jump], c.w[~c.jump]
            if c.role < 0 and c.jump.any():
                behind = np.append((c.lo + c.w)[c.jump], math.inf if horizon >= end else horizon)
                lo, far = np.append(t, behind[:-1]), behind
                if c.role == GLANCED:
                    # up to the next but one
                    far = np.append(c.lo[c.jump][1:], [behind[-1], behind[-1]])
                ends.append(behind[:-1])
                reaches.append((lo, far))
                continue
            if self.samples > 1:
                parts_of = np.arange(self.samples) / self.samples
                lo = (lo[:, None] + w[:, None] * parts_of).ravel()
                w = np.repeat(w, self.samples) / self.samples
            if not len(lo):
                continue
            hi = lo + w
            reach = hi.copy()
            alike = (w[1:] <= ALIKE * w[:-1]) & (w[:-1] <= ALIKE * w[1:])
            reach[:-1] = np.where((hi[:-1] == lo[1:]) & alike, hi[1:], hi[:-1])
            if horizon >= end:
                reach[-1] = math.inf
            ends.append(hi)
            reaches.append((lo, reach))
        edges = np.unique(np.concatenate([*ends, *stops, [horizon]]))
        edges = edges[(edges > t) & (edges <= horizon)]
        if len(edges) > ROWS:
            edges = edges[:ROWS]
            horizon = float(edges[-1])
        begins = np.concatenate([[t], edges[:-1]])
        reach = np.full(len(edges), math.inf)
        for lo, far in reaches:
            at = np.maximum(np.searchsorted(lo, begins, "right") - 1, 0)
            reach = np.minimum(reach, far[at])
        reach = np.maximum(reach, edges)
        for before, behind in stops:
            ahead = begins < before
            reach[ahead] = np.minimum(reach[ahead], before)
            reach[(begins >= before) & (begins < behind)] = -math.inf
        return np.column_stack((edges, reach)), horizon


def _least(t: Any, end: float) -> Any:
    """Return the least width of cells at time t: two to four roundings of it."""
    return 4.4e-16 * np.maximum(np.abs(t), 1e-3 * abs(end))


def follows_time(scene: Scene) -> bool:
    """Return whether an expression names TIME."""
    return bool(np.any(scene.programs.code[:, CODE_OPERATION] == TIME))


def asks_time(system: System) -> bool:
    """Return whether a user's function may look at the time."""
    if any(name[0] != STATEMENT and user.acts for name, user in system.subroutines.items()):
        return True
    return any(user.reads_time for _, user in system.user_laws)

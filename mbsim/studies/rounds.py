"""Runs that several fits ask for: all that they wait for is one round, shared among workers."""

from __future__ import annotations

import queue
import threading
from collections import Counter
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np

from mbsim.errors import Interrupted
from mbsim.studies.distributions import Numbers
from mbsim.studies.records import TIME
from mbsim.studies.stopping import number_of
from mbsim.studies.worker import FAILED, WARNED, Pool, PoolLost, Row

if TYPE_CHECKING:
    from mbsim.studies.problem import Problem

T = TypeVar("T")
#: Called with how many runs were made.
Progress = Callable[[int], None]


class Stopped(Exception):
    """The user has stopped the fit: what is asked for will not be run."""


class Slopes(NamedTuple):
    """Derivatives of the curves of a run by attributes of the deck.

    Attributes
    ----------
    columns : dict
        Attribute -> derivatives at all measured times, (rows,); only where all are known.
    evaluations : int
        Of the run itself.
    along : dict
        Attribute -> evaluations that its derivatives took beside.
    why : str
        Why there are none.
    """

    columns: dict[str, Numbers]
    evaluations: int
    along: dict[str, int]
    why: str


class _Point(NamedTuple):
    """Where a run is asked for, and by which attributes it is derived."""

    z: Numbers
    sensitivity: tuple[str, ...] = ()

    @property
    def key(self) -> tuple[bytes, tuple[str, ...]]:
        """What tells it from others."""
        return self.z.tobytes(), self.sensitivity


class _Request(NamedTuple):
    """Points that a fit waits for, and where it does."""

    fit: int
    points: Sequence[_Point]
    answer: queue.Queue[list[Any] | None]


class Asking:
    """What a fit asks for runs by, from its thread."""

    def __init__(self, ask: Callable[[Sequence[_Point]], list[Any]]) -> None:
        self._ask = ask

    def __call__(self, points: Sequence[Numbers]) -> list[Numbers | None]:
        """Return the curves at points, None where a run failed."""
        return self._ask([_Point(z) for z in points])

    def slopes(self, z: Numbers, asked: Sequence[tuple[str, ...]]) -> list[Slopes]:
        """Return derivatives at a point, a run for each tuple of attributes."""
        return self._ask([_Point(z, sensitivity) for sensitivity in asked])


class Rounds:
    """Runs a problem for fits that are each in a thread of their own.

    Which runs there are does not depend on the workers, nor on which is done first.

    Attributes
    ----------
    runs : int
        How many there were.
    reasons : Counter
        Why runs failed.
    warnings : Counter
        Of what runs warned.
    stopped : bool
        Whether Ctrl-C came, or nobody runs them any more.
    signal : int
        The number of the signal, 0: nobody runs them any more.
    notes : list of str
        What is to be said of how far output rows are apart; from the first run on.
    """

    def __init__(self, problem: Problem, pool: Pool, progress: Progress | None = None) -> None:
        self._problem, self._pool, self._progress = problem, pool, progress
        self._requests: queue.Queue[_Request | None] = queue.Queue()
        self._known: dict[tuple[bytes, tuple[str, ...]], Any] = {}
        self.runs = 0
        self.reasons: Counter[str] = Counter()
        self.warnings: Counter[str] = Counter()
        self.stopped, self.signal = False, 2
        self.notes: list[str] = []
        self._looked_at = False

    def drive(self, fits: Sequence[Callable[[Asking], T]]) -> list[T | Exception]:
        """Return what each fit returns, or the exception that it raised; they run side by side.

        Parameters
        ----------
        fits : sequence of callable
            Called with what runs points: a function of points of the unit cube that returns the
            curves of each, None where the run failed, and raises `Stopped`.
        """
        found: list[T | Exception] = [Stopped()] * len(fits)

        def work(place: int) -> None:
            try:
                found[place] = fits[place](Asking(lambda points: self._ask(place, points)))
            except Exception as error:
                found[place] = error
            finally:
                self._requests.put(None)

        threads = [
            threading.Thread(target=work, args=(place,), daemon=True) for place in range(len(fits))
        ]
        for thread in threads:
            thread.start()
        self._serve(len(threads))
        for thread in threads:
            thread.join()
        return found

    def _ask(self, fit: int, points: Sequence[_Point]) -> list[Any]:
        """Return what is known at points, from the thread of a fit."""
        if self.stopped:
            raise Stopped
        answer: queue.Queue[list[Any] | None] = queue.Queue()
        self._requests.put(_Request(fit, points, answer))
        curves = answer.get()
        if curves is None:
            raise Stopped
        return curves

    def _serve(self, live: int) -> None:
        """Run what fits ask for until all have ended."""
        waiting: list[_Request] = []
        while live:
            try:
                while len(waiting) < live:
                    request = self._requests.get()
                    if request is None:
                        live -= 1
                    else:
                        waiting.append(request)
                if not self.stopped:
                    # in the same order whichever came first
                    self._run([p for r in sorted(waiting, key=lambda r: r.fit) for p in r.points])
            except (KeyboardInterrupt, Interrupted) as error:
                self.stopped, self.signal = True, number_of(error)
            except PoolLost as error:
                self.stopped, self.signal = True, 0
                self.notes.append(str(error))
            for request in waiting:
                known = [self._known.get(point.key) for point in request.points]
                request.answer.put(None if self.stopped else known)
            waiting = []

    def _run(self, points: Sequence[_Point]) -> None:
        """Run points that were not run before."""
        new = list({p.key: p for p in points if p.key not in self._known}.values())
        cases = [self._problem.case(self.runs + k, *point) for k, point in enumerate(new)]
        first = self.runs
        for row in self._pool.share(cases, len(cases)):
            point = new[row.run - first]
            found = self._slopes(row, point) if point.sensitivity else self._curves(row, point.z)
            self._known[point.key] = found
            self.runs += 1
            if self._progress is not None:
                self._progress(self.runs)

    def _slopes(self, row: Row, point: _Point) -> Slopes:
        """Return the derivatives of a run at the measured times."""
        if row.slopes is None:
            return Slopes({}, row.evaluations, {}, row.reason)
        columns, whys = {}, []
        for path, about in row.slopes.items():
            whys.append(about["why"])
            if len(about["curves"]) == len(self._problem.records):
                of_time = {TIME: row.outputs[TIME], **about["curves"]}
                column = self._problem.curves(_known_rows(of_time), point.z)
                if column is not None:
                    columns[path] = column
        along = {path: about["evaluations"] for path, about in row.slopes.items()}
        return Slopes(columns, row.evaluations, along, "; ".join(filter(None, whys)))

    def _curves(self, row: Row, point: Numbers) -> Numbers | None:
        """Return what a run gives at the measured times, noting why there is nothing."""
        if row.status == FAILED:
            self.reasons[row.reason] += 1
            return None
        if row.status == WARNED:
            self.warnings[row.reason] += 1
        curves = self._problem.curves(row.outputs, point)
        if curves is None:
            self.reasons["the run ends before the record, or is not finite"] += 1
        elif not self._looked_at:
            self._looked_at = True
            self.notes = self._problem.too_coarse(row.outputs, point)
        return curves


def _known_rows(curves: dict[str, list[float]]) -> dict[str, Numbers]:
    """Return the rows up to the first in which one of the curves is unknown."""
    table = np.array(list(curves.values()))
    unknown = np.flatnonzero(~np.all(np.isfinite(table), axis=0))
    until = int(unknown[0]) if len(unknown) else table.shape[1]
    return dict(zip(curves, table[:, :until], strict=True))


#: What a fit runs points by, see `Rounds.drive`.
Ask = Callable[[Sequence[Numbers]], "list[Numbers | None]"]

"""Workers on this machine: processes with a pipe each; one that dies loses no run.

A worker sends every row as it comes, so that it is known which run it died in.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from multiprocessing.connection import Connection, wait
from typing import TYPE_CHECKING, Any

from mbsim.errors import Interrupted
from mbsim.studies.worker import Row, failed, run_one

if TYPE_CHECKING:
    from mbsim.studies.study import Case, Study

#: How often a run is tried whose worker dies in it.
MOST_TRIES = 3
#: Most runs that a worker is handed at once, and how often at least it comes back for more.
MOST_AT_ONCE, COMES_BACK = 50, 8


def serve(connection: Connection, study: Study) -> None:
    """Run what is sent, and send the rows: what a worker's process does."""
    with contextlib.suppress(AttributeError, OSError):
        os.setsid()  # Ctrl-C is for the process that started this one, which then closes the pipe
    with contextlib.suppress(EOFError, OSError, Interrupted):
        while True:
            for case in connection.recv():
                connection.send(run_one(study, case))


class _Worker:
    """A process, its pipe, and the runs that it has not sent a row of, in order, by number."""

    def __init__(self, study: Study) -> None:
        context = multiprocessing.get_context("spawn")
        self.connection, other = context.Pipe()
        self.process = context.Process(target=serve, args=(other, study), daemon=True)
        self.process.start()
        other.close()  # so that its end is felt here
        self.runs: dict[int, Case] = {}

    def give(self, cases: list[Case]) -> None:
        """Hand over runs."""
        self.runs.update((case.run, case) for case in cases)
        with contextlib.suppress(OSError):  # it has died: felt when it is read from
            self.connection.send(cases)

    def end(self) -> None:
        """Let the process end, at once."""
        self.connection.close()
        self.process.terminate()
        self.process.join(5.0)
        if self.process.is_alive():
            self.process.kill()
            self.process.join()


class Workers:
    """Several processes that share a study's runs.

    Attributes
    ----------
    died : int
        How many workers have, so far.
    """

    def __init__(self, study: Study, count: int) -> None:
        self._study, self._count = study, count
        # those that come, those of them that had been handed out, and how many there are of both
        self._coming: Iterator[Case] = iter(())
        self._back: deque[Case] = deque()
        self._left = 0
        self._loaded = False  # whether a worker has sent a row
        self._workers: list[_Worker] = []
        self._tries: dict[int, int] = {}
        self.died = 0

    def rows(self, runs: Sequence[int]) -> Iterator[Row]:
        """Yield the row of every run as it comes, and let the processes end."""
        try:
            yield from self.share(map(self._study.case, runs), len(runs))
        finally:
            self.close()

    def share(self, cases: Iterable[Case], count: int) -> Iterator[Row]:
        """Yield the row of each of `count` runs as it comes; processes stay for more.

        The very first run is alone, so that what the others load is compiled once.
        """
        self._coming, self._left = iter(cases), count
        most = 0
        while self._left or any(worker.runs for worker in self._workers):
            if self._loaded and not most:
                most = max(1, min(MOST_AT_ONCE, self._left // (COMES_BACK * self._count)))
            wanted = min(self._count, self._left) if self._loaded else 1
            self._workers += [_Worker(self._study) for _ in range(wanted - len(self._workers))]
            self._hand_out(most or 1)
            busy = [worker for worker in self._workers if worker.runs]
            ready = wait([worker.connection for worker in busy])
            for worker in busy:
                row = self._take(worker) if worker.connection in ready else None
                if row is not None:
                    self._loaded = True
                    yield row

    def close(self) -> None:
        """Let all processes end, at once."""
        for worker in self._workers:
            worker.end()
        self._workers = []

    def _hand_out(self, most: int) -> None:
        """Give workers without runs some of those that wait."""
        for worker in self._workers:
            if not worker.runs and self._left:
                size = min(most, self._left)
                self._left -= size
                worker.give([self._next() for _ in range(size)])

    def _next(self) -> Case:
        """Return the next run that waits."""
        return self._back.popleft() if self._back else next(self._coming)

    def _take(self, worker: _Worker) -> Row | None:
        """Return a row that a worker has sent; where it has died, one if that is the last word."""
        try:
            row: Any = worker.connection.recv()
        except (EOFError, OSError):
            return self._lost(worker)
        del worker.runs[row.run]
        return Row(*row)

    def _lost(self, worker: _Worker) -> Row | None:
        """Start another worker in the place of one that died, and give its runs back."""
        worker.process.join(5.0)
        code = worker.process.exitcode
        worker.end()
        self.died += 1
        self._workers[self._workers.index(worker)] = _Worker(self._study)
        in_hand, *others = worker.runs.values()
        tries = self._tries[in_hand.run] = self._tries.get(in_hand.run, 0) + 1
        self._return(others)
        if tries >= MOST_TRIES:
            return failed(
                in_hand.run, f"its process died {tries} times, exit code {code}", lost=True
            )
        self._return([in_hand])
        return None

    def _return(self, cases: list[Case]) -> None:
        """Let runs that were handed out be the next ones."""
        self._back.extendleft(reversed(cases))
        self._left += len(cases)

"""Processes that run cases; one that does not answer is ended, and its case with it."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import tempfile
import time
from collections.abc import Iterator, Sequence
from multiprocessing.connection import Connection, wait
from pathlib import Path

from mbsim.bench.stress import Asked, chosen
from mbsim.bench.stress.case import Case
from mbsim.bench.stress.judge import HANG, TRACEBACK, Verdict, judge, verdict

#: A process whose run cannot be stopped is ended after so many times its limit of CPU time: the
#: machine may be busy with other things.
PATIENCE = 10.0


def _serve(connection: Connection, asked: Asked, limit: float) -> None:
    """Run the cases whose numbers come, and send their verdicts: what a process does."""
    with contextlib.suppress(AttributeError, OSError):
        os.setsid()  # Ctrl-C is for the process that started this one
    cases = chosen(asked)
    with contextlib.suppress(EOFError, OSError, KeyboardInterrupt):
        while True:
            case = cases[connection.recv()]
            with tempfile.TemporaryDirectory(prefix="mbsim-stress-") as folder:
                connection.send(tuple(judge(case, Path(folder), limit)))


class _Worker:
    """A process, its pipe, and the number of the case that it runs, since when."""

    def __init__(self, asked: Asked, limit: float) -> None:
        context = multiprocessing.get_context("spawn")
        self.connection, other = context.Pipe()
        self.process = context.Process(target=_serve, args=(other, asked, limit), daemon=True)
        self.process.start()
        other.close()
        self.case: int | None = None
        self.since = 0.0

    def give(self, case: int) -> None:
        """Hand over a case."""
        self.case, self.since = case, time.monotonic()
        with contextlib.suppress(OSError):  # it has died: felt when it is read from
            self.connection.send(case)

    def end(self) -> None:
        """Let the process end, at once."""
        self.connection.close()
        self.process.kill()
        self.process.join()


def verdicts(cases: Sequence[Case], asked: Asked, count: int, limit: float) -> Iterator[Verdict]:
    """Yield the verdict of each case as it comes, from `count` processes.

    Parameters
    ----------
    cases
        Those of `chosen(asked)`.
    asked
        What `chosen` was asked for: a process makes the cases anew.
    count
        Processes. The first case is run alone, so that what the others load is compiled once.
    limit
        CPU time of a run, s.
    """
    numbers = iter(range(len(cases)))
    workers = [_Worker(asked, limit)]
    try:
        workers[0].give(next(numbers))
        while any(worker.case is not None for worker in workers):
            busy = [worker for worker in workers if worker.case is not None]
            ready = wait([worker.connection for worker in busy], timeout=1.0)
            for worker in busy:
                found = None
                if worker.connection in ready:
                    found = _answer(worker, cases)
                elif time.monotonic() - worker.since > PATIENCE * limit:
                    found = _given_up(worker, cases, HANG, "could not be stopped")
                if found is None:
                    continue
                yield found
                if worker.process.exitcode is not None or worker.connection.closed:
                    workers[workers.index(worker)] = _Worker(asked, limit)
            while len(workers) < count:
                workers.append(_Worker(asked, limit))
            for worker in workers:
                if worker.case is None and (number := next(numbers, None)) is not None:
                    worker.give(number)
    finally:
        for worker in workers:
            worker.end()


def _answer(worker: _Worker, cases: Sequence[Case]) -> Verdict:
    """Return what a process has sent, or that it has died."""
    try:
        found = Verdict(*worker.connection.recv())
    except (EOFError, OSError):
        worker.process.join(5.0)
        return _given_up(
            worker, cases, TRACEBACK, f"its process died, exit code {worker.process.exitcode}"
        )
    worker.case = None
    return found


def _given_up(worker: _Worker, cases: Sequence[Case], ended: str, reason: str) -> Verdict:
    """End a process, and return the verdict of its case."""
    number, worker.case = worker.case or 0, None
    worker.end()
    return verdict(cases[number], ended, reason, seconds=time.monotonic() - worker.since)

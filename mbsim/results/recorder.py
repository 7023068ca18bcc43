"""`Recorder`: output rows of the compiled pipeline become the signals of a result file."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from mbsim.core import profile
from mbsim.errors import ResultsError
from mbsim.results import room, signals
from mbsim.results.audit import Audit, to_attributes
from mbsim.results.background import Background
from mbsim.results.blocks import (
    Block,
    Gathered,
    Mark,
    Table,
    Tables,
    first_rows,
    nothing,
    row_bytes,
)
from mbsim.results.chunks import LONG
from mbsim.results.csv_file import write_csv
from mbsim.results.elements import acting
from mbsim.results.files import prepare_directory
from mbsim.results.forces import check_requests
from mbsim.results.identity import Identity
from mbsim.results.memory import MemoryStore
from mbsim.results.reading import Results, open_results
from mbsim.results.resume import MADE_OF, WRITTEN, digest, read_checkpoint
from mbsim.results.signal_filter import SignalFilter
from mbsim.results.store import Store, Value
from mbsim.results.watch import Watch

if TYPE_CHECKING:
    from mbsim.compile_model.build import System
    from mbsim.results.contact_posts import ContactPosts

#: Rows are kept in memory up to about this size [bytes], then written to the part file.
BUFFER_BYTES = 32 << 20
#: At least so many output rows are written at once: chunks of fewer are read slowly.
FEWEST_ROWS = 16
#: Time between two publications: at least this [s], and so many times what one takes.
FLUSH_SECONDS = 5.0
FLUSH_SHARE = 50.0
#: The first comes sooner, so that a folder soon shows this run and not an earlier one.
FIRST_FLUSH_SECONDS = 1.0


class Recorder:
    """Takes rows away from a running system and keeps them, in files or in memory.

    Parameters
    ----------
    system : System
        Its `scene.rows` are emptied by `take`.
    attributes : mapping
        Attributes of the result file: version, model, units, settings.
    directory : Path or None
        Where ``<model>.h5`` and ``.csv`` go; None keeps everything in memory.
    resume : bool
        Go on from the checkpoint in that folder, then in `checkpoint`.
    how : dataclass, optional
        `Settings` of the run, which those of a resumed one must equal.
    asked : sequence of str
        What to record, see `SignalFilter`; nothing stands for everything.
    bare : bool
        Of results in memory: leave out what the run is made of, and what only pictures need.

    Raises
    ------
    ResultsError
        If results cannot be written there, or another run is writing there.
    ModelError
        If there is nothing to resume, or it was run with another model or other settings.
    """

    def __init__(
        self,
        system: System,
        attributes: Mapping[str, Value],
        directory: Path | None,
        resume: bool = False,
        how: Any = None,
        asked: Sequence[str] = (),
        bare: bool = False,
    ) -> None:
        self.system, self._bare = system, bare and directory is None
        self.asked, self._asked = asked, SignalFilter(asked)
        self._identity, self.directory = Identity(system, how), directory
        self.checkpoint: dict[str, Table] = {}
        self._watch = Watch(acting(system))
        self._watched = 0  # of the rows gathered, how many it has looked at
        #: How many output rows are written at once, a power of two: chunks end where they do.
        self._block, size = FEWEST_ROWS, row_bytes(system)
        while 4 * self._block * size <= BUFFER_BYTES:
            self._block *= 2
        self._most = max(BUFFER_BYTES, 4 * self._block * size)
        self._gathered = Gathered(system, self._block, self._block >= LONG)
        self._background = Background()
        self._free: Tables = {}  # those of the rows that are written in the background
        self._mark: Mark | None = None
        self._written = [0, 0, 0]  # output rows, incidents and events in the file so far
        self._given = 0  # output rows in the file, or on their way there
        self._started = False  # whether state/incident_offsets has its first 0
        self._published_at = time.monotonic() - (FLUSH_SECONDS - FIRST_FLUSH_SECONDS)
        self._flush_seconds = 0.0  # what the last flush took
        self._flushing = False
        #: How many flushes there were.
        self.flushes = 0
        self._target: Path | None = None
        self._saved: set[str] = set()  # tables of the checkpoint in the part file
        self._last: dict[str, Table] = {}  # those of the last published one
        self._posts: ContactPosts | None = None
        if system.posts:
            from mbsim.results.contact_posts import ContactPosts

            self._posts = ContactPosts(system, system.posts)
        check_requests(system.model)
        if asked:
            self._asked.check(signals.names_of(system))
        self._settings: dict[str, Value] = {**attributes}
        if directory is not None:
            self._settings |= self._identity.digests
            prepare_directory(directory, system.model.name)
            self._target = directory / f"{system.model.name}.h5"
        #: Whether the folder shows this run; whether it showed another one before.
        self.shown = False
        self.earlier = self._target is not None and not resume and self._target.exists()
        if resume:
            self.checkpoint = self._resumed()
        self._given = self._written[0]
        about = None if self._bare or directory is not None else self._identity.settled()
        self._store = MemoryStore(about) if self._target is None else Store(self._target, resume)
        self._store.rows_at_once = self._block
        self._begin_file(resume)

    def _begin_file(self, resume: bool) -> None:
        """Write what a file says without rows."""
        if resume:
            # what a run that ended outside its loop has recorded since is recorded again
            self._store.shorten(partial(signals.length_of, self._written))
        shown = not self._bare
        new = (
            signals.Before({}, {}, {})
            if resume
            else signals.before_rows(self.system, self._asked, shown)
        )
        new.attributes["/"] = {**self._settings, "status": "running"}
        self._store.update(**new._asdict(), remove=["stats", "audit"])

    def _resumed(self) -> dict[str, Table]:
        """Return the checkpoint to go on from, after comparing what it was made with."""
        tables = read_checkpoint(self._target, self._settings, self._identity)
        self._started = self.shown = True
        self._saved, self._last = set(tables), dict(tables)
        tables.pop(MADE_OF, None)
        self._written = tables.pop(WRITTEN).tolist()
        self.watch.restore(tables)
        return tables

    def check_room(self, rows: float) -> None:
        """Make ready for so many output rows; raise `ModelError` where they cannot be kept.

        `rows` is a float: of a mistyped end time there may be more than integers count.
        """
        self._store.rows = int(min(rows, 1e9)) + 1
        rows = max(0.0, rows - self._written[0])  # those of a run that goes on are there
        self._gathered.expected = int(min(rows, self._block))
        requests = len(self.system.model.requests)
        at_most = 4 * row_bytes(self.system) + room.REQUEST_BYTES * requests + room.TIME_BYTES
        disk = None if self._target is None else (self.directory, self._store.room())
        room.check(rows, at_most, self._signal_bytes, disk)

    def _signal_bytes(self) -> int:
        """Return how large a row of all signals is."""
        tables = (table for _, table in self._signals(nothing(self.system)))
        return sum(table.itemsize * math.prod(table.shape[1:]) for table in tables)

    def take(self) -> None:
        """Take all rows, incidents and events that the pipeline has left so far."""
        self._background.check()
        rows = self.system.scene.rows
        n, incidents, events = rows.used.tolist()
        if n == incidents == events == 0:
            return
        block = self._gathered.take(n, incidents, events)
        rows.used[:] = 0
        if self._posts is not None:
            self._posts.take(block.time, block.contact, block.incident_count, block.incidents)
        # the same rows at once, however often the loop comes back
        while self._gathered.rows >= (wanted := self._block - self._given % self._block):
            self._hand_over(wanted)
        if self._gathered.bytes > self._most:  # points of contact
            self._hand_over(self._gathered.rows)

    def add(self, block: Block) -> None:
        """Write rows that somebody else has taken; those of the system are left alone."""
        self._look(block, 0)
        self._put(block, last=True)

    def mark(self) -> None:
        """Remember what there is: until `settle`, `go_back` may drop what is taken from here on."""
        self._background.wait()
        rows = self._gathered.copied()
        written = list(self._written)
        self._mark = Mark(rows, written, self._given, self._started, self.watch.saved())

    def settle(self) -> None:
        """Let the rows taken since `mark` be those of the run."""
        self._mark = None

    def go_back(self) -> None:
        """Drop the rows taken since `mark`, and those that wait to be taken."""
        mark, self._mark = self._mark, None
        self.system.scene.rows.used[:] = 0
        if mark is None:
            return
        self._background.wait()
        given, self._given = self._given, mark.given
        self._written, self._started = mark.written, mark.started
        self._gathered.restore(mark.rows)
        self._watched = len(mark.rows.time)
        self._watch.restore(dict(mark.watch))
        if given != mark.given and not self._store.broken:
            resume = bool(self.checkpoint)
            self._store.begin_anew(resume)
            self._begin_file(resume)

    def end(self) -> None:
        """Tell the users' CONTACTPOSTs that the run has reached its end."""
        if self._posts is not None:
            self._posts.end()

    def due(self) -> bool:
        """Return whether it is time for a flush: they cost a fiftieth of the run at most."""
        pause = max(FLUSH_SECONDS, FLUSH_SHARE * self._flush_seconds)
        passed = time.monotonic() - self._published_at
        return self._target is not None and not self._flushing and passed > pause

    def flush(self, checkpoint: Mapping[str, Table], beside: bool = False) -> None:
        """Publish all rows taken so far together with the checkpoint that follows them.

        Parameters
        ----------
        checkpoint : mapping of str to ndarray
            Full state after the last row taken, by names that may hold "/".
        beside : bool
            Return at once: `take` raises what fails, and `flushes` counts when it is done.

        Raises
        ------
        ResultsError
            If the disk is full or the folder cannot be written any more.
        """
        if self._target is None:
            return
        watched = self.watch.saved()
        self._flushing = True
        work = partial(self._flush, self._gathered.block, checkpoint, watched)
        if beside:
            self._background.begin(work)
        else:
            work()

    def _flush(self, block: Block, checkpoint: Mapping[str, Table], watched: Tables) -> None:
        """Publish a block of rows, which are still gathered behind, and a checkpoint."""
        began = time.perf_counter()
        before = self._written, self._saved, self._started
        with self._store.writing():
            self._store.mark()
            self._put(block)
            self._save(self._state(checkpoint, watched))
            self._show()
            self._store.publish()
        self._written, self._saved, self._started = before
        self._published_at = time.monotonic()
        self._flush_seconds = time.perf_counter() - began
        self._flushing, self.flushes = False, self.flushes + 1

    def _state(self, checkpoint: Mapping[str, Table], watched: Tables) -> dict[str, Table]:
        """Return all tables of a checkpoint made behind the last row written."""
        facts = {MADE_OF: self._identity.packed, WRITTEN: np.array(self._written)}
        return {**checkpoint, **watched, **facts}

    def _save(self, tables: dict[str, Table]) -> None:
        """Write a checkpoint in the place of the last one."""
        self._last = tables
        self._store.update(
            values={f"checkpoint/{name}": table for name, table in tables.items()},
            attributes={"checkpoint": {"sha256": digest(tables)}},
            remove=[f"checkpoint/{name}" for name in self._saved - tables.keys()],
        )
        self._saved = set(tables)

    def _show(self) -> None:
        """Take away what an earlier run has left beside the file that is about to be replaced."""
        if self.shown or self._target is None or self._store.broken:
            return
        self.shown = True
        for suffix in (".csv", ".log"):
            with contextlib.suppress(OSError):
                self._target.with_suffix(suffix).unlink()

    @property
    def watch(self) -> Watch:
        """What the log says of all rows, those before a resume included."""
        self._background.wait()
        block = self._gathered.block
        first, self._watched = self._watched, len(block.time)
        self._look(block, first)
        return self._watch

    def _look(self, block: Block, first: int) -> None:
        """Look at rows from a first one on: many at once, for each look costs.

        Only a log says what was seen, and there is none in memory.
        """
        if self._target is None:
            return
        self._watch.add(block.time[first:], block.energy[first:], block.wrenches[first:])

    @property
    def empty(self) -> bool:
        """Whether not one row was recorded, by this run or the one that it resumes."""
        return not (self._started or self._given or self._gathered.bytes)

    def abandon(self) -> None:
        """Leave what an earlier run published as it is, and drop this one."""
        with contextlib.suppress(ResultsError):
            self._background.wait()
        self._store.abandon()

    def close(
        self,
        status: str,
        stats: Mapping[str, Value],
        contact_log: Table,
        audit: Audit | None = None,
        checkpoint: Callable[[], Mapping[str, Table]] | None = None,
        write_log: Callable[[], None] | None = None,
    ) -> Results:
        """Complete the files and return them as results.

        Parameters
        ----------
        status : {"finished", "interrupted", "failed"}
            Written last: a file that says "finished" has all others beside it.
        stats : mapping
            Attributes of ``/stats``.
        contact_log : ndarray, shape (nc, LOG_COLUMNS)
            `Log.contacts`: largest force, depth and slip over all steps.
        audit : Audit, optional
            What the run found out about itself.
        checkpoint : callable, optional
            Returns the state at the end, with which a run can go on whose files were not completed;
            else the last one stays.
        write_log : callable, optional
            Writes the log, after the ``.csv``.

        Raises
        ------
        ResultsError
            If the files cannot be written, or could not be before.
        """
        self._write(last=status == "finished")
        peaks = signals.peaks(self.system, self._asked, contact_log)
        self._store.complete()
        judged = to_attributes(audit) if audit is not None else {}
        if profile.running is not None:
            # up to here: what follows cannot be part of what it writes
            stats = {**stats, **profile.running.stats()}
        self._store.update(values=peaks, attributes={"stats": stats, **judged})
        if self.earlier and not self.shown:
            # else a kill would leave this run's .csv and log beside the earlier one's file
            saved = self._saved
            self._store.mark()
            if checkpoint is not None:
                self._save(self._state(checkpoint(), self.watch.saved()))
            self._show()
            self._store.publish()
            self._saved = saved
        failure = self._beside(write_log)
        if failure is not None:
            status = "interrupted"
        if status != "finished" and (checkpoint is not None or self._last):
            self._save(
                self._state(checkpoint(), self.watch.saved())
                if checkpoint is not None
                else self._last
            )
        over = ["checkpoint"] if status == "finished" else []
        self._store.update(attributes={"/": {"status": status}}, remove=over)
        in_memory = self._store.finish()
        if (failure := self._store.failure or failure) is not None:
            # raised once already, maybe; a caller that cleans up shall not hear another story
            raise failure
        if self._target is not None:
            return open_results(self._target)
        if in_memory is not None:
            return Results(in_memory, None)
        raise ResultsError("results in memory could not be written")

    def _beside(self, write_log: Callable[[], None] | None) -> ResultsError | None:
        """Write the ``.csv`` and the log; return why that failed."""
        if self.earlier and not self.shown:
            return None  # nothing could be published: an earlier run's files stay together
        try:
            if self._target is not None and self._store.file:
                path = self._target.with_suffix(".csv")
                write_csv(path, Results(self._store.file, None), list(self.system.model.requests))
            if write_log is not None:
                write_log()
        except ResultsError as error:
            return error
        return None

    def _write(self, last: bool = False) -> None:
        """Hand all rows gathered to the store."""
        self._background.wait()
        block = self._gathered.block
        self._look(block, self._watched)
        # nobody fills these tables anew; of a run that records little they are more than it keeps
        later = last and self._target is None and (self._bare or not self.asked)
        self._put(block, last, later)
        self._given += len(block.time)
        self._gathered.hand_over(block)
        self._watched = 0

    def _hand_over(self, rows: int) -> None:
        """Let the first rows gathered be written while the loop goes on."""
        self._background.wait()
        self._gathered.take_back(self._free)
        self._free = self._gathered.hand_over(block := first_rows(self._gathered.block, rows))
        first, self._watched = min(self._watched, rows), max(0, self._watched - rows)
        self._given += rows

        def write() -> None:
            # these rows are nowhere else: none may follow where this fails
            with self._store.writing():
                self._look(block, first)
                self._put(block)
                self._store.sum_ahead()

        self._background.begin(write)

    def _put(self, block: Block, last: bool = False, later: bool = False) -> None:
        """Write rows behind those that are in the file; in memory they may be made `later`."""
        if self._started and not any(map(len, (block.time, block.incidents, block.events))):
            return
        rows = dict(self._signals(block, later))
        room = self._store.room()
        size = 0 if room is None else sum(table.nbytes for table in rows.values())
        # with the first rows, so that a run that dies has them too
        columns = {} if self._started else signals.request_columns(self.system)
        if room is not None and size > room:
            # and of the checkpoint, with which it goes on
            room = max(0, room - sum(table.nbytes for table in self._last.values()))
            self._fill(first_rows(block, len(block.time) * room // size), columns)
        self._store.update(rows=rows, attributes=columns, last=last)
        self._started = True
        sizes = map(len, (block.time, block.incidents, block.events))
        self._written = [a + b for a, b in zip(self._written, sizes, strict=True)]

    def _fill(self, block: Block, columns: Mapping[str, Mapping[str, Any]]) -> NoReturn:
        """Publish the rows for which there is room, and raise; the last checkpoint stays."""
        said = "no space left on device"
        if self._last and self._written[0] + len(block.time) < self._last[WRITTEN][0]:
            # fewer than were published with the last checkpoint, which stay as they are
            self._store.fail(
                f"{said}; rows of the last flush are kept; with more room, --resume goes on"
            )
        if len(block.time):
            self._store.update(dict(self._signals(block)), attributes=columns)
            said += f"; rows up to time {block.time[-1]:.9g} are kept"
        elif not self._started:
            self._store.fail(said)
        self._started = True
        self._store.update(attributes={"/": {"status": "failed"}})
        if self._last:
            self._save(self._last)
            said += "; with more room, --resume goes on"
        self._show()
        self._store.stop(said)

    def _signals(self, block: Block, later: bool = False) -> Iterator[tuple[str, Any]]:
        """Yield the rows of every dataset; `later`: what makes them."""
        given = self._asked, self._written[1], not self._started
        return (signals.signals_later if later else signals.signals)(self.system, block, *given)

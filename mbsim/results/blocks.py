"""`Block`: output rows as the pipeline leaves them, taken away to be written."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from mbsim.arrays.codes import EVENT_ELEMENT, EVENT_KIND, EVENT_TIME

if TYPE_CHECKING:
    from mbsim.compile_model.build import System

Table = np.ndarray[Any, Any]
Tables = dict[str, Table]

#: Names of the kinds of `Rows.events`, by number.
EVENT_KINDS = np.array([b"touch", b"leave", b"stick", b"slip", b"sensor"], dtype="S8")
EVENT = np.dtype([("time", "<f8"), ("kind", "S8"), ("element", "<i8")])
#: Tables of a block that do not have a row an output time.
_NOT_A_ROW = ("incidents", "points", "events")


@dataclass(frozen=True)
class Block:
    """Output rows as the pipeline leaves them; see `arrays.scene.Rows`."""

    time: Table
    y: Table
    accel: Table
    contact: Table
    energy: Table
    joint: Table
    applied: Table
    value: Table
    incident_count: Table
    incidents: Table
    points: Table
    events: Table

    @property
    def wrenches(self) -> Table:
        """Force and torque of all elements between markers, in the order of `acting`."""
        parts = [table for table in (self.joint, self.applied) if table.shape[1]]
        return np.hstack(parts) if len(parts) > 1 else (parts or [self.joint])[0]


@dataclass(frozen=True)
class Mark:
    """What a recorder goes back to: rows gathered and what was written by then."""

    rows: Block
    written: list[int]
    given: int
    started: bool
    watch: dict[str, Table]


class Gathered:
    """Rows taken so far, in tables that go to whoever writes them.

    Parameters
    ----------
    system : System
    rows : int
        How many are usually written at once.
    columnwise : bool
        Let the values of a column lie side by side: where chunks have one column, they are stored
        from where they are.
    """

    def __init__(self, system: System, rows: int = 0, columnwise: bool = False) -> None:
        self._system, self._usual = system, rows
        self._order: Literal["C", "F"] = "F" if columnwise else "C"
        found = system.scene.rows
        self._tables = {f.name: _without_rows(getattr(found, f.name)) for f in fields(Block)}
        self._widths = {name: _row_bytes(table) for name, table in self._tables.items()}
        #: Tables whose rows are written, to be filled anew.
        self._spare = dict(self._tables)
        self._ends = dict.fromkeys(self._tables, 0)
        #: How many rows there will be at least, as far as is known.
        self.expected = 0

    def take(self, rows: int, incidents: int, events: int) -> Block:
        """Add the first rows that the pipeline has left, and return what was added."""
        points = incidents if len(self._system.scene.rows.points) else 0
        counts = {"incidents": incidents, "points": points, "events": events}
        added, left = [], self._system.scene.rows
        for name, first in self._ends.items():
            count, table = counts.get(name, rows), self._tables[name]
            if count:
                if first + count > len(table):
                    self._make_room(name, first + count)
                    table = self._tables[name]
                self._ends[name] = first + count
                if self._widths[name]:
                    table[first : first + count] = getattr(left, name)[:count]
            added.append(table[first : first + count])
        return Block(*added)

    def _make_room(self, name: str, rows: int) -> None:
        """Let a table have so many rows."""
        table = self._tables[name]
        if rows <= len(table):
            return
        if rows <= len(self._spare[name]):
            made, self._spare[name] = self._spare[name], _without_rows(table)
        else:
            # a long run's are made once, a short one's with room for what it is expected to have;
            # columns a power of two apart meet in a cache
            if name not in _NOT_A_ROW:
                rows = max(rows, min(self.expected, self._usual))
            most = self._usual + self._usual // 8 if 8 * rows > self._usual else 0
            room = max(rows, most, 2 * len(table)) + 24
            order = self._order if name not in _NOT_A_ROW else "C"
            made = np.empty((room, *table.shape[1:]), table.dtype, order)
        made[: self._ends[name]] = table[: self._ends[name]]
        self._tables[name] = made

    @property
    def block(self) -> Block:
        """All rows that are there."""
        return Block(*(self._tables[name][:end] for name, end in self._ends.items()))

    @property
    def rows(self) -> int:
        """Number of output rows."""
        return self._ends["time"]

    @property
    def bytes(self) -> int:
        """Memory that the rows take."""
        return sum(end * self._widths[name] for name, end in self._ends.items())

    def hand_over(self, block: Block) -> Tables:
        """Let go of the first rows, as `first_rows` has them, and of the tables that hold them.

        Returns
        -------
        dict
            These tables, for `take_back` when nobody needs the rows any more.
        """
        gone = self._tables
        self._tables = {name: _without_rows(table) for name, table in gone.items()}
        for name, end in list(self._ends.items()):
            first = len(getattr(block, name))
            self._ends[name] = 0
            if end > first:
                self._make_room(name, end - first)
            self._tables[name][: end - first] = gone[name][first:end]
            self._ends[name] = end - first
        return gone

    def take_back(self, tables: Tables) -> None:
        """Let tables whose rows are written be filled anew, where they are no larger than usual."""
        # tables of contact points and events may have grown beyond that
        self._spare |= {
            name: table for name, table in tables.items() if len(table) < 2 * self._usual
        }

    def copied(self) -> Block:
        """Return all rows that are there, which stay as they are whatever becomes of these."""
        return Block(*(self._tables[name][:end].copy() for name, end in self._ends.items()))

    def restore(self, block: Block) -> None:
        """Let the rows of a block be all that are there."""
        for name in self._ends:
            rows = getattr(block, name)
            self._ends[name] = 0
            self._make_room(name, len(rows))
            self._tables[name][: len(rows)] = rows
            self._ends[name] = len(rows)


def row_bytes(system: System) -> int:
    """Return the memory that an output row takes, without incidents and events."""
    rows = system.scene.rows
    return sum(_row_bytes(getattr(rows, f.name)) for f in fields(Block) if f.name not in _NOT_A_ROW)


def _without_rows(table: Table) -> Table:
    """Return a table of the same columns without rows, and without what the other one holds."""
    return np.empty((0, *table.shape[1:]), table.dtype)


def _row_bytes(table: Table) -> int:
    """Return the memory that a row of a table takes."""
    return int(table.itemsize * math.prod(table.shape[1:]))


def first_rows(block: Block, rows: int) -> Block:
    """Return the first rows of a block, with the incidents and events up to them.

    Events of a block that is cut are put in order of time first.
    """
    until = block.time[rows - 1] if rows else -np.inf
    events = block.events
    events[:] = events[np.argsort(events[:, EVENT_TIME], kind="stable")]
    counts = {
        "incidents": int(block.incident_count[:rows].sum()),
        "events": int(np.searchsorted(events[:, EVENT_TIME], until, side="right")),
    }
    counts["points"] = counts["incidents"] if len(block.points) else 0
    return Block(*(getattr(block, f.name)[: counts.get(f.name, rows)] for f in fields(Block)))


def nothing(system: System) -> Block:
    """Return a block without rows: a run that failed at once has a complete file too."""
    return Gathered(system).block


def events_table(rows: Table) -> Table:
    """Return the table of events in order of time; within a step they come slot by slot."""
    table = np.zeros(len(rows), dtype=EVENT)
    ordered = rows[np.argsort(rows[:, EVENT_TIME], kind="stable")]
    table["time"] = ordered[:, EVENT_TIME]
    table["kind"] = EVENT_KINDS[ordered[:, EVENT_KIND].astype(np.int64)]
    table["element"] = ordered[:, EVENT_ELEMENT].astype(np.int64)
    return table

"""`Block`: output rows as the pipeline leaves them, taken away to be written."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.arrays.codes import EVENT_ELEMENT, EVENT_KIND, EVENT_TIME

if TYPE_CHECKING:
    from mbsim.compile_model.build import System

Table = np.ndarray[Any, Any]

#: Names of the kinds of `Rows.events`, by number.
EVENT_KINDS = np.array([b"touch", b"leave", b"stick", b"slip", b"sensor"], dtype="S8")
EVENT = np.dtype([("time", "<f8"), ("kind", "S8"), ("element", "<i8")])
#: Tables of a block that do not have a row an output time.
_NOT_A_ROW = ("incidents", "events")


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
    events: Table

    @property
    def wrenches(self) -> Table:
        """Force and torque of all elements between markers, in the order of `acting`."""
        return np.hstack([self.joint, self.applied])


class Gathered:
    """Rows taken so far, in tables that are filled anew once what they hold is written.

    What is asked of it shares their memory, and is there until the next `clear`.
    """

    def __init__(self, system: System) -> None:
        self._system = system
        found = system.scene.rows
        self._tables = {f.name: getattr(found, f.name)[:0].copy() for f in fields(Block)}
        self._widths = {
            name: table.itemsize * math.prod(table.shape[1:])
            for name, table in self._tables.items()
        }
        self._ends = dict.fromkeys(self._tables, 0)

    def take(self, rows: int, incidents: int, events: int) -> Block:
        """Add the first rows that the pipeline has left, and return what was added."""
        counts = {"incidents": incidents, "events": events}
        added = []
        for name, first in self._ends.items():
            end = first + counts.get(name, rows)
            table = self._tables[name]
            if end > len(table):
                table = np.empty((max(end, 2 * len(table)), *table.shape[1:]), table.dtype)
                table[:first] = self._tables[name][:first]
                self._tables[name] = table
            table[first:end] = getattr(self._system.scene.rows, name)[: end - first]
            self._ends[name] = end
            added.append(table[first:end])
        return Block(*added)

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

    @property
    def row_bytes(self) -> int:
        """Memory that an output row takes, without incidents and events."""
        return sum(width for name, width in self._widths.items() if name not in _NOT_A_ROW)

    def drop(self, block: Block) -> None:
        """Let go of the first rows, as `first_rows` has them."""
        for name, end in self._ends.items():
            gone, table = len(getattr(block, name)), self._tables[name]
            table[: end - gone] = table[gone:end]
            self._ends[name] = end - gone

    @property
    def ends(self) -> dict[str, int]:
        """How many rows each table has."""
        return dict(self._ends)

    def shorten(self, ends: dict[str, int]) -> None:
        """Let go of the rows behind those ends."""
        self._ends = dict(ends)


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

"""`Block`: output rows as the pipeline leaves them, taken away to be written."""

from __future__ import annotations

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
    def bytes(self) -> int:
        """Memory that the block takes."""
        return sum(int(array.nbytes) for array in vars(self).values())

    @property
    def wrenches(self) -> Table:
        """Force and torque of all elements between markers, in the order of `acting`."""
        return np.hstack([self.joint, self.applied])


def cut(system: System, rows: int, incidents: int, events: int) -> Block:
    """Return a copy of the first rows that the pipeline has left."""
    counts = {"incidents": incidents, "events": events}
    found = system.scene.rows
    return Block(
        *(getattr(found, f.name)[: counts.get(f.name, rows)].copy() for f in fields(Block))
    )


def first_rows(block: Block, rows: int) -> Block:
    """Return the first rows of a block, with the incidents and events up to them."""
    until = block.time[rows - 1] if rows else -np.inf
    counts = {
        "incidents": int(block.incident_count[:rows].sum()),
        "events": int(np.searchsorted(block.events[:, EVENT_TIME], until, side="right")),
    }
    return Block(*(getattr(block, f.name)[: counts.get(f.name, rows)] for f in fields(Block)))


def joined(blocks: list[Block]) -> Block:
    """Return several blocks as one."""
    if len(blocks) == 1:
        return blocks[0]
    columns = zip(*(vars(block).values() for block in blocks), strict=True)
    return Block(*(np.concatenate(column) for column in columns))


def nothing(system: System) -> Block:
    """Return a block without rows: a run that failed at once has a complete file too."""
    return cut(system, 0, 0, 0)


def events_table(rows: Table) -> Table:
    """Return the table of events in order of time; within a step they come slot by slot."""
    table = np.zeros(len(rows), dtype=EVENT)
    ordered = rows[np.argsort(rows[:, EVENT_TIME], kind="stable")]
    table["time"] = ordered[:, EVENT_TIME]
    table["kind"] = EVENT_KINDS[ordered[:, EVENT_KIND].astype(np.int64)]
    table["element"] = ordered[:, EVENT_ELEMENT].astype(np.int64)
    return table

"""`Recorder`: output rows of the compiled pipeline become the signals of a result file."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.arrays.codes import CONTACT_COLUMNS, PEAK_DEPTH, PEAK_FORCE, PEAK_SLIP
from mbsim.errors import ModelError, ResultsError
from mbsim.results.audit import Audit, to_attributes
from mbsim.results.contact_posts import ContactPosts
from mbsim.results.csv_file import write_csv
from mbsim.results.elements import GROUPS, acting, facts
from mbsim.results.files import prepare_directory
from mbsim.results.forces import Forces, check_requests
from mbsim.results.identity import KINDS, Identity
from mbsim.results.motion import motion
from mbsim.results.reading import Results, open_results
from mbsim.results.requests import columns_of, measures_of, request_table
from mbsim.results.store import Store, Value
from mbsim.results.watch import Watch, energies

if TYPE_CHECKING:
    from mbsim.compile_model.build import System

Table = np.ndarray[Any, Any]

#: Names of the kinds of `Rows.events`, by number.
EVENT_KINDS = np.array([b"touch", b"leave", b"stick", b"slip", b"sensor"], dtype="S8")
EVENT = np.dtype([("time", "<f8"), ("kind", "S8"), ("element", "<i8")])

_PEAKS = {"force": PEAK_FORCE, "penetration": PEAK_DEPTH, "slip_speed": PEAK_SLIP}

#: Attributes of which digests say whether they matter.
_SAID_ELSEWHERE = ("tol_from", "model_file", "overrides", "plugins", "interpret_plugins")
#: What a digest that differs says, and of which facts of `Identity` it is.
_DIGESTS = {
    "model_sha256": ("the model file has changed", "model"),
    **{kind.attribute: (kind.differs, name) for name, kind in KINDS.items()},
}
#: Where a checkpoint says what the run is made of.
MADE_OF = "made_of"
#: Rows are kept in memory up to this size [bytes], then written to the part file.
BUFFER_BYTES = 16 << 20
#: That size is for each so many bodies (and joints, ...): a write opens every signal, 0.3 ms each,
#: however few rows it adds (8000 bodies: 14 s), so that it should add many.
BUFFER_BODIES = 400
#: Time between two publications: at least this [s], and so many times what one costs.
FLUSH_SECONDS = 5.0
FLUSH_SHARE = 20.0
#: The first comes sooner, so that a folder soon shows this run and not an earlier one.
FIRST_FLUSH_SECONDS = 1.0


@dataclass(frozen=True)
class Block:
    """Output rows as the pipeline leaves them; see `arrays.scratch.Rows`."""

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


def _cut(system: System, rows: int, incidents: int, events: int) -> Block:
    """Return a copy of the first rows that the pipeline has left."""
    counts = {"incidents": incidents, "events": events}
    found = system.scene.rows
    return Block(
        *(getattr(found, f.name)[: counts.get(f.name, rows)].copy() for f in fields(Block))
    )


def _joined(blocks: list[Block]) -> Block:
    """Return several blocks as one."""
    if len(blocks) == 1:
        return blocks[0]
    columns = zip(*(vars(block).values() for block in blocks), strict=True)
    return Block(*(np.concatenate(column) for column in columns))


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
    ) -> None:
        self.system = system
        self._identity = Identity(system, how)
        self.directory = directory
        self.checkpoint: dict[str, Table] = {}
        #: What the log says of all rows, those before a resume included.
        self.watch = Watch(acting(system))
        self._blocks: list[Block] = []
        self._bytes = 0
        described = len(system.body_ids) + len(self.watch.elements)
        self._buffer = BUFFER_BYTES * max(1, described // BUFFER_BODIES)
        self._rows_since_flush = 0
        self._incidents = 0  # rows of state/incidents so far
        self._started = False  # whether state/incident_offsets has its first 0
        self._published_at = time.monotonic() - (FLUSH_SECONDS - FIRST_FLUSH_SECONDS)
        self._target: Path | None = None
        self._posts = ContactPosts(system, system.posts) if system.posts else None
        check_requests(system.model)
        settings: dict[str, Value] = {**attributes, **self._identity.digests}
        if directory is not None:
            prepare_directory(directory, system.model.name)
            self._target = directory / f"{system.model.name}.h5"
        if resume:
            self.checkpoint = self._resumed(settings)
        self._store = Store(self._target, resume)
        labels = {} if resume else self._labels()
        self._store.update(
            attributes={"/": {**settings, "status": "running"}, **labels}, remove=["stats", "audit"]
        )

    def _resumed(self, settings: Mapping[str, Value]) -> dict[str, Table]:
        """Return the checkpoint to go on from, after comparing what it was made with."""
        if self._target is None:
            raise ModelError("resume: there is no folder with results to go on from")
        if not self._target.is_file():
            raise ModelError(f"--resume: {self._target}: no such file; start without --resume")
        try:
            with open_results(self._target) as results:
                _check_same(self._target, results, settings, self._identity)
                offsets = results["state/incident_offsets"]
                self._incidents, self._started = int(offsets[-1]), True
                self.watch.recall(results)
                tables = results.tables("checkpoint")
                tables.pop(MADE_OF, None)
                return tables
        except ResultsError as error:
            raise ModelError(f"--resume: {error}") from None

    def _labels(self) -> dict[str, dict[str, Any]]:
        """Return what elements are called and what requests hold, by group or dataset."""
        model = self.system.model
        named = {f"bodies/{id}": model.bodies[id].label for id in self.system.body_ids}
        named |= {f"diffs/{id}": state.label for id, state in model.differentials.items()}
        named |= {f"contacts/{id}": model.contacts[id].label for id in self.system.contact_ids}
        labels = {name: {"label": label} for name, label in named.items() if label}
        return labels | {name: about for name, about in facts(model) if about}

    def _columns(self) -> dict[str, dict[str, Any]]:
        """Return what the columns of the requests are, by dataset."""
        about: dict[str, dict[str, Any]] = {}
        for request in self.system.model.requests.values():
            about[f"requests/{request.id}"] = {
                "columns": columns_of(request),
                "type": request.type,
                "label": request.label or request.comment,
            }
            if request.type == "EXPRESSION":
                about[f"requests/{request.id}"]["measures"] = measures_of(request)
        return about

    def take(self) -> None:
        """Take all rows, incidents and events that the pipeline has left so far."""
        rows = self.system.scene.rows
        n, incidents, events = (int(count) for count in rows.used)
        if n == incidents == events == 0:
            return
        block = _cut(self.system, n, incidents, events)
        rows.used[:] = 0
        self.watch.add(block.time, block.energy, block.wrenches)
        self._blocks.append(block)
        self._bytes += block.bytes
        self._rows_since_flush += n + events
        if self._posts is not None:
            self._posts.take(block.time, block.contact, block.incident_count, block.incidents)
        if self._bytes > self._buffer:
            self._write()

    def end(self) -> None:
        """Tell the users' CONTACTPOSTs that the run has reached its end."""
        if self._posts is not None:
            self._posts.end()

    def due(self) -> bool:
        """Return whether it is time for a flush: they cost a twentieth of the run at most."""
        pause = max(FLUSH_SECONDS, FLUSH_SHARE * self._store.publish_seconds)
        return self._target is not None and time.monotonic() - self._published_at > pause

    def flush(self, checkpoint: Mapping[str, Table]) -> None:
        """Publish all rows taken so far together with the checkpoint that follows them.

        Parameters
        ----------
        checkpoint : mapping of str to ndarray
            Full state after the last row taken, by names that may hold "/".

        Raises
        ------
        ResultsError
            If the disk is full or the folder cannot be written any more.
        """
        if self._target is None:
            return
        self._write()
        values = {f"checkpoint/{name}": array for name, array in checkpoint.items()}
        self._store.update(values=values | {f"checkpoint/{MADE_OF}": self._identity.packed()})
        self._store.publish()
        self._rows_since_flush = 0
        self._published_at = time.monotonic()

    @property
    def empty(self) -> bool:
        """Whether not one row was recorded, by this run or by the one that it resumes."""
        return not (self._started or self._blocks)

    def abandon(self) -> None:
        """Leave what an earlier run published as it is, and drop this one."""
        self._store.abandon()

    def close(
        self,
        status: str,
        stats: Mapping[str, Value],
        contact_log: Table,
        audit: Audit | None = None,
    ) -> Results:
        """Complete the files and return them as results.

        Parameters
        ----------
        status : {"finished", "interrupted", "failed"}
        stats : mapping
            Attributes of ``/stats``.
        contact_log : ndarray, shape (nc, LOG_COLUMNS)
            `Log.contacts`: largest force, depth and slip over all steps.
        audit : Audit, optional
            What the run found out about itself.

        Raises
        ------
        ResultsError
            If the files cannot be written, or could not be before.
        """
        self._write(last=True)
        peaks = {
            f"contacts/{contact_id}/peak_{name}": float(row[column])
            for row, contact_id in zip(contact_log, self.system.contact_ids, strict=True)
            for name, column in _PEAKS.items()
        }
        judged = to_attributes(audit) if audit is not None else {}
        # of rows after the checkpoint, a resumed run would record a second copy
        stale = status == "finished" or self._rows_since_flush > 0
        self._store.update(
            values=peaks,
            attributes={"stats": stats, "/": {"status": status}, **judged},
            remove=["checkpoint"] if stale else [],
        )
        in_memory = self._store.finish()
        if self._store.failure is not None:
            # raised once already, maybe; a caller that cleans up shall not hear another story
            raise self._store.failure
        if self._target is None:
            if in_memory is None:
                raise ResultsError("results in memory could not be written")
            return Results(in_memory, None)
        results = open_results(self._target)
        if self.directory is not None:
            write_csv(self._target.with_suffix(".csv"), results, list(self.system.model.requests))
        return results

    def _write(self, last: bool = False) -> None:
        """Hand the buffered rows to the store."""
        if not self._blocks:
            if self._started:
                return
            self._blocks = [_nothing(self.system)]
        block = _joined(self._blocks)
        self._blocks, self._bytes = [], 0
        # with the first rows, so that a run that dies has them too
        columns = {} if self._started else self._columns()
        self._store.update(rows=dict(self._signals(block)), attributes=columns, last=last)
        self._started = True
        self._incidents += len(block.incidents)

    def _signals(self, block: Block) -> Iterator[tuple[str, Table]]:
        """Yield the rows of every dataset."""
        system = self.system
        n = len(block.time)
        yield "time", block.time
        bodies = motion(system.body_ids, block.y, block.accel)
        for b, body_id in enumerate(system.body_ids):
            yield f"bodies/{body_id}/position", bodies.p[:, b]
            yield f"bodies/{body_id}/quaternion", bodies.q[:, b]
            yield f"bodies/{body_id}/velocity", bodies.v[:, b]
            yield f"bodies/{body_id}/angular_velocity", bodies.w[:, b]
            yield f"bodies/{body_id}/acceleration", bodies.a[:, b]
        contacts = block.contact.reshape(n, len(system.contact_ids), CONTACT_COLUMNS)
        for c, contact_id in enumerate(system.contact_ids):
            yield f"contacts/{contact_id}/force", contacts[:, c, 0:3]
            yield f"contacts/{contact_id}/torque", contacts[:, c, 3:6]
            yield f"contacts/{contact_id}/penetration", contacts[:, c, 6]
            yield f"contacts/{contact_id}/slip_speed", contacts[:, c, 7]
            yield f"contacts/{contact_id}/incidents", contacts[:, c, 8].astype(np.int64)
            yield f"contacts/{contact_id}/area", contacts[:, c, 9]
        elements = acting(system)
        wrenches = block.wrenches.reshape(n, len(elements), 6)
        for k, (statement, id) in enumerate(elements):
            path = f"{GROUPS[statement].path}/{id}"
            yield f"{path}/force", wrenches[:, k, 0:3]
            yield f"{path}/torque", wrenches[:, k, 3:6]
        for place, id in zip(system.scene.states.place, system.model.differentials, strict=False):
            yield f"diffs/{id}/value", block.y[:, place]
        for name, column in system.unknowns():
            yield name, block.value[:, column]
        forces = Forces(system, bodies, block.joint, block.applied, block.contact)
        for request in system.model.requests.values():
            markers = system.placement.markers
            yield f"requests/{request.id}", request_table(request, markers, forces, block.value)
        for k, name in enumerate(energies(system)):
            yield f"energy/{name}", block.energy[:, k]
        yield "state/y", block.y
        ends = self._incidents + np.cumsum(block.incident_count, dtype=np.int64)
        # row k has incidents[offsets[k] : offsets[k + 1]]
        yield "state/incident_offsets", ends if self._started else np.append(0, ends)
        yield "state/incidents", block.incidents
        yield "events", _events(block.events)


def _events(rows: Table) -> Table:
    """Return the table of events in order of time; within a step they come slot by slot."""
    table = np.zeros(len(rows), dtype=EVENT)
    ordered = rows[np.argsort(rows[:, 0], kind="stable")]
    table["time"] = ordered[:, 0]
    table["kind"] = EVENT_KINDS[ordered[:, 1].astype(np.int64)]
    table["element"] = ordered[:, 2].astype(np.int64)
    return table


def _nothing(system: System) -> Block:
    """Return a block without rows: a run that failed at once has a complete file too."""
    return _cut(system, 0, 0, 0)


def _check_same(
    path: Path, results: Results, settings: Mapping[str, Value], identity: Identity
) -> None:
    """Raise `ModelError` unless a run with these settings can go on from a result file."""
    there = results.attributes
    if results.status == "finished":
        raise ModelError(f"--resume: {path}: this run has finished; there is nothing to go on with")
    if not results.has_checkpoint:
        raise ModelError(f"--resume: {path}: no checkpoint in it; start without --resume")
    made_of = results.tables("checkpoint").get(MADE_OF)
    # what explains a difference comes before the digests that only show it
    for name, value in settings.items():
        if name in _SAID_ELSEWHERE or (name == "subroutines_sha256" and results.status == "failed"):
            continue  # a failed user subroutine may be mended
        if name in there and there[name] == value:
            continue
        if name in _DIGESTS:
            what, kind = _DIGESTS[name]
            found = "" if made_of is None else identity.changes(made_of, kind)
            what += f": {found}" if found else ""
        else:
            what = f"{name} was {there.get(name, 'not given')} and is {value} now"
        raise ModelError(f"--resume: {path}: {what}; a run goes on as it began")

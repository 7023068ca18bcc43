"""`RunLog`: what was run, how, and what happened, as plain text; one fact a line."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from mbsim.arrays import codes
from mbsim.compile_model.pairing import Plans
from mbsim.errors import ResultsError
from mbsim.laws.catalog import NORMAL_LAWS, friction_law_of
from mbsim.model.elements import Contact, Model
from mbsim.model.names import element_name, statement_name
from mbsim.reader.activity import statement_of
from mbsim.results.elements import APPLIED, CONSTRAINTS, GROUPS, elements_of, equations
from mbsim.results.elements import title as title_of

if TYPE_CHECKING:
    from mbsim.compile_model.build import System
    from mbsim.results.audit import Audit
    from mbsim.results.store import Value
    from mbsim.results.watch import Watch

#: A user subroutine may talk at every evaluation; no more lines than this are kept.
MOST_LINES = 20_000
_WRITE_SECONDS = 2.0
#: Statistics that are times; they differ from run to run and come last.
_TIMES = ("loop_s", "compile_s", "wall_s")


def fact(name: str, value: object) -> str:
    """Return one aligned line."""
    return f"  {name:<34} {value}"


def number(value: float, unit: str = "") -> str:
    """Return a number for reading, or a dash where there is none."""
    if not math.isfinite(value):
        return "-"
    return f"{value + 0.0:.6g} {unit}".rstrip()  # + 0.0: no -0


class RunLog:
    """The log of a run; `directory` None keeps it in `lines`.

    The file is written whole at `close`, and now and then from `show` on, each time atomically. A
    failure to write it while the run goes on does not stop the run; `close` raises it.
    """

    def __init__(
        self,
        system: System,
        attributes: Mapping[str, Value],
        directory: Path | None,
        resume: bool = False,
    ) -> None:
        self.system = system
        self.path = None if directory is None else directory / f"{system.model.name}.log"
        self.lines: list[str] = []
        self.closed = False
        self._shown = resume
        self._dropped = 0
        self._written_at = time.monotonic()
        if resume and self.path is not None and self.path.is_file():
            self.lines += self.path.read_text(encoding="utf-8", errors="replace").splitlines()
            self.lines += ["", "-" * 40, "resumed from the last checkpoint", ""]
        self.lines += header(system, attributes)
        self._first = len(self.lines)

    def line(self, text: str) -> None:
        """Add a message; one with several lines stays one block."""
        if len(self.lines) - self._first >= MOST_LINES:
            self._dropped += 1
            return
        self.lines += text.splitlines() or [""]
        if self._shown and time.monotonic() - self._written_at > _WRITE_SECONDS:
            self.show()

    def show(self) -> None:
        """Write the file as it is now, and now and then from here on: results are beside it."""
        self._shown = True
        try:
            self.flush()
        except ResultsError:
            self._written_at = time.monotonic()

    def flush(self) -> None:
        """Write the file as it is now.

        Raises
        ------
        ResultsError
            If it cannot be written.
        """
        if self.path is not None:
            from mbsim.results.files import replace_text

            replace_text(self.path, "\n".join(self.lines) + "\n")
        self._written_at = time.monotonic()

    def close(
        self,
        status: str,
        stats: Mapping[str, Value],
        watch: Watch | None = None,
        audit: Audit | None = None,
    ) -> None:
        """Add the summary and write the file.

        Parameters
        ----------
        status : {"finished", "interrupted", "failed"}
        stats : mapping
            Counters and times of the run.
        watch : Watch, optional
            Energies and largest forces (`Recorder.watch`).
        audit : Audit, optional
            What the run found out about itself.

        Raises
        ------
        ResultsError
            If it cannot be written.
        """
        if self._dropped:
            self.lines.append(f"... and {self._dropped} lines more that are not kept")
        self.lines += ["", *summary(self.system, status, stats, watch, audit)]
        self.closed = True
        self.flush()


class NoLog(RunLog):
    """The log of a run without a folder, which nobody reads."""

    def __init__(self) -> None:
        self.closed = False

    def line(self, text: str) -> None:
        """Keep nothing."""

    def show(self) -> None:
        """Write nothing."""

    def close(
        self,
        status: str,
        stats: Mapping[str, Value],
        watch: Watch | None = None,
        audit: Audit | None = None,
    ) -> None:
        """Write nothing."""
        self.closed = True


def counts(model: Model) -> dict[str, int]:
    """Return the numbers of elements by name, for logs and `mbsim check`."""
    between_markers = {
        GROUPS[statement].path: len(elements_of(model, statement))
        for statement in (*CONSTRAINTS, *APPLIED)
    }
    return {
        "bodies": sum(not body.is_ground for body in model.bodies.values()),
        "markers": len(model.markers),
        "graphics": len(model.graphics),
        "contacts": len(model.contacts),
        **{name: count for name, count in between_markers.items() if count},
        **{
            name: len(table)
            for name, table in (
                ("sensors", model.sensors),
                ("diffs", model.differentials),
                ("variables", model.variables),
                ("splines", model.splines),
                ("arrays", model.arrays),
            )
            if table
        },
        "requests": len(model.requests),
    }


def freedom(system: System) -> int | None:
    """Return the degrees of freedom of the assembled system, None where nothing is constrained.

    Directions that are free in the tree, less the equations in use: redundant ones do not count.
    """
    if not system.connections:
        return None
    tree, equations = system.scene.tree, system.scene.equations
    alone = int((tree.of_body[: len(system.body_ids)] < 0).sum())
    return 6 * alone + int(tree.free.sum()) - int(equations.active[-1])


def units_text(model: Model) -> str:
    """Return the units of force, mass, length and time in one line."""
    units = model.units
    return f"{units.force} {units.mass} {units.length} {units.time}"


def pair_texts(plans: Plans, contact_id: int) -> Iterator[str]:
    """Yield how the pairs of graphics of a contact are tested."""
    for plan in plans.pairs:
        if plan.kind.contact == contact_id:
            names = f"Post_Graphic[{plan.graphic_i}] Post_Graphic[{plan.graphic_j}]"
            yield f"{names}: {plan.kind.detector}"
    for contact_set in plans.broadphase:
        if contact_set.contact == contact_id:
            if contact_set.same:
                what = f"{len(contact_set.i)} graphics with each other"
            else:
                what = f"{len(contact_set.i)} with {len(contact_set.j)} graphics"
            yield f"{what}, {contact_set.pairs} pairs: near ones are found by a grid"
            for (shape_i, shape_j), kind in contact_set.kinds.items():
                yield f"{shape_i} {shape_j}: {kind.detector}"


def header(system: System, attributes: Mapping[str, Value]) -> Iterator[str]:
    """Yield what is run and how."""
    model = system.model
    yield f"mbsim {attributes.get('mbsim_version', '')}".rstrip()
    yield ""
    yield "model"
    yield fact("file", model.file)
    yield fact("sha256", model.sha256)
    yield fact("units", units_text(model))
    for name, count in counts(model).items():
        yield fact(name, count)
    if system.connections:
        yield fact("scalar constraint equations", equations(model))
    if not model.requests:
        missing = statement_name(model.file, "Post_Request")
        yield fact("requests written as CSV", f"none: the deck has no {missing}")
    for note in model.notes:
        yield f"  note: {note}"
    for warning in model.warnings:
        yield f"  warning: {warning}"
    from mbsim.results.forces import actings, marker_actings

    elements = actings(system)
    for request in model.requests.values():
        if request.type == "MARKER_FORCE" and not marker_actings(system, elements, request):
            ids = [id for id in (request.i_marker_id, request.j_marker_id) if id is not None]
            who = " and ".join(element_name(model.file, "Reference_Marker", id) for id in ids)
            name = element_name(model.file, "Post_Request", request.id)
            yield f"  warning: {name}: no element acts at {who}; it is 0"
    yield ""
    yield "settings"
    shown = ("integrator", "tol", "end_time", "print_interval", "detector")
    for name in shown:
        if name in attributes:
            yield fact(name, attributes[name])
    for contact in model.contacts.values():
        yield ""
        yield title(contact)
        yield from _normal_lines(system, contact)
        yield from _friction_lines(system, contact)
        for text in pair_texts(system.plans, contact.id):
            yield fact("pair", text)
    yield ""
    yield "run"


def title(contact: Contact) -> str:
    """Return a contact's name and label."""
    return f"Force_Contact[{contact.id}] {contact.label}".rstrip()


def _normal_lines(system: System, contact: Contact) -> Iterator[str]:
    """Yield a contact's normal law, and the numbers its formula took from the deck."""
    user = system.user_normal.get(contact.id)
    if user is not None:
        yield fact("normal law", f"user {user.name}, {user.how}")
        yield fact("normal law's file", user.source)
        if user.reason:
            yield fact("interpreted because", user.reason)
        return
    yield fact("normal law", f"{contact.cnf_type}, built in")
    row = system.scene.contacts.normal_par[system.contact_ids.index(contact.id)]
    # a row is as long as the longest law's
    for name, value in zip(NORMAL_LAWS[contact.cnf_type].takes, row, strict=False):
        yield fact(f"  {name}", number(value))


def _friction_lines(system: System, contact: Contact) -> Iterator[str]:
    """Yield a contact's friction law and the numbers it takes, or why a user's is not compiled."""
    user = system.user_friction.get(contact.id)
    if user is None:
        built_in = contact.cff_type != "COULOMB_OFF"
        yield fact("friction law", f"{contact.cff_type}, built in" if built_in else "none")
        if built_in:
            row = system.scene.contacts.friction_par[system.contact_ids.index(contact.id)]
            # a row is as long as the longest law's
            for name, value in zip(friction_law_of(contact).parameters, row, strict=False):
                yield fact(f"  {name}", str(value) if math.isinf(value) else number(value))
        return
    yield fact("friction law", f"user {user.name}, {user.how}")
    yield fact("friction file", user.source)
    if not user.compiled:
        yield fact("interpreted because", user.reason)


def summary(
    system: System,
    status: str,
    stats: Mapping[str, Value],
    watch: Watch | None,
    audit: Audit | None,
) -> Iterator[str]:
    """Yield what happened: contacts, forces, rejections, energy, statistics, times."""
    yield f"end: {status}"
    log = system.scene.log
    for c, contact_id in enumerate(system.contact_ids):
        row = log.contacts[c]
        yield ""
        yield title(system.model.contacts[contact_id])
        if not row[codes.TOUCHES]:
            yield fact("first touch", "never")
            continue
        yield fact("first touch at time", number(row[codes.FIRST_TOUCH]))
        yield fact("touches", int(row[codes.TOUCHES]))
        yield fact("deepest penetration", number(row[codes.PEAK_DEPTH]))
        yield fact("largest slip speed", number(row[codes.PEAK_SLIP]))
        yield fact("largest force", number(row[codes.PEAK_FORCE]))
        yield fact("largest force at time", number(row[codes.PEAK_FORCE_TIME]))
        yield fact("closing speed of the last touch", number(row[codes.APPROACH]))
        yield fact("effective rebound, first impact", number(row[codes.REBOUND]))
        yield fact("energy lost, damper and friction", number(row[codes.ENERGY_LOST]))
    if watch is not None:
        yield from _force_lines(system, watch)
    yield ""
    yield "rejected steps, by the contact that asked for it"
    names = [f"Force_Contact[{id}]" for id in system.contact_ids] + ["no contact"]
    reasons = (
        (codes.REJECT_ERROR, "local error above tol"),
        (codes.REJECT_DEPTH, "impact would begin too deep"),
        (codes.REJECT_NOT_FINITE, "force not finite"),
        (codes.REJECT_NEWTON, "Newton's iteration did not converge"),
    )
    found = False
    for name, row in zip(names, log.rejections, strict=True):
        for column, reason in reasons:
            if row[column]:
                found = True
                yield fact(name, f"{row[column]} {reason}")
    if not found:
        yield fact("none", "")
    if watch is not None:
        yield from _energy_lines(system, watch)
    if audit is not None:
        yield from _audit_lines(audit)
    yield ""
    yield "statistics"
    free = freedom(system)
    if free is not None:
        yield fact("degrees of freedom, all bodies", free)
    for name, value in stats.items():
        if name not in _TIMES:
            yield fact(name, number(value) if isinstance(value, float) else value)
    yield ""
    yield "time"
    for name in _TIMES:
        if name in stats:
            yield fact(name, f"{float(stats[name]):.3f}")


def _force_lines(system: System, watch: Watch) -> Iterator[str]:
    """Yield the largest force and torque of every element between markers, and when."""
    if not watch.elements:
        return
    yield ""
    yield "largest force and torque on marker I, over output rows"
    for (statement, id), peak in zip(watch.elements, watch.peaks, strict=True):
        force, force_time, torque, torque_time = map(number, peak.tolist())
        texts = (f"{force} at {force_time}", f"torque {torque} at {torque_time}")
        yield fact(title_of(system.model, statement, id), ", ".join(texts))


def _energy_lines(system: System, watch: Watch) -> Iterator[str]:
    """Yield the energies at the end, and how far their balance is from what it was at first."""
    if watch.first is None or watch.last is None:
        return
    from mbsim.results.watch import energies

    names = energies(system)
    yield ""
    yield "energy at the end"
    for name, amount in zip(names, watch.last, strict=False):
        said = {"dissipated": "dissipated total"}.get(name, name.replace("_", " "))
        yield fact(said, number(float(amount)))
    stages = system.model.simulations
    changed = any(s.changes or s.inactive for s in stages)
    if changed or any(s.gravity is not None for s in stages[1:]):
        return  # with another gravity or spring goes another potential energy
    what = "kinetic + potential + dissipated"
    if len(names) == len(watch.last):
        what += " - work of motions"
    first, last = (float(e[:3].sum() - e[3]) for e in (watch.first, watch.last))
    yield fact("balance, change since the start", number(last - first))
    yield fact("  of", what)


def _audit_lines(audit: Audit) -> Iterator[str]:
    """Yield what the run found out about itself."""
    yield ""
    yield f"audit: {audit.line}"
    yield fact("balance worst at time", number(audit.time))
    for id, share in audit.contacts.items():
        if share.largest:
            name = "  without contact" if id is None else f"  under Force_Contact[{id}]"
            largest = f"{number(share.largest)} at {number(share.time)}"
            yield fact(name, f"{number(share.change)}, most at once {largest}")
    for id, share in audit.contacts.items():
        if share.friction:
            yield fact(f"  friction of Force_Contact[{id}]", f"work {number(share.friction)}")
    for name, entry in audit.entries.items():
        at = f" at {entry.element}" if entry.element else ""
        when = f"{number(entry.value)} of {number(entry.allowed)} at time {number(entry.time)}"
        yield fact(name.replace("_", " "), when + at)
    for warning in audit.warnings:
        yield f"  warning: {warning}"


def sequence(model: Model) -> Iterator[str]:
    """Yield what a deck's commands do, where that is more than one transient."""
    if [s.analysis_type for s in model.simulations] in ([], ["TRANSIENT"]) and not any(
        s.changes or s.inactive for s in model.simulations
    ):
        return
    said, before = 0, set[tuple[str, int]]()
    for simulation in model.simulations:
        now = {*simulation.inactive}
        for table, id in sorted(now ^ before):
            name = element_name(model.file, statement_of(table, model.motions.get(id)), id)
            yield f"{'deactivate' if (table, id) in now else 'activate'} {name}"
        before = now
        for change in simulation.changes[said:]:
            yield f"change {change.text}"
        said = len(simulation.changes)
        until = f" to {number(simulation.end_time)}"
        times = until if simulation.end_time > simulation.start_time else ""
        yield f"simulate {simulation.analysis_type} at {number(simulation.start_time)}{times}"

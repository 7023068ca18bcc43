"""`Audit`: what a run found out about itself; its table of entries is in one place, `ENTRIES`.

Compiled code (`pipeline.audit`) keeps, for every row of `arrays.state.Audit.found`, the value
that was largest over what the local errors of the steps explain. Here it is said what that is,
how many times as large it may be, and at which element it was.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

from mbsim.arrays import codes
from mbsim.forces.catalog import FORCES
from mbsim.model.names import element_name
from mbsim.results.units import ENERGY as ENERGY_UNIT
from mbsim.results.units import UnitSystem

if TYPE_CHECKING:
    from mbsim.compile_model.build import System
    from mbsim.results.store import Value


class Judged(NamedTuple):
    """One thing that a run is judged by."""

    row: int  # of `Audit.found`
    name: str  # in result files and in `Audit.entries`
    says: str  # what is off, for the warning
    limit: float  # how many times what is explained it may be
    element: str  # what the row's element is: contact, body, equation, friction, or nothing


#: What a run is judged by. How the limits were found is in the manual, computation/audit.
ENTRIES = (
    Judged(
        codes.ENERGY, "energy", "the energy balance is off by {value:.3g} {energy}", 30.0, "contact"
    ),
    Judged(
        codes.ENERGY_STEP,
        "energy_step",
        "the energy balance changes by {value:.3g} {energy} within a few steps",
        30.0,
        "contact",
    ),
    Judged(
        codes.MOMENTUM,
        "momentum",
        "bodies on which nothing but weight acts change their momentum by {value:.3g}",
        5.0,
        "body",
    ),
    Judged(
        codes.SPIN,
        "angular_momentum",
        "bodies on which nothing but weight acts change their angular momentum by {value:.3g}",
        5.0,
        "body",
    ),
    Judged(
        codes.POSITION, "position", "a constraint is left open by {value:.3g}", 10.0, "equation"
    ),
    Judged(
        codes.VELOCITY,
        "velocity",
        "the rate of a constraint is off by {value:.3g}",
        10.0,
        "equation",
    ),
    Judged(
        codes.STICKING_SLIP,
        "held_slip",
        "what friction holds slips, by {value:.3g}",
        10.0,
        "equation",
    ),
    Judged(codes.CONE, "cone", "friction is {value:.3g} above mu N", 10.0, "contact"),
    Judged(
        codes.NEWTON,
        "newton",
        "Newton's iteration left {value:.3g} of a step's equations",
        10.0,
        "",
    ),
    Judged(
        codes.FOLD,
        "fold",
        "velocities are off by {value:.3g} of the usual behind a position in which a loop can fold",
        10.0,
        "equation",
    ),
    Judged(
        codes.DRIVES,
        "friction_work",
        "friction drives instead of resisting (it gave {value:.3g} {energy} more than it took; is "
        "its sign right?), first seen",
        codes.DRIVES_LIMIT,
        "friction",
    ),
    Judged(
        codes.PENETRATION,
        "penetration",
        "rigid shapes go {value:.3g} deep into each other",
        10.0,
        "contact",
    ),
    Judged(
        codes.UNSOLVED_IMPULSES,
        "contact_residual",
        "the contact problem of a step is solved to a velocity of {value:.3g} only",
        10.0,
        "",
    ),
    Judged(
        codes.STEP_END,
        "step_end",
        "steps of the deck's length are too long for their impacts: positions are off by "
        "{value:.3g} at the end of one",
        10.0,
        "contact",
    ),
)
#: Those of energy.
ENERGIES = ("energy", "energy_step")
#: A balance that is off by more than this part of the largest energy is told whatever explains it.
COARSE = 0.02
#: A contact that gave this part of the largest energy there was, beyond what it took, feeds motion
#: if that is more than this part of what errors of all steps may make, which is large at rest.
FEEDS, FEEDS_ERRORS = 0.3, 0.2

#: What is said of contacts of meshes that are not convex, where they feed motion.
NO_POTENTIAL = (
    "its meshes are not convex, and the force on their largest depth has no potential; that of "
    'contact_depth="FIELD" has one, and takes stiffness over the area'
)
#: What is said of overlaps whose force cannot be trusted.
TOO_DEEP = (
    "{i} and {j} go too deep into each other, first at time {time:.9g} at {who}: deeper than the "
    "layer under a mesh's surface or than its wall, or nearly as deep as their middles; so deep "
    "they are pushed too little or out on the other side: is the contact too soft?"
)


@dataclass(frozen=True)
class Entry:
    """The value that was largest over what is allowed, when, and at which element."""

    value: float
    allowed: float
    time: float
    element: str

    @property
    def excess(self) -> float:
        """How many times as large as allowed it was."""
        return self.value / self.allowed if self.allowed > 0.0 else math.inf * (self.value > 0.0)


@dataclass(frozen=True)
class Share:
    """The change of the energy balance while one contact pressed hardest."""

    change: float  # in all
    largest: float  # from one sample to the next
    time: float  # of that
    friction: float = 0.0  # work of its friction on the bodies; below 0: it resists


@dataclass(frozen=True)
class Audit:
    """What a run found out about itself.

    `balance` is the largest |kinetic + potential + dissipated - work of motions| since the start
    [F L], at `time`; `of` the largest energy of any kind that there was; `contacts` says by id
    how much of the changes came while that contact pressed hardest, None while none touched.
    `entries` has what of `ENTRIES` the model gave reason to look at.
    """

    balance: float
    of: float
    time: float
    unit: str
    entries: Mapping[str, Entry]
    contacts: Mapping[int | None, Share]
    warnings: tuple[str, ...]

    @property
    def line(self) -> str:
        """The one line at a run's end."""
        line = f"balance closes to {self.balance:.1g} of {self.of:.3g} {self.unit}"
        left, deep = self.entries.get("contact_residual"), self.entries.get("penetration")
        if left is not None:
            depth = deep.value if deep is not None else 0.0
            line += (
                f"; contact problems are solved to a velocity of {left.value:.1g}, "
                f"rigid shapes go {depth:.1g} deep"
            )
        return line


def audit_of(system: System, left: float, left_time: float) -> Audit | None:
    """Return what a system's run found out about itself, None where no step was taken.

    Parameters
    ----------
    system : System
    left, left_time : float
        The most that Newton's iteration left of a step, in the norm of the error, and when.
    """
    kept = system.scene.audit
    tally, found = kept.tally, kept.found.copy()
    if tally[codes.STEPS_ALL] == 0.0:
        return None
    if left > 0.0:
        found[codes.NEWTON] = left, kept.plan[codes.AUDIT_TOL], left_time, -1
    unit = UnitSystem(system.model.units.force, system.model.units.length).text(ENERGY_UNIT)
    entries, warnings = {}, []
    for judged in ENTRIES:
        value, explained, time, element = (float(number) for number in found[judged.row])
        if value < 0.0:
            continue
        entry = Entry(value, judged.limit * explained, time, _named(system, judged, int(element)))
        entries[judged.name] = entry
        if not entry.excess <= 1.0:
            says = judged.says.format(value=value, energy=unit)
            at = f" at {entry.element}" if entry.element else ""
            warnings.append(
                f"{says} at time {time:.9g}{at}: {entry.excess:.3g} times what tol explains"
            )
    for c, id in enumerate(system.contact_ids):
        since, *rows = system.scene.log.contacts[c, codes.BEYOND_TIME : codes.BEYOND_J + 1].tolist()
        if not math.isnan(since):
            i, j = (_graphic_name(system, int(row)) for row in rows)
            who = element_name(system.model.file, "Force_Contact", id)
            warnings.append(TOO_DEEP.format(i=i, j=j, time=since, who=who))
    ids = [*system.contact_ids, None]
    works = [*kept.friction[:, codes.WORK_NOW], 0.0]
    shares = {
        id: Share(float(row[0]), float(row[1]), float(row[2]), float(work))
        for id, row, work in zip(ids, kept.contact, works, strict=True)
    }
    balance, time = abs(float(tally[codes.WORST_OPEN])), float(tally[codes.WORST_TIME])
    size = float(tally[codes.LARGEST_ENERGY])
    # of a model that stands still no energy is large: what its scales say is
    usual = max(size, float(tally[codes.USUAL_ENERGY]))
    part = balance / usual if usual > 0.0 else 0.0
    open_already = any(entries[name].excess > 1.0 for name in ENERGIES if name in entries)
    # rigid contact has no force that could have a potential: its energy is off by steps alone
    compliant = "contact_residual" not in entries
    feeding = _feeding(system, shares, size, usual, unit) if compliant else []
    warnings += feeding
    if part > COARSE and not open_already and not feeding:
        why = f"tol {kept.plan[codes.AUDIT_TOL]:g} explains: choose a smaller one"
        if "step_end" in entries:
            why = "the deck's step explains: choose a shorter one"
        warnings.append(
            f"the energy balance is off by {balance:.2g} {unit}, {100.0 * part:.2g} % of the usual "
            f"energy of {usual:.3g} {unit}, at time {time:.9g}, as {why}"
        )
    return Audit(balance, size, time, unit, entries, shares, tuple(warnings))


def _feeding(
    system: System, shares: Mapping[int | None, Share], size: float, usual: float, unit: str
) -> list[str]:
    """Return what is said of contacts that gave much more than they took.

    Of a force without a potential that is so however small tol is, and where all is nearly at rest
    it is a small part of the usual energy: what rocks on such a contact may never come to rest.
    """
    kept = system.scene.audit
    tol, steps = float(kept.plan[codes.AUDIT_TOL]), float(kept.tally[codes.STEPS_ALL])
    explained = (
        FEEDS_ERRORS * usual * (float(kept.tally[codes.ERRORS_ALL]) + tol * math.sqrt(steps))
    )
    # a field of depth has a potential
    patched = {
        kind.contact
        for kind in system.plans.kinds
        if kind.form is not None and kind.form.patches and "FIELD" not in kind.closed_form
    }
    said = []
    for id, share in shares.items():
        if id is None or not share.change > max(FEEDS * size, explained):
            continue
        who = element_name(system.model.file, "Force_Contact", id)
        part = 100.0 * share.change / size
        why = NO_POTENTIAL if id in patched else "is its force the slope of an energy?"
        said.append(
            f"{who} gave {share.change:.2g} {unit} more than it took, {part:.2g} % of the largest "
            f"energy in the run, most of it at time {share.time:.9g}: {why}"
        )
    return said


def _graphic_name(system: System, row: int) -> str:
    """Return the graphic of a row, with its body."""
    id = system.graphic_ids[row]
    body = system.model.markers[system.model.graphics[id].marker_id].body_id
    file = system.model.file
    return f"{element_name(file, 'Post_Graphic', id)} of {element_name(file, 'Body_Rigid', body)}"


def _named(system: System, judged: Judged, row: int) -> str:
    """Return the element of a row as its deck has it."""
    contacts = len(system.contact_ids)
    if judged.element == "friction" and contacts <= row < contacts + len(system.applied):
        kind, id = system.applied[row - contacts]
        return element_name(system.model.file, FORCES[kind].statement, id)
    if judged.element in ("contact", "friction") and 0 <= row < contacts:
        return element_name(system.model.file, "Force_Contact", system.contact_ids[row])
    if judged.element == "body" and 0 <= row < len(system.body_ids):
        return system.body_name(row)
    if judged.element == "equation" and 0 <= row < len(system.equation_names):
        connection = int(system.scene.equations.connection[row])
        if 0 <= connection < len(system.connections):
            return f"{system.connection_name(connection)} ({system.equation_names[row]})"
        return system.equation_names[row]
    return ""


def to_attributes(audit: Audit) -> dict[str, dict[str, Value]]:
    """Return an audit as attributes of groups of a result file."""
    found: dict[str, dict[str, Value]] = {
        "audit": {
            "balance": audit.balance,
            "of": audit.of,
            "time": audit.time,
            "unit": audit.unit,
            "warnings": "\n".join(audit.warnings),
        }
    }
    for name, entry in audit.entries.items():
        found[f"audit/{name}"] = dict(vars(entry))
    for id, share in audit.contacts.items():
        found[f"audit/contacts/{'none' if id is None else id}"] = dict(vars(share))
    return found


def from_attributes(found: Mapping[str, Mapping[str, Any]]) -> Audit:
    """Return the audit that `to_attributes` made attributes of."""
    whole = dict(found["audit"])
    warnings = tuple(str(whole.pop("warnings")).splitlines())
    entries = {
        judged.name: Entry(**found[f"audit/{judged.name}"])
        for judged in ENTRIES
        if f"audit/{judged.name}" in found
    }
    contacts: dict[int | None, Share] = {}
    for name, facts in found.items():
        if name.startswith("audit/contacts/"):
            id = name.rpartition("/")[2]
            contacts[None if id == "none" else int(id)] = Share(**facts)
    return Audit(**whole, entries=entries, contacts=contacts, warnings=warnings)


def facts(audit: Audit) -> dict[str, Any]:
    """Return an audit for JSON and for `mbsim info`."""
    return {
        "balance": audit.balance,
        "of": audit.of,
        "time": audit.time,
        "unit": audit.unit,
        "warnings": list(audit.warnings),
        "entries": {
            name: {**vars(entry), "excess": entry.excess} for name, entry in audit.entries.items()
        },
        "contacts": {
            "none" if id is None else str(id): vars(share) for id, share in audit.contacts.items()
        },
    }

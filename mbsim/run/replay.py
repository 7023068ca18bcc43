"""Signals after the fact: contact forces of output rows once more, by the code of the run.

A result file has of every row the state and what contact forces followed from besides
(`pipeline.replay`). The model is read again, its laws are the same functions behind the same
addresses, so that forces are those of the run to the last bit; what laws were given and gave on the
way, and what users' functions name by `espy`, becomes visible.
"""

from __future__ import annotations

import ctypes
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.arrays.codes import USED_INCIDENTS
from mbsim.core.stored import read_regular
from mbsim.errors import ModelError
from mbsim.integrators.catalog import RIGID
from mbsim.run.activity import Activity
from mbsim.run.plants import with_plants

if TYPE_CHECKING:
    from mbsim.compile_model.build import System
    from mbsim.model.elements import Model
    from mbsim.results.reading import Results

Array = np.ndarray[Any, Any]
Value = float | str

#: What is known of every incident, and how many numbers it has.
OF_INCIDENTS = {
    "mu": 1,  # friction over normal force
    "force": 3,  # on I, global frame
    "torque": 3,
    "mode": 1,  # of laws that stick: stick or slip
    "slip": 1,  # speed
    "xdot": 3,  # slip velocity in the incident marker, spin
    "x": 3,  # deformation in the incident marker
    "depth": 1,
    "rate": 1,  # of depth
    "nforce": 1,
    "friction": 3,  # Fx, Fy, Tz in the incident marker
    "stored": 1,  # energy that normal force and friction hold
    "point": 3,
    "normal": 3,  # from J into I
    "area": 1,  # of a region, 0 of a point
}
OF_CONTACTS = {
    "force": 3,
    "torque": 3,
    "penetration": 1,
    "slip_speed": 1,
    "incidents": 1,
    "area": 1,
}
_AXES = ("x", "y", "z")
_MODES = {1.0: "stick", 2.0: "slip"}
_NAME = re.compile(r"Force_Contact\[(\d+)\](?:\.incident\[(\d+)\])?\.([A-Za-z_]\w*)(?:/(\w+))?")
#: How names for `mbsim plot` begin.
_PLOTTED = re.compile(r"/?(?:time$|[a-z_]+/)")


@dataclass
class Row:
    """An output row: what contacts and their incidents have, by contact id."""

    time: float
    contacts: dict[int, dict[str, Any]]
    incidents: dict[int, list[dict[str, Any]]] = field(default_factory=dict)
    # what subroutines of other elements name by espy, by statement and id
    espied: dict[tuple[str, int], dict[str, Any]] = field(default_factory=dict)


def deck_of(results: Results) -> str:
    """Return the deck that a result file names; raise `ModelError` unless it is still the same."""
    import hashlib

    named = results.attributes
    deck = Path(str(named["model_file"]))
    try:
        data = read_regular(deck)
    except OSError as error:
        raise ModelError(
            f"{results.path}: its model {deck} cannot be read: {error.strerror}; run request in "
            "the folder from which it was run"
        ) from None
    if hashlib.sha256(data).hexdigest() != named["model_sha256"]:
        raise ModelError(f"{results.path}: its model {deck} has changed since the run")
    return str(deck)


def lines_of(text: Any) -> list[str]:
    """Return what an attribute of a result file lists, a line each."""
    return str(text).split("\n") if str(text) else []


class Replay:
    """The model of a result file, built again.

    Raises
    ------
    ModelError
        If the deck, users' files or the result file are not those of the run.
    """

    def __init__(self, results: Results) -> None:
        from mbsim.arrays import codes
        from mbsim.compile_model.build import build
        from mbsim.reader.xml import read_model
        from mbsim.results.identity import Identity
        from mbsim.run.settings import settle

        named = results.attributes
        if named["integrator"] == RIGID:
            raise ModelError(
                f"{results.path}: integrator {RIGID} has no contact law to be asked again; what "
                "contacts did is in the file: contacts/<id>/force"
            )
        if "overrides" not in named:
            raise ModelError(f"{results.path}: an earlier version made it: run the model again")
        model = read_model(deck_of(results), lines_of(named["overrides"]))
        self.results = results
        # analyses of one time may all be at 0, which nobody asks for
        end = float(named["end_time"]) or None
        self.settings = settle(model, end, float(named["print_interval"]))
        plugins = [Path(file) for file in lines_of(named["plugins"])]
        interpret, detector = bool(named["interpret_plugins"]), str(named["detector"])
        self.system: System = build(
            with_plants(model), plugins, interpret, detector, lambda line: None
        )
        self._changes()
        digests = Identity(self.system).digests
        for name, what in (
            ("subroutines_sha256", "a user subroutine"),
            ("system_sha256", "what the model is made of"),
        ):
            if digests[name] != named[name]:
                raise ModelError(f"{results.path}: {what} has changed since the run")
        scene = self.system.scene
        scene.world.fixed_step[0] = int(named["integrator"] == "VERLET")
        self.wide = scene.rows.incidents.shape[1]
        self.region = self.wide > codes.INC_MEMORY + scene.state.before.shape[1]
        self._open()

    def _changes(self) -> None:
        """Make what commands change between simulations."""
        from mbsim.compile_model.changes import make_room, parameters

        self.stages = []
        given = [stage.simulation.changes for stage in self.settings.stages]
        if any(given):
            self.stages = [parameters(self.system, changes) for changes in given]
            self.system.scene = make_room(self.system.scene, self.stages)
        self.stage = -1
        switches = any(stage.simulation.inactive for stage in self.settings.stages)
        self.activity = Activity(self.system) if switches else None

    def _open(self) -> None:
        """Compile, or load, what evaluates a row."""
        from mbsim.arrays.hooks import Hook
        from mbsim.core import jit
        from mbsim.core.address import pack
        from mbsim.core.problem import HOOK
        from mbsim.dynamics.pipeline.hook_table import fill
        from mbsim.dynamics.pipeline.replay import replay_hook

        scene = self.system.scene
        # laws may ask for expressions, and for what they kept
        fill(
            scene,
            only=(
                Hook.VALUE,
                Hook.ELEMENT,
                Hook.TILTING,
                Hook.RECALL,
                Hook.SPREAD,
                Hook.RIM,
                Hook.HOLD_BACK,
            ),
        )
        if self.system.reader is not None:
            self.system.reader.open(scene)
        self._table = pack(scene)
        pointer = ctypes.c_void_p
        self._hook = ctypes.CFUNCTYPE(
            ctypes.c_int64, ctypes.c_int64, ctypes.c_double, ctypes.c_double, pointer, pointer
        )(jit.address(replay_hook, HOOK))

    def rows(self) -> Iterator[Row]:
        """Yield all rows of the result file."""
        time, y = self.results["time"], self.results["state/y"]
        offsets, table = self.results["state/incident_offsets"], self.results["state/incidents"]
        if table.ndim != 2 or (len(table) and table.shape[1] != self.wide):
            raise ModelError(
                f"{self.results.path}: its incidents have another layout: run the model again"
            )
        for k in range(len(time)):
            part = table[offsets[k] : offsets[k + 1]]
            yield self._row(float(time[k]), np.ascontiguousarray(y[k]), part)

    def _settle(self, time: float) -> None:
        """Let the parameters of the simulation that a time belongs to hold."""
        from mbsim.compile_model.changes import apply

        begins = [stage.simulation.start_time for stage in self.settings.stages]
        stage = max(sum(begin <= time for begin in begins) - 1, 0)
        if self.stages and stage != self.stage:
            apply(self.system.scene, self.stages[stage])
        if self.activity is not None and stage != self.stage:
            self.activity.apply(self.settings.stages[stage].simulation.inactive)
        self.stage = stage

    def _row(self, time: float, y: Array, incidents: Array) -> Row:
        """Evaluate one row."""
        from mbsim.arrays import codes
        from mbsim.run.failures import fail

        self._settle(time)
        scene, ids = self.system.scene, self.system.contact_ids
        count, n = len(incidents), len(y)
        scene.rows.incidents[:count] = incidents
        scene.rows.used[USED_INCIDENTS] = count
        groups = (len(scene.work.law_in), len(scene.work.law_out), codes.SLOT_COLUMNS)
        size, wide = codes.CONTACT_COLUMNS * len(ids), sum(groups)
        room = np.zeros(n + size + count * wide)
        code = self._hook(self._table.ctypes.data, time, 0.0, y.ctypes.data, room.ctypes.data)
        if code != 0:
            fail(self.system, None, code, time)
        nets = room[n : n + size].reshape(len(ids), codes.CONTACT_COLUMNS)
        found = Row(time, {id: _net(net) for id, net in zip(ids, nets, strict=True)})
        found.incidents = {id: [] for id in ids}
        for row, numbers in zip(incidents, room[n + size :].reshape(count, wide), strict=True):
            c = int(scene.kinds.contact[int(row[codes.INC_KIND])])
            given, out, slot = np.split(numbers, np.cumsum(groups)[:-1])
            found.incidents[ids[c]].append(self._incident(c, row, given, out, slot))
        found.espied = self._espied_by_subroutines(time, y)
        return found

    def _espied_by_subroutines(self, time: float, y: Array) -> dict[tuple[str, int], Any]:
        """Return what subroutines in place of expressions name; those of requests know more.

        The row has just been evaluated: measures are those of y.
        """
        from mbsim.plugins import host, raise_failure

        found = {}
        for user in self.system.subroutines.values():
            if not user.acts or user.how != "interpreted":
                continue
            results, outer = np.zeros(max(3, user.count)), host.signals
            host.signals = {}
            try:
                code = user.keep(self._table.ctypes.data, time, y.ctypes.data, results.ctypes.data)
                named = {name: _plain(value) for name, value in host.signals.items()}
            finally:
                host.signals = outer
            if code != 0:
                raise_failure()
            found[user.element] = named
        return found

    def _incident(self, c: int, row: Array, given: Array, out: Array, slot: Array) -> Any:
        """Return the signals of an incident of contact row c."""
        from mbsim.arrays import codes
        from mbsim.dynamics.contact import forces as at
        from mbsim.laws.abi import FORCE_X_OUT, FORCE_Y_OUT, FRICTION_INPUTS, TORQUE_Z_OUT
        from mbsim.laws.catalog import FRICTION_LAWS

        contacts, id = self.system.scene.contacts, self.system.contact_ids[c]
        kind = self.system.model.contacts[id].cff_type
        has_friction = contacts.friction_law[c] != 0
        nforce = float(slot[at.NORMAL])
        friction = out[[FORCE_X_OUT, FORCE_Y_OUT, TORQUE_Z_OUT]] if has_friction else np.zeros(3)
        sticks = kind in FRICTION_LAWS and FRICTION_LAWS[kind].modes
        signals: dict[str, Any] = {
            "mu": math.hypot(friction[0], friction[1]) / nforce if nforce != 0.0 else math.nan,
            "force": slot[at.FORCE : at.FORCE + 3],
            "torque": slot[at.TORQUE : at.TORQUE + 3],
            "mode": _MODES.get(float(slot[at.MODE]), "") if sticks else "",
            "slip": float(slot[at.SLIP]),
            "xdot": given[5:8] if has_friction else np.full(3, math.nan),
            "x": row[codes.INC_X : codes.INC_X + 3],
            "depth": float(slot[at.DEPTH]),
            "rate": float(slot[at.RATE]),
            "nforce": nforce,
            "friction": friction,
            "stored": float(slot[at.STORED] + slot[at.FRICTION_STORED]),
            "point": row[codes.INC_POINT : codes.INC_POINT + 3],
            "normal": row[codes.INC_NORMAL : codes.INC_NORMAL + 3],
            "area": float(row[-codes.INC_REGION]) if self.region else 0.0,
        }
        kept = int(contacts.memory[c])
        for k in range(kept if contacts.carried[c] < kept else 0):
            signals[f"state{k}"] = float(given[FRICTION_INPUTS + k])
        if has_friction and id in self.system.user_friction:
            signals |= self._espied(id, given)
        return signals

    def _espied(self, id: int, given: Array) -> dict[str, Value]:
        """Return what a user's function names by `espy`, which is run interpreted."""
        from mbsim.laws.abi import FRICTION_INPUTS
        from mbsim.plugins import host

        user = self.system.user_friction[id]
        if user.function is None:
            return {}
        a = given.tolist()
        outer, host.signals = host.state, {}
        try:
            if host.seen is not None:
                host.state = (host.seen[0], a[0], host.seen[1])
            user.call(
                a[0], user.par, a[13:16], a[16:19], a[2:5], a[5:8], a[10],
                int(a[19]), a[FRICTION_INPUTS:], a[11],
            )  # fmt: skip
            for name in host.signals:
                # what is one number may be the user's own
                if OF_INCIDENTS.get(name, 1) > 1:
                    raise ModelError(
                        f"{user.source}: espy({name}=...): {name} is a vector of every incident; "
                        "choose another name"
                    )
            return {name: _plain(value) for name, value in host.signals.items()}
        finally:
            host.state, host.signals = outer, None


def _plain(value: Any) -> Value:
    """Return a signal as a number, or as text."""
    if isinstance(value, str):
        return value
    try:
        return float(value)
    except (TypeError, ValueError):
        return str(value)


def _net(net: Array) -> dict[str, Any]:
    """Return the signals of a contact."""
    return {
        "force": net[0:3],
        "torque": net[3:6],
        "penetration": float(net[6]),
        "slip_speed": float(net[7]),
        "incidents": float(net[8]),
        "area": float(net[9]),
    }


@dataclass(frozen=True)
class Wanted:
    """A name that was asked for."""

    name: str
    contact: int
    incident: int | None
    signal: str
    part: str


def _wanted(name: str, ids: Sequence[int]) -> Wanted:
    """Return what a name stands for, as far as that can be said before rows are known."""
    match = _NAME.fullmatch(name.strip())
    if match is None:
        such = f"Force_Contact[{ids[0] if ids else 1}]"
        plotted = "; with slashes it is one for mbsim plot" if _PLOTTED.match(name.strip()) else ""
        raise ModelError(
            f"{name}: no name of a signal{plotted}; such are {such}.force and {such}.incident[0].mu"
        )
    contact, incident, signal, part = match.groups()
    if int(contact) not in ids:
        there = ", ".join(f"Force_Contact[{id}]" for id in ids) or "no contacts"
        raise ModelError(f"{name}: no such contact; there are {there}")
    k = None if incident is None else int(incident)
    return Wanted(name.strip(), int(contact), k, signal, part or "")


def request(results: Results, names: Sequence[str]) -> tuple[Array, dict[str, list[Value]]]:
    """Return the times of all rows, and what each name stands for, column by column.

    Where a row has no such incident a number is nan and a text is empty. A name of three numbers
    becomes three columns, name/x to name/z, unless one of these, or name/mag, is asked for.

    Raises
    ------
    ModelError
        If a name does not exist, or the model is not that of the run any more.
    """
    from mbsim.run.asked_elements import columns_of, is_of_element

    again: Replay | None = None
    rows: list[Row] | None = None

    def replayed() -> list[Row]:
        nonlocal again, rows
        again = again or Replay(results)
        rows = list(again.rows()) if rows is None else rows
        return rows

    def espied() -> list[Any]:
        return [row.espied for row in replayed()]

    def model() -> Model:
        nonlocal again
        again = again or Replay(results)
        return again.system.model

    others = [name for name in names if not is_of_element(name)]
    if others:
        again = Replay(results)
        for name in others:
            _wanted(name, again.system.contact_ids)
    columns: dict[str, list[Value]] = {}
    for name in names:
        if is_of_element(name):
            columns |= columns_of(results, name, espied, model)
        else:
            found = replayed()
            assert again is not None
            columns |= _columns(_wanted(name, again.system.contact_ids), found)
    return np.atleast_1d(np.asarray(results["time"], dtype=np.float64)), columns


def _columns(wanted: Wanted, rows: Sequence[Row]) -> dict[str, list[Value]]:
    """Return the columns of one name."""
    if wanted.incident is None:
        there = [[row.contacts[wanted.contact]] for row in rows]
        known = dict(OF_CONTACTS)
    else:
        k = wanted.incident
        there = [row.incidents[wanted.contact][k : k + 1] for row in rows]
        known = dict(OF_INCIDENTS)
        most = max((len(row.incidents[wanted.contact]) for row in rows), default=0)
        if k >= most:
            at_most = f"at most {most}, the last is incident[{most - 1}]" if most else "none"
            raise ModelError(f"{wanted.name}: no such incident; the rows have {at_most}")
    for signals in (signals for found in there for signals in found):
        known.update(dict.fromkeys(signals.keys() - known.keys(), 1))
    if wanted.signal not in known:
        others = "" if wanted.incident is not None else ", incident[0].mu and others of incidents"
        raise ModelError(f"{wanted.name}: no such signal; there are {', '.join(known)}{others}")
    parts = (*_AXES, "mag") if known[wanted.signal] == 3 else ()
    if wanted.part and wanted.part not in parts:
        what = f"there are /{', /'.join(parts)}" if parts else f"{wanted.signal} is one number"
        raise ModelError(f"{wanted.name}: no such part; {what}")
    values = [found[0].get(wanted.signal) if found else None for found in there]
    if not parts:
        text = any(isinstance(value, str) for value in values)
        return {wanted.name: [("" if text else math.nan) if v is None else v for v in values]}
    base = wanted.name.rpartition("/")[0] if wanted.part else wanted.name
    table = np.array([np.full(3, math.nan) if v is None else v for v in values]).reshape(-1, 3)
    if wanted.part == "mag":
        return {wanted.name: np.linalg.norm(table, axis=1).tolist()}
    chosen = [wanted.part] if wanted.part else list(_AXES)
    return {f"{base}/{part}": table[:, _AXES.index(part)].tolist() for part in chosen}

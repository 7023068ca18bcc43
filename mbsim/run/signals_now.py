"""Signals of a run at its present time, by the names that result files have for them.

What follows from y alone is read from there; the rest from a row that is evaluated when it is
asked for, once between two steps.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields
from operator import itemgetter
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.arrays.codes import (
    CONTACT_AREA,
    CONTACT_COLUMNS,
    CONTACT_DEPTH,
    CONTACT_FORCE,
    CONTACT_INCIDENTS,
    CONTACT_SLIP,
    CONTACT_TORQUE,
)
from mbsim.core.layout import AT_Q, AT_V, AT_W, BODY_SIZE
from mbsim.errors import UnknownSignal
from mbsim.results.blocks import Block
from mbsim.results.elements import GROUPS, acting, labels
from mbsim.results.forces import Forces
from mbsim.results.motion import motion
from mbsim.results.names import PARTS, by_label, compact, nearest, parts_of
from mbsim.results.requests import MAGNITUDES, places, request_table
from mbsim.results.signals import names_of
from mbsim.results.watch import energies

if TYPE_CHECKING:
    from mbsim.compile_model.build import System

Get = Callable[[], Any]
_OF_BODIES = {"position": (0, AT_Q), "quaternion": (AT_Q, AT_V), "velocity": (AT_V, AT_W)}
_OF_CONTACTS: dict[str, slice | int] = {
    "force": slice(CONTACT_FORCE, CONTACT_FORCE + 3),
    "torque": slice(CONTACT_TORQUE, CONTACT_TORQUE + 3),
    "penetration": CONTACT_DEPTH,
    "slip_speed": CONTACT_SLIP,
    "incidents": CONTACT_INCIDENTS,
    "area": CONTACT_AREA,
}
_OF_ELEMENTS = {"force": slice(0, 3), "torque": slice(3, 6)}


class SignalsNow(Mapping[str, Any]):
    """Values at the present time by name: numbers, and arrays (3,), (4,) or (8,).

    Parameters
    ----------
    system : System
    time : callable
        Returns the present time.
    y : ndarray
        The committed point.
    evaluate : callable
        Returns the row of the scene's tables that holds the present time.
    """

    def __init__(
        self, system: System, time: Callable[[], float], y: Any, evaluate: Callable[[], int]
    ) -> None:
        self._system, self._y, self._evaluate = system, y, evaluate
        self._rows = system.scene.rows
        self._names = ["time", *(n for n in names_of(system) if _is_one(n))]
        self._getters: dict[str, Get] = {"time": time}
        self._known = set(self._names)

    def __getitem__(self, name: str) -> Any:
        get = self._getters.get(name)
        if get is None:
            get = self._getters[name] = self._getter(name)
        return get()

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def __contains__(self, name: object) -> bool:
        if not isinstance(name, str):
            return False
        try:
            self._getters.setdefault(name, self._getter(name))
        except UnknownSignal:
            return False
        return True

    def _ipython_key_completions_(self) -> list[str]:
        return self._names

    def _getter(self, name: str) -> Get:
        """Return what gives a signal or a component of one."""
        if name in self._getters:
            return self._getters[name]
        whole = name.strip("/")
        if whole in self._known:
            return self._whole(whole)
        whole, _, part = whole.rpartition("/")
        if whole in self._known:
            get = self._whole(whole)
            size = np.size(get())
            if part == "mag" and size == 3:
                return lambda: float(np.linalg.norm(get()))
            if part in PARTS.get(size, {}):
                return self._component(whole, get, PARTS[size][part])
            parts = ", ".join(parts_of(size)) or "no parts"
            raise UnknownSignal(f"no signal {name!r}; {whole} has {parts}")
        asked = name.strip("/")
        written = by_label(asked, labels(self._system.model, asked.partition("/")[0]))
        near = [written] if written and written in self else nearest(asked, self._known)
        hint = f"; did you mean {' or '.join(near)}?" if near else ""
        raise UnknownSignal(f"no signal {name!r}{hint}; there is {', '.join(compact(self._names))}")

    def _component(self, whole: str, get: Get, column: int) -> Get:
        """Return what gives one number of a signal."""
        group, id, last = (*whole.split("/"), "", "")[:3]
        if group == "bodies" and last in _OF_BODIES:
            y = self._y
            at = self._body(id) + _OF_BODIES[last][0] + column
            return lambda: float(y[at])
        return lambda: float(get()[column])

    def _body(self, id: str) -> int:
        """Return where in y a body begins."""
        return BODY_SIZE * list(self._system.body_ids).index(int(id))

    def _whole(self, name: str) -> Get:
        """Return what gives a signal."""
        system, rows, evaluate = self._system, self._rows, self._evaluate
        group, _, rest = name.partition("/")
        id, _, last = rest.partition("/")
        if group == "time":
            return self._getters["time"]
        if group == "bodies":
            return self._of_body(self._body(id), last)
        if group == "contacts":
            at = CONTACT_COLUMNS * list(system.contact_ids).index(int(id))
            return _row_part(lambda: rows.contact[evaluate()], at, _OF_CONTACTS[last])
        if group == "energy":
            column = energies(system).index(rest)
            return lambda: float(rows.energy[evaluate(), column])
        if group == "diffs":
            place = int(system.scene.states.offset[list(system.model.differentials).index(int(id))])
            return lambda: float(self._y[place])
        if group == "requests":
            request = system.model.requests[int(rest)]
            if request.type == "EXPRESSION":
                return self._of_expressions(request)
            return lambda: self._request(request)
        return self._of_element(group, int(id), last)

    def _of_body(self, at: int, last: str) -> Get:
        """Return what gives a signal of the body that begins there in y."""
        y = self._y
        if last in _OF_BODIES:
            first, end = (at + k for k in _OF_BODIES[last])
            return lambda: y[first:end].copy()
        if last == "angular_velocity":
            q, w = y[at + AT_Q : at + AT_V], y[at + AT_W : at + BODY_SIZE]
            return lambda: np.array(_turned(*q.tolist(), *w.tolist()))
        rows, evaluate, column = self._rows, self._evaluate, 6 * (at // BODY_SIZE)
        return lambda: rows.accel[evaluate(), column : column + 3].copy()

    def _of_element(self, group: str, id: int, last: str) -> Get:
        """Return what gives the force or torque of an element, or an unknown of one."""
        system, rows, evaluate = self._system, self._rows, self._evaluate
        for k, (statement, other) in enumerate(acting(system)):
            if GROUPS[statement].path == group and other == id and last in _OF_ELEMENTS:
                held = len(system.connections)
                part = _OF_ELEMENTS[last]
                if k < held:
                    return _row_part(lambda: rows.joint[evaluate()], 6 * k, part)
                return _row_part(lambda: rows.applied[evaluate()], 6 * (k - held), part)
        unknowns = dict(system.unknowns())
        column = unknowns[f"{group}/{id}/{last}"]
        return lambda: float(rows.value[evaluate(), column])

    def _of_expressions(self, request: Any) -> Get:
        """Return what gives F1 to F8 of an EXPRESSION, as `results.requests` has them of rows.

        A controller reads them at every step: plain numbers are read sooner than arrays.
        """
        value, evaluate = self._rows.value, self._evaluate
        given = places(request, self._system.values)
        first, end = min(given.values(), default=0), max(given.values(), default=-1) + 1
        # of a number that the deck does not give, the 0 behind those that it gives
        numbers = itemgetter(*(given.get(number, end) - first for number in range(1, 9)))
        magnitudes = [number for number in MAGNITUDES if number not in given]

        def now() -> Any:
            values = value[evaluate(), first:end].tolist()
            values.append(0.0)
            found = list(numbers(values))
            for k in magnitudes:
                found[k - 1] = math.hypot(*found[k : k + 3])
            return np.array(found)

        return now

    def _request(self, request: Any) -> Any:
        """Return F1 to F8 of a request."""
        k = self._evaluate()
        block = Block(*(getattr(self._rows, f.name)[k : k + 1] for f in fields(Block)))
        system = self._system
        bodies = motion(system.body_ids, block.y, block.accel)
        forces = Forces(system, bodies, block.joint, block.applied, block.contact)
        markers = system.placement.markers
        return np.array(request_table(request, markers, forces, block.value)[0])


def _is_one(name: str) -> bool:
    """Return whether a dataset has a value at every time."""
    return name not in ("time", "events") and not name.startswith("state/")


def _turned(
    a: float, b: float, c: float, d: float, x: float, y: float, z: float
) -> tuple[float, float, float]:
    """Return the vector (x, y, z) turned by the unit quaternion (a, b, c, d), w first."""
    # as `results.motion.rotate` has it for arrays: v + 2 u x (u x v + a v)
    e = c * z - d * y + a * x
    f = d * x - b * z + a * y
    g = b * y - c * x + a * z
    return x + 2.0 * (c * g - d * f), y + 2.0 * (d * e - b * g), z + 2.0 * (b * f - c * e)


def _row_part(row: Callable[[], Any], at: int, part: slice | int) -> Get:
    """Return what gives numbers of a row from a place on."""
    if isinstance(part, int):
        column = at + part
        return lambda: float(row()[column])
    columns = slice(at + part.start, at + part.stop)
    return lambda: row()[columns].copy()

"""What Activate and Deactivate switch of a `System`: forces give nothing, equations do not hold.

No layout changes: a joint that is switched is none of the tree (`mechanism`), a force that is off
has a program that is 0 or no components, a contact ignores every depth, and a sensor looks at what
does not become true.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mbsim.arrays.codes import (
    COMPONENT,
    JOINT_FRICTION,
    MORE,
    MULTI_POINT,
    ON,
    PROGRAM,
    ROW_OF,
    SCALAR,
    VECTOR_FORCE,
    WRENCH,
)
from mbsim.compile_model.build import System
from mbsim.dynamics.contact.forces import IGNORE_DEEPER

Inactive = tuple[tuple[str, int], ...]

#: Tables of the model whose elements are connections, by what `System.connections` calls them.
CONNECTIONS = {
    "JOINT": "joints",
    "JPRIM": "primitives",
    "COUPLER": "couplers",
    "MOTION": "motions",
    "GCON": "general_constraints",
    "PTCV": "points_on_curves",
    "CVCV": "curves_on_curves",
    "PTSF": "points_on_surfaces",
}
_OF_APPLIED = ("form", "program", "components", "connection", "law", "by_reactions")
_OF_SENSORS = ("program", "compare", "value", "located")
#: A sensor's value that no expression exceeds.
_NEVER = 1e300


class Activity:
    """Lets elements of a system take part or not."""

    def __init__(self, system: System) -> None:
        self.system = system
        self._base: dict[str, np.ndarray[Any, Any]] | None = None

    def _begin(self) -> dict[str, np.ndarray[Any, Any]]:
        """Return the arrays as they are where everything takes part."""
        scene = self.system.scene
        if self._base is None:
            self._base = {n: getattr(scene.applied, n).copy() for n in _OF_APPLIED}
            self._base |= {
                f"of sensors: {n}": getattr(scene.sensors, n).copy() for n in _OF_SENSORS
            }
            self._base["deeper"] = scene.contacts.numbers[:, IGNORE_DEEPER].copy()
        return self._base

    def apply(self, inactive: Inactive, before: Inactive = ()) -> None:
        """Let these elements take no part, and all others; `before` those that took none so far."""
        system, scene, base = self.system, self.system.scene, self._begin()
        those = set(inactive)
        for name in _OF_APPLIED:
            getattr(scene.applied, name)[...] = base[name]
        for f, element in enumerate(system.applied):
            if element in those:
                self._take_out(f)
        self._look_by(those, set(before))
        scene.contacts.numbers[:, IGNORE_DEEPER] = base["deeper"]
        for c, id in enumerate(system.contact_ids):
            if ("contacts", id) in those:
                scene.contacts.numbers[c, IGNORE_DEEPER] = -1.0
        equations = scene.equations
        for e, c in enumerate(equations.connection):
            statement, id = system.connections[c] if c >= 0 else ("", 0)
            equations.off[e] = int(c >= 0 and (CONNECTIONS[statement], id) in those)

    def _take_out(self, f: int) -> None:
        """Let row f of `Applied` give nothing."""
        applied, nothing = self.system.scene.applied, self.system.nothing
        for u in np.flatnonzero(applied.by_reactions[:, ROW_OF] == f):
            applied.by_reactions[u, PROGRAM] = nothing
            if applied.by_reactions[u, COMPONENT] == JOINT_FRICTION:
                applied.by_reactions[u, COMPONENT] = SCALAR
        if applied.form[f] in (VECTOR_FORCE, WRENCH, MULTI_POINT) or applied.connection[f] >= 0:
            # friction in a joint is settled with the reactions, or else not at all
            applied.form[f], applied.components[f] = VECTOR_FORCE, -1
            applied.connection[f], applied.law[f] = -1, 0
        else:
            applied.program[f] = nothing

    def _look_by(self, those: set[tuple[str, int]], before: set[tuple[str, int]]) -> None:
        """Let the sensors among them look at what does not become true."""
        scene, base = self.system.scene, self._begin()
        sensors, sensed = scene.sensors, scene.state.sensed
        for name in _OF_SENSORS:
            getattr(sensors, name)[...] = base[f"of sensors: {name}"]
        for k, id in enumerate(sensors.id):
            if ("sensors", int(id)) in those:
                sensors.program[k], sensors.compare[k] = self.system.nothing, MORE
                sensors.value[k], sensors.located[k] = _NEVER, 0
            elif ("sensors", int(id)) in before:
                # what is true as it is activated becomes true then
                sensed[k, ON] = 0.0

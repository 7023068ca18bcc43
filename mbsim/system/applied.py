"""Springs, dampers and scalar forces as rows."""

from __future__ import annotations

import numpy as np

from mbsim.model.elements import Model
from mbsim.system import arrays as a
from mbsim.system.markers import MarkerTable
from mbsim.system.programs import ProgramTable


def applied_forces(
    model: Model, markers: MarkerTable, programs: ProgramTable
) -> tuple[a.Applied, list[tuple[str, int]]]:
    """Return the forces between markers, and for each row its element: (statement, id)."""
    springs, forces = model.spring_dampers.values(), model.scalar_forces.values()
    elements = [("SPRINGDAMPER", spring.id) for spring in springs]
    elements += [("SFORCE", force.id) for force in forces]
    n = len(elements)
    made = a.Applied(
        kind=np.zeros(n, dtype=np.int64),
        i=np.zeros(n, dtype=np.int64),
        j=np.zeros(n, dtype=np.int64),
        par=np.zeros((n, 4)),
        program=np.full(n, -1, dtype=np.int64),
        angle=np.full(n, -1, dtype=np.int64),
        alone=np.zeros(n, dtype=np.int64),
    )
    for k, element in enumerate([*springs, *forces]):
        made.i[k], made.j[k] = markers.row(element.i_marker_id), markers.row(element.j_marker_id)
        made.kind[k] = a.AXIS_TORQUE if element.type == "ROTATIONAL" else a.LINE_FORCE
    for k, spring in enumerate(springs):
        made.par[k] = spring.stiffness, spring.damping, spring.length, spring.preload
        if made.kind[k] == a.AXIS_TORQUE:
            made.angle[k] = markers.angle(int(made.i[k]), int(made.j[k]))
    for k, force in enumerate(forces, len(springs)):
        made.program[k] = programs.add(force.expr, force)
        if force.action_only:
            made.alone[k] = 1
            if made.kind[k] == a.LINE_FORCE:
                made.kind[k] = a.AXIS_FORCE
    return made, elements

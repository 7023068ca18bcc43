"""User subroutines of forces and variables, in order of their rows."""

from __future__ import annotations

from mbsim.model.elements import Model
from mbsim.model.source import Subroutine


def wanted(model: Model) -> list[tuple[str, str, int, Subroutine, int]]:
    """Return statement, XML statement, id, subroutine and number of results of all users'."""
    found = []
    for force in model.scalar_forces.values():
        if force.user is not None:
            found.append(("SFORCE", "Force_Scalar_TwoBody", force.id, force.user, 1))
    for variable in model.variables.values():
        if variable.user is not None:
            found.append(("VARIABLE", "Reference_Variable", variable.id, variable.user, 1))
    for statement, xml, table in (
        ("VECTORFORCE", "Force_Vector_TwoBody", model.vector_forces),
        ("BODYFORCE", "Force_Vector_OneBody", model.body_forces),
    ):
        for vector in table.values():
            if vector.user is not None:
                count = sum(expr is not None for expr in vector.exprs)
                found.append((statement, xml, vector.id, vector.user, count))
    return found

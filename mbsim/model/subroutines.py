"""User subroutines of forces and variables, in order of their rows."""

from __future__ import annotations

from mbsim.forces.catalog import Components, Expressed, of_form
from mbsim.model.elements import Model
from mbsim.model.source import Subroutine


def wanted(model: Model) -> list[tuple[str, str, int, Subroutine, int]]:
    """Return statement, XML statement, id, subroutine and number of results of all users'."""
    found = []
    for kind in of_form(Expressed):
        for force in model.table(kind.name).values():
            if force.user is not None:
                found.append((kind.name, kind.statement, force.id, force.user, 1))
    for variable in model.variables.values():
        if variable.user is not None:
            found.append(("VARIABLE", "Reference_Variable", variable.id, variable.user, 1))
    for kind in of_form(Components):
        for vector in model.table(kind.name).values():
            if vector.user is not None:
                count = sum(expr is not None for expr in vector.exprs)
                found.append((kind.name, kind.statement, vector.id, vector.user, count))
    return found

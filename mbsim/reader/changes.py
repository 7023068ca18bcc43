"""Statements of <Command> that change an element between simulations, by its id.

What such a statement does not give stays: it is read as the element's own statement with the
given attributes in place of those before, so all that is checked there is checked here.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from mbsim.forces.catalog import FORCES
from mbsim.model.elements import Change
from mbsim.reader.constraints import complete_motions
from mbsim.reader.draft import Draft
from mbsim.reader.keywords import fold
from mbsim.reader.parse import Node
from mbsim.reader.statement import Statement

_NORMAL = "stiffness exponent damping dmax penalty restitution_coef ref_velocity normal_trans_vel"
_FRICTION = "mu_static mu_dynamic stiction_trans_vel friction_trans_vel"
_ELASTIC = "i_elastic_modulus j_elastic_modulus i_poisson_ratio j_poisson_ratio i_radius j_radius"
_ELASTIC += " i_layer_depth j_layer_depth"
#: Statement, the table of its elements, and what of them may change between simulations.
CHANGEABLE = {
    **{
        kind.statement: (kind.table or name, " ".join(kind.changes))
        for name in FORCES
        if (kind := FORCES[name]).changes
    },
    "Force_Contact": ("contacts", f"{_NORMAL} {_FRICTION} {_ELASTIC}"),
    "Motion_Joint": ("motions", "expr"),
    "Reference_Variable": ("variables", "expr"),
}


def change(statement: Statement, node: Node, draft: Draft) -> None:
    """Read one change into the draft; faults go there too."""
    table, words = CHANGEABLE[statement.name]
    given = node.find("id")
    key = given.value.strip() if given else ""
    label = statement.name + (f"[{key[:40]}]" if given else "")
    before = draft.nodes.get((statement.name, key))
    if before is None:
        known = ", ".join(id for name, id in draft.nodes if name == statement.name) or "none"
        message = f"changes no element: <Model> has {statement.name} {known[:200]}"
        draft.fault(node.line, label, message)
        return
    allowed = {fold(word): word for word in words.split()}
    names = statement.spec_names
    for attribute in node.attributes:
        name = fold(names.get(fold(attribute.name), attribute.name))
        if name not in allowed and name != "id":
            message = (
                f'{attribute.name}="{attribute.value[:60]}": cannot change between simulations; '
                f"what can: {', '.join(allowed.values())}"
            )
            draft.fault(attribute.line, label, message)
            return
    new = {fold(names.get(fold(a.name), a.name)) for a in node.attributes}
    kept = [a for a in before.attributes if fold(names.get(fold(a.name), a.name)) not in new]
    merged = replace(before, line=node.line, attributes=[*kept, *node.attributes])
    # warnings and notes of what did not change have been said
    of_kind = table in FORCES and not FORCES[table].table
    empty: dict[str, Any] = {"marker_forces" if of_kind else table: {}}
    scratch = replace(draft, **empty, in_command=False, broken=set(), warnings=[], note_lines={})
    statement.read(merged, scratch)
    complete_motions(scratch)
    elements: dict[int, Any] = (
        scratch.marker_forces.get(table, {}) if of_kind else getattr(scratch, table)
    )
    for element in elements.values():
        draft.nodes[statement.name, key] = merged
        said = " ".join(f'{a.name}="{a.value}"' for a in node.attributes if fold(a.name) != "id")
        draft.changes = (*draft.changes, Change(table, element, f"{label}: {said}"))

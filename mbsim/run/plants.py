"""What linear analyses of a deck take as inputs and outputs: variables, as the caller's and values.

An input u of a variable whose expression is a number is that number. To any other expression u is
added, as a variable of its own that is 0.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from mbsim.expressions.tree import Call, Expression, Number
from mbsim.model.elements import InputElement, Model, Variable


def with_plants(model: Model) -> Model:
    """Return the model with what linear analyses need of it, behind what it has."""
    wanted = {id for each in model.simulations for id in each.linear.inputs}
    there = {(each.table, each.id) for each in model.inputs}
    variables, inputs, added = dict(model.variables), list(model.inputs), dict[int, int]()
    for id in sorted(wanted):
        expression = variables[id].expr
        if isinstance(expression.root, Number) and not _is_changed(model, id):
            if ("variables", id) not in there:
                inputs.append(InputElement("variables", id, expression.root.value))
            continue
        added[id] = max(variables) + 1
        source = variables[id].source
        variables[added[id]] = Variable(added[id], Expression("0", Number(0.0)), source=source)
        variables[id] = _plus(variables[id], added[id])
        inputs.append(InputElement("variables", added[id], 0.0))
    simulations = tuple(
        replace(each, changes=tuple(_changed(change, added) for change in each.changes))
        for each in model.simulations
    )
    outputs = tuple(dict.fromkeys(id for s in model.simulations for id in s.linear.outputs))
    if not wanted and not outputs:
        return model
    return replace(
        model,
        variables=variables,
        inputs=tuple(inputs),
        simulations=simulations,
        added=added,
        looked_at=outputs,
    )


def _is_changed(model: Model, id: int) -> bool:
    """Return whether commands change a variable: its number is no longer one place then."""
    changes = (change for each in model.simulations for change in each.changes)
    return any(change.table == "variables" and change.element.id == id for change in changes)


def _changed(change: Any, added: Mapping[int, int]) -> Any:
    """Return a change of a variable with the input that is added to it."""
    if change.table != "variables" or change.element.id not in added:
        return change
    return replace(change, element=_plus(change.element, added[change.element.id]))


def _plus(variable: Variable, other: int) -> Variable:
    """Return a variable with another one added to it."""
    root = Call("ADD", (variable.expr.root, Call("VARVAL", (Number(float(other)),))))
    text = f"{variable.expr.text} + VARVAL({other})"
    return replace(variable, expr=Expression(text, root))

"""What nonsmooth time stepping cannot run, said by element and line."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from mbsim.errors import ModelError
from mbsim.forces.catalog import FORCES, OfResidual, Switched
from mbsim.model.names import element_name

if TYPE_CHECKING:
    from mbsim.model.elements import Model


def _refused(model: Model) -> Iterator[tuple[str, Mapping[int, Any], str]]:
    """Yield statement, elements and why they are not run."""
    bound = "a joint's bounds are those of a compliant law"
    yield "Force_JointLimit", model.joint_limits, bound
    for name in FORCES:
        kind = FORCES[name]
        if isinstance(kind.form, OfResidual):
            why = "a residual is solved by methods that estimate their error"
            yield kind.statement, model.table(kind.name), why
        elif isinstance(kind.form, Switched):
            why = "what switches within a step is located by methods that estimate their error"
            yield kind.statement, model.table(kind.name), why
    friction = "friction in joints follows from their reactions, which impulses do not give"
    yield "Force_JointFriction", model.joint_frictions, friction
    posts = {i: c for i, c in model.contacts.items() if c.cpost is not None}
    yield "Force_Contact", posts, "a CONTACTPOST is asked of compliant contacts"


#: Moving bodies in contact from which on a pile is what a model is.
MANY = 20


def serves_better(model: Model) -> str:
    """Return what is to be said where MOREAU would serve a model better than AUTO, else nothing.

    That is a pile: many free bodies that contacts alone hold. Its compliant contacts need steps as
    short as they are stiff.
    """
    moving = sum(not body.is_ground for body in model.bodies.values())
    if not model.contacts or moving < MANY:
        return ""
    switched = any(simulation.inactive for simulation in model.simulations)
    if switched or any(table for _, table, _ in _refused(model)):
        return ""
    return (
        f"{moving} free bodies in contact: integrator MOREAU takes them as rigid, by steps that "
        "no stiffness bounds (manual: computation/rigid-contact)"
    )


def refuse(model: Model) -> None:
    """Raise what a model has that MOREAU cannot run."""
    for simulation in model.simulations:
        if simulation.inactive:
            raise ModelError(
                f"{model.file}:{simulation.source.line}: Simulate: integrator MOREAU cannot run "
                "this: elements are not active all the time; take AUTO"
            )
    for statement, elements, why in _refused(model):
        for element in elements.values():
            xml = getattr(element, "statement", statement)
            name = element_name(model.file, xml, element.id)
            raise ModelError(
                f"{model.file}:{element.source.line}: {name}: integrator MOREAU cannot run this: "
                f"{why}; take AUTO"
            )

"""Elements that exert forces: what they are called in decks, in result files and on pictures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from copy import copy
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from mbsim.forces.catalog import FORCES
from mbsim.model.elements import Model
from mbsim.model.names import element_name

if TYPE_CHECKING:
    from mbsim.compile_model.build import System


@dataclass(frozen=True)
class Group:
    """Elements of one statement: where a model and a result file have them, and their names."""

    member: str  # of Model: see its `table`
    path: str  # in result files
    one: str  # on pictures
    title: str  # in messages, with the id behind it


#: By the statement of `System.connections` and `System.applied`.
GROUPS = {
    "JOINT": Group("joints", "joints", "joint", "Constraint_Joint"),
    "JPRIM": Group("primitives", "primitives", "primitive", "Constraint_Jprim"),
    "COUPLER": Group("couplers", "couplers", "coupler", "Constraint_Coupler"),
    "MOTION": Group("motions", "motions", "motion", "Motion_Joint"),
    "GCON": Group(
        "general_constraints", "general_constraints", "general constraint", "Constraint_General"
    ),
    "PTCV": Group("points_on_curves", "points_on_curves", "point on a curve", "Constraint_PTCV"),
    "CVCV": Group("curves_on_curves", "curves_on_curves", "curve on a curve", "Constraint_CVCV"),
    "PTSF": Group(
        "points_on_surfaces", "points_on_surfaces", "point on a surface", "Constraint_PTSF"
    ),
    **{name: Group(name, k.path, k.title, k.statement) for name in FORCES if (k := FORCES[name])},
    "CONTACT": Group("contacts", "contacts", "contact", "Force_Contact"),
}
#: Those that hold degrees of freedom, then those that push.
CONSTRAINTS = ("JOINT", "JPRIM", "COUPLER", "MOTION", "GCON", "PTCV", "CVCV", "PTSF")
APPLIED = tuple(FORCES)


def elements_of(model: Model, statement: str) -> Mapping[int, Any]:
    """Return the elements of a statement by id."""
    return model.table(GROUPS[statement].member)


def with_own_tables(model: Model) -> Model:
    """Return the model with tables of its own: an element put into the other's changes nothing."""
    found = copy(model)
    for name, value in vars(model).items():
        if isinstance(value, dict):
            own = {key: dict(v) if isinstance(v, dict) else v for key, v in value.items()}
            vars(found)[name] = own
    return found


def title(model: Model, statement: str, id: int) -> str:
    """Return an element's name and label: ``Constraint_Joint[1] crank``, ``JOINT/1`` of Adams."""
    element = elements_of(model, statement)[id]
    xml = getattr(element, "statement", GROUPS[statement].title)
    return f"{element_name(model.file, xml, id)} {element.label}".rstrip()


def acting(system: System) -> list[tuple[str, int]]:
    """Return statement and id of all elements between markers, as rows have them."""
    return [*system.connections, *system.applied]


def facts(model: Model) -> Iterator[tuple[str, dict[str, str]]]:
    """Yield the name of each such element in a result file, with its type and label."""
    for statement in (*CONSTRAINTS, *APPLIED):
        for id, element in elements_of(model, statement).items():
            about = {"type": getattr(element, "type", ""), "label": element.label}
            yield (
                f"{GROUPS[statement].path}/{id}",
                {name: text for name, text in about.items() if text},
            )


def labels(model: Model, group: str) -> dict[str, int]:
    """Return the labels of the elements of a group of a result file, ``bodies``, with their ids."""
    tables: dict[str, Mapping[int, Any]] = {
        "bodies": model.bodies,
        "requests": model.requests,
        **{each.path: elements_of(model, name) for name, each in GROUPS.items()},
    }
    return {each.label: id for id, each in tables.get(group, {}).items() if each.label}


def equations(model: Model) -> int:
    """Return how many scalar equations the model's constraints are, redundant ones included."""
    from mbsim.joints.catalog import JOINTS

    held = sum(
        len(JOINTS[joint.type].equations)
        for joint in (*model.joints.values(), *model.primitives.values())
    )
    held += 2 * len(model.points_on_curves) + 3 * len(model.curves_on_curves)
    held += len(model.points_on_surfaces)
    return held + len(model.couplers) + len(model.motions) + len(model.general_constraints)

"""What a `mbsim.Model` calls each statement, and how it takes Python's values as attributes."""

from __future__ import annotations

import inspect
import keyword
import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field

from mbsim.errors import ModelError
from mbsim.reader.keywords import fold
from mbsim.reader.kinds import ID, IDS
from mbsim.reader.statement import Statement
from mbsim.reader.statements import STATEMENTS
from mbsim.reader.written import written

#: Statements of bodies.
BODIES = ("Body_Rigid", "Body_Point")
#: Words of the attributes that name other elements, and the statements of those.
_NAMED_BY = {
    "marker": ("Reference_Marker",),
    **dict.fromkeys(("rm", "cg", "im", "lprf", "vm", "wm"), ("Reference_Marker",)),
    **dict.fromkeys(("body", "bodies"), BODIES),
    "clusters": ("Reference_2DCluster",),
    "graphics": ("Post_Graphic",),
    "joint": ("Constraint_Joint",),
    "array": ("Reference_Array",),
    **dict.fromkeys(("matrix", "mtx", "kmtx", "cmtx"), ("Reference_Matrix",)),
    "curve": ("Reference_ParamCurve",),
    "surface": ("Reference_ParamSurface",),
    "pinput": ("Control_PlantInput",),
    "poutput": ("Control_PlantOutput",),
    "evaluate": ("Sensor_Evaluate",),
}
_AXES = "xyz"
_SQUARES = ("xx", "yy", "zz", "xy", "yz", "xz")


@dataclass(frozen=True)
class Element:
    """An element of a `mbsim.Model`; it stands for its id, as text too.

    A body's `marker` is that of its centre of mass, which it stands for in a marker's place.
    """

    statement: str
    id: int
    marker: Element | None = None
    owner: str = field(default="", compare=False)  # which model it is of, and copies of that

    def __str__(self) -> str:
        return str(self.id)

    def __repr__(self) -> str:
        return f"{self.statement}[{self.id}]"


def calls() -> dict[str, Statement]:
    """Return the statements by what a model calls them.

    That is the statement's name without its first word, as ``spring_damper``; of two that would
    be called the same, the later one keeps its first word: ``joint`` and ``motion_joint``.
    """
    found: dict[str, Statement] = {}
    for statement in STATEMENTS:
        whole = re.sub("(?<=[a-z])(?=[A-Z])", "_", statement.name).lower()
        name = statement.call or whole.partition("_")[2] or whole
        if not statement.call and ("_" not in statement.name or name in found):
            name = whole
        found[name] = statement
    return found


def required(statement: Statement) -> list[str]:
    """Return what must be given beside the id, in order: what may be given without a name."""
    return [name for name in statement.required if name != "id"]


def signature(statement: Statement) -> inspect.Signature:
    """Return the arguments of a statement's method, for help and completion."""
    must = required(statement)
    names = [*must, *(name for name in statement.attributes if name not in must)]
    first = inspect.Parameter("self", inspect.Parameter.POSITIONAL_ONLY)
    return inspect.Signature(
        [
            first,
            *(
                inspect.Parameter(
                    _argument(name),
                    inspect.Parameter.POSITIONAL_OR_KEYWORD
                    if name in must
                    else inspect.Parameter.KEYWORD_ONLY,
                    default=inspect.Parameter.empty if name in must else None,
                )
                for name in names
            ),
        ]
    )


def _argument(name: str) -> str:
    """Return an attribute's name as an argument: what Python keeps for itself gets a ``_``."""
    return f"{name}_" if keyword.iskeyword(name) else name


def about(statement: Statement) -> str:
    """Return the docstring of a statement's method."""
    lines = [f"Add a {statement.name}: {statement.about or statement.note}.", ""]
    for name, spec in statement.attributes.items():
        if spec.refused:
            continue
        unit = f" [{spec.unit}]" if spec.unit else ""
        lines.append(f"{name}: {spec.about or spec.note}; {spec.kind.allowed}{unit}")
    return "\n".join(lines)


def referred(statement: Statement, name: str) -> tuple[str, ...]:
    """Return the statements of which the attribute names an element, none where it names none."""
    if name == "id" or statement.attributes[name].kind not in (ID, IDS):
        return ()
    words = [word.rstrip("0123456789") for word in name.split("_")]
    found = [named for word, named in _NAMED_BY.items() if word in words]
    return found[0] if found else ()


def named(statement: Statement, name: str) -> str | None:
    """Return the attribute that a keyword means, None of one that the statement does not have.

    ``_id`` may be left out.
    """
    names = statement.spec_names
    for spelling in (name, f"{name}_id", f"{name.removesuffix('s')}_ids"):
        found = names.get(spelling) or names.get(fold(spelling))
        if found is not None:
            return found
    return None


def parts(statement: Statement, name: str, value: object) -> dict[str, object]:
    """Return the attributes for the components of a list, none where there are no such ones.

    ``pos=(1, 2, 3)`` is pos_x, pos_y and pos_z, ``scale=`` x_scale and so on, ``inertia=`` the
    three moments, or these and the products xy, yz and xz.
    """
    if isinstance(value, str) or not isinstance(value, Collection):
        return {}
    values: list[object] = list(value)
    for endings, form in ((_AXES, "{0}_{1}"), (_AXES, "{1}_{0}"), (_SQUARES, "{0}_{1}")):
        names = [form.format(name, ending) for ending in endings]
        if all(each in statement.attributes for each in names):
            if len(values) not in {3, len(names)}:
                counts = " or ".join(str(count) for count in sorted({3, len(names)}))
                raise ModelError(f"{statement.name}: {name} must be {counts} numbers")
            return dict(zip(names, values, strict=False))
    return {}


def texts(statement: Statement, given: Mapping[str, object]) -> Iterator[tuple[str, str]]:
    """Yield attributes and their texts; what is None is left out.

    An attribute that counts only with a flag gets it.
    """
    attributes: dict[str, object] = {}
    for name, value in given.items():
        if value is None:
            continue
        found = parts(statement, name, value)
        attributes |= found or {named(statement, name) or name: value}
    for name in list(attributes):
        if f"{name}_flag" in statement.attributes:
            attributes.setdefault(f"{name}_flag", True)
    for name, value in attributes.items():
        yield name, _text(statement, name, value)


def _text(statement: Statement, name: str, value: object) -> str:
    """Return an attribute's value as a deck has it; elements stand for their ids."""
    if isinstance(value, Element):
        return written(_id(statement, name, value))
    if isinstance(value, Iterable) and not isinstance(value, str):
        listed = [
            _id(statement, name, each) if isinstance(each, Element) else each for each in value
        ]
        return written(listed)
    return written(value)


def _id(statement: Statement, name: str, element: Element) -> int:
    """Return the id of the element meant."""
    wanted = referred(statement, name) if name in statement.attributes else ()
    if not wanted or element.statement in wanted:
        return element.id
    raise ModelError(f"{statement.name}: {name}: {element!r} is no {' or '.join(wanted)}")

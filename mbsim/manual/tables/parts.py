"""Tables of laws, joints, functions, methods, pairs of shapes, and where these live."""

from __future__ import annotations

import inspect
import re
from pathlib import Path
from typing import Any

import mbsim
from mbsim.expressions.functions import CHOICES, FUNCTIONS
from mbsim.expressions.functions import Kind as Sort
from mbsim.forces.catalog import FORCES
from mbsim.geometry.catalog import PAIRS, REGIONS
from mbsim.integrators.catalog import METHODS, SCHEMES
from mbsim.joints.catalog import JOINTS, JointKind, Row
from mbsim.laws.catalog import FRICTION_LAWS, NORMAL_LAWS
from mbsim.manual.book import Page
from mbsim.manual.tables import first_sentence, item, reference, rows, table
from mbsim.manual.tables.statements import range_of
from mbsim.reader.constraints import CONSTRAINT_JOINT
from mbsim.reader.contact import FORCE_CONTACT

_PACKAGE = Path(mbsim.__file__).parent


def _law(name: str) -> Any:
    return (FRICTION_LAWS if name in FRICTION_LAWS else NORMAL_LAWS)[name]


def _file_of(function: Any) -> str:
    """Return the file in which a part is written, from the package's folder."""
    path = Path(inspect.unwrap(getattr(function, "py_func", function)).__code__.co_filename)
    return path.relative_to(_PACKAGE.parent).as_posix() if _PACKAGE in path.parents else path.name


def _without_name(text: str) -> str:
    """Return the first sentence of a file's head without the name that it begins with."""
    return re.sub(r"^[A-Z0-9_, and]+(\([^)]*\))?: ", "", first_sentence(text))


def _about(function: Any) -> str:
    """Return what the first line of a part's file says of it."""
    module = inspect.getmodule(getattr(function, "py_func", function))
    return re.sub(
        r"^[A-Z0-9_, and]+(\([^)]*\))?: ", "", first_sentence((module and module.__doc__) or "")
    )


@table("laws friction")
def friction_laws(_: str, page: Page) -> list[str]:
    """Return the friction laws: parameters, numbers remembered, what each is."""
    return _laws(FRICTION_LAWS, page, lambda law: law.force, lambda law: str(law.memory or ""))


@table("laws normal")
def normal_laws(_: str, page: Page) -> list[str]:
    """Return the laws of the normal force."""
    return _laws(NORMAL_LAWS, page, lambda law: law.law, lambda law: "")


def _laws(registry: Any, page: Page, function: Any, memory: Any) -> list[str]:
    lines = rows(
        ("law", "memory", "what it is"),
        (
            (reference(page, n, f"`{n}`"), memory(registry[n]), _about(function(registry[n])))
            for n in registry
        ),
    )
    lines.append("")
    for n in registry:
        lines += item(f"`{n}` takes {', '.join(f'`{p}`' for p in registry[n].parameters)}.")
    return lines


@table("law")
def law(name: str, page: Page) -> list[str]:
    """Return the parameters of one law."""
    found = _law(name)
    known = FORCE_CONTACT.attributes
    return rows(
        ("parameter", "range", "unit", "default", "meaning"),
        (
            (
                f"`{each}`",
                range_of(known[each].kind),
                known[each].unit,
                "needed" if known[each].required else known[each].default,
                known[each].about,
            )
            for each in found.parameters
        ),
    )


_ROWS = {
    "offset": "{j}_J·(P_I - P_J)",
    "perp": "{i}_I·{j}_J",
    "angle": "angle about z_J",
    "spin": "angle about z_I",
    "twist": "twist",
    "distance": "abs(P_I - P_J)",
}


def _equation(rows_of: tuple[Row, ...], attributes: tuple[str, ...]) -> str:
    """Return an equation in words of its rows; factors by attributes are named."""
    terms = [_ROWS[row.kind].format(i=row.i, j=row.j) for row in rows_of]
    if len(terms) == 1:
        return terms[0]
    factor = f" · f({', '.join(attributes)})" if attributes else ""
    return terms[0] + "".join(f" and {term}{factor}" for term in terms[1:])


def _joint_file(name: str) -> str:
    return f"mbsim/joints/kinds/{name.lower()}.py"


def _joint_about(name: str) -> str:
    path = _PACKAGE.parent / _joint_file(name)
    text = path.read_text(encoding="utf-8").split('"""')[1]
    return _without_name(text)


def _moves(kind: JointKind) -> str:
    return ", ".join({"R": "rotation", "T": "translation"}[each] for each in kind.moves)


@table("joints")
def joints(_: str, page: Page) -> list[str]:
    """Return the types of Constraint_Joint and Constraint_Jprim."""
    return rows(
        ("type", "equations", "moves by", "what it does"),
        (
            (
                reference(page, name, f"`{name}`"),
                str(len(JOINTS[name].equations)),
                _moves(JOINTS[name]),
                _joint_about(name),
            )
            for name in JOINTS
        ),
    )


@table("joint")
def joint(name: str, page: Page) -> list[str]:
    """Return one joint: degrees of freedom, equations, attributes."""
    kind = JOINTS[name]
    lines = item(
        f"Equations: {len(kind.equations)}; degrees of freedom left: {6 - len(kind.equations)}."
    )
    for each in kind.equations:
        constant = "0" if len(each) == 1 and each[0].kind in ("offset", "perp") else "constant"
        if each is kind.equations[-1] and kind.value is not None:
            constant = f"`{kind.needs[0]}`" if kind.needs else "given"
        lines += item(f"{_equation(each, kind.needs)} = {constant}")
    for needed in kind.needs:
        spec = CONSTRAINT_JOINT.attributes[needed]
        unit = f" [{spec.unit}]" if spec.unit else ""
        lines += item(f"Attribute `{needed}`{unit}: {spec.about}")
    if kind.moves:
        lines += item(f"A motion or coupler may take its {_moves(kind)}.")
    return lines


@table("functions")
def functions(_: str, page: Page) -> list[str]:
    """Return the functions of expressions by what they look at."""
    lines: list[str] = []
    for sort in Sort:
        own = [f for f in FUNCTIONS.values() if f.kind is sort]
        if own:
            lines += [f"Of {sort.value}:", ""]
            lines += rows(("function", "value"), ((f"`{f.call}`", f.about) for f in own))
            lines.append("")
    ranges = ", ".join(
        f"`{name}` {low} to {high}" for name, (low, high) in CHOICES.items() if name != "point"
    )
    return [*lines, *item(f"Arguments that are whole numbers: {ranges}.")]


@table("methods")
def methods(_: str, page: Page) -> list[str]:
    """Return the integration methods."""
    return rows(("name", "what it is"), ((f"`{name}`", what) for name, what in METHODS.items()))


@table("couple-of-shapes")
def couples(_: str, page: Page) -> list[str]:
    """Return how each pair of shapes is detected: closed form (C), as a region too (R), FCL (F)."""
    shapes = ["SPHERE", "ELLIPSOID", "BOX", "CYLINDER", "FRUSTUM", "MESH", "PLANE"]

    def how(i: str, j: str) -> str:
        names = (f"{i}-{j}", f"{j}-{i}")
        if any(name in REGIONS for name in names):
            return "C R"
        if any(name in PAIRS for name in names):
            return "C"
        return "" if i == j == "PLANE" else "F"

    body = [(f"`{i}`", *(how(i, j) for j in shapes)) for i in shapes]
    lines = ["| " + " | ".join(("", *(f"`{shape}`" for shape in shapes))) + " |"]
    lines += ["|" + " --- |" * (len(shapes) + 1)]
    lines += ["| " + " | ".join(row) + " |" for row in body]
    return lines


@table("registries")
def registries(_: str, page: Page) -> list[str]:
    """Return where the parts live, and how many there are."""
    from mbsim.fclib.solvers.catalog import SOLVERS
    from mbsim.model.request_types import TYPES
    from mbsim.reader.statements import STATEMENTS

    entries = (
        ("friction law", "mbsim/laws/friction/", len(list(FRICTION_LAWS)), "mbsim/laws/catalog.py"),
        ("normal law", "mbsim/laws/normal/", len(list(NORMAL_LAWS)), "mbsim/laws/catalog.py"),
        ("joint", "mbsim/joints/kinds/", len(list(JOINTS)), "mbsim/joints/catalog.py"),
        ("pair of shapes", "mbsim/geometry/pairs/", len(list(PAIRS)), "mbsim/geometry/catalog.py"),
        ("force", "mbsim/forces/kinds/", len(list(FORCES)), "mbsim/forces/catalog.py"),
        ("integrator", "mbsim/integrators/", len(SCHEMES), "mbsim/integrators/catalog.py"),
        ("statement", "mbsim/reader/", len(STATEMENTS), "mbsim/reader/statements.py"),
        ("request", "mbsim/results/", len(TYPES), "mbsim/model/request_types.py"),
        ("function", "mbsim/expressions/", len(FUNCTIONS), "mbsim/expressions/functions.py"),
        ("fclib solver", "mbsim/fclib/solvers/", len(SOLVERS), "mbsim/fclib/solvers/catalog.py"),
    )
    for _name, folder, _count, file in entries:
        assert (_PACKAGE.parent / folder).is_dir(), folder
        assert (_PACKAGE.parent / file).is_file(), file
    return rows(
        ("part", "its files are in", "how many", "contract and list"),
        ((name, f"`{folder}`", str(count), f"`{file}`") for name, folder, count, file in entries),
    )

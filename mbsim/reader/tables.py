"""Reference_Spline and Reference_Array: tables of numbers that expressions look up."""

from __future__ import annotations

import re
from collections.abc import Sequence

from mbsim.core.stored import read_regular
from mbsim.model import elements as el
from mbsim.reader.kinds import (
    COUNT,
    FLAG,
    ID,
    REALS,
    TEXT,
    BadValueError,
    Kind,
    keyword,
    parse_real,
)
from mbsim.reader.linear_systems import ControlArray
from mbsim.reader.statement import NAMED, Entry, Spec, Statement
from mbsim.reader.subroutine import USERSUB

Numbers = tuple[float, ...]


def _ascending(entry: Entry, values: Numbers, name: str) -> bool:
    """Refuse values that do not ascend; return whether they do."""
    for k in range(1, len(values)):
        if not values[k] > values[k - 1]:
            one, other = f"{values[k - 1]:g}", f"{values[k]:g}"
            given = name if entry.given(name) else ""
            axis = "x" if name == "points" else name[0]
            entry.fault(f"{axis} must ascend; {other} stands behind {one}", given)
            return False
    return True


def add_spline(
    entry: Entry, x: Numbers, rows: Sequence[Numbers], z: Numbers, x_name: str, y_name: str
) -> None:
    """Check points and add the spline; the names are the attributes that faults quote."""
    if len(x) < 2:
        entry.fault("must be 2 points or more (4 for AKISPL and CUBSPL)", x_name)
        return
    wrong = next((len(row) for row in rows if len(row) != len(x)), None)
    if wrong is not None:
        entry.fault(f"has {wrong} values in a curve, and there are {len(x)} x", y_name)
        return
    if z and len(z) < 2:
        entry.fault("a surface needs 2 values of z or more", y_name)
        return
    if not (_ascending(entry, x, x_name) and _ascending(entry, z, "z")):
        return
    spline = el.Spline(
        id=entry.get("id", 0),
        x=x,
        y=tuple(rows),
        z=z,
        linear_extrapolate=bool(entry.get("linear_extrapolate", entry.get("LINEAR_EXTRAPOLATE"))),
        label=entry.get("label", ""),
        source=entry.source,
    )
    entry.register("splines", spline)


def _from_file(entry: Entry) -> Numbers | None:
    """Return the numbers of a file, separated by commas, semicolons or blanks; # is a comment."""
    path = entry.beside(entry.get("file", ""))
    try:
        text = read_regular(path).decode("utf-8-sig")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "not UTF-8 text"
        entry.fault(f"{path}: {reason}", "file")
        return None
    found: list[float] = []
    for number, line in enumerate(text.splitlines(), 1):
        for word in re.split(r"[,;\s]+", line.partition("#")[0].strip()):
            try:
                found.extend([parse_real(word)] if word else [])
            except BadValueError:
                entry.fault(f"{path}:{number}: {word[:40]!r} is not a number", "file")
                return None
    return tuple(found)


#: How a spline's points are given, by the attributes that give them.
_FORMS = {"x": "x", "y": "x", "points": "points", "file": "file"}


def _build_spline(entry: Entry) -> None:
    """Add a spline, from x and y or from a table of one row for each x."""
    given = {_FORMS[name] for name in entry.one_of(_FORMS)}
    if len(given) != 1 or entry.given("x") != entry.given("y"):
        entry.fault('needs its points once: as text, by file="...", or by x="..." and y="..."')
        return
    z = entry.get("z", ())
    curves = max(1, len(z))
    (name,) = given
    if name == "x":
        x, y = entry.get("x"), entry.get("y")
        if x is None or y is None:
            return
        if len(y) != curves * len(x):
            what = f"must be {curves * len(x)} numbers, {curves} for each of {len(x)} x"
            entry.fault(f"{what}; there are {len(y)}", "y")
            return
        rows = [y[k * len(x) : (k + 1) * len(x)] for k in range(curves)]
        add_spline(entry, x, rows, z, "x", "y")
        return
    table = _from_file(entry) if name == "file" else entry.get("points")
    if table is None:
        return
    width = 1 + curves
    if len(table) % width:
        row = "x y" if curves == 1 else f"x and {curves} y"
        entry.fault(f"must be rows of {row}; {len(table)} numbers make no whole rows", name)
        return
    rows = [table[k::width] for k in range(1, width)]
    add_spline(entry, table[::width], rows, z, name, name)


def add_array(
    entry: Entry, type: str, size: int | None, numbers: Numbers, ids: Numbers, names: Sequence[str]
) -> None:
    """Add an array of any type.

    `names` are the attributes that give its size, its numbers and, of type U, its variables.
    """
    draft, id = entry.draft, entry.get("id", 0)
    wanted = {"IC": names[1], "U": names[2]}.get(type)
    for name, values in zip(names[1:], (numbers, ids), strict=True):
        if values and name != wanted:
            entry.fault(f"an array of type {type} has none", name)
            return
        if name == wanted and not values:
            what = "numbers" if type == "IC" else "ids of variables"
            entry.fault(f"{name}: missing; must be {what}, separated by blanks or commas")
            return
    values = ids or numbers
    if wanted and size is not None and size != len(values):
        entry.fault(f"there are {len(values)} {wanted}", names[0])
        return
    other = draft.control.arrays.get(id) if type == "IC" else draft.arrays.get(id)
    if other is not None:
        entry.fault(
            f"id already used on line {other.source.line}; ids are unique per statement", "id"
        )
    elif type == "IC":
        array = el.ArrayOfNumbers(id, numbers, entry.get("label", ""), entry.source)
        entry.register_in(draft.arrays, array)
    else:
        size = len(ids) if type == "U" else size
        variables = tuple(map(int, ids))
        array_of = ControlArray(id, type, size, variables, entry.source)
        entry.register_in(draft.control.arrays, array_of)


def _build_array(entry: Entry) -> None:
    """Add an array; the text of one of type U is the ids of its variables."""
    type = entry.get("type", "IC")
    for name in ("type", "values", "variable_id", "num_element"):
        if entry.given(name) and entry.get(name) is None:
            return
    numbers, ids = entry.get("values", ()), entry.get("variable_id", ())
    if type == "U" and not ids and numbers:
        if any(number != int(number) or number < 1 for number in numbers):
            entry.fault("must be ids of variables", "values")
            return
        numbers, ids = (), numbers
    add_array(
        entry,
        type,
        entry.get("num_element"),
        numbers,
        ids,
        ("num_element", "values", "variable_id"),
    )


def _parse_variables(text: str) -> Numbers:
    """Return ids separated by blanks or commas; one may stand there twice."""
    words = text.replace(",", " ").split()
    if not words:
        raise BadValueError
    return tuple(ID.parse(word) for word in words)


VARIABLES = Kind("ids of variables, separated by blanks or commas", _parse_variables)

REFERENCE_SPLINE = Statement(
    "Reference_Spline",
    {
        **NAMED,
        "x": Spec(REALS, "abscissae, ascending"),
        "y": Spec(REALS, "ordinates; of a surface one curve after the other"),
        "z": Spec(REALS, "second abscissae of a surface, ascending"),
        "points": Spec(REALS, "rows of x y, or x and one y for each z; text of the element too"),
        "file": Spec(TEXT, "file of such rows, relative to the deck", alias="file_name"),
        "linear_extrapolate": Spec(FLAG, "lines, not parabolas, outside", "", "FALSE"),
        "block_name": Spec(TEXT, refused="SPLINE_READ is not built; give points", harmless="NULL"),
        **{
            name: Spec(TEXT, refused="SPLINE_READ is not built; give points or a file of them")
            for name in (*USERSUB, "script_name", "interpreter")
        },
    },
    _build_spline,
    text="points",
    about="a table that AKISPL, CUBSPL and LINSPL interpolate",
)
REFERENCE_ARRAY = Statement(
    "Reference_Array",
    {
        **NAMED,
        "type": Spec(
            keyword({"ic": "IC", "x": "X", "y": "Y", "u": "U"}), "sort of array", "", "IC"
        ),
        "num_element": Spec(COUNT, "how many elements it has", "", "as many as there are"),
        "values": Spec(REALS, "of type IC the numbers; text of the element too"),
        "variable_id": Spec(VARIABLES, "of type U the variables; as text of the element too"),
        **{
            name: Spec(TEXT, refused="ARYSUB is not built; name variables, which may be USERSUB")
            for name in (*USERSUB, "script_name", "interpreter")
        },
    },
    _build_array,
    text="values",
    about="numbers, inputs, states or outputs, by their place in ARYVAL",
)

"""Reference_Spline and Reference_Array: tables of numbers that expressions look up."""

from __future__ import annotations

import re
from collections.abc import Sequence

from mbsim.core.stored import read_regular
from mbsim.model import elements as el
from mbsim.reader.kinds import FLAG, REALS, TEXT, BadValueError, keyword, parse_real
from mbsim.reader.statement import NAMED, Entry, Spec, Statement

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
    entry.register(entry.draft.splines, spline)


def _from_file(entry: Entry) -> Numbers | None:
    """Return the numbers of a file, separated by commas, semicolons or blanks; # is a comment."""
    path = entry.draft.directory / entry.get("file", "").replace("\\", "/")
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


def _build_spline(entry: Entry) -> None:
    """Add a spline, from x and y or from a table of one row for each x."""
    given = [name for name in ("x", "points", "file") if entry.given(name)]
    if len(given) != 1 or entry.given("x") != entry.given("y"):
        entry.fault('needs its points once: as text, by file="...", or by x="..." and y="..."')
        return
    z = entry.get("z", ())
    curves = max(1, len(z))
    if entry.given("x"):
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
    name = given[0]
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


def _build_array(entry: Entry) -> None:
    """Add an array of numbers."""
    if entry.get("values") is None:
        return
    array = el.ArrayOfNumbers(
        entry.get("id", 0), entry.get("values"), entry.get("label", ""), entry.source
    )
    entry.register(entry.draft.arrays, array)


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
            keyword({"ic": "IC"}, {"x": "X", "y": "Y", "u": "U"}), "sort of array", "", "IC"
        ),
        "values": Spec(REALS, "the numbers; text of the element too", required=True),
    },
    _build_array,
    text="values",
    about="numbers that ARYVAL gives by their place",
)

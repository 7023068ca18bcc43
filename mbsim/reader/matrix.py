"""Reference_Matrix: a table of numbers that Control_StateEqn takes."""

from __future__ import annotations

import numpy as np

from mbsim.reader.kinds import COUNT, FLAG, REALS, TEXT
from mbsim.reader.linear_systems import Matrix
from mbsim.reader.statement import NAMED, Entry, Spec, Statement
from mbsim.reader.subroutine import USERSUB

_LARGEST = 1_000_000  # numbers of a matrix


def _build_matrix(entry: Entry) -> None:
    """Add a matrix."""
    rows, columns, numbers = (entry.get(name) for name in ("nrow", "ncol", "values"))
    if rows is None or columns is None or numbers is None:
        return
    if rows * columns > _LARGEST:
        entry.fault(f"{rows} x {columns} numbers; {_LARGEST} at most", "nrow")
        return
    if entry.get("issparse", False):
        values = _scattered(entry, rows, columns, numbers)
    else:
        values = _dense(entry, rows, columns, numbers)
    if values is not None:
        matrix = Matrix(entry.get("id", 0), values, entry.source)
        entry.register_in(entry.draft.control.matrices, matrix)


def _dense(entry: Entry, rows: int, columns: int, numbers: tuple[float, ...]) -> np.ndarray | None:
    """Return a matrix of which all numbers are given, column after column or row after row."""
    if entry.given("nval"):
        entry.fault("is of a sparse matrix; issparse is not TRUE", "nval")
        return None
    if len(numbers) != rows * columns:
        entry.fault(f"there are {len(numbers)} numbers for {rows} x {columns}", "values")
        return None
    by_row = entry.get("isroworder", False)
    return np.array(numbers).reshape((rows, columns), order="C" if by_row else "F")


def _scattered(
    entry: Entry, rows: int, columns: int, numbers: tuple[float, ...]
) -> np.ndarray | None:
    """Return a matrix from lines of row, column and value; the rest is 0."""
    count = entry.get("nval")
    if entry.given("isroworder"):
        entry.fault("is of a matrix of which all numbers are given", "isroworder")
        return None
    if len(numbers) % 3 or (count is not None and 3 * count != len(numbers)):
        wanted = "" if count is None else f", must be {3 * count}"
        entry.fault(f"{len(numbers)} numbers{wanted}: a row, a column and a value each", "values")
        return None
    values = np.zeros((rows, columns))
    seen = set()
    for row, column, value in zip(numbers[::3], numbers[1::3], numbers[2::3], strict=True):
        if row not in range(1, rows + 1) or column not in range(1, columns + 1):
            entry.fault(
                f"there is no row {row:g}, column {column:g} in {rows} x {columns}", "values"
            )
            return None
        if (row, column) in seen:
            entry.fault(f"gives row {row:g}, column {column:g} twice", "values")
            return None
        seen.add((row, column))
        values[int(row) - 1, int(column) - 1] = value
    return values


REFERENCE_MATRIX = Statement(
    "Reference_Matrix",
    {
        **NAMED,
        "nrow": Spec(COUNT, "number of rows", required=True),
        "ncol": Spec(COUNT, "number of columns", required=True),
        "isroworder": Spec(
            FLAG, "numbers are row after row, else column after column", "", "FALSE"
        ),
        "issparse": Spec(FLAG, "values are rows, columns and numbers that are not 0", "", "FALSE"),
        "nval": Spec(COUNT, "of a sparse matrix, how many numbers", "", "as many as are given"),
        "values": Spec(REALS, "the numbers; text of the element too", required=True),
        **{
            name: Spec(TEXT, refused="is documented but not built yet; give the numbers")
            for name in (*USERSUB, "script_name", "interpreter")
        },
    },
    _build_matrix,
    text="values",
    about="a table of numbers, for Control_StateEqn",
)

"""Columns of the pipeline's tables are read by name, and names say which column they are."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import mbsim
from mbsim.laws.catalog import FRICTION_LAWS
from mbsim.laws.friction.stiction import MU_STATIC

PACKAGE = Path(mbsim.__file__).parent
FOLDERS = ("arrays", "compile_model", "dynamics", "integrators", "laws", "results", "run")

#: What a number of a formula is an index of: matrices, lists of vectors, and scratch rows of them.
FORMULAS = {
    # rotations, inertias, blocks of matrices and what they are multiplied by
    *(
        "R",
        "J",
        "S",
        "H",
        "L",
        "A",
        "B",
        "E",
        "U",
        "P",
        "T",
        "TI",
        "g",
        "own",
        "inertia",
        "inverse",
    ),
    # tables of vectors
    *("p", "q", "net", "frames", "sticking_force", "force", "rate", "x", "skew", "relative"),
    # of Python, in which a row is what its own file says
    *("made", "pairs", "grid", "jumps"),
    # rows of scratch that are vectors themselves
    *("work", "keep", "size", "each"),
}


def base_of(node):
    """Return the last name of what is subscripted: `field` of a.b.field[...][...]."""
    while isinstance(node, ast.Subscript):
        node = node.value
    return node.attr if isinstance(node, ast.Attribute) else getattr(node, "id", "")


def literal_columns(path):
    """Yield line and name of the tables with a literal column in a file."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if not isinstance(node, ast.Subscript) or not isinstance(node.slice, ast.Tuple):
            continue
        last = node.slice.elts[-1] if node.slice.elts else None
        if isinstance(last, ast.Constant) and type(last.value) is int:
            yield node.lineno, base_of(node.value)


#: Rows that are vectors or matrices of a formula, by the field that they are of or their own name
#: where they are given: a number tells which of them, as it does of `shape`.
VECTORS = {
    "shape",
    # of space: directions, rotations and spatial vectors, of angular and linear parts
    *("size", "half", "q", "w", "p", "a", "f", "c", "S", "G", "answer", "centre", "frames"),
    # force and torque; components along x and y; value and rates
    *("wrench", "row", "sticking_force", "motion", "jet", "given"),
    # coefficients of a cubic, and unknowns of a residual
    *("piece", "curve", "z", "out", "start", "memory", "x"),
    # y' and y at two times; the last of what is kept of several times
    *("ahead", "kept_at", "kept_power"),
}
#: Lists and tuples of Python that are called as an array is.
NOT_ARRAYS = {"seen", "kept", "found", "rows", "applied", "offset", "share", "weight"}


def declared():
    """Return the number of axes of the scene's arrays by name, but for those of one entry."""
    found = {}
    for path in sorted((PACKAGE / "arrays").glob("*.py")):
        lines = path.read_text(encoding="utf-8").splitlines()
        for node in ast.walk(ast.parse("\n".join(lines))):
            if not isinstance(node, ast.AnnAssign) or not isinstance(node.target, ast.Name):
                continue
            kind = re.search(r"\b[FI]([123])\b", ast.unparse(node.annotation))
            # one that is alone has no other place than 0
            before = lines[node.lineno - 2].strip()
            alone = "# (1,)" in lines[node.lineno - 1] or before.startswith("# (1,)")
            if kind and not alone:
                found[node.target.id] = max(int(kind[1]), found.get(node.target.id, 0))
    return found


def rows_of(function, arrays):
    """Return which names in a function are rows, and of what: assigned, or given as F1 or I1."""
    found = {
        given.arg: given.arg
        for given in function.args.args
        if given.annotation is not None and ast.unparse(given.annotation) in ("F1", "I1")
    }
    for node in ast.walk(function):
        if not isinstance(node, ast.Assign):
            continue
        for target in node.targets:
            both = isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple)
            pairs = (
                zip(target.elts, node.value.elts, strict=False) if both else [(target, node.value)]
            )
            for name, value in pairs:
                if not isinstance(name, ast.Name) or base_of(value) not in arrays:
                    continue
                if isinstance(value, ast.Attribute):
                    found[name.id] = value.attr
                elif isinstance(value, ast.Subscript) and leaves_a_row(value, arrays):
                    found[name.id] = base_of(value)
    return found


def leaves_a_row(value, arrays):
    """Return whether a subscript of an array is one too."""
    parts = value.slice.elts if isinstance(value.slice, ast.Tuple) else [value.slice]
    numbers = sum(not isinstance(part, ast.Slice) for part in parts)
    return numbers < arrays[base_of(value)]


def literal_entries(path, arrays):
    """Yield line and array of the entries of rows that are named by a number."""
    functions = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
    for function in functions:
        if not isinstance(function, ast.FunctionDef):
            continue
        rows = rows_of(function, arrays)
        for node in ast.walk(function):
            if not isinstance(node, ast.Subscript) or not isinstance(node.slice, ast.Constant):
                continue
            value = node.value
            if isinstance(value, ast.Name):
                name = rows.get(value.id, "")
            else:
                name = base_of(value) if base_of(value) in arrays else ""
            if name and type(node.slice.value) is int:
                yield node.lineno, name


def test_columns_of_tables_have_names():
    found = [
        f"{path.relative_to(PACKAGE)}:{line}: {name}"
        for folder in FOLDERS
        for path in sorted((PACKAGE / folder).rglob("*.py"))
        for line, name in literal_columns(path)
        if name and name not in FORMULAS
    ]
    assert found == [], "name the column in mbsim.arrays.codes:\n" + "\n".join(found)


def test_entries_of_rows_have_names():
    arrays = declared()
    assert {"used", "energy", "tally", "slot", "code"} <= arrays.keys()
    found = [
        f"{path.relative_to(PACKAGE)}:{line}: {name}"
        for folder in FOLDERS
        for path in sorted((PACKAGE / folder).rglob("*.py"))
        for line, name in sorted(set(literal_entries(path, arrays)))
        if name not in VECTORS | NOT_ARRAYS | FORMULAS
    ]
    assert found == [], "name the entry in mbsim.arrays.codes:\n" + "\n".join(found)


def test_a_literal_entry_is_found(tmp_path):
    file = tmp_path / "kernel.py"
    file.write_text(
        "def f(scene, s, code: I1, v: V3):\n"
        "    row, k = scene.audit.contact[s], scene.rows.used[1]\n"
        "    return row[3] + code[2] + v[1] + scene.work.slot[s][4]\n"
    )
    assert sorted(set(literal_entries(file, declared()))) == [
        (2, "used"),
        (3, "code"),
        (3, "contact"),
        (3, "slot"),
    ]


def test_a_literal_column_is_found(tmp_path):
    file = tmp_path / "kernel.py"
    file.write_text("def f(scene, s):\n    return scene.state.memory[s, 0] + scene.work.R[s, 0]\n")
    assert list(literal_columns(file)) == [(2, "memory"), (2, "R")]


def test_parameters_of_rigid_stiction_are_read_by_name():
    assert FRICTION_LAWS["STICTION"].rigid.parameters[MU_STATIC] == "mu_static"

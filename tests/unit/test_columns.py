"""Columns of the pipeline's tables are read by name, and names say which column they are."""

from __future__ import annotations

import ast
from pathlib import Path

import mbsim
from mbsim.laws.catalog import FRICTION_LAWS
from mbsim.laws.friction.stiction import MU_STATIC

PACKAGE = Path(mbsim.__file__).parent
FOLDERS = ("arrays", "compile_model", "dynamics", "integrators", "laws", "results", "run")

#: What a number of a formula is an index of: matrices, lists of vectors, and scratch rows of them.
FORMULAS = {
    # rotations, inertias, blocks of matrices and what they are multiplied by
    *("R", "J", "S", "H", "A", "B", "E", "U", "P", "T", "TI", "g", "own", "inertia", "inverse"),
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


def test_columns_of_tables_have_names():
    found = [
        f"{path.relative_to(PACKAGE)}:{line}: {name}"
        for folder in FOLDERS
        for path in sorted((PACKAGE / folder).rglob("*.py"))
        for line, name in literal_columns(path)
        if name and name not in FORMULAS
    ]
    assert found == [], "name the column in mbsim.arrays.codes:\n" + "\n".join(found)


def test_a_literal_column_is_found(tmp_path):
    file = tmp_path / "kernel.py"
    file.write_text("def f(scene, s):\n    return scene.state.memory[s, 0] + scene.work.R[s, 0]\n")
    assert list(literal_columns(file)) == [(2, "memory"), (2, "R")]


def test_parameters_of_rigid_stiction_are_read_by_name():
    assert FRICTION_LAWS["STICTION"].rigid.parameters[MU_STATIC] == "mu_static"

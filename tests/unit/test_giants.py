"""Functions and files that a reader can take in; what is larger says why in its docstring."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

import mbsim

PACKAGE = Path(mbsim.__file__).parent
LINES_OF_FILE, LINES_OF_FUNCTION, ARGUMENTS = 500, 80, 10
#: In a folder of `dynamics`, beside __init__.py.
FILES_OF_FOLDER = 12
#: How the docstring of what is larger begins to give its reason.
REASON = re.compile(r"\b(long|many arguments|many branches)\b[^.]*\bbecause\b", re.I | re.S)
#: In the head of a function with more branches than ruff's limit (pyproject.toml).
BRANCHES = "# noqa: C901"


def _size(function: ast.FunctionDef | ast.AsyncFunctionDef) -> tuple[int, int]:
    """Return lines without the docstring, and arguments without self."""
    assert function.end_lineno is not None
    text = ast.get_docstring(function, clean=False)
    lines = function.end_lineno - function.lineno + 1 - (text.count("\n") + 1 if text else 0)
    given = function.args
    names = [a.arg for a in (*given.posonlyargs, *given.args, *given.kwonlyargs)]
    return lines, len(names) - (names[:1] in (["self"], ["cls"]))


def faults(path: Path, text: str) -> list[str]:
    """Return what of a file is too large and gives no reason."""
    found = []
    if text.count("\n") > LINES_OF_FILE:
        found.append(f"{path}: {text.count(chr(10))} lines")
    rows = text.splitlines()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            lines, arguments = _size(node)
            head = "\n".join(rows[node.lineno - 1 : node.body[0].lineno - 1])
            large = lines > LINES_OF_FUNCTION or arguments > ARGUMENTS or BRANCHES in head
            if large and not REASON.search(ast.get_docstring(node) or ""):
                found.append(
                    f"{path}:{node.lineno} {node.name}: {lines} lines, {arguments} arguments"
                )
    return found


def test_what_is_large_says_why():
    files = sorted(PACKAGE.rglob("*.py"))
    assert len(files) > 100
    found = []
    for file in files:
        found += faults(file.relative_to(PACKAGE), file.read_text())
    assert not found, "\n".join(found)


def test_folders_of_dynamics_are_small():
    folders = [folder for folder in (PACKAGE / "dynamics").iterdir() if folder.is_dir()]
    counts = {folder.name: len(list(folder.glob("*.py"))) for folder in folders}
    assert max(counts.values()) > 5
    assert {name: n for name, n in counts.items() if n > FILES_OF_FOLDER} == {}


@pytest.mark.parametrize(
    ("text", "count"),
    [
        ("x = 1\n" * 501, 1),
        ("def f():\n" + "    x = 1\n" * 80, 1),
        ("def f():\n" + "    x = 1\n" * 79, 0),
        (
            'def f():\n    """Do.\n\n    Long because it is a table.\n    """\n'
            + "    x = 1\n" * 80,
            0,
        ),
        ("def f(a, b, c, d, e, f, g, h, i, j, k): ...\n", 1),
        ("class C:\n    def f(self, b, c, d, e, f, g, h, i, j, k): ...\n", 0),
        ("def f(a):  # noqa: C901\n    return a\n", 1),
    ],
)
def test_what_is_too_large_is_seen(text, count):
    assert len(faults(Path("f.py"), text)) == count

"""The import picture has no circle; imports within functions count, those for types do not."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import mbsim

PACKAGE = Path(mbsim.__file__).parent


def _imports(node: ast.AST) -> Iterator[str]:
    """Yield what a module imports anywhere when it runs: `module` or `module.name`."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.ImportFrom) and child.level == 0 and child.module:
            yield from (f"{child.module}.{name.name}" for name in child.names)
        elif isinstance(child, ast.Import):
            yield from (name.name for name in child.names)
        elif isinstance(child, ast.If) and ast.unparse(child.test).endswith("TYPE_CHECKING"):
            for other in child.orelse:
                yield from _imports(other)
        else:
            yield from _imports(child)


def circle(sources: dict[str, str]) -> list[str]:
    """Return modules of which each imports the one before, or nothing; texts by module's name."""
    graph = {}
    for module, text in sources.items():
        names = set(_imports(ast.parse(text)))
        graph[module] = {
            name if name in sources else name.rpartition(".")[0] for name in names
        } & sources.keys()
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


def test_no_circle():
    sources = {
        ".".join(file.relative_to(PACKAGE.parent).with_suffix("").parts): file.read_text()
        for file in PACKAGE.rglob("*.py")
    }
    sources = {name.removesuffix(".__init__"): text for name, text in sources.items()}
    assert len(sources) > 300
    assert circle(sources) == []


def test_a_circle_within_functions_is_seen():
    types = "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import b\n"
    assert circle({"a": "import b", "b": ""}) == []
    assert circle({"a": types, "b": "import a"}) == []
    assert set(circle({"a": "def f():\n    from b import x", "b": "import a"})) == {"a", "b"}

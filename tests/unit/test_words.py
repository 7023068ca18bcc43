"""One word for one thing: names are the field's terms, not those that these took the place of."""

from __future__ import annotations

import ast
import re

from helpers.folders import PACKAGES, TESTS

#: What is said instead of what: words of names, upper case and plural forms too.
REPLACED = {
    "again": "replay",
    "blame": "at fault, diagnostics",
    "crowd": "broadphase",
    "dash": "Newton phase",
    "door": "hook",
    "foretell": "extrapolate",
    "foretold": "predicted",
    "grip": "friction slope",
    "heat": "chattering",
    "kink": "switching function, branch",
    "ledger": "energy accumulators",
    "limb": "tree joint",
    "rub": "friction",
    "rubbing": "slip test",
    "runaway": "divergence",
    "seating": "projection",
    "trouble": "diagnostics",
}
#: Names in which such a word means what it says: something is done once more, a line is dashed.
PLAIN = {"again", "assemble_again", "AGAIN", "WORTH_AGAIN", "_again", "_dash_pattern"}


def words(name):
    """Return the words of a name, in lower case and without the s of a plural."""
    parts = re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+", name)
    return {part.lower() for part in parts} | {part.lower().removesuffix("s") for part in parts}


def names(tree):
    """Yield line and name of what a file defines, reads or passes by name."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Name):
            yield node.lineno, node.id
        elif isinstance(node, ast.Attribute):
            yield node.lineno, node.attr
        elif isinstance(node, ast.arg):
            yield node.lineno, node.arg
        elif isinstance(node, ast.keyword) and node.arg:
            yield node.value.lineno, node.arg
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield node.lineno, node.name


def replaced(path):
    """Yield line, name and the word that is said otherwise."""
    for line, name in names(ast.parse(path.read_text(encoding="utf-8"))):
        # the name of a test is a sentence
        if name in PLAIN or name.startswith("test_"):
            continue
        for word in sorted(words(name) & REPLACED.keys()):
            yield line, name, word


def test_names_are_the_terms_of_the_field():
    files = [*sorted((PACKAGES / "mbsim").rglob("*.py")), *sorted(TESTS.rglob("*.py"))]
    assert len(files) > 500
    found = [
        f"{path}:{line}: {name}: say {REPLACED[word]}"
        for path in files
        for line, name, word in replaced(path)
    ]
    assert found == [], "\n".join(found)


def test_files_are_named_so():
    found = [
        path
        for folder in (PACKAGES / "mbsim", TESTS)
        for path in folder.rglob("*.py")
        if words(path.stem) & REPLACED.keys()
    ]
    assert found == []


def test_a_replaced_word_is_found(tmp_path):
    file = tmp_path / "kernel.py"
    file.write_text("def add_rubs(scene, KINKS):\n    return scene.work.gripped + BLAME_0\n")
    assert list(replaced(file)) == [
        (1, "add_rubs", "rub"),
        (1, "KINKS", "kink"),
        (2, "BLAME_0", "blame"),
    ]

"""The defaults that the manual's tables name are those that the reader takes."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from helpers.snippets import ROOT, Folder, blocks
from mbsim.errors import DeckError
from mbsim.manual.book import pages
from mbsim.reader.kinds import BadValueError
from mbsim.reader.statements import STATEMENTS
from mbsim.reader.xml import read_model

_ELEMENT = r"<{name}\b([^<>]*?)/?>"
#: Found when an equilibrium is sought; what makes a CONTACTPOST by being there.
_NOT_IN_THE_MODEL = ("max_num_iter", "cpost_param_string", "cpost_fnc_name", "cpost_interpreter")


def _said(path, overrides=()):
    """Return what a deck means, in words: everything but what was said about it."""
    model = read_model(str(path), overrides)
    said = repr(replace(model, overrides=(), notes=(), warnings=()))
    return re.sub(r"\s+", "", said).replace("-0.", "0.")  # zeros have signs


def _given(deck: str, name: str):
    """Return the selector of the first element of a statement in a deck, and its attributes."""
    found = re.search(_ELEMENT.format(name=name), deck.partition("<Command>")[0])
    found = found or re.search(_ELEMENT.format(name=name), deck)
    if found is None:
        return "", {}
    given = dict(re.findall(r'(\w+)="([^"]*)"', found.group(1)))
    return f"{name}[{given.get('id', 1)}]", given


def _is_value(spec) -> bool:
    try:
        spec.kind.parse(spec.default)
    except BadValueError:
        return False
    return bool(spec.default) and spec.kind.allowed not in ("text", "an expression")


@pytest.mark.parametrize("statement", STATEMENTS, ids=lambda each: each.name)
def test_defaults_of_a_statement(statement, tmp_path):
    """The deck of its page means the same with each default written out."""
    name = f"reference/statements/{statement.name.lower()}"
    numbers = {n: s for n, s in statement.attributes.items() if _is_value(s)}
    if name not in pages() or not numbers:
        pytest.skip("no page of its own, or no default that is a value")
    page = pages()[name]
    Folder(tmp_path)
    for block in blocks(page):
        if block.file:
            (tmp_path / block.file).write_text("\n".join(block.lines) + "\n", encoding="utf-8")
    deck = tmp_path / "deck.xml"
    if not deck.exists():
        deck = ROOT / "models" / "dry_friction_element.xml"
    selector, given = _given(deck.read_text(encoding="utf-8"), statement.name)
    assert selector, "the example has such an element"
    means = _said(deck)
    for attribute, spec in numbers.items():
        if attribute in given or attribute in _NOT_IN_THE_MODEL:
            continue
        try:
            same = _said(deck, [f"{selector}.{attribute}={spec.default}"]) == means
        except DeckError:
            continue  # what must not be given beside the others of this element
        assert same, f"{attribute}={spec.default} changes the model"

"""Runs that pictures are made of: decks of pages and of `models/`, each run once."""

from __future__ import annotations

import functools
import importlib.util
import re
import tempfile
from pathlib import Path
from typing import Any

import mbsim
from mbsim.bench import stiff
from mbsim.errors import ModelError
from mbsim.manual.book import PAGES

MODELS = stiff.folder().parent
_REFERENCES = Path(__file__).parents[3] / "tests" / "helpers" / "reference.py"


@functools.cache
def of_page(page: str, name: str) -> Any:
    """Return the results of the deck that a page has as a block of that file name."""
    text = (PAGES / f"{page}.md").read_text(encoding="utf-8")
    found = re.search(rf"^```xml {re.escape(name)}\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    if found is None:
        raise ModelError(f"{page}: no block ```xml {name}")
    return of_text(found.group(1))


def of_text(deck: str) -> Any:
    """Return the results of a deck given as text."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "deck.xml"
        path.write_text(deck, encoding="utf-8")
        return mbsim.simulate(mbsim.read_model(path))


def of_model(name: str, **settings: Any) -> Any:
    """Return the results of a deck of `models/`, by default at its own settings."""
    return mbsim.simulate(mbsim.read_model(MODELS / name), **settings)


@functools.cache
def references() -> Any:
    """Return the module of the tests' references; a checkout has it."""
    if not _REFERENCES.is_file():
        raise ModelError("references of decks are in the source folder's tests/")
    spec = importlib.util.spec_from_file_location("references_of_decks", _REFERENCES)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module

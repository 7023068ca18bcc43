"""README: short, the two commands first, the deck of the manual, links that lead somewhere."""

from __future__ import annotations

import re

from helpers.snippets import ROOT, blocks
from mbsim.manual.book import pages

TEXT = (ROOT / "README.md").read_text(encoding="utf-8")
LINES = TEXT.splitlines()


def test_it_is_short():
    assert len(LINES) <= 150
    assert not [k for k, line in enumerate(LINES, 1) if len(line) > 120]


def test_its_two_commands_stand_first():
    commands = [line.strip() for line in LINES[:12] if line.startswith("    ")]
    assert commands == [
        "pip install . && mbsim run models/bowling_ball.xml",
        "pip install -e '.[test]' && python -m pytest -n 2",
    ]


def test_its_links_and_pictures_are_there():
    for link in re.findall(r"\]\(([^)\s]+)\)", TEXT):
        assert "://" in link or (ROOT / link).exists(), link


def test_its_deck_is_the_one_of_the_first_page():
    deck = re.search(r"```xml\n(.*?)```", TEXT, re.DOTALL)
    (page,) = [b for b in blocks(pages()["start/first-deck"]) if b.file == "ball.xml"]
    assert deck is not None
    assert deck.group(1).splitlines() == page.lines

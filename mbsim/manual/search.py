"""Pages found by words: ranked, each with the line that says most."""

from __future__ import annotations

import re
from dataclasses import dataclass

from mbsim.manual.book import Page, pages, plain

#: What a word counts in a page's title, in a heading, at a table row's head, and in the text.
_TITLE, _HEADING, _ROW, _TEXT = 40.0, 12.0, 6.0, 1.0
_QUESTION = 30.0  # in a heading that is a question: its answer is a few lines
_MOST = 8  # times that a word in the text counts
_PART = 0.4  # of what a part of a longer word counts
_TOGETHER = 60.0  # for a heading that has all words, where there are several
#: Words that say nothing of a topic.
_EMPTY = set("a an and are as at by do does for from how i in is it my of on the to what".split())


@dataclass(frozen=True)
class Hit:
    """A page found, what speaks for it, and its best line."""

    page: Page
    score: float
    line: str
    number: int


def words_of(topic: str) -> list[str]:
    """Return the words of a question, folded."""
    words = [word for word in re.split(r"[^\w.\-/]+", topic.lower()) if word]
    return [word for word in words if word not in _EMPTY] or words


def titled(topic: str) -> list[Page]:
    """Return the pages that have every word of `topic` in their title."""
    words = words_of(topic)
    return [
        page
        for page in pages().values()
        if words and all(_weight(word, page.title.lower()) == 1.0 for word in words)
    ]


def search(topic: str) -> list[Hit]:
    """Return the pages that have all words of `topic`, else those that have any, best first."""
    words = words_of(topic)
    if not words:
        return []
    found = [hit for page in pages().values() if (hit := _hit(page, words))]
    complete = [hit for hit in found if all(word in hit.page.text.lower() for word in words)]
    return sorted(complete or found, key=lambda hit: -hit.score)


def _weight(word: str, text: str) -> float:
    """Return 1 where `text` has the word, less where only a part of a longer one, 0 without."""
    if word not in text:
        return 0.0
    return 1.0 if re.search(rf"(?<![\w]){re.escape(word)}(?![\w])", text) else _PART


def _hit(page: Page, words: list[str]) -> Hit | None:
    """Return what a page has of the words."""
    score = sum(_TITLE * _weight(word, page.title.lower()) for word in words)
    for heading in page.headings:
        weights = [_weight(word, heading.text.lower()) for word in words]
        counts = _QUESTION if heading.text.endswith("?") else _HEADING
        score += counts * sum(weights) * (heading.level > 1)
        if len(words) > 1 and all(weight == 1.0 for weight in weights):
            score += _TOGETHER
    best, line, number = 0.0, "", 0
    counted = dict.fromkeys(words, 0.0)
    for k, text in enumerate(page.text.splitlines(), 1):
        folded = text.lower()
        here = 0.0
        for word in words:
            weight = _weight(word, folded)
            if weight:
                head = text.startswith(("|", "-")) and word in folded[: len(word) + 6]
                here += weight * (_ROW if head else _TEXT)
                counted[word] = min(_MOST, counted[word] + weight * (_ROW if head else _TEXT))
        if here > best and not text.startswith(("# ", "<!--", "```")):
            best, line, number = here, text, k
    score += sum(counted.values())
    if not score:
        return None
    shown = plain(line).strip("#|-> ").replace("|", " ")
    return Hit(page, score, " ".join(shown.split()) or page.summary, number)

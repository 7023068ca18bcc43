"""Pages found by words: ranked, each with the line that says most."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

from mbsim.manual.book import Page, pages, plain

#: What a word counts in a page's title, in a heading, at a table row's head, and in the text.
_TITLE, _HEADING, _ROW, _TEXT = 40.0, 12.0, 6.0, 1.0
_QUESTION = 30.0  # in a heading that is a question: its answer is a few lines
_MOST = 8  # times that a word in the text counts
_TOGETHER = 60.0  # for a heading that has all words, where there are several
#: Pages that say why the program is as it is: they come behind those that say how to use it.
NOTES, _OF_NOTES = "develop/design-notes", 0.2
#: Words that say nothing of a topic.
EMPTY = frozenset(
    "a an and are as at by do does for from how i in is it my of on the to what".split()
)
#: Words of users, and those that pages have in their place.
SYNONYMS = {
    "continue": "resume",
    "restart": "resume",
    "euler": "angles",
    "animate": "animation",
    "movie": "animation",
    "video": "animation",
    "convergence": "converge",
    "diverge": "converge",
    "divergence": "converge",
    "history": "memory",
    "verify": "verification",
    "validation": "verification",
    "stick-slip": "stiction",
}


@dataclass(frozen=True)
class Hit:
    """A page found, what speaks for it, and its best line."""

    page: Page
    score: float
    line: str
    number: int
    missing: tuple[str, ...] = ()  # words that the page does not have


def words_of(topic: str) -> list[str]:
    """Return the words of a question, folded."""
    words = [word for word in re.split(r"[^\w.\-/]+", topic.lower()) if word]
    return [word for word in words if word not in EMPTY] or words


def titled(topic: str) -> list[Page]:
    """Return the pages that have every word of `topic` in their title."""
    words = words_of(topic)
    return [
        page
        for page in pages().values()
        if words and all(_whole(word).search(page.title.lower()) for word in words)
    ]


def search(topic: str) -> list[Hit]:
    """Return the pages that have all words of `topic`, else those that have most, best first.

    A word counts where it stands alone; one that no page has so counts as a part of others.
    """
    texts = {page: page.text.lower() for page in pages().values()}
    words = {word: _pattern(word, texts.values()) for word in words_of(topic)}
    lacks = {
        page: tuple(word for word, pattern in words.items() if not pattern.search(text))
        for page, text in texts.items()
    }
    fewest = min(map(len, lacks.values()))
    if fewest == len(words):
        return []
    best = [page for page, missing in lacks.items() if len(missing) == fewest]
    hits = [_hit(page, list(words.values()), lacks[page]) for page in best]
    return sorted(hits, key=lambda hit: -hit.score)


def _whole(word: str) -> re.Pattern[str]:
    """Return what finds a word, its plural or its synonym, where it is not part of another."""
    either = "|".join(re.escape(each) for each in (word, SYNONYMS.get(word, word)))
    return re.compile(rf"(?<![^\W_])(?:{either})s?(?![^\W_])")


def _pattern(word: str, texts: Iterable[str]) -> re.Pattern[str]:
    """Return what finds a word: alone, or where no text has it so, as a part."""
    whole = _whole(word)
    return whole if any(map(whole.search, texts)) else re.compile(re.escape(word))


def _hit(page: Page, words: list[re.Pattern[str]], missing: tuple[str, ...]) -> Hit:
    """Return what a page has of the words."""
    score = _TITLE * sum(bool(word.search(page.title.lower())) for word in words)
    for heading in page.headings:
        has = sum(bool(word.search(heading.text.lower())) for word in words)
        counts = _QUESTION if heading.text.endswith("?") else _HEADING
        score += counts * has * (heading.level > 1)
        if 1 < len(words) == has:
            score += _TOGETHER
    best, line, number = 0.0, "", 0
    counted = dict.fromkeys(words, 0.0)
    for k, text in enumerate(page.text.splitlines(), 1):
        folded = text.lower()
        here = 0.0
        for word in words:
            if found := word.search(folded):
                head = text.startswith(("|", "-")) and found.start() < 6
                counts = _ROW if head else _TEXT
                here += counts
                counted[word] = min(_MOST, counted[word] + counts)
        if here > best and not text.startswith(("# ", "<!--", "```")):
            best, line, number = here, text, k
    score += sum(counted.values())
    if page.name.startswith(NOTES):
        score *= _OF_NOTES
    shown = plain(line).strip("#|-> ").replace("|", " ")
    return Hit(page, score, " ".join(shown.split()) or page.summary, number, missing)

"""A page prepared for the terminal: formulas as text, links and pictures as words."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from mbsim.manual.book import Page, fold, pages
from mbsim.manual.mathematics import to_text

_MARKER = re.compile(r"\s*<!--.*-->\s*")
_PICTURE = re.compile(r"!\[([^\]]*)\]\(([^)\s]+)\)")
_LINK = re.compile(r"(?<!!)\[([^\]]*)\]\(([^)\s]+)\)")
_OPEN = re.compile(r"(```+)\s*(\S*)(.*)")


def for_terminal(page: Page) -> str:
    """Return the page's Markdown as rich can show it."""
    return "\n".join(_lines(page))


def _lines(page: Page) -> Iterator[str]:
    """Yield the lines of a page; a math block becomes a block of text."""
    fence, kind = "", ""
    block: list[str] = []
    words: list[str] = []
    for line in page.text.splitlines():
        match = _OPEN.fullmatch(line)
        if fence and line.strip() == fence:
            yield from _block(kind, block)
            fence = ""
        elif fence:
            block.append(line)
        elif match:
            yield from _prose(page, words)
            words = []
            fence, kind = match.group(1), match.group(2)
            block = [f"File `{match.group(3).strip()}`:"] if _is_file(match.group(3)) else [""]
        elif not _MARKER.fullmatch(line):
            words.append(line)
    yield from _prose(page, words)


def _prose(page: Page, lines: Sequence[str]) -> list[str]:
    """Return lines outside blocks; the words of a link may go on in the next line."""
    text = _PICTURE.sub(lambda found: f"*[picture: {found.group(1)}]*", "\n".join(lines))
    return _LINK.sub(lambda found: _reference(page, *found.groups()), text).splitlines()


def _is_file(words: str) -> bool:
    """Return whether the words of a fence name a file."""
    return "." in words


def _block(kind: str, block: list[str]) -> Iterator[str]:
    """Yield a fenced block; the first line is what stands before it."""
    if block[0]:
        yield block[0]
        yield ""
    if kind == "math":
        yield "```text"
        yield from ("  " + line for line in to_text("\n".join(block[1:])).splitlines())
    else:
        yield f"```{'text' if kind == 'console' else kind}"
        yield from block[1:]
    yield "```"


def _reference(page: Page, text: str, link: str) -> str:
    """Return the words of a link, with the name of the page where they are not it."""
    if "://" in link:
        return f"{text} ({link})"
    name, _ = page.target(link)
    other = pages().get(name)
    if other is None or name == page.name or fold(other.short) == fold(text.strip("`")):
        return text
    return f"{text} (page `{other.short}`)"

"""Pages and lists of hits on a terminal."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from contextlib import nullcontext

from rich.console import Console, RenderableType
from rich.markdown import Markdown
from rich.text import Text

from mbsim.manual.book import Page, pages
from mbsim.manual.markdown import for_terminal
from mbsim.manual.search import Hit

_WIDEST = 110  # columns; longer lines are hard to read
_OTHERS = 4  # pages named above one that was found by a word
_SHOWN = 20


def show_page(page: Page, others: Sequence[Page] = ()) -> None:
    """Print a page; `others` are named above it."""
    parts: list[RenderableType] = [Markdown(for_terminal(page), hyperlinks=False)]
    also = list(dict.fromkeys(other.name for other in others if other != page))[:_OTHERS]
    if also:
        parts.insert(0, Text(f"{page.name}; see also {', '.join(also)}\n", style="dim"))
    _print(parts)


def show_hits(topic: str, hits: Sequence[Hit]) -> None:
    """Print pages found by words, best first, each with its line."""
    have = f"{len(hits)} pages have {topic!r}"
    if hits[0].missing:
        have = f"no page has all of {topic!r}; {len(hits)} have most of it"
    parts: list[RenderableType] = [Text(f"{have}; the best first:\n")]
    for hit in hits[:_SHOWN]:
        parts.append(_entry(hit.page))
        parts.append(Text(f"    {hit.line}", style="dim"))
    if len(hits) > _SHOWN:
        parts.append(Text(f"... and {len(hits) - _SHOWN} more"))
    _print(parts)


def show_list() -> None:
    """Print the names and titles of all pages in reading order."""
    _print([_entry(page) for page in pages().values()])


def _entry(page: Page) -> Text:
    return Text.assemble((page.name, "bold"), f"  {page.title}")


def _print(parts: Sequence[RenderableType]) -> None:
    """Print to standard output, through a pager where that is a terminal too small for it."""
    console = Console(highlight=False)
    width = min(console.width, _WIDEST) if console.is_terminal else _WIDEST
    console = Console(highlight=False, width=width)
    lines = sum(len(console.render_lines(part)) for part in parts)
    paged = sys.stdout.isatty() and lines > console.height
    with console.pager(styles=True) if paged else nullcontext():
        for part in parts:
            if isinstance(part, Text):
                console.print(part, no_wrap=True, overflow="ellipsis")
            else:
                console.print(part)

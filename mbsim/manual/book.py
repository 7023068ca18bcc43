"""The pages of the manual: where they lie, their titles and headings, and their order."""

from __future__ import annotations

import functools
import posixpath
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from mbsim.errors import ModelError

PAGES = Path(__file__).parent / "pages"
#: Folders in reading order; pages of a folder stand in the order in which its index links them.
CHAPTERS = ("start", "computation", "reference", "trust", "develop")
INDEX = "index"

_HEADING = re.compile(r"(#{1,6})\s+(.*?)\s*#*")
_FENCE = re.compile(r"\s*(```+|~~~+)")
_LINK = re.compile(r"(?<!!)\[[^\]]*\]\(([^)\s]+)\)")


@dataclass(frozen=True)
class Heading:
    """A heading of a page: its level, its words and the anchor that links name."""

    level: int
    text: str
    anchor: str
    line: int


@dataclass(frozen=True)
class Page:
    """A page; `name` is its path below `pages/` without the suffix."""

    name: str
    text: str

    @property
    def short(self) -> str:
        """The last part of its name, that of its folder for an index."""
        parts = self.name.split("/")
        return parts[-2] if parts[-1] == INDEX and len(parts) > 1 else parts[-1]

    @property
    def title(self) -> str:
        """Its first heading, without marks."""
        return self.headings[0].text if self.headings else self.name

    @property
    def summary(self) -> str:
        """The sentence under the title, on one line."""
        found: list[str] = []
        for line in self.text.splitlines()[1:]:
            if line.strip():
                found.append(line.strip())
            elif found:
                break
        return plain(" ".join(found))

    @functools.cached_property
    def headings(self) -> list[Heading]:
        """All headings in order; anchors are those of GitHub."""
        found: list[Heading] = []
        seen: dict[str, int] = {}
        for number, line in prose(self.text):
            match = _HEADING.fullmatch(line)
            if match:
                text = plain(match.group(2))
                anchor = slug(text)
                again = seen.get(anchor, 0)
                seen[anchor] = again + 1
                anchor += f"-{again}" if again else ""
                found.append(Heading(len(match.group(1)), text, anchor, number))
        return found

    def links(self) -> Iterator[tuple[int, str]]:
        """Yield line number and target of every link that is no picture."""
        kept = dict(prose(self.text))
        lines = [kept.get(k, "") for k in range(1, len(self.text.splitlines()) + 1)]
        text = "\n".join(lines)  # the words of a link may go on in the next line
        for match in _LINK.finditer(text):
            yield text.count("\n", 0, match.start()) + 1, match.group(1)

    def target(self, link: str) -> tuple[str, str]:
        """Return page name and anchor that a relative link of this page leads to."""
        path, _, anchor = link.partition("#")
        if not path:
            return self.name, anchor
        joined = posixpath.normpath(posixpath.join(posixpath.dirname(self.name), path))
        return joined.removesuffix(".md"), anchor


def prose(text: str) -> Iterator[tuple[int, str]]:
    """Yield number and text of the lines outside fenced blocks."""
    fence = ""
    for number, line in enumerate(text.splitlines(), 1):
        match = _FENCE.match(line)
        if fence:
            if match and match.group(1).startswith(fence):
                fence = ""
        elif match:
            fence = match.group(1)
        else:
            yield number, line


def plain(text: str) -> str:
    """Return a line of Markdown without its marks."""
    text = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", text)
    return re.sub(r"(\*\*|__|`)", "", text)


def slug(text: str) -> str:
    """Return the anchor that GitHub gives a heading of these words."""
    return re.sub(r"[^\w\- ]", "", text.lower()).replace(" ", "-")


def link_between(page: str, other: str) -> str:
    """Return the relative link that leads from one page to another."""
    return posixpath.relpath(other + ".md", posixpath.dirname(page) or ".")


@functools.cache
def pages() -> dict[str, Page]:
    """Return all pages by name, in reading order."""
    found = {}
    for path in sorted(PAGES.rglob("*.md")):
        name = path.relative_to(PAGES).with_suffix("").as_posix()
        found[name] = Page(name, path.read_text(encoding="utf-8"))
    ordered: list[str] = []
    for chapter in ("", *CHAPTERS):
        _follow(found, posixpath.join(chapter, INDEX), ordered)
    for name in sorted(found, key=_place):
        if name not in ordered:
            _insert(ordered, name)
    return {name: found[name] for name in sorted(ordered, key=_chapter)}


def _follow(found: dict[str, Page], index: str, ordered: list[str]) -> None:
    """Add an index page, and its folder's pages in the order of links, the first page's before."""
    if index not in found or index in ordered:
        return
    ordered.append(index)
    folder = posixpath.dirname(index)
    for name in (*_linked(found, INDEX), *_linked(found, index)):
        if posixpath.basename(name) == INDEX and name.startswith(folder + "/"):
            _follow(found, name, ordered)
        elif name in found and posixpath.dirname(name) == folder and name not in ordered:
            ordered.append(name)


def _linked(found: dict[str, Page], index: str) -> list[str]:
    """Return the names that the links of an index page lead to, in their order."""
    if index not in found:
        return []
    links = [link for _, link in found[index].links() if "://" not in link]
    return [found[index].target(link)[0] for link in links]


def _insert(ordered: list[str], name: str) -> None:
    """Add a page that no index links behind the last one of its folder."""
    folder = posixpath.dirname(name)
    last = [k for k, other in enumerate(ordered) if posixpath.dirname(other) == folder]
    ordered.insert(last[-1] + 1 if last else len(ordered), name)


def _place(name: str) -> tuple[str, bool, str]:
    """Return a key that sorts folders, each with its index first."""
    return posixpath.dirname(name), posixpath.basename(name) != INDEX, name


def _chapter(name: str) -> int:
    """Return the number of a page's chapter; single pages stand around these."""
    first, _, rest = name.partition("/")
    if not rest:
        return -1 if name == INDEX else len(CHAPTERS) + 1
    return CHAPTERS.index(first) if first in CHAPTERS else len(CHAPTERS)


def fold(topic: str) -> str:
    """Return a topic without case, blanks, `_`, `-` and suffix."""
    return re.sub(r"[\s_\-]+", "", topic.strip().removesuffix(".md").lower())


def named(topic: str) -> list[Page]:
    """Return the pages whose name, or whose name's last part or parts, is `topic`."""
    wanted = fold(topic)
    if not wanted:
        return []
    full = [page for page in pages().values() if wanted == fold(page.name)]
    short = full or [page for page in pages().values() if wanted == fold(page.short)]
    ends = [page for page in pages().values() if f"/{fold(page.name)}".endswith(f"/{wanted}")]
    return short or ends


def page_of(topic: str) -> Page:
    """Return the page of that name; ModelError where there is none."""
    found = named(topic)
    if not found:
        raise ModelError(f"{topic}: no such page; mbsim manual --list names them")
    return found[0]

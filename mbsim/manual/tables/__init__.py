"""Tables of the manual that are made from the registries, so that they cannot go stale.

A page has ``<!-- table: NAME ARGUMENT -->`` and ``<!-- end of table -->`` on lines of their own;
what stands between them is made by the function registered as NAME.
"""

from __future__ import annotations

import importlib
import pkgutil
import re
import textwrap
from collections.abc import Callable, Iterable, Sequence

from mbsim.errors import ModelError
from mbsim.manual.book import Page, link_between, named

#: Longest line of a page.
WIDEST = 120
Maker = Callable[[str, Page], list[str]]
_MAKERS: dict[str, Maker] = {}
_TABLE = re.compile(
    r"(<!-- table: ([^\n]*?) -->\n)(.*?)(<!-- end of table -->)", re.DOTALL | re.MULTILINE
)


def table(name: str) -> Callable[[Maker], Maker]:
    """Register the decorated function: ``make(argument, page)`` returns the table's lines."""

    def register(make: Maker) -> Maker:
        _MAKERS[name] = make
        return make

    return register


def makers() -> dict[str, Maker]:
    """Return the makers of all tables by name."""
    for module in pkgutil.iter_modules(__path__):
        importlib.import_module(f"{__name__}.{module.name}")
    return _MAKERS


def asked(text: str) -> list[str]:
    """Return what the markers of a page ask for, with the arguments."""
    return [match.group(2) for match in _TABLE.finditer(text)]


def made(what: str, page: Page) -> str:
    """Return the table that a marker asks for."""
    by_length = sorted(makers(), key=len, reverse=True)
    name = next((name for name in by_length if (what + " ").startswith(name + " ")), None)
    if name is None:
        raise ModelError(f"{page.name}: table {what!r}: there are {', '.join(sorted(makers()))}")
    try:
        lines = makers()[name](what[len(name) :].strip(), page)
    except KeyError as error:
        raise ModelError(f"{page.name}: table {what!r}: {error.args[0]} is not known") from None
    return "\n".join(lines)


def filled(page: Page) -> str:
    """Return the text of a page with all its tables made anew."""

    def put(match: re.Match[str]) -> str:
        return f"{match.group(1)}\n{made(match.group(2), page)}\n\n{match.group(4)}"

    return _TABLE.sub(put, page.text)


def rows(head: Sequence[str], body: Iterable[Sequence[str]]) -> list[str]:
    """Return a Markdown table; columns that are empty throughout are left out.

    Of no rows it is no lines.
    """
    body = [list(row) for row in body]
    if not body:
        return []
    used = [k for k in range(len(head)) if any(row[k] for row in body)]
    lines = [[head[k] for k in used], ["---" for _ in used]]
    lines += [[row[k].replace("|", "\\|") for k in used] for row in body]
    return ["| " + " | ".join(cells) + " |" for cells in lines]


def item(text: str) -> list[str]:
    """Return one entry of a list, broken into lines."""
    return textwrap.wrap(
        text, WIDEST - 10, initial_indent="- ", subsequent_indent="  ", break_long_words=False
    )


def reference(page: Page, name: str, text: str = "") -> str:
    """Return `text` as a link to the page `name`, as code alone where there is no such page."""
    text = text or f"`{name}`"
    # other chapters may have a page of that name too
    found = sorted(named(name), key=lambda each: not each.name.startswith("reference/"))
    return f"[{text}]({link_between(page.name, found[0].name)})" if found else text


def first_sentence(text: str) -> str:
    """Return the first sentence of a docstring, on one line, without its full stop."""
    paragraph = " ".join((text or "").strip().split("\n\n")[0].split())
    return re.split(r"(?<=[\w)\]])\. |: (?=[a-z]+\()", paragraph)[0].rstrip(".")

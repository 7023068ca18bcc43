"""What the subcommands print, for people and for scripts."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from typing import Any

import click

#: What a terminal obeys instead of showing it: control characters but line ends and tabs, marks
#: that turn the direction of writing, and bytes of file names that are no text.
_UNSEEN = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]"
)


#: File and line with which a message of a deck begins; behind other words they are no beginning.
_PLACE = re.compile(r"((?:[A-Za-z]:)?[^\n:]+\.\w+:\d+): (.*)", re.DOTALL)


def printable(text: str) -> str:
    """Return a text with everything that a terminal would obey written as an escape."""
    return _UNSEEN.sub(_escaped, text)


def _escaped(found: re.Match[str]) -> str:
    """Return a character as Python writes it; a byte that is no text as that byte."""
    code = ord(found[0])
    if 0xDC80 <= code <= 0xDCFF:
        return f"\\x{code - 0xDC00:02x}"
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}"


def echo(text: str = "", err: bool = False, nl: bool = True) -> None:
    """Print text that may come from decks, file names, plugins and result files."""
    click.echo(printable(text), err=err, nl=nl)


def counted(count: int, name: str) -> str:
    """Return a number of things, `name` being their plural: ``1 body``, ``2 bodies``."""
    if count == 1:
        name = name.removesuffix("ies") + "y" if name.endswith("ies") else name.removesuffix("s")
    return f"{count} {name}"


def with_severity(severity: str, text: str) -> str:
    """Return a message as it is printed: with file and line first, where editors look for them."""
    place, message = split_place(text)
    return f"{place}: {severity}: {message}" if place else f"mbsim: {severity}: {text}"


def split_place(text: str) -> tuple[str, str]:
    """Return file and line with which a message begins, ``deck.xml:12``, or nothing; the rest."""
    found = _PLACE.match(text)
    return (found[1], found[2]) if found else ("", text)


def warn(lines: Iterable[str]) -> None:
    """Print warnings."""
    for line in lines:
        echo(with_severity("warning", line), err=True)


def print_json(value: Any) -> None:
    """Print the one JSON value that standard output shall hold; what is not ASCII is escaped."""
    click.echo(json.dumps(value, allow_nan=False))

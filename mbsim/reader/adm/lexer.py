r"""The text of a deck to `Node`s: title, comments, continuation, and whose value is what.

    title                              the first line, whatever it is
    NAME/id, WORD, NAME = value, ...   ! to the end of the line: a comment
    , NAME = value                     a line that begins with a comma goes on with the statement
    NAME/id, F2 = function\F3 = ...    a backslash ends a function as a comma does

Names and words may be cut short as long as they stay unique. A value runs to the next
``NAME =`` or word of the statement, so lists have their commas and functions go on over lines.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field

from mbsim.reader.adm.declare import AdmStatement, Value
from mbsim.reader.keywords import fold, nearest
from mbsim.reader.parse import Attribute, Node

LONGEST = 100_000  # characters of one statement

_HEAD = re.compile(r"\s*([A-Za-z_]\w*)[ \t]*(?:/[ \t]*(\d*))?[ \t]*,?")
_NAMED = re.compile(r"\s*([A-Za-z_]\w*)\s*=")

Fault = Callable[[int, str, str], None]


@dataclass
class Raw:
    """One statement as it stands: `text` with a newline where a line goes on, and its lines."""

    text: str
    lines: list[int] = field(default_factory=list)

    def line(self, position: int) -> int:
        """Return the line of the deck at a position of the text."""
        return self.lines[self.text.count("\n", 0, position)]


def split_statements(text: str) -> Iterator[Raw]:
    """Yield the statements after the title line, without comments and blank lines."""
    current: Raw | None = None
    joined = False  # the line before ended with &
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    for number, line in enumerate(text.split("\n"), start=1):
        line = _without_comment(line).strip()
        if number == 1 or not line:
            continue
        goes_on = line.startswith(",")
        ampersand = line.endswith("&")
        line = line.removesuffix("&")
        if current is not None and (goes_on or joined):
            current.text += "\n" + (line[1:] if goes_on else line)
            current.lines.append(number)
        else:
            if current is not None:
                yield current
            current = Raw(line, [number])
        joined = ampersand
    if current is not None:
        yield current


def _without_comment(line: str) -> str:
    """Return a line up to its first ! that is not within double quotes."""
    quoted = False
    for k, character in enumerate(line):
        if character == '"':
            quoted = not quoted
        elif character == "!" and not quoted:
            return line[:k]
    return line


def unique(word: str, known: Iterable[str]) -> list[str]:
    """Return what a word may stand for: itself, or all that begin with it."""
    names = list(known)
    exact = [name for name in names if fold(name) == fold(word)]
    return exact or [name for name in names if fold(name).startswith(fold(word))]


def to_node(raw: Raw, statements: Mapping[str, AdmStatement], fault: Fault) -> Node | None:
    """Return a statement as a node, None with a fault where it has no name.

    Parameters
    ----------
    raw : Raw
        One statement.
    statements : mapping of str to AdmStatement
        Every statement by its folded name.
    fault : callable
        Takes line, element and message.
    """
    head = _HEAD.match(raw.text)
    if head is None or len(raw.text) > LONGEST:
        what = f"longer than {LONGEST} characters" if head else "no statement: must be NAME/id, ..."
        fault(raw.lines[0], raw.text.split("\n")[0][:30].strip(), what)
        return None
    if _NAMED.match(raw.text):
        what = "no statement but an argument: is the comma missing that continues the line before?"
        fault(raw.lines[0], head.group(1).upper(), what)
        return None
    name, id = head.group(1), head.group(2)
    found = unique(name, (statement.name for statement in statements.values()))
    node = Node(found[0] if len(found) == 1 else name.upper(), raw.lines[0])
    if id:
        node.attributes.append(Attribute("id", str(int(id)) if len(id) < 19 else id, node.line))
    statement = statements.get(fold(node.tag))
    if statement is not None and not (statement.any_attribute(node) or statement.opaque(raw.text)):
        _Arguments(raw, head.end(), node, statement, fault).read()
    return node


class _Arguments:
    """The arguments of one statement, taken from left to right."""

    def __init__(
        self, raw: Raw, start: int, node: Node, statement: AdmStatement, fault: Fault
    ) -> None:
        self.raw, self.position, self.node = raw, start, node
        self.statement, self.fault = statement, fault
        id = node.find("id")
        self.label = node.tag + (f"[{id.value}]" if id else "")
        self.value: Attribute | None = None  # the one that may go on
        self.kind = Value.ITEM

    def read(self) -> None:
        """Put every argument into the node."""
        text = self.raw.text
        while self.position < len(text):
            start = self.position
            named = _NAMED.match(text, start)
            name = self._name(named.group(1)) if named else ""
            if named and (name or self.value is None or self.kind is not Value.TEXT):
                self._begin(name or named.group(1), named.start(1), named.end())
            else:
                self._take(text[start : self._end(start)].strip(), start)
            self.position = self._end(self.position) + 1

    def _name(self, word: str) -> str:
        """Return the attribute that a name stands for, or nothing."""
        found = unique(word, self.statement.names())
        if len(found) > 1:
            here = self.raw.line(self.position)
            self.fault(here, self.label, f"{word}: may be {', '.join(found)}; write more of it")
        return found[0] if len(found) == 1 else ""

    def _begin(self, name: str, at: int, after: int) -> None:
        """Add an attribute that has a name, with its value up to the next separator."""
        self.kind = self.statement.value_kind(name)
        self.position = after
        value = " ".join(self.raw.text[after : self._end(after)].split())
        self.value = Attribute(name, value, self.raw.line(at))
        self.node.attributes.append(self.value)

    def _end(self, start: int) -> int:
        """Return where a piece ends: at a comma, line end or backslash outside parentheses."""
        depth = 0
        text = self.raw.text
        for k in range(start, len(text)):
            if text[k] in ",\n\\" and (depth <= 0 or self.kind is Value.TEXT):
                return k
            depth += {"(": 1, ")": -1}.get(text[k], 0)
        return len(text)

    def _take(self, piece: str, start: int) -> None:
        """Take a piece without a name: a word of the statement, or more of the value before."""
        if not piece:
            return
        before = self.value
        open_end = self.kind is Value.FUNCTION and before and before.value[-1:] in "+-*/"
        words = [] if open_end or " " in piece else unique(piece, self.statement.words)
        if len(words) == 1 and self._is_word(piece, words[0]):
            name, value = self.statement.words[words[0]]
            at = start + len(self.raw.text[start:]) - len(self.raw.text[start:].lstrip())
            self.node.attributes.append(Attribute(name, value, self.raw.line(at)))
            self.value, self.kind = None, Value.ITEM
        elif before is not None and self.kind is not Value.ITEM:
            between = " " if self.kind is Value.FUNCTION else ", "
            before.value += between + " ".join(piece.split())
        else:
            shown = piece if len(piece) <= 60 else piece[:57] + "..."
            known = ", ".join(words or self.statement.words) or "none"
            close = nearest(piece, self.statement.words) or f"; known: {known}"
            what = f"may be {known}; write more of it" if words else f"unknown word{close}"
            self.fault(self.raw.line(start), self.label, f"{shown}: {what}")

    def _is_word(self, piece: str, word: str) -> bool:
        """Return whether a piece is the word, in full where it may be more text of a comment."""
        return self.value is None or self.kind is not Value.TEXT or fold(piece) == fold(word)

"""A deck's bytes to a plain tree of `Node`s, with the line of every element and attribute.

Only safe XML passes: no DOCTYPE, so no entities and no files or network behind them, and
bounded size and depth. lxml gives one line a tag (that of its end), so lines are found
by a second scan of the text, which is known to be well formed by then.
"""

from __future__ import annotations

import functools
import re
import unicodedata
from bisect import bisect_right
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

from lxml import etree

from mbsim.errors import DeckError, Fault, ModelError
from mbsim.reader.keywords import fold

MAX_BYTES = 64 * 2**20
MAX_DEPTH = 32

# decoded here and not by libxml2, so that the scan for DOCTYPE sees what the parser sees
_ENCODINGS = {
    "utf-8": "utf-8",
    "utf8": "utf-8",
    "us-ascii": "ascii",
    "ascii": "ascii",
    "iso-8859-1": "latin-1",
    "latin-1": "latin-1",
    "iso-8859-15": "iso-8859-15",
    "windows-1252": "cp1252",
    "utf-16": "utf-16",
}
#: Blanks that XML takes for letters.
_ODD_BLANKS = re.compile("[\u00a0\u1680\u2000-\u200a\u202f\u205f\u3000]")
#: First bytes of what is no text, and what it then is.
_RESULTS = {b"\x89HDF\r\n\x1a\n": "an HDF5 file", b"PAR1": "a Parquet table"}
_DECLARATION = re.compile(rb"<\?xml[^>]*?encoding\s*=\s*[\"']([^\"']*)[\"']")
_BEFORE_ROOT = re.compile(r"(?:\s+|<!--.*?-->|<\?.*?\?>)*", re.DOTALL)
_TAG = re.compile(
    r"<!--.*?-->|<!\[CDATA\[.*?\]\]>|<\?.*?\?>"
    r"|<([^\s/>!?][^\s/>]*)([^>\"']*(?:(?:\"[^\"]*\"|'[^']*')[^>\"']*)*)>",
    re.DOTALL,
)
_ATTRIBUTE = re.compile(r"([^\s=]+)\s*=\s*(?:\"[^\"]*\"|'[^']*')")
_SCHEMA = "{http://www.w3.org/2001/XMLSchema-instance}"


@dataclass(slots=True)
class Attribute:
    """One attribute as written; `origin` names the --set option that gave the value."""

    name: str
    value: str
    line: int
    origin: str = ""


@dataclass(slots=True)
class Node:
    """One element: `tag` as written, attributes in order, `text` without that of its children.

    `comments` are those between what stands before it and its tag, `last_comments` those between
    its last child and its end. A tree that is kept has with it what `reader.statement` found.
    """

    tag: str
    line: int
    attributes: list[Attribute] = field(default_factory=list)
    text: str = ""
    children: list[Node] = field(default_factory=list)
    comments: tuple[str, ...] = ()
    last_comments: tuple[str, ...] = ()
    parsed: Any = field(init=False, default=None, repr=False, compare=False)
    effect: Any = field(init=False, default=None, repr=False, compare=False)

    def copy(self) -> Node:
        """Return one whose attributes may be changed; its children are the same."""
        return Node(
            self.tag,
            self.line,
            [Attribute(a.name, a.value, a.line, a.origin) for a in self.attributes],
            self.text,
            list(self.children),
            self.comments,
            self.last_comments,
        )

    @property
    def key(self) -> str:
        """Return the tag in the form in which tags are compared."""
        return fold(self.tag)

    def find(self, name: str) -> Attribute | None:
        """Return the attribute of that name, in any spelling, or None."""
        wanted = fold(name)
        for attribute in self.attributes:
            if attribute.name == name or fold(attribute.name) == wanted:
                return attribute
        return None


def _ignore(line: int, message: str) -> None:
    return None


def parse(data: bytes, file: str, note: Callable[[int, str], None] = _ignore) -> Node:
    """Return the root of the deck `data`.

    Parameters
    ----------
    data : bytes
        The whole deck.
    file : str
        The deck's name for messages.
    note : callable, optional
        Is told the line and what was read in place of what stands there.

    Raises
    ------
    ModelError
        If the deck is larger than `MAX_BYTES`.
    DeckError
        If it is not readable text or well-formed XML, has a DOCTYPE, or is nested too deeply.
    """
    if len(data) > MAX_BYTES:
        raise ModelError(f"{file}: larger than {MAX_BYTES // 2**20} MiB, the limit of a deck")
    text = _with_blanks(_decode(data, file), note)
    start = _BEFORE_ROOT.match(text)
    if start and text.startswith("<!DOCTYPE", start.end()):
        line = text.count("\n", 0, start.end()) + 1
        raise _refused(file, line, "a DOCTYPE is not accepted: decks have no DTD and no entities")

    parser = etree.XMLParser(
        encoding="utf-8",
        resolve_entities=False,
        no_network=True,
        load_dtd=False,
        dtd_validation=False,
        attribute_defaults=False,
        huge_tree=False,
    )
    try:
        root = etree.fromstring(text.encode("utf-8"), parser)
    except etree.XMLSyntaxError as error:
        reason = re.sub(r", line \d+, column \d+.*$", "", error.msg or "no element found")
        raise _refused(file, error.lineno or 1, f"not well-formed XML: {reason}") from None
    if root.getroottree().docinfo.internalDTD is not None:
        raise _refused(file, 1, "a DOCTYPE is not accepted: decks have no DTD and no entities")
    return _to_nodes(root, text, file)


#: Bytes of a deck whose tree is kept, and how many are.
_KEPT_BYTES, _KEPT_TREES = 1 << 20, 4


def parsed(data: bytes, file: str, note: Callable[[int, str], None]) -> Node:
    """Return what `parse` does, kept where it is small: nobody changes the tree.

    A process that runs a deck many times, with other values, has the bytes again.
    """
    if len(data) > _KEPT_BYTES:
        return parse(data, file, note)
    root, notes = _parsed(data, file)
    for line, message in notes:
        note(line, message)
    return root


@functools.lru_cache(maxsize=_KEPT_TREES)
def _parsed(data: bytes, file: str) -> tuple[Node, list[tuple[int, str]]]:
    """Return the root of a deck, and lines and texts of notes."""
    notes: list[tuple[int, str]] = []
    return parse(data, file, lambda line, message: notes.append((line, message))), notes


def _refused(file: str, line: int, message: str) -> DeckError:
    """Return the one-fault error of a deck that cannot be parsed at all."""
    return DeckError([Fault(file, line, "", message)])


def refuse_results(data: bytes, file: str) -> None:
    """Raise `DeckError` where a file is one of those that runs and studies write."""
    for mark, kind in _RESULTS.items():
        if data.startswith(mark):
            raise _refused(file, 1, f"{kind}, not a deck; mbsim info shows what is in results")


def _decode(data: bytes, file: str) -> str:
    """Return the deck as text; the encoding is that of its byte order mark or declaration."""
    refuse_results(data, file)
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        name = "utf-16"
    else:
        declared = _DECLARATION.match(data.removeprefix(b"\xef\xbb\xbf"))
        name = declared.group(1).decode("ascii", "replace") if declared else "utf-8"
    codec = _ENCODINGS.get(name.lower())
    if codec is None:
        allowed = "UTF-8, UTF-16, US-ASCII, ISO-8859-1, ISO-8859-15 or Windows-1252"
        raise _refused(file, 1, f'encoding="{name}": must be {allowed}')
    try:
        text = data.decode("utf-8-sig" if codec == "utf-8" else codec)
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise _refused(file, line, f"not {name.upper()} text: {error.reason}") from None
    if "\0" in text:
        line = text.count("\n", 0, text.index("\0")) + 1
        raise _refused(file, line, "not a text file: it holds a NUL character")
    return text


def _with_blanks(text: str, note: Callable[[int, str], None]) -> str:
    """Return the text with a blank for every blank of another kind, as web pages have them."""
    found = _ODD_BLANKS.search(text)
    if found is None:
        return text
    kind = unicodedata.name(found.group(), "blank").lower()
    note(
        text.count("\n", 0, found.start()) + 1, f"a {kind} (U+{ord(found.group()):04X}) is a blank"
    )
    return _ODD_BLANKS.sub(" ", text)


def _to_nodes(root: etree._Element, text: str, file: str) -> Node:
    """Return the tree of `root` as `Node`s, walking without recursion."""
    lines = _tag_lines(text)
    top = Node("", 0)
    above = [top]
    for event, element in etree.iterwalk(root, events=("start", "end"), tag="*"):
        if event == "end":
            above.pop()
            continue
        line, attribute_lines = next(lines, (0, {}))
        if len(above) > MAX_DEPTH:
            raise _refused(file, line, f"elements nested more than {MAX_DEPTH} deep")

        attributes = []
        for name, value in element.items():
            if name[0] == "{":
                if name.startswith(_SCHEMA):
                    continue
                name = etree.QName(name).localname
            at = attribute_lines.get(name, line) if attribute_lines else line
            attributes.append(Attribute(name, value, at))
        text_of = element.text or ""
        if len(element):
            text_of += "".join(child.tail or "" for child in element)
        tag = element.tag.rpartition("}")[2]
        node = Node(tag, line, attributes, text_of and text_of.strip())
        node.comments = _comments(element.itersiblings(preceding=True))
        node.last_comments = _comments(element.iterchildren(reversed=True))
        above[-1].children.append(node)
        above.append(node)
    return top.children[0]


def _comments(nodes: Iterator[etree._Element]) -> tuple[str, ...]:
    """Return the comments before the first element of `nodes`, in the order of the text."""
    found: list[str] = []
    for node in nodes:
        if isinstance(node, etree._Comment):
            found.append(node.text or "")
        elif not isinstance(node, etree._ProcessingInstruction):
            break
    return tuple(reversed(found))


def _tag_lines(text: str) -> Iterator[tuple[int, dict[str, int]]]:
    """Yield the line of each start tag, in document order, and of its attributes by local name."""
    breaks = [match.start() for match in re.finditer("\n", text)]
    for tag in _TAG.finditer(text):
        if tag.group(1) is None:
            continue
        line = bisect_right(breaks, tag.start()) + 1
        attributes = {}
        if "\n" in tag.group(2):
            for match in _ATTRIBUTE.finditer(tag.group(2)):
                position = tag.start(2) + match.start()
                name = match.group(1).rpartition(":")[2]
                attributes[name] = bisect_right(breaks, position) + 1
        yield line, attributes

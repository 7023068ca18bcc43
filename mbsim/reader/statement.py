"""How a statement of the deck is declared, and how one element is read by its declaration."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeVar

from mbsim.model.elements import Source
from mbsim.reader.draft import Draft
from mbsim.reader.keywords import fold, nearest
from mbsim.reader.kinds import ID, TEXT, BadValueError, Kind
from mbsim.reader.parse import Attribute, Node

Element = TypeVar("Element")

_SHOWN = 60  # characters of a value that a message quotes


@dataclass(frozen=True)
class Spec:
    """One documented attribute.

    `about` is its meaning, one line for people; `unit` is in F, L, M, T and rad, `default` what is
    taken where the deck does not give it, in the deck's words. `note` says why it is accepted
    without effect, `refused` why it cannot be accepted; `harmless` is the value (folded) at which
    neither is worth a word. What `repeats` may be given more than once; its values are then put
    together with a ``|`` between.
    """

    kind: Kind = TEXT
    about: str = ""
    unit: str = ""
    default: str = ""
    required: bool = False
    note: str = ""
    refused: str = ""
    harmless: str = ""
    alias: str = ""
    repeats: bool = False


#: What an element with an id has in every deck.
NAMED = {
    "id": Spec(ID, "number by which others name it, unique per statement", required=True),
    "label": Spec(TEXT, "name in logs and pictures"),
    "full_label": Spec(TEXT, "a longer name; is not shown"),
}
#: The two markers of an element between bodies.
MARKERS = {
    "i_marker_id": Spec(ID, "marker I", required=True),
    "j_marker_id": Spec(ID, "marker J", required=True),
}


def _needs_no_names(node: Node) -> bool:
    return False


def _builds_nothing(entry: Entry) -> None:
    return None


@dataclass(frozen=True)
class Statement:
    """One statement: its attributes, its children, where it may stand, and what it becomes.

    `build` gets the parsed attributes and adds an element to the draft. `any_attribute`
    tells of a node whose attributes are not looked at, because nothing in it can matter. `text`
    is the attribute that may be given as the element's text as well. `about` says what it is.
    """

    name: str
    attributes: Mapping[str, Spec] = field(default_factory=dict)
    build: Callable[[Entry], None] = _builds_nothing
    children: tuple[str, ...] = ()
    in_model: bool = True
    in_command: bool = False
    note: str = ""
    any_attribute: Callable[[Node], bool] = _needs_no_names
    text: str = ""
    about: str = ""

    @cached_property
    def spec_names(self) -> dict[str, str]:
        """Return folded spelling -> attribute name, aliases included."""
        names = {fold(name): name for name in self.attributes}
        names |= {fold(s.alias): name for name, s in self.attributes.items() if s.alias}
        return names

    def read(self, node: Node, draft: Draft) -> None:
        """Read one element into the draft; faults go there too."""
        before = len(draft.faults)
        entry = Entry(self, node, draft)
        if self.note:
            draft.note(node.line, f"{self.name}: {self.note}")
        self.build(entry)
        if len(draft.faults) > before and entry.get("id") is not None:
            draft.broken.add((self.name, entry.get("id")))


class Entry:
    """One element being read: its attributes parsed and checked against the declaration."""

    def __init__(self, statement: Statement, node: Node, draft: Draft) -> None:
        self.statement = statement
        self.node = node
        self.draft = draft
        self.source = Source(draft.file, node.line)
        self._attributes: dict[str, Attribute] = {}
        self._values: dict[str, Any] = {}
        id = node.find("id")
        self.label = statement.name + (f"[{_short(id.value)}]" if id else "")

        if statement.any_attribute(node):
            return
        self._collect()
        self._check_content()
        for name, attribute in self._attributes.items():
            self._parse(name, attribute)
        for name, spec in statement.attributes.items():
            if spec.required and name not in self._attributes:
                self.fault(f"{name}: missing; must be {spec.kind.allowed}")

    def get(self, name: str, default: Any = None) -> Any:
        """Return the value of an attribute, `default` where it is absent or faulty."""
        return self._values.get(name, default)

    def given(self, name: str) -> bool:
        """Return whether the deck gives the attribute, faulty or not."""
        return name in self._attributes

    def fault(self, message: str, attribute: str = "") -> None:
        """Add a fault, at the attribute's line and quoting its value where one is named."""
        self.draft.fault(self._line(attribute), self.label, self._quote(attribute) + message)

    def warn(self, message: str, attribute: str = "") -> None:
        """Add a warning, placed and quoted like a fault."""
        self.draft.warn(self._line(attribute), self.label, self._quote(attribute) + message)

    def note(self, message: str, attribute: str = "") -> None:
        """Add a note that reads the same for every element it applies to."""
        name = self.statement.name + (f" {attribute}" if attribute else "")
        self.draft.note(self._line(attribute), f"{name}: {message}")

    def register(self, table: dict[int, Element], element: Element) -> None:
        """Put the element into its table; an id used twice is a fault."""
        id = self.get("id")
        if id is None:
            return
        if id in table:
            first = getattr(table[id], "source", Source()).line
            self.fault(f"id already used on line {first}; ids are unique per statement", "id")
        else:
            table[id] = element

    def _line(self, attribute: str) -> int:
        found = self._attributes.get(attribute)
        return found.line if found else self.node.line

    def _quote(self, attribute: str) -> str:
        """Return ``name="value": `` for a message, with the option that gave the value."""
        if not attribute:
            return ""
        found = self._attributes.get(attribute)
        if found is None:
            return f"{attribute}: "
        origin = f" (from {found.origin})" if found.origin else ""
        return f'{attribute}="{_short(found.value)}"{origin}: '

    def _collect(self) -> None:
        """Match the attributes with the declared names; unknown and repeated ones are faults."""
        names = self.statement.spec_names
        for attribute in self.node.attributes:
            name = names.get(fold(attribute.name))
            if name is None:
                close = nearest(attribute.name, self.statement.attributes)
                known = ", ".join(self.statement.attributes) or "none"
                help = close or f"; known: {known}"
                message = f'{attribute.name}="{_short(attribute.value)}": unknown attribute{help}'
                self.draft.fault(attribute.line, self.label, message)
            elif name in self._attributes and self.statement.attributes[name].repeats:
                first = self._attributes[name]
                joined = f"{first.value} | {attribute.value}"
                self._attributes[name] = Attribute(first.name, joined, first.line, first.origin)
            elif name in self._attributes:
                self.fault(f"given twice, the second time as {attribute.name}", name)
            else:
                self._attributes[name] = attribute

    def _parse(self, name: str, attribute: Attribute) -> None:
        """Store the value of one attribute, or the fault, refusal or note it gives rise to."""
        spec = self.statement.attributes[name]
        text = attribute.value.strip()
        harmless = bool(spec.harmless) and fold(text) == fold(spec.harmless)
        try:
            self._values[name] = spec.kind.parse(text)
        except BadValueError as error:
            self.fault(str(error) or f"must be {spec.kind.allowed}", name)
            return
        if spec.refused and not harmless:
            self.fault(spec.refused, name)
        if spec.note and not harmless:
            self.note(spec.note, name)

    def _check_content(self) -> None:
        """Refuse text and child elements that the statement does not have."""
        allowed = {fold(name) for name in self.statement.children} if self.node.children else ()
        for child in self.node.children:
            if child.key not in allowed:
                close = nearest(child.tag, self.statement.children)
                self.draft.fault(child.line, self.label, f"unknown element <{child.tag}>{close}")
        text = self.statement.text
        if self.node.text and text and text not in self._attributes:
            self._attributes[text] = Attribute(text, self.node.text, self.node.line)
        elif self.node.text and text:
            self.fault("given as text of the element too; must be one of both", text)
        elif self.node.text:
            self.fault(f"text {_short(self.node.text)!r} inside the element is not accepted")


def _short(value: str) -> str:
    """Return a value short enough for one line of a message."""
    value = " ".join(value.split())
    return value if len(value) <= _SHOWN else value[: _SHOWN - 3] + "..."

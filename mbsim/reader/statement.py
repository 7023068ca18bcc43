"""How a statement of the deck is declared, and how one element is read by its declaration."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np

from mbsim.model.elements import Source
from mbsim.reader.draft import Draft
from mbsim.reader.keywords import fold, nearest
from mbsim.reader.kinds import ID, TEXT, BadValueError, Kind, about_degrees
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
    alias: str = ""  # other names, separated by blanks
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
    is the attribute that may be given as the element's text as well. `about` says what it is,
    `call` what a `mbsim.Model` calls it where that is not its name without the first word.
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
    call: str = ""

    @cached_property
    def spec_names(self) -> dict[str, str]:
        """Return folded spelling -> attribute name, aliases and names as declared included."""
        names = {fold(name): name for name in self.attributes}
        names |= {name: name for name in self.attributes}
        names |= {
            fold(other): name for name, s in self.attributes.items() for other in s.alias.split()
        }
        return names

    @cached_property
    def required(self) -> tuple[str, ...]:
        """Return the attributes that every element must have."""
        return tuple(name for name, spec in self.attributes.items() if spec.required)

    @cached_property
    def may_hold(self) -> frozenset[str]:
        """Return the folded names of child elements."""
        return frozenset(map(fold, self.children))

    def read(self, node: Node, draft: Draft) -> None:
        """Read one element into the draft; faults go there too.

        What follows from the element alone stays with its node: one that is read again, of a deck
        that is kept (`parse.parsed`), does the same to the draft.
        """
        kept = node.effect
        if kept is not None and kept.statement is self and kept.repeat(draft):
            return
        before = len(draft.faults)
        entry = Entry(self, node, draft)
        if self.note:
            entry.note(self.note)
        self.build(entry)
        if len(draft.faults) > before:
            if entry.get("id") is not None:
                draft.broken.add((self.name, entry.get("id")))
        elif entry.alone:
            node.effect = entry.effect()


class Parsed(NamedTuple):
    """The attributes of an element without a word to be said of them."""

    statement: Statement
    attributes: dict[str, Attribute]
    values: dict[str, Any]


class Effect(NamedTuple):
    """What reading an element did to its draft, where that followed from the element alone."""

    statement: Statement
    said: list[tuple[str, tuple[Any, ...]]]  # methods of the draft, and what they were told
    elements: list[tuple[tuple[str, ...], int, Any]]  # tables that have no such id, ids, elements

    def repeat(self, draft: Draft) -> bool:
        """Do it to another draft of the deck; return whether it could, as no id is used twice."""
        for tables, id, _ in self.elements:
            if any(id in getattr(draft, table) for table in tables):
                return False
        for method, given in self.said:
            getattr(draft, method)(*given)
        for tables, id, element in self.elements:
            getattr(draft, tables[0])[id] = element
        return True


class Entry:
    """One element being read: its attributes parsed and checked against the declaration."""

    def __init__(self, statement: Statement, node: Node, draft: Draft) -> None:
        self.statement = statement
        self.node = node
        self._draft = draft
        #: Whether nothing was looked at but the element itself.
        self.alone = True
        self.source = Source(draft.file, node.line)
        self._attributes: dict[str, Attribute] = {}
        self._values: dict[str, Any] = {}
        self._said: list[tuple[str, tuple[Any, ...]]] = []
        self._elements: list[tuple[tuple[str, ...], int, Any]] = []

        if statement.any_attribute(node):
            return
        kept = node.parsed
        if kept is not None and kept.statement is statement:
            self._attributes, self._values = kept.attributes, kept.values
            return
        before = len(draft.faults)
        self._collect()
        if node.children or node.text:
            self._check_content()
        self._parse()
        for name in statement.required:
            if name not in self._attributes:
                self.fault(f"{name}: missing; must be {statement.attributes[name].kind.allowed}")
        if len(draft.faults) == before and not self._said:
            node.parsed = Parsed(statement, self._attributes, self._values)

    @property
    def draft(self) -> Draft:
        """What is known of the deck so far; who looks there depends on more than the element."""
        self.alone = False
        return self._draft

    def beside(self, name: str) -> Path:
        """Return the path of a file that the deck names; what is in it the element does not say."""
        return self.draft.directory / name.replace("\\", "/")

    def effect(self) -> Effect:
        """Return what was done to the draft; its arrays stay as they are from here on."""
        for _, _, element in self._elements:
            for value in vars(element).values():
                if isinstance(value, np.ndarray):
                    value.flags.writeable = False
        return Effect(self.statement, self._said, self._elements)

    def _tell(self, method: str, *given: Any) -> None:
        """Call a method of the draft, and remember that."""
        getattr(self._draft, method)(*given)
        self._said.append((method, given))

    @property
    def label(self) -> str:
        """Return what messages call the element."""
        id = self.node.find("id")
        return self.statement.name + (f"[{_short(id.value)}]" if id else "")

    def get(self, name: str, default: Any = None) -> Any:
        """Return the value of an attribute, `default` where it is absent or faulty."""
        return self._values.get(name, default)

    def given(self, name: str) -> bool:
        """Return whether the deck gives the attribute, faulty or not."""
        return name in self._attributes

    def those(self, names: Iterable[str]) -> list[str]:
        """Return those of the attributes that the deck gives."""
        given = self._attributes
        return [name for name in names if name in given]

    def one_of(self, names: Iterable[str]) -> list[str]:
        """Return those of attributes that say the same: where --set gives some, only these."""
        given = self.those(names)
        return [name for name in given if self._attributes[name].origin] or given

    def fault(self, message: str, attribute: str = "") -> None:
        """Add a fault, at the attribute's line and quoting its value where one is named."""
        self.fault_at(self._line(attribute), self._quote(attribute) + message)

    def fault_at(self, line: int, message: str) -> None:
        """Add a fault that stands at another line than the element's."""
        self._draft.fault(line, self.label, message)

    def warn(self, message: str, attribute: str = "") -> None:
        """Add a warning, placed and quoted like a fault."""
        said = self._quote(attribute) + message
        self._tell("warn", self._line(attribute), self.label, said)

    def note(self, message: str, attribute: str = "") -> None:
        """Add a note that reads the same for every element it applies to."""
        name = self.statement.name + (f" {attribute}" if attribute else "")
        self._tell("note", self._line(attribute), f"{name}: {message}")

    def register(self, table: str, element: Any, *others: str) -> None:
        """Put the element into a table of the draft; an id used there or in others is a fault."""
        id = self.get("id")
        if id is not None and any(id in getattr(self._draft, other) for other in others):
            self.fault("id already used; ids are unique per statement", "id")
        elif self.register_in(getattr(self._draft, table), element):
            self._elements.append(((table, *others), id, element))

    def register_in(self, table: dict[int, Element], element: Element) -> bool:
        """Put the element into a table, and return whether that could be; else it is a fault."""
        id = self.get("id")
        if id is None:
            return False
        if id in table:
            first = getattr(table[id], "source", Source()).line
            self.fault(f"id already used on line {first}; ids are unique per statement", "id")
            return False
        table[id] = element
        return True

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
        names, found = self.statement.spec_names, self._attributes
        for attribute in self.node.attributes:
            name = names.get(attribute.name) or names.get(fold(attribute.name))
            if name is not None and name not in found:
                found[name] = attribute
            elif name is None:
                close = self._meant(attribute.name)
                known = ", ".join(self.statement.attributes) or "none"
                help = close or f"; known: {known}"
                message = f'{attribute.name}="{_short(attribute.value)}": unknown attribute{help}'
                self.fault_at(attribute.line, message)
            elif self.statement.attributes[name].repeats:
                first = found[name]
                joined = f"{first.value} | {attribute.value}"
                found[name] = Attribute(first.name, joined, first.line, first.origin)
            else:
                self.fault(f"given twice, the second time as {attribute.name}", name)

    def _meant(self, name: str) -> str:
        """Return ``; did you mean X?``: what is required and not given, else the most alike.

        i_body_id is i_graphics_id where that is missing: all but one of the words are the same.
        """
        specs, words = self.statement.attributes, name.lower().split("_")
        given = {fold(attribute.name) for attribute in self.node.attributes}
        for known, spec in specs.items():
            others = known.split("_")
            alike = sum(map(str.__eq__, words, others))
            if spec.required and fold(known) not in given and len(words) == len(others) > 1:
                if alike == len(words) - 1 > 0:
                    return f"; did you mean {known}?"
        return nearest(name, specs)

    def _parse(self) -> None:
        """Store the values, or the faults, refusals and notes that they give rise to."""
        specs, values = self.statement.attributes, self._values
        for name, attribute in self._attributes.items():
            spec = specs[name]
            text = attribute.value.strip()
            try:
                values[name] = spec.kind.parse(text)
            except BadValueError as error:
                what = str(error) or f"must be {spec.kind.allowed}"
                self.fault(what + (about_degrees(text) if spec.unit == "rad" else ""), name)
                continue
            if not (spec.refused or spec.note):
                continue
            if spec.harmless and fold(text) == fold(spec.harmless):
                continue
            if spec.refused:
                self.fault(spec.refused, name)
            if spec.note:
                self.note(spec.note, name)

    def _check_content(self) -> None:
        """Refuse text and child elements that the statement does not have."""
        for child in self.node.children:
            if child.key not in self.statement.may_hold:
                close = nearest(child.tag, self.statement.children)
                self.fault_at(child.line, f"unknown element <{child.tag}>{close}")
        text = self.statement.text
        if self.node.text and text and text not in self._attributes:
            self._attributes[text] = Attribute(text, self.node.text, self.node.line)
        elif self.node.text and text and not self._attributes[text].origin:
            self.fault("given as text of the element too; must be one of both", text)
        elif self.node.text and not text:
            self.fault(f"text {_short(self.node.text)!r} inside the element is not accepted")


def _short(value: str) -> str:
    """Return a value short enough for one line of a message."""
    value = " ".join(value.split())
    return value if len(value) <= _SHOWN else value[: _SHOWN - 3] + "..."

"""`mbsim.Model`: a deck written in Python, statement by statement, checked at each.

Its methods are the statements that the reader has (`calls`); none is listed here. What goes
beyond a statement: bodies bring the marker of their centre of mass, ids are counted, and
markers are made where a place is given beside bodies.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import IO, Any, cast, final
from uuid import uuid4
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from mbsim.errors import DeckError, Fault, ModelError
from mbsim.reader.bodies import REFERENCE_MARKER
from mbsim.reader.calls import (
    BODIES,
    Element,
    about,
    calls,
    named,
    parts,
    referred,
    required,
    signature,
    texts,
)
from mbsim.reader.draft import Draft
from mbsim.reader.graphics import SHAPES
from mbsim.reader.keywords import fold, nearest
from mbsim.reader.parse import Attribute, Node
from mbsim.reader.statement import Entry, Statement
from mbsim.reader.statements import BY_KEY
from mbsim.reader.written import written

_CALLS = calls()
_CG = "cg_id"
_Z_AXIS = "z_axis"
# control characters but blanks, halves of characters, and what XML 1.0 leaves out beside them
_NOT_IN_XML = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")
_PARALLEL = 0.9  # |cosine| beyond which the marker's x-axis is not taken from global x


@final
class Model:
    """A model to be written by calls; `read_model`, `simulate` and `open` take it as it is.

    Parameters
    ----------
    deck : path-like, text or file, optional
        An XML deck to begin with; its comments are kept.
    name : str, optional
        What result files are called, and how messages name the model.
    """

    def __init__(
        self, deck: str | PathLike[str] | IO[str] | IO[bytes] | None = None, name: str = ""
    ) -> None:
        self._root = Node("MotionSolve", 0)
        self._owner = uuid4().hex
        self._sections = {"model": Node("Model", 0), "command": Node("Command", 0)}
        self._bodies: dict[int, Element] = {}
        #: By node: script and line that wrote it.
        self._places: dict[int, tuple[str, int]] = {}
        self.name = f"{name or 'model'}.xml"
        if deck is not None:
            self._begin_with(deck, name)

    def _begin_with(self, deck: str | PathLike[str] | IO[str] | IO[bytes], name: str) -> None:
        """Take over the statements of a deck."""
        from mbsim.reader.xml import read_sections

        file, sections = read_sections(deck)
        self.name = f"{name}.xml" if name else file
        for section in sections:
            own = self._sections[section.key]
            own.attributes += section.attributes
            own.children += section.children
            own.comments += section.comments
            own.last_comments += section.last_comments
            for node in section.children:
                self._places[id(node)] = (file, node.line)
        for node in self._sections["model"].children:
            number, cg = node.find("id"), node.find("cg_id")
            if node.key in ("bodyrigid", "bodypoint") and number and number.value.isdecimal():
                marker = self._element("Reference_Marker", int(cg.value)) if cg else None
                name = BY_KEY[node.key].name
                self._bodies[int(number.value)] = self._element(name, int(number.value), marker)

    def add(self, statement: str, *values: object, **attributes: Any) -> Element:
        """Add a statement by its name in decks; return the element that it makes.

        Values without names are the attributes that it must have, in their order. ``_id`` may be
        left out of names. Values are numbers, texts, lists, arrays and elements; `pos`, `z_axis`
        and other attributes of a marker make a marker there on each body that is given in a
        marker's place. A fault is raised at once, with the line of the script.
        """
        known = BY_KEY.get(fold(statement))
        if known is None:
            names = [each.name for each in BY_KEY.values()]
            raise ModelError(f"unknown statement {statement}{nearest(statement, names)}")
        must = required(known)
        if len(values) > len(must):
            raise ModelError(
                f"{known.name}: {len(values)} values without a name; those may be "
                f"{', '.join(must) or 'none'}"
            )
        given = dict(zip(must, values, strict=False)) | attributes
        for name, value in given.items():
            if isinstance(value, Element):
                self._check_own(known.name, name, value)
        own, of_marker = _split(known, given)
        if _CG in known.attributes:
            return self._add_body(known, own, of_marker)
        if known.name == "Post_Graphic":
            own = _with_marker_named(own)
        return self._write(known, self._with_markers(known, own, of_marker))

    def change(self, element: Element, **attributes: Any) -> None:
        """Change an element in <Command>: from the next Simulate on."""
        if not isinstance(element, Element):
            raise ModelError(f"change: an element of this model; {type(element).__name__} given")
        self._check_own("change", "element", element)
        statement = BY_KEY[fold(element.statement)]
        for name in attributes:
            if not named(statement, name):
                known = nearest(name, list(statement.attributes))
                raise ModelError(f"change: {element.statement} has no attribute {name}{known}")
        self._write(statement, {"id": element.id, **attributes}, "command")

    @property
    def ground(self) -> Element:
        """The body that does not move, with a marker at the global frame; made at first use."""
        for node in self._sections["model"].children:
            flag, number = node.find("isground"), node.find("id")
            if flag and number and fold(flag.value) == "true":
                return self._bodies[int(number.value)]
        return self.add("Body_Rigid", isground=True)

    def to_xml(self) -> str:
        """Return the deck."""
        return "\n".join(line for line, _ in self._lines()) + "\n"

    def read(self) -> str:
        """Return the deck, as a file would."""
        return self.to_xml()

    def placed(self, fault: Fault) -> Fault:
        """Return a fault of the deck as one of the script that wrote it."""
        nodes = [node for _, node in self._lines()]
        node = nodes[fault.line - 1] if 0 < fault.line <= len(nodes) else None
        if node is None or id(node) not in self._places or fault.file != self.name:
            return fault
        file, line = self._places[id(node)]
        return Fault(file, line, fault.element, fault.message)

    def __getattr__(self, name: str) -> Callable[..., Element]:
        statement = BY_KEY.get(fold(name))
        if statement is None:
            close = nearest(name, _CALLS)
        else:
            close = f"; {statement.name} is .{next(k for k, s in _CALLS.items() if s is statement)}"
        raise AttributeError(f"a mbsim.Model has no {name!r}{close}")

    def __repr__(self) -> str:
        count = sum(len(section.children) for section in self._sections.values())
        return f"<mbsim.Model {self.name}: {count} statements>"

    def _add_body(
        self, statement: Statement, own: dict[str, Any], of_marker: dict[str, Any]
    ) -> Element:
        """Add a body and its marker, which is its centre of mass but with a density."""
        own = {named(statement, name) or name: value for name, value in own.items()}
        number = int(written(own.pop("id", self._next_id(statement))))
        own = {"id": number} | own
        if _CG in own:
            if of_marker:
                names = ", ".join(of_marker)
                raise ModelError(f"{statement.name}[{number}]: give {names} to the marker of {_CG}")
            marker = self._element("Reference_Marker", int(written(str(own[_CG]))))
            self._write(statement, own)
        else:
            id = self._next_id(REFERENCE_MARKER)
            shaped = "isground" in own or "density" in own
            self._write(statement, own if shaped else {**own, _CG: id})
            marker = None
            if of_marker or not shaped:
                marker = self._write(REFERENCE_MARKER, {"id": id, "body_id": number, **of_marker})
        self._bodies[number] = body = self._element(statement.name, number, marker)
        return body

    def _element(self, statement: str, id: int, marker: Element | None = None) -> Element:
        return Element(statement, id, marker, self._owner)

    def _check_own(self, statement: str, name: str, element: Element) -> None:
        """Raise `ModelError` for an element that another model gave."""
        if element.owner != self._owner:
            raise ModelError(
                f"{statement}: {name}: {element.statement}[{element.id}] is of another mbsim.Model"
            )

    def _marker_of(self, body: Element) -> Element:
        """Return the marker that a body stands for; the ground's is made at first use."""
        known = self._bodies[body.id]
        if known.marker is None:
            marker = self._write(REFERENCE_MARKER, {"body_id": body.id})
            known = self._bodies[body.id] = self._element(body.statement, body.id, marker)
        assert known.marker is not None
        return known.marker

    def _with_markers(
        self, statement: Statement, own: Mapping[str, Any], of_marker: Mapping[str, Any]
    ) -> dict[str, Any]:
        """Return the attributes with a marker for each body in a marker's place.

        That is a new one where the place of a marker is given.
        """
        found = dict(own)
        for name, value in own.items():
            attribute = named(statement, name)
            if not attribute or not isinstance(value, Element):
                continue
            wanted = referred(statement, attribute)
            if wanted == (REFERENCE_MARKER.name,) and value.statement in BODIES:
                if of_marker:
                    given = {"body_id": value.id, **of_marker}
                    found[name] = self._write(REFERENCE_MARKER, given)
                else:
                    found[name] = self._marker_of(value)
        if of_marker and found == dict(own):
            names = ", ".join(of_marker)
            raise ModelError(f"{statement.name}: {names}: give bodies, on which a marker is made")
        return found

    def _write(self, statement: Statement, given: Mapping[str, Any], section: str = "") -> Element:
        """Add one statement as it is, once its attributes are checked."""
        children = {fold(name): name for name in statement.children}
        own = {name: value for name, value in given.items() if fold(name) not in children}
        if "id" in statement.required and own.get("id") is None:
            own = {"id": self._next_id(statement)} | own
        if statement is REFERENCE_MARKER and own.get(_Z_AXIS) is not None:
            own |= _cosines(own.pop(_Z_AXIS))
        node = Node(statement.name, 0)
        file, node.line = _caller()
        node.attributes = [Attribute(name, text, node.line) for name, text in texts(statement, own)]
        for attribute in node.attributes:
            if found := _NOT_IN_XML.search(attribute.value):
                raise ModelError(
                    f"{statement.name}: {attribute.name}: {found[0]!r} has no place in XML"
                )
        for name, value in given.items():
            if fold(name) in children and value is not None:
                text = written(np.asarray(value).ravel())
                node.children.append(Node(children[fold(name)], node.line, text=text))
        draft = Draft(file, Path())
        if not section:
            self._check(statement, node, draft)
            commands = self._sections["command"].children
            late = not statement.in_model or (statement.in_command and bool(commands))
            section = "command" if late else "model"
        self._sections[section].children.append(node)
        self._places[id(node)] = (file, node.line)
        number = node.find("id")
        return self._element(statement.name, int(number.value) if number else 0)

    def _check(self, statement: Statement, node: Node, draft: Draft) -> None:
        """Raise what is wrong with the attributes of one statement, as the reader words it."""
        Entry(statement, node, draft)
        number = node.find("id")
        used = {self._id_of(each) for each in self._nodes(statement)}
        if number and "id" in statement.required and number.value in used:
            text = f'id="{number.value}": id already used; ids are unique per statement'
            draft.fault(node.line, f"{statement.name}[{number.value}]", text)
        if draft.faults:
            raise DeckError(draft.faults)

    def _nodes(self, statement: Statement) -> list[Node]:
        """Return the statements among whose ids its own must be unique."""
        those = BODIES if statement.name in BODIES else (statement.name,)
        keys = set(map(fold, those))
        return [node for node in self._sections["model"].children if node.key in keys]

    @staticmethod
    def _id_of(node: Node) -> str:
        found = node.find("id")
        return found.value.strip() if found else ""

    def _next_id(self, statement: Statement) -> int:
        """Return the id after the largest that the statement has."""
        ids = (self._id_of(node) for node in self._nodes(statement))
        return max((int(text) for text in ids if text.isdecimal()), default=0) + 1

    def _lines(self) -> list[tuple[str, Node | None]]:
        """Return the lines of the deck, each with the statement on it."""
        lines: list[tuple[str, Node | None]] = [("<MotionSolve>", None)]
        for section in self._sections.values():
            if not section.children:
                continue
            lines += _said(section.comments, "  ")
            lines.append((f"  <{section.tag}{_attributes(section)}>", None))
            for node in section.children:
                lines += _said(node.comments, "    ")
                lines.append((f"    {_element(node)}", node))
            lines += _said(section.last_comments, "    ")
            lines.append((f"  </{section.tag}>", None))
        return [*lines, ("</MotionSolve>", None)]


def _split(statement: Statement, given: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the attributes of the statement itself, and those that only a marker has."""
    own, of_marker = {}, {}
    for name, value in given.items():
        if value is None:
            continue
        ours = named(statement, name) or parts(statement, name, value)
        theirs = named(REFERENCE_MARKER, name) or parts(REFERENCE_MARKER, name, value)
        if statement is not REFERENCE_MARKER and not ours and (theirs or name == _Z_AXIS):
            of_marker[name] = value
        else:
            own[name] = value
    return own, of_marker


def _with_marker_named(own: Mapping[str, Any]) -> dict[str, Any]:
    """Return a graphic's attributes; `marker` is the one that its type names its place by."""
    if "marker" not in own:
        return dict(own)
    kind = fold(str(own.get("type", "")))
    markers = next((shape.markers for shape in SHAPES if fold(shape.type) == kind), ("rm_id",))
    return {markers[0] if name == "marker" else name: value for name, value in own.items()}


def _cosines(z_axis: Sequence[float]) -> dict[str, float]:
    """Return direction cosines of axes whose z is along `z_axis` (3,), x near global x."""
    z = np.asarray(z_axis, dtype=np.float64)
    length = float(np.linalg.norm(z)) if z.shape == (3,) else 0.0
    if not 0.0 < length < np.inf:
        raise ModelError(f"z_axis={z_axis!r}: must be three numbers, not all 0")
    z = z / length
    near = np.array([1.0, 0.0, 0.0]) if abs(z[0]) < _PARALLEL else np.array([0.0, 0.0, -1.0])
    x = near - (near @ z) * z
    x /= np.linalg.norm(x)
    R = np.column_stack([x, np.cross(z, x), z])
    return {f"a{row}{column}": float(R[row, column]) for row in range(3) for column in range(3)}


def _caller() -> tuple[str, int]:
    """Return script and line of the call into this file."""
    frame = sys._getframe(1)
    while frame.f_back is not None and frame.f_code.co_filename == __file__:
        frame = frame.f_back
    return frame.f_code.co_filename, frame.f_lineno


def _attributes(node: Node) -> str:
    return "".join(f" {each.name}={quoteattr(each.value)}" for each in node.attributes)


def _said(comments: Sequence[str], indent: str) -> list[tuple[str, Node | None]]:
    """Return comments line by line."""
    return [(line, None) for text in comments for line in f"{indent}<!--{text}-->".splitlines()]


def _element(node: Node) -> str:
    """Return a statement as one line of XML."""
    inner = escape(" ".join(node.text.split())) + "".join(map(_element, node.children))
    start = f"<{node.tag}{_attributes(node)}"
    return f"{start}>{inner}</{node.tag}>" if inner else f"{start}/>"


def _method(name: str, statement: Statement) -> Callable[..., Element]:
    """Return the method that adds a statement."""

    def add(self: Model, *values: object, **attributes: Any) -> Element:
        return self.add(statement.name, *values, **attributes)

    add.__name__, add.__qualname__ = name, f"Model.{name}"
    add.__doc__ = about(statement)
    # `inspect.signature` reads it; functions do not declare it
    cast(Any, add).__signature__ = signature(statement)
    return add


for _name, _statement in _CALLS.items():
    setattr(Model, _name, _method(_name, _statement))

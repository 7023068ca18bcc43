"""`--set Force_Contact[1].mu_static=0.3`: attributes changed in the tree, before any check."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence

from mbsim.errors import ModelError
from mbsim.reader.keywords import fold, nearest
from mbsim.reader.parse import Attribute, Node
from mbsim.reader.statements import known_attributes
from mbsim.reader.written import written

_FORM = re.compile(
    r"\s*(\w+)\s*(?:\[\s*([^\]]*?)\s*\])?(?:\[\s*([1-9]\d*)\s*\])?\s*\.\s*(\w+)"
    r"\s*(?:\[\s*([1-9]\d*)\s*\])?\s*=(.*)",
    re.DOTALL,
)
#: A list of numbers that a user's subroutine is given.
_USER = re.compile(r"(\s*USER\s*\()(.*)(\)\s*)", re.IGNORECASE | re.DOTALL)
_MOST_LISTED = 12


Known = Callable[[Node], "list[str] | None"]


def as_texts(overrides: Mapping[str, object] | Sequence[str]) -> tuple[str, ...]:
    """Return overrides as ``Element[id].attribute=value``; a mapping has the values beside.

    Numbers are written such that they are read as they are, truth as TRUE and FALSE.
    """
    if not isinstance(overrides, Mapping):
        if isinstance(overrides, str):
            raise ModelError(f"overrides={overrides!r}: must be a list of texts, or a dict")
        return tuple(overrides)
    return tuple(f"{name}={written(value)}" for name, value in overrides.items())


def apply_overrides(
    sections: Sequence[Node], overrides: Sequence[str], known: Known = known_attributes
) -> None:
    """Change attributes of the statements in `sections`.

    Parameters
    ----------
    sections : sequence of Node
        The deck's <Model> and <Command> parts. What changes of their statements becomes a copy.
    overrides : sequence of str
        ``Element[id].attribute=value``, names matched without case and `_`. A statement
        without ids is named by its place among those of its name, ``Simulate[2]``, or by
        its name alone where there is one. ``Element[id][2].attribute=value`` is the first
        change of that element in <Command>, [3] the next.
        ``Element[id].attribute[2]=value`` is the second number of its ``USER(...)``.
    known : callable, optional
        Returns the attributes that a statement may have, None where that is open.

    Raises
    ------
    ModelError
        If the form is wrong, or the element, its id or the attribute is not there; the
        message says what is, a line each.
    """
    faults: list[str] = []
    own: set[int] = set()
    for text in overrides:
        match = _FORM.fullmatch(text)
        if match is None:
            faults.append(f"--set {text}: must be Element[id].attribute=value")
            continue
        element, index, turn, attribute, row, value = match.groups()
        try:
            node = _owned(_find(sections, element, index, int(turn or 1)), sections, own)
            if row is not None:
                value = _with_number(node, attribute, int(row), value)
            _set(node, attribute, value.strip(), f"--set {text}", known(node))
        except LookupError as error:
            faults.append(f"--set {text}: {error.args[0]}")
    if faults:
        raise ModelError("\n".join(faults))


def _owned(node: Node, sections: Sequence[Node], own: set[int]) -> Node:
    """Return a statement's copy, put in its place; itself where it is one, or a section."""
    if id(node) in own or any(node is section for section in sections):
        return node
    copy = node.copy()
    own.add(id(copy))
    for section in sections:
        section.children[:] = [copy if child is node else child for child in section.children]
    return copy


def _statements(sections: Sequence[Node]) -> Iterator[Node]:
    for section in sections:
        yield section
        yield from section.children


def _find(sections: Sequence[Node], element: str, index: str | None, turn: int) -> Node:
    """Return the one statement that a selector names, LookupError otherwise.

    Of statements with one id, which is the element and its changes in <Command>, it is the
    `turn`-th.
    """
    named = [node for node in _statements(sections) if node.key == fold(element)]
    if not named:
        tags = sorted({node.tag for node in _statements(sections)})
        close = nearest(element, tags)
        raise LookupError(f"no {element} in the deck; it has {', '.join(tags)}{close}")
    tag = named[0].tag
    if index is None:
        if len(named) == 1:
            return named[0]
        raise LookupError(f"{len(named)} of {tag}; name one of {_choices(named)}")
    found = []
    for place, node in enumerate(named, start=1):
        id = node.find("id")
        if index == (id.value.strip() if id else str(place)):
            found.append(node)
    if len(found) >= turn:
        return found[turn - 1]
    if found:
        raise LookupError(f"no {tag}[{index}][{turn}] in the deck; it has {len(found)} of them")
    raise LookupError(f"no {tag}[{index}] in the deck; it has {_choices(named)}")


def _choices(nodes: list[Node]) -> str:
    """Return what stands in the brackets of each selector, shortened."""
    ids = [node.find("id") for node in nodes]
    names = [f"[{id.value if id else k}]" for k, id in enumerate(ids, start=1)]
    more = f" and {len(names) - _MOST_LISTED} more" if len(names) > _MOST_LISTED else ""
    return " ".join(names[:_MOST_LISTED]) + more


def _numbers(node: Node, name: str, row: int) -> tuple[str, list[str], str]:
    """Return what is before, in and behind the USER(...) of an attribute, which has so many."""
    found = node.find(name)
    match = _USER.fullmatch(found.value) if found is not None else None
    if match is None:
        raise LookupError(
            f"{node.tag}.{name} is no USER(...) in the deck, whose number {row} it is"
        )
    numbers = match[2].split(",")
    if row > len(numbers):
        raise LookupError(f"USER(...) of {node.tag}.{name} has {len(numbers)} numbers, no {row}")
    return match[1], numbers, match[3]


def _with_number(node: Node, name: str, row: int, value: str) -> str:
    """Return the USER(...) of an attribute with one of its numbers changed."""
    before, numbers, behind = _numbers(node, name, row)
    numbers[row - 1] = value.strip()
    return f"{before}{','.join(numbers)}{behind}"


def _set(node: Node, name: str, value: str, origin: str, known: list[str] | None) -> None:
    """Set or add an attribute; one that the statement does not have is a LookupError."""
    found = node.find(name)
    if found is not None:
        found.value, found.origin = value, origin
        return
    _check_known(node, name, known)
    node.attributes.append(Attribute(name, value, node.line, origin))


def _check_known(node: Node, name: str, known: list[str] | None) -> None:
    """Raise LookupError for an attribute that the statement does not have."""
    if known is not None and fold(name) not in {fold(word) for word in known}:
        close = nearest(name, known)
        raise LookupError(
            f"{node.tag} has no attribute {name}{close or '; known: ' + ', '.join(known)}"
        )


def value_of(sections: Sequence[Node], name: str) -> str | None:
    """Return the text of the attribute that ``Element[id].attribute`` names, None if not given.

    Raises
    ------
    ModelError
        If the form is wrong, or the element is not there.
    """
    match = _FORM.fullmatch(f"{name}=")
    if match is None:
        raise ModelError(f"{name}: must be Element[id].attribute")
    element, index, turn, attribute, row, _ = match.groups()
    try:
        node = _find(sections, element, index, int(turn or 1))
        found = node.find(attribute)
        if found is None:
            _check_known(node, attribute, known_attributes(node))
        if row is not None:
            return _numbers(node, attribute, int(row))[1][int(row) - 1].strip()
    except LookupError as error:
        raise ModelError(f"{name}: {error.args[0]}") from None
    return found.value if found is not None else None

"""Expressions of a draft with some of their functions replaced, when all of the deck is known."""

from __future__ import annotations

import dataclasses
import re
from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING, Any

from mbsim.errors import Fault
from mbsim.expressions.tree import Call, Expression, Node
from mbsim.model.source import Source

if TYPE_CHECKING:
    from mbsim.reader.draft import Draft


#: Types of what holds no expression: most of a deck is numbers and names.
_PLAIN = frozenset((int, float, bool, str, type(None), Source))


#: And the words of annotations that say so.
_PLAIN_WORDS = frozenset(("int", "float", "bool", "str", "None", "Source", "tuple", "Array"))


@cache
def _fields(kind: type) -> tuple[str, ...]:
    """Return those fields that a dataclass is made of which may hold an expression."""
    if not dataclasses.is_dataclass(kind):
        return ()
    made_of = [each for each in dataclasses.fields(kind) if each.init]
    return tuple(
        each.name
        for each in made_of
        if not _PLAIN_WORDS.issuperset(re.findall(r"\w+", str(each.type)))
    )


class Rewriting(ABC):
    """Replaces functions in all expressions that a draft holds; `call` says which, and by what."""

    def __init__(self, draft: Draft) -> None:
        self.draft = draft
        self.faults: list[Fault] = []
        self.source = Source()

    @abstractmethod
    def call(self, node: Call) -> Node | None:
        """Return what a function means, None to leave it as it is."""

    def fault(self, statement: str, id: int, said: str) -> None:
        """Add a fault of an element, where the expression stands that shows it."""
        self.faults.append(Fault(self.source.file, self.source.line, f"{statement}[{id}]", said))

    def rewrite(self) -> None:
        """Rewrite the elements and simulations of the draft."""
        for name, old in vars(self.draft).items():
            if isinstance(old, dict) and old:
                setattr(self.draft, name, self(old))
        self.draft.simulations = self(self.draft.simulations)

    def __call__(self, value: Any) -> Any:
        """Return a value with its expressions rewritten; the same one where none is."""
        if isinstance(value, Expression):
            root = self.node(value.root)
            return value if root is value.root else Expression(value.text, root)
        if isinstance(value, dict):
            return self._kept(
                value, list(value.values()), lambda new: dict(zip(value, new, strict=True))
            )
        if isinstance(value, (list, tuple)) and type(value) in (list, tuple):
            return self._kept(value, list(value), type(value))
        kind: Any = type(value)
        names = _fields(kind)
        if names:
            self.source = getattr(value, "source", self.source)
            return self._kept(
                value,
                [getattr(value, name) for name in names],
                lambda new: dataclasses.replace(value, **dict(zip(names, new, strict=True))),
            )
        return value

    def _kept(self, value: Any, old: list[Any], make: Callable[[list[Any]], Any]) -> Any:
        """Return what `make` makes of rewritten parts, the value itself where all are the same."""
        same, new = True, []
        for part in old:
            changed = part if type(part) in _PLAIN else self(part)
            same = same and changed is part
            new.append(changed)
        return value if same else make(new)

    def node(self, node: Node) -> Node:
        """Return a tree with functions replaced."""
        if not isinstance(node, Call):
            return node
        found = self.call(node)
        if found is not None:
            return found
        args = tuple(self.node(arg) for arg in node.args)
        same = all(a is b for a, b in zip(args, node.args, strict=True))
        return node if same else Call(node.name, args, node.column)

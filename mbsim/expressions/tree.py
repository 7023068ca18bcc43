"""An expression as a tree of frozen nodes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

from mbsim.expressions.functions import CHOICES, FUNCTIONS


@dataclass(frozen=True)
class Number:
    """A constant, named ones (PI, RTOD, DTOR) included."""

    value: float


@dataclass(frozen=True)
class Time:
    """The variable TIME."""


@dataclass(frozen=True)
class Call:
    """A function of the language; `name` in upper case, operators as ADD, SUB, MUL, DIV, POW, NEG.

    Ids of markers and elements are `Number` arguments.
    """

    name: str
    args: tuple[Node, ...]
    column: int = 0


@dataclass(frozen=True)
class UserResult:
    """What a user subroutine returns in place of an expression: number `component` of it.

    `statement` and `id` name the element, SFORCE or VARIABLE for example, whose subroutine it is.
    """

    statement: str
    id: int
    component: int = 0


Node: TypeAlias = "Number | Time | Call | UserResult"


@dataclass(frozen=True)
class Expression:
    """What the deck says: its text, for messages, and the tree that it means."""

    text: str
    root: Node


class Reference(NamedTuple):
    """An element that an expression names: `statement` is MARKER, JOINT, VARIABLE and so on."""

    statement: str
    id: int
    function: str
    column: int


def references(expression: Expression) -> Iterator[Reference]:
    """Yield the elements that an expression names; marker 0, the global frame, is none."""
    waiting: list[Node] = [expression.root]
    while waiting:
        node = waiting.pop()
        if not isinstance(node, Call):
            continue
        function = FUNCTIONS.get(node.name)
        kinds = function.args if function else ("number",) * len(node.args)
        for kind, arg in zip(kinds, node.args, strict=False):
            if kind == "number":
                waiting.append(arg)
            elif kind not in CHOICES and isinstance(arg, Number) and arg.value != 0.0:
                yield Reference(kind.upper(), int(arg.value), node.name, node.column)

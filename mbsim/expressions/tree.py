"""An expression as a tree of frozen nodes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias


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


Node: TypeAlias = "Number | Time | Call"


@dataclass(frozen=True)
class Expression:
    """What the deck says: its text, for messages, and the tree that it means."""

    text: str
    root: Node

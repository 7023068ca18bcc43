"""How a statement of an Adams deck is declared: that of the XML, and the words that it takes."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

from mbsim.reader.kinds import EXPRESSION, IDS, TEXT, USER, BadValueError, Kind, parse_real
from mbsim.reader.statement import Statement

_DEGREES = re.compile(r"(.*\d\.?)[dD]")


class Value(Enum):
    """What may follow an argument's value after a comma: nothing, items, text, a function."""

    ITEM = 0
    LIST = 1
    TEXT = 2
    FUNCTION = 3


def _is_read(text: str) -> bool:
    return False


@dataclass(frozen=True)
class AdmStatement(Statement):
    """A statement: `words` stand alone and mean (attribute, value); `xml` is its name there.

    `opaque` tells of a statement's text whether its arguments are not looked at.
    """

    words: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    xml: str = ""
    opaque: Callable[[str], bool] = _is_read

    def names(self) -> list[str]:
        """Return the names that stand before ``=``."""
        of_words = {name for name, _ in self.words.values()}
        return [name for name in self.attributes if name not in of_words and name != "id"]

    def value_kind(self, name: str) -> Value:
        """Return how the value of a name may go on."""
        spec = self.attributes.get(name)
        if spec is None:
            return Value.LIST
        if spec.kind in (EXPRESSION, EXPRESSION_OR_USER):
            return Value.FUNCTION
        if spec.kind is TEXT:
            return Value.TEXT
        return Value.LIST if spec.kind.allowed.endswith(LIST) else Value.ITEM


LIST = "separated by commas"


def parse_angle(text: str) -> float:
    """Return an angle in radians; a D after the number says that it is in degrees."""
    degrees = _DEGREES.fullmatch(text)
    return math.radians(parse_real(degrees.group(1))) if degrees else parse_real(text)


def _parse_items(text: str, angles: bool, counts: tuple[int, ...]) -> tuple[float, ...]:
    words = [word.strip() for word in text.split(",")]
    if len(words) not in counts:
        raise BadValueError
    return tuple((parse_angle if angles else parse_real)(word) for word in words)


def _parse_ids(text: str) -> tuple[int, ...]:
    found: tuple[int, ...] = IDS.parse(text)
    return found


def numbers(*counts: int) -> Kind:
    """Return the kind of lists of so many numbers."""
    some = " or ".join(map(str, counts))
    return Kind(f"{some} numbers {LIST}", lambda text: _parse_items(text, False, counts))


def _parse_numbers(text: str) -> tuple[float, ...]:
    return tuple(parse_real(word.strip()) for word in text.split(","))


def _parse_rows(text: str) -> tuple[tuple[float, ...], ...]:
    return tuple(_parse_numbers(row) for row in text.split("|"))


def angles(count: int) -> Kind:
    """Return the kind of lists of so many angles."""
    allowed = f"{count} angles (radians, or degrees with a D as in 90D) {LIST}"
    return Kind(allowed, lambda text: _parse_items(text, True, (count,)))


def _parse_either(text: str) -> Any:
    return (USER if re.match(r"USER\s*\(", text, re.IGNORECASE) else EXPRESSION).parse(text)


#: Endings of shared libraries.
LIBRARIES = (".so", ".dll", ".dylib", ".sl")


def _parse_routine(text: str) -> str:
    """Return `name`, or `file.py::name`."""
    file, _, name = text.rpartition("::")
    if not name.isidentifier():
        raise BadValueError
    if file.lower().endswith(LIBRARIES) and name.istitle():
        # it would be called with addresses of numbers
        raise BadValueError(f"{name} is Adams' form in C, with a structure: it is not built")
    if file and not file.lower().endswith((".py", ".pyc", *LIBRARIES)):
        raise BadValueError("must be " + ROUTINE.allowed)
    return text


def _parse_routines(text: str) -> tuple[str, ...]:
    """Return one function or three, separated by commas."""
    words = tuple(_parse_routine(word.strip()) for word in text.split(","))
    if len(words) not in (1, 3):
        raise BadValueError
    return words


EXPRESSION_OR_USER = Kind("an expression, or USER(number, number, ...)", _parse_either)
ROUTINE = Kind("a function's name, or FILE.py::NAME or LIBRARY.so::NAME", _parse_routine)
ROUTINES = Kind(f"one or three functions, named as {ROUTINE.allowed}, {LIST}", _parse_routines)
IDS_BY_COMMAS = Kind(f"ids {LIST}", _parse_ids)
ANGLE = Kind("an angle (radians, or degrees with a D as in 90D)", parse_angle)
ANY = Kind(f"items {LIST}", str)
NUMBERS = Kind(f"numbers {LIST}", _parse_numbers)
ROWS = Kind(f"numbers {LIST}", _parse_rows)

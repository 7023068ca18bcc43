"""What an attribute's text may be: one `Kind` for each sort of value in a deck."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from mbsim.expressions import Expression
from mbsim.reader.keywords import fold, nearest

_REAL = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_INTEGER = re.compile(r"[+-]?[0-9]{1,18}")

# products of five such numbers (density times length^5) still fit a double
LARGEST_REAL = 1e40
LARGEST_ID = 2**31 - 1


class BadValueError(ValueError):
    """A value that its attribute does not allow; the message says what is wrong."""


@dataclass(frozen=True)
class Kind:
    """`allowed` completes "must be ..."; `parse` returns the value or raises BadValueError."""

    allowed: str
    parse: Callable[[str], Any]


def parse_real(text: str) -> float:
    """Return a finite number as the deck may write it: ``5``, ``500.``, ``.5``, ``1.0E5``."""
    if not _REAL.fullmatch(text):
        raise BadValueError
    value = float(text)
    if abs(value) > LARGEST_REAL:
        raise BadValueError(f"is larger than {LARGEST_REAL:g}, the limit of a number")
    return value


def about_degrees(text: str) -> str:
    """Return what to add to a message where an angle is given in degrees as Adams has them."""
    number = text.rstrip("dD")
    if number == text or not _REAL.fullmatch(number):
        return ""
    radians = math.radians(float(number))
    return (
        f"; angles are in radians, {number} degrees are {radians:.9g}: D is for expressions and "
        "Adams decks"
    )


def parse_integer(text: str) -> int:
    """Return a whole number."""
    if not _INTEGER.fullmatch(text):
        raise BadValueError
    return int(text)


def real(
    allowed: str,
    *,
    above: float = -math.inf,
    least: float = -math.inf,
    most: float = math.inf,
) -> Kind:
    """Return the kind of numbers > `above`, >= `least` and <= `most`."""

    def parse(text: str) -> float:
        value = parse_real(text)
        if not (value > above and least <= value <= most):
            raise BadValueError
        return value

    return Kind(allowed, parse)


def _parse_positive_or_infinite(text: str) -> float:
    """Return a number > 0, or infinity for INFINITE."""
    if fold(text) == "infinite":
        return math.inf
    value = parse_real(text)
    if not value > 0.0:
        raise BadValueError
    return value


def _parse_expression(text: str) -> float:
    """Return a number; anything else may be an expression, which is not built."""
    if re.search(r"[A-Za-z]{2,}|[*/()]", text) and fold(text) not in ("nan", "inf", "-inf"):
        raise BadValueError("is not a number; expressions are documented but not built yet")
    return parse_real(text)


def _parse_either(text: str) -> float | Expression:
    """Return a number, or an expression where the text is none."""
    if _REAL.fullmatch(text):
        return parse_real(text)
    made: Expression = _parse_tree(text)
    return made


def _parse_id(text: str) -> int:
    """Return a positive id that fits a 32-bit integer, as user subroutines take it."""
    if not (_INTEGER.fullmatch(text) and 0 < (value := int(text)) <= LARGEST_ID):
        raise BadValueError
    return value


def _parse_count(text: str) -> int:
    value = parse_integer(text)
    if value < 1:
        raise BadValueError
    return value


def _parse_ids(text: str) -> tuple[int, ...]:
    """Return ids separated by blanks or commas."""
    words = text.replace(",", " ").split()
    if not words:
        raise BadValueError
    ids = tuple(_parse_id(word) for word in words)
    seen: set[int] = set()
    for id in ids:
        if id in seen:
            raise BadValueError(f"names id {id} twice")
        seen.add(id)
    return ids


def _parse_flag(text: str) -> bool:
    value = {"true": True, "false": False}.get(text.lower())
    if value is None:
        raise BadValueError
    return value


def _parse_user(text: str) -> tuple[float, ...]:
    """Return the numbers of ``USER(1, 2.5, ...)``."""
    call = re.fullmatch(r"USER\s*\((.*)\)", text, re.IGNORECASE | re.DOTALL)
    if call is None:
        raise BadValueError
    inside = call.group(1).strip()
    if not inside:
        return ()
    values = []
    for word in inside.split(","):
        try:
            values.append(parse_real(word.strip()))
        except BadValueError as error:
            raise BadValueError(f"value {word.strip()!r} {str(error) or 'is no number'}") from None
    return tuple(values)


def _parse_tree(text: str) -> Expression:
    """Return an expression of the language of functions."""
    from mbsim.expressions.parse import ExpressionError, parse

    if re.match(r"USER\s*\(", text, re.IGNORECASE):
        raise BadValueError(
            "USER(...) is no expression; a subroutine stands in place of one where the manual has "
            "it (in XML decks by usrsub_param_string and usrsub_fnc_name)"
        )
    try:
        return parse(text)
    except ExpressionError as error:
        raise BadValueError(f"is no expression: {error}") from None


def _parse_words(text: str) -> tuple[str, ...]:
    """Return words separated by blanks or commas, in upper case."""
    words = tuple(text.replace(",", " ").upper().split())
    if not words:
        raise BadValueError
    return words


def _parse_reals(text: str) -> tuple[float, ...]:
    """Return numbers separated by blanks or commas."""
    words = text.replace(",", " ").split()
    if not words:
        raise BadValueError
    return tuple(parse_real(word) for word in words)


def keyword(
    allowed: Mapping[str, str], not_built: Mapping[str, str] | None = None, why: str = ""
) -> Kind:
    """Return the kind of keywords; both tables are folded spelling -> canonical keyword.

    `why` says for what reason those of the second table are not built.
    """
    canonical = list(dict.fromkeys(allowed.values()))
    choice = ("one of " if len(canonical) > 1 else "") + ", ".join(canonical)

    def parse(text: str) -> str:
        word = fold(text)
        if word in allowed:
            return allowed[word]
        if not_built and word in not_built:
            built = ", ".join(canonical)
            reason = f": {why}" if why else ""
            raise BadValueError(f"{not_built[word]} is not built yet{reason}; built: {built}")
        close = nearest(text, (*canonical, *(not_built or {}).values()))
        raise BadValueError(f"must be {choice}{close}")

    return Kind(choice, parse)


REAL = Kind("a number", parse_real)
POSITIVE = real("a number > 0", above=0.0)
NOT_NEGATIVE = real("a number >= 0", least=0.0)
POSITIVE_OR_INFINITE = Kind("a number > 0 or INFINITE", _parse_positive_or_infinite)
UNIT = real("a number from 0 to 1", least=0.0, most=1.0)
RATIO = real("a number > -1 and <= 0.5", above=-1.0, most=0.5)
REAL_NO_EXPRESSION = Kind("a number", _parse_expression)
REAL_OR_EXPRESSION = Kind("a number or an expression of TIME", _parse_either)
INTEGER = Kind("a whole number", parse_integer)
COUNT = Kind("a whole number > 0", _parse_count)
ID = Kind(f"a positive integer up to {LARGEST_ID}", _parse_id)
IDS = Kind("positive integer ids, separated by blanks or commas", _parse_ids)
FLAG = Kind("TRUE or FALSE", _parse_flag)
TEXT = Kind("text", str)
USER = Kind("USER(number, number, ...)", _parse_user)
EXPRESSION = Kind("an expression", _parse_tree)
WORDS = Kind("words, separated by blanks or commas", _parse_words)
REALS = Kind("numbers, separated by blanks or commas", _parse_reals)

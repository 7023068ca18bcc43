"""Text of the deck's language to a tree, by an LALR grammar; bounded in length and depth.

So -2**2 is -4 and 2**3**2 is 2**9. A number that ends in D is an angle in degrees; ":" stands
only after the first argument of IF. The parser keeps its own stack and the tree is made from its
leaves up, so that no text can bring about a recursion error.
"""

from __future__ import annotations

import difflib
import functools
import math
import re
from typing import TYPE_CHECKING, Any, NamedTuple

from mbsim.expressions.functions import (
    CHOICES,
    CONSTANTS,
    CONTACT_BY_INDEX,
    FUNCTIONS,
    Function,
)
from mbsim.expressions.tree import Call, Expression, Node, Number, Time

if TYPE_CHECKING:
    from lark import Lark, Token

LONGEST = 20_000
#: Parentheses and functions within each other.
DEEPEST = 50
#: Operations that wait for each other's result, as the terms of a sum do.
LONGEST_CHAIN = 400

_VALUES = {"PI": math.pi, "RTOD": 180.0 / math.pi, "DTOR": math.pi / 180.0}
_SIGNS = {"PLUS": "ADD", "MINUS": "SUB", "TIMES": "MUL", "OVER": "DIV"}
_WHY = {
    "index": " in CONTACT(id, index, rm), the deepest penetration; other results are not built. "
    "Forces are CONTACT(id, jflag, comp, rm), rm 0 for global axes",
}
_ORDINALS = ("first", "second", "third", "fourth")

GRAMMAR = r"""
?sum: product
    | sum PLUS product    -> operation
    | sum MINUS product   -> operation
?product: unary
    | product TIMES unary -> operation
    | product OVER unary  -> operation
?unary: power
    | PLUS unary          -> plus
    | MINUS unary         -> minus
?power: primary
    | primary POWER unary -> power
?primary: NUMBER          -> number
    | NAME                -> constant
    | FUNCTION "(" sum (SEPARATOR sum)* ")" -> call
    | "(" sum ")"         -> group

NUMBER: /([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?([a-zA-Z_][a-zA-Z_0-9]*|\.[0-9]*)?/
NAME: /[a-zA-Z_][a-zA-Z_0-9]*/
POWER: "**"
TIMES: "*"
OVER: "/"
PLUS: "+"
MINUS: "-"
SEPARATOR: "," | ":"
%declare FUNCTION
%ignore /\s+/
"""
_NUMBER = re.compile(r"(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)(?P<unit>.*)", re.ASCII)


class ExpressionError(ValueError):
    """An expression that cannot be used; `column` counts from 1, `message` says why."""

    def __init__(self, message: str, column: int) -> None:
        super().__init__(f"{message} (column {column})")
        self.message, self.column = message, column


class _Part(NamedTuple):
    """A part of the tree, with the levels of nesting and of operations in it."""

    node: Node
    levels: int = 0
    chain: int = 1


def _number(token: Token) -> Token:
    """Refuse what only looks like a number; this and `_name` are called as the text is cut."""
    match = _NUMBER.fullmatch(token)
    assert match is not None
    column, unit = _column(token), match["unit"]
    if not math.isfinite(float(match["number"])):
        raise ExpressionError(f"{token} is too large for a number", column)
    if re.fullmatch(r"[dD]\d+", unit):
        raise ExpressionError(
            f"{token} is not clear: write E for a power of ten, D alone for degrees", column
        )
    if unit and unit.upper() != "D":
        raise ExpressionError(f"{token} is not a number", column)
    return token


def _name(token: Token) -> Token:
    """Mark functions and refuse what is no name."""
    name = token.upper()
    if name in FUNCTIONS:
        token.type = "FUNCTION"
    elif name not in _VALUES and name != "TIME":
        raise ExpressionError(f"there is no function {name}{_like(name)}", _column(token))
    return token


def _column(token: Token) -> int:
    return (token.start_pos or 0) + 1


class _Builder:
    """What the parser calls for each rule, with its parts from left to right."""

    def number(self, given: list[Token]) -> _Part:
        match = _NUMBER.fullmatch(given[0])
        assert match is not None
        return _Part(Number(float(match["number"]) * (_VALUES["DTOR"] if match["unit"] else 1.0)))

    def constant(self, given: list[Token]) -> _Part:
        name = given[0].upper()
        return _Part(Time() if name == "TIME" else Number(_VALUES[name]))

    def group(self, given: list[Any]) -> _Part:
        part = given[0]
        return _nested(part, part, 1)

    def plus(self, given: list[Any]) -> _Part:
        return _nested(given[1], given[1], _column(given[0]))

    def minus(self, given: list[Any]) -> _Part:
        sign, part = given
        if isinstance(part.node, Number):
            return _nested(_Part(Number(-part.node.value)), part, _column(sign))
        return _nested(_call("NEG", [part], _column(sign)), part, _column(sign))

    def operation(self, given: list[Any]) -> _Part:
        left, sign, right = given
        return _call(_SIGNS[sign.type], [left, right], _column(sign))

    def power(self, given: list[Any]) -> _Part:
        base, sign, exponent = given
        made = _call("POW", [base, exponent], _column(sign))
        deeper = _nested(made, exponent, _column(sign))
        return deeper._replace(levels=max(deeper.levels, base.levels))

    def call(self, given: list[Any]) -> _Part:
        name, column = given[0].upper(), _column(given[0])
        for place, sign in enumerate(given[2::2]):
            if sign == ":" and (name != "IF" or place > 0):
                raise ExpressionError(
                    "':' stands only after the first argument of IF", _column(sign)
                )
        parts = given[1::2]
        if name == "CONTACT" and len(parts) == FUNCTIONS[CONTACT_BY_INDEX].least:
            name = CONTACT_BY_INDEX
        check_arguments(FUNCTIONS[name], [part.node for part in parts], column)
        made = _call(name, parts, column)
        return _nested(made, made, column)


def _call(name: str, parts: list[_Part], column: int) -> _Part:
    """Return a function of parts; refuse a tree that is too deep for those who walk it."""
    chain = 1 + max(part.chain for part in parts)
    if chain > LONGEST_CHAIN + 1:
        raise ExpressionError(
            f"more than {LONGEST_CHAIN} operations in a row: use variables for parts of it", column
        )
    node = Call(name, tuple(part.node for part in parts), column)
    return _Part(node, max(part.levels for part in parts), chain)


def _nested(part: _Part, inner: _Part, column: int) -> _Part:
    """Return a part one level above an inner one."""
    if inner.levels >= DEEPEST:
        raise ExpressionError(f"more than {DEEPEST} levels of nesting", column)
    return part._replace(levels=inner.levels + 1)


@functools.cache
def _parser() -> Lark:
    """Return the parser; only decks with expressions import what it needs."""
    from lark import Lark

    return Lark(
        GRAMMAR,
        start="sum",
        parser="lalr",
        lexer="basic",
        transformer=_Builder(),
        lexer_callbacks={"NUMBER": _number, "NAME": _name},
    )


def _unexpected(text: str, token: Token, accepted: set[str]) -> ExpressionError:
    """Return what is wrong about a token that cannot stand where it does."""
    at_end = token.type == "$END"
    column = len(text) + 1 if at_end else _column(token)
    shown = "the end" if at_end else repr(token.upper() if token.type in _NAMES else str(token))
    if "NUMBER" in accepted:
        wanted = "a number, a name or '('"
    elif "PLUS" not in accepted:
        name = re.split(r"\W+", text[: column - 1].rstrip(), flags=re.ASCII)[-1]
        wanted = f"'(' after {name.upper()}"
    else:
        wanted = _closing(text[: column - 1])
    return ExpressionError(f"{shown} stands where {wanted} should be", column)


_NAMES = ("FUNCTION", "NAME")


def _closing(before: str) -> str:
    """Return what could follow a complete operand: it depends on the parenthesis around it."""
    opened: list[int] = []
    for at, sign in enumerate(before):
        if sign == "(":
            opened.append(at)
        elif sign == ")" and opened:
            opened.pop()
    if not opened:
        return "an operator or the end"
    name = re.search(r"[a-zA-Z_]\w*\s*\Z", before[: opened[-1]], re.ASCII)
    if name is None:
        return f"')' for the '(' of column {opened[-1] + 1}"
    return f"')' or ',' after an argument of {name[0].strip().upper()}"


def _like(name: str) -> str:
    """Return a hint at the known name that is nearest; nothing is near to a very long one."""
    if name == "T":
        return "; the time is TIME"
    if len(name) > 2 * max(map(len, FUNCTIONS)):
        return ""
    names = [function.name for function in FUNCTIONS.values()]
    near = difflib.get_close_matches(name, [*names, *CONSTANTS, "TIME"], 1)
    return f"; did you mean {near[0]}?" if near else ""


def check_arguments(function: Function, args: list[Node], column: int) -> None:
    """Refuse a wrong number of arguments, and ids and flags that are none."""
    name, least, most = function.name, function.least, len(function.args)
    if not least <= len(args) <= most:
        allowed = f"{least}" if least == most else f"{least} to {most}"
        raise ExpressionError(
            f"{name} has {len(args)} argument{'s' * (len(args) != 1)}, not {allowed}", column
        )
    for place, (kind, arg) in enumerate(zip(function.args, args, strict=False)):
        if kind == "number":
            continue
        which = f"the {_ORDINALS[place]} argument of {name}"
        whole = isinstance(arg, Number) and arg.value >= 0.0 and arg.value == int(arg.value)
        if kind in CHOICES:
            low, high = CHOICES[kind]
            if not (whole and isinstance(arg, Number) and low <= arg.value <= high):
                allowed = f"{low}" if low == high else f"{low} to {high}"
                raise ExpressionError(f"{which} must be {allowed}{_WHY.get(kind, '')}", column)
        elif not whole:
            what = "a marker" if kind == "marker" else f"a {kind}"
            raise ExpressionError(f"{which} must be the id of {what}, a whole number", column)


def parse(text: str) -> Expression:
    """Return the tree of an expression.

    Parameters
    ----------
    text : str
        In the language of the deck; names in any case, blanks and line ends anywhere.

    Raises
    ------
    ExpressionError
        With what is wrong and its column.
    """
    if len(text) > LONGEST:
        raise ExpressionError(f"an expression of more than {LONGEST} characters", LONGEST + 1)
    if not text.strip():
        raise ExpressionError("the expression is empty", 1)
    parser = _parser()
    from lark.exceptions import UnexpectedCharacters, UnexpectedToken

    try:
        made: Any = parser.parse(text)
    except UnexpectedCharacters as fault:
        at = fault.pos_in_stream or 0
        shown = f"'{text[at]}'" if text[at].isprintable() else repr(text[at])
        raise ExpressionError(f"{shown} means nothing here", at + 1) from None
    except UnexpectedToken as fault:
        raise _unexpected(text, fault.token, set(fault.accepts or fault.expected)) from None
    return Expression(text, made.node)

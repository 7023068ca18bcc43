"""Text of the deck's language to a tree: recursive descent, bounded in length and depth.

    sum      : product (("+" | "-") product)*
    product  : unary (("*" | "/") unary)*
    unary    : ("+" | "-") unary | power
    power    : primary ("**" unary)?
    primary  : NUMBER | NAME | NAME "(" sum (("," | ":") sum)* ")" | "(" sum ")"

So -2**2 is -4 and 2**3**2 is 2**9. A number that ends in D is an angle in degrees; ":" stands
only after the first argument of IF.
"""

from __future__ import annotations

import difflib
import math
import re
from typing import NamedTuple

from mbsim.expressions.functions import CHOICES, CONSTANTS, FUNCTIONS, Function
from mbsim.expressions.tree import Call, Expression, Node, Number, Time

LONGEST = 20_000
#: Parentheses and functions within each other.
DEEPEST = 50
#: Operations that wait for each other's result, as the terms of a sum do.
LONGEST_CHAIN = 400

_VALUES = {"PI": math.pi, "RTOD": 180.0 / math.pi, "DTOR": math.pi / 180.0}
_TOKEN = re.compile(
    r"(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)(?P<unit>[a-zA-Z_]\w*|\.\d*)?"
    r"|(?P<name>[a-zA-Z_]\w*)|(?P<sign>\*\*|[-+*/(),:])",
    re.ASCII,
)
_OPERATORS = {"+": "ADD", "-": "SUB", "*": "MUL", "/": "DIV"}
_ORDINALS = ("first", "second", "third", "fourth")


class ExpressionError(ValueError):
    """An expression that cannot be used; `column` counts from 1, `message` says why."""

    def __init__(self, message: str, column: int) -> None:
        super().__init__(f"{message} (column {column})")
        self.message, self.column = message, column


class _Token(NamedTuple):
    """A number, a name in upper case, a sign, or the end."""

    kind: str
    text: str
    column: int
    value: float = 0.0


def _tokens(text: str) -> list[_Token]:
    """Cut the text into tokens, the last one being the end."""
    found, at = [], 0
    while True:
        while at < len(text) and text[at].isspace():
            at += 1
        if at >= len(text):
            return [*found, _Token("end", "the end", at + 1)]
        match = _TOKEN.match(text, at)
        if match is None:
            raise ExpressionError(f"{text[at]!r} means nothing here", at + 1)
        if match["number"]:
            found.append(_number(match, at + 1))
        elif match["name"]:
            found.append(_Token("name", match["name"].upper(), at + 1))
        else:
            found.append(_Token("sign", match["sign"], at + 1))
        at = match.end()


def _number(match: re.Match[str], column: int) -> _Token:
    """Return a number, in radians where it ends in D."""
    value, unit = float(match["number"]), match["unit"] or ""
    if not math.isfinite(value):
        raise ExpressionError(f"{match[0]} is too large for a number", column)
    if unit.upper() == "D":
        value *= math.pi / 180.0
    elif re.fullmatch(r"[dD]\d+", unit):
        raise ExpressionError(
            f"{match[0]} is not clear: write E for a power of ten, D alone for degrees", column
        )
    elif unit:
        raise ExpressionError(f"{match[0]} is not a number", column)
    return _Token("number", match[0], column, value)


class _Parser:
    """One pass over the tokens of one text."""

    def __init__(self, text: str) -> None:
        self.tokens = _tokens(text)
        self.at = 0
        self.depth = 0

    @property
    def next(self) -> _Token:
        return self.tokens[self.at]

    def take(self, *signs: str) -> _Token | None:
        """Return the next token and go on, if it is one of the signs."""
        token = self.next
        if token.kind != "sign" or token.text not in signs:
            return None
        self.at += 1
        return token

    def expect(self, sign: str, after: str) -> None:
        """Go over a sign that has to be here."""
        if self.take(sign) is None:
            raise ExpressionError(
                f"{_shown(self.next)} stands where {sign!r} {after} should be", self.next.column
            )

    def nest(self, change: int) -> None:
        """Go one level of nesting in or out."""
        self.depth += change
        if self.depth > DEEPEST:
            raise ExpressionError(f"more than {DEEPEST} levels of nesting", self.next.column)

    def sum(self) -> Node:
        node = self.product()
        while sign := self.take("+", "-"):
            node = Call(_OPERATORS[sign.text], (node, self.product()), sign.column)
        return node

    def product(self) -> Node:
        node = self.unary()
        while sign := self.take("*", "/"):
            node = Call(_OPERATORS[sign.text], (node, self.unary()), sign.column)
        return node

    def unary(self) -> Node:
        sign = self.take("+", "-")
        if sign is None:
            return self.power()
        self.nest(1)
        node = self.unary()
        self.nest(-1)
        if sign.text == "+":
            return node
        return (
            Number(-node.value) if isinstance(node, Number) else Call("NEG", (node,), sign.column)
        )

    def power(self) -> Node:
        base = self.primary()
        sign = self.take("**")
        if sign is None:
            return base
        self.nest(1)
        node = Call("POW", (base, self.unary()), sign.column)
        self.nest(-1)
        return node

    def primary(self) -> Node:
        token = self.next
        if self.take("("):
            self.nest(1)
            node = self.sum()
            self.nest(-1)
            self.expect(")", f"for the '(' of column {token.column}")
            return node
        if token.kind not in ("number", "name"):
            raise ExpressionError(
                f"{_shown(token)} stands where a number, a name or '(' should be", token.column
            )
        self.at += 1
        if token.kind == "number":
            return Number(token.value)
        return self.named(token)

    def named(self, token: _Token) -> Node:
        """Return what a name means."""
        name = token.text
        if name == "TIME":
            return Time()
        if name in _VALUES:
            return Number(_VALUES[name])
        function = FUNCTIONS.get(name)
        if function is None:
            raise ExpressionError(f"there is no function {name}{_like(name)}", token.column)
        self.expect("(", f"after {name}")
        self.nest(1)
        args = self.arguments(name)
        self.nest(-1)
        _check_arguments(function, args, token.column)
        return Call(name, tuple(args), token.column)

    def arguments(self, name: str) -> list[Node]:
        """Return what stands between a function's parentheses."""
        args = [self.sum()]
        while sign := self.take(",", ":"):
            if sign.text == ":" and (name != "IF" or len(args) != 1):
                raise ExpressionError("':' stands only after the first argument of IF", sign.column)
            args.append(self.sum())
        self.expect(")", f"or ',' after an argument of {name}")
        return args


def _shown(token: _Token) -> str:
    """Return a token as a message shows it."""
    return token.text if token.kind == "end" else repr(token.text)


def _like(name: str) -> str:
    """Return a hint at the known name that is nearest."""
    near = difflib.get_close_matches(name, [*FUNCTIONS, *CONSTANTS, "TIME"], 1)
    return f"; did you mean {near[0]}?" if near else ""


def _check_arguments(function: Function, args: list[Node], column: int) -> None:
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
                raise ExpressionError(f"{which} must be {allowed}", column)
        elif not whole:
            what = "a marker" if kind == "marker" else f"a {kind}"
            raise ExpressionError(f"{which} must be the id of {what}, a whole number", column)


def _check_chains(root: Node) -> None:
    """Refuse a tree that is too deep for those who walk it."""
    waiting = [(root, 1)]
    while waiting:
        node, depth = waiting.pop()
        if isinstance(node, Call):
            if depth > LONGEST_CHAIN:
                raise ExpressionError(
                    f"more than {LONGEST_CHAIN} operations in a row: use variables for parts of it",
                    node.column,
                )
            waiting.extend((arg, depth + 1) for arg in node.args)


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
    parser = _Parser(text)
    if parser.next.kind == "end":
        raise ExpressionError("the expression is empty", 1)
    root = parser.sum()
    if parser.next.kind != "end":
        raise ExpressionError(
            f"{_shown(parser.next)} stands where an operator or the end should be",
            parser.next.column,
        )
    _check_chains(root)
    return Expression(text, root)

"""Whatever stands in a deck as an expression is parsed, or refused by the one error."""

from __future__ import annotations

import random
from collections.abc import Iterator

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mbsim.expressions.functions import CONSTANTS, FUNCTIONS
from mbsim.expressions.parse import ExpressionError, parse
from mbsim.expressions.tree import Expression, references

PIECES = [
    *(function.name for function in FUNCTIONS.values()),
    *CONSTANTS,
    *("TIME", "time", "T", "x1", "Step"),
    *("0", "1", "21", "2.5", ".5", "1e-3", "180D", "1D3", "1e999", "5.", "1.2.3", "3TIME"),
    *("+", "-", "*", "/", "**", "(", ")", ",", ":", "^", ";", "'", "\u00b2", "\u0663"),
    *(" ", "\n", "\t", "\u00a0", "\x00"),
]

# a text is made of bytes: one draw a text, where a draw a piece takes ten times as long
near_grammar = st.binary(max_size=40).map(
    lambda drawn: "".join(PIECES[k % len(PIECES)] for k in drawn)
)
ARGUMENTS = ["1", "0", "TIME", "-2.5", "SIN(TIME)", "27", "1/0"]
NAMED = list(FUNCTIONS.values())
OPERATORS = ["+", "-", "*", "/", "**"]


def sentence(drawn: Iterator[int]) -> str:
    """Return a text of the grammar, leaves where the bytes end; ids and counts may be wrong."""
    kind = next(drawn, 0) % 10
    if kind < 2:
        return ["TIME", "1", "2.5", "PI"][next(drawn, 0) % 4]
    if kind < 5:
        function = NAMED[next(drawn, 0) % len(NAMED)]
        if next(drawn, 0) % 4:
            # one that is right but for the values of ids and flags
            args = [
                ARGUMENTS[next(drawn, 0) % len(ARGUMENTS)] if arg == "number" else "1"
                for arg in function.args[: function.least]
            ]
        else:
            count = next(drawn, 0) % 9
            args = [ARGUMENTS[next(drawn, 0) % len(ARGUMENTS)] for _ in range(count)]
        return f"{function.name}({','.join(args)})"
    if kind < 7:
        sign = OPERATORS[next(drawn, 0) % len(OPERATORS)]
        return sentence(drawn) + sign + sentence(drawn)
    if kind == 7:
        return f"({sentence(drawn)})" if next(drawn, 0) % 2 else f"-{sentence(drawn)}"
    if kind == 8:
        p = [sentence(drawn) for _ in range(4)]
        return f"IF({p[0]}: {p[1]}, {p[2]}, {p[3]})"
    return f"STEP({', '.join(sentence(drawn) for _ in range(5))})"


nested = st.binary(max_size=150).map(lambda drawn: sentence(iter(drawn)))
repeated = st.tuples(st.sampled_from(PIECES), st.integers(1, 3000)).map(lambda p: p[0] * p[1])
texts = st.one_of(near_grammar, nested, st.text(max_size=80), repeated)


def check(text: str) -> bool:
    """Parse a text and walk its tree; return whether it is an expression."""
    try:
        made = parse(text)
    except ExpressionError as fault:
        assert fault.message
        assert 1 <= fault.column <= len(text) + 1
        return False
    assert isinstance(made, Expression)
    assert made.text == text
    assert all(reference.id > 0 for reference in references(made))
    return True


def test_the_checker_knows_both_kinds() -> None:
    assert check("STEP(TIME, 0, 0, 1, 1)")
    assert not check("STEP(TIME, 0, 0, 1, 1")


def test_both_kinds_of_text_are_drawn() -> None:
    """Of the texts of the grammar neither kind is rare, and some are deep."""
    rng = random.Random(1)
    made = [sentence(iter(rng.randbytes(rng.randrange(150)))) for _ in range(1000)]
    good = [text for text in made if check(text)]
    assert 200 < len(good) < 900
    assert max(map(len, good)) > 200


@settings(max_examples=3000, deadline=None, suppress_health_check=list(HealthCheck))
@given(texts)
def test_any_text_is_parsed_or_refused(text: str) -> None:
    check(text)


@pytest.mark.slow
@settings(
    max_examples=100_000, deadline=None, database=None, suppress_health_check=list(HealthCheck)
)
@given(texts)
def test_a_hundred_thousand_texts_are_parsed_or_refused(text: str) -> None:
    check(text)

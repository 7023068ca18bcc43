"""Whatever stands in a deck as an expression is parsed, or refused by the one error."""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mbsim.expressions.functions import CONSTANTS, FUNCTIONS
from mbsim.expressions.parse import ExpressionError, parse
from mbsim.expressions.tree import Expression, references

PIECES = [
    *FUNCTIONS,
    *CONSTANTS,
    *("TIME", "time", "T", "x1", "Step"),
    *("0", "1", "21", "2.5", ".5", "1e-3", "180D", "1D3", "1e999", "5.", "1.2.3", "3TIME"),
    *("+", "-", "*", "/", "**", "(", ")", ",", ":", "^", ";", "'", "\u00b2", "\u0663"),
    *(" ", "\n", "\t", "\u00a0", "\x00"),
]

near_grammar = st.lists(st.sampled_from(PIECES), max_size=40).map("".join)
calls = st.builds(
    lambda name, args: f"{name}({','.join(args)})",
    st.sampled_from(list(FUNCTIONS)),
    st.lists(st.sampled_from(["1", "0", "TIME", "-2.5", "SIN(TIME)", "27", "1/0"]), max_size=8),
)
nested = st.recursive(
    st.one_of(st.sampled_from(["TIME", "1", "2.5", "PI"]), calls),
    lambda inner: st.one_of(
        st.tuples(inner, st.sampled_from(["+", "-", "*", "/", "**"]), inner).map("".join),
        inner.map(lambda text: f"({text})"),
        inner.map(lambda text: f"-{text}"),
        st.tuples(*[inner] * 4).map(lambda p: f"IF({p[0]}: {p[1]}, {p[2]}, {p[3]})"),
        st.tuples(*[inner] * 5).map(lambda parts: f"STEP({', '.join(parts)})"),
    ),
    max_leaves=30,
)
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


@settings(max_examples=3000, deadline=None, suppress_health_check=list(HealthCheck))
@given(texts)
def test_any_text_is_parsed_or_refused(text: str) -> None:
    check(text)


@pytest.mark.slow
@settings(max_examples=100_000, deadline=None, suppress_health_check=list(HealthCheck))
@given(texts)
def test_a_hundred_thousand_texts_are_parsed_or_refused(text: str) -> None:
    check(text)

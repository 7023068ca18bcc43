"""Text of an expression to its tree: so far numbers only."""

from __future__ import annotations

from mbsim.expressions.tree import Expression, Number


class ExpressionError(ValueError):
    """Text that is no expression; `column` counts from 0."""

    def __init__(self, message: str, column: int) -> None:
        super().__init__(message)
        self.column = column


def parse(text: str) -> Expression:
    """Return the expression that `text` means.

    Raises
    ------
    ExpressionError
        If the text is no number.
    """
    try:
        return Expression(text, Number(float(text)))
    except ValueError:
        raise ExpressionError(f"{text!r} is no number", 0) from None

"""Formulas of study files: arithmetic over names, compiled once, nothing else of Python."""

from __future__ import annotations

import ast
import math
from collections.abc import Collection, Mapping
from typing import Any

from mbsim.errors import ModelError

_FUNCTIONS = {
    name: getattr(math, name)
    for name in ("sqrt", "exp", "log", "log10", "sin", "cos", "tan", "asin", "acos", "atan")
} | {"atan2": math.atan2, "hypot": math.hypot, "abs": abs, "min": min, "max": max}
_CONSTANTS = {"pi": math.pi}
_OPERATORS = (ast.Add, ast.Sub, ast.Mult, ast.Div, ast.Pow, ast.USub, ast.UAdd)


class Formula:
    """A formula over named numbers, ``0.8*mu`` or ``hypot(x_end, y_end)/v0``.

    Parameters
    ----------
    text : str
    names : collection of str
        Those that it may use, beside ``pi``.

    Raises
    ------
    ModelError
        If it is no arithmetic, or uses another name.
    """

    def __init__(self, text: str, names: Collection[str]) -> None:
        self.text = text
        try:
            tree = ast.parse(text.strip(), mode="eval")
            _check(tree.body, text, names)
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            raise ModelError(f"{text[:60]!r}: is no formula") from None
        for node in ast.walk(tree):
            if isinstance(node, ast.Constant) and isinstance(node.value, int):
                # a power of whole numbers may have more digits than there is time for
                node.value = float(node.value)
        self.names = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
        self._code = compile(tree, "<formula>", "eval")

    def __call__(self, values: Mapping[str, float]) -> float:
        """Return its value; ArithmeticError or ValueError where there is none."""
        # `_check` has let nothing in that is not arithmetic
        scope: dict[str, Any] = {"__builtins__": {}, **_FUNCTIONS, **_CONSTANTS, **values}
        try:
            found = eval(self._code, scope)
        except OverflowError:
            raise ArithmeticError("a number out of range") from None
        if isinstance(found, complex):
            raise ArithmeticError("a root of a negative number")
        return float(found)


def _check(node: ast.expr, text: str, names: Collection[str]) -> None:
    """Raise `ModelError` where a part of a formula is no arithmetic."""
    if isinstance(node, ast.Constant) and type(node.value) in (int, float):
        return
    if isinstance(node, ast.Name):
        if node.id in names or node.id in _CONSTANTS:
            return
        known = ", ".join(sorted([*names, *_CONSTANTS]))
        raise ModelError(f"{text!r}: no {node.id}; there is {known}")
    inner: list[ast.expr] = []
    if isinstance(node, ast.BinOp) and isinstance(node.op, _OPERATORS):
        inner = [node.left, node.right]
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, _OPERATORS):
        inner = [node.operand]
    elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
        if node.func.id not in _FUNCTIONS:
            there = ", ".join(sorted(_FUNCTIONS))
            raise ModelError(f"{text!r}: no function {node.func.id}; there are {there}")
        inner = node.args
    if not inner:
        raise ModelError(f"{text!r}: only numbers, names, + - * / ** and functions are allowed")
    for part in inner:
        _check(part, text, names)

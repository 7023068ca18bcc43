"""What a user's function returned, as finite numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    pass


class NotAForce(Exception):
    """A user function returned something else than three finite numbers."""


def three_numbers(result: Any) -> list[float]:
    """Return a user function's result as three finite floats, or raise `NotAForce`."""
    return numbers(result, 3, " [Fx, Fy, Tz]")


def force_and_state(result: Any, states: int) -> list[float]:
    """Return Fx, Fy, Tz and the new state as finite floats, or raise `NotAForce`."""
    try:
        force, state = result
    except (TypeError, ValueError):
        shown = repr(result)
        shown = shown if len(shown) <= 80 else shown[:77] + "..."
        raise NotAForce(
            f"returned {shown}, not (force, new_state) as CFFSUB_STATES = {states} asks"
        ) from None
    return three_numbers(force) + numbers(state, states, " of new state")


def two_parts(result: Any, first: int, second: int) -> tuple[list[float], list[float]]:
    """Return slopes of states and outputs that a GSESUB gave, or raise `NotAForce`."""
    try:
        slopes, outputs = result
    except (TypeError, ValueError):
        shown = repr(result)
        shown = shown if len(shown) <= 80 else shown[:77] + "..."
        raise NotAForce(f"returned {shown}, not [stated, output], a list of each") from None
    return numbers(slopes, first, " of stated"), numbers(outputs, second, " of output")


def numbers(result: Any, count: int, names: str = "") -> list[float]:
    """Return a user function's result as `count` finite floats, or raise `NotAForce`."""
    shown = repr(result)
    shown = shown if len(shown) <= 80 else shown[:77] + "..."
    # numpy arrays have no common base with list; length and indexing make a sequence
    sized = hasattr(result, "__len__") and hasattr(result, "__getitem__")
    if not sized or isinstance(result, (str, bytes, dict)):
        hint = " (no return statement?)" if result is None else ""
        raise NotAForce(f"returned {shown}{hint}, not {count} finite numbers{names}")
    if len(result) != count:
        raise NotAForce(f"returned {len(result)} values, {shown}, not {count} finite numbers")
    try:
        if any(isinstance(value, (str, bytes)) for value in result):
            raise TypeError
        values = [float(value) for value in result]
    except (TypeError, ValueError, OverflowError) as error:
        raise NotAForce(f"returned {shown}, not {count} finite numbers") from error
    if any(value - value != 0.0 for value in values):
        raise NotAForce(f"returned {shown}, not {count} finite numbers")
    return values


def one_number(result: Any) -> list[float]:
    """Return a user function's result as one finite float in a list, or raise `NotAForce`."""
    shown = repr(result)
    shown = shown if len(shown) <= 80 else shown[:77] + "..."
    hint = " (no return statement?)" if result is None else ""
    try:
        if isinstance(result, (str, bytes)):
            raise TypeError
        value = float(result)
    except (TypeError, ValueError, OverflowError) as error:
        raise NotAForce(f"returned {shown}{hint}, not one finite number") from error
    if value - value != 0.0:
        raise NotAForce(f"returned {shown}, not one finite number")
    return [value]


def only_one(result: Any) -> float:
    """Return the force that a function gave as a number or as a sequence of one."""
    if type(result) is float and result - result == 0.0:
        return result
    if hasattr(result, "__len__") and not isinstance(result, (str, bytes, dict)):
        return numbers(result, 1, " [F]")[0]
    return one_number(result)[0]

"""The registry of joints, and the rows of which their equations are made.

A row is one number that follows from where marker I is as seen from marker J, and an equation
says that a sum of rows stays what it is. With P the origins, x, y, z the axes of the markers:

| row                | value                                    |
|--------------------|------------------------------------------|
| `offset(a)`        | a_J . (P_I - P_J)                  [L]   |
| `perp(a, b)`       | a_I . b_J                          [-]   |
| `angle()`          | of I's x about J's z from J's x    [rad] |
| `spin()`           | angle of I about its own z, against J [rad], 0 as assembled |
| `twist()`          | 2 cos(b/2) sin(t/2) of the turn t about J's z and the bend b after it that |
|                    | take J to I [-], t = 0 as assembled |
| `distance()`       | abs(P_I - P_J)                     [L]   |

An equation of one offset or perp row is 0; other sums keep the value that they have as
assembled, or what the joint's own attribute says.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from mbsim.core.registry import Registry


def _one(joint: Any) -> float:
    return 1.0


class Row(NamedTuple):
    """One row: its kind, the axes it takes of I and J, its factor, from the joint's attributes."""

    kind: str
    i: str = ""
    j: str = ""
    factor: Callable[[Any], float] = _one

    def times(self, factor: float | Callable[[Any], float]) -> Row:
        """Return the row with a factor, a number or a function of the joint's attributes."""
        if callable(factor):
            return self._replace(factor=factor)
        return self._replace(factor=lambda joint: factor)


def offset(axis: str) -> Row:
    """Return how far I's origin is from J's along J's axis."""
    return Row("offset", "", axis)


def perp(i: str, j: str) -> Row:
    """Return the cosine between an axis of I and one of J."""
    return Row("perp", i, j)


def angle() -> Row:
    """Return the angle of I's x about J's z, whole turns counted."""
    return Row("angle")


def spin() -> Row:
    """Return the angle of I about its own z against J, 0 as assembled, whole turns counted."""
    return Row("spin")


def twist() -> Row:
    """Return twice z of the quaternion from J to I, J turned about its z to have none at first."""
    return Row("twist")


def distance() -> Row:
    """Return the distance of the origins."""
    return Row("distance")


class JointKind(NamedTuple):
    """A joint: its equations, each a sum of rows, and the attributes that it must have.

    `value` gives what the last equation equals, None where it keeps its value as assembled.
    """

    name: str
    equations: tuple[tuple[Row, ...], ...]
    needs: tuple[str, ...] = ()
    value: Callable[[Any], float | None] | None = None
    moves: tuple[str, ...] = ()  # of R, T: what a motion or coupler may take


JOINTS: Registry[JointKind] = Registry("mbsim.joints.kinds")


def joint(
    name: str,
    *equations: Row | tuple[Row, ...],
    needs: tuple[str, ...] = (),
    value: Callable[[Any], float | None] | None = None,
    moves: tuple[str, ...] = (),
) -> None:
    """Register a joint; an equation is a row or a sum of rows."""
    sums = tuple((e,) if isinstance(e, Row) else tuple(e) for e in equations)
    JOINTS.put(name, JointKind(name, sums, needs, value, moves))

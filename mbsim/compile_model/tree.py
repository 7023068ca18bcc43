"""Limbs of the tree of bodies: joints whose equations are plain offsets and cosines."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from mbsim.arrays import codes
from mbsim.arrays.model import Tree
from mbsim.joints.catalog import Row
from mbsim.model.elements import Array

#: Directions free at each kind of turn.
FREE_TURNS = {
    codes.TURN_LOCKED: 0,
    codes.TURN_AXIS: 1,
    codes.TURN_CROSS: 2,
    codes.TURN_FREE: 3,
    codes.TURN_ROOT: 6,
}

AXES = "xyz"
#: What of a rotation is left free by these cosines held at 0 (axis of I, axis of J).
_TURNS = {
    frozenset[tuple[str, str]](): codes.TURN_FREE,
    frozenset({("z", "x"), ("z", "y")}): codes.TURN_AXIS,
    frozenset({("z", "x"), ("z", "y"), ("x", "y")}): codes.TURN_LOCKED,
}


@dataclass(frozen=True)
class TreeJoint:
    """A joint that can hang a body on another: what it leaves free; bodies and markers by rows."""

    connection: int
    i: int
    j: int
    turn: int
    slide: tuple[int, int, int]
    axis_i: int = 0
    axis_j: int = 0

    @property
    def held(self) -> int:
        """Number of directions that the joint holds."""
        return 6 - FREE_TURNS[self.turn] - sum(self.slide)

    @property
    def both_ways(self) -> bool:
        """Whether I's body may be the parent: slides are then along I's axes as well."""
        return self.turn in (codes.TURN_LOCKED, codes.TURN_AXIS) or sum(self.slide) in (0, 3)


def nearest_flip(turn: int, relative: Array) -> Array:
    """Return the half turn (or none) of the child's axes that brings them nearest to the parent's.

    Cosines held at 0 do not tell an axis from its opposite.
    """
    if turn == codes.TURN_AXIS:
        return np.eye(3) if relative[2, 2] >= 0.0 else np.diag([1.0, -1.0, -1.0])
    if turn == codes.TURN_LOCKED:
        flips = [np.diag([x, y, x * y]) for x, y in product((1.0, -1.0), repeat=2)]
        return max(flips, key=lambda flip: float(np.trace(relative @ flip)))
    return np.eye(3)


def is_plain(rows: tuple[Row, ...]) -> bool:
    """Return whether an equation is one offset or one cosine, which a tree joint can hold."""
    return len(rows) == 1 and rows[0].kind in ("offset", "perp")


def tree_joint_of(
    connection: int, i: int, j: int, equations: tuple[tuple[Row, ...], ...]
) -> TreeJoint | None:
    """Return what a joint is as a joint of the tree, None where it cannot be one."""
    plain = [rows[0] for rows in equations if is_plain(rows)]
    held = {row.j for row in plain if row.kind == "offset"}
    cosines = [(row.i, row.j) for row in plain if row.kind == "perp"]
    slide = (int("x" not in held), int("y" not in held), int("z" not in held))
    if len(cosines) == 1:
        axis_i, axis_j = (AXES.index(axis) for axis in cosines[0])
        return TreeJoint(connection, i, j, codes.TURN_CROSS, slide, axis_i, axis_j)
    turn = _TURNS.get(frozenset(cosines))
    return None if turn is None else TreeJoint(connection, i, j, turn, slide)


def empty_tree(ground: int, n: int) -> Tree:
    """Return a tree of n bodies to be filled."""

    def ints(*shape: int) -> np.ndarray[tuple[int, ...], np.dtype[np.int64]]:
        return np.zeros(shape, dtype=np.int64)

    return Tree(
        body=ints(n),
        parent=ints(n),
        of_body=np.full(ground + 1, -1, dtype=np.int64),
        root=ints(n),
        end=ints(n),
        turn=ints(n),
        slide=ints(n, 3),
        axis=ints(n, 2),
        child_p=np.zeros((n, 3)),
        child_R=np.zeros((n, 3, 3)),
        parent_p=np.zeros((n, 3)),
        parent_R=np.zeros((n, 3, 3)),
        free=ints(n),
    )

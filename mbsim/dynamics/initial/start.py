"""Velocities to start with: those that the deck gives are kept, the others follow.

Of the velocities that all constraints allow those that are nearest to what is given (least
squares), and of these the ones with the least of everything else.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mbsim.arrays.codes import SCALE_LENGTH, START_RATE
from mbsim.arrays.scene import Scene
from mbsim.core.layout import BODY_SIZE
from mbsim.dynamics.constraints.equations import lasting

Array = np.ndarray[Any, Any]

#: Singular values below this part of the largest of `tree_map` are rounding.
_RANK = 1e-9
#: Largest number of free directions for which the least squares are solved.
MOST_DIRECTIONS = 400
_MISMATCH, _FLOW = 1, 3


def tree_map(scene: Scene) -> Array:
    """Return how (v_cg, w) of the tree's bodies, global, follow from rates in the free directions.

    Shape (6 bodies, free directions); the tree has been prepared.
    """
    tree, sweep = scene.tree, scene.sweep
    n = len(tree.body)
    first = np.concatenate([[0], np.cumsum(tree.free)])
    spatial = np.zeros((n, 6, int(first[-1])))
    for k in range(n):
        parent = int(tree.parent[k])
        if parent >= 0:
            spatial[k] = spatial[parent]
        for q in range(int(tree.free[k])):
            spatial[k, :, first[k] + q] += sweep.S[k, q]
    found = np.zeros((n, 6, int(first[-1])))
    for k in range(n):
        angular, linear = spatial[k, :3], spatial[k, 3:]
        found[k, :3] = linear + np.cross(angular, sweep.arm[k], axis=0)
        found[k, 3:] = angular
    return found.reshape(6 * n, -1)


def equation_rows(scene: Scene, found: Array, held: Array) -> Array:
    """Return what the rates of the held equations take of rates in the free directions."""
    equations, tree, sweep = scene.equations, scene.tree, scene.sweep
    rows = []
    for e in np.flatnonzero(held):
        row = np.zeros(found.shape[1])
        for k in range(equations.first[e], equations.first[e + 1]):
            for side, m in enumerate((equations.i[k], equations.j[k])):
                index = int(tree.of_body[scene.markers.body[m]])
                if index < 0:
                    continue
                G = sweep.G[k, 6 * side : 6 * side + 6]
                # about the cg
                torque = G[:3] - np.cross(sweep.arm[index], G[3:])
                at = found[6 * index : 6 * index + 6]
                row += G[3:] @ at[:3] + torque @ at[3:]
        rows.append(row)
    return np.array(rows).reshape(-1, found.shape[1])


def _flows(scene: Scene, found: Array, held: Array, given: Array) -> tuple[Array, Array]:
    """Return rows and right sides of the rates that equations ask for."""
    wanted = scene.sweep.rate[:, _FLOW] - scene.sweep.rate[:, _MISMATCH]
    sides = np.where(np.isfinite(given), given, wanted[: len(given)])
    return equation_rows(scene, found, held), sides[held]


def _meet(rate: Array, free: Array, rows: Array, sides: Array, size: float) -> tuple[Array, Array]:
    """Return rates changed within `free` so that rows times them come nearest to the right sides.

    With them what is still free: the directions in which the rows do not change, that is by less
    than rounding of `size`, by which velocities follow from rates.
    """
    if not (len(rows) and free.shape[1]):
        return rate, free
    # all of v is needed, of u only what meets a singular value
    u, s, vt = np.linalg.svd(rows @ free, full_matrices=len(rows) < free.shape[1])
    rank = int((s > _RANK * size).sum())
    step = (u.T @ (sides - rows @ rate))[:rank] / s[:rank]
    return rate + free @ (vt[:rank].T @ step), free @ vt[rank:].T


def start_velocities(scene: Scene, y: Array, given: dict[int, Array]) -> None:
    """Write velocities into y that the constraints allow and that keep what is given.

    `given` has, by body row, rows (v axis, w axis, value): six coefficients, global, and what they
    times (v, w) shall be. Bodies that no constraint holds keep theirs as they are.
    """
    tree, length = scene.tree, float(scene.world.scale[SCALE_LENGTH])
    found = tree_map(scene)
    if found.shape[1] == 0:
        # all is fixed: nothing can move
        for b in tree.body:
            y[BODY_SIZE * b + 7 : BODY_SIZE * b + 13] = 0.0
        return
    starts = np.where(scene.equations.level < 1, scene.equations.start[:, START_RATE], np.nan)
    held = (scene.equations.level >= 1) | np.isfinite(starts)
    # what slides at the start may do so
    held &= lasting(scene)
    asked, wanted = _flows(scene, found, held, starts)
    size, freedom = float(np.linalg.norm(found, 2)), found.shape[1]
    rate, free = np.zeros(freedom), np.eye(freedom)
    rate, free = _meet(rate, free, asked, wanted, size)
    rows, sides = [], []
    for k, b in enumerate(tree.body):
        for row in given.get(int(b), np.zeros((0, 7))):
            scale = length if row[3:6].any() else 1.0
            rows.append(scale * (row[:6] @ found[6 * k : 6 * k + 6]))
            sides.append(scale * row[6])
    rate, free = _meet(rate, free, np.array(rows).reshape(-1, freedom), np.array(sides), size)
    unit = np.tile([1.0, 1.0, 1.0, length, length, length], len(tree.body))
    rate, _ = _meet(rate, free, unit[:, None] * found, np.zeros(len(found)), size)
    both = (found @ rate).reshape(-1, 6)
    for k, b in enumerate(tree.body):
        y[BODY_SIZE * b + 7 : BODY_SIZE * b + 10] = both[k, :3]
        y[BODY_SIZE * b + 10 : BODY_SIZE * b + 13] = scene.work.R[b].T @ both[k, 3:]

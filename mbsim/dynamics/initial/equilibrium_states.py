"""Equilibrium of bodies together with the user's own states: forces and slopes z' vanish.

States that are held stay as they are, whatever their slopes are.

Newton's method for displacements along the free directions and all z at once, so that a state
may also be one whose slope only the bodies change (the integral part of a controller). The
Jacobian is taken by central differences; a step is the one of least norm, and halved until the
residual, each row over its largest entry, is smaller.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mbsim.arrays.scene import Scene
from mbsim.dynamics.initial.equilibrium import DIFFERENCE, LOOSE, Hooks, Search

Array = np.ndarray[Any, Any]

#: A slope is 0 where it is below this part of what the unknowns, each by its size, make of it.
_AT_REST = 1e-10
_MOST_HALVINGS = 30


@dataclass(frozen=True)
class Rest:
    """How a search ended: the last y, and the state whose slope is not 0, -1 for none."""

    y: Array
    iterations: int
    state: int
    rate: float


@dataclass(frozen=True)
class _Local:
    """Residual and Jacobian at a point; P: displacements, R: attitudes, unit: of each unknown."""

    P: Array
    R: Array
    unit: Array
    F: Array
    J: Array


class _States:
    """The search; unknowns are along the columns of P, then the states `loose` (rows)."""

    def __init__(self, scene: Scene, y: Array, hooks: Hooks, loose: Array) -> None:
        self.search = Search(scene, y, hooks)
        self.offsets, self.scale = scene.states.offset[loose], scene.states.scale[loose]
        self.search.move_to(self.search.y)

    def residual(self, y: Array, P: Array, R: Array) -> Array | None:
        """Return forces along P and slopes; None where they cannot be evaluated."""
        a = self.search.accelerations(y)
        if a is None:
            return None
        slopes = self.search.f[self.offsets]
        return np.concatenate([P.T @ self.search.forces(a, R).ravel(), slopes])

    def moved(self, step: Array, P: Array) -> Array:
        """Return the point after a step from the best one."""
        n = P.shape[1]
        y = self.search.moved(self.search.y, (P @ step[:n]).reshape(-1, 6))
        y[self.offsets] += step[n:]
        return y

    def look(self) -> _Local | None:
        """Return residual and Jacobian at the best point."""
        search = self.search
        if search.keep(search.y) is None:
            return None
        P = search.directions(search.y)
        R = search.scene.work.R[: search.count].copy()
        F = self.residual(search.y, P, R)
        size = np.maximum(np.abs(search.y[self.offsets]), self.scale)
        shift = np.tile([search.length] * 3 + [1.0] * 3, search.count)
        across = [1.0 / np.abs(column / shift).max() for column in P.T]
        unit = np.concatenate([across, size])
        J = np.zeros((len(unit), len(unit)))
        for k, whole in enumerate(unit):
            step = np.zeros(len(unit))
            step[k] = DIFFERENCE * whole
            ahead = self.residual(self.moved(step, P), P, R)
            behind = self.residual(self.moved(-step, P), P, R)
            if F is None or ahead is None or behind is None:
                return None
            J[:, k] = (ahead - behind) / (2.0 * DIFFERENCE)
        return None if F is None or not np.isfinite(J).all() else _Local(P, R, unit, F, J)

    def advance(self, local: _Local) -> bool:
        """Go by Newton's step, or a part of it; return whether the residual became smaller."""
        rows = np.abs(local.J).max(axis=1, initial=0.0)
        weight = 1.0 / np.where(rows > 0.0, rows, 1.0)
        J, F = local.J * weight[:, None], local.F * weight
        step = local.unit * np.linalg.lstsq(J, -F, rcond=LOOSE)[0]
        n = local.P.shape[1]
        part = self.search.limit((local.P @ step[:n]).reshape(-1, 6))
        for _ in range(_MOST_HALVINGS):
            y = self.moved(part * step, local.P)
            new = self.residual(y, local.P, local.R)
            if new is not None and np.linalg.norm(new * weight) < np.linalg.norm(F):
                self.search.y = y
                return True
            part *= 0.5
        return False


def settle_states(scene: Scene, y: Array, hooks: Hooks, most: int, loose: Array) -> Rest:
    """Return bodies and states at rest, from y on, or which state does not come to rest.

    Bodies that are not yet at rest are left to `equilibrium.balance`. `loose` are the rows of the
    states that are not held, at least one.
    """
    states, iterations = _States(scene, y, hooks, loose), 0
    while iterations < most:
        iterations += 1
        local = states.look()
        # on as long as it becomes better: the last steps are free
        if local is None or not states.advance(local):
            break
    local = states.look()
    if local is None:
        return Rest(states.search.y, iterations, int(loose[0]), np.nan)
    n = local.P.shape[1]
    slopes, allowed = local.F[n:], _AT_REST * np.abs(local.J[n:]).sum(axis=1)
    beyond = np.abs(slopes) - allowed
    worst = int(beyond.argmax())
    state = int(loose[worst]) if beyond[worst] > 0.0 else -1
    return Rest(states.search.y, iterations, state, slopes[worst])

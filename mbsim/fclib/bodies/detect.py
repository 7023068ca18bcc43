"""Rigid bodies in a global problem: parts of M of at most six unknowns, two to a contact.

Unknowns of a body are neighbours mostly: six in space, three in the plane. M of a sphere is
diagonal, so that it does not say which belong together; where it couples others, its components do.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.core.jitable import jitable
from mbsim.fclib.blocks import Rows
from mbsim.fclib.bodies.factors import BodyMatrix
from mbsim.fclib.bodies.solve import empty_matrix
from mbsim.fclib.bodies.system import SIX, BodySystem, body_system
from mbsim.fclib.clock import compiled
from mbsim.fclib.condensation import components

if TYPE_CHECKING:
    from mbsim.fclib.problem import Indices, Vector


@jitable
def _bodies(space: bool, n: int, m: Rows) -> tuple[int, Indices]:
    """Return how many bodies M may have, and every unknown's."""
    size = SIX if space else 3
    fits = n % size == 0
    for a in range(n):
        for j in range(m.ptr[a], m.ptr[a + 1]):
            fits = fits and m.col[j] // size == a // size
    if not fits:
        return components(n, m.ptr, m.col)
    component = np.empty(n, np.int32)
    for a in range(n):
        component[a] = a // size
    return n // size, component


@jitable
def body_arrays(
    space: bool, d: int, nc: int, mass: tuple[Any, ...], columns: tuple[Any, ...]
) -> tuple[bool, Vector, Indices, Vector]:
    """Return whether all is of rigid bodies, and M, bodies and H as `BodySystem` has them.

    `mass` and `columns` are M and H, what `Rows` has. A body of fewer than six unknowns gets others
    that nothing moves: ones on M's diagonal.
    """
    m, k = Rows(*mass), Rows(*columns)
    n = len(m.ptr) - 1
    count, component = _bodies(space, n, m)
    sizes, inside = np.zeros(count, np.int64), np.empty(n, np.int64)
    bodies, h = np.full((nc, 2), np.int32(-1)), np.zeros((nc, 2, d, SIX))
    masses = np.zeros((count, SIX, SIX))
    for a in range(n):
        inside[a] = sizes[component[a]]
        sizes[component[a]] += 1
    if n > 0 and sizes.max() > SIX:
        return False, masses, bodies, h
    for a in range(n):
        for j in range(m.ptr[a], m.ptr[a + 1]):
            masses[component[a], inside[a], inside[m.col[j]]] += m.val[j]
    for c in range(count):
        for i in range(sizes[c], SIX):
            masses[c, i, i] = 1.0
    for a in range(n):
        b = component[a]
        for j in range(k.ptr[a], k.ptr[a + 1]):
            if k.val[j] == 0.0:
                continue
            contact = k.col[j] // d
            side = 0
            if bodies[contact, 0] >= 0 and bodies[contact, 0] != b:
                side = 1
                if bodies[contact, 1] >= 0 and bodies[contact, 1] != b:
                    return False, masses, bodies, h
            bodies[contact, side] = b
            h[contact, side, k.col[j] - d * contact, inside[a]] += k.val[j]
    return True, masses, bodies, h


def rigid_bodies(
    tangent: tuple[int, ...],
    rolling: tuple[int, ...],
    mass: tuple[Any, ...],
    columns: tuple[Any, ...],
    w: Vector,
    mu: Vector,
    mu_r: Vector,
) -> tuple[BodySystem, BodyMatrix] | None:
    """Return a global problem in its bodies' velocities, with an empty matrix; None if it has none.

    `mass` and `columns` as for `body_arrays`; w = H' M^-1 f + w, the contacts' free velocities.
    """
    d, nc = 1 + len(tangent) + len(rolling), len(mu)
    if nc == 0:
        return None
    rigid, masses, bodies, h = compiled(body_arrays)(len(tangent) == 2, d, nc, mass, columns)
    if not rigid:
        return None
    inverse = np.ascontiguousarray(np.linalg.inv(masses))
    system = BodySystem(*compiled(body_system)(tangent, rolling, inverse, bodies, h, w, mu, mu_r))
    return system, BodyMatrix(*compiled(empty_matrix)(system, len(inverse)))

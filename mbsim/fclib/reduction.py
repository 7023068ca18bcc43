"""From global problems and equality constraints to u = W r + q in blocks, and back to v and l.

Global to local: v = M^-1 (H r + G l + f), so that W = H'M^-1 H, V = H'M^-1 G, R = G'M^-1 G,
q = H'M^-1 f + w, s = G'M^-1 f + b (`condensation`). The equality constraints are then eliminated
(`equality`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.errors import ModelError
from mbsim.fclib.blocks import (
    DelassusSystem,
    beside,
    block_rows,
    compressed_rows,
    dense,
    diagonal_and_units,
    product_of_stored,
    transposed_product_of_stored,
)
from mbsim.fclib.bodies.detect import rigid_bodies
from mbsim.fclib.clock import compiled
from mbsim.fclib.condensation import condense, mass_solve
from mbsim.fclib.equality import Equality, eliminate, split, upper_solution
from mbsim.fclib.problem import Global, Local, Matrix, matrix

if TYPE_CHECKING:
    from mbsim.fclib.problem import Vector


#: Contacts from which looking for rigid bodies is worth its time: without rolling friction, with.
SEVERAL, FEW = 100, 11


@dataclass(eq=False)
class Blocks:
    """u = W r + q, W in blocks (`blocks.block_rows`), and how to get l and v from r.

    `tangent` and `rolling` are the tuples whose lengths compiled code looks at; `rho` (nc,) turns a
    contact's velocity into the impulse that it is worth (`blocks.own_units`). `rigid`: of a global
    problem of rigid bodies, what `bodies.detect.rigid_bodies` returns; its second part changes.
    """

    tangent: tuple[int, ...]
    rolling: tuple[int, ...]
    ptr: Any
    col: Any
    val: Any
    diagonal: Any
    q: Vector
    mu: Vector
    mu_r: Vector
    rho: Vector
    equality: Equality | None = None
    mass: tuple[Any, ...] | None = None
    rigid: tuple[Any, ...] | None = None

    @cached_property
    def system(self) -> DelassusSystem:
        """The same as compiled code takes it."""
        return DelassusSystem(
            self.tangent, self.rolling, self.ptr, self.col, self.val, self.diagonal, self.q,
            self.mu, self.mu_r, self.rho,
        )  # fmt: skip

    @property
    def contacts(self) -> int:
        """Number of contacts."""
        return len(self.mu)


def directions(problem: Local | Global) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Return tuples as long as there are tangential and rolling directions."""
    d = problem.spacedim
    if problem.mu_r is None:
        return ((0,), ()) if d == 2 else ((0, 0), ())
    return ((0,), (0,)) if d == 3 else ((0, 0), (0, 0))


def reduce(problem: Local | Global) -> Blocks:
    """Return a problem in blocks, without equality constraints."""
    if isinstance(problem, Local):
        return _reduce_local(problem)
    return _reduce_global(problem)


def _blocks(
    problem: Local | Global, rows: tuple[Any, ...], q: Vector, equality: Equality | None
) -> Blocks:
    """Return blocks with what every problem has."""
    tangent, rolling = directions(problem)
    mu_r = np.zeros(problem.contacts) if problem.mu_r is None else problem.mu_r
    ptr, col, val = rows
    diagonal, rho = compiled(diagonal_and_units)(ptr, col, val)
    return Blocks(tangent, rolling, ptr, col, val, diagonal, q, problem.mu, mu_r, rho, equality)


def _rows(stored: Matrix) -> tuple[Any, ...]:
    """Return a stored matrix as compressed rows."""
    rows: tuple[Any, ...] = compiled(compressed_rows)(
        stored.m, stored.n, stored.nz, stored.p, stored.i, stored.x
    )
    return rows


def _reduce_local(problem: Local) -> Blocks:
    """Return a local problem in blocks."""
    d, nc = problem.spacedim, problem.contacts
    rows = compiled(block_rows)(d, nc, *_rows(problem.W))
    if problem.V is None or problem.R is None or problem.s is None:
        return _blocks(problem, rows, problem.q, None)
    v = compiled(dense)(problem.V.m, problem.V.n, *_rows(problem.V))
    r = compiled(dense)(problem.R.m, problem.R.n, *_rows(problem.R))
    rows, q, equality = eliminate(d, rows, problem.q, v, r, problem.s)
    return _blocks(problem, rows, q, equality)


def _reduce_global(problem: Global) -> Blocks:
    """Return a global problem in blocks."""
    d, nc = problem.spacedim, problem.contacts
    m, p = problem.H.n, problem.equalities
    (ptr, col, val, free), mass, extra = _condensed(problem)
    q = free[:m] + problem.w
    equality = None
    if p and problem.b is not None:
        ptr, col, val, v, r = compiled(split)(d, nc, extra, ptr, col, val)
        rows, q, equality = eliminate(
            d, (ptr, col, val), q, v[:, :p], r[:p, :p], free[m : m + p] + problem.b
        )
        ptr, col, val = rows
    blocks = _blocks(problem, (ptr, col, val), q, equality)
    blocks.mass = mass
    if p == 0 and nc >= (SEVERAL if problem.mu_r is None else FEW):
        tangent, rolling = directions(problem)
        blocks.rigid = rigid_bodies(
            tangent, rolling, _rows(problem.M), _rows(problem.H), q, blocks.mu, blocks.mu_r
        )
    return blocks


def _condensed(problem: Global) -> tuple[tuple[Any, ...], tuple[Any, ...], int]:
    """Return [H G]' M^-1 [H G] in blocks with [H G]' M^-1 f, factors of M, and G's blocks."""
    d, n, m = problem.spacedim, problem.M.m, problem.H.n
    h = _rows(problem.H)
    if problem.G is not None:
        h = compiled(beside)(n, m, *h, *_rows(problem.G))
    extra = -(-problem.equalities // d)
    done, mass = compiled(condense)(d, problem.contacts + extra, _rows(problem.M), h, problem.f)
    if not done[0]:
        raise ModelError("M is singular: a part of it cannot be factorised")
    return done[1:], mass, extra


def times(a: Matrix, vector: Vector) -> Vector:
    """Return A times a vector, from the entries as they are stored."""
    found = np.zeros(a.m)
    compiled(product_of_stored)(a.m, a.nz, a.p, a.i, a.x, vector, found)
    return found


def transposed_times(a: Matrix, vector: Vector) -> Vector:
    """Return the transpose of A times a vector."""
    found = np.zeros(a.n)
    compiled(transposed_product_of_stored)(a.m, a.nz, a.p, a.i, a.x, vector, found)
    return found


def multipliers(blocks: Blocks, r: Vector) -> Vector | None:
    """Return l (p,) that goes with r, or None without equality constraints."""
    if blocks.equality is None:
        return None
    factors = blocks.equality.factors
    weights = -np.append(r[blocks.equality.rows], 1.0)
    found: Vector = compiled(upper_solution)(factors, len(factors), weights)
    return found


def velocities(problem: Global, blocks: Blocks, r: Vector, l: Vector | None) -> Vector:  # noqa: E741  FCLIB
    """Return v (n,) that goes with r and l: M v = H r + G l + f."""
    forces = problem.f + times(problem.H, r)
    if problem.G is not None and l is not None:
        forces = forces + times(problem.G, l)
    assert blocks.mass is not None
    v = np.empty(len(forces))
    compiled(mass_solve)(blocks.mass, forces, v)
    return v


def local(problem: Global) -> Local:
    """Return the local problem that a global one condenses to; equality constraints are kept."""
    d, m, p = problem.spacedim, problem.H.n, problem.equalities
    (ptr, col, val, free), _, _ = _condensed(problem)
    q = free[:m] + problem.w
    from scipy import sparse

    whole = sparse.bsr_array((val, col, ptr), shape=(len(free), len(free))).tocsr()
    w = matrix(whole[:m, :m])
    if problem.b is None:
        return Local(d, w, q, problem.mu, mu_r=problem.mu_r, info=problem.info)
    v, r = matrix(whole[:m, m : m + p]), matrix(whole[m : m + p, m : m + p])
    s = free[m : m + p] + problem.b
    return Local(d, w, q, problem.mu, v, r, s, problem.mu_r, problem.info)


def globalised(problem: Local) -> Global:
    """Return a global problem with the same u and r: M = W, H = the unit matrix, f = 0.

    It needs a regular W; v is then u - q + w with w = q, that is v = W r + V l.
    """
    m = problem.W.m
    identity = matrix(_unit(m), "triplet")
    if problem.V is not None:
        raise ModelError("a local problem with V, R, s has no global form with its own matrices")
    inverse = np.linalg.inv(problem.W.csr().toarray())
    if not np.isfinite(inverse).all() or np.linalg.cond(inverse) > 1e14:
        raise ModelError("W is singular: the problem has no global form with H = 1")
    return Global(
        problem.spacedim,
        matrix(inverse, "triplet"),
        identity,
        np.zeros(m),
        problem.q,
        problem.mu,
        mu_r=problem.mu_r,
        info=problem.info,
    )


def _unit(size: int) -> Any:
    """Return a sparse unit matrix."""
    from scipy import sparse

    return sparse.eye_array(size)

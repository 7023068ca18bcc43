"""What a frictional contact problem is: matrices as the file stores them, vectors, solutions."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.errors import ModelError

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from scipy.sparse import csr_array

    Vector = NDArray[np.float64]
    Indices = NDArray[np.integer[Any]]
    Flags = NDArray[np.bool_]

#: Values of `Matrix.nz` that are no count of entries.
CSC, CSR = -1, -2


@dataclass(frozen=True, eq=False)
class MatrixInfo:
    """What a file may say of a matrix; libfclib reads it only where `conditioning` is there."""

    comment: str
    conditioning: float
    determinant: float
    rank: int


@dataclass(frozen=True, eq=False)
class Matrix:
    """A sparse matrix exactly as FCLIB stores it.

    Parameters
    ----------
    m, n
        Rows and columns.
    nz
        Number of entries of a triplet matrix; -1: compressed columns; -2: compressed rows.
    nzmax
        Room for entries as the file states it; a triplet file may state more than it holds.
    p, i
        Triplet: **column** and row of each entry (CSparse's order; the comment in fclib.h says
        the opposite, and every real file obeys CSparse). Compressed: pointers (n + 1 or m + 1),
        then rows or columns.
    x
        Values; entries at one place add up.
    info, attributes
        Remarks of the file, kept.
    """

    m: int
    n: int
    nz: int
    nzmax: int
    p: Indices
    i: Indices
    x: Vector
    info: MatrixInfo | None = None
    attributes: dict[str, Any] = field(default_factory=dict)

    @property
    def storage(self) -> str:
        """`triplet`, `csc` or `csr`."""
        return {CSC: "csc", CSR: "csr"}.get(self.nz, "triplet")

    @property
    def entries(self) -> int:
        """Number of stored entries."""
        return self.nz if self.nz >= 0 else int(self.p[-1])

    def csr(self) -> csr_array:
        """Return the matrix as SciPy's compressed rows, entries at one place added up."""
        from scipy import sparse

        shape, count = (self.m, self.n), self.entries
        x, i = self.x[:count], self.i[:count]
        if self.nz == CSR:
            made = sparse.csr_array((x, i, self.p), shape=shape)
        elif self.nz == CSC:
            made = sparse.csc_array((x, i, self.p), shape=shape).tocsr()
        else:
            made = sparse.coo_array((x, (i, self.p[:count])), shape=shape).tocsr()
        if not made.has_canonical_format:
            made = made.copy()  # summing works in place, and the arrays are the file's
            made.sum_duplicates()
        return made

    def _coordinates(self) -> tuple[Indices, Indices, Vector]:
        """Return row, column and value of every stored entry."""
        count = self.entries
        inner, x = self.i[:count], self.x[:count]
        if self.nz >= 0:
            return inner, self.p[:count], x
        outer = np.repeat(np.arange(len(self.p) - 1, dtype=np.int32), np.diff(self.p))
        return (outer, inner, x) if self.nz == CSR else (inner, outer, x)


def length(vector: Vector) -> float:
    """Return the Euclidean norm, as `np.linalg.norm` does, which takes four times as long."""
    return math.sqrt(vector.dot(vector))


def matrix(dense_or_sparse: Any, storage: str = "csr") -> Matrix:
    """Return an array or a SciPy matrix as FCLIB stores it: `csr`, `csc` or `triplet`."""
    from scipy import sparse

    if storage not in ("csr", "csc", "triplet"):
        raise ModelError(f"{storage}: no storage of FCLIB; there are csr, csc, triplet")
    made = sparse.coo_array(dense_or_sparse)
    m, n = made.shape
    if storage == "triplet":
        made.sum_duplicates()
        row, column = made.coords
        p, i, x, nz = column, row, made.data, made.nnz
    else:
        packed = made.tocsr() if storage == "csr" else made.tocsc()
        packed.sort_indices()
        p, i, x = packed.indptr, packed.indices, packed.data
        nz = CSR if storage == "csr" else CSC
    return Matrix(
        int(m),
        int(n),
        nz,
        len(x),
        np.ascontiguousarray(p, dtype=np.int32),
        np.ascontiguousarray(i, dtype=np.int32),
        np.ascontiguousarray(x, dtype=np.float64),
    )


@dataclass(frozen=True, eq=False)
class Info:
    """What a file says of its problem; None where it says nothing, "" where it says that.

    Bytes that are no UTF-8 are kept as surrogate escapes, so that they are written as read.
    """

    title: str | None = None
    description: str | None = None
    math_info: str | None = None
    attributes: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Local:
    """u = W r + V l + q, V' r + R l + s = 0, and Coulomb's law between u and r.

    Parameters
    ----------
    spacedim
        Numbers of a contact, d: 2 or 3; with rolling friction (which no group of a file has) 3
        in the plane (normal, tangent, rolling) or 5.
    W, q
        (m, m) and (m,), m = d times the number of contacts; normal first.
    mu
        (nc,) coefficients of friction.
    V, R, s
        (m, p), (p, p), (p,), all or none: equality constraints.
    mu_r
        (nc,) coefficients of rolling friction, lengths.
    """

    spacedim: int
    W: Matrix
    q: Vector
    mu: Vector
    V: Matrix | None = None
    R: Matrix | None = None
    s: Vector | None = None
    mu_r: Vector | None = None
    info: Info | None = None

    kind = "local"

    def __post_init__(self) -> None:
        m = self.W.m
        _check_contacts(self, m, "W")
        _check_size("q", self.q, m)
        _check_shape("W", self.W, m, m)
        if len({self.V is None, self.R is None, self.s is None}) > 1:
            raise ModelError("V, R and s belong together: all three or none")
        if self.V is not None and self.R is not None and self.s is not None:
            _check_shape("V", self.V, m, self.V.n)
            _check_shape("R", self.R, self.V.n, self.V.n)
            _check_size("s", self.s, self.V.n)

    @property
    def contacts(self) -> int:
        """Number of contacts."""
        return len(self.mu)

    @property
    def equalities(self) -> int:
        """Number of equality constraints."""
        return 0 if self.V is None else self.V.n


@dataclass(frozen=True, eq=False)
class Global:
    """M v = H r + G l + f, G' v + b = 0, u = H' v + w, and Coulomb's law between u and r.

    Parameters
    ----------
    spacedim
        Numbers of a contact, d: 2 or 3; with rolling friction 3 in the plane or 5.
    M, H, f, w
        (n, n), (n, m), (n,), (m,), m = d times the number of contacts; normal first.
    mu
        (nc,) coefficients of friction.
    G, b
        (n, p), (p,), both or none: equality constraints.
    mu_r
        (nc,) coefficients of rolling friction, lengths.
    """

    spacedim: int
    M: Matrix
    H: Matrix
    f: Vector
    w: Vector
    mu: Vector
    G: Matrix | None = None
    b: Vector | None = None
    mu_r: Vector | None = None
    info: Info | None = None

    def __post_init__(self) -> None:
        n, m = self.M.m, self.H.n
        _check_contacts(self, m, "H")
        _check_shape("M", self.M, n, n)
        _check_shape("H", self.H, n, m)
        _check_size("f", self.f, n)
        _check_size("w", self.w, m)
        if (self.G is None) is not (self.b is None):
            raise ModelError("G and b belong together: both or none")
        if self.G is not None and self.b is not None:
            _check_shape("G", self.G, n, self.G.n)
            _check_size("b", self.b, self.G.n)

    @property
    def kind(self) -> str:
        """`global` or `global_rolling`."""
        return "global" if self.mu_r is None else "global_rolling"

    @property
    def contacts(self) -> int:
        """Number of contacts."""
        return len(self.mu)

    @property
    def equalities(self) -> int:
        """Number of equality constraints."""
        return 0 if self.G is None else self.G.n


@dataclass(frozen=True, eq=False)
class Solution:
    """A solution or a guess: u, r (m), v (n) of a global problem, l (p) of equality constraints."""

    u: Vector
    r: Vector
    v: Vector | None = None
    l: Vector | None = None  # noqa: E741  FCLIB's name


@dataclass(frozen=True, eq=False)
class Contents:
    """Everything in one FCLIB file."""

    problem: Local | Global
    solution: Solution | None = None
    guesses: tuple[Solution, ...] = ()


def _check_contacts(problem: Local | Global, rows: int, owner: str) -> None:
    """Refuse a size that does not go with the number of contacts."""
    d = problem.spacedim
    allowed = (2, 3) if problem.mu_r is None else (3, 5)
    if d not in allowed:
        law = "without" if problem.mu_r is None else "with"
        raise ModelError(f"spacedim {d}: {allowed[0]} or {allowed[1]} is allowed {law} mu_r")
    if problem.mu_r is not None:
        _check_size("mu_r", problem.mu_r, len(problem.mu))
    if rows != d * len(problem.mu):
        raise ModelError(
            f"{owner} has {rows} rows for contacts, but mu names {len(problem.mu)} contacts of {d}"
        )
    for name, values in (("mu", problem.mu), ("mu_r", problem.mu_r)):
        if values is not None and not bool(np.all(values >= 0)):
            raise ModelError(f"{name}: a coefficient of friction is negative or no number")


def _check_size(name: str, vector: Vector, size: int) -> None:
    """Refuse a vector of the wrong length or with values that are no numbers."""
    if vector.shape != (size,):
        raise ModelError(f"{name} has shape {vector.shape}, expected ({size},)")
    if not bool(np.isfinite(vector).all()):
        raise ModelError(f"{name} holds values that are no finite numbers")


def _check_shape(name: str, stored: Matrix, rows: int, columns: int) -> None:
    """Refuse a matrix of the wrong size, or whose indices leave it."""
    if (stored.m, stored.n) != (rows, columns):
        raise ModelError(f"{name} is {stored.m} x {stored.n}, expected {rows} x {columns}")
    _check_storage(name, stored)


def _check_storage(name: str, stored: Matrix) -> None:
    """Refuse pointers, indices and lengths that contradict each other."""
    if stored.nz < CSR:
        raise ModelError(f"{name}/nz is {stored.nz}; allowed: -2 (csr), -1 (csc), or a count")
    if stored.nz >= 0:
        count, inner, outer = stored.nz, stored.m, stored.n
        if len(stored.p) != count or len(stored.i) != count or len(stored.x) != count:
            raise ModelError(f"{name}: p, i and x must hold nz = {count} entries each")
        if stored.nzmax < count:
            raise ModelError(f"{name}/nzmax is {stored.nzmax}, below nz = {count}")
        _check_range(f"{name}/p", stored.p, outer)
    else:
        outer, inner = (stored.m, stored.n) if stored.nz == CSR else (stored.n, stored.m)
        if len(stored.p) != outer + 1:
            raise ModelError(f"{name}/p holds {len(stored.p)} pointers, expected {outer + 1}")
        if len(stored.i) != stored.nzmax or len(stored.x) != stored.nzmax:
            raise ModelError(f"{name}: i and x must hold nzmax = {stored.nzmax} entries each")
        if stored.p[0] != 0 or bool((np.diff(stored.p) < 0).any()) or stored.p[-1] > stored.nzmax:
            raise ModelError(f"{name}/p must rise from 0 to at most nzmax = {stored.nzmax}")
        count = int(stored.p[-1])
    _check_range(f"{name}/i", stored.i[:count], inner)
    if not bool(np.isfinite(stored.x[:count]).all()):
        raise ModelError(f"{name}/x holds values that are no finite numbers")


def _check_range(name: str, indices: Indices, limit: int) -> None:
    """Refuse indices below 0 or not below `limit`."""
    if len(indices) and (int(indices.min()) < 0 or int(indices.max()) >= limit):
        raise ModelError(f"{name} holds an index outside 0..{limit - 1}")

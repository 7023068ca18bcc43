"""FCLIB's HDF5 files: read exactly, written so that libfclib reads them, never half-written.

Scalars are data sets of length 1, vectors of rank 1, integers int32, numbers float64, all
contiguous, as libfclib writes them (it reads no other shape). Triplet matrices have the *column*
indices in `p` and the rows in `i` (see `problem.Matrix`), and `p`, `i`, `x` have `nz` entries even
where `nzmax` is larger.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.core.stored import claims_too_much
from mbsim.errors import MbsimError, ModelError, ResultsError
from mbsim.fclib.problem import (
    Contents,
    Global,
    Info,
    Local,
    Matrix,
    MatrixInfo,
    Solution,
)

if TYPE_CHECKING:
    import h5py

    from mbsim.fclib.problem import Vector

#: Kind of a problem -> its group.
GROUPS = {
    "local": "fclib_local",
    "global": "fclib_global",
    "global_rolling": "fclib_global_rolling",
}
#: What h5py raises where a file is damaged, and numpy where a member is not of its form.
_DAMAGE = (OSError, KeyError, ValueError, TypeError, RuntimeError, IndexError, AttributeError)
_TEXTS = ("title", "description", "math_info")


def read(path: str | os.PathLike[str], kind: str | None = None) -> Contents:
    """Return the problem in a file, its solution and its guesses.

    `kind` (`local`, `global`, `global_rolling`) chooses where a file holds several problems.
    Do not trust a stored solution: every real file written by Siconos has r = 0 in it.
    """
    import h5py

    place = Path(path)
    try:
        if not place.is_file():
            raise ModelError(f"{place}: no such file")
        with h5py.File(place, "r") as file:
            return _contents(file, kind)
    except ModelError as error:
        prefix = "" if str(error).startswith(str(place)) else f"{place}: "
        raise ModelError(f"{prefix}{error}") from None
    except (*_DAMAGE, MemoryError) as error:
        raise ModelError(f"{place}: no readable FCLIB file: {_short(error)}") from None


def write(
    path: str | os.PathLike[str],
    problem: Local | Global,
    solution: Solution | None = None,
    guesses: Sequence[Solution] = (),
) -> None:
    """Write a problem with its solution and guesses; the file appears whole or not at all."""
    with _new_file(Path(path)) as file:
        _put_problem(file, problem)
        if solution is not None:
            _put_solution(file.create_group("solution"), problem, solution)
        if guesses:
            _put_guesses(file, problem, guesses)


def append_solution(
    path: str | os.PathLike[str], solution: Solution, *, replace: bool = False
) -> None:
    """Add a solution to a file; everything else in it stays as it is.

    A solution that is there already is an error (libfclib writes nothing then), unless `replace`.
    """
    problem = read(path).problem
    with _new_file(Path(path), keep=True) as file:
        _make_room(file, "solution", replace, path)
        _put_solution(file.create_group("solution"), problem, solution)


def append_guesses(
    path: str | os.PathLike[str], guesses: Sequence[Solution], *, replace: bool = False
) -> None:
    """Add guesses to a file that has none, or put them in the place of those there are."""
    problem = read(path).problem
    with _new_file(Path(path), keep=True) as file:
        _make_room(file, "guesses", replace, path)
        _put_guesses(file, problem, guesses)


def _make_room(file: h5py.File, name: str, replace: bool, path: Any) -> None:
    """Delete a group that is to be replaced; refuse if it is not."""
    if name in file:
        if not replace:
            raise ResultsError(f"{path}: /{name} is there already")
        del file[name]


def _short(error: Exception) -> str:
    """Return the first line of an error's text."""
    return (str(error).splitlines() or [type(error).__name__])[0]


# reading


def _contents(file: h5py.File, kind: str | None) -> Contents:
    """Return what is in an open file."""
    there = [name for name, group in GROUPS.items() if group in file]
    if kind is not None and kind not in GROUPS:
        raise ModelError(f"{kind}: no kind of problem; there are {', '.join(GROUPS)}")
    if not there or (kind is not None and kind not in there):
        wanted = GROUPS.values() if kind is None else [GROUPS[kind]]
        raise ModelError(f"no FCLIB problem: none of /{', /'.join(wanted)} is in the file")
    if len(there) > 1 and kind is None:
        raise ModelError(f"holds several problems ({', '.join(there)}); name the kind")
    chosen = kind or there[0]
    problem = _problem(_group(file, GROUPS[chosen]), chosen)
    solution = _solution(_group(file, "solution"), problem) if "solution" in file else None
    return Contents(problem, solution, _guesses(file, problem))


def _problem(group: h5py.Group, kind: str) -> Local | Global:
    """Return the problem of a group."""
    spacedim = _whole(group, "spacedim")
    vectors = _group(group, "vectors")
    info = _info(_group(group, "info")) if "info" in group else None
    mu = _vector(vectors, "mu")
    if kind == "local":
        return Local(
            spacedim,
            _matrix(group, "W"),
            _vector(vectors, "q"),
            mu,
            _matrix(group, "V") if "V" in group else None,
            _matrix(group, "R") if "R" in group else None,
            _vector(vectors, "s") if "s" in vectors else None,
            info=info,
        )
    return Global(
        spacedim,
        _matrix(group, "M"),
        _matrix(group, "H"),
        _vector(vectors, "f"),
        _vector(vectors, "w"),
        mu,
        _matrix(group, "G") if "G" in group else None,
        _vector(vectors, "b") if "b" in vectors else None,
        _vector(vectors, "mu_r") if kind == "global_rolling" else None,
        info=info,
    )


def _member(group: h5py.Group, name: str) -> Any:
    """Return a member of a group; a clear error if it is missing."""
    if name not in group:
        raise ModelError(f"{group.name}/{name} is missing")
    return group[name]


def _group(parent: h5py.Group, name: str) -> h5py.Group:
    """Return a group in a group: asked what it has, a data set would look through all its rows."""
    found = _member(parent, name)
    if not hasattr(found, "keys"):
        raise ModelError(f"{found.name} is no group")
    return found


def _values(group: h5py.Group, name: str) -> Any:
    """Return what a data set holds, if it can be there."""
    stored = _member(group, name)
    if not hasattr(stored, "shape"):
        raise ModelError(f"{group.name}/{name} is no data set")
    if claims_too_much(stored):
        raise ModelError(f"{group.name}/{name} is said to be larger than what is stored")
    return stored[()]


def _whole(group: h5py.Group, name: str) -> int:
    """Return a whole number, stored as a scalar or with length 1."""
    value = np.asarray(_values(group, name))
    if value.size != 1 or value.dtype.kind not in "iu":
        raise ModelError(f"{group.name}/{name} is no single whole number")
    return int(value.reshape(-1)[0])


def _array(group: h5py.Group, name: str, dtype: Any, kinds: str) -> Any:
    """Return a data set of rank 1 as contiguous numbers."""
    data = _values(group, name)
    if np.ndim(data) != 1 or np.asarray(data).dtype.kind not in kinds:
        raise ModelError(f"{group.name}/{name} is no list of numbers of the right kind")
    return np.ascontiguousarray(data, dtype=dtype)


def _vector(group: h5py.Group, name: str) -> Vector:
    """Return a vector."""
    vector: Vector = _array(group, name, np.float64, "fiu")
    return vector


def _matrix(parent: h5py.Group, name: str) -> Matrix:
    """Return a matrix as it is stored."""
    group = _group(parent, name)
    return Matrix(
        _whole(group, "m"),
        _whole(group, "n"),
        _whole(group, "nz"),
        _whole(group, "nzmax"),
        _array(group, "p", np.int32, "iu"),
        _array(group, "i", np.int32, "iu"),
        _array(group, "x", np.float64, "fiu"),
        _matrix_info(group),
        dict(group.attrs),
    )


def _matrix_info(group: h5py.Group) -> MatrixInfo | None:
    """Return the remarks on a matrix; like libfclib, only where `conditioning` is there."""
    if "conditioning" not in group:
        return None
    return MatrixInfo(
        _text(group, "comment") or "",
        float(np.asarray(_values(group, "conditioning")).reshape(-1)[0]),
        float(np.asarray(_values(group, "determinant")).reshape(-1)[0]),
        _whole(group, "rank"),
    )


def _info(group: h5py.Group) -> Info:
    """Return the remarks on a problem."""
    return Info(**{name: _text(group, name) for name in _TEXTS}, attributes=dict(group.attrs))


def _text(group: h5py.Group, name: str) -> str | None:
    """Return a text, whatever its bytes are."""
    if name not in group:
        return None
    value = _values(group, name)
    if isinstance(value, str):
        return value
    raw = value if isinstance(value, bytes) else bytes(np.asarray(value).reshape(-1)[0])
    return raw.decode("utf-8", "surrogateescape")


def _solution(group: h5py.Group, problem: Local | Global) -> Solution:
    """Return a solution or a guess."""
    v = _vector(group, "v") if "v" in group else None
    multipliers = _vector(group, "l") if "l" in group else None
    solution = Solution(_vector(group, "u"), _vector(group, "r"), v, multipliers)
    _check_solution(problem, solution, group.name)
    return solution


def _check_solution(problem: Local | Global, solution: Solution, place: str) -> None:
    """Refuse a solution whose lengths do not go with the problem."""
    m = problem.spacedim * problem.contacts
    n = problem.M.m if isinstance(problem, Global) else None
    sizes = [("u", solution.u, m), ("r", solution.r, m)]
    sizes += [("v", solution.v, n)] if solution.v is not None and n is not None else []
    sizes += [("l", solution.l, problem.equalities)] if solution.l is not None else []
    for name, vector, size in sizes:
        if vector is None or vector.shape != (size,):
            shape = "nothing" if vector is None else vector.shape
            raise ModelError(f"{place}/{name} has shape {shape}, expected ({size},)")


def _guesses(file: h5py.File, problem: Local | Global) -> tuple[Solution, ...]:
    """Return the guesses, "1" first."""
    if "guesses" not in file:
        return ()
    group = _group(file, "guesses")
    count = _whole(group, "number_of_guesses")
    return tuple(_solution(_group(group, str(k)), problem) for k in range(1, count + 1))


# writing


@contextlib.contextmanager
def _new_file(path: Path, *, keep: bool = False) -> Iterator[h5py.File]:
    """Give a file to write that takes the place of `path` only when it is whole.

    With `keep` it begins as a copy of what is there.
    """
    import h5py

    temporary = None
    try:
        handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".tmp", dir=path.parent)
        os.close(handle)
        temporary = Path(name)
        if keep:
            shutil.copyfile(path, temporary)
        with h5py.File(temporary, "a" if keep else "w", libver="earliest") as file:
            yield file
        with temporary.open("rb") as done:
            os.fsync(done.fileno())
        temporary.chmod(path.stat().st_mode & 0o777 if path.exists() else 0o666 & ~_umask())
        temporary.replace(path)
    except MbsimError:
        raise
    except (OSError, RuntimeError, ValueError) as error:
        number = getattr(error, "errno", None)
        reason = os.strerror(number) if number else _short(error)
        raise ResultsError(f"{path}: cannot be written: {reason}") from None
    finally:
        if temporary is not None:
            temporary.unlink(missing_ok=True)


def _umask() -> int:
    """Return the process' mask of file modes; reading it means setting it."""
    mask = os.umask(0)
    os.umask(mask)
    return mask


def _put_problem(file: h5py.File, problem: Local | Global) -> None:
    """Write the group of a problem, in libfclib's order."""
    if problem.kind == "local" and problem.mu_r is not None:
        raise ModelError("FCLIB has no group for local problems with rolling friction")
    group = file.create_group(GROUPS[problem.kind])
    _put_whole(group, "spacedim", problem.spacedim)
    matrices = ("W", "V", "R") if isinstance(problem, Local) else ("M", "H", "G")
    for name in matrices:
        stored = getattr(problem, name)
        if stored is not None:
            _put_matrix(group.create_group(name), stored)
    vectors = group.create_group("vectors")
    named = ("q", "s", "mu") if isinstance(problem, Local) else ("f", "w", "b", "mu", "mu_r")
    for name in named:
        values = getattr(problem, name)
        if values is not None:
            _put(vectors, name, values, np.float64)
    if problem.info is not None:
        _put_info(group.create_group("info"), problem.info)


def _put(group: h5py.Group, name: str, values: Any, dtype: Any) -> None:
    """Write a data set of rank 1."""
    group.create_dataset(name, data=np.ascontiguousarray(values, dtype=dtype))


def _put_whole(group: h5py.Group, name: str, value: int) -> None:
    """Write a whole number as libfclib does, with length 1."""
    _put(group, name, [value], np.int32)


def _put_text(group: h5py.Group, name: str, text: str) -> None:
    """Write a text as H5LT does: one string of fixed length with its NUL."""
    import h5py

    raw = text.encode("utf-8", "surrogateescape")
    kind = h5py.h5t.C_S1.copy()
    kind.set_size(len(raw) + 1)
    kind.set_strpad(h5py.h5t.STR_NULLTERM)
    space = h5py.h5s.create(h5py.h5s.SCALAR)
    dataset = h5py.h5d.create(group.id, name.encode(), kind, space)
    dataset.write(
        h5py.h5s.ALL, h5py.h5s.ALL, np.array(raw + b"\0", dtype=f"S{len(raw) + 1}"), mtype=kind
    )


def _put_matrix(group: h5py.Group, stored: Matrix) -> None:
    """Write a matrix as it is stored."""
    for name in ("nzmax", "m", "n", "nz"):
        _put_whole(group, name, getattr(stored, name))
    _put(group, "p", stored.p, np.int32)
    _put(group, "i", stored.i, np.int32)
    _put(group, "x", stored.x, np.float64)
    if stored.info is not None:
        _put_text(group, "comment", stored.info.comment)
        _put(group, "conditioning", [stored.info.conditioning], np.float64)
        _put(group, "determinant", [stored.info.determinant], np.float64)
        _put_whole(group, "rank", stored.info.rank)
    _put_attributes(group, stored.attributes)


def _put_info(group: h5py.Group, info: Info) -> None:
    """Write the remarks on a problem."""
    for name in _TEXTS:
        text = getattr(info, name)
        if text is not None:
            _put_text(group, name, text)
    _put_attributes(group, info.attributes)


def _put_attributes(group: h5py.Group, attributes: dict[str, Any]) -> None:
    """Write attributes with the types they were read with."""
    for name, value in attributes.items():
        group.attrs.create(name, value)


def _put_solution(group: h5py.Group, problem: Local | Global, solution: Solution) -> None:
    """Write a solution or a guess; libfclib expects v and l where the problem has them."""
    _check_solution(problem, solution, group.name)
    v = solution.v
    if isinstance(problem, Global) and v is None:
        raise ModelError(f"{group.name}/v is missing: a global problem's solution has v")
    if problem.equalities and solution.l is None:
        raise ModelError(f"{group.name}/l is missing: the problem has equality constraints")
    named = (("v", v), ("u", solution.u), ("r", solution.r), ("l", solution.l))
    for name, values in named:
        if values is not None:
            _put(group, name, values, np.float64)


def _put_guesses(file: h5py.File, problem: Local | Global, guesses: Sequence[Solution]) -> None:
    """Write guesses "1", "2", ..."""
    group = file.create_group("guesses")
    _put_whole(group, "number_of_guesses", len(guesses))
    for number, guess in enumerate(guesses, 1):
        _put_solution(group.create_group(str(number)), problem, guess)

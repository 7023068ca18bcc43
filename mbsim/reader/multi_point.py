"""Force_MultiPoint: linear forces and torques between many markers, by matrices of the deck.

The matrices may stand behind it. So it is put together when all of the deck has been read: the
force on each marker becomes an element of its own, `forces.kinds.multi_point.ROWS` times the id
and the number of the marker, and NFORCE(id, marker, component, k) a sum of those of elements,
which have jflag in the place of the marker.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from mbsim.core.arrays import F1, F2
from mbsim.errors import Fault
from mbsim.expressions.tree import Call, Node, Number
from mbsim.forces.kinds.multi_point import ROWS
from mbsim.model import elements as el
from mbsim.reader.draft import Draft, MultiPointDraft
from mbsim.reader.kinds import COUNT, ID, IDS, NOT_NEGATIVE
from mbsim.reader.rewriting import Rewriting
from mbsim.reader.statement import NAMED, Entry, Spec, Statement

#: Most markers, as Adams has it.
MOST = 350
_KIND = "NFORCE"
_STATEMENT = "Force_MultiPoint"
_MATRICES = ("kmtx_id", "cmtx_id", "preload_mtx_id", "length_mtx_id")
#: Negative parts of a damping matrix, over its diagonal, that are rounding.
_ROUNDING = 1e-12


class _UnfitError(ValueError):
    """A force that cannot be put together; the message says why."""


def _build(entry: Entry) -> None:
    """Keep a force until its markers and matrices are known."""
    ids, count = entry.get("i_marker_ids"), entry.get("n_i_marker")
    if ids is not None and count is not None and len(ids) != count:
        entry.fault(f"{count}, but there are {len(ids)} ids of markers", "n_i_marker")
    if ids is not None and len(ids) > MOST:
        entry.fault(f"there are {len(ids)} markers; {MOST} at most", "i_marker_ids")
    if entry.given("cratio") and entry.given("cmtx_id"):
        entry.fault(
            "goes without cmtx_id: it makes the damping matrix of that of stiffness", "cratio"
        )
    force = MultiPointDraft(
        id=entry.get("id", 0),
        marker_ids=ids or (),
        ref_marker_id=entry.get("ref_marker_id", 0),
        matrices={name: entry.get(name) for name in _MATRICES},
        cratio=entry.get("cratio"),
        label=entry.get("label", ""),
        source=entry.source,
    )
    entry.register("multi_points", force)


FORCE_MULTI_POINT = Statement(
    _STATEMENT,
    {
        **NAMED,
        "ref_marker_id": Spec(
            ID, "marker J: along its axes all is, and its body takes the opposite", required=True
        ),
        "kmtx_id": Spec(ID, "stiffness, 6 N x 6 N", required=True),
        "cmtx_id": Spec(ID, "damping, 6 N x 6 N", "", "none"),
        "cratio": Spec(NOT_NEGATIVE, "damping matrix over stiffness matrix", "T", "0"),
        "preload_mtx_id": Spec(ID, "forces and torques at the lengths, 6 N x 1", "", "zeros"),
        "length_mtx_id": Spec(ID, "displacements without load, 3 N or 6 N x 1", "", "zeros"),
        "n_i_marker": Spec(COUNT, "number N of I markers", "", "as many as are given"),
        "i_marker_ids": Spec(IDS, "the I markers; text of the element too", required=True),
    },
    _build,
    text="i_marker_ids",
    about="linear forces and torques between many markers",
)


def expand(draft: Draft) -> list[Fault]:
    """Put the forces of several markers together, and return what is wrong with them."""
    faults = []
    known = {}
    for force in draft.multi_points.values():
        name = f"{_STATEMENT}[{force.id}]"
        if (_STATEMENT, force.id) in draft.broken:
            continue
        try:
            rows = list(_rows(force, draft))
        except _UnfitError as unfit:
            draft.broken.add((_STATEMENT, force.id))
            faults.append(Fault(force.source.file, force.source.line, name, str(unfit)))
            continue
        known[force.id] = force
        table = draft.marker_forces.setdefault(_KIND, {})
        table.update((row.id, row) for row in rows)
    _switch(draft, known)
    rewriting = _Rewriting(known, draft)
    rewriting.rewrite()
    return faults + rewriting.faults


def _switch(draft: Draft, known: dict[int, MultiPointDraft]) -> None:
    """Let simulations switch off the rows of a force that Deactivate names."""
    for k, simulation in enumerate(draft.simulations):
        inactive: list[tuple[str, int]] = []
        for table, id in simulation.inactive:
            if table == _KIND and id in known:
                many = range(1, len(known[id].marker_ids) + 1)
                inactive += ((table, ROWS * id + place) for place in many)
            else:
                inactive.append((table, id))
        draft.simulations[k] = replace(simulation, inactive=tuple(sorted(inactive)))


def _rows(force: MultiPointDraft, draft: Draft) -> Iterator[el.MarkerForce]:
    """Yield the force on each marker as an element."""
    for what, id in (
        *(("ref_marker_id", id) for id in (force.ref_marker_id,)),
        *(("i_marker_ids", id) for id in force.marker_ids),
    ):
        if id not in draft.markers and ("Reference_Marker", id) not in draft.broken:
            raise _UnfitError(f'{what}="{id}": there is no Reference_Marker {id}')
    if force.ref_marker_id in force.marker_ids:
        raise _UnfitError(f"marker {force.ref_marker_id} is ref_marker_id and an I marker")
    n = len(force.marker_ids)
    K = _square(force, "kmtx_id", draft)
    C = _square(force, "cmtx_id", draft) if force.matrices["cmtx_id"] else (force.cratio or 0.0) * K
    _look_at(force, K, C, draft)
    preload, lengths = (
        _column(force, "preload_mtx_id", draft),
        _column(force, "length_mtx_id", draft),
    )
    half, curl = 0.5 * (K + K.T), 0.5 * (K - K.T)
    for k, marker in enumerate(force.marker_ids):
        own = slice(6 * k, 6 * k + 6)
        strips = (each[own].ravel() for each in (half, curl, C))
        numbers: F1 = np.concatenate([[n], np.zeros(n), lengths, preload[own], *strips])
        yield el.MarkerForce(
            id=ROWS * force.id + k + 1,
            kind=_KIND,
            label=force.label or f"{_STATEMENT} {force.id} on marker {marker}",
            i_marker_id=marker,
            j_marker_id=force.ref_marker_id,
            parameters=(("place", k), ("constants", tuple(numbers.tolist()))),
            source=force.source,
        )


def _matrix(force: MultiPointDraft, name: str, draft: Draft) -> F2:
    """Return a matrix of the deck."""
    id = force.matrices[name]
    matrix = draft.control.matrices.get(id or 0)
    if matrix is None:
        raise _UnfitError(f'{name}="{id}": there is no Reference_Matrix {id}, or it has a fault')
    found: F2 = matrix.values
    return found


def _square(force: MultiPointDraft, name: str, draft: Draft) -> F2:
    """Return stiffness or damping, (6 n, 6 n)."""
    found, size = _matrix(force, name, draft), 6 * len(force.marker_ids)
    if found.shape != (size, size):
        shape = " x ".join(map(str, found.shape))
        raise _UnfitError(
            f'{name}="{force.matrices[name]}": is {shape}, must be {size} x {size}: six rows and '
            f"columns for each of {len(force.marker_ids)} markers"
        )
    return found


def _column(force: MultiPointDraft, name: str, draft: Draft) -> F1:
    """Return preload or lengths, (6 n,); of lengths the angles may be left out."""
    n = len(force.marker_ids)
    if not force.matrices[name]:
        return np.zeros(6 * n)
    found = _matrix(force, name, draft)
    sizes = (6 * n, 3 * n) if name == "length_mtx_id" else (6 * n,)
    if found.size not in sizes or 1 not in found.shape:
        shape, wanted = (
            " x ".join(map(str, found.shape)),
            " or ".join(f"{size} x 1" for size in sizes),
        )
        raise _UnfitError(f'{name}="{force.matrices[name]}": is {shape}, must be {wanted}')
    if found.size == 6 * n:
        return found.ravel()
    return np.hstack([found.reshape(n, 3), np.zeros((n, 3))]).ravel()


def _look_at(force: MultiPointDraft, K: F2, C: F2, draft: Draft) -> None:
    """Warn of what a physical element would not have."""
    name, line = f"{_STATEMENT}[{force.id}]", force.source.line
    if not np.array_equal(K, K.T):
        draft.warn(line, name, "kmtx_id: K is not symmetric: what it does depends on the way taken")
    size = np.sqrt(np.abs(np.diag(C)))
    size[size == 0.0] = 1.0
    if np.linalg.eigvalsh(0.5 * (C + C.T) / np.outer(size, size))[0] < -_ROUNDING * len(C):
        what = "damping feeds energy to some velocities (not positive semidefinite)"
        draft.warn(line, name, f"{'cmtx_id' if force.cratio is None else 'cratio'}: {what}")


class _Rewriting(Rewriting):
    """Puts functions of single markers in the place of NFORCE."""

    def __init__(self, known: dict[int, MultiPointDraft], draft: Draft) -> None:
        super().__init__(draft)
        self.known = known

    def call(self, node: Call) -> Node | None:
        """Return what NFORCE(id, marker, component, k) means."""
        if node.name != _KIND:
            return None
        id, marker, comp, *axes = (int(arg.value) for arg in node.args if isinstance(arg, Number))
        force = self.known.get(id)
        if force is None:
            if (_STATEMENT, id) not in self.draft.broken:
                self.fault(_STATEMENT, id, f"{_KIND}({id}, ...): there is no {_STATEMENT} {id}")
            return Number(0.0)
        if marker == force.ref_marker_id:
            return _on_j(node, force, comp, axes)
        if marker not in force.marker_ids:
            ids = ", ".join(map(str, (*force.marker_ids[:12], force.ref_marker_id)))
            said = f"{_KIND}({id}, {marker}, ...): marker {marker} is none of its own: {ids}"
            self.fault(_STATEMENT, id, said)
            return Number(0.0)
        return _of_row(node, force, force.marker_ids.index(marker), 0, comp, axes)


def _of_row(
    node: Call, force: MultiPointDraft, place: int, jflag: int, comp: int, axes: list[int]
) -> Node:
    """Return a component of the force of one row on its marker, or with jflag 1 on J."""
    values = (ROWS * force.id + place + 1, jflag, comp, *(axes or [0]))
    return Call(_KIND, tuple(Number(float(value)) for value in values), node.column)


def _on_j(node: Call, force: MultiPointDraft, comp: int, axes: list[int]) -> Node:
    """Return a component of what acts on J, about its origin."""
    if comp in (1, 5):
        squares: list[Node] = []
        for axis in range(comp + 1, comp + 4):
            part = _on_j(node, force, axis, axes)
            squares.append(Call("MUL", (part, part), node.column))
        total: Any = squares[0]
        for square in squares[1:]:
            total = Call("ADD", (total, square), node.column)
        return Call("SQRT", (total,), node.column)
    parts = [_of_row(node, force, k, 1, comp, axes) for k in range(len(force.marker_ids))]
    found = parts[0]
    for part in parts[1:]:
        found = Call("ADD", (found, part), node.column)
    return found

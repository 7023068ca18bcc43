"""Linear control systems of a deck, x' = A x + B u and y = C x + D u, as states and expressions.

Control_SISO and Control_StateEqn name arrays of states, inputs and outputs, and these may stand
behind them in the deck. So they are put together when all of it has been read: each state becomes
a Control_Diff, each input is the VARVAL of its variable, and ARYVAL(id, n) of one of the arrays is
replaced in every expression by what it means. Nothing of them is left for the compiled loop:
slopes, linearisation, statics and results of such states are those of Control_Diff.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from mbsim.errors import Fault
from mbsim.expressions.tree import Call, Expression, Node, Number, UserResult
from mbsim.model import elements as el
from mbsim.model.source import Source, StateSubroutine, Subroutine
from mbsim.reader.rewriting import Rewriting

if TYPE_CHECKING:
    from mbsim.reader.draft import Draft

_SIZES = (("A", "x", "x"), ("B", "x", "u"), ("C", "y", "x"), ("D", "y", "u"))
_LARGEST_SCALE = 1e30


@dataclass(frozen=True)
class ControlArray:
    """Reference_Array of type X, Y or U; `size` None where the deck gives none."""

    id: int
    type: str
    size: int | None = None
    variable_ids: tuple[int, ...] = ()  # of type U
    source: Source = Source()


@dataclass(frozen=True)
class Matrix:
    """Reference_Matrix: `values` (rows, columns)."""

    id: int
    values: np.ndarray
    source: Source = Source()


@dataclass(frozen=True)
class LinearSystem:
    """One control system: ids of its arrays, and A, B, C and D or the ids of those matrices.

    `scales` are the sizes of the states by which their error is judged, of all states or none.
    """

    id: int
    statement: str
    arrays: dict[str, int | None]  # of x, u and y
    matrices: dict[str, np.ndarray | int]  # of A, B, C and D those that are there
    label: str = ""
    ic_id: int | None = None
    scales: tuple[float, ...] = ()
    counts: Mapping[str, int | None] = field(default_factory=dict)  # of x and y, as the deck says
    is_static_hold: bool = False
    user: Subroutine | None = None  # that gives it in place of matrices
    source: Source = Source()


@dataclass
class ControlDraft:
    """Control arrays and matrices by id, and the systems in the order of the deck."""

    arrays: dict[int, ControlArray] = field(default_factory=dict)
    matrices: dict[int, Matrix] = field(default_factory=dict)
    systems: dict[str, dict[int, LinearSystem]] = field(default_factory=dict)  # by statement


class _UnfitError(ValueError):
    """A system that cannot be put together; the message says why."""


def realise(
    numerator: Sequence[float], denominator: Sequence[float]
) -> tuple[dict[str, np.ndarray], tuple[float, ...]]:
    """Return matrices and sizes of the states of a transfer function.

    Parameters
    ----------
    numerator, denominator : sequence of float
        Coefficients of s^0, s^1 and so on; the denominator's last one is not 0, and the numerator
        has no more of them.

    Returns
    -------
    matrices : dict of str to ndarray
        A (n, n), B (n, 1), C (1, n) and D (1, 1) in observable canonical form: x1 is y - D u, so
        that the first state has the size of the output whatever the coefficients are.
    scales : tuple of float
        w^k for k = 0 ... n-1, w the largest of |a_(n-k)/a_n|^(1/k), at most twice of which the
        fastest pole is (Fujiwara's bound): the size of each state at an output of 1.

    Notes
    -----
    Kailath, Linear Systems (1980), 2.1.
    """
    n = len(denominator) - 1
    a = np.array(denominator, dtype=np.float64) / denominator[-1]
    b = np.zeros(n + 1)
    b[: len(numerator)] = np.array(numerator, dtype=np.float64) / denominator[-1]
    gain = b[n]
    matrices = {
        "A": np.eye(n, k=1),
        "B": (b[:n] - a[:n] * gain)[::-1].reshape(n, 1),
        "C": np.eye(1, n),
        "D": np.array([[gain]]),
    }
    if n:
        matrices["A"][:, 0] -= a[:n][::-1]
    rate = max((abs(a[n - k]) ** (1.0 / k) for k in range(1, n + 1)), default=0.0) or 1.0
    return matrices, tuple(min(rate**k, _LARGEST_SCALE) for k in range(n))


def expand(draft: Draft) -> list[Fault]:
    """Put the control systems of a draft together, and return what is wrong with them."""
    control = draft.control
    if not (control.arrays or control.systems):
        return []
    meanings: dict[int, list[Node]] = {}
    faults: list[Fault] = []
    for system in (each for table in control.systems.values() for each in table.values()):
        try:
            for id, values in _expanded(system, draft):
                if id in meanings:
                    raise _UnfitError(f"array {id} belongs to another control statement already")
                meanings[id] = values
        except _UnfitError as unfit:
            draft.broken |= {("Reference_Array", id) for id in system.arrays.values() if id}
            name = f"{system.statement}[{system.id}]"
            faults.append(Fault(system.source.file, system.source.line, name, str(unfit)))
    for array in control.arrays.values():
        if array.type == "U":
            meanings.setdefault(array.id, [_call("VARVAL", id) for id in array.variable_ids])
    put_in = _PutIn(meanings, draft)
    put_in.rewrite()
    return faults + put_in.faults


def _expanded(system: LinearSystem, draft: Draft) -> Iterator[tuple[int, list[Node]]]:
    """Add the states of a system to the draft; yield what the elements of x and y mean."""
    inputs = _inputs(system, draft)
    found = {name: _matrix(system, name, draft) for name in system.matrices}
    if system.user is not None:
        n, outputs = system.counts["x"] or 0, system.counts["y"] or 0
    else:
        n = found["A"].shape[0] if "A" in found else 0
        outputs = max((found[name].shape[0] for name in "CD" if name in found), default=0)
    sizes = {"x": n, "u": len(inputs), "y": outputs}
    for name, rows, columns in _SIZES:
        wanted = (sizes[rows], sizes[columns])
        if name in found and found[name].shape != wanted:
            shape = " x ".join(map(str, found[name].shape))
            many = ", ".join(f"{size} {what}" for what, size in sizes.items())
            raise _UnfitError(
                f"{name} is {shape}, must be {wanted[0]} x {wanted[1]}: there are {many}"
            )
    for what in ("x", "y"):
        _check_array(system, what, sizes[what], draft)
        if system.counts.get(what) not in (None, sizes[what]):
            raise _UnfitError(f"says {system.counts[what]} {what}; its matrices have {sizes[what]}")
    if system.scales and len(system.scales) != n:
        raise _UnfitError(f"has {len(system.scales)} scales for {n} states")
    starts = _starts(system, n, draft)
    first = max(draft.differentials, default=0) + 1
    states: list[Node] = [_call("DIF", first + k) for k in range(n)]
    given = _by_user(system, n + outputs)
    for k in range(n):
        slope = given[k] if given else _sum(found, "AB", k, states, inputs)
        draft.differentials[first + k] = el.Differential(
            id=first + k,
            expr=Expression(f"{system.statement} {system.id}: slope of state {k + 1}", slope),
            ic=starts[k],
            scale=system.scales[k] if system.scales else 1.0,
            is_static_hold=system.is_static_hold,
            user=_user(system, first, n, outputs, draft) if k == 0 else None,
            label=f"{system.label or system.statement} {system.id} x{k + 1}",
            source=system.source,
        )
    if x := system.arrays.get("x"):
        yield x, states
    if y := system.arrays.get("y"):
        yield y, given[n:] or [_sum(found, "CD", k, states, inputs) for k in range(outputs)]


def _by_user(system: LinearSystem, count: int) -> list[Node]:
    """Return what a subroutine gives, slopes and then outputs; nothing where there is none."""
    if system.user is None:
        return []
    return [UserResult("GSE", system.id, k) for k in range(count)]


def _user(
    system: LinearSystem, first: int, n: int, outputs: int, draft: Draft
) -> StateSubroutine | None:
    """Return the subroutine of a system, which the first of its states keeps."""
    if system.user is None:
        return None
    array = draft.control.arrays.get(system.arrays.get("u") or 0)
    return StateSubroutine(
        **vars(system.user),
        element_id=system.id,
        state_ids=tuple(range(first, first + n)),
        input_ids=array.variable_ids if array else (),
        outputs=outputs,
    )


def _inputs(system: LinearSystem, draft: Draft) -> list[Node]:
    """Return the inputs of a system."""
    id = system.arrays.get("u")
    if id is None:
        return []
    array = _check_array(system, "u", None, draft)
    for variable in array.variable_ids:
        if variable not in draft.variables and ("Reference_Variable", variable) not in draft.broken:
            raise _UnfitError(f"array {id} names Reference_Variable {variable}; there is none")
    return [_call("VARVAL", variable) for variable in array.variable_ids]


def _check_array(system: LinearSystem, what: str, size: int | None, draft: Draft) -> ControlArray:
    """Return the array of x, u or y, refused where it is not there or of another type or size."""
    id = system.arrays.get(what)
    if id is None:
        return ControlArray(0, what.upper())
    array = draft.control.arrays.get(id)
    if array is None:
        other = "is of type IC" if id in draft.arrays else "is not in the deck"
        raise _UnfitError(f"array {id} of its {what} {other}")
    if array.type != what.upper():
        raise _UnfitError(f"array {id} of its {what} is of type {array.type}")
    if size is not None and array.size not in (None, size):
        raise _UnfitError(f"array {id} has {array.size} elements; there are {size} {what}")
    return array


def _matrix(system: LinearSystem, name: str, draft: Draft) -> np.ndarray:
    """Return a matrix of a system."""
    given = system.matrices[name]
    if isinstance(given, np.ndarray):
        return given
    matrix = draft.control.matrices.get(given)
    if matrix is None:
        raise _UnfitError(f"{name}: matrix {given} is not in the deck, or has a fault of its own")
    return matrix.values


def _starts(system: LinearSystem, n: int, draft: Draft) -> tuple[float, ...]:
    """Return the states at the start."""
    if system.ic_id is None:
        return (0.0,) * n
    array = draft.arrays.get(system.ic_id)
    if array is None:
        raise _UnfitError(f"array {system.ic_id} of type IC is not in the deck")
    if len(array.values) != n:
        raise _UnfitError(f"array {array.id} has {len(array.values)} numbers for {n} states")
    return array.values


def _call(name: str, id: int) -> Call:
    return Call(name, (Number(float(id)),), 1)


def _sum(
    found: dict[str, np.ndarray], names: str, row: int, states: list[Node], inputs: list[Node]
) -> Node:
    """Return row `row` of the matrices `names` times states and inputs; what is 0 has no term."""
    terms: list[Node] = []
    for name, values in zip(names, (states, inputs), strict=True):
        for factor, value in zip(found[name][row] if name in found else (), values, strict=False):
            if factor == 1.0:
                terms.append(value)
            elif factor != 0.0:
                terms.append(Call("MUL", (Number(float(factor)), value), 1))
    while len(terms) > 1:  # in pairs, so that long sums are not deep
        pairs: list[Node] = [
            Call("ADD", pair, 1) for pair in zip(terms[::2], terms[1::2], strict=False)
        ]
        terms = pairs + terms[2 * len(pairs) :]
    return terms[0] if terms else Number(0.0)


class _PutIn(Rewriting):
    """Replaces ARYVAL of control arrays in all expressions that something holds."""

    def __init__(self, meanings: dict[int, list[Node]], draft: Draft) -> None:
        super().__init__(draft)
        self.meanings = meanings
        self.types = {id: array.type for id, array in draft.control.arrays.items()}
        self.broken = {id for name, id in draft.broken if name == "Reference_Array"}

    def call(self, node: Call) -> Node | None:
        """Return what an element of a control array means."""
        ids = [int(arg.value) for arg in node.args if isinstance(arg, Number)]
        if node.name != "ARYVAL" or len(ids) != 2 or ids[0] not in self.types:
            return None
        id, place = ids
        values = self.meanings.get(id)
        if values is not None and 1 <= place <= len(values):
            return values[place - 1]
        if id not in self.broken:
            what = (
                f"has {len(values)} elements"
                if values is not None
                else (f"is of type {self.types[id]} and belongs to no control statement")
            )
            self.fault("Reference_Array", id, f"ARYVAL({id}, {place}): array {id} {what}")
        return Number(0.0)

"""Applied forces as rows: what acts, where, and by which formula, form by form."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from typing import Any, NamedTuple

import numpy as np

from mbsim.arrays import codes
from mbsim.arrays.codes import OF_ELEMENT
from mbsim.arrays.model import Applied
from mbsim.compile_model.markers import MarkerTable
from mbsim.compile_model.programs import ProgramTable
from mbsim.forces.catalog import (
    FORCES,
    Acts,
    Components,
    Expressed,
    ForceKind,
    Form,
    MultiPoint,
    OfReactions,
    OfResidual,
    Scalar,
    Switched,
    Values,
    Wrench,
)
from mbsim.laws.catalog import FRICTION_LAWS, NORMAL_LAWS
from mbsim.laws.constants import friction_parameters, normal_constants
from mbsim.model.elements import MarkerForce, Model

Array = np.ndarray[Any, Any]
_NONE = np.zeros(0)


class _Rows(NamedTuple):
    """What is filled, and what that takes."""

    model: Model
    markers: MarkerTable
    programs: ProgramTable
    made: Applied


def applied_forces(
    model: Model, markers: MarkerTable, programs: ProgramTable, laws: bool = True
) -> tuple[Applied, list[tuple[str, int]]]:
    """Return the forces between markers, and for each row its element: (kind, id).

    Without `laws` formulas and laws are left out, which would be compiled.
    """
    given = [(FORCES[name], element) for name in FORCES for element in model.table(name).values()]
    n = len(given)
    constants = [_constants(kind, element) for kind, element in given]
    found = [_law(kind, element) if laws else (0, _NONE) for kind, element in given]
    made = Applied(
        form=np.zeros(n, dtype=np.int64),
        with_reactions=np.zeros(n, dtype=np.int64),
        i=np.zeros(n, dtype=np.int64),
        j=np.zeros(n, dtype=np.int64),
        formula=np.zeros(n, dtype=np.int64),
        par=np.zeros((n, max([1, *map(len, constants)]))),
        bound=np.zeros((n, codes.BOUNDS)),
        keeps=np.zeros(n, dtype=np.int64),
        program=np.full(n, -1, dtype=np.int64),
        components=np.full((n, 6), -1, dtype=np.int64),
        axes=np.zeros(n, dtype=np.int64),
        angle=np.full(n, -1, dtype=np.int64),
        alone=np.zeros(n, dtype=np.int64),
        law=np.array([address for address, _ in found], dtype=np.int64),
        law_par=np.zeros((n, max([1, *(len(values) for _, values in found)]))),
        slopes=np.zeros(n, dtype=np.int64),
        id=np.array([element.id for _, element in given], dtype=np.int64),
        connection=np.full(n, -1, dtype=np.int64),
        equation=np.full(n, -1, dtype=np.int64),
        by_reactions=np.zeros((0, 3), dtype=np.int64),
    )
    to = _Rows(model, markers, programs, made)
    for k, (kind, element) in enumerate(given):
        made.par[k, : len(constants[k])] = constants[k]
        made.law_par[k, : len(found[k][1])] = found[k][1]
        made.i[k], made.j[k] = _ends(model, markers, element)
        made.axes[k] = made.j[k]
        if laws and len(constants[k]) > 0 and isinstance(kind.form, (Scalar, Switched, Wrench)):
            made.formula[k] = _formula(kind, constants[k])
        _FILL[type(kind.form)](to, k, kind.form, element)
    return made, [(kind.name, element.id) for kind, element in given]


def _values(element: Any) -> Values:
    """Return the attributes of an element by name."""
    if isinstance(element, MarkerForce):
        return element.values
    return {each.name: getattr(element, each.name) for each in fields(element)}


def _constants(kind: ForceKind, element: Any) -> Array:
    """Return what the formula of an element takes, shape (n,)."""
    if isinstance(kind.form, (Scalar, Switched, Wrench)):
        return np.array(kind.form.constants(_values(element)), dtype=np.float64)
    if isinstance(kind.form, (OfReactions, MultiPoint)):
        return np.array(element.constants, dtype=np.float64)
    return _NONE


def _formula(kind: ForceKind, constants: Array) -> int:
    """Return the address of the formula of a kind."""
    from mbsim.forces.abi import formula_address  # what only a run needs

    return formula_address(kind.name, len(constants))


def _law(kind: ForceKind, element: Any) -> tuple[int, Array]:
    """Return address and parameters of the law of an element; address 0 where it has none."""
    name = getattr(element, getattr(kind.form, "law", "") or "id")
    if isinstance(kind.form, Switched) and kind.form.law:
        from mbsim.laws import abi  # what only a run needs

        normal = NORMAL_LAWS[name]
        return abi.normal_address(normal), normal_constants(normal, element)
    if isinstance(kind.form, OfReactions) and name in FRICTION_LAWS:
        from mbsim.laws import abi

        friction = FRICTION_LAWS[name]
        return abi.friction_address(friction), friction_parameters(friction, element)
    return 0, _NONE


def _ends(model: Model, markers: MarkerTable, element: Any) -> tuple[int, int]:
    """Return the rows of an element's markers, or of its joint's."""
    joint = getattr(element, "joint_id", None)
    between = element if joint is None else model.joints[joint]
    j = "j_marker_id" if hasattr(between, "j_marker_id") else "j_floating_marker_id"
    return markers.row(between.i_marker_id), markers.row(getattr(between, j))


def _act_as(to: _Rows, k: int, acts: Acts) -> None:
    """Let row k act where a scalar force does."""
    to.made.form[k] = acts.form
    to.made.axes[k] = to.markers.turned(int(to.made.j[k]), acts.axis)
    if acts.turns:
        i = to.markers.turned(int(to.made.i[k]), acts.axis)
        to.made.angle[k] = to.markers.angle(i, int(to.made.axes[k]))


def _fill_scalar(to: _Rows, k: int, form: Scalar | Switched, element: Any) -> None:
    """Fill row k with a force by one displacement and its rate."""
    _act_as(to, k, form.acts(_values(element)))
    if form.bounds is not None:
        bounds = form.bounds(to.made.par[k])
        to.made.bound[k] = (*bounds[: codes.REST], *bounds.rest)
    to.made.keeps[k] = int(isinstance(form, Switched) and form.commit is not None)


def _fill_expressed(to: _Rows, k: int, form: Expressed, element: Any) -> None:
    """Fill row k with a force by an expression."""
    to.made.program[k] = to.programs.add(element.expr, element, forces=True)
    to.made.alone[k] = int(form.alone(_values(element)))
    _act_as(to, k, form.acts(_values(element)))


def _fill_wrench(to: _Rows, k: int, form: Wrench, element: Any) -> None:
    """Fill row k with a wrench."""
    to.made.form[k] = codes.WRENCH
    bounds = form.bounds(form.constants(_values(element)))
    to.made.bound[k] = (*bounds[: codes.REST], *bounds.rest)


def _fill_components(to: _Rows, k: int, form: Components, element: Any) -> None:
    """Fill row k with a vector force by expressions."""
    to.made.form[k] = codes.VECTOR_FORCE
    to.made.alone[k] = int(form.alone)
    to.made.axes[k] = to.markers.row(element.ref_marker_id)
    for c, expression in enumerate(element.exprs):
        if expression is not None:
            to.made.components[k, c] = to.programs.add(expression, element, forces=True)


def _fill_multi_point(to: _Rows, k: int, form: MultiPoint, element: Any) -> None:
    """Fill row k with the force on one of several markers; see `link_points`."""
    to.made.form[k] = codes.MULTI_POINT


def link_points(model: Model, applied: Applied, elements: list[tuple[str, int]]) -> None:
    """Let the rows of forces of several markers know each other, now that they are in order."""
    for k in np.flatnonzero(applied.form == codes.MULTI_POINT):
        kind, id = elements[k]
        first = id - model.table(kind)[id].place
        n = int(applied.par[k, codes.POINTS])
        for b in range(n):
            applied.par[k, codes.OF_POINTS + b] = elements.index((kind, first + b))


def _fill_friction(to: _Rows, k: int, form: OfReactions, element: Any) -> None:
    """Fill row k with what follows from the reactions of a joint."""
    to.made.form[k] = form.forms[to.model.joints[element.joint_id].type]
    to.made.with_reactions[k] = 1
    # joints are the first connections, in the order of the model
    to.made.connection[k] = list(to.model.joints).index(element.joint_id)


def _fill_residual(to: _Rows, k: int, form: OfResidual, element: Any) -> None:
    """Fill row k with an element of a user's residual."""
    from mbsim.compile_model.force_elements import force_program

    to.made.form[k] = codes.RESIDUAL
    to.made.par[k, OF_ELEMENT] = list(to.model.force_elements).index(element.id)
    for at, direction in enumerate(element.directions):
        c = 3 * "TR".index(direction[0]) + "XYZ".index(direction[1])
        to.made.components[k, c] = force_program(to.programs, element.id, at)


#: What fills a row, by form.
_FILL: dict[type[Form], Callable[..., None]] = {
    Scalar: _fill_scalar,
    Expressed: _fill_expressed,
    Wrench: _fill_wrench,
    Components: _fill_components,
    MultiPoint: _fill_multi_point,
    OfReactions: _fill_friction,
    Switched: _fill_scalar,
    OfResidual: _fill_residual,
}

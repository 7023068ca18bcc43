"""User subroutines of forces, variables, states, sensors, motions and requests, in their order."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from enum import Enum
from typing import Any, NamedTuple

from mbsim.forces.catalog import Components, Expressed, of_form
from mbsim.model.elements import Model
from mbsim.model.source import RelationSubroutine, StateSubroutine, Subroutine


class Call(Enum):
    """How a subroutine is called: the names of its arguments."""

    FORCE = "id, time, par, npar, dflag, iflag"
    PLAIN = "id, time, par, npar, iflag"
    MOTION = "id, time, par, npar, iord, iflag"
    STATES = "id, time, par, npar, dflag, iflag, nstate, states, ninput, input, noutput"
    RELATION = "id, time, par, npar, disp, ndisp, iflag"


#: Numbers that a REQSUB returns.
RESULTS = 8
#: What MOTSUB is asked for by `val_type`: displacement, velocity, acceleration are 0, 1, 2.
ORDERS = {"D": (0, 1, 2), "V": (1, 2), "A": (2,)}


class Wanted(NamedTuple):
    """A subroutine of an element.

    Attributes
    ----------
    kind : str
        Of `forces.catalog`, or VARIABLE, DIFF, GSE, SENSOR, SENVAL (what a sensor evaluates),
        MOTION, COUPLER, REQUEST: with the id what `expressions.tree.UserResult` names.
    statement : str
        The XML's name of the statement.
    id : int
    user : Subroutine
    results : int
        How many numbers it gives: of a motion value, rate and second rate.
    call : Call
    orders : tuple of int
        Of a motion: iord of the calls for these.
    """

    kind: str
    statement: str
    id: int
    user: Subroutine
    results: int = 1
    call: Call = Call.FORCE
    orders: tuple[int, ...] = ()


def asking(each: Wanted) -> tuple[Any, ...]:
    """Return what stands behind id, time, par, npar in the one call with iflag 1."""
    if isinstance(each.user, StateSubroutine):
        n, m = len(each.user.state_ids), len(each.user.input_ids)
        return (0, 1, n, [0.0] * n, m, [0.0] * m, each.user.outputs)
    if isinstance(each.user, RelationSubroutine):
        return ([0.0] * each.results, 1)
    return {Call.FORCE: (0, 1), Call.PLAIN: (1,), Call.MOTION: (*each.orders[:1], 1)}[each.call]


def calls(each: Wanted) -> tuple[tuple[int, ...], ...]:
    """Return what stands behind id, time, par, npar in the calls for numbers."""
    if each.call is Call.MOTION:
        return tuple((iord, 0) for iord in each.orders)
    return ((0,),) if each.call in (Call.PLAIN, Call.RELATION) else ((0, 0),)


def of_contacts(model: Model) -> Iterator[tuple[str, str, Subroutine]]:
    """Yield the subroutines of contacts: the element, the prefix of their attributes."""
    for contact in model.contacts.values():
        for prefix, user in (("cff", contact.cff), ("cnf", contact.cnf), ("cpost", contact.cpost)):
            if user is not None:
                yield f"Force_Contact[{contact.id}]", prefix, user


def wanted(model: Model) -> list[Wanted]:
    """Return all user subroutines that stand in place of expressions."""
    return list(_wanted(model))


def _wanted(model: Model) -> Iterator[Wanted]:
    """Yield them: forces, variables, then what came later."""
    for kind in of_form(Expressed):
        for force in _with_users(model.table(kind.name)):
            yield Wanted(kind.name, kind.statement, force.id, force.user)
    for variable in _with_users(model.variables):
        yield Wanted("VARIABLE", "Reference_Variable", variable.id, variable.user)
    for kind in of_form(Components):
        for vector in _with_users(model.table(kind.name)):
            results = sum(expr is not None for expr in vector.exprs)
            yield Wanted(kind.name, kind.statement, vector.id, vector.user, results)
    for state in _with_users(model.differentials):
        yield _of_states(state.user) or Wanted("DIFF", "Control_Diff", state.id, state.user)
    for motion in _with_users(model.motions):
        orders = ORDERS[motion.val_type]
        yield Wanted("MOTION", motion.statement, motion.id, motion.user, 3, Call.MOTION, orders)
    for coupler in _with_users(model.couplers):
        user = coupler.user
        yield Wanted("COUPLER", "Constraint_Coupler", coupler.id, user, user.results, Call.RELATION)
    for name, statement, table, results in (
        ("SENSOR", "Sensor_Event", model.sensors, 1),
        ("SENVAL", "Sensor_Evaluate", model.evaluations, 1),
        ("REQUEST", "Post_Request", model.requests, RESULTS),
    ):
        for element in _with_users(table):
            yield Wanted(name, statement, element.id, element.user, results, Call.PLAIN)


def _of_states(user: Subroutine) -> Wanted | None:
    """Return a subroutine that gives the slopes of several states, None if it is none."""
    if not isinstance(user, StateSubroutine):
        return None
    results = len(user.state_ids) + user.outputs
    statement = "Control_StateEqn"
    return Wanted("GSE", statement, user.element_id, user, results, Call.STATES)


def _with_users(table: Mapping[int, Any]) -> list[Any]:
    """Return the elements that a subroutine gives."""
    return [element for element in table.values() if element.user is not None]

"""Control_StateEqn: a linear system by its matrices A, B, C and D, or one by a subroutine."""

from __future__ import annotations

from typing import Any

from mbsim.model.source import Subroutine
from mbsim.reader.kinds import COUNT, FLAG, ID, BadValueError, Kind, keyword, parse_real
from mbsim.reader.linear_systems import LinearSystem
from mbsim.reader.statement import NAMED, Entry, Spec, Statement
from mbsim.reader.subroutine import USERSUB, subroutine


def _parse_sizes(text: str) -> tuple[float, ...]:
    """Return numbers > 0 separated by blanks or commas."""
    values = tuple(parse_real(word) for word in text.replace(",", " ").split())
    if not values or min(values) <= 0.0:
        raise BadValueError
    return values


def _build_by_user(entry: Entry) -> None:
    """Keep a system whose slopes and outputs a subroutine gives."""
    for name in ("usrsub_param_string", "num_state"):
        if not entry.given(name):
            kind = entry.statement.attributes[name].kind
            entry.fault(f"{name}: missing; must be {kind.allowed}")
    if entry.given("y_array_id") != entry.given("num_output"):
        entry.fault("num_output and y_array_id: one goes with the other")
    for name in "abcd":
        if entry.given(f"{name}_matrix_id"):
            entry.fault("a subroutine gives this system; must not be there", f"{name}_matrix_id")
    user = subroutine(entry, "usrsub", "GSESUB")
    if entry.get("num_state") and entry.get("x_array_id"):
        _keep(entry, {}, user)


def _build_state_eqn(entry: Entry) -> None:
    """Keep a system until its arrays and matrices are known."""
    given = [name for name in USERSUB if entry.given(name)]
    if entry.get("type") == "USERSUB" or (given and not entry.given("type")):
        _build_by_user(entry)
        return
    for name in given:
        entry.fault("this system is linear; must not be there", name)
    if not entry.given("a_matrix_id"):
        entry.fault("a_matrix_id: missing; must be an id, or type USERSUB with a subroutine")
    matrices = {name.upper(): entry.get(f"{name}_matrix_id") for name in "abcd"}
    arrays = {name: entry.get(f"{name}_array_id") for name in "xuy"}
    if matrices["A"] is None or arrays["x"] is None:
        return
    for name, needs in (("B", "u"), ("C", "y"), ("D", "uy")):
        missing = [f"{what}_array_id" for what in needs if arrays[what] is None]
        if matrices[name] is not None and missing:
            entry.fault(f"needs {' and '.join(missing)} too", f"{name.lower()}_matrix_id")
            return
    if arrays["y"] is not None and matrices["C"] is None and matrices["D"] is None:
        entry.fault("needs c_matrix_id or d_matrix_id, by which it is made", "y_array_id")
        return
    if arrays["u"] is not None and matrices["B"] is None and matrices["D"] is None:
        entry.fault("needs b_matrix_id or d_matrix_id, by which it acts", "u_array_id")
        return
    _keep(entry, {name: id for name, id in matrices.items() if id is not None})


def _keep(entry: Entry, matrices: dict[str, Any], user: Subroutine | None = None) -> None:
    """Keep a system until its arrays and matrices are known."""
    system = LinearSystem(
        id=entry.get("id", 0),
        statement="Control_StateEqn",
        arrays={name: entry.get(f"{name}_array_id") for name in "xuy"},
        matrices=matrices,
        label=entry.get("label", ""),
        ic_id=entry.get("ic_array_id"),
        scales=entry.get("scale", ()),
        is_static_hold=entry.get("is_static_hold", False),
        user=user,
        counts={"x": entry.get("num_state"), "y": entry.get("num_output")},
        source=entry.source,
    )
    entry.register_in(entry.draft.control.systems.setdefault("Control_StateEqn", {}), system)


CONTROL_STATE_EQN = Statement(
    "Control_StateEqn",
    {
        **NAMED,
        "type": Spec(
            keyword({"linear": "LINEAR", "usersub": "USERSUB"}),
            "how it is given",
            "",
            "by what is given",
        ),
        "x_array_id": Spec(
            ID, "array of type X: its states", required=True, alias="x_solver_array_id"
        ),
        "y_array_id": Spec(ID, "array of type Y: its outputs", alias="y_solver_array_id"),
        "u_array_id": Spec(ID, "array of type U: its inputs", alias="u_solver_array_id"),
        "ic_array_id": Spec(
            ID, "array of type IC: states at the start", "", "zeros", alias="ic_solver_array_id"
        ),
        "a_matrix_id": Spec(ID, "A, states by states; needed of a linear one"),
        "b_matrix_id": Spec(ID, "B, states by inputs"),
        "c_matrix_id": Spec(ID, "C, outputs by states"),
        "d_matrix_id": Spec(ID, "D, outputs by inputs"),
        "num_state": Spec(COUNT, "number of states", "", "that of A; needed of a subroutine"),
        "num_output": Spec(COUNT, "number of outputs", "", "that of C or D"),
        "is_static_hold": Spec(
            FLAG, "TRUE: a static analysis leaves its states as they are", "", "FALSE"
        ),
        "scale": Spec(  # ours
            Kind("numbers > 0, separated by blanks or commas", _parse_sizes),
            "sizes of the states by which their errors are judged",
            "",
            "1 each",
        ),
        **USERSUB,
    },
    _build_state_eqn,
    about="inputs, states and outputs by matrices or a subroutine",
)

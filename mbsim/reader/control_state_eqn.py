"""Control_StateEqn: a linear system by its matrices A, B, C and D."""

from __future__ import annotations

from mbsim.reader.kinds import COUNT, FLAG, ID, TEXT, BadValueError, Kind, keyword, parse_real
from mbsim.reader.linear_systems import LinearSystem
from mbsim.reader.statement import NAMED, Entry, Spec, Statement
from mbsim.reader.subroutine import USERSUB

_BY_USER = "a system by a subroutine (GSESUB) is not built; give A, B, C and D, or Control_Diff"


def _parse_sizes(text: str) -> tuple[float, ...]:
    """Return numbers > 0 separated by blanks or commas."""
    values = tuple(parse_real(word) for word in text.replace(",", " ").split())
    if not values or min(values) <= 0.0:
        raise BadValueError
    return values


def _build_state_eqn(entry: Entry) -> None:
    """Keep a system until its arrays and matrices are known."""
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
    system = LinearSystem(
        id=entry.get("id", 0),
        statement="Control_StateEqn",
        arrays=arrays,
        matrices={name: id for name, id in matrices.items() if id is not None},
        label=entry.get("label", ""),
        ic_id=entry.get("ic_array_id"),
        scales=entry.get("scale", ()),
        is_static_hold=entry.get("is_static_hold", False),
        counts={"x": entry.get("num_state"), "y": entry.get("num_output")},
        source=entry.source,
    )
    entry.register(entry.draft.control.systems.setdefault("Control_StateEqn", {}), system)


CONTROL_STATE_EQN = Statement(
    "Control_StateEqn",
    {
        **NAMED,
        "type": Spec(
            keyword({"linear": "LINEAR"}, {"usersub": "USERSUB"}, _BY_USER), "how it is given"
        ),
        "x_array_id": Spec(
            ID, "array of type X: its states", required=True, alias="x_solver_array_id"
        ),
        "y_array_id": Spec(ID, "array of type Y: its outputs", alias="y_solver_array_id"),
        "u_array_id": Spec(ID, "array of type U: its inputs", alias="u_solver_array_id"),
        "ic_array_id": Spec(
            ID, "array of type IC: states at the start", "", "zeros", alias="ic_solver_array_id"
        ),
        "a_matrix_id": Spec(ID, "A, states by states", required=True),
        "b_matrix_id": Spec(ID, "B, states by inputs"),
        "c_matrix_id": Spec(ID, "C, outputs by states"),
        "d_matrix_id": Spec(ID, "D, outputs by inputs"),
        "num_state": Spec(COUNT, "number of states", "", "that of A"),
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
        **{name: Spec(TEXT, refused=_BY_USER) for name in (*USERSUB, "script_name", "interpreter")},
    },
    _build_state_eqn,
    about="a linear system of inputs, states and outputs by its matrices",
)

"""Control_SISO: a transfer function of one input and one output."""

from __future__ import annotations

from mbsim.reader.kinds import COUNT, FLAG, ID, REALS
from mbsim.reader.linear_systems import LinearSystem, realise
from mbsim.reader.statement import NAMED, Entry, Spec, Statement


def _coefficients(entry: Entry, name: str) -> tuple[float, ...]:
    """Return the coefficients of a polynomial, nothing where they have a fault."""
    values: tuple[float, ...] = entry.get(f"{name}_coef", ())
    count = entry.get(f"num_{name}_coef")
    if values and count is not None and count != len(values):
        entry.fault(f"there are {len(values)} coefficients", f"num_{name}_coef")
        return ()
    return values


def _build_siso(entry: Entry) -> None:
    """Keep a transfer function until its arrays are known."""
    above, below = _coefficients(entry, "numerator"), _coefficients(entry, "denominator")
    if not (above and below):
        return
    while len(above) > 1 and above[-1] == 0.0:
        above = above[:-1]
    if below[-1] == 0.0:
        entry.fault("the last coefficient, of the highest power, must not be 0", "denominator_coef")
        return
    if len(above) > len(below):
        order = f"order {len(above) - 1} over order {len(below) - 1}"
        entry.fault(f"{order}: the output would need derivatives of the input", "numerator_coef")
        return
    matrices, scales = realise(above, below)
    system = LinearSystem(
        id=entry.get("id", 0),
        statement="Control_SISO",
        arrays={name: entry.get(f"{name}_array_id") for name in "xuy"},
        matrices=dict(matrices),
        label=entry.get("label", ""),
        scales=scales,
        is_static_hold=entry.get("is_static_hold", False),
        source=entry.source,
    )
    entry.register_in(entry.draft.control.systems.setdefault("Control_SISO", {}), system)


CONTROL_SISO = Statement(
    "Control_SISO",
    {
        **NAMED,
        "x_array_id": Spec(ID, "array of type X: its states"),
        "y_array_id": Spec(ID, "array of type Y: its output", required=True),
        "u_array_id": Spec(ID, "array of type U: its input", required=True),
        "is_static_hold": Spec(
            FLAG, "TRUE: a static analysis leaves its states as they are", "", "FALSE"
        ),
        "num_numerator_coef": Spec(COUNT, "how many there are", "", "as many as are given"),
        "numerator_coef": Spec(REALS, "of s^0, s^1 and so on", required=True),
        "num_denominator_coef": Spec(COUNT, "how many there are", "", "as many as are given"),
        "denominator_coef": Spec(REALS, "of s^0, s^1 and so on", required=True),
    },
    _build_siso,
    about="a transfer function of one input and one output",
)

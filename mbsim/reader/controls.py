"""Control_Diff: states of the user's own."""

from __future__ import annotations

from mbsim.model import elements as el
from mbsim.reader.constraints import USERSUB_REFUSED
from mbsim.reader.keywords import BY_EXPRESSION, BY_USERSUB
from mbsim.reader.kinds import EXPRESSION, FLAG, ID, POSITIVE, REAL, TEXT, keyword
from mbsim.reader.statement import Entry, Spec, Statement

_IMPLICIT = "an implicit equation 0 = f(z, z') is not built; solve it for z' and leave it out"
_NO_SLOPE = "z' at the start is what expr gives; only an implicit equation has it given"


def _build_differential(entry: Entry) -> None:
    """Add a state."""
    if entry.get("expr") is None:
        return
    differential = el.Differential(
        id=entry.get("id", 0),
        expr=entry.get("expr"),
        ic=entry.get("ic", 0.0),
        scale=entry.get("scale", 1.0),
        label=entry.get("label", ""),
        source=entry.source,
    )
    entry.register(entry.draft.differentials, differential)


CONTROL_DIFF = Statement(
    "Control_Diff",
    {
        "id": Spec(ID, required=True),
        "label": Spec(TEXT),
        "full_label": Spec(TEXT),
        "type": Spec(keyword(BY_EXPRESSION, BY_USERSUB)),
        "expr": Spec(EXPRESSION, required=True),
        "ic": Spec(REAL),
        "ic_dot": Spec(REAL, note=_NO_SLOPE),
        "is_implicit": Spec(FLAG, refused=_IMPLICIT, harmless="FALSE"),
        "scale": Spec(POSITIVE),  # ours: what the error norm takes for small
        **USERSUB_REFUSED,
    },
    _build_differential,
)

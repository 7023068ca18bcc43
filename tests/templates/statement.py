"""Force_Lift: a constant force `lift` [F] on the body of a marker, along z of the global frame.

Template of a statement: copy it into mbsim/reader/ and name it in `reader/statements.py`. Here it
becomes an element that there is; one of its own is a dataclass in mbsim/model/ with its table in
`Model` and `Draft`, arrays in mbsim/compile_model/, and a formula in mbsim/dynamics/.
"""

from __future__ import annotations

from mbsim.expressions.parse import parse
from mbsim.model import elements as el
from mbsim.reader.kinds import REAL
from mbsim.reader.statement import MARKERS, NAMED, Entry, Spec, Statement


def _build(entry: Entry) -> None:
    """Add a force on one body; faults of attributes are there already."""
    lift = parse(repr(entry.get("lift", 0.0)))
    force = el.BodyForce(
        id=entry.get("id", 0),
        type="FORCEONLY",
        exprs=(None, None, lift, None, None, None),
        label=entry.get("label", ""),
        i_marker_id=entry.get("i_marker_id", 0),
        source=entry.source,
    )
    entry.register("body_forces", force)


FORCE_LIFT = Statement(
    "Force_Lift",
    {
        **NAMED,
        "i_marker_id": MARKERS["i_marker_id"],
        "lift": Spec(REAL, "force along global z", "F", required=True),
    },
    _build,
    about="a constant force upwards",
)

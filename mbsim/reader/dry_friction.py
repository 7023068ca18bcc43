"""Force_DryFriction (ours): friction of a given level between two markers, after Muscade's."""

from __future__ import annotations

from mbsim.model import elements as el
from mbsim.reader.keywords import DRY_TYPES
from mbsim.reader.kinds import NOT_NEGATIVE, POSITIVE, keyword
from mbsim.reader.statement import MARKERS, NAMED, Entry, Spec, Statement


def _build(entry: Entry) -> None:
    """Add dry friction between markers."""
    type, friction = entry.get("type"), entry.get("friction")
    if type is None or friction is None:
        return
    static = entry.get("friction_static")
    if static is not None and static < friction:
        entry.fault(f"must be a number >= friction ({friction:g})", "friction_static")
    made = el.DryFriction(
        id=entry.get("id", 0),
        type=type,
        friction=friction,
        dx=entry.get("dx", 0.0),
        friction_static=static,
        label=entry.get("label", ""),
        i_marker_id=entry.get("i_marker_id", 0),
        j_marker_id=entry.get("j_marker_id", 0),
        source=entry.source,
    )
    entry.register(entry.draft.dry_frictions, made)


FORCE_DRYFRICTION = Statement(
    "Force_DryFriction",
    {
        **NAMED,
        **MARKERS,
        "type": Spec(keyword(DRY_TYPES), "along J's axis (T) or about it (R)", required=True),
        "friction": Spec(POSITIVE, "force or torque while it slips", "F or F L", required=True),
        "friction_static": Spec(POSITIVE, "what begins the slip", "F or F L", "friction"),
        "dx": Spec(NOT_NEGATIVE, "give before it slips; 0: none", "L or rad", "0"),
        "scale": Spec(
            refused="is Muscade's x'scale, by which it tells stick from slip; here the mode is "
            "kept, and there is nothing to scale"
        ),
    },
    _build,
    about="a dry slider between two markers that holds and slips",
)

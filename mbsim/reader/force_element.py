"""Force_Element (ours): forces between two markers by a user's residual, as Muscade has them."""

from __future__ import annotations

from mbsim.model import elements as el
from mbsim.reader.keywords import DRY_TYPES
from mbsim.reader.kinds import BadValueError, Kind
from mbsim.reader.statement import MARKERS, NAMED, Entry, Spec, Statement
from mbsim.reader.subroutine import USERSUB, subroutine

_AXES = tuple(dict.fromkeys(DRY_TYPES.values()))
_ALLOWED = f"one or more of {', '.join(_AXES)}, each once"


def _parse_directions(text: str) -> tuple[str, ...]:
    """Return directions separated by blanks or commas, in upper case."""
    words = tuple(text.replace(",", " ").upper().split())
    if not words or any(word not in _AXES for word in words) or len(set(words)) < len(words):
        raise BadValueError
    return words


def _build(entry: Entry) -> None:
    """Add an element between markers."""
    user = subroutine(entry, "usrsub", "residual")
    directions = entry.get("direction")
    if directions is None:
        return
    made = el.ForceElement(
        id=entry.get("id", 0),
        directions=directions,
        user=user,
        label=entry.get("label", ""),
        i_marker_id=entry.get("i_marker_id", 0),
        j_marker_id=entry.get("j_marker_id", 0),
        source=entry.source,
    )
    entry.register(entry.draft.force_elements, made)


FORCE_ELEMENT = Statement(
    "Force_Element",
    {
        **NAMED,
        **MARKERS,
        "direction": Spec(
            Kind(_ALLOWED, _parse_directions), "along and about axes of J", required=True
        ),
        **USERSUB,
    },
    _build,
    about="forces between two markers by a residual of your own",
)

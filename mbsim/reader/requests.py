"""Post_Request: marker displacement, velocity and acceleration."""

from __future__ import annotations

from mbsim.model import elements as el
from mbsim.reader.keywords import REQUEST_NOT_BUILT, REQUEST_TYPES
from mbsim.reader.kinds import ID, TEXT, keyword
from mbsim.reader.statement import Entry, Spec, Statement

_OF_OTHER_TYPES = (
    *("elem_type", "elem_id", "jflag", *(f"expr{k}" for k in range(1, 9))),
    *("usrsub_param_string", "usrsub_fnc_name", "usrsub_dll_name", "script_name", "interpreter"),
)


def _build_request(entry: Entry) -> None:
    """Add a request."""
    type = entry.get("type")
    if type is None:
        return
    for name in _OF_OTHER_TYPES:
        if entry.given(name):
            entry.fault(f"belongs to another type of request than {type}", name)
    if not entry.given("i_marker_id"):
        entry.fault(f"i_marker_id: missing; must be {ID.allowed}")
    request = el.Request(
        id=entry.get("id", 0),
        type=type,
        label=entry.get("label", ""),
        comment=entry.get("comment", ""),
        i_marker_id=entry.get("i_marker_id", 0),
        j_marker_id=entry.get("j_marker_id"),
        ref_marker_id=entry.get("ref_marker_id"),
        source=entry.source,
    )
    entry.register(entry.draft.requests, request)


POST_REQUEST = Statement(
    "Post_Request",
    {
        "id": Spec(ID, required=True),
        "type": Spec(keyword(REQUEST_TYPES, REQUEST_NOT_BUILT), required=True),
        "label": Spec(TEXT),
        "comment": Spec(TEXT),
        "i_marker_id": Spec(ID),
        "j_marker_id": Spec(ID),
        "ref_marker_id": Spec(ID),
        **{name: Spec(TEXT) for name in _OF_OTHER_TYPES},
    },
    _build_request,
)

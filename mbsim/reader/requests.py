"""Post_Request: motion of and forces between markers, forces of elements, expressions."""

from __future__ import annotations

from mbsim.expressions.tree import Expression
from mbsim.model import elements as el
from mbsim.model.subroutines import RESULTS
from mbsim.reader.keywords import BY_USERSUB, FORCE_ELEMENTS, REQUEST_TYPES
from mbsim.reader.kinds import EXPRESSION, FLAG, ID, TEXT, Kind, keyword
from mbsim.reader.statement import NAMED, Entry, Spec, Statement
from mbsim.reader.subroutine import USERSUB, result, subroutine

_OR_NULL = Kind(
    "an expression, or NULL for none",
    lambda text: None if text.strip().upper() == "NULL" else EXPRESSION.parse(text),
)
_EXPRESSIONS = tuple(f"expr{k}" for k in range(1, 9))
_MARKERS = ("i_marker_id", "j_marker_id", "ref_marker_id")
#: What each type takes; the first ones it must have.
_TAKES: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "ELEMENTAL_FORCE": (("elem_type", "elem_id"), ("jflag", "ref_marker_id")),
    "EXPRESSION": ((), _EXPRESSIONS),
    "USERSUB": (("usrsub_param_string",), tuple(USERSUB)[1:]),
}
_OF_MARKERS = (("i_marker_id",), ("j_marker_id", "ref_marker_id"))


def user_results(entry: Entry, user: el.Subroutine) -> tuple[Expression, ...]:
    """Return F1..F8 of a request that a subroutine gives."""
    trees = (result(entry, "REQUEST", user, k).root for k in range(RESULTS))
    return tuple(Expression(f"{user.fnc_name} {k}", tree) for k, tree in enumerate(trees, 1))


def _build_request(entry: Entry) -> None:
    """Add a request."""
    type = entry.get("type")
    if type is None:
        return
    needs, may = _TAKES.get(type, _OF_MARKERS)
    every = (*_MARKERS, "elem_type", "elem_id", "jflag", *_EXPRESSIONS, *USERSUB)
    for name in every:
        if entry.given(name) and name not in (*needs, *may):
            entry.fault(f"belongs to another type of request than {type}", name)
    for name in needs:
        if not entry.given(name):
            kind = entry.statement.attributes[name].kind
            entry.fault(f"{name}: missing; must be {kind.allowed}")
    exprs = tuple(entry.get(name) for name in _EXPRESSIONS)
    if type == "EXPRESSION" and not any(entry.given(name) for name in _EXPRESSIONS):
        entry.fault("expr1 ... expr8: missing; at least one must be given")
    user = subroutine(entry, "usrsub", "REQSUB") if type == "USERSUB" else None
    if user is not None:
        exprs = user_results(entry, user)
    request = el.Request(
        id=entry.get("id", 0),
        type="EXPRESSION" if user is not None else type,
        label=entry.get("label", ""),
        comment=entry.get("comment", ""),
        i_marker_id=entry.get("i_marker_id", 0),
        j_marker_id=entry.get("j_marker_id"),
        ref_marker_id=entry.get("ref_marker_id"),
        elem_type=entry.get("elem_type", ""),
        elem_id=entry.get("elem_id", 0),
        jflag=entry.get("jflag", False),
        exprs=exprs if type in ("EXPRESSION", "USERSUB") else (),
        user=user,
        source=entry.source,
    )
    entry.register("requests", request)


POST_REQUEST = Statement(
    "Post_Request",
    {
        "id": NAMED["id"],
        "type": Spec(keyword(REQUEST_TYPES | BY_USERSUB), "what is written", required=True),
        "label": NAMED["label"],
        "full_label": NAMED["full_label"],
        "comment": Spec(TEXT, "name in the CSV file, where there is no label"),
        "i_marker_id": Spec(ID, "marker I"),
        "j_marker_id": Spec(ID, "marker J", "", "global frame; of MARKER_FORCE: any"),
        "ref_marker_id": Spec(ID, "marker along whose axes F1..F8 are", "", "global frame"),
        "elem_type": Spec(keyword(FORCE_ELEMENTS), "sort of the element of ELEMENTAL_FORCE"),
        "elem_id": Spec(ID, "its id"),
        "jflag": Spec(FLAG, "TRUE: what acts on J", "", "FALSE"),
        **{name: Spec(_OR_NULL, f"F{name[-1]} of EXPRESSION", "", "0") for name in _EXPRESSIONS},
        **USERSUB,
    },
    _build_request,
    about="numbers for the result file: motion, forces, expressions",
)

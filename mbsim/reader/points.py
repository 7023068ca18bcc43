"""Body_Point and Adams' POINT_MASS: bodies that keep their orientation and so only have a mass."""

from __future__ import annotations

from mbsim.model import elements as el
from mbsim.reader.bodies import start_given, start_velocity
from mbsim.reader.draft import Draft
from mbsim.reader.kinds import FLAG, ID, POSITIVE, REAL
from mbsim.reader.statement import NAMED, Entry, Spec, Statement

#: Moments of inertia: what does not turn is moved by none of them.
INERTIA = (1.0, 1.0, 1.0, 0.0, 0.0, 0.0)


def _build_point(entry: Entry) -> None:
    """Add a point mass."""
    body = el.Body(
        id=entry.get("id", 0),
        label=entry.get("label", ""),
        mass=entry.get("mass"),
        inertia=INERTIA,
        cg_id=entry.get("cg_id"),
        lprf_id=entry.get("lprf_id"),
        v_ic=start_velocity(entry, "v"),
        v_given=start_given(entry, "v"),
        source=entry.source,
    )
    entry.draft.points[body.id] = ("Body_Point", entry.source)
    entry.register("bodies", body)


def hold_points(draft: Draft) -> None:
    """Keep point masses from turning: each is a body with ORIENTATION to ground."""
    ground = next((body.id for body in draft.bodies.values() if body.is_ground), None)
    for id, (statement, source) in draft.points.items():
        cg = draft.bodies[id].cg_id if id in draft.bodies else None
        if cg not in draft.markers:
            continue
        if ground is None:
            message = "a point mass needs a ground body, whose axes it keeps to, in the deck"
            draft.fault(source.line, f"{statement}[{id}]", message)
            return
        there = max(draft.markers) + 1
        draft.markers[there] = el.Marker(id=there, body_id=ground, rm_id=cg, source=source)
        held = max(draft.primitives, default=0) + 1
        draft.primitives[held] = el.Joint(
            id=held,
            type="ORIENTATION",
            label=f"{statement} {id}",
            i_marker_id=cg or 0,
            j_marker_id=there,
            is_primitive=True,
            source=source,
        )


BODY_POINT = Statement(
    "Body_Point",
    {
        **NAMED,
        "cg_id": Spec(ID, "marker of the body where its mass is", required=True),
        "lprf_id": Spec(ID, "marker in which the body's markers are given", "", "global frame"),
        "mass": Spec(POSITIVE, "mass", "M", required=True),
        **{f"v_ic_{a}": Spec(REAL, f"velocity along {a} at the start", "L/T", "0") for a in "xyz"},
        **{f"v_ic_{a}_flag": Spec(FLAG, f"whether v_ic_{a} counts", "", "FALSE") for a in "xyz"},
    },
    _build_point,
    about="a point mass: it moves and does not turn",
)

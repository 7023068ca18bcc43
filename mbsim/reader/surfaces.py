"""Reference_ParamSurface and Constraint_PTSF: surfaces, and points that stay on them."""

from __future__ import annotations

from mbsim.model.curves import ParamSurface, PointOnSurface
from mbsim.reader.curves import START, start_of
from mbsim.reader.keywords import spellings
from mbsim.reader.kinds import FLAG, ID, REAL, keyword
from mbsim.reader.statement import NAMED, Entry, Spec, Statement
from mbsim.reader.subroutine import USERSUB, subroutine

_ENDS = ("u_start", "u_end", "v_start", "v_end")


def _build_surface(entry: Entry) -> None:
    """Add a surface."""
    ends = [entry.get(name, 0.0) for name in _ENDS]
    for k in (0, 2):
        if ends[k + 1] <= ends[k] and entry.given(_ENDS[k]) and entry.given(_ENDS[k + 1]):
            entry.fault(f"must be more than {_ENDS[k]}", _ENDS[k + 1])
            return
    surface = ParamSurface(
        id=entry.get("id", 0),
        u=(ends[0], ends[1]),
        v=(ends[2], ends[3]),
        user=subroutine(entry, "usrsub", "SURSUB", libraries=False),
        is_u_closed=entry.get("is_u_closed", False),
        is_v_closed=entry.get("is_v_closed", False),
        label=entry.get("label", ""),
        source=entry.source,
    )
    entry.register("surfaces", surface)


def _build_point(entry: Entry) -> None:
    """Add a point on a surface."""
    j = entry.get("j_marker_id", 0)
    point = PointOnSurface(
        id=entry.get("id", 0),
        i_marker_id=entry.get("i_marker_id", 0),
        j_marker_id=j,
        surface_id=entry.get("surface_id", 0),
        start=start_of(entry, START),
        start_marker_id=j,
        label=entry.get("label", ""),
        source=entry.source,
    )
    entry.register("points_on_surfaces", point)


_DOCUMENTED = "shared libraries are not built for surfaces; name a script"
REFERENCE_PARAM_SURFACE = Statement(
    "Reference_ParamSurface",
    {
        **NAMED,
        "is_u_closed": Spec(FLAG, "it ends along u where it begins", "", "FALSE"),
        "is_v_closed": Spec(FLAG, "it ends along v where it begins", "", "FALSE"),
        **{
            name: Spec(REAL, f"where {name[0]} {verb}", required=True)
            for name, verb in zip(_ENDS, ("begins", "ends") * 2, strict=True)
        },
        "type": Spec(keyword(spellings(USERSUB="")), "how it is given", "", "USERSUB"),
        **{name: spec for name, spec in USERSUB.items() if name != "usrsub_language"},
        "usrsub_language": Spec(USERSUB["usrsub_language"].kind, refused=_DOCUMENTED),
    },
    _build_surface,
    about="a surface in space",
)
CONSTRAINT_PTSF = Statement(
    "Constraint_PTSF",
    {
        **NAMED,
        "i_marker_id": Spec(ID, "marker whose origin stays on the surface", required=True),
        "j_marker_id": Spec(ID, "marker in whose axes the surface is given", required=True),
        "surface_id": Spec(ID, "the Reference_ParamSurface", required=True),
        **{
            name: Spec(REAL, "near where on the surface it begins, in J's axes", "L", "where I is")
            for name in START
        },
    },
    _build_point,
    about="a point that stays on a surface",
)

"""UNITS, PART, MARKER, joints, motions and gravity of an Adams deck."""

from __future__ import annotations

from mbsim.model import elements as el
from mbsim.model.frames import GLOBAL
from mbsim.reader import units
from mbsim.reader.adm.draft import draft_of, frame_of, require
from mbsim.reader.adm.subroutine import function_or_user
from mbsim.reader.constraints import note_unused_starts
from mbsim.reader.kinds import ID
from mbsim.reader.points import INERTIA
from mbsim.reader.statement import Entry

SYSTEMS = {
    "MKS": {"force": "NEWTON", "mass": "KILOGRAM", "length": "METER", "time": "SECOND"},
    "CGS": {"force": "DYNE", "mass": "GRAM", "length": "CENTIMETER", "time": "SECOND"},
    "FPS": {"force": "POUND_FORCE", "mass": "SLUG", "length": "FOOT", "time": "SECOND"},
}


def build_units(entry: Entry) -> None:
    """Set the draft's units, once."""
    if entry.draft.units is not None:
        entry.fault("a second UNITS; a deck has one")
        return
    single = {key: entry.get(key.upper()) for key in ("force", "mass", "length", "time")}
    chosen = {key: name for key, name in single.items() if name is not None}
    system = entry.get("SYSTEM")
    if system is not None and chosen:
        entry.fault("give SYSTEM or FORCE, MASS, LENGTH and TIME, not both", "SYSTEM")
    entry.draft.units = units.make_units(**(SYSTEMS[system] if system else chosen))


def build_part(entry: Entry) -> None:
    """Add a part; its frame is kept for its markers."""
    id = entry.get("id", 0)
    frame = frame_of(entry, "QG", "ZG", "XG")
    if entry.get("GROUND", False):
        for name in entry.statement.attributes:
            if entry.given(name) and name not in ("id", "GROUND"):
                entry.fault("ground has no such argument: it does not move", name)
        frame = GLOBAL
    else:
        for name in ("MASS", "CM", "IP"):
            if not entry.given(name):
                kind = entry.statement.attributes[name].kind
                entry.fault(f"{name}: missing; a part that moves needs it, must be {kind.allowed}")
    ip = (*entry.get("IP", ()), 0.0, 0.0, 0.0)
    # here xx yy zz xy xz yz, in the model xx yy zz xy yz xz
    inertia = (ip[0], ip[1], ip[2], ip[3], ip[5], ip[4]) if entry.get("IP") else None
    w = (entry.get("WX", 0.0), entry.get("WY", 0.0), entry.get("WZ", 0.0))
    body = el.Body(
        id=id,
        is_ground=entry.get("GROUND", False),
        mass=entry.get("MASS"),
        inertia=inertia,
        cg_id=entry.get("CM"),
        im_id=entry.get("IM"),
        v_ic=(entry.get("VX", 0.0), entry.get("VY", 0.0), entry.get("VZ", 0.0)),
        w_ic=w,
        v_given=_given(entry, "V"),
        w_given=_given(entry, "W"),
        vm_id=entry.get("VM"),
        wm_id=entry.get("WM", entry.get("CM") if any(_given(entry, "W")) else None),
        source=entry.source,
    )
    draft_of(entry).parts[id] = frame
    entry.register("bodies", body)


def build_point_mass(entry: Entry) -> None:
    """Add a point mass: a body that cannot turn, whose moments of inertia move nothing."""
    id, draft = entry.get("id", 0), entry.draft
    frame = frame_of(entry, "QG", "ZG", "XG")
    body = el.Body(
        id=id,
        mass=entry.get("MASS"),
        inertia=INERTIA,
        cg_id=entry.get("CM"),
        v_ic=(entry.get("VX", 0.0), entry.get("VY", 0.0), entry.get("VZ", 0.0)),
        v_given=_given(entry, "V"),
        source=entry.source,
    )
    draft_of(entry).parts[id] = frame
    draft.points[id] = ("POINT_MASS", entry.source)
    entry.register_in(draft.bodies, body)


def _given(entry: Entry, kind: str) -> tuple[bool, bool, bool]:
    """Return which components of a velocity the deck gives."""
    x, y, z = (entry.given(f"{kind}{axis}") for axis in "XYZ")
    return x, y, z


def build_marker(entry: Entry) -> None:
    """Add a marker, whose place in its part becomes one in the global frame."""
    frame = frame_of(entry, "QP", "ZP", "XP", not entry.get("USEXP", False))
    owners = entry.those(("PART", "POINT_MASS"))
    if len(owners) != 1:
        missing = f"PART: missing; must be {ID.allowed}, or POINT_MASS"
        entry.fault("give PART or POINT_MASS, not both" if owners else missing)
        return
    owner = entry.get(owners[0], 0)
    points = entry.draft.points
    if owners[0] == "POINT_MASS" and owner not in points:
        known = ", ".join(map(str, points)) or "none"
        entry.fault(f"there is no such point mass; the deck has {known}", "POINT_MASS")
    part = draft_of(entry).parts.get(owner, GLOBAL)
    p = part.p + part.R @ frame.p
    marker = el.Marker(
        id=entry.get("id", 0),
        body_id=owner,
        pos=(float(p[0]), float(p[1]), float(p[2])),
        R=part.R @ frame.R,
        source=entry.source,
        floating=entry.get("FLOATING", False),
    )
    entry.register("markers", marker)


def _starts_at_rest(entry: Entry) -> None:
    """Refuse initial conditions of a joint that say anything."""
    for name in ("ICTRAN", "ICROT"):
        if any(entry.get(name, ())):
            entry.fault(
                "initial conditions of joints are not built yet; place the parts, and give their "
                "VX ... WZ",
                name,
            )


_JOINTS = {"RACKPIN": "RACK_PINION", "CONVEL": "CONSTANT_VELOCITY"}
_OF_SOME_JOINTS = {"PITCH": "SCREW", "PD": "RACKPIN"}


def build_joint(entry: Entry) -> None:
    """Add a joint."""
    type = entry.get("TYPE")
    if type is None:
        require(entry, "TYPE")
        return
    _starts_at_rest(entry)
    for name, owner in _OF_SOME_JOINTS.items():
        if entry.given(name) and type != owner:
            entry.fault(f"belongs to a joint of type {owner}; this is {type}", name)
        if type == owner and not entry.given(name):
            entry.fault(f"{name}: missing; must be {entry.statement.attributes[name].kind.allowed}")
    joint = el.Joint(
        id=entry.get("id", 0),
        type=_JOINTS.get(type, type),
        i_marker_id=entry.get("I", 0),
        j_marker_id=entry.get("J", 0),
        pitch=entry.get("PITCH"),
        pitch_diameter=entry.get("PD"),
        source=entry.source,
    )
    entry.register("joints", joint)


def build_primitive(entry: Entry) -> None:
    """Add a joint primitive."""
    type = entry.get("TYPE")
    if type is None:
        require(entry, "TYPE")
        return
    joint = el.Joint(
        id=entry.get("id", 0),
        type="SPHERICAL" if type == "ATPOINT" else type,
        i_marker_id=entry.get("I", 0),
        j_marker_id=entry.get("J", 0),
        is_primitive=True,
        source=entry.source,
    )
    entry.register("primitives", joint)


def build_constraint(entry: Entry) -> None:
    """Add a constraint by an expression."""
    if entry.get("FUNCTION") is not None:
        constraint = el.GeneralConstraint(
            entry.get("id", 0), entry.get("FUNCTION"), source=entry.source
        )
        entry.register("general_constraints", constraint)


_DIRECTIONS = {"ROTATION": "R", "TRANSLATION": "T"}
_BETWEEN_MARKERS = ("X", "Y", "Z", "B1", "B2", "B3")


def _motion_direction(entry: Entry) -> str:
    """Return the direction of a motion; of a joint it may be left to the joint."""
    word = entry.get("DIRECTION")
    if entry.given("JOINT"):
        if word is not None and word not in _DIRECTIONS:
            entry.fault(f"{word}: must be ROTATION or TRANSLATION where JOINT is given")
        for name in ("I", "J"):
            if entry.given(name):
                entry.fault("give JOINT, or I and J, not both", name)
        return _DIRECTIONS.get(word or "", "")
    for name in ("I", "J"):
        if not entry.given(name):
            entry.fault(f"{name}: missing; a motion needs JOINT, or I and J, must be {ID.allowed}")
    if word is not None and word not in _BETWEEN_MARKERS:
        entry.fault(f"{word}: must be one of {', '.join(_BETWEEN_MARKERS)} between I and J")
    elif word is None:
        require(entry, "DIRECTION")
    return str(word)


def build_motion(entry: Entry) -> None:
    """Add a motion."""
    val_type = entry.get("VALUE", "DISPLACEMENT")[0]
    note_unused_starts(entry, val_type, "ICDISP", "ICVEL")
    expr, user = function_or_user(entry, "MOTION", "MOTSUB")
    motion = el.Motion(
        id=entry.get("id", 0),
        joint_id=entry.get("JOINT"),
        i_marker_id=entry.get("I", 0),
        j_marker_id=entry.get("J", 0),
        direction=_motion_direction(entry),
        val_type=val_type,
        expr=expr,
        user=user,
        ic_disp=entry.get("ICDISP") if val_type != "D" else None,
        ic_vel=entry.get("ICVEL") if val_type == "A" else None,
        source=entry.source,
    )
    entry.register("motions", motion)


def build_gravity(entry: Entry) -> None:
    """Set the model's gravity."""
    if entry.draft.gravity is not None:
        line = entry.draft.gravity.source.line
        entry.fault(f"a second ACCGRAV; the first is on line {line}")
        return
    x, y, z = (entry.get(f"{axis}GRAV", 0.0) for axis in "IJK")
    entry.draft.gravity = el.Gravity((x, y, z), entry.source)

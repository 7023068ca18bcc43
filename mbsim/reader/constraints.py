"""Constraint_Joint, _Jprim, _Coupler, _General, Motion_Joint and Motion_Marker."""

from __future__ import annotations

from dataclasses import replace

from mbsim.joints.catalog import JOINTS
from mbsim.model import elements as el
from mbsim.reader.draft import Draft
from mbsim.reader.keywords import (
    BY_EXPRESSION,
    BY_USERSUB,
    DIRECTIONS,
    MARKER_DIRECTIONS,
    PRIMITIVES,
    VALUE_TYPES,
    spellings,
)
from mbsim.reader.kinds import (
    EXPRESSION,
    FLAG,
    ID,
    IDS,
    POSITIVE,
    REAL,
    REALS,
    TEXT,
    WORDS,
    keyword,
)
from mbsim.reader.statement import MARKERS, NAMED, Entry, Spec, Statement
from mbsim.reader.subroutine import (
    GIVEN_BY,
    USERSUB,
    expression_or_user,
    relation,
    subroutine,
)

_NOT_BUILT = "is documented but not built yet"
#: What only some joints have; DISTANCE may have a length, the others must have theirs.
_OF_SOME_JOINTS = {"pitch": "SCREW", "pitch_diameter": "RACK_PINION", "length": "DISTANCE"}
USERSUB_REFUSED = {name: Spec(refused=f"{_NOT_BUILT}; give expr") for name in USERSUB}

#: What says that an element is given by an expression; the other way is not built.
BY_WHAT = Spec(keyword(BY_EXPRESSION, BY_USERSUB), "how it is given", "", "EXPRESSION")


def _build_joint(entry: Entry) -> None:
    """Add a joint; what its type needs must be there, what it does not have must not."""
    type = entry.get("type")
    if type is None:
        return
    for name, owner in _OF_SOME_JOINTS.items():
        if entry.given(name) and type != owner:
            entry.fault(f"belongs to a joint of type {owner}; this is {type}", name)
    for name in JOINTS[type].needs:
        if not entry.given(name):
            entry.fault(f"{name}: missing; {type} needs it, must be {_kind(entry, name)}")
    if entry.get("is_virtual", False):
        entry.fault(f"virtual joints are {_NOT_BUILT[3:]}; must be FALSE", "is_virtual")
    joint = el.Joint(
        id=entry.get("id", 0),
        type=type,
        label=entry.get("label", ""),
        i_marker_id=entry.get("i_marker_id", 0),
        j_marker_id=entry.get("j_marker_id", 0),
        pitch=entry.get("pitch"),
        pitch_diameter=entry.get("pitch_diameter"),
        length=entry.get("length"),
        source=entry.source,
    )
    entry.register("joints", joint)


def _kind(entry: Entry, name: str) -> str:
    return entry.statement.attributes[name].kind.allowed


def _build_primitive(entry: Entry) -> None:
    """Add a joint primitive, which has ids of its own."""
    if entry.get("type") is None:
        return
    joint = el.Joint(
        id=entry.get("id", 0),
        type=entry.get("type"),
        label=entry.get("label", ""),
        i_marker_id=entry.get("i_marker_id", 0),
        j_marker_id=entry.get("j_marker_id", 0),
        is_primitive=True,
        source=entry.source,
    )
    entry.register("primitives", joint)


def _build_coupler(entry: Entry) -> None:
    """Add a coupler of two or three joints, spelled joint by joint or as lists."""
    if any(entry.given(name) for name in _BY_JOINT):
        _build_coupler_by_joint(entry)
        return
    needed = ["joint_ids", "motion_types", "scales"]
    user = _relation(entry, needed, "scales")
    for name in needed:
        if not entry.given(name):
            entry.fault(f"{name}: missing; must be {_kind(entry, name)}")
    ids = entry.get("joint_ids", ())
    if entry.get("joint_ids") is not None and len(ids) not in (2, 3):
        entry.fault(f"names {len(ids)} joints; a coupler has 2 or 3", "joint_ids")
    for name in ("motion_types", "scales"):
        value = entry.get(name)
        if value is not None and ids and len(value) != len(ids):
            entry.fault(f"must have one value for each of the {len(ids)} joints", name)
    for word in entry.get("motion_types", ()):
        if word not in ("R", "T"):
            entry.fault(f"{word}: must be R or T for each joint", "motion_types")
    if any(scale == 0.0 for scale in entry.get("scales", ())):
        entry.fault("a joint with scale 0 takes no part; must be numbers other than 0", "scales")
    coupler = el.Coupler(
        id=entry.get("id", 0),
        label=entry.get("label", ""),
        joint_ids=ids,
        motion_types=entry.get("motion_types", ()),
        scales=entry.get("scales", ()),
        user=None if user is None else relation(user, len(ids)),
        source=entry.source,
    )
    entry.register("couplers", coupler)


def _relation(entry: Entry, needed: list[str], scales: str) -> el.Subroutine | None:
    """Return the subroutine of a coupler, where one gives it; then no scales are needed."""
    if not any(map(entry.given, USERSUB)):
        return None
    needed.remove(scales)
    if entry.given(scales):
        entry.fault("this coupler is given by a user subroutine; must not be there", scales)
    if not entry.given("usrsub_param_string"):
        kind = entry.statement.attributes["usrsub_param_string"].kind
        entry.fault(f"usrsub_param_string: missing; must be {kind.allowed}")
    return subroutine(entry, "usrsub", "COUSUB")


def _build_coupler_by_joint(entry: Entry) -> None:
    """Add a coupler as MotionSolve spells it."""
    for name in ("joint_ids", "motion_types", "scales"):
        if entry.given(name):
            entry.fault("goes with joint_ids, motion_types and scales, not with joint1_id", name)
    third = ("joint3_id", "freedom_3")
    joints = [*_BY_JOINT[:4], *(third if any(map(entry.given, third)) else ())]
    needed = [*joints, "coefficients"]
    user = _relation(entry, needed, "coefficients")
    for name in needed:
        if not entry.given(name):
            entry.fault(f"{name}: missing; must be {_kind(entry, name)}")
    ids = [entry.get(name) for name in joints[::2]]
    types = [entry.get(name) for name in joints[1::2]]
    scales = () if user else entry.get("coefficients")
    if None in (*ids, *types, scales):
        return
    if len(scales) != len(ids) and user is None:
        entry.fault(f"must have one value for each of the {len(ids)} joints", "coefficients")
    if any(scale == 0.0 for scale in scales):
        entry.fault("must be numbers other than 0", "coefficients")
    coupler = el.Coupler(
        id=entry.get("id", 0),
        label=entry.get("label", ""),
        joint_ids=tuple(ids),
        motion_types=tuple(types),
        scales=scales,
        user=None if user is None else relation(user, len(ids)),
        source=entry.source,
    )
    entry.register("couplers", coupler)


def _build_general(entry: Entry) -> None:
    """Add a constraint by an expression."""
    expr = entry.get("expr")
    if expr is None:
        return
    constraint = el.GeneralConstraint(
        id=entry.get("id", 0), expr=expr, label=entry.get("label", ""), source=entry.source
    )
    entry.register("general_constraints", constraint)


def note_unused_starts(entry: Entry, val_type: str, disp: str, vel: str) -> None:
    """Note initial values that the type of motion does not take: only V and A integrate."""
    unused = {"D": (disp, vel), "V": (vel,), "A": ()}[val_type]
    for name in unused:
        if entry.given(name):
            entry.note(f"has no effect with a motion by {_GIVEN[val_type]}", name)


_GIVEN = {"D": "displacement", "V": "velocity", "A": "acceleration"}


def _build_motion(entry: Entry) -> None:
    """Add a motion; of a joint its markers, and a direction left open, come from the joint."""
    of_joint = entry.statement.name == "Motion_Joint"
    val_type = entry.get("val_type")
    if val_type is None:
        return
    note_unused_starts(entry, val_type, "ic_disp", "ic_vel")
    expr, user = expression_or_user(entry, "MOTION", "MOTSUB")
    motion = el.Motion(
        id=entry.get("id", 0),
        label=entry.get("label", ""),
        joint_id=entry.get("joint_id", 0) if of_joint else None,
        i_marker_id=entry.get("i_marker_id", 0),
        j_marker_id=entry.get("j_marker_id", 0),
        direction=entry.get("motion_type" if of_joint else "direction", ""),
        val_type=val_type,
        expr=expr,
        user=user,
        ic_disp=entry.get("ic_disp") if val_type != "D" else None,
        ic_vel=entry.get("ic_vel") if val_type == "A" else None,
        source=entry.source,
    )
    other = entry.draft.motions.get(motion.id)
    if other is not None and other.statement != motion.statement:
        first = f"{other.statement} on line {other.source.line}"
        entry.fault(f"id already used by a {first}; motions share their ids", "id")
        return
    entry.register("motions", motion)


def complete_motions(draft: Draft) -> None:
    """Give the motions of joints the joint's markers, and the one direction that it has."""
    # what refers to a motion need not say of which statement it is
    draft.broken |= {("Motion_Joint", id) for name, id in draft.broken if name == "Motion_Marker"}
    for motion in draft.motions.values():
        joint = draft.joints.get(motion.joint_id or 0)
        if joint is None:
            continue
        moves = JOINTS[joint.type].moves
        direction = motion.direction
        if not direction and len(moves) == 1:
            direction = moves[0]
        draft.motions[motion.id] = replace(
            motion,
            direction=direction,
            i_marker_id=joint.i_marker_id,
            j_marker_id=joint.j_marker_id,
        )


_JOINT_TYPES = spellings(**{name: "" for name in JOINTS})
CONSTRAINT_JOINT = Statement(
    "Constraint_Joint",
    {
        **NAMED,
        "type": Spec(keyword(_JOINT_TYPES), "sort of joint", required=True),
        **MARKERS,
        "pitch": Spec(REAL, "way along z a turn, SCREW, right-handed", "L"),
        "pitch_diameter": Spec(POSITIVE, "diameter of the pinion, RACK_PINION", "L"),
        "length": Spec(POSITIVE, "distance, DISTANCE", "L", "as assembled"),  # ours
        "is_virtual": Spec(FLAG, "virtual joints are not built", "", "FALSE"),
    },
    _build_joint,
    about="a joint between two bodies",
)
CONSTRAINT_JPRIM = Statement(
    "Constraint_Jprim",
    {**NAMED, "type": Spec(keyword(PRIMITIVES), "sort of primitive", required=True), **MARKERS},
    _build_primitive,
    about="a joint primitive, with ids of its own",
)
#: How MotionSolve spells a coupler.
_BY_JOINT = (
    *("joint1_id", "freedom_1", "joint2_id", "freedom_2", "joint3_id", "freedom_3"),
    "coefficients",
)
CONSTRAINT_COUPLER = Statement(
    "Constraint_Coupler",
    {
        **NAMED,
        **{
            name: Spec(ID, f"joint {name[5]}")
            if name.endswith("id")
            else Spec(keyword(DIRECTIONS), f"R turns, T slides, of joint {name[-1]}")
            for name in _BY_JOINT[:-1]
        },
        "coefficients": Spec(REALS, "factor of each joint's displacement"),
        "joint_ids": Spec(IDS, "two or three joints, as a list"),  # ours
        "motion_types": Spec(WORDS, "R or T, one for each joint, as a list"),
        "scales": Spec(REALS, "coefficients that go with joint_ids"),
        "is_virtual": Spec(FLAG, refused="virtual couplers are not built", harmless="false"),
        **USERSUB,
    },
    _build_coupler,
    about="a relation of joints, linear or by a subroutine",
)
CONSTRAINT_GENERAL = Statement(
    "Constraint_General",
    {
        **NAMED,
        "type": BY_WHAT,
        "expr": Spec(EXPRESSION, "what shall be 0: of displacements and TIME", required=True),
        **USERSUB_REFUSED,
    },
    _build_general,
    about="a constraint: an expression is 0",
)
_GIVEN_MOTION: dict[str, Spec] = {
    "val_type": Spec(keyword(VALUE_TYPES), "what expr gives, see below", required=True),
    "type": GIVEN_BY,
    "expr": Spec(EXPRESSION, "displacement, velocity or acceleration"),
    "ic_disp": Spec(REAL, "displacement at the start, with V and A", "L or rad", "as assembled"),
    "ic_vel": Spec(REAL, "velocity at the start, with A", "L/T or rad/T", "as bodies move"),
    **USERSUB,
}
MOTION_JOINT = Statement(
    "Motion_Joint",
    {
        **NAMED,
        "joint_id": Spec(ID, "joint that is driven", required=True),
        "motion_type": Spec(keyword(DIRECTIONS), "R turns, T slides", "", "the joint's"),
        "joint_type": Spec(TEXT, note="the joint's own type counts"),
        **_GIVEN_MOTION,
    },
    _build_motion,
    about="drives a joint by an expression",
)
MOTION_MARKER = Statement(
    "Motion_Marker",
    {
        **NAMED,
        **MARKERS,
        "direction": Spec(
            keyword(MARKER_DIRECTIONS), "along J's X, Y, Z or about them", required=True
        ),
        **_GIVEN_MOTION,
    },
    _build_motion,
    about="drives one direction between two markers by an expression",
)

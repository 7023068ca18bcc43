"""Every statement of an Adams deck that the reader knows, and what each becomes."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from mbsim.model import elements as el
from mbsim.model.frames import GLOBAL, Frame, rotation_313
from mbsim.reader import units
from mbsim.reader.adm.declare import (
    ANGLE,
    ANY,
    EXPRESSION_OR_USER,
    NUMBERS,
    ROUTINE,
    ROWS,
    AdmStatement,
    angles,
    numbers,
)
from mbsim.reader.adm.marker_forces import marker_forces
from mbsim.reader.adm.subroutine import function_or_user, routine
from mbsim.reader.constraints import note_unused_starts
from mbsim.reader.controls import add_sensor
from mbsim.reader.draft import Draft
from mbsim.reader.keywords import fold
from mbsim.reader.kinds import (
    COUNT,
    EXPRESSION,
    FLAG,
    ID,
    NOT_NEGATIVE,
    POSITIVE,
    REAL,
    TEXT,
    USER,
    keyword,
)
from mbsim.reader.parse import Node
from mbsim.reader.statement import Entry, Spec
from mbsim.reader.subroutine import result
from mbsim.reader.tables import add_spline


@dataclass
class AdmDraft(Draft):
    """A draft that also knows where the parts' frames are.

    `puzzling` holds statements with words that nobody knows: what they lack may be just that.
    """

    parts: dict[int, Frame] = field(default_factory=dict)
    puzzling: set[str] = field(default_factory=set)


_NOT_BUILT = "is documented but not built yet"
_HARMLESS = "has no effect in mbsim"
_ID = {"id": Spec(ID, required=True)}
_MARKERS = {"I": Spec(ID, required=True), "J": Spec(ID, required=True)}


def _words(attribute: str, *values: str) -> dict[str, tuple[str, str]]:
    """Return words that each mean themselves as the value of one attribute."""
    return {value: (attribute, value) for value in values}


def _choice(*values: str) -> Spec:
    return Spec(keyword({fold(value): value for value in values}))


def _frame(entry: Entry, origin: str, z: str, x: str, z_first: bool = True) -> Frame:
    """Return a frame from its origin and its 3-1-3 angles, or a point on its z-axis and one on x.

    With points, the one on the first axis is on it, the other in the xz-plane.
    """
    p = np.array(entry.get(origin, (0.0, 0.0, 0.0)))
    points = [name for name in (z, x) if entry.given(name)]
    if entry.given("REULER") and points:
        entry.fault(f"give REULER or {z} and {x}, not both")
    if not points:
        return Frame(p, rotation_313(*entry.get("REULER", (0.0, 0.0, 0.0))))
    if len(points) == 1:
        entry.fault(f"{x if points == [z] else z}: missing; {z} and {x} must be given together")
    if entry.get(z) is None or entry.get(x) is None:
        return Frame(p, np.eye(3))
    to_z, to_x = np.array(entry.get(z)) - p, np.array(entry.get(x)) - p
    y = np.cross(to_z, to_x)
    if not np.linalg.norm(y) > 1e-9 * np.linalg.norm(to_z) * np.linalg.norm(to_x):
        entry.fault(f"{z} and {x} are in one line with the origin and give no axes")
        return Frame(p, np.eye(3))
    y = y / np.linalg.norm(y)
    if z_first:
        e_z = to_z / np.linalg.norm(to_z)
        return Frame(p, np.column_stack((np.cross(y, e_z), y, e_z)))
    e_x = to_x / np.linalg.norm(to_x)
    return Frame(p, np.column_stack((e_x, y, np.cross(e_x, y))))


def _draft(entry: Entry) -> AdmDraft:
    assert isinstance(entry.draft, AdmDraft)
    return entry.draft


def _missing(entry: Entry, name: str, more: str = "") -> None:
    """Add the fault that a word is missing, where it is not one that nobody knows."""
    if not entry.given(name) and entry.label not in _draft(entry).puzzling:
        allowed = entry.statement.attributes[name].kind.allowed
        entry.fault(f"{name.lower()}: missing; must be {allowed}{more}")


def _build_units(entry: Entry) -> None:
    """Set the draft's units, once."""
    if entry.draft.units is not None:
        entry.fault("a second UNITS; a deck has one")
        return
    single = {key: entry.get(key.upper()) for key in ("force", "mass", "length", "time")}
    chosen = {key: name for key, name in single.items() if name is not None}
    system = entry.get("SYSTEM")
    if system is not None and chosen:
        entry.fault("give SYSTEM or FORCE, MASS, LENGTH and TIME, not both", "SYSTEM")
    entry.draft.units = units.make_units(**(_SYSTEMS[system] if system else chosen))


def _build_part(entry: Entry) -> None:
    """Add a part; its frame is kept for its markers."""
    id = entry.get("id", 0)
    frame = _frame(entry, "QG", "ZG", "XG")
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
    _draft(entry).parts[id] = frame
    entry.register(entry.draft.bodies, body)


def _given(entry: Entry, kind: str) -> tuple[bool, bool, bool]:
    """Return which components of a velocity the deck gives."""
    x, y, z = (entry.given(f"{kind}{axis}") for axis in "XYZ")
    return x, y, z


def _build_marker(entry: Entry) -> None:
    """Add a marker, whose place in its part becomes one in the global frame."""
    frame = _frame(entry, "QP", "ZP", "XP", not entry.get("USEXP", False))
    part = _draft(entry).parts.get(entry.get("PART", 0), GLOBAL)
    p = part.p + part.R @ frame.p
    marker = el.Marker(
        id=entry.get("id", 0),
        body_id=entry.get("PART", 0),
        pos=(float(p[0]), float(p[1]), float(p[2])),
        R=part.R @ frame.R,
        source=entry.source,
        floating=entry.get("FLOATING", False),
    )
    entry.register(entry.draft.markers, marker)


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


def _build_joint(entry: Entry) -> None:
    """Add a joint."""
    type = entry.get("TYPE")
    if type is None:
        _missing(entry, "TYPE")
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
    entry.register(entry.draft.joints, joint)


def _build_primitive(entry: Entry) -> None:
    """Add a joint primitive."""
    type = entry.get("TYPE")
    if type is None:
        _missing(entry, "TYPE")
        return
    joint = el.Joint(
        id=entry.get("id", 0),
        type="SPHERICAL" if type == "ATPOINT" else type,
        i_marker_id=entry.get("I", 0),
        j_marker_id=entry.get("J", 0),
        is_primitive=True,
        source=entry.source,
    )
    entry.register(entry.draft.primitives, joint)


def _build_constraint(entry: Entry) -> None:
    """Add a constraint by an expression."""
    if entry.get("FUNCTION") is not None:
        constraint = el.GeneralConstraint(
            entry.get("id", 0), entry.get("FUNCTION"), source=entry.source
        )
        entry.register(entry.draft.general_constraints, constraint)


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
        _missing(entry, "DIRECTION")
    return str(word)


def _build_motion(entry: Entry) -> None:
    """Add a motion."""
    val_type = entry.get("VALUE", "DISPLACEMENT")[0]
    note_unused_starts(entry, val_type, "ICDISP", "ICVEL")
    motion = el.Motion(
        id=entry.get("id", 0),
        joint_id=entry.get("JOINT"),
        i_marker_id=entry.get("I", 0),
        j_marker_id=entry.get("J", 0),
        direction=_motion_direction(entry),
        val_type=val_type,
        expr=entry.get("FUNCTION"),
        ic_disp=entry.get("ICDISP") if val_type != "D" else None,
        ic_vel=entry.get("ICVEL") if val_type == "A" else None,
        source=entry.source,
    )
    entry.register(entry.draft.motions, motion)


def _build_gravity(entry: Entry) -> None:
    """Set the model's gravity."""
    if entry.draft.gravity is not None:
        line = entry.draft.gravity.source.line
        entry.fault(f"a second ACCGRAV; the first is on line {line}")
        return
    x, y, z = (entry.get(f"{axis}GRAV", 0.0) for axis in "IJK")
    entry.draft.gravity = el.Gravity((x, y, z), entry.source)


_OF_SPRINGS = {
    "TRANSLATIONAL": ("K", "C", "LENGTH", "FORCE"),
    "ROTATIONAL": ("KT", "CT", "ANGLE", "TORQUE"),
}


def _type_of(entry: Entry) -> str:
    """Return TRANSLATIONAL or ROTATIONAL, with a fault where the deck says neither."""
    type: str | None = entry.get("TYPE")
    if type is None:
        _missing(entry, "TYPE")
        return "TRANSLATIONAL"
    return type


def _build_spring(entry: Entry) -> None:
    """Add a spring-damper."""
    type = _type_of(entry)
    names = _OF_SPRINGS[type]
    for name in entry.statement.attributes:
        if entry.given(name) and name in {
            *_OF_SPRINGS["TRANSLATIONAL"],
            *_OF_SPRINGS["ROTATIONAL"],
        }:
            if name not in names:
                entry.fault(f"belongs to the other type; {type} has {', '.join(names)}", name)
    stiffness, damping, length, preload = (entry.get(name, 0.0) for name in names)
    spring = el.SpringDamper(
        id=entry.get("id", 0),
        type=type,
        i_marker_id=entry.get("I", 0),
        j_marker_id=entry.get("J", 0),
        stiffness=stiffness,
        damping=damping,
        length=length,
        preload=preload,
        source=entry.source,
    )
    entry.register(entry.draft.spring_dampers, spring)


def _build_scalar(entry: Entry) -> None:
    """Add a scalar force."""
    type = _type_of(entry)
    expr, user = function_or_user(entry, "SFORCE", "SFOSUB")
    if expr is None:
        return
    force = el.ScalarForce(
        id=entry.get("id", 0),
        type=type,
        expr=expr,
        user=user,
        i_marker_id=entry.get("I", 0),
        j_marker_id=entry.get("J", 0),
        action_only=entry.get("ACTIONONLY", False),
        source=entry.source,
    )
    entry.register(entry.draft.scalar_forces, force)


_VECTORS = {"VFORCE": "FORCEONLY", "VTORQUE": "TORQUEONLY", "GFORCE": "FORCEANDTORQUE"}
_VECTOR_SUBROUTINES = {"VFORCE": "VFOSUB", "VTORQUE": "VTOSUB", "GFORCE": "GFOSUB"}


def _build_vector(entry: Entry) -> None:
    """Add a vector force, torque or both."""
    names = [name for name in _COMPONENTS if name in entry.statement.attributes]
    given = [name for name in names if entry.given(name)]
    exprs = tuple(entry.get(name) for name in _COMPONENTS)
    user = routine(entry, _VECTOR_SUBROUTINES[entry.statement.name])
    for name in given if entry.given("FUNCTION") else ():
        entry.fault("give FUNCTION or components, not both", name)
    if user is not None:
        exprs = tuple(
            result(entry, "VECTORFORCE", user, names.index(name)) if name in names else None
            for name in _COMPONENTS
        )
    elif not given and not entry.given("FUNCTION"):
        entry.fault(f"{names[0]} ... {names[-1]}: missing; at least one must be given")
    force = el.VectorForce(
        id=entry.get("id", 0),
        type=_VECTORS[entry.statement.name],
        exprs=exprs,
        user=user,
        i_marker_id=entry.get("I", 0),
        j_floating_marker_id=entry.get("JFLOAT", 0),
        ref_marker_id=entry.get("RM"),
        source=entry.source,
    )
    other = entry.draft.vector_forces.get(force.id)
    if other is not None and other.type != force.type:
        first = next(name for name, type in _VECTORS.items() if type == other.type)
        where = f"the {first} on line {other.source.line}"
        entry.fault(f"id already used by {where}; {', '.join(_VECTORS)} share their ids here", "id")
        return
    entry.register(entry.draft.vector_forces, force)


def _build_variable(entry: Entry) -> None:
    """Add a variable."""
    expr, user = function_or_user(entry, "VARIABLE", "VARSUB")
    if expr is not None:
        variable = el.Variable(entry.get("id", 0), expr, user=user, source=entry.source)
        entry.register(entry.draft.variables, variable)


def _build_differential(entry: Entry) -> None:
    """Add a state."""
    if entry.get("FUNCTION") is not None:
        state = el.Differential(
            entry.get("id", 0), entry.get("FUNCTION"), entry.get("IC", 0.0), source=entry.source
        )
        entry.register(entry.draft.differentials, state)


def _build_spline(entry: Entry) -> None:
    """Add a spline; of a surface each Y is a value of z and the curve there."""
    x, rows = entry.get("X"), entry.get("Y")
    if x is None or rows is None:
        return
    z: tuple[float, ...] = ()
    if len(rows) > 1 or len(rows[0]) == len(x) + 1:
        z, rows = tuple(row[0] for row in rows), tuple(row[1:] for row in rows)
    add_spline(entry, x, rows, z, "X", "Y")


def _build_array(entry: Entry) -> None:
    """Add an array of numbers."""
    values, size = entry.get("NUMBERS"), entry.get("SIZE")
    if values is None:
        return
    if size is not None and size != len(values):
        entry.fault(f"there are {len(values)} NUMBERS", "SIZE")
    array = el.ArrayOfNumbers(entry.get("id", 0), values, source=entry.source)
    entry.register(entry.draft.arrays, array)


def _build_sensor(entry: Entry) -> None:
    """Add a sensor."""
    if entry.get("FUNCTION") is None:
        return
    sensor = el.Sensor(
        entry.get("id", 0),
        entry.get("FUNCTION"),
        compare=entry.get("COMPARE", "EQ"),
        value=entry.get("VALUE", 0.0),
        error_tol=entry.get("ERROR", 1e-3),
        zero_crossing=entry.get("BISECTION", False),
        evaluate=entry.get("EVALUATE"),
        halt=entry.get("HALT", False),
        stops=entry.get("RETURN", False),
        prints=entry.get("PRINT", False),
        dt=entry.get("DT"),
        stepsize=entry.get("STEPSIZE"),
        source=entry.source,
    )
    add_sensor(entry, sensor)


_COMPARE = ("EQ", "GE", "LE")
_SENSOR_FLAGS = ("HALT", "PRINT", "RETURN")
_OF_RESTARTS = ("CODGEN", "YYDUMP", "RESTART")
_FUNCTIONS = tuple(f"F{k}" for k in range(1, 9))


def _build_request(entry: Entry) -> None:
    """Add a request, by markers or by functions."""
    word = entry.get("TYPE")
    functions = [name for name in _FUNCTIONS if entry.given(name)]
    by_markers = [name for name in ("I", "J", "RM") if entry.given(name)]
    if word is None and not functions:
        _missing(entry, "TYPE", ", or functions F1 ... F8")
    if functions and (word or by_markers):
        other = ", ".join(([word] if word else []) + by_markers)
        entry.fault(f"give functions or markers, not both ({', '.join(functions)} and {other})")
    if word is not None and not entry.given("I"):
        entry.fault(f"I: missing; must be {ID.allowed}")
    request = el.Request(
        id=entry.get("id", 0),
        type="EXPRESSION" if functions else f"MARKER_{word}",
        label=entry.get("TITLE", ""),
        comment=entry.get("COMMENT", ""),
        i_marker_id=entry.get("I", 0),
        j_marker_id=entry.get("J"),
        ref_marker_id=entry.get("RM"),
        exprs=tuple(entry.get(name) for name in _FUNCTIONS) if functions else (),
        source=entry.source,
    )
    entry.register(entry.draft.requests, request)


def _build_integrator(entry: Entry) -> None:
    """Set tolerance and steps; the method is mbsim's own."""
    draft = entry.draft
    if draft.transient is not None:
        entry.fault(f"a second INTEGRATOR; the first is on line {draft.transient.source.line}")
        return
    h_min, h_max = entry.get("HMIN"), entry.get("HMAX")
    if h_min is not None and h_max is not None and h_min > h_max:
        entry.fault(f"must not be larger than HMAX ({h_max:g})", "HMIN")
    draft.transient = el.Transient(
        # Adams' own default, 1e-3, stands for the default of Adams decks
        integr_tol=None if entry.get("ERROR") is None else 1e-5 * entry.get("ERROR"),
        h_max=h_max,
        h_min=h_min,
        h0_max=entry.get("HINIT"),
        source=entry.source,
    )


def _everything(node: Node) -> bool:
    return True


def _output_only(name: str, what: str) -> AdmStatement:
    """Return a statement that cannot change motion, so that its arguments are not looked at."""
    return AdmStatement(name, note=what, any_attribute=_everything)


_SYSTEMS = {
    "MKS": {"force": "NEWTON", "mass": "KILOGRAM", "length": "METER", "time": "SECOND"},
    "CGS": {"force": "DYNE", "mass": "GRAM", "length": "CENTIMETER", "time": "SECOND"},
    "FPS": {"force": "POUND_FORCE", "mass": "SLUG", "length": "FOOT", "time": "SECOND"},
}
_TYPES = ("TRANSLATIONAL", "ROTATIONAL")
_TYPE_WORDS = _words("TYPE", *_TYPES)
_JOINT_TYPES = (
    *("REVOLUTE", "TRANSLATIONAL", "CYLINDRICAL", "SPHERICAL", "UNIVERSAL", "HOOKE", "PLANAR"),
    *("FIXED", "SCREW", "RACKPIN", "CONVEL"),
)
_PRIMITIVES = ("ATPOINT", "INLINE", "INPLANE", "ORIENTATION", "PARALLEL_AXES", "PERPENDICULAR")
_METHODS = ("GSTIFF", "WSTIFF", "HASTIFF", "HHT", "NEWMARK", "CONSTANT_BDF", "ABAM", "RKF45")
_FORMULATIONS = ("I3", "SI2", "SI1", "SI0")
_OF_METHODS = ("KMAX", "MAXIT", "CORRECTOR", "PATTERN", "FORMULATION", "INTERPOLATE", "ADAPTIVITY")
_DIRECTION_WORDS = ("ROTATION", "TRANSLATION", "X", "Y", "Z", "B1", "B2", "B3")
_VALUES = ("DISPLACEMENT", "VELOCITY", "ACCELERATION")
_REQUESTS = (*_VALUES, "FORCE")
_TRUE = Spec(FLAG)

_COMPONENTS = ("FX", "FY", "FZ", "TX", "TY", "TZ")


def _vector(name: str, components: tuple[str, ...]) -> AdmStatement:
    """Return the statement of a vector force with these components."""
    return AdmStatement(
        name,
        {
            **_ID,
            "I": Spec(ID, required=True),
            "JFLOAT": Spec(ID, required=True),
            "RM": Spec(ID),
            **{component: Spec(EXPRESSION) for component in components},
            "FUNCTION": Spec(USER),
            "ROUTINE": Spec(ROUTINE),
        },
        _build_vector,
        xml="Force_Vector_TwoBody",
    )


STATEMENTS = (
    AdmStatement(
        "UNITS",
        {
            "FORCE": Spec(keyword(units.names(units.FORCE))),
            "MASS": Spec(keyword(units.names(units.MASS))),
            "LENGTH": Spec(keyword(units.names(units.LENGTH))),
            "TIME": Spec(keyword(units.names(units.TIME))),
            "SYSTEM": Spec(keyword({name.lower(): name for name in _SYSTEMS})),
            "UCF": Spec(REAL, refused=f"{_NOT_BUILT}; the factor follows from the units"),
        },
        _build_units,
        xml="Param_Unit",
    ),
    AdmStatement(
        "PART",
        {
            **_ID,
            "GROUND": _TRUE,
            "MASS": Spec(POSITIVE),
            "CM": Spec(ID),
            "IM": Spec(ID),
            "IP": Spec(numbers(3, 6)),
            "QG": Spec(numbers(3)),
            "REULER": Spec(angles(3)),
            "ZG": Spec(numbers(3)),
            "XG": Spec(numbers(3)),
            **{name: Spec(REAL) for name in ("VX", "VY", "VZ")},
            **{name: Spec(ANGLE) for name in ("WX", "WY", "WZ")},
            "VM": Spec(ID),
            "WM": Spec(ID),
            "EXACT": Spec(ANY, note="all parts stay where the deck puts them, if joints allow it"),
        },
        _build_part,
        words={"GROUND": ("GROUND", "TRUE")},
        xml="Body_Rigid",
    ),
    AdmStatement(
        "MARKER",
        {
            **_ID,
            "PART": Spec(ID, required=True),
            "QP": Spec(numbers(3)),
            "REULER": Spec(angles(3)),
            "ZP": Spec(numbers(3)),
            "XP": Spec(numbers(3)),
            "USEXP": _TRUE,
            "FLOATING": _TRUE,
            **{name: Spec(refused=_NOT_BUILT) for name in ("POINT_MASS", "FLEX_BODY", "NODE_ID")},
        },
        _build_marker,
        words={"USEXP": ("USEXP", "TRUE"), "FLOATING": ("FLOATING", "TRUE")},
        xml="Reference_Marker",
    ),
    AdmStatement(
        "JOINT",
        {
            **_ID,
            "TYPE": _choice(*_JOINT_TYPES),
            **_MARKERS,
            "PITCH": Spec(REAL),
            "PD": Spec(POSITIVE),
            "ICTRAN": Spec(numbers(1, 2)),
            "ICROT": Spec(angles(2)),
        },
        _build_joint,
        words=_words("TYPE", *_JOINT_TYPES),
        xml="Constraint_Joint",
    ),
    AdmStatement(
        "JPRIM",
        {**_ID, "TYPE": _choice(*_PRIMITIVES), **_MARKERS},
        _build_primitive,
        words=_words("TYPE", *_PRIMITIVES),
        xml="Constraint_Jprim",
    ),
    AdmStatement(
        "GCON",
        {
            **_ID,
            "I": Spec(ID, note="says where Adams reports the force; mbsim reports it by markers"),
            "FUNCTION": Spec(EXPRESSION, required=True),
        },
        _build_constraint,
        xml="Constraint_General",
    ),
    AdmStatement(
        "MOTION",
        {
            **_ID,
            "JOINT": Spec(ID),
            "I": Spec(ID),
            "J": Spec(ID),
            "DIRECTION": _choice(*_DIRECTION_WORDS),
            "VALUE": _choice(*_VALUES),
            "FUNCTION": Spec(EXPRESSION, required=True),
            "ICDISP": Spec(ANGLE),
            "ICVEL": Spec(ANGLE),
        },
        _build_motion,
        words=_words("DIRECTION", *_DIRECTION_WORDS) | _words("VALUE", *_VALUES),
        xml="Motion_Joint",
    ),
    AdmStatement(
        "ACCGRAV",
        {f"{axis}GRAV": Spec(REAL) for axis in "IJK"},
        _build_gravity,
        xml="Force_Gravity",
    ),
    AdmStatement(
        "SPRINGDAMPER",
        {
            **_ID,
            "TYPE": _choice(*_TYPES),
            **_MARKERS,
            **{name: Spec(NOT_NEGATIVE) for name in ("K", "C", "KT", "CT", "LENGTH")},
            **{name: Spec(REAL) for name in ("FORCE", "TORQUE")},
            "ANGLE": Spec(ANGLE),
        },
        _build_spring,
        words=_TYPE_WORDS,
        xml="Force_SpringDamper",
    ),
    AdmStatement(
        "SFORCE",
        {
            **_ID,
            "TYPE": _choice(*_TYPES),
            **_MARKERS,
            "ACTIONONLY": _TRUE,
            "FUNCTION": Spec(EXPRESSION_OR_USER, required=True),
            "ROUTINE": Spec(ROUTINE),
        },
        _build_scalar,
        words=_TYPE_WORDS | {"ACTIONONLY": ("ACTIONONLY", "TRUE")},
        xml="Force_Scalar_TwoBody",
    ),
    *marker_forces(),
    _vector("VFORCE", _COMPONENTS[:3]),
    _vector("VTORQUE", _COMPONENTS[3:]),
    _vector("GFORCE", _COMPONENTS),
    AdmStatement(
        "VARIABLE",
        {
            **_ID,
            "FUNCTION": Spec(EXPRESSION_OR_USER, required=True),
            "ROUTINE": Spec(ROUTINE),
            "IC": Spec(REAL, note="has no effect: the value follows from the function"),
        },
        _build_variable,
        xml="Reference_Variable",
    ),
    AdmStatement(
        "DIFF",
        {
            **_ID,
            "FUNCTION": Spec(EXPRESSION, required=True),
            "IC": Spec(REAL),
            "STATIC_HOLD": Spec(FLAG, note=_HARMLESS),
            "IMPLICIT": Spec(FLAG, refused="an implicit equation is not built; solve it for z'"),
        },
        _build_differential,
        words={"STATIC_HOLD": ("STATIC_HOLD", "TRUE"), "IMPLICIT": ("IMPLICIT", "TRUE")},
        xml="Control_Diff",
    ),
    AdmStatement(
        "SPLINE",
        {
            **_ID,
            "X": Spec(NUMBERS, required=True),
            "Y": Spec(ROWS, required=True, repeats=True),
            "LINEAR_EXTRAPOLATE": _TRUE,
            "FILE": Spec(refused=f"{_NOT_BUILT}; give X and Y"),
            "BLOCK": Spec(refused=f"{_NOT_BUILT}; give X and Y"),
            "CHANNEL": Spec(refused=f"{_NOT_BUILT}; give X and Y"),
        },
        _build_spline,
        words={"LINEAR_EXTRAPOLATE": ("LINEAR_EXTRAPOLATE", "TRUE")},
        xml="Reference_Spline",
    ),
    AdmStatement(
        "ARRAY",
        {
            **_ID,
            "KIND": Spec(keyword({"ic": "IC"}, {"x": "X", "y": "Y", "u": "U"})),
            "SIZE": Spec(COUNT),
            "NUMBERS": Spec(NUMBERS, required=True),
            "VARIABLES": Spec(refused=_NOT_BUILT),
        },
        _build_array,
        words=_words("KIND", "IC", "X", "Y", "U"),
        xml="Reference_Array",
    ),
    AdmStatement(
        "SENSOR",
        {
            **_ID,
            "FUNCTION": Spec(EXPRESSION, required=True),
            "VALUE": Spec(REAL),
            "ERROR": Spec(NOT_NEGATIVE),
            "COMPARE": _choice(*_COMPARE),
            "EVALUATE": Spec(EXPRESSION),
            "DT": Spec(POSITIVE),
            "STEPSIZE": Spec(POSITIVE),
            **{name: Spec(FLAG) for name in _SENSOR_FLAGS},
            "BISECTION": Spec(FLAG),
            "CODGEN": Spec(FLAG, note=_HARMLESS),
            "YYDUMP": Spec(FLAG, note=_HARMLESS),
            "RESTART": Spec(FLAG, note=_HARMLESS),
        },
        _build_sensor,
        words=_words("COMPARE", *_COMPARE)
        | {name: (name, "TRUE") for name in (*_SENSOR_FLAGS, "BISECTION", *_OF_RESTARTS)},
        xml="Sensor_Event",
    ),
    AdmStatement(
        "REQUEST",
        {
            **_ID,
            "TYPE": _choice(*_REQUESTS),
            "I": Spec(ID),
            "J": Spec(ID),
            "RM": Spec(ID),
            "COMMENT": Spec(TEXT),
            "TITLE": Spec(TEXT),
            **{name: Spec(EXPRESSION) for name in _FUNCTIONS},
            "FUNCTION": Spec(refused=f"{_NOT_BUILT}; use F1 ... F8"),
        },
        _build_request,
        words=_words("TYPE", *_REQUESTS),
        xml="Post_Request",
    ),
    AdmStatement(
        "INTEGRATOR",
        {
            "ERROR": Spec(POSITIVE),
            "HMAX": Spec(POSITIVE),
            "HMIN": Spec(POSITIVE),
            "HINIT": Spec(POSITIVE),
            "METHOD": Spec(keyword({fold(m): m for m in _METHODS}), note="the method is mbsim's"),
            **{name: Spec(ANY, note=_HARMLESS) for name in _OF_METHODS},
        },
        _build_integrator,
        words=_words("METHOD", *_METHODS)
        | _words("FORMULATION", *_FORMULATIONS)
        | {"INTERPOLATE": ("INTERPOLATE", "ON")},
        xml="Param_Transient",
    ),
    _output_only("GRAPHICS", "no picture is drawn"),
    _output_only("OUTPUT", "result files are mbsim's own (HDF5 and CSV); it sets nothing"),
    _output_only("RESULTS", "result files are mbsim's own (HDF5 and CSV); it sets nothing"),
    AdmStatement("END"),
)
BY_KEY = {fold(statement.name): statement for statement in STATEMENTS}

# the others of the language, which would change the motion or what is known of it; those that have
# been built are none of them
_DOCUMENTED = (
    "BEAM CONTACT COUPLER CURVE CVCV EQUILIBRIUM FIELD FLEX_BODY FRICTION GEAR "
    "GSE IC KINEMATICS LSE MATRIX MFORCE NFORCE PINPUT POINT_MASS POUTPUT PREFERENCES "
    "PTCV PTSF STRING SURFACE TFSISO TIRE UCON"
).split()
NOT_BUILT = [name for name in _DOCUMENTED if fold(name) not in BY_KEY]

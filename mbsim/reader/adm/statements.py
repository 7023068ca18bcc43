"""Every statement of an Adams deck that the reader knows, and what each becomes."""

from __future__ import annotations

from mbsim.reader import units
from mbsim.reader.adm.bodies import (
    SYSTEMS,
    build_constraint,
    build_gravity,
    build_joint,
    build_marker,
    build_motion,
    build_part,
    build_point_mass,
    build_primitive,
    build_units,
)
from mbsim.reader.adm.contacts import CONTACT, GRAPHICS
from mbsim.reader.adm.control import (
    COMPARE,
    FORMULATIONS,
    FUNCTIONS,
    METHODS,
    OF_METHODS,
    OF_RESTARTS,
    SENSOR_FLAGS,
    build_array,
    build_differential,
    build_equilibrium,
    build_integrator,
    build_request,
    build_sensor,
    build_spline,
    build_variable,
)
from mbsim.reader.adm.couplers import COUPLER, GEAR
from mbsim.reader.adm.curves import CURVE, CVCV, PTCV
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
from mbsim.reader.adm.forces import (
    COMPONENTS,
    build_scalar,
    build_spring,
    build_vector,
)
from mbsim.reader.adm.friction import FRICTION
from mbsim.reader.adm.linear_systems import GSE, LSE, MATRIX, PINPUT, POUTPUT, TFSISO, VARIABLES
from mbsim.reader.adm.marker_forces import NFORCE, marker_forces
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
from mbsim.reader.statement import Spec

_NOT_BUILT = "is documented but not built yet"
_HARMLESS = "has no effect in mbsim"
_OWN_SEARCH = (
    "has no effect: mbsim's own search goes on until forces balance to rounding; "
    "IMBALANCE and MAXIT bound it"
)
_ID = {"id": Spec(ID, required=True)}
_MARKERS = {"I": Spec(ID, required=True), "J": Spec(ID, required=True)}


def _words(attribute: str, *values: str) -> dict[str, tuple[str, str]]:
    """Return words that each mean themselves as the value of one attribute."""
    return {value: (attribute, value) for value in values}


def _choice(*values: str) -> Spec:
    return Spec(keyword({fold(value): value for value in values}))


def _everything(node: Node) -> bool:
    return True


def output_only(name: str, what: str) -> AdmStatement:
    """Return a statement that cannot change motion, so that its arguments are not looked at."""
    return AdmStatement(name, note=what, any_attribute=_everything)


_TYPES = ("TRANSLATIONAL", "ROTATIONAL")
_TYPE_WORDS = _words("TYPE", *_TYPES)
_JOINT_TYPES = (
    *("REVOLUTE", "TRANSLATIONAL", "CYLINDRICAL", "SPHERICAL", "UNIVERSAL", "HOOKE", "PLANAR"),
    *("FIXED", "SCREW", "RACKPIN", "CONVEL"),
)
_PRIMITIVES = ("ATPOINT", "INLINE", "INPLANE", "ORIENTATION", "PARALLEL_AXES", "PERPENDICULAR")
_DIRECTION_WORDS = ("ROTATION", "TRANSLATION", "X", "Y", "Z", "B1", "B2", "B3")
_VALUES = ("DISPLACEMENT", "VELOCITY", "ACCELERATION")
_REQUESTS = (*_VALUES, "FORCE")
_TRUE = Spec(FLAG)


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
        build_vector,
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
            "SYSTEM": Spec(keyword({name.lower(): name for name in SYSTEMS})),
            "UCF": Spec(REAL, refused=f"{_NOT_BUILT}; the factor follows from the units"),
        },
        build_units,
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
        build_part,
        words={"GROUND": ("GROUND", "TRUE")},
        xml="Body_Rigid",
    ),
    AdmStatement(
        "POINT_MASS",
        {
            **_ID,
            "MASS": Spec(POSITIVE, required=True),
            "CM": Spec(ID, required=True),
            "QG": Spec(numbers(3)),
            "REULER": Spec(angles(3)),
            "ZG": Spec(numbers(3)),
            "XG": Spec(numbers(3)),
            **{name: Spec(REAL) for name in ("VX", "VY", "VZ")},
            "EXACT": Spec(ANY, note="all parts stay where the deck puts them, if joints allow it"),
        },
        build_point_mass,
        xml="Body_Point",
    ),
    AdmStatement(
        "MARKER",
        {
            **_ID,
            "PART": Spec(ID),
            "POINT_MASS": Spec(ID),
            "QP": Spec(numbers(3)),
            "REULER": Spec(angles(3)),
            "ZP": Spec(numbers(3)),
            "XP": Spec(numbers(3)),
            "USEXP": _TRUE,
            "FLOATING": _TRUE,
            **{name: Spec(refused=_NOT_BUILT) for name in ("FLEX_BODY", "NODE_ID")},
        },
        build_marker,
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
        build_joint,
        words=_words("TYPE", *_JOINT_TYPES),
        xml="Constraint_Joint",
    ),
    AdmStatement(
        "JPRIM",
        {**_ID, "TYPE": _choice(*_PRIMITIVES), **_MARKERS},
        build_primitive,
        words=_words("TYPE", *_PRIMITIVES),
        xml="Constraint_Jprim",
    ),
    COUPLER,
    GEAR,
    CURVE,
    PTCV,
    CVCV,
    AdmStatement(
        "GCON",
        {
            **_ID,
            "I": Spec(ID, note="says where Adams reports the force; mbsim reports it by markers"),
            "FUNCTION": Spec(EXPRESSION, required=True),
        },
        build_constraint,
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
            "FUNCTION": Spec(EXPRESSION_OR_USER, required=True),
            "ROUTINE": Spec(ROUTINE),
            "ICDISP": Spec(ANGLE),
            "ICVEL": Spec(ANGLE),
        },
        build_motion,
        words=_words("DIRECTION", *_DIRECTION_WORDS) | _words("VALUE", *_VALUES),
        xml="Motion_Joint",
    ),
    AdmStatement(
        "ACCGRAV",
        {f"{axis}GRAV": Spec(REAL) for axis in "IJK"},
        build_gravity,
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
        build_spring,
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
        build_scalar,
        words=_TYPE_WORDS | {"ACTIONONLY": ("ACTIONONLY", "TRUE")},
        xml="Force_Scalar_TwoBody",
    ),
    *marker_forces(),
    NFORCE,
    _vector("VFORCE", COMPONENTS[:3]),
    _vector("VTORQUE", COMPONENTS[3:]),
    _vector("GFORCE", COMPONENTS),
    AdmStatement(
        "VARIABLE",
        {
            **_ID,
            "FUNCTION": Spec(EXPRESSION_OR_USER, required=True),
            "ROUTINE": Spec(ROUTINE),
            "IC": Spec(REAL, note="has no effect: the value follows from the function"),
        },
        build_variable,
        xml="Reference_Variable",
    ),
    AdmStatement(
        "DIFF",
        {
            **_ID,
            "FUNCTION": Spec(EXPRESSION_OR_USER, required=True),
            "ROUTINE": Spec(ROUTINE),
            "IC": Spec(REAL),
            "STATIC_HOLD": Spec(FLAG),
            "IMPLICIT": Spec(FLAG, refused="an implicit equation is not built; solve it for z'"),
        },
        build_differential,
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
        build_spline,
        words={"LINEAR_EXTRAPOLATE": ("LINEAR_EXTRAPOLATE", "TRUE")},
        xml="Reference_Spline",
    ),
    AdmStatement(
        "ARRAY",
        {
            **_ID,
            "KIND": Spec(keyword({"ic": "IC", "x": "X", "y": "Y", "u": "U"})),
            "SIZE": Spec(COUNT),
            "NUMBERS": Spec(NUMBERS),
            "VARIABLES": Spec(VARIABLES),
        },
        build_array,
        words=_words("KIND", "IC", "X", "Y", "U"),
        xml="Reference_Array",
    ),
    MATRIX,
    GSE,
    LSE,
    PINPUT,
    POUTPUT,
    TFSISO,
    AdmStatement(
        "SENSOR",
        {
            **_ID,
            "FUNCTION": Spec(EXPRESSION_OR_USER, required=True),
            "ROUTINE": Spec(ROUTINE),
            "VALUE": Spec(REAL),
            "ERROR": Spec(NOT_NEGATIVE),
            "COMPARE": _choice(*COMPARE),
            "EVALUATE": Spec(EXPRESSION),
            "DT": Spec(POSITIVE),
            "STEPSIZE": Spec(POSITIVE),
            **{name: Spec(FLAG) for name in SENSOR_FLAGS},
            "BISECTION": Spec(FLAG),
            "CODGEN": Spec(FLAG, note=_HARMLESS),
            "YYDUMP": Spec(FLAG, note=_HARMLESS),
            "RESTART": Spec(FLAG, note=_HARMLESS),
        },
        build_sensor,
        words=_words("COMPARE", *COMPARE)
        | {name: (name, "TRUE") for name in (*SENSOR_FLAGS, "BISECTION", *OF_RESTARTS)},
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
            **{name: Spec(EXPRESSION) for name in FUNCTIONS},
            "FUNCTION": Spec(USER),
            "ROUTINE": Spec(ROUTINE),
        },
        build_request,
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
            "METHOD": Spec(keyword({fold(m): m for m in METHODS}), note="the method is mbsim's"),
            **{name: Spec(ANY, note=_HARMLESS) for name in OF_METHODS},
        },
        build_integrator,
        words=_words("METHOD", *METHODS)
        | _words("FORMULATION", *FORMULATIONS)
        | {"INTERPOLATE": ("INTERPOLATE", "ON")},
        xml="Param_Transient",
    ),
    AdmStatement(
        "EQUILIBRIUM",
        {
            "MAXIT": Spec(COUNT),
            "IMBALANCE": Spec(POSITIVE),
            **{
                name: Spec(ANY, note=_OWN_SEARCH)
                for name in (
                    *("ALIMIT", "TLIMIT", "ERROR", "STABILITY", "PATTERN", "METHOD"),
                    *("DYNAMIC", "STATIC", "GLOBAL_DAMPING", "KINETIC_ENERGY_ERROR"),
                    *("ACCELERATION_ERROR", "SETTLING_TIME", "DYNAMIC_SETTLING_TIME"),
                )
            },
        },
        build_equilibrium,
        words={"STATIC": ("STATIC", "TRUE"), "DYNAMIC": ("DYNAMIC", "TRUE")},
        xml="Param_Static",
    ),
    GRAPHICS,
    CONTACT,
    FRICTION,
    output_only("IC", "joints are put together by mbsim's own iteration, to rounding"),
    output_only("KINEMATICS", "positions are solved for to rounding at each time; it sets nothing"),
    output_only("PREFERENCES", "it says how Adams is run; it sets nothing"),
    output_only("LSOLVER", "mbsim has linear algebra of its own; it sets nothing"),
    output_only("DEBUG", "it says what Adams prints; see the log"),
    output_only("MREQUEST", "no requests are made of it; positions of all bodies are kept"),
    output_only("OUTPUT", "result files are mbsim's own (HDF5 and CSV); it sets nothing"),
    output_only("RESULTS", "result files are mbsim's own (HDF5 and CSV); it sets nothing"),
    AdmStatement("END"),
)
BY_KEY = {fold(statement.name): statement for statement in STATEMENTS}

# the others of the language, which would change the motion or what is known of it; those that have
# been built are none of them
_DOCUMENTED = (
    "BEAM CONTACT COUPLER CURVE CVCV EQUILIBRIUM FIELD FLEX_BODY FRICTION GEAR "
    "GSE IC LSE MATRIX MFORCE NFORCE PINPUT POINT_MASS POUTPUT PTCV PTSF STRING SURFACE TFSISO "
    "TIRE UCON"
).split()
NOT_BUILT = [name for name in _DOCUMENTED if fold(name) not in BY_KEY]

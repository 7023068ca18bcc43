"""The one table of the language's functions: their arguments, and what they look at.

Angles are in radians. P is an origin, x, y, z are axes, v and w velocities of markers i, j, k, l,
where one that is left out or 0 is the global frame. What each function is stands with it.
"""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

from mbsim.forces.catalog import FORCES


class Kind(Enum):
    """What a function looks at, which says where it may be used."""

    ELEMENTARY = "its arguments alone"
    DISPLACEMENT = "where markers are"
    VELOCITY = "how markers move"
    ACCELERATION = "accelerations"
    FORCE = "forces"
    VARIABLE = "a variable"
    STATE = "states"
    TABLE = "a table of numbers"


class Function(NamedTuple):
    """A function: `args` names its arguments, of which the first `least` must be given.

    An argument is a ``number`` (any expression), a ``marker``, the id of an element (its
    statement's name), or one of ``jflag``, ``comp``, ``parameter``, ``measure``, ``iord``,
    ``index``, ``place``, ``point``, whose values are in `CHOICES`. `call` is how it is written,
    `about` its value.
    """

    name: str
    args: tuple[str, ...]
    least: int
    kind: Kind
    call: str
    about: str


#: Arguments that are whole numbers out of a range.
CHOICES = {
    "jflag": (0, 1),
    "comp": (1, 8),
    "index": (1, 1),
    "parameter": (1, 4),
    "measure": (27, 27),
    "iord": (0, 2),
    "place": (1, 1_000_000),
    # a marker in decks; once elements are known the id is of the force on one, and this is jflag
    "point": (0, 2**31 - 1),
}
#: Points that a spline must have, by method.
SPLINE_POINTS = {"AKISPL": 4, "CUBSPL": 4, "LINSPL": 2}
#: Names that are numbers; TIME is the one variable.
CONSTANTS = ("PI", "RTOD", "DTOR")
#: Most coefficients of a series.
COEFFICIENTS = 31
#: Most arguments of MIN and MAX.
MANY = 30

FUNCTIONS: dict[str, Function] = {}


def _put(kind: Kind, args: str, least: int | None, written: str, **about: str) -> None:
    """Add functions that have the same arguments, `written` as people write them."""
    given = tuple(args.split())
    for name, value in about.items():
        count = len(given) if least is None else least
        FUNCTIONS[name] = Function(name, given, count, kind, f"{name}({written})", value)


def _numbers(most: int, least: int | None, written: str, **about: str) -> None:
    """Add elementary functions of `least` to `most` numbers."""
    _put(Kind.ELEMENTARY, "number " * most, least, written, **about)


_numbers(
    1,
    None,
    "x",
    ABS="|x|",
    SIN="sine",
    COS="cosine",
    TAN="tangent",
    ASIN="arc sine, from -pi/2 to pi/2",
    ACOS="arc cosine, from 0 to pi",
    ATAN="arc tangent, from -pi/2 to pi/2",
    SINH="hyperbolic sine",
    COSH="hyperbolic cosine",
    TANH="hyperbolic tangent",
    EXP="e^x",
    LOG="natural logarithm",
    LOG10="logarithm to the base 10",
    SQRT="square root",
    AINT="x without its fraction",
    ANINT="the nearest whole number",
)
_numbers(2, None, "y, x", ATAN2="angle of the point (x, y), from -pi to pi; 0 at (0, 0)")
_numbers(
    2,
    None,
    "x, y",
    MOD="x - y AINT(x/y)",
    SIGN="|x| with the sign of y",
    DIM="max(0, x - y)",
)
_numbers(MANY, 2, "x, y, ...", MIN="the smallest", MAX="the largest")
_numbers(4, None, "x: a, b, c", IF="a where x < 0, b where x = 0, c where x > 0")
_numbers(
    5,
    None,
    "x, x0, h0, x1, h1",
    STEP="h0 up to x0, h1 from x1 on, a cubic between, s^2 (3 - 2 s)",
    STEP5="the same with a polynomial of degree 5, s^3 (10 - 15 s + 6 s^2)",
    HAVSIN="the same with half a period of a sine",
)
_numbers(6, 4, "x, x0, a, w[, phi, b]", SHF="a sin(w (x - x0) - phi) + b")
_numbers(
    2 + COEFFICIENTS,
    3,
    "x, x0, a0, a1, ...",
    POLY="sum of a_j (x - x0)^j",
    CHEBY="sum of a_j T_j(x - x0), T_j the polynomials of Chebyshev",
)
_numbers(
    3 + COEFFICIENTS,
    4,
    "x, x0, w, a0, a1, ...",
    FORSIN="a0 + sum of a_j sin(j w (x - x0))",
    FORCOS="a0 + sum of a_j cos(j w (x - x0))",
)
_numbers(
    7,
    None,
    "x, x', x1, k, e, c, d",
    IMPACT="max(0, k (x1 - x)^e - STEP(x1 - x, 0, 0, d, c) x') where x < x1, else 0",
)
_numbers(
    7,
    None,
    "x, a, x0, f0, x1, f1, dx",
    SWEEP="sine a sin(...), frequency f0 to f1 from x0 to x1, grown over dx by STEP5",
)
_numbers(
    8,
    None,
    "x, x', x1, x2, k, e, c, d",
    BISTOP="IMPACT at the stop x1 below, and the same, negative, at x2 above",
)
_put(
    Kind.DISPLACEMENT,
    "marker marker",
    1,
    "i[, j]",
    DM="abs(P_i - P_j) [L]",
    AX="angle of i about x_j, whole turns counted [rad]",
    AY="angle of i about y_j, whole turns counted [rad]",
    AZ="angle of i about z_j, whole turns counted [rad]",
    PSI="first angle of the turns z, x, z that take j's axes to i's [rad]",
    THETA="second angle of the turns z, x, z [rad]",
    PHI="third angle of the turns z, x, z [rad]",
    YAW="first angle of the turns z, y, x that take j's axes to i's [rad]",
    PITCH="second angle of the turns z, y, x [rad]",
    ROLL="third angle of the turns z, y, x [rad]",
)
_put(
    Kind.DISPLACEMENT,
    "marker marker marker",
    1,
    "i[, j[, k]]",
    DX="(P_i - P_j) . x_k [L]",
    DY="(P_i - P_j) . y_k [L]",
    DZ="(P_i - P_j) . z_k [L]",
)
_put(
    Kind.DISPLACEMENT,
    "measure parameter marker marker",
    3,
    "27, n, i[, j]",
    ORIENT="Euler parameter e0, e1, e2, e3 of i in j for n = 1, 2, 3, 4",
)
_put(
    Kind.DISPLACEMENT,
    "marker marker marker",
    None,
    "i, j, k",
    INCANG="angle at P_j between the lines to P_i and P_k, 0 to pi [rad]",
)
_put(
    Kind.VELOCITY,
    "marker marker marker",
    1,
    "i[, j[, l]]",
    VM="abs(v_i - v_j), seen from l [L/T]",
)
_put(
    Kind.VELOCITY,
    "marker marker",
    1,
    "i[, j]",
    VR="rate of DM(i, j) [L/T]",
    WM="abs(w_i - w_j) [rad/T]",
)
_put(
    Kind.VELOCITY,
    "marker marker marker marker",
    1,
    "i[, j[, k[, l]]]",
    VX="(v_i - v_j) . x_k, seen from l [L/T]",
    VY="(v_i - v_j) . y_k, seen from l [L/T]",
    VZ="(v_i - v_j) . z_k, seen from l [L/T]",
)
_put(
    Kind.VELOCITY,
    "marker marker marker",
    1,
    "i[, j[, k]]",
    WX="(w_i - w_j) . x_k [rad/T]",
    WY="(w_i - w_j) . y_k [rad/T]",
    WZ="(w_i - w_j) . z_k [rad/T]",
)
_put(
    Kind.ACCELERATION,
    "marker marker marker",
    1,
    "i[, j[, l]]",
    ACCM="size of the second derivative of P_i - P_j, taken in l's body [L/T^2]",
    WDTM="size of the derivative of w_i - w_j, taken in l's body [rad/T^2]",
)
_put(
    Kind.ACCELERATION,
    "marker marker marker marker",
    1,
    "i[, j[, k[, l]]]",
    ACCX="second derivative of P_i - P_j, taken in l's body, along x_k [L/T^2]",
    ACCY="the same along y_k",
    ACCZ="the same along z_k",
    WDTX="derivative of w_i - w_j, taken in l's body, along x_k [rad/T^2]",
    WDTY="the same along y_k",
    WDTZ="the same along z_k",
)
_put(
    Kind.FORCE,
    "marker marker marker",
    1,
    "i[, j[, k]]",
    FM="size of the force on i of all that acts between i and j [F]",
    TM="size of the torque on i of all that acts between i and j [F L]",
    FX="that force along x_k",
    FY="that force along y_k",
    FZ="that force along z_k",
    TX="that torque along x_k",
    TY="that torque along y_k",
    TZ="that torque along z_k",
)
_OF_ELEMENT = "id, jflag, comp[, k]"


def _element(kind: str, **about: str) -> None:
    """Add functions that give the force or torque of one element."""
    _put(Kind.FORCE, f"{kind} jflag comp marker", 3, _OF_ELEMENT, **about)


_element("JOINT", JOINT="reaction of a joint on I (jflag 0) or on J (jflag 1)")
_element("JPRIM", JPRIM="of a joint primitive")
_element("MOTION", MOTION="of a motion")
_element("PTCV", PTCV="of a curve on the point that it holds")
_element("CVCV", CVCV="of a curve on one that touches it")
_element("PTSF", PTSF="of a surface on the point that it holds")
for _name in FORCES:
    _about = f"of a {FORCES[_name].statement}"
    _element(_name, **dict.fromkeys(FORCES[_name].functions.split(), _about))
_put(
    Kind.FORCE,
    "NFORCE point comp marker",
    3,
    "id, i, comp[, k]",
    NFORCE="of a Force_MultiPoint on marker i, one of its own or J",
)
_put(Kind.VARIABLE, "VARIABLE", None, "id", VARVAL="value of a Reference_Variable")
_put(Kind.VARIABLE, "DIFF", None, "id", DIF1="z' of a Control_Diff")
_put(Kind.STATE, "DIFF", None, "id", DIF="z of a Control_Diff")
_put(
    Kind.FORCE,
    "CONTACT jflag comp marker",
    4,
    "id, jflag, comp, k",
    CONTACT="of all points of a contact; torque about the cg of the body",
)
#: What `CONTACT(id, index, k)` is in the table: a name that no deck can write.
CONTACT_BY_INDEX = "CONTACT(3)"
FUNCTIONS[CONTACT_BY_INDEX] = Function(
    "CONTACT",
    ("CONTACT", "index", "marker"),
    3,
    Kind.FORCE,
    "CONTACT(id, index, k)",
    "deepest penetration of a contact for index 1 [L]; k says nothing of a number",
)
_put(
    Kind.TABLE,
    "number number SPLINE iord",
    3,
    "x, z, id[, iord]",
    AKISPL="spline at x, Akima's local cubic, or its derivative of order iord",
    CUBSPL="the same, natural cubic spline",
    LINSPL="the same, straight lines",
)
_put(Kind.TABLE, "ARRAY place", None, "id, n", ARYVAL="n-th element of an array, from 1")
_put(
    Kind.STATE,
    "SENSOR",
    None,
    "id",
    SENVAL="what a Sensor_Evaluate, or else the sensor, evaluated when it acted last, 0 before",
)

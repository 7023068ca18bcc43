"""The one table of the language's functions: their arguments, and what they look at.

Angles are in radians. With P the origins, x, y, z the axes, v and w the velocities of markers
i, j, k, l, where one that is left out or 0 is the global frame:

| function                  | value                                                        |
|---------------------------|--------------------------------------------------------------|
| DM(i,j)                   | abs(P_i - P_j)                                               |
| DX, DY, DZ(i,j,k)         | (P_i - P_j) . x_k, y_k, z_k                                  |
| AX, AY, AZ(i,j)           | angle of i about x_j, y_j, z_j, whole turns counted          |
| PSI, THETA, PHI(i,j)      | angles of the turns z, x, z that take j's axes to i's        |
| YAW, PITCH, ROLL(i,j)     | angles of the turns z, y, x that take j's axes to i's        |
| ORIENT(27,n,i,j)          | Euler parameter e0, e1, e2, e3 of i in j for n = 1, 2, 3, 4   |
| VM(i,j,l)                 | abs(v_i - v_j), seen from l                                  |
| VR(i,j)                   | rate of DM(i,j)                                              |
| VX, VY, VZ(i,j,k,l)       | (v_i - v_j) . x_k, y_k, z_k, seen from l                     |
| WM(i,j), WX..(i,j,k)      | abs(w_i - w_j), (w_i - w_j) . x_k                            |
| DIF(id), DIF1(id)         | z of a Control_Diff, and z'                                  |
| INCANG(i,j,k)             | angle at P_j between the lines to P_i and P_k, 0 to pi       |
| ACCM(i,j,l), ACCX..(i,j,k,l) | as VM, VX.. of the second derivative, taken in l's body   |
| WDTM(i,j,l), WDTX..(i,j,k,l) | as WM, WX.. of the derivative of w_i - w_j, taken in l's  |
| SENVAL(id)                | what a Sensor_Event evaluated when it acted last, 0 before   |
| FM, FX.. TM, TX..(i,j,k)  | of all that acts between i and j: force and torque on i      |
| JOINT.. (id,jflag,comp,k) | force or torque of an element on I (jflag 0) or J (1)        |

The force measures' comp is 1 to 8: abs(F), Fx, Fy, Fz, abs(T), Tx, Ty, Tz, along k's axes. CONTACT
is the sum of a contact's incidents, its torque about the cg of each body that they act on.
AKISPL, CUBSPL, LINSPL(x,z,id,iord) are a spline or its derivative by x, ARYVAL(id,n) the n-th
number of an array.
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
    ``place``, whose values are in `CHOICES`.
    """

    name: str
    args: tuple[str, ...]
    least: int
    kind: Kind


#: Arguments that are whole numbers out of a range.
CHOICES = {
    "jflag": (0, 1),
    "comp": (1, 8),
    "parameter": (1, 4),
    "measure": (27, 27),
    "iord": (0, 2),
    "place": (1, 1_000_000),
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


def _put(kind: Kind, names: str, args: str, least: int | None = None) -> None:
    """Add functions that have the same arguments."""
    given = tuple(args.split())
    for name in names.split():
        FUNCTIONS[name] = Function(name, given, len(given) if least is None else least, kind)


def _numbers(names: str, most: int, least: int | None = None) -> None:
    """Add elementary functions of `least` to `most` numbers."""
    _put(Kind.ELEMENTARY, names, "number " * most, least)


_numbers("ABS SIN COS TAN ASIN ACOS ATAN SINH COSH TANH EXP LOG LOG10 SQRT AINT ANINT", 1)
_numbers("ATAN2 MOD SIGN DIM", 2)
_numbers("MIN MAX", MANY, 2)
_numbers("IF", 4)
_numbers("STEP STEP5 HAVSIN", 5)
_numbers("SHF", 6, 4)
_numbers("POLY CHEBY", 2 + COEFFICIENTS, 3)
_numbers("FORSIN FORCOS", 3 + COEFFICIENTS, 4)
_numbers("IMPACT SWEEP", 7)
_numbers("BISTOP", 8)
_put(Kind.DISPLACEMENT, "DM AX AY AZ PSI THETA PHI YAW PITCH ROLL", "marker marker", 1)
_put(Kind.DISPLACEMENT, "DX DY DZ", "marker marker marker", 1)
_put(Kind.DISPLACEMENT, "ORIENT", "measure parameter marker marker", 3)
_put(Kind.DISPLACEMENT, "INCANG", "marker marker marker")
_put(Kind.VELOCITY, "VM", "marker marker marker", 1)
_put(Kind.VELOCITY, "VR WM", "marker marker", 1)
_put(Kind.VELOCITY, "VX VY VZ", "marker marker marker marker", 1)
_put(Kind.VELOCITY, "WX WY WZ", "marker marker marker", 1)
_put(Kind.ACCELERATION, "ACCM WDTM", "marker marker marker", 1)
_put(Kind.ACCELERATION, "ACCX ACCY ACCZ WDTX WDTY WDTZ", "marker marker marker marker", 1)
_put(Kind.FORCE, "FM TM FX FY FZ TX TY TZ", "marker marker marker", 1)
_put(Kind.FORCE, "JOINT", "JOINT jflag comp marker", 3)
_put(Kind.FORCE, "JPRIM", "JPRIM jflag comp marker", 3)
_put(Kind.FORCE, "MOTION", "MOTION jflag comp marker", 3)
for _name in FORCES:
    _put(Kind.FORCE, FORCES[_name].functions, f"{_name} jflag comp marker", 3)
_put(Kind.VARIABLE, "VARVAL", "VARIABLE")
_put(Kind.VARIABLE, "DIF1", "DIFF")
_put(Kind.STATE, "DIF", "DIFF")
_put(Kind.FORCE, "CONTACT", "CONTACT jflag comp marker", 3)
_put(Kind.VARIABLE, "VARVAL", "VARIABLE")
_put(Kind.TABLE, "AKISPL CUBSPL LINSPL", "number number SPLINE iord", 3)
_put(Kind.TABLE, "ARYVAL", "ARRAY place")
_put(Kind.STATE, "SENVAL", "SENSOR")

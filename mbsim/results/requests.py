"""Post_Request: F1..F8 of how markers move, of forces and of expressions, over rows."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mbsim.expressions import Expression
from mbsim.expressions.functions import CONTACT_BY_INDEX, FUNCTIONS
from mbsim.expressions.tree import Call, Number
from mbsim.model.elements import Array, Request
from mbsim.model.placement import MarkerPlace
from mbsim.model.request_types import TYPES
from mbsim.results.forces import Forces, Wrench
from mbsim.results.motion import Motion, matrices

#: What functions of the language measure.
_MEASURES = {
    "displacement": ("DM", "DX", "DY", "DZ", CONTACT_BY_INDEX),
    "angle": ("AX", "AY", "AZ", "PSI", "THETA", "PHI", "YAW", "PITCH", "ROLL", "INCANG"),
    "velocity": ("VM", "VR", "VX", "VY", "VZ"),
    "angular_velocity": ("WM", "WX", "WY", "WZ"),
    "acceleration": ("ACCM", "ACCX", "ACCY", "ACCZ"),
    "angular_acceleration": ("WDTM", "WDTX", "WDTY", "WDTZ"),
    "force": ("FM", "FX", "FY", "FZ"),
    "torque": ("TM", "TX", "TY", "TZ"),
}
#: Those whose third argument says whether it is a force (1..4) or a torque (5..8).
_FORCES_OF_ELEMENTS = {n for n, f in FUNCTIONS.items() if {"jflag", "point"} & {*f.args}}
#: F1 and F5 are magnitudes of the three columns behind them.
MAGNITUDES = (1, 5)

# below this sine of theta, psi and phi turn about one line and only their sum is known
_SINGULAR = 1e-9


@dataclass(frozen=True)
class MarkerMotion:
    """A marker over n rows (or 1 row where it stands still), global frame.

    `p`, `v`, `w`, `a`, `alpha` are (n, 3); `R` is (n, 3, 3), the marker's axes as columns.
    """

    p: Array
    R: Array
    v: Array
    w: Array
    a: Array
    alpha: Array


def _still(p: Array, R: Array) -> MarkerMotion:
    """Return a marker that does not move."""
    zero = np.zeros((1, 3))
    return MarkerMotion(p[None, :], R[None, :, :], zero, zero, zero, zero)


def marker_motion(
    marker_id: int | None, markers: Mapping[int, MarkerPlace], bodies: Motion
) -> MarkerMotion:
    """Return how a marker moves; None and 0 are the global frame.

    Notes
    -----
    Of a rigid body: v + w x r and a + alpha x r + w x (w x r), r from the cg.
    """
    if not marker_id:
        return _still(np.zeros(3), np.eye(3))
    place = markers[marker_id]
    if place.body_id not in bodies.body_ids:
        return _still(place.p, place.R)
    b = list(bodies.body_ids).index(place.body_id)
    R_body = matrices(bodies.q[:, b])
    r = R_body @ place.p_B
    w, alpha = bodies.w[:, b], bodies.alpha[:, b]
    spin = np.cross(w, r)
    return MarkerMotion(
        p=bodies.p[:, b] + r,
        R=R_body @ place.R_B,
        v=bodies.v[:, b] + spin,
        w=w,
        a=bodies.a[:, b] + np.cross(alpha, r) + np.cross(w, spin),
        alpha=alpha,
    )


def angles_313(R: Array) -> tuple[Array, Array, Array]:
    """Return psi, theta, phi (n,) [rad] of R = Rz(psi) Rx(theta) Rz(phi), shape (n, 3, 3).

    Principal values: theta in [0, pi], psi and phi in (-pi, pi]; nothing is unwrapped, so a
    value depends on its own row alone. Where theta is 0 or pi, phi is 0 and psi holds all
    of the turn.
    """
    sine = np.hypot(R[:, 2, 0], R[:, 2, 1])
    theta = np.arctan2(sine, R[:, 2, 2])
    regular = sine > _SINGULAR
    # + 0.0 turns -0 into 0, of which arctan2 would make -pi
    psi = np.where(
        regular,
        np.arctan2(R[:, 0, 2] + 0.0, -R[:, 1, 2] + 0.0),
        np.arctan2(R[:, 1, 0] + 0.0, R[:, 0, 0] + 0.0),
    )
    phi = np.where(regular, np.arctan2(R[:, 2, 0] + 0.0, R[:, 2, 1] + 0.0), 0.0)
    return psi, theta, phi


def rotation_angle(R: Array) -> Array:
    """Return the angle (n,) in [0, pi] of the rotations R (n, 3, 3)."""
    # sine from the skew part, cosine from the trace: exact at both ends
    skew = R - R.swapaxes(-1, -2)
    axial = 0.5 * np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=-1)
    angle: Array = np.arctan2(
        np.linalg.norm(axial, axis=-1), 0.5 * (np.trace(R, axis1=-2, axis2=-1) - 1.0)
    )
    return angle


def columns_of(request: Request) -> tuple[str, ...]:
    """Return what F1..F8 of a request are; of an EXPRESSION its texts."""
    if request.type != "EXPRESSION":
        return TYPES[request.type].columns
    exprs = (*request.exprs, *[None] * 8)[:8]
    return tuple(
        expr.text if expr is not None else "mag" if k in MAGNITUDES else ""
        for k, expr in enumerate(exprs, 1)
    )


def measures_of(request: Request) -> tuple[str, ...]:
    """Return what F1..F8 of an EXPRESSION measure; nothing where an expression is not one measure.

    A magnitude that the deck does not give is of the kind of its components.
    """
    exprs = (*request.exprs, *[None] * 8)[:8]
    found = ["" if expr is None else _measure(expr) for expr in exprs]
    for number in MAGNITUDES:
        parts = {found[k] for k in range(number, number + 3) if exprs[k] is not None}
        if exprs[number - 1] is None and len(parts) == 1:
            found[number - 1] = parts.pop()
    return tuple(found)


def _measure(expr: Expression) -> str:
    """Return what an expression measures, if it is one function of the language or minus one."""
    node = expr.root
    while isinstance(node, Call) and node.name == "NEG":
        node = node.args[0]
    if not isinstance(node, Call):
        return ""
    if node.name in _FORCES_OF_ELEMENTS:
        comp = node.args[2] if len(node.args) > 2 else None
        torque = isinstance(comp, Number) and comp.value >= 5
        return "torque" if torque else "force"
    return next((name for name, calls in _MEASURES.items() if node.name in calls), "")


def request_table(
    request: Request, markers: Mapping[int, MarkerPlace], forces: Forces, value: Array
) -> Array:
    """Return F1..F8 of a request of any type, shape (n, 8), in model units and radians.

    Parameters
    ----------
    request : Request
    markers : mapping of int to MarkerPlace
        All markers of the model.
    forces : Forces
        With the moving bodies over n rows.
    value : ndarray, shape (n, values)
        Expressions, as `Rows.value`.
    """
    if request.type == "EXPRESSION":
        return expressions(request, forces.system.values, value)
    if request.type in RELATIVE:
        return evaluate(request, markers, forces.bodies)
    return force_table(request, markers, forces)


def force_table(request: Request, markers: Mapping[int, MarkerPlace], forces: Forces) -> Array:
    """Return F1..F8 (n, 8) of a MARKER_FORCE or ELEMENTAL_FORCE, as `request_table`."""
    of_marker = request.type == "MARKER_FORCE"
    wrench = forces.on_marker(request) if of_marker else forces.of_element(request)
    return resolved(wrench, marker_motion(request.ref_marker_id, markers, forces.bodies).R)


def resolved(wrench: Wrench, R: Array) -> Array:
    """Return magnitude and components of force and torque, (n, 8), along the columns of R."""
    to_reference = R.swapaxes(-1, -2)
    made = np.zeros((len(wrench.force), 8))
    for first, vectors in ((0, wrench.force), (4, wrench.torque)):
        made[:, first] = np.linalg.norm(vectors, axis=-1)
        made[:, first + 1 : first + 4] = (to_reference @ vectors[..., None])[..., 0]
    return made


def expressions(request: Request, values: Sequence[tuple[int, int]], value: Array) -> Array:
    """Return F1..F8 (n, 8) of an EXPRESSION.

    F1 and F5 are, where the deck gives none, the magnitudes of F2..F4 and of F6..F8; others
    that it does not give are 0.

    Parameters
    ----------
    request : Request
    values : sequence of (int, int)
        Request id and F number of each column of `value`.
    value : ndarray, shape (n, values)
    """
    made = np.zeros((len(value), 8))
    given = places(request, values)
    for number, column in given.items():
        made[:, number - 1] = value[:, column]
    for number in MAGNITUDES:
        if number not in given:
            made[:, number - 1] = np.linalg.norm(made[:, number : number + 3], axis=1)
    return made


def places(request: Request, values: Sequence[tuple[int, int]]) -> dict[int, int]:
    """Return the column of `value` for each F number of an EXPRESSION that the deck gives."""
    return {number: column for column, (id, number) in enumerate(values) if id == request.id}


#: F2..F4 and F6..F8 (n, 3) of I relative to J, global axes; None for the angles of a rotation.
RELATIVE: dict[str, Callable[[MarkerMotion, MarkerMotion], tuple[Array, Array | None]]] = {
    "MARKER_DISPLACEMENT": lambda i, j: (i.p - j.p, None),
    "MARKER_VELOCITY": lambda i, j: (i.v - j.v, i.w - j.w),
    "MARKER_ACCELERATION": lambda i, j: (i.a - j.a, i.alpha - j.alpha),
}


def evaluate(request: Request, markers: Mapping[int, MarkerPlace], bodies: Motion) -> Array:
    """Return F1..F8 of how markers move, shape (n, 8), in model units and radians.

    Parameters
    ----------
    request : Request
        Of a type in `RELATIVE`.
    markers : mapping of int to MarkerPlace
        All markers of the model.
    bodies : Motion
        The moving bodies over n rows.

    Returns
    -------
    ndarray, shape (n, 8)
        F1 magnitude; F2..F4 components; F5 magnitude (for a displacement the angle of
        the rotation from J to I); F6..F8 components (for a displacement psi, theta, phi,
        the 3-1-3 angles of I's axes in J's, see `angles_313`).

    Notes
    -----
    I's origin relative to J's (default: ground's origin), components in the axes of the
    reference marker (default: global). Velocities and accelerations relative to J are, as
    in MotionSolve and Adams, differences of the global ones, that is derivatives taken in
    the ground frame and then resolved: a J that turns adds no Coriolis terms.
    """
    i, j, reference = (
        marker_motion(id, markers, bodies)
        for id in (request.i_marker_id, request.j_marker_id, request.ref_marker_id)
    )
    linear, angular = RELATIVE[request.type](i, j)
    made = np.zeros((bodies.rows, 8))
    to_reference = reference.R.swapaxes(-1, -2)
    made[:, 0] = np.linalg.norm(linear, axis=-1)
    made[:, 1:4] = (to_reference @ linear[..., None])[..., 0]
    if angular is None:
        relative = np.broadcast_to(j.R.swapaxes(-1, -2) @ i.R, (bodies.rows, 3, 3))
        made[:, 4] = rotation_angle(relative)
        made[:, 5], made[:, 6], made[:, 7] = angles_313(relative)
    else:
        made[:, 4] = np.linalg.norm(angular, axis=-1)
        made[:, 5:8] = (to_reference @ angular[..., None])[..., 0]
    return made

"""Post_Request: F1..F8 of marker displacements, velocities and accelerations, over rows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from mbsim.model.elements import Array, Request
from mbsim.model.placement import MarkerPlace
from mbsim.results.motion import Motion, matrices

#: What F1..F8 are, by type of request.
COLUMNS = {
    "MARKER_DISPLACEMENT": ("mag", "x", "y", "z", "angle", "psi", "theta", "phi"),
    "MARKER_VELOCITY": ("mag", "vx", "vy", "vz", "wmag", "wx", "wy", "wz"),
    "MARKER_ACCELERATION": ("mag", "ax", "ay", "az", "alphamag", "alphax", "alphay", "alphaz"),
}

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


def evaluate(request: Request, markers: Mapping[int, MarkerPlace], bodies: Motion) -> Array:
    """Return F1..F8 of a request, shape (n, 8), in model units and radians.

    Parameters
    ----------
    request : Request
        Of type MARKER_DISPLACEMENT, MARKER_VELOCITY or MARKER_ACCELERATION.
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
    if request.type == "MARKER_DISPLACEMENT":
        linear, angular = i.p - j.p, None
    elif request.type == "MARKER_VELOCITY":
        linear, angular = i.v - j.v, i.w - j.w
    else:
        linear, angular = i.a - j.a, i.alpha - j.alpha

    table = np.zeros((bodies.rows, 8))
    to_reference = reference.R.swapaxes(-1, -2)
    table[:, 0] = np.linalg.norm(linear, axis=-1)
    table[:, 1:4] = (to_reference @ linear[..., None])[..., 0]
    if angular is None:
        relative = np.broadcast_to(j.R.swapaxes(-1, -2) @ i.R, (bodies.rows, 3, 3))
        table[:, 4] = rotation_angle(relative)
        table[:, 5], table[:, 6], table[:, 7] = angles_313(relative)
    else:
        table[:, 4] = np.linalg.norm(angular, axis=-1)
        table[:, 5:8] = (to_reference @ angular[..., None])[..., 0]
    return table

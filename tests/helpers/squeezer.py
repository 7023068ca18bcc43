"""Andrews' squeezing mechanism as bodies and revolute joints; constants of the IVP Test Set.

Points: crank O-P, link P-E, triangle B-E-D (spring C-D), links E-H and H-A, E-G and G-A.
"""

from __future__ import annotations

import numpy as np

from helpers import mechanics as mech
from helpers.mechanism_decks import Joint, Scene

MASS = (0.04325, 0.00365, 0.02373, 0.00706, 0.0705, 0.00706, 0.05498)
INERTIA = (2.194e-6, 4.41e-7, 5.255e-6, 5.667e-7, 1.169e-5, 5.667e-7, 1.912e-5)
D, DA, E, EA, RR, RA = 0.028, 0.0115, 0.02, 0.01421, 0.007, 0.00092
SS, SA, SB, SC, SD = 0.035, 0.01874, 0.01043, 0.018, 0.02
TA, TB, U, UA, UB, ZF, ZT, FA = 0.02308, 0.00916, 0.04, 0.01228, 0.00449, 0.02, 0.04, 0.01421
A, B, C = (-0.06934, -0.00227), (-0.03635, 0.03273), (0.014, 0.072)
TORQUE, SPRING, LENGTH = 0.033, 4530.0, 0.07785

START = {
    "beta": -0.0617138900142764496,
    "Theta": 0.0,
    "gamma": 0.455279819163070380,
    "Phi": 0.222668390165885885,
    "delta": 0.487364979543842550,
    "Omega": -0.222668390165885885,
    "epsilon": 1.23054744454982119,
}
END = {
    "beta": 1.581077119629904e01,
    "Theta": -1.575637105984298e01,
    "gamma": 4.082224013073101e-02,
    "Phi": -5.347301163226948e-01,
    "delta": 5.244099658805304e-01,
    "Omega": 5.347301163226948e-01,
    "epsilon": 1.048080741042263e00,
}
END_RATES = {
    "beta": 1.139920302151208e03,
    "Theta": -1.424379294994111e03,
    "gamma": 1.103291221937134e01,
    "Phi": 1.929337464421385e01,
    "delta": 5.735699284790808e-01,
    "Omega": -1.929337464421385e01,
    "epsilon": 3.231791658026955e-01,
}


def _along(angle, length):
    return length * np.array([np.cos(angle), np.sin(angle), 0.0])


def _across(angle, length):
    return length * np.array([np.sin(angle), -np.cos(angle), 0.0])


def body_angles(q):
    """Return the absolute angles of the seven bodies from the seven coordinates."""
    return (
        q["beta"],
        q["beta"] + q["Theta"],
        q["gamma"],
        q["delta"] + q["Phi"],
        q["delta"],
        q["epsilon"] + q["Omega"],
        q["epsilon"],
    )


def coordinates(angles):
    """Return the seven coordinates from the absolute angles (or rates) of the bodies."""
    k1, k2, k3, k4, k5, k6, k7 = angles
    return {
        "beta": k1,
        "Theta": k2 - k1,
        "gamma": k3,
        "Phi": k4 - k5,
        "delta": k5,
        "Omega": k6 - k7,
        "epsilon": k7,
    }


def points(angles):
    """Return the joints' places P, E, D, H, G of the absolute angles of the bodies."""
    k1, k2, k3, k4, k5, k6, k7 = angles
    a, b = (np.array([*p, 0.0]) for p in (A, B))
    p = _along(k1, RR)
    h, g = a + _along(k5, ZT), a + _across(k7, U)
    e = p - _along(k2, D)
    d = b + _across(k3, SC) + _along(k3, SD)
    # three ways round to E: a check of the geometry, to the digits of the start
    assert np.abs(b + _across(k3, SS) - e).max() < 1e-14
    assert np.abs(h + _across(k4, E) - e).max() < 1e-14
    assert np.abs(g + _along(k6, ZF) - e).max() < 1e-14
    return p, e, d, h, g


def centres(angles):
    """Return the seven centres of mass of the absolute angles of the bodies."""
    k1, k2, k3, k4, k5, k6, k7 = angles
    a, b = (np.array([*p, 0.0]) for p in (A, B))
    p = _along(k1, RR)
    h, g = a + _along(k5, ZT), a + _across(k7, U)
    return (
        _along(k1, RA),
        p - _along(k2, DA),
        b + _across(k3, SA) + _along(k3, SB),
        h + _across(k4, E - EA),
        a + _along(k5, TA) - _across(k5, TB),
        g + _along(k6, ZF - FA),
        a + _across(k7, UA) - _along(k7, UB),
    )


def scene():
    """Return the squeezer as a Scene: planar in xy, no gravity; torque and spring as statements."""
    angles = body_angles(START)
    a, b, c = (np.array([*p, 0.0]) for p in (A, B, C))
    o = np.zeros(3)
    p, e, d, h, g = points(angles)
    bodies = [
        mech.Body(m, (J, J, J), centre, turn(angle))
        for m, J, centre, angle in zip(MASS, INERTIA, centres(angles), angles, strict=True)
    ]
    pins = ((1, 0, o), (2, 1, p), (3, 0, b), (3, 2, e), (4, 2, e), (6, 2, e))
    pins += ((5, 0, a), (4, 5, h), (7, 0, a), (6, 7, g))
    joints = [Joint("REVOLUTE", i, j, point) for i, j, point in pins]
    extra = "\n".join(
        (
            f'<Reference_Marker id="501" body_id="4" pos_x="{float(d[0])!r}" '
            f'pos_y="{float(d[1])!r}"/>',
            f'<Reference_Marker id="502" body_id="1" pos_x="{C[0]!r}" pos_y="{C[1]!r}"/>',
            '<Force_SpringDamper id="1" type="TRANSLATIONAL" i_marker_id="501" j_marker_id="502"'
            f' stiffness="{SPRING!r}" damping="0" length="{LENGTH!r}"/>',
            '<Force_Scalar_TwoBody id="2" type="ROTATIONAL" i_marker_id="1000" j_marker_id="1001"'
            f' expr="{TORQUE!r}"/>',
        )
    )
    loads = (
        mech.Force(mech.Marker(3, d), mech.Marker(0, c), mech.spring(SPRING, 0.0, LENGTH)),
        mech.Force(mech.Marker(1, o), mech.Marker(0, o), _drive),
    )
    return Scene(bodies, joints, (0.0, 0.0, 0.0), extra), loads


def _drive(I, J, t):
    return np.zeros(3), TORQUE * J.z.v


def turn(angle):
    """Return the rotation about z by an angle."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def correct_digits(results):
    """Return correct digits of coordinates and rates at the end, relative to 1 + their size."""
    q = [results[f"bodies/{k}/quaternion"] for k in range(2, 9)]
    angles = [np.unwrap(2 * np.arctan2(x[:, 3], x[:, 0]))[-1] for x in q]
    rates = [results[f"bodies/{k}/angular_velocity"][-1, 2] for k in range(2, 9)]
    return [
        -np.log10(max(abs(found[n] - end) / (1 + abs(end)) for n, end in ends.items()))
        for found, ends in ((coordinates(angles), END), (coordinates(rates), END_RATES))
    ]

"""Force_Beam, Adams' BEAM: a straight massless beam of constant section from J to I.

Its neutral axis is J's x, I's origin at `length` on it and I's axes along J's where nothing
bends it. With q = (d - length e_x, theta), a linear Timoshenko beam exerts on I

    F = F0 - (K q)_d - (C u)_v         T = T0 - J(theta)^-T (K q)_theta - (C u)_w,   u = (v, w)

and stores q'K q/2 - F0.d, of which both are the exact gradient; a constant torque T0 has no
potential. The work of that counts as lost, with the sign turned. K is (J. S. Przemieniecki, Theory
of Matrix Structural Analysis, 1968, section 5.6), with Py = 12 E Izz ASY / (G A L^2) and Pz
likewise of Iyy and ASZ,

    x x   E A / L                            tx tx   G Ixx / L
    y y   12 E Izz / (L^3 (1 + Py))          tz tz   (4 + Py) E Izz / (L (1 + Py))
    z z   12 E Iyy / (L^3 (1 + Pz))          ty ty   (4 + Pz) E Iyy / (L (1 + Pz))
    y tz  -6 E Izz / (L^2 (1 + Py))          z ty    6 E Iyy / (L^2 (1 + Pz))

and C is `cratio` K or `cmatrix`. Bending is small, what carries the beam along is not.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from mbsim.core.arrays import F2, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, norm, scale, sub
from mbsim.forces.catalog import Adams, Bounds, Finding, Parameter, Values, Wrench, force
from mbsim.forces.formula import Motion
from mbsim.forces.matrix import times
from mbsim.forces.turning import turned_back

_AXES = ("x", "y", "z", "tx", "ty", "tz")
_PRELOAD = tuple(f"preload_{axis}" for axis in _AXES)
#: Half of the difference of angles [rad].
_PUSH = 1e-7
#: Where K, C and the preload stand among the constants, behind the length.
_K, _C, _F0 = 1, 37, 73
#: Negative parts of a damping matrix, over its diagonal, that are rounding.
_ROUNDING = 1e-12


def _stiffness(values: Values) -> F2:
    """Return K, shape (6, 6)."""
    L, E, G, A = (values[name] for name in ("length", "E", "G", "area"))
    K = np.zeros((6, 6))
    K[0, 0], K[3, 3] = E * A / L, G * values["ixx"] / L
    for y, tz, name, ratio, sign in ((1, 5, "izz", "ASY", -1.0), (2, 4, "iyy", "ASZ", 1.0)):
        EI = E * values[name]
        P = 12.0 * EI * values[ratio] / (G * A * L * L)
        K[y, y] = 12.0 * EI / (L**3 * (1.0 + P))
        K[tz, tz] = (4.0 + P) * EI / (L * (1.0 + P))
        K[y, tz] = K[tz, y] = sign * 6.0 * EI / (L * L * (1.0 + P))
    return K


def _damping(values: Values) -> F2:
    """Return C, shape (6, 6); `cmatrix` has its columns from the diagonal down."""
    if not values["cmatrix"]:
        return values["cratio"] * _stiffness(values)
    C = np.zeros((6, 6))
    C.T[np.triu_indices(6)] = values["cmatrix"]
    return C + np.tril(C, -1).T


def _check(values: Values) -> Iterator[Finding]:
    if not values["cmatrix"]:
        return
    if values["cratio"]:
        yield Finding("give the damping once: cratio or a matrix", "cratio")
    C = _damping(values)
    size = np.sqrt(np.maximum(np.diag(C), 0.0))
    size[size == 0.0] = 1.0
    if np.linalg.eigvalsh(C / np.outer(size, size))[0] < -_ROUNDING:
        message = "feeds energy: no velocities may have negative losses (positive semidefinite)"
        yield Finding(message, "cmatrix")


def _constants(values: Values) -> Sequence[float]:
    """Return length, K and C by rows, preload."""
    preload = [values[name] for name in _PRELOAD]
    return (values["length"], *_stiffness(values).flat, *_damping(values).flat, *preload)


@jitable
def _elastic(d: V3, theta: V3, par: Sequence[float]) -> tuple[V3, V3]:
    """Return what the beam's own force and torque on I are less than the preload."""
    bent = times(par, _K, (d[0] - par[0], d[1], d[2]), theta)
    return bent[0], turned_back(theta, bent[1])


def _wrench(motion: Motion, par: Sequence[float]) -> tuple[V3, V3, float, float]:
    d, theta, v, w = motion.d, motion.theta, motion.v, motion.w
    q = (d[0] - par[0], d[1], d[2])
    bent = times(par, _K, q, theta)
    slowed = times(par, _C, v, w)
    f0, t0 = (par[_F0], par[_F0 + 1], par[_F0 + 2]), (par[_F0 + 3], par[_F0 + 4], par[_F0 + 5])
    force = sub(sub(f0, bent[0]), slowed[0])
    torque = sub(sub(t0, turned_back(theta, bent[1])), slowed[1])
    stored, lost = 0.0, 0.0
    for k in range(3):
        stored += 0.5 * (q[k] * bent[0][k] + theta[k] * bent[1][k]) - f0[k] * d[k]
        lost += v[k] * slowed[0][k] + w[k] * (slowed[1][k] - t0[k])
    return force, torque, stored, lost


def _slopes(motion: Motion, par: Sequence[float], K: F2, D: F2) -> None:
    d, theta = motion.d, motion.theta
    for r in range(6):
        for k in range(6):
            D[r, k] = par[_C + 6 * r + k]
    for k in range(3):
        e = (1.0 if k == 0 else 0.0, 1.0 if k == 1 else 0.0, 1.0 if k == 2 else 0.0)
        force, torque = times(par, _K, e, (0.0, 0.0, 0.0))
        torque = turned_back(theta, torque)
        # d theta = J(theta)^-1 e as I turns, which is J^-T of -theta
        turn = scale(_PUSH, turned_back(scale(-1.0, theta), e))
        up, low = _elastic(d, add(theta, turn), par), _elastic(d, sub(theta, turn), par)
        for r in range(3):
            K[r, k] = force[r]
            K[3 + r, k] = torque[r]
            K[r, 3 + k] = (up[0][r] - low[0][r]) / (2.0 * _PUSH)
            K[3 + r, 3 + k] = (up[1][r] - low[1][r]) / (2.0 * _PUSH)


def _bounds(par: Sequence[float]) -> Bounds:
    """Return twice the halves of the diagonals: no less than a semidefinite matrix as a whole."""
    made = []
    for first in (_K, _C):
        matrix = np.reshape(par[first : first + 36], (6, 6))
        for half in (matrix[:3, :3], matrix[3:, 3:]):
            made.append(2.0 * float(np.linalg.norm(half, 2)))
    k, turning_k, c, turning_c = made
    load = norm((par[_F0], par[_F0 + 1], par[_F0 + 2]))
    return Bounds(k, turning_k, c, turning_c, force=load, rest=(par[0], 0.0, 0.0))


force(
    "BEAM",
    "Force_Beam",
    "beams",
    Parameter("length", None, positive=True, about="length without load, along J's x", unit="L"),
    Parameter("E", None, positive=True, alias="e_modulus", about="Young's modulus", unit="F/L^2"),
    Parameter("G", None, positive=True, alias="g_modulus", about="shear modulus", unit="F/L^2"),
    Parameter(
        "area", None, positive=True, alias="area_x_section", about="area of the section", unit="L^2"
    ),
    Parameter("ixx", None, positive=True, about="torsion constant", unit="L^4"),
    Parameter("iyy", None, positive=True, about="second moment of area about J's y", unit="L^4"),
    Parameter("izz", None, positive=True, about="second moment of area about J's z", unit="L^4"),
    Parameter("ASY", alias="shear_y_area_ratio", about="shear ratio for shear along y; 0: none"),
    Parameter("ASZ", alias="shear_z_area_ratio", about="shear ratio for shear along z; 0: none"),
    Parameter("cratio", about="damping matrix over stiffness matrix", unit="T"),
    Parameter(
        "cmatrix", (), signed=True, count=21, about="damping matrix, lower triangle by columns"
    ),
    *(
        Parameter(
            f"preload_{axis}", signed=True, about=f"constant load on I, {axis} of J", unit=unit
        )
        for axis, unit in zip(_AXES, ("F", "F", "F", "F L", "F L", "F L"), strict=True)
    ),
    form=Wrench(_constants, _wrench, _slopes, _bounds),
    check=_check,
    functions="BEAM",
    about="straight massless beam of constant section between two markers",
    adams=Adams(
        "BEAM",
        {
            "LENGTH": ("length",),
            "IXX": ("ixx",),
            "IYY": ("iyy",),
            "IZZ": ("izz",),
            "AREA": ("area",),
            "ASY": ("ASY",),
            "ASZ": ("ASZ",),
            "EMODULUS": ("E",),
            "GMODULUS": ("G",),
            "CRATIO": ("cratio",),
            "CMATRIX": ("cmatrix",),
        },
    ),
)

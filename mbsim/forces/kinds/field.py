"""Force_Field, Adams' FIELD: a linear force and torque of all six displacements and velocities.

With q = (d, theta) - length, d along J's axes and theta the rotation vector of I in J, it exerts
on I at I's origin

    F = F0 - (K q)_d - (C u)_v         T = T0 - J(theta)^-T (K q)_theta - (C u)_w,   u = (v, w).

The symmetric half S of K stores q'S q/2 - F0.d, of which its force and torque are the exact
gradient. What the other half does, and the constant torque, has no potential and counts as lost.
C is `cratio` K or a matrix of its own.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from mbsim.core.arrays import F2, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, dot, scale, sub
from mbsim.forces.catalog import Adams, Bounds, Finding, Parameter, Values, Wrench, force
from mbsim.forces.formula import Motion
from mbsim.forces.matrix import times
from mbsim.forces.turning import turned_back

_AXES = ("x", "y", "z", "tx", "ty", "tz")
_LENGTH = tuple(f"length_{axis}" for axis in _AXES)
_PRELOAD = tuple(f"preload_{axis}" for axis in _AXES)
_STIFFNESS = tuple(f"K{r}{c}" for r in range(1, 7) for c in range(1, 7))
_DAMPING = tuple(f"C{r}{c}" for r in range(1, 7) for c in range(1, 7))
#: Half of the difference of angles [rad].
_PUSH = 1e-7
#: Where the halves of K, C and the preload stand among the constants, behind the lengths.
_K, _CURL, _C, _F0 = 6, 42, 78, 114
#: Negative parts of a damping matrix, over its diagonal, that are rounding.
_ROUNDING = 1e-12


def _matrix(values: Values, names: Sequence[str]) -> F2:
    """Return a matrix, shape (6, 6)."""
    return np.array([values[name] for name in names], dtype=float).reshape(6, 6)


def _damping(values: Values) -> F2:
    """Return C, shape (6, 6)."""
    own = _matrix(values, _DAMPING)
    return own if own.any() else values["cratio"] * _matrix(values, _STIFFNESS)


def _check(values: Values) -> Iterator[Finding]:
    K, C = _matrix(values, _STIFFNESS), _damping(values)
    if not np.array_equal(K, K.T):
        yield Finding("K is not symmetric: what it does depends on the way taken", "K12", True)
    if values["cratio"] and _matrix(values, _DAMPING).any():
        yield Finding("has no effect beside a damping matrix", "cratio", True)
    size = np.sqrt(np.abs(np.diag(C)))
    size[size == 0.0] = 1.0
    if np.linalg.eigvalsh(0.5 * (C + C.T) / np.outer(size, size))[0] < -_ROUNDING:
        yield Finding("C feeds energy to some velocities (not positive semidefinite)", "C11", True)


def _constants(values: Values) -> Sequence[float]:
    """Return lengths, both halves of K and C by rows, preload."""
    K = _matrix(values, _STIFFNESS)
    lengths = [values[name] for name in _LENGTH]
    preload = [values[name] for name in _PRELOAD]
    half, curl = 0.5 * (K + K.T), 0.5 * (K - K.T)
    return (*lengths, *half.flat, *curl.flat, *_damping(values).flat, *preload)


@jitable
def _bent(d: V3, theta: V3, par: Sequence[float]) -> tuple[V3, V3]:
    """Return the displacements (d, theta) less the lengths."""
    return sub(d, (par[0], par[1], par[2])), sub(theta, (par[3], par[4], par[5]))


@jitable
def _elastic(d: V3, theta: V3, par: Sequence[float]) -> tuple[V3, V3]:
    """Return what force and torque on I are less than the preload at rest."""
    q = _bent(d, theta, par)
    half, curl = times(par, _K, q[0], q[1]), times(par, _CURL, q[0], q[1])
    return add(half[0], curl[0]), turned_back(theta, add(half[1], curl[1]))


def _wrench(motion: Motion, par: Sequence[float]) -> tuple[V3, V3, float, float]:
    d, theta, v, w = motion.d, motion.theta, motion.v, motion.w
    q = _bent(d, theta, par)
    half, curl = times(par, _K, q[0], q[1]), times(par, _CURL, q[0], q[1])
    slowed = times(par, _C, v, w)
    f0, t0 = (par[_F0], par[_F0 + 1], par[_F0 + 2]), (par[_F0 + 3], par[_F0 + 4], par[_F0 + 5])
    around = turned_back(theta, curl[1])
    force = sub(sub(sub(f0, half[0]), curl[0]), slowed[0])
    torque = sub(sub(sub(t0, turned_back(theta, half[1])), around), slowed[1])
    stored = 0.5 * (dot(q[0], half[0]) + dot(q[1], half[1])) - dot(f0, d)
    lost = dot(v, add(slowed[0], curl[0])) + dot(w, sub(add(slowed[1], around), t0))
    return force, torque, stored, lost


def _slopes(motion: Motion, par: Sequence[float], K: F2, D: F2) -> None:
    d, theta = motion.d, motion.theta
    for r in range(6):
        for k in range(6):
            D[r, k] = par[_C + 6 * r + k]
    for k in range(3):
        e = (1.0 if k == 0 else 0.0, 1.0 if k == 1 else 0.0, 1.0 if k == 2 else 0.0)
        half, curl = times(par, _K, e, (0.0, 0.0, 0.0)), times(par, _CURL, e, (0.0, 0.0, 0.0))
        force, torque = add(half[0], curl[0]), turned_back(theta, add(half[1], curl[1]))
        # d theta = J(theta)^-1 e as I turns, which is J^-T of -theta
        turn = scale(_PUSH, turned_back(scale(-1.0, theta), e))
        up, low = _elastic(d, add(theta, turn), par), _elastic(d, sub(theta, turn), par)
        for r in range(3):
            K[r, k] = force[r]
            K[3 + r, k] = torque[r]
            K[r, 3 + k] = (up[0][r] - low[0][r]) / (2.0 * _PUSH)
            K[3 + r, 3 + k] = (up[1][r] - low[1][r]) / (2.0 * _PUSH)


def _halves(matrix: F2) -> tuple[float, float]:
    """Return a, b with x'M y <= sqrt((a |d|^2 + b |theta|^2) of x times that of y)."""
    along, about = (float(np.linalg.norm(part, 2)) for part in (matrix[:3, :3], matrix[3:, 3:]))
    between = max(float(np.linalg.norm(p, 2)) for p in (matrix[:3, 3:], matrix[3:, :3]))
    if along > 0.0 and about > 0.0:
        share = (along / about) ** 0.5
        return along + between * share, about + between / share
    return along + between, about + between


def _bounds(par: Sequence[float]) -> Bounds:
    """Return the largest stiffness and damping, and the constant force."""
    whole = np.add(par[_K : _K + 36], par[_CURL : _CURL + 36]).reshape(6, 6)
    (k, turning_k), (c, turning_c) = _halves(whole), _halves(np.reshape(par[_C : _C + 36], (6, 6)))
    # at these lengths, with I's axes along J's
    load = float(np.linalg.norm(np.add(par[_F0 : _F0 + 3], whole[:3, 3:] @ np.array(par[3:6]))))
    return Bounds(k, turning_k, c, turning_c, force=load, rest=(par[0], par[1], par[2]))


def _six(names: Sequence[str], about: str, *units: str) -> list[Parameter]:
    return [
        Parameter(name, signed=True, about=f"{about}, {axis} of J", unit=units[k // 3])
        for k, (name, axis) in enumerate(zip(names, _AXES, strict=True))
    ]


def _entries(names: Sequence[str], about: str, time: str) -> list[Parameter]:
    """Return the entries of a matrix with their units."""
    units = {(0, 0): f"F{time}/L", (0, 1): f"F{time}", (1, 0): f"F{time}", (1, 1): f"F L{time}"}
    return [
        Parameter(name, signed=True, about=about, unit=units[k // 18, k % 6 // 3])
        for k, name in enumerate(names)
    ]


force(
    "LINEAR_FIELD",
    "Force_Field",
    "fields",
    *_six(_LENGTH, "displacement without load", "L", "rad"),
    *_six(_PRELOAD, "load on I at that displacement", "F", "F L"),
    *_entries(_STIFFNESS, "stiffness: row force, column displacement", ""),
    *_entries(_DAMPING, "damping: row force, column velocity", " T"),
    Parameter("cratio", about="damping matrix over stiffness matrix", unit="T"),
    form=Wrench(_constants, _wrench, _slopes, _bounds),
    check=_check,
    functions="FIELD",
    refused=dict.fromkeys(
        ("usrsub_param_string", "usrsub_fnc_name", "usrsub_dll_name", "script_name", "interpreter"),
        "FIESUB is documented but not built yet; give matrices, or a Force_Vector_TwoBody",
    ),
    about="linear force and torque of all six displacements and velocities",
    adams=Adams(
        "FIELD",
        {
            # matrices are given by columns
            "KMATRIX": tuple(f"K{r}{c}" for c in range(1, 7) for r in range(1, 7)),
            "CMATRIX": tuple(f"C{r}{c}" for c in range(1, 7) for r in range(1, 7)),
            "LENGTH": _LENGTH,
            "FORCE": _PRELOAD,
            "CRATIO": ("cratio",),
        },
    ),
)

"""Force_MultiPoint: force and torque on each of several markers by the displacements of all.

What it is stands in `forces.kinds.multi_point`. A row of `Applied` is the force on one marker. Its
constants are

    n, rows of the n markers, lengths (6 n), preload (6), and by rows the strips (6, 6 n) of this
    marker of S and A, the halves of K, and of C.
"""

from __future__ import annotations

from mbsim.arrays.codes import MULTI_POINT, OF_POINTS, POINTS
from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, dot, scale, sub
from mbsim.dynamics.forces.wrenches import add_wrench, apply, combined, fill_motion
from mbsim.forces.matrix import times
from mbsim.forces.turning import turned_back


@jitable
def points_of(scene: Scene, f: int) -> int:
    """Return how many markers the force of row f has."""
    return int(scene.applied.par[f, POINTS])


@jitable
def row_of_point(scene: Scene, f: int, b: int) -> int:
    """Return the row of `Applied` of marker b of the force of row f."""
    return int(scene.applied.par[f, OF_POINTS + b])


@jitable
def lengths_at(n: int) -> int:
    """Return where the lengths begin among the constants."""
    return OF_POINTS + n


@jitable
def preload_at(n: int) -> int:
    """Return where the preload begins."""
    return lengths_at(n) + 6 * n


@jitable
def strip_at(n: int, which: int) -> int:
    """Return where the strip of S, A or C (0, 1, 2) begins."""
    return preload_at(n) + 6 + 36 * n * which


@jitable
def bent(scene: Scene, y: F1, f: int, b: int) -> tuple[V3, V3]:
    """Return (d, theta) of marker b less its lengths; `Work.motion` is filled by it."""
    motion, par = scene.work.motion, scene.applied.par[f]
    fill_motion(scene, y, row_of_point(scene, f, b))
    at = lengths_at(points_of(scene, f)) + 6 * b
    d = sub((motion[0], motion[1], motion[2]), (par[at], par[at + 1], par[at + 2]))
    return d, sub((motion[3], motion[4], motion[5]), (par[at + 3], par[at + 4], par[at + 5]))


@jitable
def place_of(scene: Scene, f: int) -> int:
    """Return which marker of its force row f is of."""
    b = 0
    while row_of_point(scene, f, b) != f:
        b += 1
    return b


@jitable
def loads(scene: Scene, y: F1, f: int) -> tuple[V3, V3, V3, V3, V3, V3]:
    """Return the rows of S q, A q and C u that are of the marker of row f: six vectors."""
    motion, par, n = scene.work.motion, scene.applied.par[f], points_of(scene, f)
    none = (0.0, 0.0, 0.0)
    half_d, half_t, curl_d, curl_t, slow_v, slow_w = none, none, none, none, none, none
    for b in range(n):
        q = bent(scene, y, f, b)
        v, w = (motion[6], motion[7], motion[8]), (motion[9], motion[10], motion[11])
        half = times(par, strip_at(n, 0) + 6 * b, q[0], q[1], 6 * n)
        curl = times(par, strip_at(n, 1) + 6 * b, q[0], q[1], 6 * n)
        slow = times(par, strip_at(n, 2) + 6 * b, v, w, 6 * n)
        half_d, half_t = add(half_d, half[0]), add(half_t, half[1])
        curl_d, curl_t = add(curl_d, curl[0]), add(curl_t, curl[1])
        slow_v, slow_w = add(slow_v, slow[0]), add(slow_w, slow[1])
    return half_d, half_t, curl_d, curl_t, slow_v, slow_w


@jitable
def add_multi_point(scene: Scene, y: F1, f: int) -> int:
    """Add the force on one marker, as `forces.wrenches.add_vector_force`; return 0 or a code.

    Of what S stores each row has the part by its own q: the rates of these are not those of the
    powers of single rows, their sum is.
    """
    motion, par, n = scene.work.motion, scene.applied.par[f], points_of(scene, f)
    j = scene.applied.j[f]
    half_d, half_t, curl_d, curl_t, slow_v, slow_w = loads(scene, y, f)
    q = bent(scene, y, f, place_of(scene, f))
    d, theta = (motion[0], motion[1], motion[2]), (motion[3], motion[4], motion[5])
    v, w = (motion[6], motion[7], motion[8]), (motion[9], motion[10], motion[11])
    at = preload_at(n)
    f0, t0 = (par[at], par[at + 1], par[at + 2]), (par[at + 3], par[at + 4], par[at + 5])
    around = turned_back(theta, curl_t)
    force = sub(sub(sub(f0, half_d), curl_d), slow_v)
    torque = sub(sub(sub(t0, turned_back(theta, half_t)), around), slow_w)
    stored = 0.5 * (dot(q[0], half_d) + dot(q[1], half_t)) - dot(f0, d)
    lost = dot(v, add(slow_v, curl_d)) + dot(w, sub(add(slow_w, around), t0))
    on_i, about_i = combined(scene, j, force), combined(scene, j, torque)
    return apply(scene, y, f, on_i, about_i, stored, lost)


@jitable
def add_any_wrench(scene: Scene, t: float, y: F1, f: int) -> int:
    """Add a force of several markers, a vector force or a marker force; return 0 or a code."""
    if scene.applied.form[f] == MULTI_POINT:
        return add_multi_point(scene, y, f)
    return add_wrench(scene, t, y, f)


@jitable
def stiffness_column(scene: Scene, y: F1, f: int, b: int, k: int) -> tuple[V3, V3]:
    """Return how force and torque on the marker of row f fall, as K does, by marker b.

    That is as b moves along J's axis k, or for k of 3 to 5 turns about it. How the torque turns
    with theta of the marker itself is left to `own_turning`.
    """
    par, n, motion = scene.applied.par[f], points_of(scene, f), scene.work.motion
    none, c = (0.0, 0.0, 0.0), k % 3
    e = (1.0 if c == 0 else 0.0, 1.0 if c == 1 else 0.0, 1.0 if c == 2 else 0.0)
    bent(scene, y, f, b)
    if k >= 3:
        # d theta = J(theta)^-1 e, which is J^-T of -theta
        e = turned_back((-motion[3], -motion[4], -motion[5]), e)
    d, theta = (none, e) if k >= 3 else (e, none)
    half = times(par, strip_at(n, 0) + 6 * b, d, theta, 6 * n)
    curl = times(par, strip_at(n, 1) + 6 * b, d, theta, 6 * n)
    bent(scene, y, f, place_of(scene, f))
    own = motion[3], motion[4], motion[5]
    return add(half[0], curl[0]), turned_back(own, add(half[1], curl[1]))


@jitable
def own_turning(scene: Scene, y: F1, f: int, k: int, push: float) -> V3:
    """Return how J(theta)^-T m falls as theta turns about J's axis k, m as it is.

    By differences of `push` [rad]; `Work.motion` is filled by the marker of row f.
    """
    motion = scene.work.motion
    _, half_t, _, curl_t, _, _ = loads(scene, y, f)
    bent(scene, y, f, place_of(scene, f))
    m, theta = add(half_t, curl_t), (motion[3], motion[4], motion[5])
    e = (1.0 if k == 0 else 0.0, 1.0 if k == 1 else 0.0, 1.0 if k == 2 else 0.0)
    turn = scale(push, turned_back(scale(-1.0, theta), e))
    rise = sub(turned_back(add(theta, turn), m), turned_back(sub(theta, turn), m))
    return scale(0.5 / push, rise)

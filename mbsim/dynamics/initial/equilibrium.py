"""Static equilibrium: the bodies go where all accelerations vanish at rest, without time.

Unknowns are displacements dq in the directions Q that joints and equations leave free, forces on
them r = Q'M a, a: accelerations at rest. A step solves (|H| + mu) dq = r: H, the stiffness over
the inertia, by central differences, its eigenvalues by amount so that the step goes downhill,
and mu = 1/dt^2 of a pseudo-transient that fades out as the steps succeed. A step is cut where the
force along it turns against it, so contacts are found on the way and never passed. Near the end
steps are Newton's, taken on until rounding allows no better.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from mbsim.arrays.codes import SCALE_LENGTH
from mbsim.arrays.hooks import Joints
from mbsim.arrays.scene import Scene
from mbsim.core.layout import BODY_SIZE
from mbsim.dynamics.constraints.equations import lasting
from mbsim.dynamics.constraints.selection import sticks
from mbsim.dynamics.initial.start import equation_rows, tree_map

Array = np.ndarray[Any, Any]

#: Iterations, where Param_Static does not say.
MOST_ITERATIONS = 300
#: Residual force over the largest weight (or force met) that counts as none.
BALANCED = 1e-10
#: Differences for the stiffness: parts of the model's length, and radians.
DIFFERENCE = 1e-6
#: Directions softer than this part of the stiffest are those in which nothing holds a body.
LOOSE = 1e-9
#: Rows of equations smaller than this part of the largest are implied by others.
_RANK = 1e-9
#: The most of a step: part of the model's length, of the thinnest side (from its middle), radians.
_MOST_SHIFT, _MOST_OF_SIDE, _MOST_TURN = 0.1, 0.5, 0.2
#: Bodies that have gone further than this many lengths rest on nothing.
FAR_AWAY = 1e3
_MOST_CUTS = 40
#: What the pseudo-transient's mu fades to, at least, of that of the begin.
_LEAST_MU = 1e-9


@dataclass(frozen=True)
class Hooks:
    """What is asked of the mechanism at the time of the equilibrium.

    `rhs(y, f)` returns a code and `project(y)`, `commit(y, f)` none; `serve(what, y)` asks
    joints (`arrays.hooks.Joints`) and is None where there are no joints.
    """

    rhs: Callable[[Array, Array], float]
    project: Callable[[Array], Any]
    commit: Callable[[Array, Array], Any]
    serve: Callable[[int, Array], Any] | None


@dataclass(frozen=True)
class Balance:
    """How a search ended; `residual` is a force, `scale` the force it is measured by [F].

    `loose` says that nothing holds the body with the largest residual, `unstable` that a small
    push would take the bodies away.
    """

    iterations: int
    evaluations: int
    residual: float
    scale: float
    worst: int  # body row
    far: bool
    loose: bool
    unstable: bool
    balanced: bool


class Search:
    """The search from one state; `y` is the best point so far, with velocities 0."""

    def __init__(self, scene: Scene, y: Array, hooks: Hooks) -> None:
        self.scene, self.hooks = scene, hooks
        self.count = len(scene.bodies.mass)
        self.evaluations = 0
        self.y = y.copy()
        self.first = y.copy()
        self.f = np.zeros_like(y)
        self.length = float(scene.world.scale[SCALE_LENGTH])
        inertia = np.trace(scene.bodies.inertia, axis1=1, axis2=2)
        self.gyration = np.sqrt(inertia / (2.0 * scene.bodies.mass))
        thin = scene.graphics.thin[np.isfinite(scene.graphics.thin)]
        side = _MOST_OF_SIDE * float(thin.min()) if len(thin) else np.inf
        self.longest = min(_MOST_SHIFT * self.length, side)

    def rest(self, y: Array) -> None:
        """Take all velocities away."""
        for b in range(self.count):
            y[BODY_SIZE * b + 7 : BODY_SIZE * b + 13] = 0.0

    def move_to(self, y: Array) -> None:
        """Bring y onto the constraints, at rest."""
        self.rest(y)
        self.hooks.project(y)
        self.rest(y)

    def accelerations(self, y: Array) -> Array | None:
        """Return a and alpha of all bodies, global, (nb, 6); None where there are none."""
        self.evaluations += 1
        if self.hooks.rhs(y, self.f) != 0.0:
            return None
        found: Array = self.f[: BODY_SIZE * self.count].reshape(-1, BODY_SIZE)[:, 7:13].copy()
        R = self.scene.work.R[: self.count]
        found[:, 3:] = np.einsum("bij,bj->bi", R, found[:, 3:])
        return found

    def forces(self, a: Array, R: Array) -> Array:
        """Return M a, (nb, 6)."""
        bodies = self.scene.bodies
        found = np.empty_like(a)
        found[:, :3] = bodies.mass[:, None] * a[:, :3]
        local = np.einsum("bji,bj->bi", R, a[:, 3:])
        found[:, 3:] = np.einsum("bij,bjk,bk->bi", R, bodies.inertia, local)
        return found

    def sizes(self, a: Array) -> Array:
        """Return m (|a| + k |alpha|) of every body, k its radius of gyration."""
        turn = self.gyration * np.linalg.norm(a[:, 3:], axis=1)
        found: Array = self.scene.bodies.mass * (np.linalg.norm(a[:, :3], axis=1) + turn)
        return found

    def moved(self, y: Array, twist: Array) -> Array:
        """Return y with every body displaced by (translation, rotation), back on its joints."""
        new: Array = y.copy()
        for b, (shift, turn) in enumerate(zip(twist[:, :3], twist[:, 3:], strict=True)):
            at = BODY_SIZE * b
            if twist[b].any():
                new[at : at + 3] += shift
                new[at + 3 : at + 7] = _turned(new[at + 3 : at + 7], turn)
        self.move_to(new)
        return new

    def directions(self, y: Array) -> Array:
        """Return the displacements that joints and equations leave free, (6 nb, n)."""
        scene, tree = self.scene, self.scene.tree
        free = [b for b in range(self.count) if tree.of_body[b] < 0]
        loose = np.zeros((6 * self.count, 6 * len(free)))
        for k, b in enumerate(free):
            loose[6 * b : 6 * b + 6, 6 * k : 6 * k + 6] = np.eye(6)
        if self.hooks.serve is None:
            return loose
        at = y.copy()
        if len(scene.equations.program):
            # what sticks too
            self.hooks.serve(Joints.CHOOSE, at)
        self.hooks.serve(Joints.MATRIX, at)
        found = tree_map(scene)
        if len(scene.equations.program):
            rows = equation_rows(scene, found, self.holding())
            found = found @ _null(rows)
            self.hooks.serve(Joints.CHOOSE, at)
        held = np.zeros((6 * self.count, found.shape[1]))
        for k, b in enumerate(tree.body):
            held[6 * b : 6 * b + 6] = found[6 * k : 6 * k + 6]
        return np.hstack([loose, held])

    def holding(self) -> Array:
        """Return which equations hold: those of friction only while it sticks, (ne,)."""
        lasts = lasting(self.scene)
        return np.array([lasts[e] or sticks(self.scene, e) for e in range(len(lasts))], dtype=bool)

    def stiffness(self, y: Array, P: Array) -> Array | None:
        """Return how the forces along P change with displacements along P, by differences."""
        n = P.shape[1]
        K = np.zeros((n, n))
        R = self.scene.work.R[: self.count].copy()
        unit = np.tile([self.length] * 3 + [1.0] * 3, self.count)
        for k in range(n):
            eps = DIFFERENCE / float(np.abs(P[:, k] / unit).max())
            sides = []
            for sign in (1.0, -1.0):
                a = self.accelerations(self.moved(y, sign * eps * P[:, k].reshape(-1, 6)))
                if a is None:
                    return None
                sides.append(P.T @ self.forces(a, R).ravel())
            K[:, k] = (sides[0] - sides[1]) / (2.0 * eps)
        return K

    def along(self, y: Array, twist: Array, R: Array) -> tuple[float, Array, Array] | None:
        """Return the force along a displacement after it, with the point and accelerations."""
        new = self.moved(y, twist)
        a = self.accelerations(new)
        if a is None:
            return None
        return float(twist.ravel() @ self.forces(a, R).ravel()), new, a

    def cut(self, y: Array, twist: Array, R: Array, start: float) -> tuple[float, Array, Array]:
        """Return part of a step, and where it leads: the force there does not turn against it.

        `start` is the force along the step at its begin; the part is found by regula falsi.
        """
        low, at_low, high, at_high = 0.0, start, np.inf, 0.0
        best: tuple[float, Array, Array] | None = None
        part = 1.0
        for _ in range(_MOST_CUTS):
            found = self.along(y, part * twist, R)
            s = -np.inf if found is None else found[0] / part
            if found is not None and s >= -0.5 * start:
                best = (part, found[1], found[2])
                if part == 1.0 or s <= 0.5 * start:
                    return best
                low, at_low = part, s
                at_high *= 0.5
            else:
                high, at_high = part, s
                at_low *= 0.5
            weight = at_low / (at_low - at_high) if np.isfinite(at_high) else 0.5
            part = low + (high - low) * min(max(weight, 1e-3), 0.9)
            at_low = max(at_low, 1e-300)
        if best is None:
            a = self.accelerations(y)
            return 0.0, y, np.zeros((self.count, 6)) if a is None else a
        return best

    def limit(self, twist: Array) -> float:
        """Return the part of a step that is short enough."""
        shift = float(np.linalg.norm(twist[:, :3], axis=1).max(initial=0.0))
        turn = float(np.linalg.norm(twist[:, 3:], axis=1).max(initial=0.0))
        return min(1.0, self.longest / shift if shift else 1.0, _MOST_TURN / turn if turn else 1.0)

    def gone(self) -> bool:
        """Return whether a body is far from where it was."""
        shape = (-1, BODY_SIZE)
        n = BODY_SIZE * self.count
        shift = self.y[:n].reshape(shape)[:, :3] - self.first[:n].reshape(shape)[:, :3]
        return bool(np.abs(shift).max(initial=0.0) > FAR_AWAY * self.length)

    def keep(self, y: Array) -> Array | None:
        """Take a point as the best so far; return the accelerations there."""
        self.y = y
        self.accelerations(y)
        self.hooks.commit(y, self.f)
        return self.accelerations(y)


def _turned(q: Array, turn: Array) -> Array:
    """Return a quaternion turned by a rotation vector, global: (cos, sin e) q."""
    angle = float(np.linalg.norm(turn))
    c = np.cos(0.5 * angle)
    u = 0.5 * np.sinc(angle / (2.0 * np.pi)) * turn
    return np.concatenate([[c * q[0] - u @ q[1:]], c * q[1:] + q[0] * u + np.cross(u, q[1:])])


def _null(rows: Array) -> Array:
    """Return an orthonormal basis of what `rows` take to 0."""
    if not len(rows):
        return np.eye(rows.shape[1])
    size = np.linalg.norm(rows, axis=1)
    _, s, vt = np.linalg.svd(rows / np.where(size > 0.0, size, 1.0)[:, None])
    rank = int((s > _RANK * max(float(s.max(initial=0.0)), 1e-300)).sum())
    free: Array = vt[rank:].T
    return free


@dataclass
class _Local:
    """The mechanism at one point: directions P that are orthonormal by inertia, forces, H = VDV'.

    `K` is not symmetric where forces follow bodies; `H` is its symmetric part, negated.
    """

    P: Array
    g: Array
    K: Array
    d: Array
    V: Array
    R: Array


def _look(search: Search, a: Array) -> _Local | None:
    """Return what the mechanism is like at the best point so far."""
    y = search.y
    Q = search.directions(y)
    R = search.scene.work.R[: search.count].copy()
    M = np.array([search.forces(q.reshape(-1, 6), R).ravel() for q in Q.T]).T
    if Q.shape[1] == 0:
        empty = np.zeros((0, 0))
        return _Local(Q, np.zeros(0), empty, np.zeros(0), empty, R)
    L = np.linalg.cholesky(Q.T @ M)
    P = np.linalg.solve(L, Q.T).T
    K = search.stiffness(y, P)
    if K is None or not np.isfinite(K).all():
        return None
    d, V = np.linalg.eigh(-0.5 * (K + K.T))
    return _Local(P, P.T @ search.forces(a, R).ravel(), K, d, V, R)


def _newton(local: _Local) -> Array:
    """Return Newton's step of least norm, along P."""
    u, s, vt = np.linalg.svd(-local.K)
    keep = s > LOOSE * max(float(s.max(initial=0.0)), 1e-300)
    found: Array = vt[keep].T @ ((u.T @ local.g)[keep] / s[keep])
    return found


def _downhill(local: _Local, mu: float) -> Array:
    """Return the pseudo-transient's step along P."""
    found: Array = local.V @ ((local.V.T @ local.g) / (np.abs(local.d) + mu))
    return found


def _is_loose(local: _Local) -> bool:
    """Return whether the largest force is in a direction in which nothing is stiff."""
    soft = np.abs(local.d) <= LOOSE * np.abs(local.d).max(initial=0.0)
    parts = local.V.T @ local.g
    return bool(soft.any() and np.abs(parts[soft]).max() >= 0.5 * np.abs(parts).max())


def balance(
    scene: Scene,
    y: Array,
    hooks: Hooks,
    most: int = MOST_ITERATIONS,
    imbalance: float | None = None,
) -> tuple[Balance, Array]:
    """Return how the search for an equilibrium ended, and the best state, at rest.

    Parameters
    ----------
    scene : Scene
    y : (n,) array
        Where to start; its velocities do not count.
    hooks : Hooks
    most : int
        Iterations.
    imbalance : float, optional
        Residual force that is accepted [F]; default 1e-10 of the largest weight (where nothing
        weighs, of the largest force at the start), or what rounding leaves.
    """
    search = Search(scene, y, hooks)
    search.move_to(search.y)
    a = search.keep(search.y)
    if a is None:
        return Balance(0, search.evaluations, np.inf, 1.0, 0, False, False, False, False), y
    weight = float(scene.bodies.mass.max(initial=0.0) * np.linalg.norm(scene.world.gravity))
    scale = max(weight, float(search.sizes(a).max(initial=0.0)) if weight == 0.0 else 0.0)
    size = float(search.sizes(a).max(initial=0.0))
    strongest = float(np.abs(a[:, :3]).max(initial=0.0))
    mu = first_mu = strongest / search.longest
    worst, loose, unstable, far, done = 0, False, False, False, False
    k = 0
    while True:
        size = float(search.sizes(a).max(initial=0.0))
        worst = int(search.sizes(a).argmax()) if search.count else 0
        local = None if size == 0.0 and done else _look(search, a)
        if local is None:
            break
        stiffest = float(np.abs(local.d).max(initial=0.0))
        # a distance has a rounding of the length, a force that of the distance times stiffness
        heaviest = float(scene.bodies.mass.max(initial=0.0))
        noise = 64.0 * np.finfo(float).eps * stiffest * heaviest * search.length
        enough = max(BALANCED * scale, noise) if imbalance is None else max(imbalance, noise)
        done = size <= enough
        loose = _is_loose(local)
        unstable = bool(local.d.min(initial=0.0) < -1e-6 * stiffest)
        if size == 0.0 or k >= most or not len(local.g):
            done = done or not len(local.g)
            break
        k += 1
        a_new = _try_newton(search, local, size, done)
        if a_new is not None:
            a = a_new
            continue
        if done:
            break
        twist = (local.P @ _downhill(local, mu)).reshape(-1, 6)
        twist *= search.limit(twist)
        start = float(twist.ravel() @ (search.forces(a, local.R)).ravel())
        part, new, _ = search.cut(search.y, twist, local.R, start)
        if part == 0.0:
            mu = 4.0 * max(mu, LOOSE * stiffest)
            if mu > 1e6 * max(stiffest, strongest / search.longest):
                break
            continue
        mu = mu / 4.0 if part == 1.0 else min(2.0 * mu, max(stiffest, mu))
        mu = max(mu, LOOSE * stiffest, _LEAST_MU * first_mu)
        found = search.keep(new)
        if found is None:
            break
        a = found
        if search.gone():
            far = True
            break
    balance = Balance(
        k, search.evaluations, size, scale or 1.0, worst, far, loose, unstable and done, done
    )
    return balance, search.y


def _try_newton(search: Search, local: _Local, size: float, done: bool) -> Array | None:
    """Go by Newton's step where it halves the residual; return the accelerations there."""
    if local.d.min() < -LOOSE * np.abs(local.d).max():
        # downhill first: Newton's step leads to a saddle as well
        if not done:
            return None
    twist = (local.P @ _newton(local)).reshape(-1, 6)
    if not search.limit(twist) == 1.0:
        return None
    found = search.along(search.y, twist, local.R)
    if found is None or not float(search.sizes(found[2]).max()) <= 0.5 * size:
        return None
    return search.keep(found[1])

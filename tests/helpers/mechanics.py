"""An independent solver of small mechanisms, for tests: bodies, constraints, multipliers.

A quantity that moves with the bodies is a `Jet`: its value, its rate, and its second
derivative as a linear function of all accelerations. The rules for sums and products of jets
are Leibniz's; so a constraint written as geometry between two frames gives its Jacobian and
its right-hand side with no derivative taken by hand, and none of the code under test.
Accelerations and multipliers follow from M a - G' lambda = F, G a = -gamma (Lagrange, index 1),
integrated by scipy's DOP853.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.integrate import solve_ivp

GROUND = 0


class Jet:
    """A scalar or vector `v`, its rate `d`, and its second derivative `a` @ (accelerations, 1)."""

    def __init__(self, v, d, a):
        self.v, self.d, self.a = v, d, a

    def __add__(self, other):
        return Jet(self.v + other.v, self.d + other.d, self.a + other.a)

    def __sub__(self, other):
        return Jet(self.v - other.v, self.d - other.d, self.a - other.a)

    def __neg__(self):
        return Jet(-self.v, -self.d, -self.a)

    def __mul__(self, factor):
        return Jet(self.v * factor, self.d * factor, self.a * factor)

    __rmul__ = __mul__


def dot(a, b):
    """Return the scalar product of two vector jets."""
    second = b.v @ a.a + a.v @ b.a
    second[-1] += 2.0 * (a.d @ b.d)
    return Jet(a.v @ b.v, a.d @ b.v + a.v @ b.d, second)


def function(x, f, df, ddf):
    """Return f(x) of a scalar jet, from f and its two derivatives at x."""
    second = df * x.a
    second[-1] += ddf * x.d**2
    return Jet(f, df * x.d, second)


def root(x):
    """Return the square root of a scalar jet."""
    r = np.sqrt(x.v)
    return function(x, r, 0.5 / r, -0.25 / r**3)


def angle(s, c):
    """Return the angle whose sine and cosine are s and c (in (-pi, pi])."""
    # d(angle) = (c ds - s dc) / (s^2 + c^2), written with jets of the rates
    n = s.v**2 + c.v**2
    rate = (c.v * s.d - s.v * c.d) / n
    second = (c.v * s.a - s.v * c.a) / n
    second[-1] -= 2.0 * rate * (s.v * s.d + c.v * c.d) / n
    return Jet(np.arctan2(s.v, c.v), rate, second)


class Frame:
    """A marker as it moves: origin `p`, axes `x`, `y`, `z`, angular velocity `w` (rate only)."""

    def __init__(self, p, x, y, z, w):
        self.p, self.x, self.y, self.z, self.w = p, x, y, z, w


@dataclass
class Body:
    """A rigid body: mass, inertia about its centre in its own axes, pose and velocity at 0."""

    mass: float
    inertia: object  # three principal values, or a tensor
    p: object
    R: object = field(default_factory=lambda: np.eye(3))
    v: object = (0.0, 0.0, 0.0)
    w: object = (0.0, 0.0, 0.0)


@dataclass
class Marker:
    """A marker given in the global frame at the start, on body `body` (0 is ground)."""

    body: int
    p: object
    R: object = field(default_factory=lambda: np.eye(3))


@dataclass
class Constraint:
    """Equations `rows(I, J, t)` between two markers: a list of jets that stay 0."""

    i: Marker
    j: Marker
    rows: object


@dataclass
class Force:
    """Loads on I by J: `law(I, J, t)` gives force at I's origin and torque on I, global axes.

    The opposite acts on J at I's origin; `on_j` gives J's own point of action (a jet) instead.
    """

    i: Marker
    j: Marker
    law: object


def skew(a):
    """Return the matrix of the cross product with a."""
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def matrix(q):
    """Return the rotation matrix of a quaternion, w first."""
    w, x, y, z = q / np.sqrt(q @ q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def quaternion(R):
    """Return the quaternion, w first, of a rotation matrix."""
    from scipy.spatial.transform import Rotation

    return np.roll(Rotation.from_matrix(np.asarray(R, float)).as_quat(), 1)


class Mechanism:
    """Bodies under gravity, constraints and forces. Body k is `bodies[k - 1]`."""

    def __init__(self, bodies, constraints=(), forces=(), g=(0.0, 0.0, -9.81)):
        self.bodies, self.constraints, self.forces = list(bodies), list(constraints), list(forces)
        self.g = np.array(g, float)
        self.columns = 6 * (len(self.bodies) + 1)
        self.start = [(np.zeros(3), np.eye(3))]
        for body in self.bodies:
            self.start.append((np.array(body.p, float), np.array(body.R, float)))
        self.inertias = []
        for body in self.bodies:
            J = np.array(body.inertia, float)
            self.inertias.append(np.diag(J) if J.ndim == 1 else J)

    def y0(self):
        """Return the start: position, quaternion, velocity, angular velocity of each body."""
        return np.concatenate(
            [np.concatenate([b.p, quaternion(b.R), b.v, b.w]) for b in self.bodies]
        ).astype(float)

    def parts(self, y):
        """Return position, rotation matrix, velocity and angular velocity of all bodies."""
        out = [(np.zeros(3), np.eye(3), np.zeros(3), np.zeros(3))]
        for k in range(len(self.bodies)):
            s = y[13 * k : 13 * k + 13]
            out.append((s[:3], matrix(s[3:7]), s[7:10], s[10:13]))
        return out

    def frame(self, marker, parts):
        """Return the moving frame of a marker."""
        k = marker.body
        p, R, v, w = parts[k]
        p0, R0 = self.start[k]
        s = R @ (R0.T @ (np.asarray(marker.p, float) - p0))
        axes = R @ (R0.T @ np.asarray(marker.R, float))

        def turning(u, base=None):
            a = np.zeros((3, self.columns + 1))
            a[:, 6 * k + 3 : 6 * k + 6] = -skew(u)
            a[:, -1] = np.cross(w, np.cross(w, u))
            return a

        a = turning(s)
        a[:, 6 * k : 6 * k + 3] = np.eye(3)
        origin = Jet(p + s, v + np.cross(w, s), a)
        x, y, z = (Jet(u, np.cross(w, u), turning(u)) for u in axes.T)
        spin = np.zeros((3, self.columns + 1))
        spin[:, 6 * k + 3 : 6 * k + 6] = np.eye(3)
        return Frame(origin, x, y, z, Jet(np.full(3, np.nan), w, spin))

    def rows(self, parts, t):
        """Return all constraint equations as jets, and for each its constraint."""
        jets, owner = [], []
        for k, c in enumerate(self.constraints):
            new = c.rows(self.frame(c.i, parts), self.frame(c.j, parts), t)
            jets += new
            owner += [k] * len(new)
        return jets, owner

    def accelerations(self, y, t):
        """Return accelerations (bodies, 6), multipliers, the rows and their owners."""
        parts = self.parts(y)
        n = self.columns
        M, F = np.zeros((n - 6, n - 6)), np.zeros(n)
        for k, body in enumerate(self.bodies):
            _, R, _, w = parts[k + 1]
            J = R @ self.inertias[k] @ R.T
            M[6 * k : 6 * k + 3, 6 * k : 6 * k + 3] = body.mass * np.eye(3)
            M[6 * k + 3 : 6 * k + 6, 6 * k + 3 : 6 * k + 6] = J
            F[6 * k + 6 : 6 * k + 9] = body.mass * self.g
            F[6 * k + 9 : 6 * k + 12] = -np.cross(w, J @ w)
        for load in self.forces:
            I, J = self.frame(load.i, parts), self.frame(load.j, parts)
            force, torque = load.law(I, J, t)
            for k, sign in ((load.i.body, 1.0), (load.j.body, -1.0)):
                arm = I.p.v - parts[k][0]
                F[6 * k : 6 * k + 3] += sign * force
                F[6 * k + 3 : 6 * k + 6] += sign * (torque + np.cross(arm, force))
        jets, owner = self.rows(parts, t)
        if not jets:
            return np.linalg.solve(M, F[6:]).reshape(-1, 6), np.zeros(0), jets, owner
        G = np.array([jet.a[:-1] for jet in jets])
        gamma = np.array([jet.a[-1] for jet in jets])
        inverse = np.linalg.inv(M)
        free = inverse @ F[6:]
        A = G[:, 6:] @ inverse @ G[:, 6:].T
        scale = 1.0 / np.sqrt(np.diag(A))
        right = -gamma - G[:, 6:] @ free
        # redundant rows: the smallest multipliers (in force units of the rows) that do it
        lam = scale * np.linalg.lstsq(scale[:, None] * A * scale, scale * right, rcond=1e-10)[0]
        return (free + inverse @ G[:, 6:].T @ lam).reshape(-1, 6), lam, jets, owner

    def rhs(self, t, y):
        """Return dy/dt."""
        a = self.accelerations(y, t)[0]
        out = np.empty_like(y)
        for k in range(len(self.bodies)):
            s = y[13 * k : 13 * k + 13]
            w, x, yy, z = s[3:7]
            out[13 * k : 13 * k + 3] = s[7:10]
            E = np.array([[-x, -yy, -z], [w, z, -yy], [-z, w, x], [yy, -x, w]])
            out[13 * k + 3 : 13 * k + 7] = 0.5 * E @ s[10:13]
            out[13 * k + 7 : 13 * k + 13] = a[k]
        return out

    def solve(self, times, rtol=1e-11, atol=1e-12):
        """Return the motion at the times as a `Solution`."""
        times = np.asarray(times, float)
        found = solve_ivp(
            self.rhs, (times[0], times[-1]), self.y0(), method="DOP853",
            t_eval=times, rtol=rtol, atol=atol,
        )  # fmt: skip
        assert found.success, found.message
        return Solution(self, times, found.y.T)


class Solution:
    """A motion; arrays (rows, 3) of body k, and reactions of constraint c on its I side."""

    def __init__(self, mechanism, times, y):
        self.mechanism, self.times, self.y = mechanism, times, y
        self._solved = None

    def _body(self, k, first, last):
        return self.y[:, 13 * (k - 1) + first : 13 * (k - 1) + last]

    def position(self, k):
        return self._body(k, 0, 3)

    def quaternion(self, k):
        q = self._body(k, 3, 7)
        return q / np.linalg.norm(q, axis=1)[:, None]

    def velocity(self, k):
        return self._body(k, 7, 10)

    def angular_velocity(self, k):
        return self._body(k, 10, 13)

    def _solutions(self):
        if self._solved is None:
            both = zip(self.times, self.y, strict=True)
            self._solved = [self.mechanism.accelerations(y, t) for t, y in both]
        return self._solved

    def acceleration(self, k):
        return np.array([a[k - 1, :3] for a, _, _, _ in self._solutions()])

    def angular_acceleration(self, k):
        return np.array([a[k - 1, 3:] for a, _, _, _ in self._solutions()])

    def residual(self):
        """Return the largest constraint value and rate over all rows."""
        values = [(abs(jet.v), abs(jet.d)) for _, _, jets, _ in self._solutions() for jet in jets]
        return np.nanmax(np.array(values), axis=0)

    def reaction(self, c):
        """Return force and torque (rows, 6) of constraint c on its I body, torque about I."""
        out = []
        k = self.mechanism.constraints[c].i.body
        marker = self.mechanism.constraints[c].i
        for y, (_, lam, jets, owner) in zip(self.y, self._solutions(), strict=True):
            parts = self.mechanism.parts(y)
            load = np.zeros(6)
            for value, jet, own in zip(lam, jets, owner, strict=True):
                if own == c:
                    load += value * jet.a[6 * k : 6 * k + 6]
            arm = self.mechanism.frame(marker, parts).p.v - parts[k][0]
            load[3:] -= np.cross(arm, load[:3])
            out.append(load)
        return np.array(out)

    def energy(self):
        """Return kinetic and gravity's potential energy (rows,)."""
        kinetic, potential = np.zeros(len(self.times)), np.zeros(len(self.times))
        for row, y in enumerate(self.y):
            parts = self.mechanism.parts(y)
            for k, body in enumerate(self.mechanism.bodies):
                p, R, v, w = parts[k + 1]
                local = R.T @ w
                kinetic[row] += 0.5 * body.mass * v @ v
                kinetic[row] += 0.5 * local @ self.mechanism.inertias[k] @ local
                potential[row] -= body.mass * self.mechanism.g @ p
        return kinetic, potential


# --- joints as geometry: each written from what it does, not from a table of rows ---


def components(a):
    """Return the three components of a vector jet as scalar jets."""
    return [Jet(a.v[i], a.d[i], a.a[i].copy()) for i in range(3)]


def spherical(I, J, t):
    """The origins coincide."""
    return components(I.p - J.p)


def parallel(I, J, t):
    """z of I stays along z of J: no part of it in J's x and y."""
    return [dot(I.z, J.x), dot(I.z, J.y)]


def revolute(I, J, t):
    """Common origin, common z."""
    return spherical(I, J, t) + parallel(I, J, t)


def orientation(I, J, t):
    """Axes stay as they are against each other (written for axes that agree at the start)."""
    return [dot(I.x, J.y), dot(I.y, J.z), dot(I.z, J.x)]


def inplane(I, J, t):
    """I's origin in J's xy-plane."""
    return [dot(I.p - J.p, J.z)]


def inline(I, J, t):
    """I's origin on J's z-axis."""
    d = I.p - J.p
    return [dot(d, J.x), dot(d, J.y)]


def cylindrical(I, J, t):
    """Common z-axis."""
    return inline(I, J, t) + parallel(I, J, t)


def translational(I, J, t):
    """Common z-axis, no turning."""
    return inline(I, J, t) + orientation(I, J, t)


def planar(I, J, t):
    """I's xy-plane in J's."""
    return inplane(I, J, t) + parallel(I, J, t)


def fixed(I, J, t):
    """No motion at all."""
    return spherical(I, J, t) + orientation(I, J, t)


def perpendicular(I, J, t):
    """z-axes at right angles."""
    return [dot(I.z, J.z)]


def universal(I, J, t):
    """Cross with arms along the z-axes."""
    return [*spherical(I, J, t), dot(I.z, J.z)]


def hooke(I, J, t):
    """Cross with arms along I's x and J's y; the shafts are the z-axes."""
    return [*spherical(I, J, t), dot(I.x, J.y)]


def distance(length):
    """Origins at a fixed distance."""

    def rows(I, J, t):
        d = I.p - J.p
        r = root(dot(d, d))
        return [Jet(r.v - length, r.d, r.a)]

    return rows


def relative_angle(I, J):
    """Return the angle of I's x about J's z, from J's x."""
    return angle(dot(I.x, J.y), dot(I.x, J.x))


def screw(pitch):
    """Common z-axis; pitch along it a turn. (The value is known up to whole turns.)"""

    def rows(I, J, t):
        turn = relative_angle(I, J)
        travel = dot(I.p - J.p, J.z)
        advance = travel - turn * (pitch / (2.0 * np.pi))
        return [*inline(I, J, t), *parallel(I, J, t), Jet(np.nan, advance.d, advance.a)]

    return rows


def constant_velocity(I, J, t):
    """Common origin; relative spin about the bisector of the shafts (z-axes) is none.

    The joint is a half turn about J's z and one about the bisector n, so that I.x - J.x and
    I.y - J.y lie along n as well: one of them is long where shafts that fold back leave I.z + J.z
    short.
    """
    axis = max((I.z + J.z, I.x - J.x, I.y - J.y), key=lambda sum: sum.v @ sum.v)
    w = I.w - J.w
    # rate of the constraint: w . axis = 0; its derivative is linear in the accelerations
    second = axis.v @ w.a
    second[-1] += w.d @ axis.d
    return [*spherical(I, J, t), Jet(np.nan, w.d @ axis.v, second)]


def driven_angle(f, df, ddf):
    """The angle of I about J's z is f(t)."""

    def rows(I, J, t):
        a = relative_angle(I, J)
        second = a.a.copy()
        second[-1] -= ddf(t)
        gap = (a.v - f(t) + np.pi) % (2.0 * np.pi) - np.pi
        return [Jet(gap, a.d - df(t), second)]

    return rows


def driven_travel(f, df, ddf):
    """I's origin is at f(t) along J's z."""

    def rows(I, J, t):
        a = dot(I.p - J.p, J.z)
        second = a.a.copy()
        second[-1] -= ddf(t)
        return [Jet(a.v - f(t), a.d - df(t), second)]

    return rows


def spring(k, c, length):
    """A spring and damper along the line of the origins."""

    def law(I, J, t):
        d = I.p.v - J.p.v
        r = np.sqrt(d @ d)
        if r == 0.0:
            return np.zeros(3), np.zeros(3)
        u = d / r
        rate = (I.p.d - J.p.d) @ u
        return (-k * (r - length) - c * rate) * u, np.zeros(3)

    return law


def torsion(k, c):
    """A spring and damper about J's z; along z the turns are counted from -pi to pi."""

    def law(I, J, t):
        a = relative_angle(I, J)
        return np.zeros(3), (-k * a.v - c * (I.w.d - J.w.d) @ J.z.v) * J.z.v

    return law


def euler313(psi, theta, phi):
    """Return Rz(psi) Rx(theta) Rz(phi), angles in degrees."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_euler("ZXZ", [psi, theta, phi], degrees=True).as_matrix()

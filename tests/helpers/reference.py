"""Independent solutions: a mass on the IMPACT law, by an 8th-order method; a top, by series."""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq


def drop_height(times, z0, low, mass, stiffness, exponent, damping, dmax, g=9.81):
    """Return the height of a body whose lowest point is `low` below its centre.

    Steps are bounded in contact, where the force may vanish and come back (see README,
    design note 6), so that none is missed.
    """

    def force(z, v):
        depth = low - z
        if depth <= 0.0:
            return 0.0
        s = min(depth / dmax, 1.0)
        damper = damping * s * s * (3.0 - 2.0 * s)
        return max(0.0, stiffness * depth**exponent - damper * v)

    def rhs(t, y):
        return [y[1], force(y[0], y[1]) / mass - g]

    def touch(t, y):
        return y[0] - low

    touch.terminal, touch.direction = True, -1.0

    def leave(t, y):
        return y[0] - low

    leave.terminal, leave.direction = True, 1.0
    heights = np.full(len(times), np.nan)
    t, y, end = float(times[0]), [z0, 0.0], float(times[-1])
    free = True
    while t < end:
        solution = solve_ivp(
            rhs,
            (t, end),
            y,
            method="DOP853",
            rtol=1e-12,
            atol=1e-14,
            events=touch if free else leave,
            max_step=np.inf if free else 5e-6,
            dense_output=True,
        )
        inside = (times >= t) & (times <= solution.t[-1])
        if inside.any():
            heights[inside] = solution.sol(times[inside])[0]
        t, y = float(solution.t[-1]), list(solution.y[:, -1])
        y[0] = low
        free = not free
        # leave the surface before the event is armed again
        t_new = t + 1e-12
        y[0] += y[1] * 1e-12
        t = t_new
    return heights


def top_attitude(inertia, w0, end, steps, order=28):
    """Return the attitude (w first) at `end` of a free top that starts at the identity.

    Taylor series of Euler's equations and q' = q (0, w)/2, all of them products: the series
    of a product is the convolution of the series. In extended precision where there is one.
    """
    real = np.longdouble
    a, b, c = (real(str(i)) for i in inertia)
    ratio = ((b - c) / a, (c - a) / b, (a - b) / c)
    w, q = np.zeros((3, order + 1), real), np.zeros((4, order + 1), real)
    w[:, 0], q[0, 0] = [real(str(x)) for x in w0], 1.0
    powers = (real(str(end)) / steps) ** np.arange(order + 1)
    for _ in range(steps):
        for k in range(order):

            def product(x, y, k=k):
                return np.dot(x[: k + 1], y[k::-1]) / (k + 1)

            for i in range(3):
                w[i, k + 1] = ratio[i] * product(w[(i + 1) % 3], w[(i + 2) % 3])
            q[0, k + 1] = -sum(product(q[i + 1], w[i]) for i in range(3)) / 2
            for i in range(3):
                j, m = (i + 1) % 3, (i + 2) % 3
                turn = product(q[j + 1], w[m]) - product(q[m + 1], w[j])
                q[i + 1, k + 1] = (product(q[0], w[i]) + turn) / 2
        w[:, 0], q[:, 0] = w @ powers, q @ powers
        q[:, 0] /= np.sqrt(q[:, 0] @ q[:, 0])
    return q[:, 0].astype(float)


def angle_between(p, q):
    """Return the angle [rad] from attitude p to attitude q."""
    return 4.0 * np.arcsin(0.5 * min(np.linalg.norm(p - q), np.linalg.norm(p + q)))


def impact(depth, rate, stiffness, exponent, damping, dmax):
    """Return the IMPACT force at a depth and its rate."""
    if depth <= 0.0:
        return 0.0
    s = min(depth / dmax, 1.0)
    return max(0.0, stiffness * depth**exponent + damping * s * s * (3.0 - 2.0 * s) * rate)


def wall_pendulum(times, start, length, mass, inertia, law, g=9.81):
    """Return the angle [rad] from the vertical of a pendulum that meets a wall at 0.

    `inertia` is that about the hinge; the wall pushes level at the bob. Steps end at each touch
    and are bounded in contact.
    """

    def rhs(t, y):
        depth, rate = length * np.sin(y[0]), length * np.cos(y[0]) * y[1]
        push = impact(depth, rate, *law) * length * np.cos(y[0])
        return [y[1], -(mass * g * length * np.sin(y[0]) + push) / inertia]

    def cross(t, y):
        return y[0]

    cross.terminal = True
    angles, t, y, end = np.full(len(times), np.nan), float(times[0]), [start, 0.0], times[-1]
    while t < end:
        free = y[0] < 0.0 or (y[0] == 0.0 and y[1] < 0.0)
        cross.direction = 1.0 if free else -1.0
        found = solve_ivp(
            rhs, (t, end), y, method="DOP853", rtol=1e-12, atol=1e-14, events=cross,
            max_step=np.inf if free else 5e-5, dense_output=True,
        )  # fmt: skip
        inside = (times >= t) & (times <= found.t[-1])
        angles[inside] = found.sol(times[inside])[0]
        t, y = float(found.t[-1]), [0.0, float(found.y[1, -1])]
    return angles


def slider_crank(times, angle, speed, crank, rod, slider, g=9.81):
    """Return the crank's angle; `crank` and `rod` are (length, mass) of slender bars.

    The kinetic energy is M(a) a'^2 / 2; M' by the complex step.
    """
    (r, m), (length, n) = crank, rod

    def terms(a):
        sine = -r * np.sin(a) / length
        cosine = np.sqrt(1 - sine**2)
        turn = -r * np.cos(a) / (length * cosine)  # the rod's angle per crank angle
        x = -r * np.sin(a) - length / 2 * sine * turn
        z = r * np.cos(a) + length / 2 * cosine * turn
        slide = -r * np.sin(a) - length * sine * turn
        inertia = m * r**2 / 3 + n * (x**2 + z**2 + length**2 / 12 * turn**2) + slider * slide**2
        height = m * r / 2 * np.sin(a) + n * (r * np.sin(a) + length / 2 * sine)
        return inertia, g * height

    def rhs(t, y):
        step = 1e-30
        inertia, potential = terms(y[0] + 1j * step)
        push = (potential.imag + 0.5 * inertia.imag * y[1] ** 2) / step
        return [y[1], -push / inertia.real]

    return solve_ivp(
        rhs, (times[0], times[-1]), [angle, speed], method="DOP853", t_eval=times,
        rtol=1e-12, atol=1e-13,
    ).y[0]  # fmt: skip


def falling_chain(times, node, angles, length, mass, radius, law, g=9.81):
    """Return the nodes (rows, links + 1, 2) of hinged slender links above a floor at 0.

    Coordinates: x and z of the first node, and the links' angles from the horizontal; a ball at
    each node meets the floor without friction.
    """
    links = len(angles)
    size = 2 + links

    def place(q, u):
        """Return for each node its position, Jacobian, and the acceleration left at q'' = 0."""
        p, J, c = [q[:2]], [np.eye(2, size)], [np.zeros(2)]
        for k in range(links):
            cos, sin = np.cos(q[2 + k]), np.sin(q[2 + k])
            along, across = length * np.array([cos, sin]), length * np.array([-sin, cos])
            step = np.zeros((2, size))
            step[:, 2 + k] = across
            p.append(p[-1] + along)
            J.append(J[-1] + step)
            c.append(c[-1] - along * u[2 + k] ** 2)
        return np.array(p), np.array(J), np.array(c)

    def rhs(t, y):
        q, u = y[:size], y[size:]
        p, J, c = place(q, u)
        M, F = np.zeros((size, size)), np.zeros(size)
        for k in range(links):
            middle, rest = (J[k] + J[k + 1]) / 2, (c[k] + c[k + 1]) / 2
            M += mass * middle.T @ middle
            M[2 + k, 2 + k] += mass * length**2 / 12
            F -= mass * middle.T @ (rest + np.array([0.0, g]))
        for k in range(links + 1):
            push = impact(radius - p[k, 1], -J[k][1] @ u, *law)
            F += push * J[k][1]
        return np.concatenate([u, np.linalg.solve(M, F)])

    def touches(k):
        def gap(t, y):
            return place(y[:size], y[size:])[0][k, 1] - radius

        return gap

    events = [touches(k) for k in range(links + 1)]
    for event in events:
        event.terminal = True
    y, t = np.concatenate([node, angles, np.zeros(size)]), float(times[0])
    out = np.full((len(times), links + 1, 2), np.nan)
    while t < times[-1]:
        # in contact, and just after, small steps; in flight to the next touch
        near = min(event(t, y) for event in events) < 1e-9
        found = solve_ivp(
            rhs, (t, min(t + 0.01, times[-1]) if near else times[-1]), y, method="DOP853",
            rtol=1e-11, atol=1e-13, max_step=1e-4 if near else 0.01,
            events=None if near else events, dense_output=True,
        )  # fmt: skip
        for row in np.flatnonzero((times >= t) & (times <= found.t[-1])):
            state = found.sol(times[row])
            out[row] = place(state[:size], state[size:])[0]
        t, y = float(found.t[-1]), found.y[:, -1]
    return out


def elastic_stop(times, mass, spring, stop, gap, v=0.0, push=0.0, frequency=0.0):
    """Return position of a mass on a spring with a linear stop at x = gap, and events.

    It starts at x = 0 with `v`, under push sin(frequency t). In each stretch (free, in the stop)
    the motion is A cos(w s) + B sin(w s) + offset + P sin(frequency t), exact to the root finder
    that joins them. Events are pairs of time and "touch" or "leave".
    """
    t, x = float(times[0]), 0.0
    events, out = [], np.empty(len(times))
    inside = x >= gap and v > 0.0
    if inside:
        events.append((t, "touch"))
    while t <= times[-1]:
        stiffness = spring + (stop if inside else 0.0)
        w = np.sqrt(stiffness / mass)
        offset = stop * gap / stiffness if inside else 0.0
        P = push / (stiffness - mass * frequency**2)
        A = x - offset - P * np.sin(frequency * t)
        B = (v - P * frequency * np.cos(frequency * t)) / w

        def place(s, t=t, w=w, A=A, B=B, P=P, offset=offset):
            harmonic = P * np.sin(frequency * (t + s))
            return A * np.cos(w * s) + B * np.sin(w * s) + offset + harmonic

        step = 0.01 / w
        end, sign = step, 1.0 if inside else -1.0
        # out of x = gap first (s = 0 is a root), then to the next change of side
        while t + end <= times[-1] and sign * (place(end) - gap) > 0.0:
            end += step
        found = t + end <= times[-1]
        if found:
            end = brentq(lambda s: place(s) - gap, end - step, end, xtol=1e-16)
        rows = (times >= t) & (times <= t + end)
        out[rows] = place(times[rows] - t)
        if not found:
            break
        phase = frequency * (t + end)
        v = w * (B * np.cos(w * end) - A * np.sin(w * end)) + P * frequency * np.cos(phase)
        t, x, inside = t + end, gap, not inside
        events.append((t, "touch" if inside else "leave"))
    return out, events


def flat_follower(times, speed, e, mass, spring, preload, K, c, start, g=9.81):
    """Return the lift of a flat follower on an eccentric cam that it does not leave, and its rate.

    m s'' = K (l - s) + c (l' - s') - k s - F0 - m g with l = e (1 - cos(w t)), from s = `start`
    at rest: mean, harmonic and decaying part of a linear oscillator.
    """
    mean = (K * e - preload - mass * g) / (K + spring)
    spun = 1j * speed
    wave = -e * (K + spun * c) / (K + spring + mass * spun**2 + spun * c)
    roots = np.roots([mass, c, K + spring]).astype(complex)
    rest = np.array([start - mean - wave.real, -(spun * wave).real])
    parts = np.linalg.solve(np.vstack([np.ones(2), roots]), rest)
    lift = mean + (wave * np.exp(spun * times)).real
    rate = (spun * wave * np.exp(spun * times)).real
    for root, part in zip(roots, parts, strict=True):
        lift = lift + (part * np.exp(root * times)).real
        rate = rate + (root * part * np.exp(root * times)).real
    return lift, rate


def hopping_follower(times, speed, e, mass, spring, preload, law, start, g=9.81):
    """Return the lift of a flat follower that may leave its eccentric cam, and when it leaves.

    As `flat_follower`, with the IMPACT law; steps end where it touches and leaves.
    """

    def depth(t, s):
        return e * (1.0 - np.cos(speed * t)) - s

    def rhs(t, y):
        rate = e * speed * np.sin(speed * t) - y[1]
        push = impact(depth(t, y[0]), rate, *law)
        return [y[1], (push - spring * y[0] - preload) / mass - g]

    def cross(t, y):
        return depth(t, y[0])

    cross.terminal = True
    lift, leaves = np.full(len(times), np.nan), []
    t, y, end = float(times[0]), [start, 0.0], float(times[-1])
    inside = depth(t, start) > 0.0
    while t < end:
        cross.direction = -1.0 if inside else 1.0
        found = solve_ivp(
            rhs, (t, end), y, method="DOP853", rtol=1e-11, atol=1e-14, events=cross,
            max_step=2e-5 if inside else 1e-3, dense_output=True,
        )  # fmt: skip
        rows = (times >= t) & (times <= found.t[-1])
        lift[rows] = found.sol(times[rows])[0]
        t, y = float(found.t[-1]), list(found.y[:, -1])
        if found.status == 1 and inside:
            leaves.append(t)
        inside = not inside
    return lift, leaves


def four_bar_place(a, bars, base):
    """Return crank pin B and rocker pin C of a four-bar over (0, 0) and (base, 0), crank at `a`.

    Together with what they, coupler and rocker move per crank angle. `a` may be complex.
    """
    r, length, rocker = bars
    B, dB = r * np.array([np.cos(a), np.sin(a)]), r * np.array([-np.sin(a), np.cos(a)])
    d = np.array([base, 0.0]) - B
    square = d @ d
    along = (length**2 - rocker**2 + square) / (2 * square)
    p = along * d + np.sqrt(length**2 / square - along**2) * np.array([-d[1], d[0]])
    s = B + p - np.array([base, 0.0])
    # dB + u perp(p) = w perp(s)
    cross = p[0] * s[1] - p[1] * s[0]
    u, w = -(dB @ s) / cross, -(dB @ p) / cross
    return B, B + p, dB, w * np.array([-s[1], s[0]]), u, w


def four_bar_on_stop(
    times, start, bars, masses, base, spring, wall, law, g=9.81, friction=(0.0, 1.0), **method
):
    """Return crank angle and place of the rocker's ball of a four-bar that falls on a stop.

    Bars are slender and uniform. `spring` is (anchor, stiffness, free length, damping) to the
    rocker pin; `wall` is (place, outward normal, radius of the ball at the pin), `friction` mu and
    the transition velocity. It acts half the depth above the deepest point of the ball, which turns
    with the rocker. The kinetic energy is M(a) a'^2 / 2; M' by the complex step.
    """
    anchor, stiffness, free, damping = spring
    foot, normal, radius = wall
    across = np.array([-normal[1], normal[0]])
    settings = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-13} | method

    def terms(a):
        B, C, dB, dC, u, w = four_bar_place(a, bars, base)
        M = masses[0] * bars[0] ** 2 / 3 + masses[2] * bars[2] ** 2 * w**2 / 3
        middle = (dB + dC) / 2
        M = M + masses[1] * (middle @ middle + bars[1] ** 2 * u**2 / 12)
        height = masses[0] * B[1] / 2 + masses[1] * (B[1] + C[1]) / 2 + masses[2] * C[1] / 2
        return M, g * height, C, dC, w

    def gap(t, y):
        return normal @ (four_bar_place(y[0], bars, base)[1] - foot) - radius

    def rhs(t, y):
        h = 1e-30
        M, V, C, dC, w = terms(y[0] + 1j * h)
        C, dC, v = C.real, dC.real, dC.real * y[1]
        away = C - anchor
        x = np.sqrt(away @ away)
        pull = -(stiffness * (x - free) + damping * (away @ v) / x) * (away @ dC) / x
        press, mu, u = impact(-gap(t, y), -(normal @ v), *law), *friction
        # along the wall: the ball's centre, and its turning at the point of contact
        slide = across @ dC - (radius + gap(t, y) / 2) * w.real
        u = np.clip(slide * y[1] / u, -1.0, 1.0)
        push = press * (normal @ dC) - mu * press * u * (3.0 - u * u) / 2.0 * slide
        return [y[1], (pull + push - V.imag / h - 0.5 * M.imag / h * y[1] ** 2) / M.real]

    gap.terminal = True
    angles, t, y = np.full(len(times), np.nan), float(times[0]), [start, 0.0]
    free_now = gap(t, y) > 0.0
    while t < times[-1]:
        gap.direction = -1.0 if free_now else 1.0
        found = solve_ivp(
            rhs, (t, times[-1]), y, events=gap, max_step=5e-3 if free_now else 1e-4,
            dense_output=True, **settings,
        )  # fmt: skip
        rows = (times >= t) & (times <= found.t[-1])
        if rows.any():
            angles[rows] = found.sol(times[rows])[0]
        t, y = float(found.t[-1]), list(found.y[:, -1])
        free_now = not free_now
    return angles, np.array([four_bar_place(a, bars, base)[1] for a in angles])


class Governor:
    """The stiff flyball governor: angle b of the rods below the horizontal, and slider height s.

    I(b) turns with the angular momentum h about the shaft: 2 J b'' = I'(b) (h / I)^2 / 2 + ...
    """

    def __init__(self, speed=2 * np.pi, g=9.81, stiffness=8e5, damping=4e4):
        self.stiffness, self.damping = stiffness, damping
        self.hinge, self.g = 0.05, g
        self.rod, self.ball, self.slider = 0.3, 5.0, 3.0
        self.J = self.ball + self.rod * (1 / 3 + 1e-4 / 12)
        self.h = self.inertia(np.pi / 6) * speed

    def inertia(self, b):
        """Return the inertia about the shaft: shaft, slider, rods with their width, balls."""
        cos, a, width = np.cos(b), self.hinge, 1e-4 / 12
        rod = a**2 + a * cos + cos**2 / 3 + width * (1 + np.sin(b) ** 2)
        return 5e-6 + 0.005 + 2 * (self.rod * rod + self.ball * (a + cos) ** 2)

    def coupler(self, b, s):
        """Return the coupler from the slider to the middle of a rod: radial and upward part."""
        return 0.5 * np.cos(b), 1.0 - 0.5 * np.sin(b) - s

    def rhs(self, t, y):
        """Return the rates of (b, s, b', s', turn of the shaft)."""
        b, s, db, ds, _ = y
        x, z = self.coupler(b, s)
        dx, dz = -0.5 * np.sin(b) * db, -0.5 * np.cos(b) * db - ds
        length = np.hypot(x, z)
        rate = (x * dx + z * dz) / length
        tension = self.stiffness * (length - 0.5) + self.damping * rate
        step = 1e-30
        slope = self.inertia(b + 1j * step).imag / step
        spin = self.h / self.inertia(b)
        weight = self.g * (2 * self.ball + self.rod) * np.cos(b)
        pull = 2 * tension * (0.5 * x * np.sin(b) + 0.5 * z * np.cos(b)) / length
        ddb = (slope * spin**2 / 2 + weight + pull) / (2 * self.J)
        dds = 2 * tension * z / (length * self.slider) - self.g
        return [db, ds, ddb, dds, spin]

    def solve(self, times):
        """Return b, s, b', s' and the shaft's angle at the times."""
        return solve_ivp(
            self.rhs, (times[0], times[-1]), [np.pi / 6, 0.5, 0, 0, 0], method="DOP853",
            t_eval=times, rtol=1e-10, atol=1e-12,
        ).y  # fmt: skip

    def energy(self, y):
        """Return kinetic and potential energy, the springs' included."""
        b, s, db, ds, _ = y
        x, z = self.coupler(b, s)
        kinetic = self.h**2 / self.inertia(b) / 2 + self.J * db**2 + self.slider * ds**2 / 2
        height = (
            self.slider * s
            + (2 * self.ball + 2 * self.rod)
            - (2 * self.ball + self.rod) * np.sin(b)
        )
        return kinetic, self.g * height + self.stiffness * (np.hypot(x, z) - 0.5) ** 2


def roller_follower(
    times, speed, e, R, roller, mass, inertia, spring, preload, law, friction, z0, g=9.81
):
    """Return height and spin (about y) of a follower's roller above an eccentric cam, and forces.

    The cam's centre is at -e (sin, cos)(w t) in x and z. `law` is that of IMPACT, `friction` the
    coefficient and the slip at which it is full; forces act half the depth below both surfaces.
    Forces are the normal force, along x and along z.
    """
    mu, full = friction

    def push(t, z, dz, spin):
        x0, z0 = -e * math.sin(speed * t), -e * math.cos(speed * t)
        far = math.hypot(x0, z - z0)
        n = (-x0 / far, (z - z0) / far)
        depth = R + roller - far
        cam = (x0 + (R - depth / 2) * n[0], z0 + (R - depth / 2) * n[1])
        arm = roller - depth / 2
        # a turn w about y moves (x, z) by w (z, -x)
        vx = -spin * arm * n[1] - speed * cam[1]
        vz = dz + spin * arm * n[0] + speed * cam[0]
        normal = impact(depth, -(n[0] * vx + n[1] * vz), *law)
        slip = n[1] * vx - n[0] * vz
        u = min(abs(slip) / full, 1.0)
        drag = -math.copysign(mu * normal * u * (3.0 - u * u) / 2, slip)
        return normal, normal * n[0] + drag * n[1], normal * n[1] - drag * n[0], -arm * drag

    low = R + roller - e

    def rhs(t, y):
        _, _, up, torque = push(t, *y)
        return [y[1], (up - preload - spring * (y[0] - low)) / mass - g, torque / inertia]

    z, dz, spin = solve_ivp(
        rhs, (times[0], times[-1]), [z0, 0.0, 0.0], method="DOP853", t_eval=times,
        rtol=1e-10, atol=1e-13, max_step=2e-5,
    ).y  # fmt: skip
    forces = np.array([push(*row)[:3] for row in zip(times, z, dz, spin, strict=True)])
    return z, spin, forces


def geneva_wheel(times, speed, a, pin, walls, inertia, damper, law):
    """Return the angle of a Geneva wheel at (0, 0), its crank at (a, 0) turning from -90 deg.

    `pin` is (crank radius, pin radius); `walls` is (near end, far end, half width of the slot,
    thickness). The pin is a disc that meets eight rectangles without friction; two contact points
    (the ends of the line) share one law each, so the push is twice `law`.
    """
    radius, disc = pin
    near, far, half, thick = walls
    angles = np.repeat(np.pi / 4 + np.arange(4) * np.pi / 2, 2)
    sides = np.tile([1.0, -1.0], 4)
    reach = np.array([(far - near) / 2, thick / 2])
    middle = np.column_stack([np.full(8, (near + far) / 2), sides * (half + thick / 2)])

    def rhs(t, y):
        turn = speed * t - np.pi / 2
        p = np.array([a - radius * np.cos(turn), radius * np.sin(turn)])
        v = radius * speed * np.array([np.sin(turn), np.cos(turn)])
        v = v - y[1] * np.array([-p[1], p[0]])  # as the wheel sees it
        cos, sin = np.cos(y[0] + angles), np.sin(y[0] + angles)
        local = np.column_stack([cos * p[0] + sin * p[1], cos * p[1] - sin * p[0]]) - middle
        away = local - np.clip(local, -reach, reach)
        gap = np.hypot(away[:, 0], away[:, 1])
        torque = -damper * y[1]
        for k in np.flatnonzero(gap < disc):
            n = away[k] / gap[k]
            n = np.array([cos[k] * n[0] - sin[k] * n[1], sin[k] * n[0] + cos[k] * n[1]])
            push = 2 * impact(disc - gap[k], -(n @ v), *law)
            torque -= push * (p[0] * n[1] - p[1] * n[0])
        return [y[1], torque / inertia]

    return solve_ivp(
        rhs, (times[0], times[-1]), [0.0, 0.0], method="DOP853", t_eval=times,
        rtol=1e-9, atol=1e-11, max_step=5e-4,
    ).y[0]  # fmt: skip


def poisson(depth, rate, penalty, restitution, blend):
    """Return the POISSON force at a depth and its rate."""
    s = min(max((rate + blend) / (2 * blend), 0.0), 1.0)
    soft = restitution**2 * penalty
    return (soft + (penalty - soft) * s * s * (3.0 - 2.0 * s)) * depth


def loose_slider(times, law, mu, slip, g=9.81):
    """Return the angles of crank, rod and slider (Flores, Leine, Glocker 2010), and the slider.

    Start: stretched, turning at 150, -75, 0 rad/s. `law` of a corner in the plane: penalty,
    restitution, blend; friction `mu` is full from slip speed `slip` on, acting half the depth
    above the corner.
    """
    l1, l2, a, b, room = 0.153, 0.306, 0.05, 0.025, 0.026
    m1, m2, m3, J1, J2, J3 = 0.038, 0.038, 0.076, 7.4e-5, 5.9e-4, 2.7e-6
    M11 = J1 + (m1 / 4 + m2 + m3) * l1**2
    M22 = J2 + (m2 / 4 + m3) * l2**2
    both = (m2 / 2 + m3) * l1 * l2

    def rhs(t, y):
        p, q, r, dp, dq, dr = y
        cp, sp, cq, sq = math.cos(p), math.sin(p), math.cos(q), math.sin(q)
        cr, sr = math.cos(r), math.sin(r)
        height = l1 * sp + l2 * sq
        vx, vy = -l1 * sp * dp - l2 * sq * dq, l1 * cp * dp + l2 * cq * dq
        fx = fy = torque = 0.0
        for along, up in ((a, b), (a, -b), (-a, b), (-a, -b)):
            x, z = cr * along - sr * up, sr * along + cr * up
            for side in (1.0, -1.0):  # upper and lower guide
                depth = side * (height + z) - room
                if depth <= 0.0:
                    continue
                push = poisson(depth, side * (vy + x * dr), *law)
                arm = z - side * depth / 2
                v = vx - arm * dr
                u = min(abs(v) / slip, 1.0)
                drag = -math.copysign(mu * push * u * (3.0 - u * u) / 2, v)
                fx, fy = fx + drag, fy - side * push
                torque += -x * side * push - arm * drag
        # Lagrange's equations; the slider's own angle is coupled by forces alone
        c, s = both * math.cos(p - q), both * math.sin(p - q)
        Q1 = l1 * (-sp * fx + cp * fy) - s * dq**2 - g * (m1 / 2 + m2 + m3) * l1 * cp
        Q2 = l2 * (-sq * fx + cq * fy) + s * dp**2 - g * (m2 / 2 + m3) * l2 * cq
        det = M11 * M22 - c * c
        return [dp, dq, dr, (M22 * Q1 - c * Q2) / det, (M11 * Q2 - c * Q1) / det, torque / J3]

    p, q, r = solve_ivp(
        rhs, (times[0], times[-1]), [0, 0, 0, 150.0, -75.0, 0], method="DOP853", t_eval=times,
        rtol=1e-10, atol=1e-11, max_step=2e-5,
    ).y[:3]  # fmt: skip
    place = np.column_stack([l1 * np.cos(p) + l2 * np.cos(q), l1 * np.sin(p) + l2 * np.sin(q)])
    return p, q, r, place


def jenkins_block(
    t: np.ndarray, k: float, friction: float, dx: float, x: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return x and f of a unit mass on a spring k and on dry friction with a spring before it.

    It starts at rest at `x`, f = 0. Each stretch is harmonic; the next begins where abs(f) comes to
    the friction, or where x' comes to 0 in slip.
    """
    give = friction / dx
    found_x, found_f = np.empty_like(t), np.empty_like(t)
    start, v, slider, slides = 0.0, 0.0, x, 0.0
    while True:
        stiff = k if slides else k + give
        middle = -slides * friction / k if slides else give * slider / stiff
        w = np.sqrt(stiff)
        reach, phase = np.hypot(x - middle, v / w), np.arctan2(-v / w, x - middle)
        if slides:
            # x' = -reach w sin(w s + phase) has the sign of `slides` up to the next multiple of pi
            length = (np.pi * (1.0 if slides < 0.0 else 0.0) - phase) / w
            while length <= 1e-12:
                length += 2.0 * np.pi / w
        else:
            # f = give (x - slider) = +-friction, on the way out
            ends = [(slider + side * dx - middle) / reach for side in (-1.0, 1.0)]
            angles = [side * np.arccos(c) for c in ends if abs(c) <= 1.0 for side in (-1.0, 1.0)]
            waits = [((a - phase) % (2.0 * np.pi)) / w for a in angles]
            # it begins at one of them where slip has just ended
            length = min((s for s in waits if s > 1e-7 / w), default=np.inf)
            length = min((s for s in waits if s > 1e-12 and s < length), default=length)
        here = (t >= start) & (t <= start + length)
        found_x[here] = middle + reach * np.cos(w * (t[here] - start) + phase)
        found_f[here] = slides * friction if slides else give * (found_x[here] - slider)
        start += length
        if start > t[-1]:
            return found_x, found_f
        x, v = middle + reach * np.cos(w * length + phase), -reach * w * np.sin(w * length + phase)
        if slides:
            slider, slides, v = x - slides * dx, 0.0, 0.0
        else:
            slides = np.sign(v)


# IMPACT at 1 m/s, m = 1 kg, k = 1e5, e = 1.5, dmax = 1e-3, no gravity (rtol 1e-12)
RESTITUTION = [(50.0, 0.4813434809, 0.0357468168, 0.0080820827),
               (200.0, 0.1078059064, 0.0551703767, 0.0043920515)]  # fmt: skip


def rotation_matrices(q):
    w, x, y, z = q.T
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    ).transpose(2, 0, 1)

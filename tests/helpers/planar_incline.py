"""A body on an incline, as a deck and as an independent planar integration: scipy, no mbsim.

The body presses by IMPACT with exponent 1 on the points where it meets the plane, and friction is
rigid: where the body moves in the plane of the fall line all points that press stick or slip
together. They begin to slip where what holds them passes mu times what they press with, and stick
again where the slip has come back to 0 and is held there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import root

G = 9.81
# along the fall line, off the plane, tilt forwards about the cg, and their rates
X, Z, TILT, VX, VZ, SPIN = range(6)
#: More changes between stick and slip than this are a fault of the integration.
MOST_CHANGES = 400
#: Slips shorter than a step are not seen: it pitches with a period of 3 ms.
MOST_STEP = 1e-4


@dataclass(frozen=True)
class Incline:
    """A box of 0.3 x 0.3 x 0.1 m or a standing cylinder as wide, 2 kg, on an incline.

    `turned` is the box's angle to the fall line. The fall line has the angle `down` in the deck.
    """

    angle: float
    margin: float
    shape: str = "box"
    turned: float = 0.0
    down: float = 0.0
    damping: float = 2e3
    mass: float = 2.0
    inertia: float = 0.02
    height: float = 0.05
    half: float = 0.15
    k: float = 1e6
    dmax: float = 1e-5
    points: list = field(init=False)

    def __post_init__(self):
        """Find where the points are along the fall line, tilted forwards and backwards."""
        if self.shape == "box":
            corners = [(x, y) for x in (self.half, -self.half) for y in (self.half, -self.half)]
            c, s = math.cos(self.turned), math.sin(self.turned)
            along = [c * x - s * y for x, y in corners]
            both = [along, along]
        else:
            # the lowest point of the rim, and those at 120 degrees to both sides
            along = [self.half, -0.5 * self.half, -0.5 * self.half]
            both = [along, [-x for x in along]]
        object.__setattr__(self, "points", both)

    @property
    def mu(self):
        """Return the coefficient of friction, that of a block just held times 1 + margin."""
        return math.tan(self.angle) * (1.0 + self.margin)

    @property
    def pull(self):
        """Return gravity along the incline [m/s2]."""
        return G * math.sin(self.angle)

    @property
    def press(self):
        """Return gravity onto the incline [m/s2]."""
        return G * math.cos(self.angle)

    def flat(self):
        """Return place and rates of the body put down flat, as deep as its weight presses it."""
        depth = self.mass * self.press / (self.k * len(self.points[0]))
        return np.array([0.0, self.height - depth, 0.0, 0.0, 0.0, 0.0])

    def balanced(self):
        """Return place and rates of the body where nothing moves it while friction holds."""
        unit = self.flat()[Z] - self.height

        def left(v):
            u = np.array([0.0, self.height + unit * v[0], unit * v[1] / self.half, 0.0, 0.0, 0.0])
            force, moment, lever, _ = self.loads(u)
            weight = self.mass * self.press
            return [
                force / weight - 1.0,
                (moment - lever * self.mass * self.pull) / (weight * self.half),
            ]

        found = root(left, [1.0, 0.0], tol=1e-12).x
        if max(map(abs, left(found))) > 1e-9:
            raise ValueError("it is nowhere in balance: it topples")
        x = unit * found
        return np.array([0.0, self.height + x[0], x[1] / self.half, 0.0, 0.0, 0.0])

    def loads(self, u):
        """Return the force off the plane, its moment, the lever of friction and its rate."""
        cos, sin = math.cos(u[TILT]), math.sin(u[TILT])
        total = moment = level = change = 0.0
        for a in self.points[0 if u[TILT] >= 0.0 else 1]:
            x = a * cos - self.height * sin
            depth = a * sin + self.height * cos - u[Z]
            if depth <= 0.0:
                continue
            rate, q = x * u[SPIN] - u[VZ], min(1.0, depth / self.dmax)
            force = self.k * depth + self.damping * q * q * (3.0 - 2.0 * q) * rate
            if force > 0.0:
                total += force
                moment -= x * force
                # a contact point lies in the middle of its depth; friction is shared as forces are
                level -= 0.5 * depth * force
                change -= 0.5 * rate * force
        if total == 0.0:
            return 0.0, 0.0, -u[Z], -u[VZ]
        return total, moment, level / total - u[Z], change / total - u[VZ]

    def friction(self, u):
        """Return what has to hold so that there is no slip, and what it holds at most [N]."""
        force, moment, lever, change = self.loads(u)
        free = self.pull + lever * moment / self.inertia + change * u[SPIN]
        return -free / (1.0 / self.mass + lever**2 / self.inertia), self.mu * force

    def slip(self, u):
        """Return the velocity of the points that rub [m/s]."""
        return u[VX] + self.loads(u)[2] * u[SPIN]

    def moves(self, u, mode):
        """Return the rates of u where it sticks (mode 0) or slips forwards (1) or back (-1)."""
        force, moment, lever, _ = self.loads(u)
        held, most = self.friction(u)
        held = held if mode == 0 else -mode * most
        v = -lever * u[SPIN] if mode == 0 else u[VX]
        return [
            v,
            u[VZ],
            u[SPIN],
            self.pull + held / self.mass,
            force / self.mass - self.press,
            (moment + lever * held) / self.inertia,
        ]

    def mode_at_rest(self, u):
        """Return what it does from a point without slip on."""
        held, most = self.friction(u)
        return 0 if abs(held) <= most else (-1 if held > 0.0 else 1)

    def displacement(self, u):
        """Return by how much the middle of the lower face has moved along the fall line [m]."""
        return float(u[X] - self.height * math.sin(u[TILT]))

    def integrate(self, start, end, rtol=1e-9):
        """Return the last point and [(time, what it does from there on)]."""
        t, u, changes = 0.0, np.array(start, dtype=float), []
        mode = self.mode_at_rest(u)
        atol = np.array([1e-13, 1e-14, 1e-13, 1e-11, 1e-11, 1e-10])
        changes.append((t, mode))
        while t < end:

            def over(t, u, mode=mode):
                if mode == 0:
                    held, most = self.friction(u)
                    return most - abs(held)
                return mode * self.slip(u)

            over.terminal, over.direction = True, -1
            found = solve_ivp(
                lambda t, u, mode=mode: self.moves(u, mode),
                (t, end),
                u,
                method="DOP853",
                rtol=rtol,
                atol=atol,
                events=over,
                max_step=MOST_STEP if t < 0.3 else 1e-3,
            )
            t, u = float(found.t[-1]), found.y[:, -1].copy()
            if found.status != 1:
                break
            if mode == 0:
                held, _ = self.friction(u)
                mode = -1 if held > 0.0 else 1
            else:
                mode = self.mode_at_rest(u)
            u[VX] -= self.slip(u)
            changes.append((t, mode))
            if len(changes) > MOST_CHANGES:
                raise ArithmeticError("it changes between stick and slip for ever")
        return u, changes

    def deck(self, start, scale=1.0):
        """Return model statements; `scale` is 1 for metres, 1000 for millimetres."""
        pull, unit = self.pull * scale, "METER" if scale == 1.0 else "MILLIMETER"
        gx, gy = pull * math.cos(self.down), pull * math.sin(self.down)
        turn = self.inertia * scale**2
        about = self.down + 0.5 * math.pi
        side, width = 2.0 * self.height * scale, 2.0 * self.half * scale
        if self.shape == "box":
            solid = f"""type="BoxDefinedFromCenter" center_marker_id="20"
  length_x="{width!r}" length_y="{width!r}" length_z="{side!r}\""""
        else:
            solid = (
                f'type="Cylinder" center_marker_id="21" radius="{0.5 * width!r}" length="{side!r}"'
            )
        # a cylinder is given by the middle of its base
        low = [-self.height * math.sin(start[TILT]) * scale * math.cos(self.down)]
        low.append(-self.height * math.sin(start[TILT]) * scale * math.sin(self.down))
        low.append((float(start[Z]) - self.height * math.cos(start[TILT])) * scale)
        at = " ".join(f'pos_{axis}="{x!r}"' for axis, x in zip("xyz", low, strict=True))
        turns = f'psi="{about!r}" theta="{float(start[TILT])!r}" '
        turns += f'phi="{self.turned - 0.5 * math.pi!r}"'
        friction = self.mu
        return f"""
<Param_Unit force_unit="NEWTON" mass_unit="KILOGRAM" length_unit="{unit}" time_unit="SECOND"/>
<Body_Rigid id="1" isground="TRUE"/><Reference_Marker id="10" body_id="1"/>
<Post_Graphic id="100" type="Plane" rm_id="10"/>
<Force_Gravity grav_x="{gx!r}" grav_y="{gy!r}" grav_z="{-self.press * scale!r}"/>
<Body_Rigid id="2" cg_id="20" mass="{self.mass!r}" inertia_xx="{turn!r}" inertia_yy="{turn!r}"
  inertia_zz="{1.5 * turn!r}"/>
<Reference_Marker id="20" body_id="2" pos_z="{float(start[Z]) * scale!r}" {turns}/>
<Reference_Marker id="21" body_id="2" {at} {turns}/>
<Post_Graphic id="200" {solid}/>
<Force_Contact id="301" num_i_graphics="1" i_graphics_id="200" num_j_graphics="1"
  j_graphics_id="100" cnf_type="IMPACT" stiffness="{self.k / scale!r}" exponent="1.0"
  damping="{self.damping / scale!r}" dmax="{self.dmax * scale!r}" cff_type="STICTION"
  mu_static="{friction!r}" mu_dynamic="{friction!r}" tangential_stiffness="INFINITE"/>"""

    def rubbed(self, results, scale=1.0):
        """Return where the middle of the lower face is at each output of a run: (n, 2), along
        and across the fall line [m]."""
        w, x, y, v = results["bodies/2/quaternion"].T
        up = np.array([2.0 * (x * v + w * y), 2.0 * (y * v - w * x)]).T
        place = results["bodies/2/position"][:, :2] / scale - self.height * up
        along = np.array([math.cos(self.down), math.sin(self.down)])
        moved = place - (place[0] if results["time"][0] == 0.0 else 0.0)
        return np.array([moved @ along, moved @ [-along[1], along[0]]]).T

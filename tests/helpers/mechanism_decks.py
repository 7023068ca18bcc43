"""One description of a mechanism, two readings: a deck for mbsim and `mechanics.Mechanism`."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

import mbsim
from helpers import mechanics as mech
from helpers.decks import write_deck

#: Name of a joint's type to what it does, as geometry.
ROWS = {
    "FIXED": mech.fixed,
    "REVOLUTE": mech.revolute,
    "TRANSLATIONAL": mech.translational,
    "CYLINDRICAL": mech.cylindrical,
    "SPHERICAL": mech.spherical,
    "UNIVERSAL": mech.universal,
    "HOOKE": mech.hooke,
    "PLANAR": mech.planar,
    "INLINE": mech.inline,
    "INPLANE": mech.inplane,
    "ORIENTATION": mech.orientation,
    "PARALLEL_AXES": mech.parallel,
    "PERPENDICULAR": mech.perpendicular,
    "CONSTANT_VELOCITY": mech.constant_velocity,
}


@dataclass
class Joint:
    """A Constraint_Joint between markers at one place; `R_i`, `R_j` are their axes at the start."""

    type: str
    i: int  # bodies, 0 is ground
    j: int
    p: object = (0.0, 0.0, 0.0)
    R_i: object = field(default_factory=lambda: np.eye(3))
    R_j: object = None  # as R_i
    p_j: object = None  # as p
    attributes: str = ""
    rows: object = None  # the type's, from ROWS

    def markers(self):
        """Return markers I and J."""
        R_j = self.R_i if self.R_j is None else self.R_j
        p_j = self.p if self.p_j is None else self.p_j
        return mech.Marker(self.i, self.p, self.R_i), mech.Marker(self.j, p_j, R_j)


@dataclass
class Scene:
    """Bodies, joints, further statements, gravity. Deck ids: see `xml`."""

    bodies: list
    joints: list
    g: tuple = (0.0, 0.0, -9.81)
    extra: str = ""

    def mechanism(self, forces=(), more=()):
        """Return the independent model; `more` are constraints beside the joints."""
        held = [mech.Constraint(*j.markers(), j.rows or ROWS[j.type]) for j in self.joints]
        return mech.Mechanism(self.bodies, [*held, *more], forces, self.g)

    def consistent(self, more=()):
        """Return the scene with the start velocities that its joints allow, nearest to those given.

        The least change of momentum: v - M^-1 G' (G M^-1 G')^-1 G v.
        """
        mechanism = self.mechanism(more=more)
        parts = mechanism.parts(mechanism.y0())
        jets, _ = mechanism.rows(parts, 0.0)
        G = np.array([jet.a[6:-1] for jet in jets])
        rates = np.array([jet.d for jet in jets])
        bodies = []
        change = np.linalg.pinv(G) @ rates
        for k, body in enumerate(self.bodies):
            dv, dw = change[6 * k : 6 * k + 3], change[6 * k + 3 : 6 * k + 6]
            bodies.append(replace(body, v=np.array(body.v) - dv, w=np.array(body.w) - dw))
        return replace(self, bodies=bodies)

    def xml(self):
        """Return the statements: body k has id k + 1 and cg marker 100 + k; ground's is 100.

        Joint n (from 0) has id n + 1, marker I 1000 + 2 n and marker J 1001 + 2 n.
        """
        out = ['<Body_Rigid id="1" isground="TRUE"/>', marker(100, 0, (0, 0, 0), np.eye(3))]
        for k, body in enumerate(self.bodies, 1):
            J = np.array(body.inertia, float)
            J = np.diag(J) if J.ndim == 1 else J
            names = {"xx": J[0, 0], "yy": J[1, 1], "zz": J[2, 2]}
            names |= {"xy": -J[0, 1], "yz": -J[1, 2], "xz": -J[0, 2]}
            inertia = " ".join(f'inertia_{a}="{float(v)!r}"' for a, v in names.items())
            start = " ".join(
                f'{kind}_ic_{axis}="{float(value)!r}" {kind}_ic_{axis}_flag="TRUE"'
                for kind, vector in (("v", body.v), ("w", body.w))
                for axis, value in zip("xyz", vector, strict=True)
            )
            out.append(
                f'<Body_Rigid id="{k + 1}" cg_id="{100 + k}" mass="{body.mass!r}" '
                f"{inertia} {start}/>"
            )
            out.append(marker(100 + k, k, body.p, body.R))
        for n, joint in enumerate(self.joints):
            I, J = joint.markers()
            out.append(marker(1000 + 2 * n, I.body, I.p, I.R))
            out.append(marker(1001 + 2 * n, J.body, J.p, J.R))
            out.append(
                f'<Constraint_Joint id="{n + 1}" type="{joint.type}" i_marker_id="{1000 + 2 * n}" '
                f'j_marker_id="{1001 + 2 * n}" {joint.attributes}/>'
            )
        gravity = " ".join(
            f'grav_{axis}="{float(value)!r}"' for axis, value in zip("xyz", self.g, strict=True)
        )
        return "\n".join([*out, self.extra, f"<Force_Gravity {gravity}/>"])

    def run(self, folder, end_time, print_interval, tol=1e-9, **settings):
        """Run the deck and return its results."""
        path = write_deck(folder, self.xml(), end_time, print_interval)
        return mbsim.simulate(mbsim.read_model(path), tol=tol, **settings)


def marker(id, body, p, R):
    """Return a Reference_Marker, given in the global frame at the start."""
    cosines = " ".join(
        f'a{row}{column}="{float(R[row][column])!r}"' for row in range(3) for column in range(3)
    )
    place = " ".join(f'pos_{axis}="{float(v)!r}"' for axis, v in zip("xyz", p, strict=True))
    return f'<Reference_Marker id="{id}" body_id="{body + 1}" {place} {cosines}/>'


def states(results, bodies):
    """Return the rows of a run in the order of `mechanics`: position, quaternion, velocities."""
    names = ("position", "quaternion", "velocity", "angular_velocity")
    return np.hstack(
        [results[f"bodies/{k + 1}/{name}"] for k in range(1, bodies + 1) for name in names]
    )


def residual(results, mechanism):
    """Return the largest violation of the constraints over all rows, and that of their rates."""
    worst = np.zeros(2)
    rows = states(results, len(mechanism.bodies))
    for t, y in zip(results["time"], rows, strict=True):
        jets, _ = mechanism.rows(mechanism.parts(y), t)
        for jet in jets:
            worst = np.fmax(worst, [abs(jet.v), abs(jet.d)])
    return worst


def apart(p, q):
    """Return the largest angle [rad] between two rows of attitudes, up to sign."""
    near = np.minimum(np.linalg.norm(p - q, axis=1), np.linalg.norm(p + q, axis=1))
    return (4.0 * np.arcsin(0.5 * near)).max()

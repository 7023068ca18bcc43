"""Random decks, each from its seed: shapes, laws, joints, forces, units; and how a run is judged.

A deck is made in N, m, kg, s and written in one of three systems of units. `judge` runs it with an
explicit and an implicit method at two tolerances. It is an offence if a run ends in an exception
that is none of ours, gives up, takes too long, finds itself wrong (`results.audit`), or if runs
differ by more than AGREE tol times what the motion makes of a small change of its start: twice
the distance of a run in which each body's start was changed by PUSH its own way, over PUSH. So a
motion that is chaotic is not held against the methods.

A balance that does not close is no offence where it is the force law's and not the methods', and
the run says so: a pair of shapes that meet in patches has no potential (`LAWLESS`; README, "What
an elastic hit of two boxes or convex meshes keeps"), the motions of all runs agree, and so do
their balances, to the same part of the largest energy. It is listed as `told`.
"""

from __future__ import annotations

import re
import signal
import time
import traceback
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

import mbsim
from mbsim.errors import Interrupted, MbsimError, ModelError
from mbsim.run import loop

#: Names of units of force, mass, length, time, and what they are in N, kg, m, s.
UNITS = (
    ("NEWTON KILOGRAM METER SECOND", (1.0, 1.0, 1.0, 1.0)),
    ("NEWTON TONNE MILLIMETER SECOND", (1.0, 1e3, 1e-3, 1.0)),
    ("KNEWTON KILOGRAM MILLIMETER MILLISECOND", (1e3, 1.0, 1e-3, 1e-3)),
)
SHAPES = ("Sphere", "BoxDefinedFromCenter", "Cylinder", "Frustum", "Ellipsoid", "TriaMesh")
JOINTS = (
    *("REVOLUTE", "SPHERICAL", "TRANSLATIONAL", "CYLINDRICAL", "UNIVERSAL", "INPLANE", "INLINE"),
    *("PLANAR", "CONSTANT_VELOCITY", "FIXED"),
)
#: Shapes two of which may change the energy by themselves, as points of a patch come and go.
LAWLESS = ("BoxDefinedFromCenter", "Cylinder", "Frustum", "TriaMesh")
SIZE = 0.1  # a usual half size of a body [m]
TOLS = (1e-7, 1e-9)
AGREE, PUSH = 1000.0, 1e-8


class Writer:
    """Statements of a deck in one system of units; numbers are given in N, kg, m, s."""

    def __init__(self, units):
        self.names, (self.F, self.M, self.L, self.T) = units
        self.lines = []

    def length(self, x):
        """Return a length in the deck's units."""
        return float(x) / self.L

    def add(self, statement, text="", **attributes):
        """Add a statement."""
        given = " ".join(f'{name}="{value}"' for name, value in attributes.items())
        end = f">{text}</{statement}>" if text else "/>"
        self.lines.append(f"<{statement} {given}{end}")

    def marker(self, id, body, p, R=None):
        """Add a marker at p whose axes are the columns of R."""
        facts = dict(zip(("pos_x", "pos_y", "pos_z"), map(self.length, p), strict=True))
        if R is not None:
            facts |= {f"a{i}{j}": float(R[i, j]) for j in range(3) for i in range(3)}
        self.add("Reference_Marker", id=id, body_id=body, **facts)

    def body(self, id, mass, inertia, v=(0, 0, 0), w=(0, 0, 0), at_rest=False):
        """Add a body whose cg marker is 10 id."""
        facts = {"mass": mass / self.M}
        square = self.M * self.L**2
        facts |= {f"inertia_{a}{a}": J / square for a, J in zip("xyz", inertia, strict=True)}
        if not at_rest:
            for kind, vector, unit in (("v", v, self.L / self.T), ("w", w, 1.0 / self.T)):
                for axis, value in zip("xyz", vector, strict=True):
                    facts[f"{kind}_ic_{axis}"] = float(value) / unit
                    facts[f"{kind}_ic_{axis}_flag"] = "TRUE"
        self.add("Body_Rigid", id=id, cg_id=10 * id, **facts)

    def text(self, end, rows):
        """Return the deck."""
        force, mass, length, time = self.names.split()
        head = (
            f'<Param_Unit force_unit="{force}" mass_unit="{mass}" length_unit="{length}" '
            f'time_unit="{time}"/>'
        )
        end /= self.T
        return (
            "<MotionSolve><Model>\n"
            + "\n".join([head, *self.lines])
            + f'\n</Model><Command>\n<Simulate analysis_type="Transient" end_time="{end}" '
            f'print_interval="{end / rows}"/>\n</Command></MotionSolve>\n'
        )


def rotation(rng):
    """Return a random rotation matrix."""
    Q, R = np.linalg.qr(rng.normal(size=(3, 3)))
    Q *= np.sign(np.diag(R))
    return Q if np.linalg.det(Q) > 0.0 else Q[:, ::-1].copy()


def hull(rng):
    """Return nodes and faces of a convex polyhedron about the origin."""
    from scipy.spatial import ConvexHull

    points = rng.normal(size=(int(rng.integers(8, 16)), 3))
    points *= SIZE / np.linalg.norm(points, axis=1)[:, None]
    made = ConvexHull(points)
    faces = []
    for face, plane in zip(made.simplices, made.equations, strict=True):
        a, b, c = points[face]
        outward = np.cross(b - a, c - a) @ plane[:3] > 0.0
        faces.append(face if outward else face[::-1])
    return points, np.array(faces)


def shape(rng, writer, kind, id, marker):
    """Add a graphic of a kind on a marker at the middle of its body."""
    a = SIZE * rng.uniform(0.5, 1.0, 3)
    facts = {"id": id, "type": kind, "center_marker_id": marker}
    long = writer.length
    if kind == "Sphere":
        facts["radius"] = long(a[0])
    elif kind == "BoxDefinedFromCenter":
        facts |= {f"length_{n}": long(2.0 * x) for n, x in zip("xyz", a, strict=True)}
    elif kind == "Cylinder":
        facts |= {"radius": long(a[0]), "length": long(a[1])}
    elif kind == "Frustum":
        top = a[2] * rng.choice([0.0, 0.6])
        facts |= {"bottom_radius": long(a[0]), "top_radius": long(top), "length": long(a[1])}
    elif kind == "Ellipsoid":
        facts |= {f"{n}_scale": long(x) for n, x in zip("xyz", a, strict=True)}
    else:
        points, faces = hull(rng)
        nodes = " ".join(repr(long(x)) for x in points.ravel())
        text = f"<Nodes>{nodes}</Nodes><Faces>{' '.join(map(str, faces.ravel()))}</Faces>"
        writer.add("Post_Graphic", text, id=id, type=kind, rm_id=marker)
        return
    writer.add("Post_Graphic", **facts)


def contact(rng, writer, i, j, id=1):
    """Add a contact of random laws between two graphics."""
    F, L, T = writer.F, writer.L, writer.T
    stiffness = 10.0 ** rng.uniform(4.0, 7.0)
    law = str(rng.choice(["IMPACT", "POISSON", "HUNT_CROSSLEY"]))
    if law == "IMPACT":
        exponent = float(rng.choice([1.0, 1.5, 2.2]))
        # the same force at a depth of 1 mm as of a linear spring
        k = stiffness * 1e-3 ** (1.0 - exponent)
        normal = {"stiffness": k * L**exponent / F, "exponent": exponent}
        normal |= {"damping": float(rng.choice([0.0, 50.0])) * L / (F * T), "dmax": 1e-4 / L}
    elif law == "POISSON":
        normal = {"penalty": stiffness * L / F, "restitution_coef": float(rng.choice([0.3, 0.8]))}
        normal["normal_trans_vel"] = 1e-2 * T / L
    else:
        k = stiffness * 1e-3**-0.5
        normal = {"stiffness": k * L**1.5 / F, "exponent": 1.5, "restitution_coef": 0.7}
        normal["ref_velocity"] = 1.0 * T / L
    mu = float(rng.uniform(0.1, 0.7))
    vs = 10.0 ** rng.uniform(-2.5, -1.0) * T / L
    name = str(
        rng.choice(["COULOMB_OFF", "COULOMB_ON", "TANH", "STRIBECK", "LUGRE", "DAHL", "STICTION"])
    )
    friction = {"cff_type": name}
    if name != "COULOMB_OFF":
        friction["mu_dynamic"] = mu
    if name in ("COULOMB_ON", "STRIBECK", "LUGRE", "STICTION"):
        friction["mu_static"] = mu * float(rng.uniform(1.0, 1.3))
    if name in ("COULOMB_ON", "STRIBECK"):
        friction["stiction_trans_vel"] = vs
    if name in ("COULOMB_ON", "TANH"):
        friction["friction_trans_vel"] = 1.5 * vs
    if name in ("STRIBECK", "LUGRE"):
        friction["stribeck_vel"] = 3.0 * vs
    if name in ("LUGRE", "DAHL"):
        friction["bristle_stiffness"] = 1e4 * L / F
    if name == "LUGRE":
        friction["bristle_damping"] = 10.0 * L / (F * T)
    writer.add(
        "Force_Contact",
        id=id,
        num_i_graphics=1,
        i_graphics_id=i,
        num_j_graphics=1,
        j_graphics_id=j,
        cnf_type=law,
        **normal,
        **friction,
    )
    return law, name


def inertia_of(rng, mass):
    """Return three moments of inertia that a solid can have."""
    return 0.4 * mass * SIZE**2 * rng.uniform(0.8, 1.0, 3)


def gravity(writer, g=(0.0, 0.0, -9.81)):
    """Add gravity [m/s^2]."""
    unit = writer.L / writer.T**2
    writer.add(
        "Force_Gravity", **{f"grav_{n}": x / unit for n, x in zip("xyz", g, strict=True) if x}
    )


def collision(rng, writer):
    """Two bodies of random shapes that fly at each other."""
    kinds = [str(rng.choice(SHAPES)) for _ in range(2)]
    for k, (kind, side) in enumerate(zip(kinds, (-1.0, 1.0), strict=True)):
        id, mass = 2 + k, float(rng.uniform(0.3, 3.0))
        p = np.array([side * 2.2 * SIZE, *rng.normal(scale=0.1 * SIZE, size=2)])
        R = rotation(rng)
        writer.marker(10 * id, id, p, R)
        v = (-side * rng.uniform(0.3, 2.0), *rng.normal(scale=0.3, size=2))
        writer.body(id, mass, inertia_of(rng, mass), v, rng.normal(scale=5.0, size=3))
        shape(rng, writer, kind, 200 + k, 10 * id)
    laws = contact(rng, writer, 200, 201)
    return f"{kinds[0]} {kinds[1]} {laws[0]} {laws[1]}", 0.4


def drop(rng, writer):
    """A body of a random shape falls onto a plane."""
    kind, mass = str(rng.choice(SHAPES)), float(rng.uniform(0.3, 3.0))
    writer.marker(100, 1, (0, 0, 0))
    writer.add("Post_Graphic", id=100, type="Plane", rm_id=100)
    writer.marker(20, 2, (0.0, 0.0, 2.5 * SIZE + rng.uniform(0.0, 0.1)), rotation(rng))
    v = (*rng.normal(scale=0.5, size=2), -rng.uniform(0.0, 1.0))
    writer.body(2, mass, inertia_of(rng, mass), v, rng.normal(scale=3.0, size=3))
    shape(rng, writer, kind, 200, 20)
    gravity(writer)
    laws = contact(rng, writer, 200, 100)
    return f"{kind} Plane {laws[0]} {laws[1]}", 0.5


def tree(rng, writer):
    """A tree of bodies on joints with a spring or a bushing; the last may touch a plane."""
    F, L, T = writer.F, writer.L, writer.T
    count, said, tip = int(rng.integers(1, 5)), [], np.array([0.0, 0.0, 1.0])
    tips = {1: tip}
    for k in range(count):
        id, mass = 2 + k, float(rng.uniform(0.5, 3.0))
        parent = int(rng.choice(list(tips)))
        way = rng.normal(size=3)
        way *= 0.3 / np.linalg.norm(way)
        start = tips[parent]
        writer.marker(10 * id, id, start + 0.5 * way, rotation(rng))
        R = rotation(rng)
        kind = str(rng.choice(JOINTS))
        if kind == "UNIVERSAL":
            J = R[:, [2, 0, 1]]
            writer.marker(10 * id + 2, parent, start, J)
        else:
            writer.marker(10 * id + 2, parent, start, R)
        writer.marker(10 * id + 1, id, start, R)
        writer.marker(10 * id + 3, id, start + way)
        writer.body(id, mass, inertia_of(rng, mass), at_rest=True)
        writer.add(
            "Constraint_Joint",
            id=1 + k,
            type=kind,
            i_marker_id=10 * id + 1,
            j_marker_id=10 * id + 2,
        )
        tips[id] = start + way
        said.append(kind)
    gravity(writer, rng.normal(scale=5.0, size=3))
    last = 10 * (1 + count) + 3
    writer.marker(900, 1, tips[1 + count] + rng.normal(scale=0.3, size=3))
    if rng.uniform() < 0.5:
        writer.add(
            "Force_SpringDamper",
            id=1,
            type="TRANSLATIONAL",
            i_marker_id=last,
            j_marker_id=900,
            stiffness=10.0 ** rng.uniform(1.0, 4.0) * L / F,
            damping=float(rng.choice([0.0, 1.0])) * L / (F * T),
            length=writer.length(0.3),
        )
        said.append("spring")
    else:
        k, c = 10.0 ** rng.uniform(1.0, 3.0), 0.5
        facts = {f"k{n}": k * rng.uniform(0.5, 2.0) * L / F for n in "xyz"}
        facts |= {f"c{n}": c * L / (F * T) for n in "xyz"}
        facts |= {f"kt{n}": rng.uniform(0.1, 1.0) / (F * L) for n in "xyz"}
        writer.add("Force_Bushing", id=1, i_marker_id=last, j_marker_id=900, **facts)
        said.append("bushing")
    if rng.uniform() < 0.4:
        writer.marker(100, 1, tips[1 + count] - np.array([0.0, 0.0, 1.2 * SIZE]))
        writer.add("Post_Graphic", id=100, type="Plane", rm_id=100)
        writer.add(
            "Post_Graphic",
            id=200,
            type="Sphere",
            center_marker_id=last,
            radius=writer.length(SIZE),
        )
        said += contact(rng, writer, 200, 100)
    return " ".join(said), 0.6


def deck_of(seed):
    """Return the text of the deck of a seed, what it holds, and its explicit, implicit method."""
    rng = np.random.default_rng(seed)
    units = UNITS[int(rng.integers(len(UNITS)))]
    writer = Writer(units)
    writer.add("Body_Rigid", id=1, isground="TRUE")
    writer.marker(10, 1, (0, 0, 0))
    kind = (collision, drop, tree)[int(rng.integers(3))]
    said, end = kind(rng, writer)
    methods = str(rng.choice(["DOPRI5", "DOP853", "AUTO"])), str(rng.choice(["RADAU5", "GALPHA"]))
    unit = units[0].split()[2].lower()
    return writer.text(end, 20), f"{kind.__name__} {unit} {said}", methods


@dataclass
class Found:
    """What a run came to."""

    status: str  # "ok", or why it ended
    poses: np.ndarray | None = None
    warnings: tuple[str, ...] = ()
    steps: int = 0
    seconds: float = 0.0
    balance: float = 0.0  # how far the energy balance is off at most, over the largest energy


@contextmanager
def stopping(seconds):
    """Let a run be interrupted after so many seconds of its own, however busy the machine is."""
    plain, running = loop.Runner.__init__, []

    def begin(runner, *given, **named):
        plain(runner, *given, **named)
        running.append(runner)

    def stop(*_):
        for runner in running:
            runner.interrupted = True

    loop.Runner.__init__ = begin
    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds, 1.0)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)
        loop.Runner.__init__ = plain


def poses_of(results, scale):
    """Return positions over a length and quaternions of all bodies, (rows, bodies, 7)."""
    ids = results.ids("bodies")
    return np.stack(
        [
            np.hstack([results[f"bodies/{b}/position"] / scale, results[f"bodies/{b}/quaternion"]])
            for b in ids
        ],
        axis=1,
    )


def distance(one, other):
    """Return how far two runs are apart at most: of positions over the length, and of turns."""
    if one is None or other is None or one.shape != other.shape:
        return np.inf
    moved = np.linalg.norm(one[..., :3] - other[..., :3], axis=-1)
    p, q = one[..., 3:], other[..., 3:]
    turned = 2.0 * np.minimum(np.linalg.norm(p - q, axis=-1), np.linalg.norm(p + q, axis=-1))
    return float(max(moved.max(), turned.max()))


def run(path, method, tol, scale, overrides=(), seconds=60.0):
    """Run a deck."""
    began = time.process_time()
    try:
        with stopping(seconds):
            model = mbsim.read_model(path, overrides)
            with mbsim.simulate(model, integrator=method, tol=tol) as results:
                audit = results.audit
                warnings = () if audit is None else audit.warnings
                poses, steps = poses_of(results, scale), int(results.stats["steps"])
        found = Found("ok", poses, warnings, steps)
        if audit is not None and audit.of > 0.0:
            found.balance = audit.balance / audit.of
    except Interrupted:
        found = Found(f"longer than {seconds:.0f} s")
    except ModelError as error:
        found = Found(f"refused: {error}")
    except MbsimError as error:
        found = Found(f"gave up: {error}")
    except Exception:  # none of ours: an offence, which `judge` finds by this word
        found = Found("TRACEBACK " + traceback.format_exc(limit=-2).replace("\n", " "))
    found.seconds = time.process_time() - began
    return found


def judge(seed, folder, tols=TOLS, seconds=60.0):
    """Run the deck of a seed; return what it holds, offences, and how far runs are apart.

    Offences are pairs of a kind (traceback, slow, gave up, audit, disagree) and a text; what is
    `told` is none.
    """
    text, said, (explicit, implicit) = deck_of(seed)
    path = folder / f"random_{seed}.xml"
    path.write_text(text, encoding="utf-8")
    scale = SIZE / next(u[1][2] for u in UNITS if f" {u[0].split()[2].lower()} " in f" {said} ")
    offences, runs = [], {}
    for method in (explicit, implicit):
        for tol in tols:
            # an order of 2 takes a hundred times the steps of another
            asked = 100.0 * tol if method == "GALPHA" else tol
            found = run(path, method, asked, scale, seconds=seconds)
            who = f"{method} {asked:g}"
            runs[method, tol] = found, asked
            if found.status.startswith("refused"):
                return said, [("refused", f"{who}: {found.status}")], {}
            if found.status != "ok":
                kind = {"T": "traceback", "l": "slow", "g": "gave up"}[found.status[0]]
                offences.append((kind, f"{who}: {found.status}"))
            offences += [("audit", f"{who}: {warning}") for warning in found.warnings]
    best, tol = runs[explicit, tols[-1]]
    pushed = run(path, explicit, tol, scale, pushes(text, scale), seconds)
    growth = max(1.0, 2.0 * distance(best.poses, pushed.poses) / PUSH)
    apart = {}
    for (method, given), (found, asked) in runs.items():
        if found.status != "ok" or best.status != "ok" or found is best:
            continue
        far = distance(found.poses, best.poses)
        loose = max(asked, tol)
        apart[f"{method} {given:g}"] = far, far / (AGREE * loose * growth)
        if far > AGREE * loose * growth:
            offences.append(
                (
                    "disagree",
                    f"{method} {asked:g} and {explicit} {tol:g} are {far:.3g} apart, "
                    f"{growth:.3g} growth",
                )
            )
    if all(kind == "audit" for kind, _ in offences) and is_lawless(said):
        alike = [
            abs(found.balance - best.balance) <= AGREE * max(asked, tol) * growth
            for found, asked in runs.values()
        ]
        if all(alike) and all("energy balance" in text for _, text in offences):
            offences = [("told", text) for _, text in offences]
    return said, offences, apart


def is_lawless(said):
    """Return whether a deck is of two bodies of shapes whose pair has no potential."""
    kind, _, *words = said.split()
    return kind == "collision" and all(word in LAWLESS for word in words[:2])


def pushes(text, scale):
    """Return overrides that change place and inertia of each body by PUSH of their size."""
    found = []
    for body in re.findall(r'<Body_Rigid id="(\d+)" cg_id', text):
        # its own way, the first two against each other: what moves alike feels nothing of it
        k = int(body)
        ways = (k & 1, (k >> 1 ^ k) & 1, (k >> 2 ^ k) & 1)
        for axis, way in zip("xyz", ways, strict=True):
            at = re.search(rf'<Reference_Marker id="{body}0" [^>]*pos_{axis}="([^"]*)"', text)
            value = float(at[1]) + (2.0 * way - 1.0) * PUSH * scale
            found.append(f"Reference_Marker[{body}0].pos_{axis}={value!r}")
        for axis, sign in (("xx", 1.0), ("yy", -1.0)):
            at = re.search(rf'<Body_Rigid id="{body}" [^>]*inertia_{axis}="([^"]*)"', text)
            value = float(at[1]) * (1.0 + sign * PUSH)
            found.append(f"Body_Rigid[{body}].inertia_{axis}={value!r}")
    return tuple(found)

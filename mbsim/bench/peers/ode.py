"""The Open Dynamics Engine, a library of the system, through a driver in C that is built here.

It knows rigid contact with a friction pyramid along the direction of slip, semi-implicit Euler
steps, and two solvers: sweeps of projected Gauss-Seidel (QuickStep) and Dantzig's (Step). A law of
a contact's own it has not. Needs a C compiler and the library with its header (Debian: libode-dev).
"""

from __future__ import annotations

import functools
import math
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from mbsim.bench import drum as drums
from mbsim.bench import parameters as p
from mbsim.bench.daily import CHAIN, TRAIN
from mbsim.bench.outcome import Outcome
from mbsim.bench.peers import common
from mbsim.bench.simbenchmark import BOUNCING, ELASTIC, PILE, Balls

NAME = "ode"
#: As ode_driver.c numbers shapes; numbers of a shape, and of a row of a body.
PLANE, SPHERE, BOX, CYLINDER, MESH = range(5)
SHAPE, ROW = 7, 13
STILL = (0.0, 0.0, 0.0)
UPRIGHT = (1.0, 0.0, 0.0, 0.0)
#: Points of one pair: a box has at most 8; of meshes ODE is asked for all that it can hold.
OF_SOLIDS, OF_MESHES = 8, 64
#: Fixed steps with no error control are tried so [s].
TRIED = (1e-2, 5e-3, 2e-3, 1e-3)


class Body(NamedTuple):
    """A body at t = 0: principal axes along its own, quaternion w first, global velocities.

    One of mass 0 keeps its velocities.
    """

    mass: float
    inertia: Sequence[float]
    position: Sequence[float]
    quaternion: Sequence[float] = UPRIGHT
    velocity: Sequence[float] = STILL
    spin: Sequence[float] = STILL


class Shape(NamedTuple):
    """A shape of body number `body`, -1 for a fixed one; see ode_driver.c for its numbers."""

    body: int
    kind: int
    numbers: Sequence[float]


class Hinge(NamedTuple):
    """A hinge of bodies `a` and `b`; a point and the direction of its axis in the world, t = 0."""

    a: int
    b: int
    point: Sequence[float]
    axis: Sequence[float]


class Case(NamedTuple):
    """A scene; `sweeps` of QuickStep, 0 for the direct solver."""

    dt: float  # s
    end_time: float  # s
    sweeps: int
    bodies: Sequence[Body]
    shapes: Sequence[Shape]
    mu: float
    meshes: Sequence[tuple[np.ndarray, np.ndarray]] = ()
    gravity: Sequence[float] = (0.0, 0.0, -p.GRAVITY)
    sample: float = p.SAMPLE
    contacts: int = OF_SOLIDS  # most of a pair
    hinges: Sequence[Hinge] = ()
    restitution: float = 0.0
    touch: bool = True  # shapes of two bodies do; else each touches fixed ones alone


Cases = Iterator[tuple[str, Callable[[], Case]]]
Make = Callable[[float, int], Case]


def is_installed() -> bool:
    """Return whether there are a C compiler and the library with its header."""
    compiler = shutil.which("cc")
    if compiler is None:
        return False
    asked = [compiler, "-E", "-x", "c", "-include", "ode/ode.h", "/dev/null"]
    return subprocess.run(asked, capture_output=True, check=False).returncode == 0


@functools.cache
def _driver() -> tuple[Path, tempfile.TemporaryDirectory[str]]:
    """Build the driver; it is there as long as this process is."""
    folder = tempfile.TemporaryDirectory(prefix="mbsim_ode_")
    path = Path(folder.name) / "ode_driver"
    source = Path(__file__).with_name("ode_driver.c")
    built = subprocess.run(
        ["cc", "-O2", str(source), "-o", str(path), "-lode", "-lm"],
        capture_output=True,
        text=True,
        check=False,
    )
    if built.returncode != 0:
        raise RuntimeError(f"the driver of ODE cannot be built: {built.stderr.strip()}")
    return path, folder


@functools.cache
def version() -> str:
    """The version of the library, of which the header says nothing; as pkg-config knows it."""
    asked = subprocess.run(
        ["pkg-config", "--modversion", "ode"], capture_output=True, text=True, check=False
    )
    return asked.stdout.strip() or "unknown"


def settings(scene: str) -> list[str]:
    """Settings of one scene, coarse to fine; empty if the engine cannot express it."""
    return list(_cases(scene))


def run(scene: str, setting: str, repeats: int) -> Outcome:
    """Run `scene` under `setting`; the wall time is the median of `repeats` loops."""
    case = _cases(scene)[setting]()
    steps = common.plan(case.dt, case.end_time, case.sample)
    text = " ".join(repr(float(x)) for x in _numbers(case, steps))

    def once() -> tuple[float, np.ndarray]:
        done = subprocess.run([str(_driver()[0])], input=text.encode(), capture_output=True)
        if done.returncode != 0:
            raise RuntimeError(f"ODE ended with {done.returncode}: {done.stderr.decode().strip()}")
        found = np.frombuffer(done.stdout)
        return float(found[0]), found

    wall, found = common.measure(once, repeats)
    rows = found[3:].reshape(int(found[2]), len(case.bodies), ROW)
    stored = common.Rows(
        steps.times[: len(rows)], rows[..., :3], rows[..., 3:7], rows[..., 7:10], rows[..., 10:]
    )
    extra = {
        "steps": float((len(rows) - 1) * steps.steps_per_row),
        "peak_penetration": float(found[1]),
    }
    note = "rigid, pyramid of friction"
    if scene.startswith("S7_"):
        extra |= common.s7_measures(stored.position)
    return common.outcome(wall, stored, note, case.end_time, extra)


def _numbers(case: Case, steps: common.Plan) -> Iterator[float]:
    """The scene as ode_driver.c reads it."""
    yield from (case.dt, steps.steps_per_row, steps.rows, case.sweeps)
    # as ODE's manual recommends: 0.2 of an error is taken back in a step; contacts hardly give
    yield from (0.2, 1e-9, *case.gravity, case.mu, case.restitution, 0.0)
    yield from (case.contacts, common.WALL_CAP)
    yield float(case.touch)
    yield len(case.bodies)
    for body in case.bodies:
        yield from (body.mass, *body.inertia, *body.position)
        yield from (*body.quaternion, *body.velocity, *body.spin)
    yield len(case.meshes)
    for vertices, faces in case.meshes:
        yield from (len(vertices), len(faces), *vertices.ravel().tolist(), *faces.ravel().tolist())
    yield len(case.shapes)
    for shape in case.shapes:
        yield from (shape.body, shape.kind, *shape.numbers)
        yield from [0.0] * (SHAPE - len(shape.numbers))
    yield len(case.hinges)
    for hinge in case.hinges:
        yield from (hinge.a, hinge.b, *hinge.point, *hinge.axis)


# ---------------------------------------------------------------------------------------------
# Scenes

FLOOR = Shape(-1, PLANE, (0.0, 0.0, 1.0, 0.0))


def _cases(scene: str) -> dict[str, Callable[[], Case]]:
    """Settings of a scene and what builds each."""
    scenes: dict[str, Callable[[], Cases]] = {
        "S3": _rolling,
        "S4stick": lambda: _box(p.S4.mu_stick, p.S4.stick_end_time),
        "S4slip": lambda: _box(p.S4.mu_slip, p.S4.slip_end_time),
        "S6": _stack,
        "S7_125": lambda: _grains(125, (2e-3, 1e-3)),
        "S7_1000": lambda: _grains(1000, (5e-3, 2e-3, 1e-3)),
        "S7_8000": lambda: _grains(8000, (2e-3,)),
        "S9plane": lambda: _torus(upright=False),
        "S9torus": lambda: _torus(upright=True),
        "S10b": _heavy,
        "bin_50": lambda: _bin(50, (5e-3, 2e-3, 1e-3)),
        "bin_200": lambda: _bin(200, (5e-3, 2e-3, 1e-3)),
        "chain_box": _draped,
        "cylinder_train": _train,
        "sb_bouncing": lambda: _balls(BOUNCING),
        "sb_666": lambda: _balls(PILE),
        "sb_666_elastic": lambda: _balls(ELASTIC),
        "drum_300": lambda: _drum(300, (5e-3, 2e-3, 1e-3, 5e-4)),
        "drum_3000": lambda: _drum(3000, (2e-3, 1e-3, 5e-4)),
    }
    return dict(scenes[scene]()) if scene in scenes else {}


def _each(
    dts: Sequence[float], solvers: Sequence[int], make: Callable[[float, int], Case]
) -> Cases:
    """Yield a case for each solver and step."""
    for sweeps in solvers:
        for dt in dts:
            name = f"QuickStep {sweeps}" if sweeps else "Step"
            yield f"{name} dt={dt:g}", functools.partial(make, dt, sweeps)


def _rolling() -> Cases:
    inertia = 0.4 * p.S3.mass * p.S3.radius**2
    at = (0.0, 0.0, p.S3.radius)
    ball = Body(p.S3.mass, [inertia] * 3, at, velocity=(p.S3.speed, 0.0, 0.0))
    shapes = (FLOOR, Shape(0, SPHERE, (p.S3.radius,)))
    yield from _each(
        (*TRIED, 1e-4, 2e-5),
        (0, 20),
        lambda dt, sweeps: Case(dt, p.S3.end_time, sweeps, [ball], shapes, p.S3.mu),
    )


def _cuboid(mass: float, edges: Sequence[float], **at: Sequence[float]) -> Body:
    a, b, c = edges
    inertia = [mass * (u * u + v * v) / 12.0 for u, v in ((b, c), (a, c), (a, b))]
    return Body(mass, inertia, **at)


def _box(mu: float, end_time: float) -> Cases:
    box = _cuboid(p.S4.mass, p.S4.size, position=(0.0, 0.0, 0.5 * p.S4.size[2]))
    tilt = (p.GRAVITY * math.sin(p.S4.tilt), 0.0, -p.GRAVITY * math.cos(p.S4.tilt))
    shapes = (FLOOR, Shape(0, BOX, p.S4.size))
    yield from _each(
        TRIED,
        (0, 20),
        lambda dt, sweeps: Case(dt, end_time, sweeps, [box], shapes, mu, gravity=tilt),
    )


def _stack() -> Cases:
    edges = (p.S6.edge,) * 3
    boxes = [_cuboid(p.S6.mass, edges, position=at) for at in p.s6_positions()]
    shapes = (FLOOR, *(Shape(k, BOX, edges) for k in range(p.S6.count)))
    yield from _each(
        TRIED,
        (0, 20, 50),
        lambda dt, sweeps: Case(dt, p.S6.end_time, sweeps, boxes, shapes, p.S6.mu),
    )


def _heavy() -> Cases:
    edges = (p.S10B.edge,) * 3
    boxes = [
        _cuboid(mass, edges, position=(0.0, 0.0, (k + 0.5) * p.S10B.edge))
        for k, mass in enumerate((p.S10B.mass, p.S10B.above))
    ]
    shapes = (FLOOR, *(Shape(k, BOX, edges) for k in range(2)))
    yield from _each(
        TRIED,
        (0, 20, 50),
        lambda dt, sweeps: Case(dt, p.S10B.end_time, sweeps, boxes, shapes, p.S10B.mu),
    )


def _walls(half: float) -> tuple[Shape, ...]:
    """Floor and four walls at `half` from the axis."""
    sides = ((1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0))
    return (FLOOR, *(Shape(-1, PLANE, (x, y, 0.0, -half)) for x, y in sides))


def _grains(count: int, dts: Sequence[float]) -> Cases:
    inertia = 0.4 * p.S7.mass * p.S7.radius**2
    balls = [Body(p.S7.mass, [inertia] * 3, at) for at in p.s7_positions(count).tolist()]
    shapes = (
        *_walls(p.s7_half_width(count)),
        *(Shape(k, SPHERE, (p.S7.radius,)) for k in range(count)),
    )
    sample = p.s7_sample(count)
    yield from _each(
        dts,
        (20,),
        lambda dt, sweeps: Case(dt, p.S7.end_time, sweeps, balls, shapes, p.S7.mu, sample=sample),
    )


def _balls(balls: Balls) -> Cases:
    inertia = 0.4 * balls.mass * balls.radius**2
    bodies = [Body(balls.mass, [inertia] * 3, at) for at in balls.centres().tolist()]
    shapes = (FLOOR, *(Shape(k, SPHERE, (balls.radius,)) for k in range(len(bodies))))
    yield from _each(
        (1e-2, 5e-3, 1e-3),
        (20,),
        lambda dt, sweeps: Case(
            dt, balls.end_time, sweeps, bodies, shapes, 0.0, restitution=balls.restitution
        ),
    )


def _bin(count: int, dts: Sequence[float]) -> Cases:
    edges = (p.BIN.edge,) * 3
    places, turns = p.bin_start(count)
    boxes = [
        _cuboid(p.BIN.mass, edges, position=at, quaternion=q)
        for at, q in zip(places.tolist(), turns.tolist(), strict=True)
    ]
    shapes = (*_walls(p.BIN.half_width), *(Shape(k, BOX, edges) for k in range(count)))
    yield from _each(
        dts,
        (20,),
        lambda dt, sweeps: Case(
            dt, p.BIN.end_time, sweeps, boxes, shapes, p.BIN.mu, sample=p.BIN.sample
        ),
    )


def _draped() -> Cases:
    c = CHAIN
    places = c.centres().tolist()
    links = [Body(c.mass, c.inertia, (x, 0.0, c.height)) for x in places]
    ball = (c.ball, c.length / 2.0, 0.0, 0.0)
    shapes = (
        Shape(-1, PLANE, (0.0, 0.0, 1.0, c.floor)),
        Shape(-1, BOX, (*c.box, 0.0, 0.0, -c.box[2] / 2.0)),
        *(Shape(k, SPHERE, ball) for k in range(c.count)),
    )
    hinges = [
        Hinge(k, k - 1, (places[k] - c.length / 2.0, 0.0, c.height), (0.0, 1.0, 0.0))
        for k in range(1, c.count)
    ]

    def case(dt: float, sweeps: int) -> Case:
        return Case(dt, c.end_time, sweeps, links, shapes, c.mu, hinges=hinges, touch=False)

    yield from _each((1e-2, 5e-3, 2e-3), (0,), case)
    yield from _each((*TRIED, 5e-4, 2e-4), (20, 50), case)


def _train() -> Cases:
    t = TRAIN
    along, across = t.inertia
    lying = (math.sqrt(0.5), -math.sqrt(0.5), 0.0, 0.0)  # a cylinder's own axis is z
    cylinders = [
        Body(t.mass, (across, across, along), (x, 0.0, t.radius), lying)
        for x in t.centres().tolist()
    ]
    shapes = (
        FLOOR,
        Shape(-1, PLANE, (-1.0, 0.0, 0.0, -t.wall)),
        *(Shape(k, CYLINDER, (t.radius, t.length)) for k in range(t.count)),
    )
    yield from _each(
        (*TRIED, 5e-4),
        (0, 20, 50),
        lambda dt, sweeps: Case(dt, t.end_time, sweeps, cylinders, shapes, t.mu, gravity=t.pull()),
    )


def _drum(count: int, dts: Sequence[float]) -> Cases:
    drum = drums.DRUMS[count]
    turning = Body(0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), spin=(0.0, drum.spin, 0.0))
    inertia = 0.4 * drum.mass * drum.radius**2
    spheres = [Body(drum.mass, [inertia] * 3, at) for at in drums.places(drum).tolist()]
    out, long = drum.apothem + drums.THICK / 2.0, drum.half_length
    faces = [
        # angles are about -y in a frame where z is up
        Shape(0, BOX, (drums.THICK, 2.0 * long, drum.face, *(out * normal), -angle))
        for angle, normal in zip(drums.angles().tolist(), drums.outward(), strict=True)
    ]
    wide, end = 2.0 * drum.apothem, long + drums.THICK / 2.0
    ends = [Shape(0, BOX, (wide, drums.THICK, wide, 0.0, side * end, 0.0)) for side in (-1.0, 1.0)]
    balls = [Shape(1 + k, SPHERE, (drum.radius,)) for k in range(count)]
    yield from _each(
        dts,
        (20,),
        lambda dt, sweeps: Case(
            dt,
            drum.end_time,
            sweeps,
            [turning, *spheres],
            [*faces, *ends, *balls],
            drum.mu,
            sample=drum.sample,
        ),
    )


def _torus(*, upright: bool) -> Cases:
    half = 0.5 * (0.5 * math.pi if upright else p.S9.tilt)
    turn = (math.cos(half), math.sin(half), 0.0, 0.0)
    ring = Body(p.S9.mass, p.torus_inertia(p.S9), (0.0, 0.0, p.S9.height), turn)
    fixed = (Shape(-1, MESH, (0, *p.S9.fixed)),) if upright else ()
    yield from _each(
        TRIED,
        (0, 20),
        lambda dt, sweeps: Case(
            dt,
            p.S9.end_time,
            sweeps,
            [ring],
            (FLOOR, Shape(0, MESH, (0,)), *fixed),
            p.S9.mu,
            meshes=[p.torus_mesh(p.S9)],
            contacts=OF_MESHES,
        ),
    )

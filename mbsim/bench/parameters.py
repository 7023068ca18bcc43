"""The constants of the benchmark scenes and the small reference numbers; all SI, z up.

Source of every number: ``reference/scenes.md`` and the ``params`` of ``data/references.json``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

GRAVITY = 9.81  # m/s^2, along -z unless the scene tilts it
SAMPLE = 0.01  # s, rows are stored at multiples of this


class ImpactLaw(NamedTuple):
    """F = max(0, k d^e + STEP(d, 0, 0, dmax, c) d') for a penetration d > 0."""

    k: float  # N/m^e
    e: float
    c: float  # N s/m
    dmax: float  # m


class LinearLaw(NamedTuple):
    """F = max(0, k d + c d') for a penetration d > 0."""

    k: float  # N/m
    c: float  # N s/m


class HuntCrossleyLaw(NamedTuple):
    """F = k d max(0, 1 + dissipation d') for a penetration d > 0."""

    k: float  # N/m
    dissipation: float  # s/m


class FreeBody(NamedTuple):
    """S1 and S10c: a body free of forces, principal axes along the body's own, q(0) = 1."""

    mass: float  # kg
    inertia: tuple[float, float, float]  # kg m^2
    spin: tuple[float, float, float]  # rad/s, in the body's axes (= global at t = 0)
    end_time: float  # s
    end_quaternion: tuple[float, float, float, float]  # reference attitude, w first
    end_spin: tuple[float, float, float]  # reference, rad/s, body axes


class Drop(NamedTuple):
    """S2 and S10a: a sphere at rest a gap above the plane z = 0."""

    mass: float  # kg
    radius: float  # m
    gap: float  # m
    end_time: float  # s
    first_bounce: float  # s, rows up to here make the error of the first bounce


class RollingSphere(NamedTuple):
    """S3: a solid sphere sliding along x on the plane until it rolls."""

    mass: float  # kg
    radius: float  # m
    mu: float
    speed: float  # m/s
    end_time: float  # s
    law: LinearLaw
    roll_time: float  # s, reference: 2 v0 / (7 mu g)
    roll_speed: float  # m/s, reference: 5/7 v0
    end_x: float  # m, reference


class TiltedBox(NamedTuple):
    """S4: a box on the plane z = 0 under tilted gravity g (sin, 0, -cos)."""

    mass: float  # kg
    size: tuple[float, float, float]  # m, full edges
    tilt: float  # rad
    mu_stick: float
    mu_slip: float
    stick_end_time: float  # s
    slip_end_time: float  # s
    law: LinearLaw  # of each of the four corners
    slip_end_x: float  # m, reference


@dataclass(frozen=True)  # a NamedTuple has a method `count` of its own
class BallRow:
    """S5: the first ball flies at the others, which touch; no gravity, no damping."""

    count: int
    mass: float  # kg
    radius: float  # m
    speed: float  # m/s, of the first ball
    first_gap: float  # m, in front of the first ball
    k: float  # N/m^e, ball on ball
    e: float
    end_time: float  # s
    end_x: tuple[float, ...]  # m, reference for this law
    end_v: tuple[float, ...]  # m/s, reference for this law


class Grains(NamedTuple):
    """S7: N equal spheres fall from a jittered grid into an open box."""

    radius: float  # m
    density: float  # kg/m^3
    mu: float
    pitch: float  # m
    jitter: float  # m
    end_time: float  # s
    law: LinearLaw

    @property
    def mass(self) -> float:
        """Mass of one sphere (kg)."""
        return self.density * 4 / 3 * math.pi * self.radius**3


class Chain(NamedTuple):
    """S8_n: equal slender rods hinged about y in a row, from the origin along x, at rest."""

    length: float  # m, of the whole chain
    mass: float  # kg, of one rod
    end_time: dict[int, float]  # s, for each number of rods


class SliderCrank(NamedTuple):
    """S8b: uniform rods in the plane x-z, the crank about the origin, the slider along x.

    Angles count from x towards z.
    """

    crank_length: float  # m
    crank_mass: float  # kg
    rod_length: float  # m
    rod_mass: float  # kg
    slider_mass: float  # kg
    angle: float  # rad, of the crank at t = 0
    speed: float  # rad/s, of the crank at t = 0
    end_time: float  # s


@dataclass(frozen=True)  # a NamedTuple has a method `count` of its own
class Stack:
    """S6: cubes on each other on the plane z = 0, touching, at rest."""

    count: int
    edge: float  # m
    mass: float  # kg, of one cube
    mu: float
    end_time: float  # s
    law: LinearLaw  # of each corner


class HeavyOnLight(NamedTuple):
    """S10b: a heavy cube on a light one on the plane z = 0, touching, at rest."""

    edge: float  # m
    mass: float  # kg, below
    above: float  # kg
    mu: float
    end_time: float  # s
    law: LinearLaw  # of each corner


class Bin(NamedTuple):
    """Cubes fall from a grid, each turned at random, into an open box."""

    edge: float  # m
    mass: float  # kg, of one cube
    mu: float
    half_width: float  # m, half the inner width of the box
    pitch: float  # m
    floor: float  # m, height of the lowest centres
    end_time: float  # s
    sample: float  # s
    late: float  # s, from here on the depth counts as that of a pile at rest
    law: LinearLaw  # of each corner


class FallingTorus(NamedTuple):
    """S9: a mesh torus falls on the plane z = 0, tilted about x, or upright onto a fixed one."""

    ring: float  # m, radius of the centre circle
    tube: float  # m
    sections: tuple[int, int]  # of the mesh, around the ring and around the tube
    mass: float  # kg
    mu: float
    height: float  # m, of its centre at t = 0
    tilt: float  # rad, of its axis where it falls on the plane
    fixed: tuple[float, float, float]  # m, centre of the fixed torus, whose axis is z
    end_time: float  # s


S1 = FreeBody(
    mass=1.0,
    inertia=(0.010, 0.020, 0.025),
    spin=(0.01, 10.0, 0.02),
    end_time=10.0,
    end_quaternion=(
        -7.081532693947116e-05,
        -0.0438360516206641,
        0.00013368533928130632,
        -0.9990387268228045,
    ),
    end_spin=(-0.0029866949792797704, -10.000006830971534, 0.01808690900998162),
)

S10C = FreeBody(
    mass=1.0,
    inertia=(0.010, 0.020, 0.025),
    spin=(1.0, 1000.0, 1.0),
    end_time=1.0,
    end_quaternion=(
        0.05574650739694432,
        -0.8198895729027286,
        -0.0899873397381129,
        -0.5626505965919535,
    ),
    end_spin=(172.33779595514244, -977.4717520868892, 154.14425948357953),
)

S2 = Drop(mass=1.0, radius=0.1, gap=0.5, end_time=3.0, first_bounce=0.86)
S2A_LAW = ImpactLaw(k=1e8, e=1.5, c=200.0, dmax=1e-4)
S2B_LAW = LinearLaw(k=1e6, c=60.0)
S2C_LAW = HuntCrossleyLaw(k=1e6, dissipation=0.05)

#: S2: time (s), speed in and speed out (m/s) of the first impact under each law (reference).
S2_FIRST_IMPACT = {
    "impact": (0.3192754284070505, 3.132091952673165, 2.6520805198611317),
    "linear": (0.3192754284070505, 3.132091952673165, 2.8542720561550787),
    "linear_noclip": (0.3192754284070505, 3.132091952673165, 2.8491348490201176),
    "hc": (0.3192754284070505, 3.132091952673165, 2.8336454763561956),
    "mujoco": (0.3192754284070505, 3.132091952673165, 2.854828365360823),
}

S10A = Drop(mass=0.1, radius=0.05, gap=0.5, end_time=1.0, first_bounce=0.64)
S10A_LAW = LinearLaw(k=1e9, c=10.0)
#: S10a: restitution of a linear spring and damper, so the rebound is its square times the drop.
S10A_RESTITUTION = 0.9984304365320034

S3 = RollingSphere(
    mass=5.0,
    radius=0.108,
    mu=0.2,
    speed=5.0,
    end_time=2.0,
    law=LinearLaw(k=1e6, c=2e3),
    roll_time=0.7281199941750399,
    roll_speed=3.5714285714285716,
    end_x=7.662942852982171,
)

S4 = TiltedBox(
    mass=1.0,
    size=(0.2, 0.2, 0.1),
    tilt=math.radians(20.0),
    mu_stick=0.5,
    mu_slip=0.2,
    stick_end_time=10.0,
    slip_end_time=2.0,
    law=LinearLaw(k=1e5, c=30.0),
    slip_end_x=3.023081368085715,
)

S5 = BallRow(
    count=5,
    mass=1.0,
    radius=0.1,
    speed=1.0,
    first_gap=0.1,
    k=1e8,
    e=1.5,
    end_time=0.3,
    end_x=(
        -0.013352269032807569,
        0.194823521076034,
        0.3979813105880331,
        0.6257797489121226,
        0.9947676884583373,
    ),
    end_v=(
        -0.07108501708615696,
        -0.030273764096839205,
        -0.014463629032061102,
        0.12704498609327733,
        0.9887774241217804,
    ),
)

S7 = Grains(
    radius=0.02,
    density=2500.0,
    mu=0.3,
    pitch=0.05,
    jitter=0.002,
    end_time=2.0,
    law=LinearLaw(k=1e5, c=20.0),
)

S6 = Stack(count=10, edge=0.2, mass=1.0, mu=0.5, end_time=10.0, law=LinearLaw(k=1e5, c=30.0))
#: S10b: stiff enough that the heavy one's weight sinks into the light one by a hundredth of it.
S10B = HeavyOnLight(
    edge=0.2, mass=1.0, above=1e4, mu=0.5, end_time=5.0, law=LinearLaw(k=1e8, c=3e3)
)

BIN = Bin(
    edge=0.04,
    mass=0.064,
    mu=0.4,
    half_width=0.21,
    pitch=0.08,
    floor=0.06,
    end_time=2.0,
    sample=0.02,
    late=1.5,
    law=LinearLaw(k=1e5, c=10.0),
)

S8 = Chain(length=2.0, mass=1.0, end_time={2: 5.0, 10: 2.0, 40: 2.0})
#: Inertia of a slender rod over m l^2: about its own axis, and across at its middle.
ROD_ALONG, ROD_ACROSS = 1e-3, 1.0 / 12.0

S8B = SliderCrank(
    crank_length=0.15,
    crank_mass=1.0,
    rod_length=0.35,
    rod_mass=0.5,
    slider_mass=0.8,
    angle=math.pi / 4.0,
    speed=10.0,
    end_time=2.0,
)


S9 = FallingTorus(
    ring=0.1,
    tube=0.03,
    sections=(72, 36),
    mass=1.0,
    mu=0.3,
    height=0.23,
    tilt=math.radians(60.0),
    fixed=(0.1, 0.0, 0.03),
    end_time=1.0,
)


def torus_mesh(torus: FallingTorus) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 3) (m) and faces (2n, 3) of a torus about z, its vertices on the surface."""
    around, across = torus.sections
    i, j = (each.ravel() for each in np.indices((around, across)))
    u, v = 2.0 * np.pi * i / around, 2.0 * np.pi * j / across
    reach = torus.ring + torus.tube * np.cos(v)
    vertices = np.column_stack([reach * np.cos(u), reach * np.sin(u), torus.tube * np.sin(v)])
    a, b = across * i + j, across * ((i + 1) % around) + j
    c, d = across * ((i + 1) % around) + (j + 1) % across, across * i + (j + 1) % across
    return vertices, np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])


def torus_inertia(torus: FallingTorus) -> tuple[float, float, float]:
    """Principal inertia of the solid inside the mesh of a torus about z (kg m^2)."""
    from mbsim.model.mass_properties import polyhedron

    solid = polyhedron(*torus_mesh(torus))
    x, y, z = np.diag(solid.inertia / solid.volume * torus.mass).tolist()
    return (x, y, z)


def s5_positions() -> np.ndarray:
    """Centres of the balls of S5 along x at t = 0 (m), shape (5,); ball 2 at 0.2."""
    touching = 2 * S5.radius * np.arange(S5.count, dtype=float)
    touching[0] -= S5.first_gap
    return touching


def s7_side(count: int) -> int:
    """Spheres along one edge of the grid; `count` must be a cube."""
    side: int = round(count ** (1 / 3))
    if side**3 != count:
        raise ValueError(f"count = {count}: must be a cube (1, 8, 27, ...)")
    return side


def s7_half_width(count: int) -> float:
    """Half the inner width of the open box of S7 (m): the walls touch the grid's cells."""
    return s7_side(count) * S7.pitch / 2


def s7_positions(count: int) -> np.ndarray:
    """Centres of the spheres of S7 at t = 0 (m), shape (count, 3), z fastest.

    A cubic grid of cells of one pitch, the lowest cells on the floor z = 0, the box's axis through
    x = y = 0; each centre moved by a uniform jitter drawn by ``RandomState(0)``.
    """
    side = s7_side(count)
    across = (np.arange(side) - (side - 1) / 2) * S7.pitch
    up = (np.arange(side) + 0.5) * S7.pitch
    grid = np.stack(np.meshgrid(across, across, up, indexing="ij"), axis=-1).reshape(-1, 3)
    jitter = np.random.RandomState(0).uniform(-S7.jitter, S7.jitter, grid.shape)
    return grid + jitter


def s7_sample(count: int) -> float:
    """Time between the stored rows of S7 (s): short of 100 MB of rows at any count."""
    return SAMPLE if count <= 1000 else 0.1


def rod_inertia(mass: float, length: float) -> tuple[float, float, float]:
    """Principal inertia of a slender rod along x about its middle (kg m^2)."""
    across = ROD_ACROSS * mass * length**2
    return (ROD_ALONG * mass * length**2, across, across)


def s6_positions() -> list[tuple[float, float, float]]:
    """Centres of the cubes of S6 at t = 0 (m), from below."""
    return [(0.0, 0.0, (k + 0.5) * S6.edge) for k in range(S6.count)]


def bin_start(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Centres (count, 3) (m) and quaternions (count, 4), w first, of the cubes of a bin at t = 0.

    Layers of 5 by 5; attitudes are uniform over all rotations, drawn by ``RandomState(0)``.
    """
    across = (np.arange(5) - 2.0) * BIN.pitch
    up = BIN.floor + BIN.pitch * np.arange(math.ceil(count / 25))
    z, y, x = np.meshgrid(up, across, across, indexing="ij")
    drawn = np.random.RandomState(0).normal(size=(count, 4))
    places = np.column_stack([x.ravel(), y.ravel(), z.ravel()])[:count]
    return places, drawn / np.linalg.norm(drawn, axis=1, keepdims=True)


def axes_of(quaternion: np.ndarray) -> np.ndarray:
    """Rotation matrices (..., 3, 3), body to world, of unit quaternions (..., 4), w first."""
    w, x, y, z = np.moveaxis(np.asarray(quaternion), -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))

"""Drake: joints in minimal coordinates, continuous with Runge-Kutta steps, or discrete.

Only S8_n, S8b, S9 by hydroelastic contact, and `quadruped` by compliant points: its contact laws
are held against the other scenes' nowhere else. A loop can be closed in discrete time only.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from mbsim.bench import linkages
from mbsim.bench import parameters as p
from mbsim.bench.outcome import Outcome
from mbsim.bench.peers import common, drake_quadruped, drake_tori
from mbsim.bench.peers.drake_rows import advanced

NAME = "drake"

#: Steps a hair longer than a share of a row's time: the last one is cut to fit, else a short one
#: that rounding leaves would follow it.
HAIR = 1.0 + 1e-9


class Scheme(NamedTuple):
    """An integrator with fixed steps of `step` (s), or held to `accuracy`; or discrete steps."""

    name: str
    step: float  # s
    accuracy: float = 0.0

    @property
    def label(self) -> str:
        """How the setting is called."""
        if self.accuracy:
            return f"{self.name} accuracy={self.accuracy:g}"
        return f"{self.name} dt={self.step:g}"


class Case(NamedTuple):
    """A scene under one setting."""

    build: Callable[[Any, Any], None]  # fills a plant
    scheme: Scheme
    end_time: float  # s
    position: np.ndarray  # at the start
    velocity: np.ndarray
    rows: Callable[[np.ndarray, np.ndarray, np.ndarray], common.Rows]  # times, positions, rates
    note: str = ""


#: Scenes of S9, and whether the torus falls onto another.
_TORI = {"S9plane": False, "S9torus": True}

Cases = Iterator[tuple[str, Callable[[], Case]]]


@functools.cache
def _engine() -> Any:
    with common.silence():
        import pydrake.all
    return pydrake.all


def version() -> str:
    """The version of the installed package."""
    from importlib.metadata import version as installed

    return installed("drake")


def settings(scene: str) -> list[str]:
    """Settings of one scene, coarse to fine; empty if the scene is not known."""
    if scene == "quadruped":
        return list(drake_quadruped.settings())
    return list(drake_tori.settings() if scene in _TORI else _cases(scene))


def run(scene: str, setting: str, repeats: int) -> Outcome:
    """Run `scene` under `setting`; the wall time is the median of `repeats` loops."""
    if scene in _TORI:
        with common.silence():
            return drake_tori.run(_engine(), _TORI[scene], drake_tori.settings()[setting], repeats)
    if scene == "quadruped":
        with common.silence():
            return drake_quadruped.run(_engine(), *drake_quadruped.settings()[setting], repeats)
    case = _cases(scene)[setting]()
    with common.silence():
        return _run(case, repeats)


def _run(case: Case, repeats: int) -> Outcome:
    drake, scheme = _engine(), case.scheme
    discrete = scheme.name == "discrete"
    plant = drake.MultibodyPlant(scheme.step if discrete else 0.0)
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, -p.GRAVITY])
    if discrete:
        plant.set_discrete_contact_approximation(drake.DiscreteContactApproximation.kSap)
    case.build(drake, plant)
    plant.Finalize()
    count = round(case.end_time / p.SAMPLE)
    times = np.arange(count + 1) * p.SAMPLE

    def once() -> tuple[float, Any]:
        simulator = drake.Simulator(plant)
        context = simulator.get_mutable_context()
        plant.SetPositions(context, case.position)
        plant.SetVelocities(context, case.velocity)
        if not discrete:
            drake.ResetIntegratorFromFlags(simulator, scheme.name, scheme.step * HAIR)
            integrator = simulator.get_mutable_integrator()
            integrator.set_fixed_step_mode(not scheme.accuracy)
            if scheme.accuracy:
                integrator.set_target_accuracy(scheme.accuracy)
        return advanced(simulator, plant, context, times)

    wall, state = common.measure(once, repeats)
    half = len(case.position)
    rows = case.rows(times, state[:, :half], state[:, half:])
    return common.outcome(wall, rows, case.note, case.end_time)


# ---------------------------------------------------------------------------------------------
# Scenes


def _cases(scene: str) -> dict[str, Callable[[], Case]]:
    """Settings of a scene and what builds each."""
    if scene.startswith("S8_"):
        return dict(_chain(int(scene[3:])))
    return dict(_slider_crank()) if scene == "S8b" else {}


def _rod(
    drake: Any, plant: Any, name: str, mass: float, length: float, parent: Any, x: float
) -> Any:
    """A rod hinged at its end about -y, at `x` along its parent's own axis."""
    inertia = drake.UnitInertia(*(value / mass for value in p.rod_inertia(mass, length)))
    middle = np.array([length / 2, 0.0, 0.0])
    moved = inertia.ShiftFromCenterOfMass(middle)
    body = plant.AddRigidBody(name, drake.SpatialInertia(mass, middle, moved))
    place = drake.RigidTransform(np.array([x, 0.0, 0.0]))
    frame = plant.AddFrame(drake.FixedOffsetFrame(f"{name} hinge", parent, place))
    axis = np.array([0.0, -1.0, 0.0])
    plant.AddJoint(drake.RevoluteJoint(f"{name} joint", frame, body.body_frame(), axis))
    return body


def _chain(count: int) -> Cases:
    length = p.S8.length / count

    def build(drake: Any, plant: Any) -> None:
        parent, x = plant.world_frame(), 0.0
        for k in range(count):
            body = _rod(drake, plant, f"rod {k}", p.S8.mass, length, parent, x)
            parent, x = body.body_frame(), length

    def rows(at: np.ndarray, q: np.ndarray, v: np.ndarray) -> common.Rows:
        return common.Rows(at, *linkages.hinged_chain(q, v))

    fixed = (1e-2, 5e-3, 2e-3, 1e-3) if count < 40 else (1e-3, 5e-4)
    accuracies = (1e-4, 1e-6, 1e-8, 1e-10) if count < 40 else (1e-5, 1e-7)
    schemes = [
        Scheme("discrete", 1e-3),
        *(Scheme("runge_kutta5", step) for step in fixed),
        *(Scheme("runge_kutta5", 0.1, accuracy) for accuracy in accuracies),
        *([Scheme("runge_kutta3", 0.1, 1e-5)] if count < 40 else []),
    ]
    still = np.zeros(count)
    for scheme in schemes:
        yield (
            scheme.label,
            functools.partial(Case, build, scheme, p.S8.end_time[count], still, still, rows),
        )


def _slider_crank() -> Cases:
    s, start = p.S8B, linkages.crank_start()

    def build(drake: Any, plant: Any) -> None:
        crank = _rod(drake, plant, "crank", s.crank_mass, s.crank_length, plant.world_frame(), 0.0)
        rod = _rod(
            drake, plant, "rod", s.rod_mass, s.rod_length, crank.body_frame(), s.crank_length
        )
        inertia = drake.SpatialInertia.SolidSphereWithMass(s.slider_mass, 0.05)
        slider = plant.AddRigidBody("slider", inertia)
        plant.AddJoint(
            drake.PrismaticJoint(
                "slide", plant.world_frame(), slider.body_frame(), np.array([1.0, 0.0, 0.0])
            )
        )
        end = np.array([s.rod_length, 0.0, 0.0])
        plant.AddBallConstraint(rod, end, slider, np.zeros(3))

    def rows(at: np.ndarray, q: np.ndarray, v: np.ndarray) -> common.Rows:
        angle, rate = np.cumsum(q[:, :2], axis=1), np.cumsum(v[:, :2], axis=1)
        return common.Rows(at, *linkages.slider_crank(angle, rate, q[:, 2], v[:, 2]))

    position = np.array([start.crank, start.rod - start.crank, start.slider])
    velocity = np.array([start.crank_rate, start.rod_rate - start.crank_rate, start.slider_rate])
    note = "loop closed by a ball constraint, in discrete time only"
    for step in (1e-3, 1e-4):
        scheme = Scheme("discrete", step)
        yield (
            scheme.label,
            functools.partial(Case, build, scheme, s.end_time, position, velocity, rows, note),
        )

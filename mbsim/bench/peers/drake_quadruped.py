"""The scene `quadruped` in Drake: discrete steps, compliant points of our law, drives as gains.

Its contact solvers take a linear spring and damper, which is the law of the scene: the relaxation
time of a pair is c/k. Friction is Coulomb's, regularised by the solver.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mbsim.bench import parameters as p
from mbsim.bench.outcome import Outcome
from mbsim.bench.peers import common
from mbsim.bench.peers.drake_rows import advanced
from mbsim.bench.quadruped import WALKER, Link, foot_of, legs

#: Contact approximations by name, and the steps that each is tried with [s].
_KINDS = {"sap": "kSap", "similar": "kSimilar"}
_STEPS = (5e-3, 2e-3, 1e-3, 5e-4, 2e-4)
_RIGID = 1e12  # N/m, of the floor: the foot's stiffness is the pair's


def settings() -> dict[str, tuple[str, float]]:
    """Approximation and step (s) by label, coarse to fine."""
    return {f"{kind} dt={dt:g}": (kind, dt) for kind in _KINDS for dt in _STEPS}


def run(drake: Any, kind: str, dt: float, repeats: int) -> Outcome:
    """Run the scene; the wall time is the median of `repeats` loops."""
    diagram, plant, trunk = _build(drake, kind, dt)
    count = round(WALKER.end_time / p.SAMPLE)
    times = np.arange(count + 1) * p.SAMPLE

    def once() -> tuple[float, Any]:
        simulator = drake.Simulator(diagram)
        context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
        pose = drake.RigidTransform(np.array([0.0, 0.0, WALKER.height]))
        plant.SetFreeBodyPose(context, trunk, pose)
        return advanced(simulator, plant, context, times)

    wall, state = common.measure(once, repeats)
    one = state[:, None, :]
    rows = common.Rows(times, one[..., 4:7], one[..., :4], one[..., 22:25], one[..., 19:22])
    note = "compliant points, spring and damper of the scene's law"
    return common.outcome(wall, rows, note, WALKER.end_time)


def _build(drake: Any, kind: str, dt: float) -> tuple[Any, Any, Any]:
    """Diagram, plant and trunk."""
    builder = drake.DiagramBuilder()
    plant, _ = drake.AddMultibodyPlantSceneGraph(builder, dt)
    approximation = getattr(drake.DiscreteContactApproximation, _KINDS[kind])
    plant.set_discrete_contact_approximation(approximation)
    plant.set_contact_model(drake.ContactModel.kPoint)
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, -p.GRAVITY])
    plant.RegisterCollisionGeometry(
        plant.world_body(),
        drake.RigidTransform(),
        drake.HalfSpace(),
        "floor",
        _material(drake, _RIGID),
    )
    trunk = plant.AddRigidBody("trunk", _inertia(drake, WALKER.trunk_mass, WALKER.trunk_inertia))
    links = legs()
    bodies: list[Any] = []
    for k, link in enumerate(links):
        parent = trunk if link.parent < 0 else bodies[link.parent]
        at = (0.0, 0.0, WALKER.height) if link.parent < 0 else links[link.parent].hinge
        bodies.append(_link(drake, plant, k, link, parent, at))
    plant.Finalize()
    _drive(drake, builder, plant, links)
    return builder.Build(), plant, trunk


def _material(drake: Any, stiffness: float) -> Any:
    """Material of a side; relaxation times of a pair add up."""
    made = drake.ProximityProperties()
    friction = drake.CoulombFriction(WALKER.mu, WALKER.mu)
    drake.AddContactMaterial(0.0, stiffness, friction, made)
    made.AddProperty("material", "relaxation_time", WALKER.law.c / WALKER.law.k / 2.0)
    return made


def _inertia(drake: Any, mass: float, about: Any, centre: Any = (0.0, 0.0, 0.0)) -> Any:
    """Spatial inertia from the principal one about the centre."""
    return drake.SpatialInertia.MakeFromCentralInertia(
        mass, np.asarray(centre, dtype=float), drake.RotationalInertia(*about)
    )


def _link(drake: Any, plant: Any, k: int, link: Link, parent: Any, at: Any) -> Any:
    """A link, its hinge on the parent, whose origin is `at`, its drive, and a shank's foot."""
    hinge = np.array(link.hinge)
    about = [link.inertia] * 3
    centre = np.array(link.centre) - hinge
    body = plant.AddRigidBody(f"link {k}", _inertia(drake, link.mass, about, centre))
    place = drake.RigidTransform(hinge - np.array(at))
    frame = plant.AddFrame(drake.FixedOffsetFrame(f"hinge {k}", parent.body_frame(), place))
    joint = drake.RevoluteJoint(f"joint {k}", frame, body.body_frame(), np.array(link.axis))
    drive = plant.AddJointActuator(f"drive {k}", plant.AddJoint(joint))
    drive.set_controller_gains(drake.PdControllerGains(p=WALKER.stiffness, d=WALKER.damping))
    if k % 3 == 2:
        foot = drake.RigidTransform(np.array(foot_of(link)) - hinge)
        shape, made = drake.Sphere(WALKER.foot), _material(drake, WALKER.law.k)
        plant.RegisterCollisionGeometry(body, foot, shape, f"foot {k}", made)
    return body


def _drive(drake: Any, builder: Any, plant: Any, links: list[Link]) -> None:
    """Connect the drives' targets: angles, then rates, which are 0."""
    gain = np.zeros((2 * len(links), 1))
    gain[: len(links), 0] = [link.swing for link in links]
    beat = builder.AddSystem(drake.Sine(np.ones(1), np.array([WALKER.rate]), np.zeros(1)))
    shares = builder.AddSystem(drake.MatrixGain(gain))
    builder.Connect(beat.get_output_port(0), shares.get_input_port())
    instance = plant.GetModelInstanceByName("DefaultModelInstance")
    builder.Connect(shares.get_output_port(), plant.get_desired_state_input_port(instance))

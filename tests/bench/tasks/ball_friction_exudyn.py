"""A bowling ball slides, then rolls, under friction of one's own: mu = 0.1 + 0.1 exp(-v)."""

import math

import exudyn as exu
import numpy as np
from exudyn.utilities import InertiaSphere

container = exu.SystemContainer()
mbs = container.AddSystem()
ball = mbs.CreateRigidBody(
    inertia=InertiaSphere(5, 0.108),
    nodeType=exu.NodeType.RotationRotationVector,
    referencePosition=[0, 0, 0.108],
    initialVelocity=[5, 0, 0],
    gravity=[0, 0, -9.81],
)


def contact_force(mbs):
    place, v, w = (
        mbs.GetObjectOutputBody(ball, kind, [0, 0, 0])
        for kind in (
            exu.OutputVariableType.Position,
            exu.OutputVariableType.Velocity,
            exu.OutputVariableType.AngularVelocity,
        )
    )
    depth = 0.108 - place[2]
    if depth <= 0:
        return np.zeros(3)
    normal = max(0.0, 1e7 * depth**1.5 - 1e3 * v[2])
    slip = np.array([v[0] - 0.108 * w[1], v[1] + 0.108 * w[0]])
    size = np.linalg.norm(slip)
    mu = (0.1 + 0.1 * math.exp(-size)) * min(1.0, size / 1e-3)
    return np.array([*(-mu * normal / max(size, 1e-12) * slip), normal])


def force(mbs, t, load):
    return contact_force(mbs)


def torque(mbs, t, load):
    return np.cross([0, 0, -0.108], contact_force(mbs))


mbs.CreateForce(itemNumber=ball, loadVector=[0, 0, 0], loadVectorUserFunction=force)
mbs.CreateTorque(itemNumber=ball, loadVector=[0, 0, 0], loadVectorUserFunction=torque)
mbs.Assemble()
settings = exu.SimulationSettings()
settings.timeIntegration.endTime = 4
settings.timeIntegration.numberOfSteps = 20000
settings.solution.file.write = False
mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.RK44)
print(mbs.GetObjectOutputBody(ball, exu.OutputVariableType.Velocity, [0, 0, 0])[0])

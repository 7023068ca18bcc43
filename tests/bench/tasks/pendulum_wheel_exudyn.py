"""A rod on a wheel that rolls on a plane is kept up by a controller of its torque."""

import exudyn as exu
import numpy as np
from exudyn.utilities import MarkerBodyRigid, MarkerNodeRigid, ObjectGround, RigidBodyInertia

container = exu.SystemContainer()
mbs = container.AddSystem()
ground = mbs.AddObject(ObjectGround())
wheel, rod = (
    mbs.CreateRigidBody(
        inertia=RigidBodyInertia(mass=mass, inertiaTensor=np.diag(inertia)),
        referencePosition=[0, 0, height],
        gravity=[0, 0, -9.81],
        returnDict=True,
    )
    for mass, inertia, height in ((1, [3e-3, 5e-3, 3e-3], 0.1), (0.5, [0.02, 0.02, 1e-3], 0.5))
)
bodies = wheel["bodyNumber"], rod["bodyNumber"]
mbs.CreateRevoluteJoint(itemNumbers=list(bodies), position=[0, 0, 0.1], axis=[0, 1, 0])
mbs.CreateGenericJoint(
    itemNumbers=[ground, bodies[1]], position=[0, 0, 0.1], constrainedAxes=[0, 1, 0, 1, 0, 1]
)
contact = mbs.AddGeneralContact()
contact.SetFrictionPairings(0.8 * np.eye(1))
contact.SetFrictionProportionalZone(1e-2)
sphere = mbs.AddMarker(MarkerNodeRigid(nodeNumber=wheel["nodeNumber"]))
contact.AddSphereWithMarker(sphere, 0.1, 1e5, 200, 0)
corners = [[-5, -1, 0], [5, -1, 0], [5, 1, 0], [-5, 1, 0]]
contact.AddTrianglesRigidBodyBased(
    mbs.AddMarker(MarkerBodyRigid(bodyNumber=ground)),
    *(1e5, 200, 0),
    pointList=corners,
    triangleList=[[0, 1, 2], [0, 2, 3]],
)
contact.SetSearchTreeCellSize(numberOfCells=[1, 1, 1])
contact.SetSearchTreeBox(pMin=[-5, -1, -1], pMax=[5, 1, 1])
held = [0.0, 0.4]


def seen(body, kind):
    return mbs.GetObjectOutputBody(body, getattr(exu.OutputVariableType, kind), [0, 0, 0])


def lean():
    return 2.5 * (seen(bodies[1], "Position")[0] - seen(bodies[0], "Position")[0])


def control(mbs, t):
    if t >= 0.05 and t >= held[0] - 1e-9:
        x, v = seen(bodies[0], "Position")[0], seen(bodies[0], "Velocity")[0]
        rate = seen(bodies[1], "AngularVelocity")[1]
        held[:] = t + 0.01, 20 * lean() + 4 * rate + 0.5 * x + 1.0 * v
    return True


for sign, body in zip((1, -1), bodies, strict=True):
    mbs.CreateTorque(
        itemNumber=body,
        loadVector=[0, 0, 0],
        loadVectorUserFunction=lambda mbs, t, load, sign=sign: [0, sign * held[1], 0],
    )
mbs.SetPreStepUserFunction(control)
mbs.Assemble()
settings = exu.SimulationSettings()
settings.timeIntegration.endTime = 10
settings.timeIntegration.numberOfSteps = 10000
settings.solution.file.write = False
mbs.SolveDynamic(settings)
print(lean())

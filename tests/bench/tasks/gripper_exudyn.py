"""Two fingers close on a box by a force, and lift it by a motion."""

import exudyn as exu
import numpy as np
from exudyn.utilities import InertiaCuboid, ObjectGround, RigidBodyInertia

container = exu.SystemContainer()
mbs = container.AddSystem()
ground = mbs.AddObject(ObjectGround())
box = mbs.CreateRigidBody(
    inertia=InertiaCuboid(500, [0.1, 0.1, 0.1]),
    referencePosition=[0, 0, 0.05],
    gravity=[0, 0, -9.81],
)
law = {
    "sphereRadius": 0.001,
    "includeEdges": 0,
    "dynamicFriction": 0.6,
    "frictionProportionalZone": 1e-3,
    "contactStiffness": 1e5,
    "contactDamping": 200,
}
for x in (-0.049, 0.049):
    for y in (-0.049, 0.049):
        mbs.CreateSphereTriangleContact(
            itemNumbers=[box, ground],
            localPosition0=[x, y, -0.049],
            trianglePoints=exu.Vector3DList([[-9, -9, 0], [19, -9, 0], [-9, 19, 0]]),
            **law,
        )


def height(t):
    u = min(max(t - 0.5, 0.0), 1.0)
    return 0.2 * u * u * (3 - 2 * u)


def lifted(mbs, t, item, u, v, k, d, offset):
    return k * (u - height(t)) + d * v


for side in (-1, 1):
    finger = mbs.CreateRigidBody(
        inertia=RigidBodyInertia(mass=0.2, inertiaTensor=0.01 * np.eye(3)),
        referencePosition=[0.07 * side, 0, 0.05],
        gravity=[0, 0, -9.81],
    )
    mbs.CreateGenericJoint(
        itemNumbers=[ground, finger],
        position=[0.07 * side, 0, 0.05],
        constrainedAxes=[0, 1, 0, 1, 1, 1],
    )
    mbs.CreateCartesianSpringDamper(
        itemNumbers=[ground, finger],
        localPosition0=[0.07 * side, 0, 0.05],
        stiffness=[0, 0, 20000],
        damping=[10, 0, 400],
        springForceUserFunction=lambda mbs, t, item, u, v, k, d, offset: [
            d[0] * v[0],
            0,
            k[2] * (u[2] - height(t)) + d[2] * v[2],
        ],
    )
    mbs.CreateForce(itemNumber=finger, loadVector=[-20 * side, 0, 0])
    for y in (-0.029, 0.029):
        for z in (-0.029, 0.029):
            mbs.CreateSphereTriangleContact(
                itemNumbers=[finger, box],
                localPosition0=[-0.009 * side, y, z],
                trianglePoints=exu.Vector3DList(
                    [[0.05 * side, *point] for point in ([-1, -1], [3, -1], [-1, 3])[::side]]
                ),
                **law,
            )
mbs.Assemble()
settings = exu.SimulationSettings()
settings.timeIntegration.endTime = 2
settings.timeIntegration.numberOfSteps = 4000
settings.solution.file.write = False
mbs.SolveDynamic(settings)
print(mbs.GetObjectOutputBody(box, exu.OutputVariableType.Position, [0, 0, 0])[2])

"""Look at contact forces: a cube is pushed over a plane; forces over time, and a picture."""

import exudyn as exu
import matplotlib
import numpy as np
from exudyn.utilities import InertiaCuboid, ObjectGround, SensorUserFunction

matplotlib.use("agg")
import matplotlib.pyplot as plt

container = exu.SystemContainer()
mbs = container.AddSystem()
ground = mbs.AddObject(ObjectGround())
cube = mbs.CreateRigidBody(
    inertia=InertiaCuboid(1000, [0.1, 0.1, 0.1]),
    referencePosition=[0, 0, 0.05],
    initialVelocity=[1, 0, 0],
    gravity=[0, 0, -9.81],
)
corners = [
    mbs.CreateSphereTriangleContact(
        itemNumbers=[cube, ground],
        localPosition0=[x, y, -0.049],
        sphereRadius=0.001,
        trianglePoints=exu.Vector3DList([[-9, -9, 0], [19, -9, 0], [-9, 19, 0]]),
        includeEdges=0,
        dynamicFriction=0.3,
        frictionProportionalZone=1e-3,
        contactStiffness=1e5,
        contactDamping=200,
    )
    for x in (-0.049, 0.049)
    for y in (-0.049, 0.049)
]


def total(mbs, t, sensors, factors, configuration):
    kind = exu.OutputVariableType.Force
    return -sum(np.array(mbs.GetObjectOutput(corner, kind)) for corner in contacts)


contacts = [corner["oContact"] if isinstance(corner, dict) else corner for corner in corners]
sensor = mbs.AddSensor(
    SensorUserFunction(sensorUserFunction=total, storeInternal=True, writeToFile=False)
)
mbs.Assemble()
settings = exu.SimulationSettings()
settings.timeIntegration.endTime = 0.5
settings.timeIntegration.numberOfSteps = 1000
settings.solution.file.write = False
mbs.SolveDynamic(settings)
rows = mbs.GetSensorStoredData(sensor)
print(rows[len(rows) // 5, 1:])
figure, axes = plt.subplots()
axes.plot(rows[:, 0], rows[:, 1:])
axes.set_xlabel("time [s]")
figure.savefig("forces.png")

"""125 balls fall into a heap on a plane, with friction."""

import exudyn as exu
import numpy as np
from exudyn.utilities import InertiaSphere, MarkerBodyRigid, MarkerNodeRigid, ObjectGround

container = exu.SystemContainer()
mbs = container.AddSystem()
contact = mbs.AddGeneralContact()
contact.SetFrictionPairings(0.4 * np.eye(1))
contact.SetFrictionProportionalZone(1e-3)
contact.SetSearchTreeCellSize(numberOfCells=[20, 20, 20])
contact.SetSearchTreeBox(pMin=[-2, -2, -1], pMax=[3, 3, 1])
places = [(0.105 * i, 0.105 * j, 0.06 + 0.105 * k) for k in range(5) for i, j in np.ndindex(5, 5)]
noise = np.random.default_rng(1).uniform(-0.002, 0.002, (125, 3))
balls = []
for place in places + noise:
    ball = mbs.CreateRigidBody(
        inertia=InertiaSphere(1000 * 4 / 3 * np.pi * 0.05**3, 0.05),
        nodeType=exu.NodeType.RotationRotationVector,
        referencePosition=list(place),
        gravity=[0, 0, -9.81],
        returnDict=True,
    )
    balls.append(ball["bodyNumber"])
    marker = mbs.AddMarker(MarkerNodeRigid(nodeNumber=ball["nodeNumber"]))
    contact.AddSphereWithMarker(marker, 0.05, 2e5, 50, 0)
floor = mbs.AddMarker(MarkerBodyRigid(bodyNumber=mbs.AddObject(ObjectGround())))
corners = [[-2, -2, 0], [3, -2, 0], [3, 3, 0], [-2, 3, 0]]
contact.AddTrianglesRigidBodyBased(
    floor, 2e5, 50, 0, pointList=corners, triangleList=[[0, 1, 2], [0, 2, 3]]
)
mbs.Assemble()
settings = exu.SimulationSettings()
settings.timeIntegration.endTime = 1
settings.timeIntegration.numberOfSteps = 20000
settings.timeIntegration.explicit.computeMassMatrixInversePerBody = True
settings.solution.file.write = False
mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.VelocityVerlet)
kind = exu.OutputVariableType.Position
print(np.mean([mbs.GetObjectOutputBody(ball, kind, [0, 0, 0])[2] for ball in balls]))

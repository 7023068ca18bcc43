"""A thrown ball slides, then rolls: its way in 2 s over the coefficient of friction."""

import exudyn as exu
import numpy as np
from exudyn.utilities import InertiaSphere, MarkerBodyRigid, MarkerNodeRigid, ObjectGround


def way(mu):
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    ball = mbs.CreateRigidBody(
        inertia=InertiaSphere(5, 0.108),
        nodeType=exu.NodeType.RotationRotationVector,
        referencePosition=[0, 0, 0.108],
        initialVelocity=[5, 0, 0],
        gravity=[0, 0, -9.81],
        returnDict=True,
    )
    contact = mbs.AddGeneralContact()
    contact.SetFrictionPairings(mu * np.eye(1))
    contact.SetFrictionProportionalZone(1e-3)
    sphere = mbs.AddMarker(MarkerNodeRigid(nodeNumber=ball["nodeNumber"]))
    contact.AddSphereWithMarker(sphere, 0.108, 1e6, 1e3, 0)
    floor = mbs.AddMarker(MarkerBodyRigid(bodyNumber=mbs.AddObject(ObjectGround())))
    corners = [[-1, -1, 0], [20, -1, 0], [20, 1, 0], [-1, 1, 0]]
    contact.AddTrianglesRigidBodyBased(
        floor, 1e6, 1e3, 0, pointList=corners, triangleList=[[0, 1, 2], [0, 2, 3]]
    )
    contact.SetSearchTreeCellSize(numberOfCells=[1, 1, 1])
    contact.SetSearchTreeBox(pMin=[-1, -1, -1], pMax=[20, 1, 1])
    mbs.Assemble()
    settings = exu.SimulationSettings()
    settings.timeIntegration.endTime = 2
    settings.timeIntegration.numberOfSteps = 20000
    settings.solution.file.write = False
    mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.RK44)
    place = mbs.GetObjectOutputBody(ball["bodyNumber"], exu.OutputVariableType.Position, [0, 0, 0])
    return place[0]


for mu in (0.05, 0.1, 0.15, 0.2, 0.25, 0.3):
    print(mu, way(mu))

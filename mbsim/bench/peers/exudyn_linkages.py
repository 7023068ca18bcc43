"""S8_n and S8b in Exudyn: minimal coordinates as a kinematic tree, or plane bodies with joints.

Its plane bodies lie in its x-y plane, which stands for x-z; a tree's hinges turn about -y. Angles
so count from x towards z.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mbsim.bench import linkages
from mbsim.bench import parameters as p
from mbsim.bench.peers import common


def tree(exu: Any, system: Any, count: int) -> list[Any]:
    """The chain of S8_n as one object with a coordinate a hinge; its node."""
    from exudyn.itemInterface import NodeGenericODE2, ObjectKinematicTree

    length, still = p.S8.length / count, [0.0] * count
    node = system.AddNode(
        NodeGenericODE2(
            referenceCoordinates=still,
            initialCoordinates=still,
            initialCoordinates_t=still,
            numberOfODE2Coordinates=count,
        )
    )
    inertia = np.diag(p.rod_inertia(p.S8.mass, length))
    # it has hinges about +y only: seen upside down they are about -y, and gravity is along +z
    system.AddObject(
        ObjectKinematicTree(
            nodeNumber=node,
            gravity=[0.0, 0.0, p.GRAVITY],
            jointTypes=[exu.JointType.RevoluteY] * count,
            linkParents=list(range(-1, count - 1)),
            jointTransformations=exu.Matrix3DList([np.eye(3)] * count),
            jointOffsets=exu.Vector3DList([[length if k else 0.0, 0.0, 0.0] for k in range(count)]),
            linkInertiasCOM=exu.Matrix3DList([inertia] * count),
            linkCOMs=exu.Vector3DList([[length / 2, 0.0, 0.0]] * count),
            linkMasses=[p.S8.mass] * count,
        )
    )
    return [node]


def tree_rows(time: np.ndarray, x: np.ndarray, v: np.ndarray) -> common.Rows:
    """Rows of the rods from the hinges (n, rods)."""
    return common.Rows(time, *linkages.hinged_chain(x, v))


def _plane_body(
    system: Any, mass: float, inertia: float, poses: linkages.Poses, body: int, angle: float
) -> tuple[Any, Any]:
    """Node and object of a plane body as it is in the first row of `poses`."""
    from exudyn.itemInterface import (
        LoadForceVector,
        MarkerBodyPosition,
        NodeRigidBody2D,
        ObjectRigidBody2D,
    )

    place, velocity = poses.position[0, body, ::2], poses.velocity[0, body, ::2]
    node = system.AddNode(
        NodeRigidBody2D(
            referenceCoordinates=[*map(float, place), angle],
            initialVelocities=[*map(float, velocity), -float(poses.angular_velocity[0, body, 1])],
        )
    )
    made = system.AddObject(ObjectRigidBody2D(mass=mass, inertia=inertia, nodeNumber=node))
    marker = system.AddMarker(MarkerBodyPosition(bodyNumber=made))
    system.AddLoad(LoadForceVector(markerNumber=marker, loadVector=[0.0, -mass * p.GRAVITY, 0.0]))
    return node, made


def _at(system: Any, body: Any, x: float) -> Any:
    """A marker at `x` along a body's own axis."""
    from exudyn.itemInterface import MarkerBodyRigid

    return system.AddMarker(MarkerBodyRigid(bodyNumber=body, localPosition=[x, 0.0, 0.0]))


def _hinge(system: Any, a: Any, b: Any) -> None:
    from exudyn.itemInterface import RevoluteJoint2D

    system.AddObject(RevoluteJoint2D(markerNumbers=[a, b]))


def jointed(exu: Any, system: Any, count: int) -> list[Any]:
    """The chain of S8_n as plane bodies with joints; their nodes."""
    from exudyn.itemInterface import ObjectGround

    length, flat = p.S8.length / count, np.zeros((1, count))
    poses, across = linkages.chain(flat, flat), p.rod_inertia(p.S8.mass, length)[1]
    nodes, before = [], _at(system, system.AddObject(ObjectGround()), 0.0)
    for k in range(count):
        node, body = _plane_body(system, p.S8.mass, across, poses, k, 0.0)
        nodes.append(node)
        _hinge(system, before, _at(system, body, -length / 2))
        before = _at(system, body, length / 2)
    return nodes


def jointed_rows(time: np.ndarray, x: np.ndarray, v: np.ndarray) -> common.Rows:
    """Rows of the rods from displacements and angles (n, 3 rods)."""
    shape = (len(x), -1, 3)
    moved, rates = x.reshape(shape), v.reshape(shape)
    flat = np.zeros((1, len(moved[0])))
    place = linkages.chain(flat, flat).position[..., ::2] + moved[..., :2]
    poses = linkages.planar(place, moved[..., 2], rates[..., :2], rates[..., 2])
    return common.Rows(time, *poses)


def slider_crank(exu: Any, system: Any, slide: bool) -> list[Any]:
    """S8b with joints; the slider has a slide, or only a coordinate along x. Nodes."""
    from exudyn.itemInterface import ObjectGround

    s, start, poses = p.S8B, linkages.crank_start(), linkages.crank_poses()
    ground = system.AddObject(ObjectGround())
    across = [
        p.rod_inertia(mass, length)[1]
        for mass, length in ((s.crank_mass, s.crank_length), (s.rod_mass, s.rod_length))
    ]
    crank, one = _plane_body(system, s.crank_mass, across[0], poses, 0, start.crank)
    rod, two = _plane_body(system, s.rod_mass, across[1], poses, 1, start.rod)
    _hinge(system, _at(system, ground, 0.0), _at(system, one, -s.crank_length / 2))
    _hinge(system, _at(system, one, s.crank_length / 2), _at(system, two, -s.rod_length / 2))
    make = _slider_with_slide if slide else _slider_on_axis
    slider, pin = make(system, ground, poses)
    _hinge(system, _at(system, two, s.rod_length / 2), pin)
    return [crank, rod, slider]


def _slider_with_slide(system: Any, ground: Any, poses: linkages.Poses) -> tuple[Any, Any]:
    """Node and marker of a plane body that a prismatic joint leads along x."""
    from exudyn.itemInterface import PrismaticJoint2D

    node, body = _plane_body(system, p.S8B.slider_mass, 1e-3, poses, 2, 0.0)
    markers = [_at(system, ground, 0.0), _at(system, body, 0.0)]
    system.AddObject(PrismaticJoint2D(markerNumbers=markers))
    return node, markers[1]


def _slider_on_axis(system: Any, ground: Any, poses: linkages.Poses) -> tuple[Any, Any]:
    """Node and marker of a mass with one coordinate, along x."""
    from exudyn.itemInterface import MarkerBodyPosition, Node1D, ObjectMass1D

    node = system.AddNode(
        Node1D(
            referenceCoordinates=[float(poses.position[0, 2, 0])],
            initialVelocities=[float(poses.velocity[0, 2, 0])],
        )
    )
    body = system.AddObject(ObjectMass1D(physicsMass=p.S8B.slider_mass, nodeNumber=node))
    return node, system.AddMarker(MarkerBodyPosition(bodyNumber=body))


def crank_rows(time: np.ndarray, x: np.ndarray, v: np.ndarray) -> common.Rows:
    """Rows of S8b from displacements and angles of crank and rod, then those of the slider."""
    n, start, poses = len(x), linkages.crank_start(), linkages.crank_poses()
    place, velocity = np.zeros((n, 3, 2)), np.zeros((n, 3, 2))
    angle, rate = np.zeros((n, 3)), np.zeros((n, 3))
    for body, first in enumerate((start.crank, start.rod)):
        place[:, body], velocity[:, body] = x[:, 3 * body :][:, :2], v[:, 3 * body :][:, :2]
        angle[:, body], rate[:, body] = first + x[:, 3 * body + 2], v[:, 3 * body + 2]
    # of a slider with a slide x, z and angle are known, of the other one x only
    known = min(x.shape[1] - 6, 2)
    place[:, 2, :known], velocity[:, 2, :known] = x[:, 6 : 6 + known], v[:, 6 : 6 + known]
    if x.shape[1] > 8:
        angle[:, 2], rate[:, 2] = x[:, 8], v[:, 8]
    return common.Rows(
        time, *linkages.planar(place + poses.position[..., ::2], angle, velocity, rate)
    )

"""What Exudyn's scenes are made of: cases and their solvers, nodes, markers and contacts."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from mbsim.bench import parameters as p
from mbsim.bench.peers import common


class Solver(NamedTuple):
    """An integrator of Exudyn; `tol` > 0 asks for automatic steps of at most `step`."""

    name: str
    step: float  # s
    tol: float = 0.0
    rho: float = 0.9  # spectral radius of the generalised alpha method
    fresh: bool = False  # a new Jacobian every step

    @property
    def label(self) -> str:
        """How the setting is called."""
        if self.tol:
            return f"{self.name} tol={self.tol:g} hmax={self.step:g}"
        rho = f" rho={self.rho:g}" if self.name == "GeneralizedAlpha" else ""
        fresh = " Jacobian every step" if self.fresh else ""
        return f"{self.name}{rho}{fresh} dt={self.step:g}"

    @property
    def implicit(self) -> bool:
        """Whether each step solves equations."""
        return self.name in ("GeneralizedAlpha", "TrapezoidalIndex2")


class Case(NamedTuple):
    """A scene under one setting; `build` fills a system and returns its bodies' nodes."""

    build: Callable[[Any, Any], list[Any]]
    solver: Solver
    end_time: float  # s
    note: str = ""
    grid: bool = False  # rows of automatic steps are brought to the 10-ms grid
    many: bool = False  # S7: sparse, one mass matrix a body, rows from a step function, capped
    sample: float = p.SAMPLE  # s
    rows: RowsOf | None = None  # from times, all coordinates and rates; None: one body a node


RowsOf = Callable[[np.ndarray, np.ndarray, np.ndarray], common.Rows]
Cases = Iterator[tuple[str, Callable[[], Case]]]


def add_point(system: Any, place: Any, mass: float, velocity: Any = (0.0, 0.0, 0.0)) -> Any:
    """Node of a mass point."""
    from exudyn.itemInterface import MassPoint, NodePoint

    node = system.AddNode(
        NodePoint(referenceCoordinates=list(place), initialVelocities=list(velocity))
    )
    system.AddObject(MassPoint(mass=mass, nodeNumber=node))
    return node


def add_rigid_body(
    system: Any, place: Any, mass: float, inertia: Any, twist: Any = (0.0,) * 6
) -> Any:
    """Node of a rigid body whose rotation is a vector of the Lie group; spin in body axes."""
    from exudyn.itemInterface import NodeRigidBodyRotVecLG, ObjectRigidBody

    node = system.AddNode(
        NodeRigidBodyRotVecLG(
            referenceCoordinates=[*map(float, place), 0.0, 0.0, 0.0],
            initialVelocities=[*map(float, twist)],
        )
    )
    tensor = [*map(float, inertia), 0.0, 0.0, 0.0]
    system.AddObject(ObjectRigidBody(mass=mass, inertia=tensor, nodeNumber=node))
    return node


def add_ball(system: Any, place: Any, mass: float, radius: float, twist: Any = (0.0,) * 6) -> Any:
    """Node of a ball."""
    inertia = 0.4 * mass * radius**2
    return add_rigid_body(system, place, mass, (inertia,) * 3, twist)


def add_marker(system: Any, node: Any) -> Any:
    """Marker of a node's place, of its rotation too where it has one."""
    from exudyn.itemInterface import MarkerNodePosition, MarkerNodeRigid

    point = system.GetNode(node)["nodeType"] == "Point"
    return system.AddMarker((MarkerNodePosition if point else MarkerNodeRigid)(nodeNumber=node))


def add_pull(system: Any, marker: Any, force: Any) -> None:
    """A constant force on a marker."""
    from exudyn.itemInterface import LoadForceVector

    system.AddLoad(LoadForceVector(markerNumber=marker, loadVector=[float(f) for f in force]))


def add_ground_marker(system: Any) -> Any:
    """Marker at the origin of the ground."""
    from exudyn.itemInterface import MarkerBodyRigid, ObjectGround

    return system.AddMarker(MarkerBodyRigid(bodyNumber=system.AddObject(ObjectGround())))


class Contact:
    """GeneralContact with one friction coefficient; a law k, c between any two of its parts.

    Stiffnesses of a pair act in series and dampings add, so each side gets 2 k and c / 2.
    """

    def __init__(self, system: Any, law: p.LinearLaw, mu: float, zone: float = 1e-3) -> None:
        self._contact = system.AddGeneralContact()
        self._contact.SetFrictionPairings(mu * np.eye(1))
        self._contact.SetFrictionProportionalZone(zone)
        self._side = (2 * law.k, law.c / 2, 0)

    def sphere(self, marker: Any, radius: float) -> None:
        """A sphere about a marker."""
        self._contact.AddSphereWithMarker(marker, radius, *self._side)

    def rectangle(self, marker: Any, corners: list[tuple[float, float, float]]) -> None:
        """Two triangles through four corners, counter-clockwise seen from outside."""
        points = [list(map(float, corner)) for corner in corners]
        self._contact.AddTrianglesRigidBodyBased(
            marker, *self._side, pointList=points, triangleList=[[0, 1, 2], [0, 2, 3]]
        )

    def search(self, cells: tuple[int, int, int], low: Any, high: Any) -> None:
        """The boxes in which partners are searched."""
        self._contact.SetSearchTreeCellSize(numberOfCells=list(cells))
        self._contact.SetSearchTreeBox(pMin=list(map(float, low)), pMax=list(map(float, high)))


def add_floor(system: Any, contact: Contact, reach: tuple[float, float], width: float) -> None:
    """The plane z = 0 from reach[0] to reach[1] along x."""
    a, b = reach
    contact.rectangle(
        add_ground_marker(system),
        [(a, -width, 0.0), (b, -width, 0.0), (b, width, 0.0), (a, width, 0.0)],
    )
    contact.search((1, 1, 1), (a, -width, -1.0), (b, width, 1.0))

"""Drake on S9: hydroelastic contact of a mesh torus with a plane or a second torus.

The law is Drake's own, a pressure field: it is held to where the torus ends alone.
"""

from __future__ import annotations

import functools
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mbsim.bench import parameters as p
from mbsim.bench.outcome import Outcome
from mbsim.bench.peers import common
from mbsim.bench.peers.drake_rows import advanced

_MODULUS = 1e7  # Pa, hydroelastic
_DISSIPATION = 1.0  # s/m, Hunt and Crossley


class Setting(NamedTuple):
    """Whether the falling torus is compliant too, and the discrete step (s)."""

    compliant: bool
    step: float

    @property
    def label(self) -> str:
        """How the setting is called."""
        kind = "compliant torus" if self.compliant else "rigid torus on compliant"
        return f"hydroelastic {kind} dt={self.step:g}"


def settings() -> dict[str, Setting]:
    """Settings of both scenes, coarse to fine."""
    steps = (5e-3, 2e-3, 1e-3)
    found = [Setting(kind, step) for kind in (False, True) for step in steps]
    return {setting.label: setting for setting in found}


def run(drake: Any, on_torus: bool, setting: Setting, repeats: int) -> Outcome:
    """Run one scene; the wall time is the median of `repeats` loops."""
    with tempfile.TemporaryDirectory() as folder:
        return _run(drake, on_torus, setting, repeats, Path(folder))


def _run(drake: Any, on_torus: bool, setting: Setting, repeats: int, folder: Path) -> Outcome:
    diagram, plant = _build(drake, on_torus, setting, folder)
    count = round(p.S9.end_time / p.SAMPLE)
    times = np.arange(count + 1) * p.SAMPLE
    turn = np.pi / 2.0 if on_torus else p.S9.tilt

    def once() -> tuple[float, Any]:
        simulator = drake.Simulator(diagram)
        context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
        pose = drake.RigidTransform(
            drake.RotationMatrix.MakeXRotation(turn), np.array([0.0, 0.0, p.S9.height])
        )
        plant.SetFreeBodyPose(context, plant.GetBodyByName("torus"), pose)
        return advanced(simulator, plant, context, times)

    wall, state = common.measure(once, repeats)
    one = state[:, None, :]
    rows = common.Rows(times, one[..., 4:7], one[..., :4], one[..., 10:13], one[..., 7:10])
    note = f"pressure field, {_MODULUS:g} Pa; no law of ours"
    return common.outcome(wall, rows, note, p.S9.end_time)


def _build(drake: Any, on_torus: bool, setting: Setting, folder: Path) -> tuple[Any, Any]:
    """Return the diagram and its plant, whose mesh files are read as a run begins."""
    surface, volume = folder / "torus.obj", folder / "torus.vtk"
    surface.write_text(_surface(), encoding="ascii")
    volume.write_text(_volume(), encoding="ascii")
    builder = drake.DiagramBuilder()
    plant, _ = drake.AddMultibodyPlantSceneGraph(builder, setting.step)
    plant.set_discrete_contact_approximation(drake.DiscreteContactApproximation.kSap)
    plant.set_contact_model(drake.ContactModel.kHydroelastic)
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, -p.GRAVITY])
    friction = drake.CoulombFriction(p.S9.mu, p.S9.mu)

    def properties(compliant: bool, edge: float, slab: float = 0.0) -> Any:
        made = drake.ProximityProperties()
        drake.AddContactMaterial(_DISSIPATION, 1e6, friction, made)
        if not compliant:
            drake.AddRigidHydroelasticProperties(edge, made)
        elif slab:
            drake.AddCompliantHydroelasticPropertiesForHalfSpace(slab, _MODULUS, made)
        else:
            drake.AddCompliantHydroelasticProperties(edge, _MODULUS, made)
        return made

    def torus(body: Any, compliant: bool, pose: Any, name: str) -> None:
        shape = drake.Mesh(str(volume if compliant else surface))
        made = properties(compliant, p.S9.tube)
        plant.RegisterCollisionGeometry(body, pose, shape, name, made)

    mass, (x, y, z) = p.S9.mass, p.torus_inertia(p.S9)
    inertia = drake.SpatialInertia(
        mass, np.zeros(3), drake.UnitInertia(x / mass, y / mass, z / mass)
    )
    body = plant.AddRigidBody("torus", inertia)
    torus(body, setting.compliant, drake.RigidTransform(), "falling")
    world = plant.world_body()
    # the plane carries the torus on the plane and must be compliant under a rigid one
    plane = properties(not setting.compliant, p.S9.tube, slab=p.S9.tube)
    plant.RegisterCollisionGeometry(
        world, drake.RigidTransform(), drake.HalfSpace(), "plane", plane
    )
    if on_torus:
        place = drake.RigidTransform(np.array(p.S9.fixed))
        torus(world, True, place, "fixed")
    plant.Finalize()
    return builder.Build(), plant


@functools.cache
def _surface() -> str:
    """The mesh as an OBJ file."""
    vertices, faces = p.torus_mesh(p.S9)
    points = "".join(f"v {x!r} {y!r} {z!r}\n" for x, y, z in vertices.tolist())
    return points + "".join(f"f {a} {b} {c}\n" for a, b, c in (faces + 1).tolist())


@functools.cache
def _volume() -> str:
    """Tetrahedra inside the same mesh as a VTK file: its cells joined to the centre circle."""
    vertices, faces = p.torus_mesh(p.S9)
    around, across = p.S9.sections
    angle = 2.0 * np.pi * np.arange(around) / around
    ring = p.S9.ring * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(around)])
    points = np.vstack([vertices, ring])
    i, j = (each.ravel() for each in np.indices((around, across)))
    here, after = len(vertices) + i, len(vertices) + (i + 1) % around
    a, d = across * i + j, across * i + (j + 1) % across
    # a cell and two centres make a wedge: all its faces are joined to the centre after it
    cells = [
        np.column_stack([faces, np.concatenate([after, after])]),
        np.column_stack([a, d, here, after]),
    ]
    tetrahedra = np.concatenate(cells)
    corners = points[tetrahedra]
    edges = corners[:, 1:] - corners[:, :1]
    turned = np.linalg.det(edges) < 0.0
    tetrahedra[turned] = tetrahedra[turned][:, [1, 0, 2, 3]]
    rows = "".join(f"4 {a} {b} {c} {d}\n" for a, b, c, d in tetrahedra.tolist())
    places = "".join(f"{x!r} {y!r} {z!r}\n" for x, y, z in points.tolist())
    count = len(tetrahedra)
    return (
        "# vtk DataFile Version 3.0\ntorus\nASCII\nDATASET UNSTRUCTURED_GRID\n"
        f"POINTS {len(points)} double\n{places}\nCELLS {count} {5 * count}\n{rows}\n"
        f"CELL_TYPES {count}\n" + "10\n" * count
    )

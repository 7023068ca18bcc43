"""What is there to look at in a result file: bodies, shapes, markers, what is between bodies."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from mbsim.errors import MbsimError, ModelError
from mbsim.model.elements import Array
from mbsim.results.form import plain
from mbsim.results.graphics import CONNECTION, MARKER, NONE, SHAPE, about_graphics, graphics_of
from mbsim.results.reading import Results
from mbsim.results.units import UnitSystem
from mbsim.view.motion import Poses, continuous

Table = np.ndarray[Any, Any]
#: Radius of the ball that stands for a body without shapes, of the size of the scene.
_DOT = 0.01


@dataclass
class Scene:
    """A run to look at: poses are global, of the cg marker, lengths in the units of the deck."""

    name: str
    results: Results
    units: UnitSystem
    time: Array  # (n,) [T]
    body_ids: list[int]
    labels: list[str]
    poses: Poses
    shapes: Table  # `results.graphics.SHAPE`
    markers: Table  # `results.graphics.MARKER`
    connections: Table  # `results.graphics.CONNECTION`
    meshes: Table
    vertices: Array
    faces: Table
    gravity: Array  # (3,) [L/T^2]
    size: float  # [L] diagonal of the deck's box at t = 0
    warnings: list[str] = field(default_factory=list)

    @property
    def up(self) -> Array:
        """Unit vector against gravity; z where there is none."""
        length = float(np.linalg.norm(self.gravity))
        return -self.gravity / length if length > 0.0 else np.array([0.0, 0.0, 1.0])

    @property
    def reach(self) -> Array:
        """Distance of each body's farthest point from its centre [L]."""
        found = np.zeros(len(self.body_ids))
        column = {id: k for k, id in enumerate(self.body_ids)}
        for shape in self.shapes:
            k = column.get(int(shape["body"]))
            if k is not None:
                far = np.linalg.norm(shape["position"]) + self.radius_of(shape)
                found[k] = max(found[k], far)
        for marker in self.markers:
            k = column.get(int(marker["body"]))
            if k is not None:
                found[k] = max(found[k], np.linalg.norm(marker["position"]))
        return found

    def radius_of(self, shape: Any) -> float:
        """Return the radius of a ball about a shape's centre that holds it; 0 of a plane."""
        size, kind = shape["size"], shape["shape"]
        if kind == "MESH":
            mesh = self.meshes[shape["mesh"]]
            points = self.vertices[mesh["vertex"] : mesh["vertex"] + mesh["vertices"]]
            return float(np.linalg.norm(points, axis=1).max(initial=0.0))
        if kind == "BOX":
            return float(np.linalg.norm(size)) / 2.0
        if kind == "CYLINDER":
            return float(np.hypot(size[0], size[1] / 2.0))
        if kind == "FRUSTUM":
            return float(np.hypot(max(size[0], size[1]), size[2] / 2.0))
        return 0.0 if kind == "PLANE" else float(size.max())


def read_scene(results: Results) -> Scene:
    """Return what a result file has to look at.

    Raises
    ------
    ModelError
        If it holds no motion of bodies.
    """
    name = results.path.stem if results.path is not None else "run"
    time = np.atleast_1d(np.asarray(results["time"], dtype=np.float64))
    ids = results.ids("bodies")
    moving = [id for id in ids if f"bodies/{id}/position" in results]
    turning = all(f"bodies/{id}/quaternion" in results for id in moving)
    if not moving or not turning:
        raise ModelError(
            f"{results.path}: holds no positions and quaternions of bodies, so there is nothing to "
            "look at; record bodies/*/position and bodies/*/quaternion (--signals)"
        )
    if not len(time):
        raise ModelError(f"{results.path}: has no output row yet")
    p = np.stack([results[f"bodies/{id}/position"] for id in moving], axis=1)
    q = np.stack([results[f"bodies/{id}/quaternion"] for id in moving], axis=1)
    good = np.isfinite(p).all(axis=(1, 2)) & np.isfinite(q).all(axis=(1, 2))
    warnings = []
    if not good.all():
        warnings.append(
            f"{int((~good).sum())} rows with positions that are no numbers are left out"
        )
        time, p, q = time[good], p[good], q[good]
        if not len(time):
            raise ModelError(f"{results.path}: no row has positions that are numbers")
    length = np.linalg.norm(q, axis=2, keepdims=True)
    poses = Poses(p, continuous(q / np.where(length > 0.0, length, 1.0)))
    tables, about, told = _tables(results, moving, poses)
    return Scene(
        name=name,
        results=results,
        units=UnitSystem.of(results.attributes),
        time=time,
        body_ids=moving,
        labels=[results.label(f"bodies/{id}") for id in moving],
        poses=poses,
        shapes=tables["graphics/shapes"],
        markers=tables["markers"],
        connections=tables["connections"],
        meshes=tables.get("graphics/meshes", np.zeros(0)),
        vertices=tables.get("graphics/vertices", np.zeros((0, 3))),
        faces=tables.get("graphics/faces", np.zeros((0, 3), dtype=np.uint32)),
        gravity=np.array([about.get(f"gravity_{axis}", 0.0) for axis in "xyz"]),
        size=about["size"],
        warnings=warnings + told,
    )


def _tables(
    results: Results, ids: list[int], poses: Poses
) -> tuple[dict[str, Table], dict[str, float], list[str]]:
    """Return the tables, the attributes of `/graphics`, and what is to be said of them."""
    if "graphics/shapes" in results:
        names = [f"graphics/{name}" for name in results.tables("graphics")]
        tables = {name: results[name] for name in (*names, "markers", "connections")}
        about = {
            name: float(results.attribute("graphics", name))
            for name in ("gravity_x", "gravity_y", "gravity_z", "size")
        }
        return tables, about, []
    # of an earlier version: the deck has them, if it is still the one that was run
    file = str(results.attributes.get("model_file", ""))
    try:
        from mbsim.model.placement import place
        from mbsim.reader.xml import read_model

        overrides = str(results.attributes.get("overrides", "")).splitlines()
        model = read_model(Path(file), overrides)
        if model.sha256 == results.attributes.get("model_sha256"):
            placement = place(model)
            tables = {name: plain(t) for name, t in graphics_of(model, placement).items()}
            return tables, about_graphics(model, placement), []
        why = f"{file} has changed since the run"
    except MbsimError as error:
        why = str(error).splitlines()[0]
    span = np.ptp(poses.p.reshape(-1, 3), axis=0)
    size = float(np.linalg.norm(span)) or 1.0
    shapes = np.zeros(len(ids), dtype=SHAPE)
    shapes["id"], shapes["body"], shapes["quaternion"] = ids, ids, (1.0, 0.0, 0.0, 0.0)
    shapes["shape"], shapes["size"], shapes["mesh"] = "SPHERE", (_DOT * size, 0.0, 0.0), NONE
    shapes["color"] = NONE
    tables = {
        "graphics/shapes": plain(shapes),
        "markers": np.zeros(0, dtype=MARKER),
        "connections": plain(np.zeros(0, dtype=CONNECTION)),
    }
    told = f"the file has no shapes ({why}): each body is shown as a small ball"
    return tables, {"size": size}, [told]

"""All that a page needs of one run, as a pack: see `packing` for its form."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mbsim.model.elements import Array
from mbsim.results.names import order
from mbsim.results.units import (
    ACCELERATION,
    FORCE,
    POSITION,
    SPIN,
    TIME,
    VELOCITY,
    Quantity,
    UnitSystem,
)
from mbsim.view.arrows import arrows, dots
from mbsim.view.channels import bytes_apart, channels, shortened
from mbsim.view.colours import FIXED, PALETTE
from mbsim.view.motion import Poses
from mbsim.view.packing import MOST_STEPS, pack, planes, quantised
from mbsim.view.scene import Scene
from mbsim.view.thinning import error, kept_rows

#: What is shown is off from the result file by less than this, of the size of the scene.
TOLERANCE = 1e-4
#: Steps of positions, of the size of the scene, and of quaternions.
_STEP, _TURN = 2.0**-17, 2.0**-15
#: Poses of bodies in a page without leaving out rows, and at most.
_FEW, _MOST = 200_000, 450_000
#: Bytes of a page in base64 that a run may take.
ROOM = 4_000_000
#: Events that a page lists.
_EVENTS = 3000


@dataclass(frozen=True)
class RunData:
    """A deflated pack, and what it leaves out."""

    data: bytes
    rows: int  # that are kept, of those of the file
    rows_of_file: int
    error: float  # of positions at all rows, of the size of the scene
    signals_left_out: int
    warnings: list[str]


def run_data(
    scene: Scene, room: int = ROOM, asked: Sequence[str] = (), shown: UnitSystem | None = None
) -> RunData:
    """Return what a page needs of a run.

    Parameters
    ----------
    scene : Scene
    room : int
        Bytes that it may take in base64, about.
    asked : sequence of str
        Names of signals whose curves come first.
    shown : UnitSystem, optional
        Of curves, times and lengths as shown; default: the run's own.

    Raises
    ------
    UnknownSignal
        If there is none of a name that is asked for.
    """
    shown = shown or scene.units
    step = _step(scene)
    rows, off = view_rows(scene)
    arrays, poses = _poses(scene, rows, step)
    touching = dots(scene, rows)
    forces = arrows(scene, rows, touching)
    for name, made in (("dots", touching), ("arrows", forces)):
        data, count, order_ = planes(quantised(made.point - scene_centre(scene), step))
        arrays |= {name: data, f"{name}_first": made.first.astype(np.uint32)}
        poses[name] = {"count": len(made.point), "planes": count, "order": order_}
    arrays["arrow_force"] = bytes_apart(shortened(forces.force.reshape(-1)))
    arrays["arrow_slip"] = bytes_apart(shortened(forces.slip))
    arrays["arrow_area"] = bytes_apart(shortened(forces.area))
    arrays["arrow_contact"] = forces.contact.astype(np.int32)
    arrays |= _shapes(scene) | _markers(scene) | _meshes(scene)
    about = {**_about(scene, shown), **poses, "arrows_at_points": forces.at_points}
    taken = len(pack(about, arrays)) * 4 // 3
    curves = channels(scene, max(room - taken, 100_000), asked, shown)
    arrays |= curves.arrays
    about["channels"], about["asked"] = curves.about, list(asked)
    about["left_out"] = curves.left_out
    about["error"] = off
    about["rows"], about["rows_of_file"] = len(rows), len(scene.time)
    warnings = list(scene.warnings)
    coarse = _rounding(scene, step)
    if coarse > TOLERANCE:
        warnings.append(
            f"bodies go so far that positions are shown to {coarse:.2g} of the scene's size"
        )
    elif off > TOLERANCE:
        warnings.append(
            f"rows are left out for size: between those shown, positions are off by up to "
            f"{off:.2g} of the scene's size"
        )
    if touching.left_out:
        warnings.append(f"{touching.left_out} points of contact are left out for size")
    about["warnings"] = warnings
    return RunData(pack(about, arrays), len(rows), len(scene.time), off, curves.left_out, warnings)


def scene_centre(scene: Scene) -> Array:
    """Return the point that positions in a pack are counted from, (3,) [L]."""
    p = scene.poses.p
    middle: Array = 0.5 * (p[0].min(axis=0) + p[0].max(axis=0))
    return middle


def _step(scene: Scene) -> float:
    """Return what positions are rounded to [L]: whole numbers of it must hold the farthest."""
    far = float(np.abs(scene.poses.p - scene_centre(scene)).max(initial=0.0))
    return max(_STEP * scene.size, far / (MOST_STEPS / 4))


def _rounding(scene: Scene, step: float) -> float:
    """Return by how much rounding moves a point of a body at most, of the scene's size."""
    reach = float(scene.reach.max(initial=0.0)) / scene.size
    return 0.5 * 3**0.5 * step / scene.size + 2.0 * _TURN * reach


def view_rows(scene: Scene) -> tuple[np.ndarray[Any, Any], float]:
    """Return the rows to keep, and by how much positions are off at any row, of the size."""
    n, bodies = scene.poses.p.shape[:2]
    rounding = _rounding(scene, _step(scene))
    if n * bodies <= _FEW:
        return np.arange(n), rounding
    share = 0.5 * TOLERANCE
    while True:
        rows = kept_rows(scene.time, scene.poses, scene.reach, share * scene.size)
        if len(rows) * bodies <= _MOST or share > 0.1 or len(rows) <= 100:
            break
        share *= 2.0
    pairs = zip(rows[:-1].tolist(), rows[1:].tolist(), strict=True)
    off = max((error(scene.time, scene.poses, scene.reach, a, b) for a, b in pairs), default=0.0)
    return rows, off / scene.size + rounding


def _poses(scene: Scene, rows: Any, step: float) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the arrays of time and poses, and how they are packed."""
    kept = Poses(scene.poses.p[rows] - scene_centre(scene), scene.poses.q[rows])
    n, bodies = kept.p.shape[:2]
    p, p_planes, p_order = planes(quantised(kept.p.reshape(n, 3 * bodies), step))
    q, q_planes, q_order = planes(quantised(kept.q.reshape(n, 4 * bodies), _TURN))
    arrays = {"time": np.asarray(scene.time[rows], dtype="<f8").view("<u4"), "p": p, "q": q}
    return arrays, {
        "step": step,
        "turn": _TURN,
        "centre": scene_centre(scene).tolist(),
        "p": {"planes": p_planes, "order": p_order},
        "q": {"planes": q_planes, "order": q_order},
    }


def label_of(row: Any) -> str:
    """Return the label of a row of a table that may have none."""
    return str(row["label"]) if "label" in (row.dtype.names or ()) else ""


def _about(scene: Scene, shown: UnitSystem) -> dict[str, Any]:
    """Return the words and numbers of a run that is shown in some units."""
    results, units = scene.results, scene.units
    column = {id: k for k, id in enumerate(scene.body_ids)}
    quantities = {
        "time": TIME,
        "position": POSITION,
        "velocity": VELOCITY,
        "acceleration": ACCELERATION,
        "spin": SPIN,
        "force": FORCE,
        "pressure": Quantity("Pressure", force=1, length=-2),
    }
    events = results["events"] if "events" in results else []
    audit = results.audit
    markers = {int(id): k for k, id in enumerate(scene.markers["id"])}
    return {
        "name": scene.name,
        "file": str(results.path or ""),
        "model": str(results.attributes.get("model_file", "")),
        "version": str(results.attributes.get("mbsim_version", "")),
        "status": results.status,
        "audit": audit.line if audit is not None else "",
        "audit_warnings": list(audit.warnings) if audit is not None else [],
        "units": {name: units.text(quantity) for name, quantity in quantities.items()},
        # lengths and times of this run are multiplied with these to be shown
        "factor": {
            "length": units.factor_to(shown, POSITION),
            "time": units.factor_to(shown, TIME),
        },
        "shown": {"position": shown.text(POSITION)},
        "second": 1.0 / shown.factor_to(UnitSystem(), TIME),
        "gravity": scene.gravity.tolist(),
        "up": scene.up.tolist(),
        "size": scene.size,
        "palette": list(PALETTE),
        "fixed": FIXED,
        "bodies": [
            {"id": id, "label": label}
            for id, label in zip(scene.body_ids, scene.labels, strict=True)
        ],
        "shapes": [
            {
                "id": int(shape["id"]),
                "label": label_of(shape),
                "shape": str(shape["shape"]),
                "body": column.get(int(shape["body"]), -1),
                "body_id": int(shape["body"]),
            }
            for shape in scene.shapes
        ],
        "markers": [
            [int(m["id"]), column.get(int(m["body"]), -1), label_of(m)] for m in scene.markers
        ],
        "connections": [
            {
                "group": str(c["group"]),
                "id": int(c["id"]),
                "type": str(results.attribute(f"{c['group']}/{c['id']}", "type") or ""),
                "label": results.label(f"{c['group']}/{c['id']}"),
                "i": markers.get(int(c["i_marker"]), -1),
                "j": markers.get(int(c["j_marker"]), -1),
            }
            for c in sorted(scene.connections, key=lambda c: order(f"{c['group']}/{c['id']}"))
        ],
        "events": [[float(e["time"]), str(e["kind"]), int(e["element"])] for e in events[:_EVENTS]],
    }


def _shapes(scene: Scene) -> dict[str, Any]:
    """Return poses, sizes and colours of shapes."""
    shapes = scene.shapes
    pose = np.column_stack([shapes["position"], shapes["quaternion"]]).astype("<f4")
    sizes = np.column_stack([shapes["size"], shapes["bounds"]]).astype("<f4")
    looks = np.column_stack([shapes["color"], shapes["hidden"], shapes["mesh"]]).astype("<i4")
    return {
        "shape_pose": pose.reshape(-1),
        "shape_size": sizes.reshape(-1),
        "shape_looks": looks.reshape(-1),
    }


def _markers(scene: Scene) -> dict[str, Any]:
    """Return poses of markers in their bodies."""
    pose = np.column_stack([scene.markers["position"], scene.markers["quaternion"]])
    return {"marker_pose": pose.astype("<f4").reshape(-1)}


def _meshes(scene: Scene) -> dict[str, Any]:
    """Return vertices as 16-bit numbers of their box, and faces, of each mesh that a shape has."""
    rows = [] if not len(scene.meshes) else scene.meshes.tolist()
    arrays: dict[str, Any] = {"meshes": np.array(rows, dtype="<u4").reshape(-1)}
    if rows:
        arrays["vertices"] = bytes_apart(shortened_vertices(scene.vertices).reshape(-1))
        # indices of neighbours are near each other
        steps = np.diff(scene.faces.reshape(-1).astype(np.int64), prepend=0)
        folded = np.where(steps < 0, -2 * steps - 1, 2 * steps).astype("<u4")
        arrays["faces"] = np.ascontiguousarray(folded.view("u1").reshape(-1, 4).T).reshape(-1)
    return arrays


def shortened_vertices(vertices: Any) -> Any:
    """Return vertices rounded to 2^-16 of the farthest one, as float32."""
    far = float(np.abs(vertices).max(initial=0.0))
    if far == 0.0:
        return vertices.astype("<f4")
    step = 2.0 ** (np.floor(np.log2(far)) - 16)
    return (np.rint(vertices.astype(np.float64) / step) * step).astype("<f4")

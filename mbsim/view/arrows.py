"""Where bodies touch over the rows of a view, and the forces there."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from mbsim.arrays.codes import INC_POINT
from mbsim.model.elements import Array
from mbsim.results.graphics import NONE
from mbsim.view.scene import Scene

Table = np.ndarray[Any, Any]
#: Points and forces that a view shows at most; of each row the strongest.
MOST = 120_000


class Arrows(NamedTuple):
    """Forces at points, row by row of a view: row k has those from first[k] to first[k + 1].

    A force acts on the body of I, global axes. Without `at_points` a force is the resultant of a
    contact between two bodies, on its line of action.
    """

    first: Table  # (rows + 1,)
    point: Array  # (m, 3) [L]
    force: Array  # (m, 3) [F]
    slip: Array  # (m,) [L/T]
    area: Array  # (m,) [L^2] 0 of a point
    contact: Table  # (m,) id
    at_points: bool


class Dots(NamedTuple):
    """Points of contact, row by row of a view."""

    first: Table
    point: Array
    left_out: int


def _pieces(first: Table, rows: Table) -> tuple[Table, Table]:
    """Return which entries of a table belong to rows, and where those of each of them begin."""
    counts = first[rows + 1] - first[rows]
    begins = np.append(0, np.cumsum(counts))
    entries = np.repeat(first[rows] - begins[:-1], counts) + np.arange(begins[-1])
    return entries, begins


def dots(scene: Scene, rows: Table) -> Dots:
    """Return the points of contact at rows of the result file, as many as a view shows."""
    results = scene.results
    if "state/incident_offsets" not in results:
        return Dots(np.zeros(len(rows) + 1, np.int64), np.zeros((0, 3)), 0)
    entries, begins = _pieces(np.asarray(results["state/incident_offsets"]), rows)
    table = results["state/incidents"]
    points = np.asarray(table[:, INC_POINT : INC_POINT + 3], dtype=np.float64)[entries]
    # the same share of every row
    every = -(-len(points) // MOST) if len(points) else 1
    if every > 1:
        row = np.repeat(np.arange(len(rows)), np.diff(begins))
        kept = (np.arange(len(points)) - begins[row]) % every == 0
        counts = np.bincount(row[kept], minlength=len(rows))
        return Dots(np.append(0, np.cumsum(counts)), points[kept], int((~kept).sum()))
    return Dots(begins, points, 0)


def arrows(scene: Scene, rows: Table, at: Dots) -> Arrows:
    """Return forces at rows: at points where the run recorded them, else resultants."""
    if "contact_points/offsets" in scene.results:
        return _recorded(scene, rows)
    return _resultants(scene, rows, at)


def _recorded(scene: Scene, rows: Table) -> Arrows:
    """Return the forces at all points, of each row the strongest."""
    results = scene.results
    entries, begins = _pieces(np.asarray(results["contact_points/offsets"]), rows)
    force = np.asarray(results["contact_points/force"], dtype=np.float64)[entries]
    row = np.repeat(np.arange(len(rows)), np.diff(begins))
    if len(force) > MOST:
        size = np.linalg.norm(force, axis=1)
        order = np.lexsort((-size, row))
        place = np.empty(len(force), np.int64)
        place[order] = np.arange(len(force)) - begins[row[order]]
        kept = np.flatnonzero(place < max(1, MOST // len(rows)))
        entries, force, row = entries[kept], force[kept], row[kept]
    counts = np.bincount(row, minlength=len(rows))

    def column(name: str) -> Table:
        return np.asarray(results[f"contact_points/{name}"])[entries]

    return Arrows(
        first=np.append(0, np.cumsum(counts)),
        point=column("position"),
        force=force,
        slip=column("slip_speed"),
        area=column("area"),
        contact=column("contact"),
        at_points=True,
    )


def _resultants(scene: Scene, rows: Table, at: Dots) -> Arrows:
    """Return the resultant of every contact between two bodies, at rows where it touches."""
    results = scene.results
    found: list[tuple[Table, ...]] = []
    for contact in scene.connections:
        id = int(contact["id"])
        names = [f"contacts/{id}/{name}" for name in ("force", "torque", "slip_speed")]
        between = contact["group"] == "contacts" and NONE not in (
            contact["i_body"],
            contact["j_body"],
        )
        if not between or not all(name in results for name in names):
            continue
        force, torque, slip = (np.asarray(results[name])[rows] for name in names)
        square = (force**2).sum(axis=1)
        k = np.flatnonzero(np.isfinite(square) & (square > 0.0))
        force, torque, square = force[k], torque[k], square[k]
        cg = np.zeros((len(k), 3))
        if contact["i_body"] in scene.body_ids:
            cg = scene.poses.p[rows[k], scene.body_ids.index(contact["i_body"])]
        # the line of the force on which its torque about the centre is the one given
        base = cg + np.cross(force, torque) / square[:, None]
        base = _moved(base, force / np.sqrt(square)[:, None], k, at)
        name = f"contacts/{id}/area"
        areas = np.asarray(results[name])[rows][k] if name in results else np.zeros(len(k))
        found.append((k, base, force, slip[k], areas, np.full(len(k), id)))
        if sum(len(part[0]) for part in found) > MOST:
            break
    if not found:
        return Arrows(
            np.zeros(len(rows) + 1, np.int64),
            *(np.zeros((0, 3)),) * 2,
            *(np.zeros(0),) * 2,
            np.zeros(0, np.int64),
            False,
        )
    k, *columns = (np.concatenate(parts) for parts in zip(*found, strict=True))
    order = np.argsort(k, kind="stable")
    counts = np.bincount(k, minlength=len(rows))
    first = np.append(0, np.cumsum(counts))
    point, force, slip, area, contact_ids = (column[order] for column in columns)
    return Arrows(first, point, force, slip, area, contact_ids, False)


def _moved(base: Array, along: Array, k: Table, at: Dots) -> Array:
    """Return points of the lines of action that are beside the points of contact nearest to them.

    Parameters
    ----------
    base, along : ndarray, shape (m, 3)
        A point and the direction of each line.
    k : ndarray, shape (m,)
        Rows of the view.
    at : Dots
    """
    made: Array = base.copy()
    for m, row in enumerate(k):
        points = at.point[at.first[row] : at.first[row + 1]]
        if not len(points):
            continue
        arms = points - base[m]
        shift = arms @ along[m]
        far = np.linalg.norm(arms - shift[:, None] * along[m], axis=1)
        made[m] += shift[far.argmin()] * along[m]
    return made

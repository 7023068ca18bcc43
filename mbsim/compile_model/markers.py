"""Rows of markers that compiled code looks at, made as they are asked for."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from mbsim.arrays.model import Angles, Markers
from mbsim.model.elements import Array, Model
from mbsim.model.placement import Placement


def body_rows(model: Model, placement: Placement) -> dict[int, int]:
    """Return the row of every body by id, that of ground being the number of moving bodies."""
    rows = {body.id: len(placement.bodies) for body in model.bodies.values()}
    rows.update({id: k for k, id in enumerate(placement.bodies)})
    return rows


@dataclass
class MarkerTable:
    """Rows of `arrays.Markers` and `arrays.Angles`; row 0 of the markers is the global frame.

    `body_row` is the row of every body by id, that of ground being the number of moving bodies.
    """

    placement: Placement
    body_row: dict[int, int]
    #: What residuals of constraints are measured by [L].
    length: float = 1.0
    rows: dict[int, int] = field(default_factory=dict)
    angle_rows: dict[tuple[int, int], int] = field(default_factory=dict)
    turned_rows: dict[tuple[int, int], int] = field(default_factory=dict)
    frames: list[tuple[int, Array, Array]] = field(default_factory=list)
    #: Rows of `arrays.Angles` that are of the global frame until somebody needs them.
    spare_angles: int = 0

    def __post_init__(self) -> None:
        self.frames.append((self.ground, np.zeros(3), np.eye(3)))

    @property
    def ground(self) -> int:
        """Row of ground in the body arrays."""
        return len(self.placement.bodies)

    def row(self, marker_id: int | None) -> int:
        """Return the row of a marker of the model; None and 0 are the global frame."""
        if not marker_id:
            return 0
        if marker_id not in self.rows:
            placed = self.placement.markers[marker_id]
            body = self.body_row[placed.body_id]
            self.rows[marker_id] = self.add(body, placed.p_B, placed.R_B)
        return self.rows[marker_id]

    def add(self, body: int, p: Array, R: Array) -> int:
        """Return the row of a new marker: origin (3,) and axes (3, 3) in the body's cg axes."""
        self.frames.append((body, p, R))
        return len(self.frames) - 1

    def frame(self, row: int) -> tuple[Array, Array]:
        """Return origin (3,) and axes (3, 3) of a row at the start, global."""
        body, p, R = self.frames[row]
        if body == self.ground:
            return p, R
        placed = list(self.placement.bodies.values())[body]
        return placed.p + placed.R @ p, placed.R @ R

    def turned(self, row: int, axis: int) -> int:
        """Return the row of a marker turned so that an angle about `axis` is one about its z.

        The angle about x is atan2(-z_I.y_J, z_I.z_J), so that z, -y, x become the axes; that
        about y is atan2(z_I.x_J, z_I.z_J), so that z, x, y do.
        """
        if axis == 2:
            return row
        if (row, axis) not in self.turned_rows:
            body, p, R = self.frames[row]
            x, y, z = R.T
            axes = (z, -y, x) if axis == 0 else (z, x, y)
            self.turned_rows[row, axis] = self.add(body, p, np.column_stack(axes))
        return self.turned_rows[row, axis]

    def angle(self, i: int, j: int) -> int:
        """Return the row of the angle of marker row i about the z-axis of marker row j."""
        return self.angle_rows.setdefault((i, j), len(self.angle_rows))

    def start_angle(self, i: int, j: int) -> float:
        """Return the angle of row i about the z-axis of row j at the start [rad]."""
        x, R = self.frame(i)[1][:, 0], self.frame(j)[1]
        return math.atan2(float(x @ R[:, 1]), float(x @ R[:, 0]))

    def start_angles(self) -> Array:
        """Return all followed angles at the start [rad]."""
        found = [self.start_angle(i, j) for i, j in self.angle_rows]
        return np.array(found + [0.0] * self.spare_angles, dtype=np.float64)

    def arrays(self) -> tuple[Markers, Angles]:
        """Return the tables as they are now."""
        body, p, R = zip(*self.frames, strict=True)
        rows = [*self.angle_rows, *[(0, 0)] * self.spare_angles]
        pairs = np.array(rows, dtype=np.int64).reshape(-1, 2)
        return (
            Markers(np.array(body, dtype=np.int64), np.array(p), np.array(R)),
            Angles(pairs[:, 0].copy(), pairs[:, 1].copy()),
        )

"""A model while it is being read: what is known so far, and every fault found on the way."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from mbsim.errors import Fault
from mbsim.model import elements as el
from mbsim.model.curves import (
    CurveOnCurve,
    ParamCurve,
    ParamSurface,
    PointOnCurve,
    PointOnSurface,
)
from mbsim.reader.linear_systems import ControlDraft
from mbsim.reader.parse import Node


@dataclass(frozen=True)
class GearDraft:
    """A gear as it is read: it becomes a coupler when markers are known."""

    id: int
    joint_ids: tuple[int, ...]
    cv: int
    label: str = ""
    source: el.Source = field(default_factory=el.Source)


@dataclass(frozen=True)
class MultiPointDraft:
    """A Force_MultiPoint as it is read: markers and ids of matrices, None where there is none."""

    id: int
    marker_ids: tuple[int, ...]
    ref_marker_id: int
    matrices: dict[str, int | None]  # by attribute
    cratio: float | None = None
    label: str = ""
    source: el.Source = field(default_factory=el.Source)


@dataclass(frozen=True)
class PlanarCluster:
    """A Reference_2DCluster as it is read: it becomes joints where a Subsystem_Planar names it."""

    id: int
    plane: str
    bodies: tuple[int, ...]
    source: el.Source


@dataclass
class Draft:
    """Elements by id and the findings; `broken` holds (statement, id) with a fault of their own.

    A broken element still counts as existing, so that one fault is not reported again
    by everything that refers to it.
    """

    file: str
    directory: Path
    units: el.Units | None = None
    bodies: dict[int, el.Body] = field(default_factory=dict)
    markers: dict[int, el.Marker] = field(default_factory=dict)
    graphics: dict[int, el.Graphic] = field(default_factory=dict)
    contacts: dict[int, el.Contact] = field(default_factory=dict)
    joints: dict[int, el.Joint] = field(default_factory=dict)
    primitives: dict[int, el.Joint] = field(default_factory=dict)
    couplers: dict[int, el.Coupler] = field(default_factory=dict)
    gears: dict[int, GearDraft] = field(default_factory=dict)
    motions: dict[int, el.Motion] = field(default_factory=dict)
    general_constraints: dict[int, el.GeneralConstraint] = field(default_factory=dict)
    points_on_curves: dict[int, PointOnCurve] = field(default_factory=dict)
    curves_on_curves: dict[int, CurveOnCurve] = field(default_factory=dict)
    points_on_surfaces: dict[int, PointOnSurface] = field(default_factory=dict)
    surfaces: dict[int, ParamSurface] = field(default_factory=dict)
    scalar_forces: dict[int, el.ScalarForce] = field(default_factory=dict)
    marker_forces: dict[str, dict[int, el.MarkerForce]] = field(default_factory=dict)
    multi_points: dict[int, MultiPointDraft] = field(default_factory=dict)
    vector_forces: dict[int, el.VectorForce] = field(default_factory=dict)
    body_forces: dict[int, el.BodyForce] = field(default_factory=dict)
    joint_frictions: dict[int, el.JointFriction] = field(default_factory=dict)
    joint_limits: dict[int, el.JointLimit] = field(default_factory=dict)
    force_elements: dict[int, el.ForceElement] = field(default_factory=dict)
    variables: dict[int, el.Variable] = field(default_factory=dict)
    sensors: dict[int, el.Sensor] = field(default_factory=dict)
    evaluations: dict[int, el.Evaluation] = field(default_factory=dict)
    differentials: dict[int, el.Differential] = field(default_factory=dict)
    splines: dict[int, el.Spline] = field(default_factory=dict)
    curves: dict[int, ParamCurve] = field(default_factory=dict)
    curve_matrices: dict[int, int] = field(default_factory=dict)  # of curves that these give
    clusters: dict[int, PlanarCluster] = field(default_factory=dict)
    planar: dict[int, el.Source] = field(default_factory=dict)  # clusters in force
    arrays: dict[int, el.ArrayOfNumbers] = field(default_factory=dict)
    control: ControlDraft = field(default_factory=ControlDraft)
    requests: dict[int, el.Request] = field(default_factory=dict)
    display_graphics: dict[int, str] = field(default_factory=dict)
    points: dict[int, tuple[str, el.Source]] = field(default_factory=dict)  # bodies: point masses
    gravity: el.Gravity | None = None
    transient: el.Transient | None = None
    static: el.Static = field(default_factory=el.Static)
    linear: el.Linear = field(default_factory=el.Linear)
    plants: dict[str, dict[int, el.Plant]] = field(default_factory=dict)  # by statement
    simulations: list[el.Simulation] = field(default_factory=list)
    compatibility: str = ""
    more: bytes = b""  # of another file that says what is run
    in_command: bool = False  # the section being read

    # what the statements of <Command> read so far have set for the next Simulate
    command_gravity: el.Gravity | None = None
    command_transient: el.Transient | None = None
    stop_line: int = 0
    changes: tuple[el.Change, ...] = ()
    # elements that take no part, by table and id, with the statement that says so
    inactive: dict[tuple[str, int], tuple[el.Source, str]] = field(default_factory=dict)
    # (joint, id of what needs it) that have been told of
    joints_missed: set[tuple[int, int]] = field(default_factory=set)
    # statements of <Model> that may be changed, by name and id as written, as last changed
    nodes: dict[tuple[str, str], Node] = field(default_factory=dict)

    faults: list[Fault] = field(default_factory=list)
    broken: set[tuple[str, int]] = field(default_factory=set)
    warnings: list[str] = field(default_factory=list)
    note_lines: dict[str, list[int]] = field(default_factory=dict)
    note_files: dict[str, str] = field(default_factory=dict)

    def fault(self, line: int, element: str, message: str) -> None:
        """Add one fault."""
        self.faults.append(Fault(self.file, line, element, message))

    def warn(self, line: int, element: str, message: str) -> None:
        """Add one warning, worded like a fault."""
        self.warnings.append(str(Fault(self.file, line, element, message)))

    def note(self, line: int, message: str) -> None:
        """Add what is accepted and not acted on; equal notes are joined into one."""
        self.note_lines.setdefault(message, []).append(line)
        self.note_files.setdefault(message, self.file)

    def notes(self) -> tuple[str, ...]:
        """Return the notes, each once, with the first lines on which it applies."""
        joined = []
        for message, lines in self.note_lines.items():
            more = f" and {len(lines) - 1} more" if len(lines) > 1 else ""
            joined.append(f"{self.note_files[message]}:{lines[0]}{more}: {message}")
        return tuple(joined)

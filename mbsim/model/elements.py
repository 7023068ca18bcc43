"""What a deck says, as frozen dataclasses in the deck's own words and units.

Every element carries its `Source` (file and line), so that a fault found late,
in the geometry or in a running solver, can still be shown in the user's deck.
Forces and simulations have files of their own and are found here under the same names.
Nothing here is converted, placed or checked; see `placement` and `checks`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from mbsim.expressions import Expression
from mbsim.forces.catalog import FORCES, table_of
from mbsim.model.curves import HigherPairs
from mbsim.model.forces import (
    BodyForce,
    ForceElement,
    Gravity,
    JointFriction,
    JointLimit,
    MarkerForce,
    ScalarForce,
    VectorForce,
)
from mbsim.model.simulation import Change, Linear, Plant, Simulation, Static, Transient
from mbsim.model.source import ASIDE, NO_RESULT, RelationSubroutine, Source, Subroutine

__all__ = [
    "ASIDE",
    "ArrayOfNumbers",
    "Body",
    "BodyForce",
    "Change",
    "Contact",
    "Coupler",
    "Differential",
    "Evaluation",
    "ForceElement",
    "GeneralConstraint",
    "Graphic",
    "Gravity",
    "Joint",
    "JointFriction",
    "JointLimit",
    "Linear",
    "Marker",
    "MarkerForce",
    "Model",
    "Motion",
    "Plant",
    "RelationSubroutine",
    "Request",
    "ScalarForce",
    "Sensor",
    "Simulation",
    "Source",
    "Spline",
    "Static",
    "Subroutine",
    "Transient",
    "Units",
    "Variable",
    "VectorForce",
]

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Units:
    """Names of the model's units and the factor that makes F = m a hold in them.

    `mass_scale` [-] multiplies every mass and inertia of the deck: 1 for N, m, kg, s,
    1e-3 for N, mm, kg, s (1 kg mm/s^2 = 1e-3 N).
    """

    force: str = "NEWTON"
    mass: str = "KILOGRAM"
    length: str = "METER"
    time: str = "SECOND"
    mass_scale: float = 1.0
    length_m: float = 1.0  # one length unit in metres
    time_s: float = 1.0  # one time unit in seconds


@dataclass(frozen=True)
class Body:
    """Body_Rigid. Velocities count only where their flag is true."""

    id: int
    label: str = ""
    is_ground: bool = False
    mass: float | None = None
    inertia: tuple[float, float, float, float, float, float] | None = None  # xx yy zz xy yz xz
    cg_id: int | None = None
    im_id: int | None = None
    lprf_id: int | None = None
    v_ic: tuple[float, float, float] = (0.0, 0.0, 0.0)
    w_ic: tuple[float, float, float] = (0.0, 0.0, 0.0)
    v_given: tuple[bool, bool, bool] = (False, False, False)  # flagged in the deck
    w_given: tuple[bool, bool, bool] = (False, False, False)
    vm_id: int | None = None
    wm_id: int | None = None
    density: float | None = None  # ours, [mass/L^3]; used only where mass is absent
    source: Source = Source()


@dataclass(frozen=True)
class Marker:
    """Reference_Marker: position and axes (columns of `R`) in its parent frame."""

    id: int
    label: str = ""
    body_id: int = 0
    rm_id: int | None = None
    pos: tuple[float, float, float] = (0.0, 0.0, 0.0)
    R: Array = field(default_factory=lambda: np.eye(3))
    source: Source = Source()
    floating: bool = False  # of Adams: wherever I of its force is


@dataclass(frozen=True)
class Graphic:
    """Post_Graphic. `shape` is SPHERE, ELLIPSOID, BOX, CYLINDER, FRUSTUM, PLANE or MESH.

    `size` is (radius,) for a sphere, semi-axes for an ellipsoid, edge lengths for a
    box, (radius, length) for a cylinder, (bottom radius, top radius, length) for a frustum,
    empty for a plane and a mesh.
    `offset` is the shape's centre in the marker's frame: a box from its corner
    and a cylinder or frustum (whose marker is the centre of its base) have one.
    A plane is the half-space z <= 0 of its marker; a mesh has vertices and faces.
    """

    id: int
    label: str = ""
    type: str = "SPHERE"  # the deck's own type, e.g. BoxDefinedFromCorner
    shape: str = "SPHERE"
    marker_id: int = 0
    size: tuple[float, ...] = ()
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    vertices: Array | None = None  # (n, 3)
    faces: npt.NDArray[np.int64] | None = None  # (m, 3), zero-based
    mesh_file: str = field(default="", metadata=NO_RESULT)
    hull: Array | None = None  # of a convex mesh: its polyhedron, packed as in model.hull
    is_material_inside: bool = True
    # how pictures show it: red, green, blue from 0 to 255; xmin, xmax, ymin, ymax of a plane
    color: tuple[int, int, int] | None = field(default=None, metadata=NO_RESULT)
    hidden: bool = field(default=False, metadata=NO_RESULT)
    bounds: tuple[float, ...] = field(default=(), metadata=NO_RESULT)
    source: Source = Source()


@dataclass(frozen=True)
class Contact:
    """Force_Contact, every documented attribute; `cnf_type` and `cff_type` are canonical."""

    id: int
    label: str = ""
    i_graphics_id: tuple[int, ...] = ()
    j_graphics_id: tuple[int, ...] = ()
    ignore_penetration_larger_than: float | None = None
    contact_points: str = "POINTS"
    contact_depth: str = "LARGEST"
    cnf_type: str = "IMPACT"
    stiffness: float = 0.0
    exponent: float = 1.5
    damping: float = 0.0
    dmax: float | None = None
    penalty: float = 0.1
    restitution_coef: float | None = None
    ref_velocity: float | None = None
    normal_trans_vel: float = 1e-3
    i_elastic_modulus: float | None = None
    j_elastic_modulus: float | None = None
    i_poisson_ratio: float | None = None
    j_poisson_ratio: float | None = None
    i_layer_depth: float | None = None
    j_layer_depth: float | None = None
    i_radius: float | None = None  # HERTZ takes those of the graphics where these are None
    j_radius: float | None = None
    cff_type: str = "COULOMB_OFF"
    mu_static: float = 0.0
    mu_dynamic: float = 0.0
    stiction_trans_vel: float = 1e-3
    friction_trans_vel: float = 1e-3
    friction: tuple[tuple[str, float], ...] = ()  # attributes that only its friction law has
    cff: Subroutine = Subroutine()
    source: Source = Source()
    cnf: Subroutine = Subroutine()
    cpost: Subroutine | None = None

    @property
    def asks_user(self) -> bool:
        """Whether a function of the user's gives its friction, or a law's friction of sliding."""
        return self.cff_type == "USERCFF" or bool(self.cff.fnc_name)

    @property
    def needs_area(self) -> bool:
        """Whether its friction follows from the area of contact alone."""
        return self.cff_type == "CONTENSOU" and "patch_radius" not in dict(self.friction)

    @property
    def rigid(self) -> bool:
        """Whether its friction holds without give: tangential_stiffness is INFINITE."""
        return math.isinf(dict(self.friction).get("tangential_stiffness", 0.0))

    @property
    def numbers(self) -> tuple[float, ...]:
        """What kernels are given beside the laws' own, in `dynamics.contact.forces`' order."""
        ignored = self.ignore_penetration_larger_than
        return (math.inf if ignored is None else ignored,)

    @property
    def with_itself(self) -> bool:
        """Whether I and J are the same graphics: all of them touch each other."""
        return set(self.i_graphics_id) == set(self.j_graphics_id)


@dataclass(frozen=True)
class Joint:
    """Constraint_Joint, and Adams' JOINT and JPRIM. `type` is a name of `joints.JOINTS`."""

    id: int
    type: str
    label: str = ""
    i_marker_id: int = 0
    j_marker_id: int = 0
    pitch: float | None = None  # SCREW: travel of I along z [L] a turn
    pitch_diameter: float | None = None  # RACK_PINION [L]
    length: float | None = None  # DISTANCE [L]; None: as assembled
    is_primitive: bool = False  # JPRIM: has ids of its own
    source: Source = Source()


@dataclass(frozen=True)
class Coupler:
    """Constraint_Coupler: the sum over joints of scale times displacement is constant.

    `motion_types` says for each joint whether its rotation (R) or its translation (T) counts.
    With a subroutine what it gives is 0 instead, and there are no scales.
    """

    id: int
    label: str = ""
    joint_ids: tuple[int, ...] = ()
    motion_types: tuple[str, ...] = ()
    scales: tuple[float, ...] = ()
    user: RelationSubroutine | None = None
    source: Source = Source()


class InputElement(NamedTuple):
    """An element whose expression is a number that the caller sets between steps."""

    table: str  # of the model: variables or motions
    id: int
    start: float


@dataclass(frozen=True)
class Motion:
    """Motion_Joint, Motion_Marker, Adams' MOTION: a displacement, its first or second rate.

    `direction` is R (about J's z) or T (along it) on a joint; between two markers X, Y, Z (of I's
    origin along J's axes) or B1, B2, B3 (AX, AY, AZ: about J's x, y, z). The markers are the
    joint's where there is one.
    """

    id: int
    label: str = ""
    joint_id: int | None = None
    i_marker_id: int = 0
    j_marker_id: int = 0
    direction: str = "R"
    val_type: str = "D"  # D, V or A
    expr: Expression | None = None  # [L], [rad] or their rates
    ic_disp: float | None = None  # what a V or A motion starts from; None: as the bodies stand
    ic_vel: float | None = None
    user: Subroutine | None = None  # `expr` is then what it returns
    source: Source = Source()

    @property
    def statement(self) -> str:
        """The XML's name of the statement."""
        return "Motion_Marker" if self.joint_id is None else "Motion_Joint"


@dataclass(frozen=True)
class GeneralConstraint:
    """Constraint_General, Adams' GCON: a scalar expression of displacements and TIME is 0."""

    id: int
    expr: Expression
    label: str = ""
    source: Source = Source()


@dataclass(frozen=True)
class Variable:
    """Reference_Variable, Adams' VARIABLE: an expression that others use by VARVAL(id)."""

    id: int
    expr: Expression
    label: str = ""
    user: Subroutine | None = None  # `expr` is then what it returns
    source: Source = Source()


@dataclass(frozen=True)
class Differential:
    """Control_Diff, Adams' DIFF: a state z of the user's own, z' = expr, that starts at `ic`.

    Others use z by DIF(id) and z' by DIF1(id). `scale`: below this size of z a local error
    counts as one of z at this size (manual, error control). `is_static_hold`: a static analysis
    leaves z as it is.
    """

    id: int
    expr: Expression
    ic: float = 0.0
    scale: float = 1.0
    is_static_hold: bool = False
    user: Subroutine | None = None  # `expr` is then what it returns
    label: str = ""
    source: Source = Source()


@dataclass(frozen=True)
class Spline:
    """Reference_Spline, Adams' SPLINE: points of a curve, or of one curve for each z of a surface.

    `y` holds one row of values for each of `z`, or one row where there is no `z`.
    """

    id: int
    x: tuple[float, ...]
    y: tuple[tuple[float, ...], ...]
    z: tuple[float, ...] = ()
    linear_extrapolate: bool = False
    label: str = ""
    source: Source = Source()


@dataclass(frozen=True)
class ArrayOfNumbers:
    """Reference_Array of type IC, Adams' ARRAY: numbers that expressions name by ARYVAL(id, n)."""

    id: int
    values: tuple[float, ...]
    label: str = ""
    source: Source = Source()


@dataclass(frozen=True)
class Sensor:
    """Sensor_Event, Adams' SENSOR: acts when its condition becomes true (manual, Sensor_Event).

    `zero_crossing`: a step ends where it becomes true. What it does: `halt` ends the run,
    `stops` (return) the Simulate, `prints` adds a row; `dt` [T] is the print interval, `stepsize`
    the next step, `h_max` the longest from then on; `evaluate` is what SENVAL shows, by the id of
    the Sensor_Evaluate `evaluate_id` that it is of, or by the sensor's own.
    """

    id: int
    expr: Expression
    compare: str = "EQ"  # GE, LE, GT, LT or EQ
    value: float = 0.0
    error_tol: float = 0.0
    zero_crossing: bool = False
    evaluate: Expression | None = None
    evaluate_id: int | None = None
    halt: bool = False
    stops: bool = False
    prints: bool = False
    dt: float | None = None
    stepsize: float | None = None
    h_max: float | None = None
    verbose: bool = False
    user: Subroutine | None = None  # `expr` is then what it returns
    label: str = ""
    source: Source = Source()


@dataclass(frozen=True)
class Evaluation:
    """Sensor_Evaluate: what SENVAL(id) shows from when a sensor that names it acts."""

    id: int
    expr: Expression
    user: Subroutine | None = None  # `expr` is then what it returns
    label: str = ""
    source: Source = Source()


@dataclass(frozen=True)
class Request:
    """Post_Request, Adams' REQUEST.

    `type` is one of `request_types.TYPES`: the motion of a marker, MARKER_FORCE (all forces between
    two markers), ELEMENTAL_FORCE (`elem_type`, `elem_id`, `jflag`) or EXPRESSION (`exprs`: F1..F8,
    None where there is none).
    """

    id: int
    type: str
    label: str = ""
    comment: str = ""
    i_marker_id: int = 0
    j_marker_id: int | None = None
    ref_marker_id: int | None = None
    elem_type: str = ""  # of keywords.FORCE_ELEMENTS
    elem_id: int = 0
    jflag: bool = False  # the force on J's side instead of I's
    exprs: tuple[Expression | None, ...] = ()
    user: Subroutine | None = None  # of EXPRESSION: `exprs` are then what it returns
    source: Source = Source()


@dataclass(frozen=True)
class Model(HigherPairs):
    """A whole deck. Dictionaries are keyed by id, in the order of the deck."""

    name: str = field(metadata=NO_RESULT)
    file: str = field(metadata=NO_RESULT)
    sha256: str = field(metadata=NO_RESULT)
    units: Units
    bodies: dict[int, Body]
    markers: dict[int, Marker]
    graphics: dict[int, Graphic]
    contacts: dict[int, Contact]
    joints: dict[int, Joint] = field(default_factory=dict)
    primitives: dict[int, Joint] = field(default_factory=dict)
    couplers: dict[int, Coupler] = field(default_factory=dict)
    motions: dict[int, Motion] = field(default_factory=dict)
    general_constraints: dict[int, GeneralConstraint] = field(default_factory=dict)
    scalar_forces: dict[int, ScalarForce] = field(default_factory=dict)
    marker_forces: dict[str, dict[int, MarkerForce]] = field(default_factory=dict)  # by kind
    vector_forces: dict[int, VectorForce] = field(default_factory=dict)
    body_forces: dict[int, BodyForce] = field(default_factory=dict)
    joint_frictions: dict[int, JointFriction] = field(default_factory=dict)
    joint_limits: dict[int, JointLimit] = field(default_factory=dict)
    force_elements: dict[int, ForceElement] = field(default_factory=dict)
    variables: dict[int, Variable] = field(default_factory=dict)
    differentials: dict[int, Differential] = field(default_factory=dict)
    splines: dict[int, Spline] = field(default_factory=dict)
    arrays: dict[int, ArrayOfNumbers] = field(default_factory=dict)
    sensors: dict[int, Sensor] = field(default_factory=dict)
    evaluations: dict[int, Evaluation] = field(default_factory=dict)
    gravity: Gravity = field(default_factory=Gravity)
    transient: Transient = field(default_factory=Transient)
    simulations: tuple[Simulation, ...] = ()
    requests: dict[int, Request] = field(default_factory=dict)
    compatibility: str = ""
    # statements accepted and not acted on, for the log
    notes: tuple[str, ...] = field(default=(), metadata=NO_RESULT)
    warnings: tuple[str, ...] = field(default=(), metadata=NO_RESULT)
    # what was set in the deck before it was read
    overrides: tuple[str, ...] = field(default=(), metadata=NO_RESULT)

    # elements whose value the caller sets while the model runs, see `run.inputs`
    inputs: tuple[InputElement, ...] = ()
    # of linear analyses, see `run.plants`: what is added to variables, and variables looked at
    added: Mapping[int, int] = field(default_factory=dict)
    looked_at: tuple[int, ...] = ()

    @property
    def shown(self) -> tuple[int, ...]:
        """By which id SENVAL shows what each sensor evaluates, 0 for none."""
        if not self.evaluations:
            return tuple(self.sensors)
        return tuple(sensor.evaluate_id or 0 for sensor in self.sensors.values())

    def table(self, name: str) -> Mapping[int, Any]:
        """Return the elements of a field by id, or those of a kind of `forces.catalog`."""
        field = table_of(name)
        if not field:
            return self.marker_forces.get(name, {})
        found: dict[int, Any] = getattr(self, field)
        return found

    def changed(self, changes: tuple[Change, ...]) -> Model:
        """Return the model with elements as the changes leave them, the last of each."""
        tables: dict[str, Any] = {}
        for change in changes:
            table = tables.setdefault(change.table, dict(self.table(change.table)))
            table[change.element.id] = change.element
        kinds = {name: tables.pop(name) for name in [*tables] if name in FORCES}
        if kinds:
            tables["marker_forces"] = self.marker_forces | kinds
        return replace(self, **tables) if tables else self

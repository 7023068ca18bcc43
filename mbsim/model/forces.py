"""The forces of a deck beside contacts, as `elements` has them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from mbsim.expressions import Expression
from mbsim.forces.catalog import ForceKind, memories
from mbsim.model.source import Source, Subroutine

if TYPE_CHECKING:
    from mbsim.model.elements import Model


@dataclass(frozen=True)
class ScalarForce:
    """Force_Scalar_TwoBody, Adams' SFORCE: an expression along the line of two markers, or about z.

    `type` TRANSLATIONAL: a positive force pushes I and J apart; ROTATIONAL: a positive torque
    acts on I about J's z. `action_only`: nothing acts on J; the line (or axis) is J's z.
    """

    statement: ClassVar[str] = "Force_Scalar_TwoBody"

    id: int
    type: str
    expr: Expression
    label: str = ""
    i_marker_id: int = 0
    j_marker_id: int = 0
    action_only: bool = False
    user: Subroutine | None = None  # `expr` is then what it returns
    source: Source = Source()


@dataclass(frozen=True)
class MarkerForce:
    """A force between two markers of one of the kinds in `forces.catalog`.

    `parameters` are the attributes of its statement by name, defaults among them.
    """

    id: int
    kind: str
    label: str = ""
    i_marker_id: int = 0
    j_marker_id: int = 0
    parameters: tuple[tuple[str, Any], ...] = ()
    source: Source = Source()

    @property
    def values(self) -> dict[str, Any]:
        """The attributes by name."""
        return dict(self.parameters)

    def __getattr__(self, name: str) -> Any:
        """Return an attribute of the statement."""
        for known, value in self.__dict__.get("parameters", ()):
            if known == name:
                return value
        raise AttributeError(name)


@dataclass(frozen=True)
class VectorForce:
    """Force_Vector_TwoBody, Adams' VFORCE, VTORQUE and GFORCE: six expressions.

    `exprs` are force and torque on I along the axes of the reference marker (None and 0: global),
    None where there is none. The body of the floating J marker takes the opposite at the origin
    of I, wherever that marker is.
    """

    statement: ClassVar[str] = "Force_Vector_TwoBody"

    id: int
    type: str = "FORCEANDTORQUE"
    exprs: tuple[Expression | None, ...] = (None,) * 6
    label: str = ""
    i_marker_id: int = 0
    j_floating_marker_id: int = 0
    ref_marker_id: int | None = None
    user: Subroutine | None = None  # `exprs` are then what it returns
    source: Source = Source()

    @property
    def action_only(self) -> bool:
        """Whether nothing acts on a second body."""
        return False


@dataclass(frozen=True)
class BodyForce(VectorForce):
    """Force_Vector_OneBody: the same on I alone."""

    statement: ClassVar[str] = "Force_Vector_OneBody"

    @property
    def action_only(self) -> bool:
        """Whether nothing acts on a second body."""
        return True


@dataclass(frozen=True)
class JointFriction:
    """Force_JointFriction: a friction law in a joint, pressed by the joint's own reaction.

    Normal force: the reaction across the free axis (of SPHERICAL all of it) + `preload` + the
    reaction torque across that axis over `bending_reaction_arm`, where that is > 0. `friction_arm`
    is where the force along the axis of REVOLUTE rubs, `reaction_arm` where the torque about the
    axis of TRANSLATIONAL presses.
    """

    id: int
    joint_id: int
    label: str = ""
    cff_type: str = "COULOMB_ON"
    mu_static: float = 0.0
    mu_dynamic: float = 0.0
    stiction_trans_vel: float = 1e-3  # [L/T]
    friction_trans_vel: float = 1e-3  # [L/T]
    pin_radius: float | None = None  # REVOLUTE, CYLINDRICAL [L]
    ball_radius: float | None = None  # SPHERICAL [L]
    preload: float = 0.0  # [F]
    bending_reaction_arm: float = 0.0  # [L]
    friction_arm: float = 0.0  # REVOLUTE [L]
    reaction_arm: float = 0.0  # TRANSLATIONAL [L]
    source: Source = Source()

    @property
    def constants(self) -> tuple[float, ...]:
        """Radius, preload, arms: the order of `dynamics.forces.joint_friction`."""
        radius = self.pin_radius or self.ball_radius or 0.0
        arms = self.bending_reaction_arm, self.friction_arm, self.reaction_arm
        return radius, self.preload, *arms


@dataclass(frozen=True)
class JointLimit:
    """Force_JointLimit (ours): a normal law pushes a joint's displacement back between bounds.

    `direction` T: of I along J's z [L]; R: the angle about it [rad], whole turns counted. The
    law's force is then a torque, and its depth an angle.
    """

    id: int
    joint_id: int
    direction: str
    label: str = ""
    lower: float | None = None
    upper: float | None = None
    cnf_type: str = "IMPACT"
    stiffness: float = 0.0
    exponent: float = 1.5
    damping: float = 0.0
    dmax: float | None = None
    penalty: float = 0.1
    restitution_coef: float | None = None
    ref_velocity: float | None = None
    normal_trans_vel: float = 1e-3
    source: Source = Source()


@dataclass(frozen=True)
class ForceElement:
    """Force_Element (ours): forces along and about axes of J by a user's residual.

    `directions` are TX ... RZ, each once. The function and its unknowns are in the user's script.
    """

    id: int
    directions: tuple[str, ...]
    user: Subroutine
    label: str = ""
    i_marker_id: int = 0
    j_marker_id: int = 0
    source: Source = Source()


def rigid_forces(model: Model) -> list[tuple[ForceKind, MarkerForce]]:
    """Return the applied forces that are held by an equation while they stick."""
    return [
        (kind, force)
        for kind in memories()
        for force in model.table(kind.name).values()
        if kind.form.is_rigid(force.values)
    ]


@dataclass(frozen=True)
class Gravity:
    """Force_Gravity [L/T^2] in the global frame; `exprs` of TIME stand in place of numbers."""

    g: tuple[float, float, float] = (0.0, 0.0, 0.0)
    source: Source = Source()
    exprs: tuple[Expression | None, ...] = (None, None, None)
    id: int = 1

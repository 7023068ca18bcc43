"""The registry of applied forces, and what a kind of them is.

A kind is a file in `forces/kinds`: names and attributes of its statement, formula, energy, slopes
and branches. Nothing in it is about arrays, XML or compilation. `FORCES` has all kinds form by
form, each by name, and forces are summed in that order. What a kind's formula is asked for, and
what it returns, follows from its form:

`Scalar`, `Switched`: one force F along a line or an axis, or one torque about an axis, by the
displacement x [L or rad] there and its rate x'; see `Acts`. ``force(x, rate, par)`` returns F on I,
stored energy and lost power, F x' + the rate of what is stored + what is lost being 0, and
``slopes(x, rate, par)`` dF/dx and dF/dx'. A switched one keeps to a branch within a step, or has
one for each side of its switches: ``force(x, rate, par, kept, law)``, ``slopes`` and ``side`` of
the same, which returns a number that differs where the branch does, so that steps end there.
`kept` is what the force remembers (`formula.Kept`), and ``commit(x, rate, par, kept)`` returns
slider and mode that hold behind an accepted step, and the energy that is lost there at once. `law`
is the normal law of an element that has one, for `formula.ask`.

`Wrench`: force and torque on I by how I stands and moves as seen from J. ``wrench(motion, par)``,
with `motion` a `formula.Motion`, returns

    force [F], torque [F L] on I's body at I's origin, along J's axes; stored energy; lost power

and J's body takes the opposite at I's origin. What is stored is a function of displacements alone,
and force . v + torque . w + its rate + lost power = 0. ``slopes(motion, par, K, D)`` fills two
6 x 6 arrays of zeros with how (force, torque) fall as I moves along and turns about J's axes (K),
and with (v, w) (D).

`Expressed`, `Components`: what a user's expressions say; their slopes are those of expressions, and
what they do to bodies counts as lost, with the sign turned.

`par` is the array of constants that ``constants(values)`` makes of the attributes before a run.
``bounds(par)`` says what a method without error estimate has to follow; such a method refuses kinds
that have none.

Three are registered and act elsewhere, because no formula of two markers gives them.
Force_MultiPoint (`MultiPoint`) has a row for each marker: `dynamics.forces.multi_point`. Friction
in joints (`OfReactions`) follows from the reactions that it changes:
`dynamics.forces.joint_friction`.
Force_Element (`OfResidual`) has unknowns of its own, which a user's residual makes 0:
`dynamics.forces.force_element`. Rigid dry friction has a formula where it slides; what holds it is
an equation, in `dynamics.stiction.rigid_friction`.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, ClassVar, NamedTuple, Protocol

import numpy as np

from mbsim.core.jitable import jitable
from mbsim.core.registry import Registry
from mbsim.forces.formula import Vector

Values = Mapping[str, Any]


class Acts(NamedTuple):
    """Where a scalar force acts: an entry of `Applied.form`, and which axis of J it is along."""

    form: int
    axis: int = 2
    turns: bool = False  # whether x is an angle, whole turns counted


class Parameter(NamedTuple):
    """An attribute of the statement: a number, `count` of them, or one of `words`."""

    name: str
    default: Any = 0.0  # None: it must be given, unless it is optional
    positive: bool = False  # else it may be 0 as well
    signed: bool = False  # else it may not be negative
    count: int = 1  # type: ignore[assignment]  # hides a method of tuples
    alias: str = ""  # other names, separated by blanks
    words: tuple[str, ...] = ()
    others: Mapping[str, str] = {}  # other spellings of a word, separated by blanks
    kind: str = ""  # what it is if neither number nor word: a name that the reader knows
    optional: bool = False  # it is None where the deck does not give it
    about: str = ""  # its meaning, for the manual
    unit: str = ""
    shown: str = ""  # what the manual gives for the default, unless it is a number


class Given(Protocol):
    """What a deck gives of an element, for a kind that reads its own statement."""

    def given(self, name: str) -> bool:
        """Return whether the deck gives an attribute, faulty or not."""

    def fault(self, message: str, attribute: str = "") -> None:
        """Say what is wrong, of an attribute if one is named."""

    def by_user(self, expressions: tuple[str, ...] = ("expr",)) -> bool:
        """Return whether a user's function stands in place of expressions."""

    def subroutine(self, default: str) -> Any:
        """Return the user's function, called `default` where the deck does not name it."""

    def result(self, user: Any, component: int = 0) -> Any:
        """Return what a user's function gives as an expression."""

    def check_law(self, attribute: str) -> None:
        """Check what a law of friction or of normal forces needs, which an attribute names."""


class Reading(NamedTuple):
    """How a kind with elements of its own class reads its statement.

    ``read(given, values)`` returns the fields of the element beside id, label and source, or None
    where too much is missing; `values` are those that the deck gives without fault, and 0 for ids
    that must be there and are not.
    """

    attributes: tuple[Parameter, ...]
    read: Callable[[Given, dict[str, Any]], Mapping[str, Any] | None]


def marker(name: str, about: str = "") -> Parameter:
    """Return the attribute that names a marker, ``i_marker_id``."""
    return Parameter(name, None, kind="id", about=about or f"marker {name[0].upper()}")


#: The attributes of a user's function.
USERS = Parameter("usrsub", kind="users function")
#: Attributes of vector forces that are expressions.
COMPONENTS = tuple(f"{name}_expression" for name in ("fx", "fy", "fz", "tx", "ty", "tz"))


class Adams(NamedTuple):
    """Adams' statement: its name, and for each word the attributes whose numbers it gives."""

    name: str
    words: Mapping[str, tuple[str, ...]] = {}


class Finding(NamedTuple):
    """What is wrong with an element, or only looks so."""

    message: str
    attribute: str = ""
    warns: bool = False


class Bounds(NamedTuple):
    """The largest stiffness and damping along any axis and about it, and what pulls at rest.

    With them the force may be taken as `force` + `stiffness` abs(d - rest). Of a scalar force
    stiffness and damping are by its own x, and the first of `rest` is x without load.
    """

    stiffness: float  # [F/L]
    turning_stiffness: float  # [F L/rad]
    damping: float
    turning_damping: float
    force: float = 0.0
    rest: Vector = (0.0, 0.0, 0.0)  # d without load


@dataclass(frozen=True)
class Form:
    """What a kind is, for those who fill rows of `Applied` and evaluate them."""

    #: Fields that are called from compiled code.
    COMPILED: ClassVar[tuple[str, ...]] = ()

    def is_rigid(self, values: Values) -> bool:
        """Return whether an element of these values is held by an equation while it sticks."""
        return False


@dataclass(frozen=True)
class Scalar(Form):
    """A force by one displacement and its rate, without branches."""

    acts: Callable[[Values], Acts]
    constants: Callable[[Values], Sequence[float]]
    force: Callable[..., Any]
    slopes: Callable[..., Any]
    bounds: Callable[[Sequence[float]], Bounds] | None = None

    COMPILED = ("force", "slopes")


@dataclass(frozen=True)
class Expressed(Form):
    """A force along a line or an axis, or about one, by an expression: the element's `expr`."""

    acts: Callable[[Values], Acts]
    alone: Callable[[Values], bool]  # whether nothing acts on J


@dataclass(frozen=True)
class Wrench(Form):
    """Force and torque by how I stands and moves as seen from J."""

    constants: Callable[[Values], Sequence[float]]
    wrench: Callable[..., Any]
    slopes: Callable[..., Any]
    bounds: Callable[[Sequence[float]], Bounds]

    COMPILED = ("wrench", "slopes")


@dataclass(frozen=True)
class Components(Form):
    """Force and torque by six expressions, the element's `exprs`."""

    alone: bool  # whether nothing acts on a second body
    known_as: str = ""  # the kind whose functions ask for it too


@dataclass(frozen=True)
class MultiPoint(Form):
    """Force and torque on each of several markers by how all of them stand and move."""


@dataclass(frozen=True)
class OfReactions(Form):
    """What follows from a joint's reactions: an entry of `Applied.form` by the joint's type."""

    forms: Mapping[str, int]
    law: str  # attribute that names its friction law


@dataclass(frozen=True)
class Switched(Form):
    """As `Scalar`, with branches; without `slopes` it is asked at neighbouring x and x'."""

    acts: Callable[[Values], Acts]
    constants: Callable[[Values], Sequence[float]]
    force: Callable[..., Any]
    side: Callable[..., Any]
    slopes: Callable[..., Any] | None = None
    commit: Callable[..., Any] | None = None
    law: str = ""  # attribute that names its normal law
    #: Attribute that is 0 where the force is rigid: what sticks is held by an equation.
    rigid_by: str = ""
    bounds: None = None

    def is_rigid(self, values: Values) -> bool:
        """Return whether `rigid_by` is 0."""
        return self.rigid_by != "" and values[self.rigid_by] == 0.0

    COMPILED = ("force", "side", "slopes", "commit")


@dataclass(frozen=True)
class OfResidual(Form):
    """Forces whose unknowns make a user's residual 0."""


_ORDER = (Scalar, Expressed, Wrench, Components, MultiPoint, OfReactions, Switched, OfResidual)


#: Of an element's values, and of its force and its torque at every row, (n, 3), a word a row.
Told = Callable[[Values, np.ndarray, np.ndarray], list[str]]


class ForceKind(NamedTuple):
    """A kind of applied forces; see `force`."""

    name: str
    statement: str
    path: str
    title: str
    form: Form
    parameters: tuple[Parameter, ...]
    check: Callable[[Values], Iterable[Finding]]
    functions: str
    adams: Adams | None
    table: str
    reading: Reading | None
    spellings: str
    changes: tuple[str, ...]
    refused: Mapping[str, str]
    told: Mapping[str, Told]
    about: str


FORCES: Registry[ForceKind] = Registry(
    "mbsim.forces.kinds", key=lambda kind: _ORDER.index(type(kind.form))
)


@functools.cache
@functools.cache
def table_of(name: str) -> str:
    """Return the field of `Model` that has elements of a kind, nothing where several share one."""
    return FORCES[name].table if name in FORCES else name


@functools.cache
def of_form(*forms: type[Form]) -> tuple[ForceKind, ...]:
    """Return the kinds of these forms."""
    return tuple(kind for name in FORCES if isinstance((kind := FORCES[name]).form, forms))


@functools.cache
def memories() -> tuple[ForceKind, ...]:
    """Return the kinds that remember something from step to step."""
    kinds = [FORCES[name] for name in FORCES]
    return tuple(kind for kind in kinds if isinstance(kind.form, Switched) and kind.form.commit)


def _nothing_wrong(values: Values) -> Iterable[Finding]:
    return ()


def force(
    name: str,
    statement: str,
    path: str,
    *parameters: Parameter,
    form: Form,
    title: str = "",
    check: Callable[[Values], Iterable[Finding]] = _nothing_wrong,
    functions: str = "",
    adams: Adams | None = None,
    table: str = "",
    reading: Reading | None = None,
    spellings: str = "",
    changes: str = "",
    refused: Mapping[str, str] | None = None,
    told: Mapping[str, Told] | None = None,
    about: str = "",
) -> None:
    """Register a kind of forces.

    Many arguments because all of these are the kind's own words.

    Parameters
    ----------
    name : str
        What requests and expressions call it: ``BUSHING``.
    statement : str
        The XML statement, which has `i_marker_id` and `j_marker_id` beside `parameters`.
    path : str
        The group of its signals in a result file: ``bushings``.
    form : Form
        What it does; see the head of this module.
    title : str, optional
        What an element is called on pictures, unless its name in small letters.
    check : callable, optional
        Yields what is wrong with the values of an element, all of which are there.
    functions : str, optional
        Its functions in expressions: ``BUSH(id, jflag, comp, marker)``.
    adams : Adams, optional
        The statement of an Adams deck.
    table : str, optional
        The field of `Model` that has its elements, where they are of a class of their own;
        otherwise they are `MarkerForce`.
    reading : Reading, optional
        How the statement of such elements is read.
    spellings : str, optional
        What requests may call it beside its name and its statement.
    changes : str, optional
        Attributes that may change between simulations.
    refused : mapping, optional
        Attributes that decks of others have and that are not taken, each with the reason.
    told : mapping, optional
        Words that `mbsim request` tells of each row, by the name of the signal: ``mode``.
    about : str, optional
        What it is, one line for the manual.
    """
    for each in fields(form):
        if each.name in form.COMPILED and getattr(form, each.name) is not None:
            jitable(getattr(form, each.name))
    made = ForceKind(
        name,
        statement,
        path,
        title or name.lower(),
        form,
        parameters,
        check,
        functions,
        adams,
        table,
        reading,
        spellings,
        tuple(changes.split()),
        refused or {},
        told or {},
        about,
    )
    FORCES.put(name, made)

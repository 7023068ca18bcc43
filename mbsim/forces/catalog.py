"""The registry of forces between two markers, and what a kind of them is.

A kind is a file in `forces/kinds`: attributes of its statement, formula, energy and slopes; nothing
in it is about arrays, XML or compilation. Its formula is ``wrench(motion, par)``, with `motion` a
`Motion` and `par` the array of constants that ``constants(values)`` makes of the attributes before
a run. It returns

    force [F], torque [F L] on I's body at I's origin, along J's axes; stored energy; lost power

and J's body takes the opposite at I's origin. What is stored is a function of displacements alone,
and force . v + torque . w + its rate + lost power = 0. ``slopes(motion, par, K, D)`` fills two
6 x 6 arrays of zeros with how (force, torque) fall as I moves along and turns about J's axes (K),
and with (v, w) (D). ``bounds(par)`` says what a method without error estimate has to follow.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from mbsim.core.jitable import jitable
from mbsim.core.registry import Registry

Vector = tuple[float, float, float]
Values = Mapping[str, Any]


class Motion(NamedTuple):
    """How marker I stands and moves as seen from marker J, along J's axes."""

    d: Vector  # I's origin from J's [L]
    theta: Vector  # rotation vector that turns J's axes into I's [rad], its length at most pi
    v: Vector  # velocity of I's origin against J's body there [L/T]
    w: Vector  # spin of I's body against J's [rad/T]


class Parameter(NamedTuple):
    """An attribute of the statement: a number, or `count` of them."""

    name: str
    default: Any = 0.0  # None: it must be given
    positive: bool = False  # else it may be 0 as well
    signed: bool = False  # else it may not be negative
    count: int = 1  # type: ignore[assignment]  # hides a method of tuples
    alias: str = ""
    about: str = ""  # its meaning, for the manual
    unit: str = ""


class Adams(NamedTuple):
    """Adams' statement: its name, and for each word the attributes whose numbers it gives."""

    name: str
    words: Mapping[str, tuple[str, ...]]


class Finding(NamedTuple):
    """What is wrong with an element, or only looks so."""

    message: str
    attribute: str = ""
    warns: bool = False


class Bounds(NamedTuple):
    """The largest stiffness and damping along any axis and about it, and what pulls at rest.

    With them the force may be taken as `force` + `stiffness` abs(d - rest).
    """

    stiffness: float  # [F/L]
    turning_stiffness: float  # [F L/rad]
    damping: float
    turning_damping: float
    force: float = 0.0
    rest: Vector = (0.0, 0.0, 0.0)  # d without load


class ForceKind(NamedTuple):
    """A kind of forces between two markers; see `force`."""

    name: str
    statement: str
    path: str
    title: str
    parameters: tuple[Parameter, ...]
    constants: Callable[[Values], Sequence[float]]
    wrench: Callable[..., Any]
    slopes: Callable[..., Any]
    bounds: Callable[[Sequence[float]], Bounds]
    check: Callable[[Values], Iterable[Finding]]
    function: str
    adams: Adams | None
    about: str


FORCES: Registry[ForceKind] = Registry("mbsim.forces.kinds")


def _nothing_wrong(values: Values) -> Iterable[Finding]:
    return ()


def force(
    name: str,
    statement: str,
    path: str,
    *parameters: Parameter,
    constants: Callable[[Values], Sequence[float]],
    wrench: Callable[..., Any],
    slopes: Callable[..., Any],
    bounds: Callable[[Sequence[float]], Bounds],
    check: Callable[[Values], Iterable[Finding]] = _nothing_wrong,
    function: str = "",
    adams: Adams | None = None,
    about: str = "",
) -> None:
    """Register a kind of forces.

    Parameters
    ----------
    name : str
        What requests and expressions call it: ``BUSHING``.
    statement : str
        The XML statement, which has `i_marker_id` and `j_marker_id` beside `parameters`.
    path : str
        The group of its signals in a result file: ``bushings``.
    constants, wrench, slopes, bounds
        See the head of this module; the two in the middle are compiled.
    check : callable, optional
        Yields what is wrong with the values of an element, all of which are there.
    function : str, optional
        Its function in expressions: ``BUSH(id, jflag, comp, marker)``.
    adams : Adams, optional
        The statement of an Adams deck.
    about : str, optional
        What it is, one line for the manual.
    """
    made = ForceKind(
        name,
        statement,
        path,
        name.lower(),
        parameters,
        constants,
        jitable(wrench),
        jitable(slopes),
        bounds,
        check,
        function,
        adams,
        about,
    )
    FORCES.put(name, made)

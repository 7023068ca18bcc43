"""The two registries of laws, and what a law is.

A normal law is ``law(depth, depth_rate, *constants)`` and returns three numbers: the force,
the force at rate 0 (the elastic part) and the energy stored, which is the integral of the
elastic part over depth. Power is lost at (force - elastic) * rate, and no law may make that
negative. A friction law is ``force(inputs, *parameters)`` with `inputs` a `FrictionInput`.
Parameters are attributes of Force_Contact, in the deck's words; those that one law alone has
are declared with it as a `Parameter`. Where the formula of a normal law takes other numbers than
the deck gives, ``constants(*parameters)`` makes them once, before the run. A law file is a formula
with its source; nothing in it is about arrays, XML or compilation.

A friction law with memory is ``force(inputs, memory, *parameters)``, `memory` being its own numbers
at the committed state, and returns

    (Fx, Fy, Mx, My, Tz, stored, mode, branch, size, unit), memory

the energy that it will give back, STICK or SLIP, and its numbers at the point asked for, which the
host keeps if the step is accepted. They are 0 at touch. Of these the first ``carried`` are
integrated: the law gets them at the point itself, and their rates follow behind the numbers to
keep. `size` is a usual size of what is integrated, `unit` the velocity as which an error of 1 in it
counts (the square root of stiffness over mass makes one of a stretch: the same energy).
A law with ``modes`` keeps to the committed `branch` within a step that is ``frozen``, and says
which branch the point asks for: `mode` and 4 times a number of its own. Steps end where that
changes, and what is integrated is then set to what the law keeps. Where the branch depends on how
fast N changes, which only the end of a step can tell, it says UNDECIDED, and is asked again with
that. One of the numbers that it keeps, `left`, may be how far the point is beyond the committed
branch, below 0 on it: smooth, so that the time of a change is soon found, and 0 where not known.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

from mbsim.core.jitable import jitable
from mbsim.core.registry import Registry

Vector = tuple[float, float, float]


class NormalLaw(NamedTuple):
    """A normal law, and the Force_Contact attributes from which its constants are made."""

    name: str
    law: Callable[..., tuple[float, float, float]]
    parameters: tuple[str, ...]
    constants: Callable[..., tuple[float, ...]]
    of_shapes: bool = False  # it needs the radii of what touches

    @property
    def takes(self) -> tuple[str, ...]:
        """Names of the constants that `law` takes after depth and depth rate."""
        code = self.law.__code__
        return code.co_varnames[2 : code.co_argcount]


class Parameter(NamedTuple):
    """An attribute of Force_Contact that a friction law brings with it."""

    name: str
    default: float | None = None  # None: it must be given
    positive: bool = False  # else it may be 0 as well
    ratio: bool = False  # a Poisson's ratio
    flag: bool = False  # TRUE or FALSE: 1 or 0
    needs: str = ""  # another attribute without which it means nothing
    infinite: bool = False  # it may be INFINITE: then `FrictionLaw.rigid` is the law
    about: str = ""  # its meaning, for the manual
    unit: str = ""
    usual: str = ""  # what a missing one means, where `default` does not say it


#: What a law with memory does: mode 0 says that it began.
BEGUN, STICK, SLIP = 0.0, 1.0, 2.0


#: Of `branch`: it depends on rates that were not given; times what a law's own number counts.
UNDECIDED, BRANCHES = -1.0, 4

#: What a law integrates follows no faster than so many times as fast as the mass that slips
#: would swing on it.
FASTEST = 1e3
#: An error of bristles counts as so many times the velocity of the same energy: where they do not
#: slip it is not forgotten.
LASTS = 8.0


class FrictionLaw(NamedTuple):
    """A friction law: its function, and the Force_Contact attributes it takes in order."""

    name: str
    force: Callable[..., Any]
    parameters: tuple[str, ...]
    own: tuple[Parameter, ...] = ()  # which of these are its own
    memory: int = 0  # numbers that it keeps
    carried: int = 0  # how many of these are integrated
    uses_x: bool = False  # whether it looks at X
    of_area: bool = False  # whether it is that of a whole area, with its torque against spin
    takes_function: bool = False  # whether a user's function may give its friction of sliding
    modes: bool = False  # whether it tells STICK from SLIP, so that steps end where that changes
    left: int = 0  # of modes: which number kept is how far it is beyond its branch, 0 for none
    rigid: FrictionLaw | None = None  # where what sticks is held by equations


class FrictionInput(NamedTuple):
    """What a friction law may look at, in the I incident marker, model units."""

    time: float  # [T]
    step: float  # time since the committed state [T]
    x: Vector  # deformation since touch: x, y [L], rotation about z [rad]
    xdot: Vector  # slip velocity of I relative to J: x, y [L/T], spin about z [rad/T]
    rolling: tuple[float, float]  # relative angular velocity about x and y [rad/T]
    nforce: float  # normal force [F], >= 0
    area: float  # of the contact patch [L^2], 0 for a point
    radius: float  # of the contact patch [L], 0 for a point
    loci: Vector  # contact point on I, from the graphic's marker, in its axes [L]
    locj: Vector  # the same on J
    dflag: float  # 1 where a derivative is being formed
    frozen: float  # 1 where a law with modes keeps to the committed one, to the end of the step
    stiffness: float  # of the normal force, by depth [F/L]; this and the next only with memory
    mass: float  # that slips, 1/(1/m_I + 1/m_J), a part for each point [M, such that F = m a]
    limit: float  # friction of the user's own function in sliding [F], NaN where there is none
    growth: float  # of that stiffness, over itself [1/T]
    nforce_rate: float  # of the normal force [F/T], NaN where it is not known
    limit_rate: float  # of `limit`, likewise
    stiffness_rate: float  # of `stiffness` [F/(L T)] where `growth` cannot know it, else NaN


Law = TypeVar("Law", bound=Callable[..., Any])

NORMAL_LAWS: Registry[NormalLaw] = Registry("mbsim.laws.normal")
FRICTION_LAWS: Registry[FrictionLaw] = Registry("mbsim.laws.friction")


def _as_given(*parameters: float) -> tuple[float, ...]:
    return parameters


def normal_law(
    name: str,
    *parameters: str,
    constants: Callable[..., tuple[float, ...]] = _as_given,
    of_shapes: bool = False,
) -> Callable[[Law], Law]:
    """Register the decorated function as the normal law `name` of these attributes."""

    def register(law: Law) -> Law:
        NORMAL_LAWS.put(name, NormalLaw(name, jitable(law), parameters, constants, of_shapes))
        return law

    return register


def friction_law(
    name: str,
    *parameters: str | Parameter,
    memory: int = 0,
    carried: int = 0,
    uses_x: bool = False,
    of_area: bool = False,
    takes_function: bool = False,
    modes: bool = False,
    left: int = 0,
    rigid: FrictionLaw | None = None,
) -> Callable[[Law], Law]:
    """Register the decorated function as the friction law `name` of these attributes."""

    def register(force: Law) -> Law:
        own = tuple(each for each in parameters if isinstance(each, Parameter))
        names = tuple(each.name if isinstance(each, Parameter) else each for each in parameters)
        made = jitable(force)
        law = FrictionLaw(
            name,
            made,
            names,
            own,
            memory,
            carried,
            uses_x,
            of_area,
            takes_function,
            modes,
            left,
            rigid,
        )
        FRICTION_LAWS.put(name, law)
        return force

    return register


def friction_law_of(contact: Any) -> FrictionLaw:
    """Return the built-in law of a Force_Contact, or what stands for it where it is rigid."""
    law = FRICTION_LAWS[contact.cff_type]
    return law.rigid if law.rigid is not None and contact.rigid else law

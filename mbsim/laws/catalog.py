"""The two registries of laws, and what a law is.

A normal law is ``law(depth, depth_rate, *constants)`` and returns three numbers: the force,
the force at rate 0 (the elastic part) and the energy stored, which is the integral of the
elastic part over depth. Power is lost at (force - elastic) * rate, and no law may make that
negative. A friction law is ``force(inputs, *parameters)`` with `inputs` a `FrictionInput`.
Parameters are attributes of Force_Contact, in the deck's words; where the formula of a normal
law takes other numbers than the deck gives, ``constants(*parameters)`` makes them once, before
the run. A law file is a formula with its source; nothing in it is about arrays, XML or
compilation.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from mbsim.core.jitable import jitable
from mbsim.core.registry import Registry

Vector = tuple[float, float, float]


class NormalLaw(NamedTuple):
    """A normal law, and the Force_Contact attributes from which its constants are made."""

    name: str
    law: Callable[..., tuple[float, float, float]]
    parameters: tuple[str, ...]
    constants: Callable[..., tuple[float, ...]]

    @property
    def takes(self) -> tuple[str, ...]:
        """Names of the constants that `law` takes after depth and depth rate."""
        code = self.law.__code__
        return code.co_varnames[2 : code.co_argcount]


class FrictionLaw(NamedTuple):
    """A friction law: its function, and the Force_Contact attributes it takes in order."""

    name: str
    force: Callable[..., tuple[float, float, float, float, float]]
    parameters: tuple[str, ...]


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


NORMAL_LAWS: Registry[NormalLaw] = Registry("mbsim.laws.normal")
FRICTION_LAWS: Registry[FrictionLaw] = Registry("mbsim.laws.friction")


def _as_given(*parameters: float) -> tuple[float, ...]:
    return parameters


def normal_law(
    name: str, *parameters: str, constants: Callable[..., tuple[float, ...]] = _as_given
) -> Any:
    """Register the decorated function as the normal law `name` of these attributes."""

    def register(law: Callable[..., Any]) -> Callable[..., Any]:
        NORMAL_LAWS.put(name, NormalLaw(name, jitable(law), parameters, constants))
        return law

    return register


def friction_law(name: str, *parameters: str) -> Any:
    """Register the decorated function as the friction law `name` of these attributes."""

    def register(force: Callable[..., Any]) -> Callable[..., Any]:
        FRICTION_LAWS.put(name, FrictionLaw(name, jitable(force), parameters))
        return force

    return register

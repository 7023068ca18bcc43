"""The two registries of laws, and what a law is.

A normal law is ``force(depth, depth_rate, *parameters)`` with, beside it, the energy
``energy(depth, *parameters)`` that it stores at rest. A friction law is
``force(inputs, *parameters)`` with `inputs` a `FrictionInput`. Parameters are
attributes of Force_Contact, in the deck's words. A law file is a formula with
its source; nothing in it is about arrays, XML or compilation.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from mbsim.core.jitable import jitable
from mbsim.core.registry import Registry

Vector = tuple[float, float, float]


class NormalLaw(NamedTuple):
    """A normal law: its functions, and the Force_Contact attributes they take in order."""

    name: str
    force: Callable[..., float]
    energy: Callable[..., float]
    parameters: tuple[str, ...]


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


def normal_law(name: str, *parameters: str, energy: Callable[..., float]) -> Any:
    """Register the decorated function as the normal law `name` of these attributes."""

    def register(force: Callable[..., float]) -> Callable[..., float]:
        jitable(force)
        jitable(energy)
        NORMAL_LAWS.put(name, NormalLaw(name, force, energy, parameters))
        return force

    return register


def friction_law(name: str, *parameters: str) -> Any:
    """Register the decorated function as the friction law `name` of these attributes."""

    def register(force: Callable[..., Any]) -> Callable[..., Any]:
        FRICTION_LAWS.put(name, FrictionLaw(name, jitable(force), parameters))
        return force

    return register

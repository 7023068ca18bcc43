"""What formulas of applied forces are given, and what they may ask: see `forces.catalog`."""

from __future__ import annotations

from enum import IntEnum
from typing import Any, NamedTuple

Vector = tuple[float, float, float]


class Motion(NamedTuple):
    """How marker I stands and moves as seen from marker J, along J's axes."""

    d: Vector  # I's origin from J's [L]
    theta: Vector  # rotation vector that turns J's axes into I's [rad], its length at most pi
    v: Vector  # velocity of I's origin against J's body there [L/T]
    w: Vector  # spin of I's body against J's [rad/T]


class Kept(NamedTuple):
    """What a switched force remembers."""

    slider: float  # no number before the first step
    mode: float  # 0, or the sign of what slides
    frozen: float  # 1 where it keeps its mode within a step


class Asked(IntEnum):
    """What the formula of a scalar force is asked for."""

    FORCE = 0
    SIDE = 1
    COMMIT = 2


def ask(law: Any, depth: float, rate: float) -> tuple[float, float, float]:
    """Return what a normal law makes of depth and its rate: force, that at rate 0, stored energy.

    Compiled code has its own form of this: `forces.abi`.
    """
    force, elastic, stored = law(depth, rate)
    return force, elastic, stored

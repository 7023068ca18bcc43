"""UNIVERSAL: the origins coincide, the z-axes of I and J (the cross) stay at right angles."""

from __future__ import annotations

from mbsim.joints.catalog import joint, offset, perp

joint("UNIVERSAL", offset("x"), offset("y"), offset("z"), perp("z", "z"))

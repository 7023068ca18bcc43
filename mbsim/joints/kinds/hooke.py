"""HOOKE: as UNIVERSAL, but the cross is I's x-axis and J's y-axis; the z-axes are the shafts."""

from __future__ import annotations

from mbsim.joints.catalog import joint, offset, perp

joint("HOOKE", offset("x"), offset("y"), offset("z"), perp("x", "y"))

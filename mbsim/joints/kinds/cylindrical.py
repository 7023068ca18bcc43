"""CYLINDRICAL: I slides along the common z-axis and turns about it."""

from __future__ import annotations

from mbsim.joints.catalog import joint, offset, perp

joint("CYLINDRICAL", offset("x"), offset("y"), perp("z", "x"), perp("z", "y"), moves=("R", "T"))

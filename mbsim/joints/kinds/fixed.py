"""FIXED: I stays where it is on J."""

from __future__ import annotations

from mbsim.joints.catalog import joint, offset, perp

joint(
    "FIXED", offset("x"), offset("y"), offset("z"), perp("z", "x"), perp("z", "y"), perp("x", "y")
)

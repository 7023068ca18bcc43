"""TRANSLATIONAL: I slides along the common z-axis and does not turn."""

from __future__ import annotations

from mbsim.joints.catalog import joint, offset, perp

joint(
    "TRANSLATIONAL",
    offset("x"),
    offset("y"),
    perp("z", "x"),
    perp("z", "y"),
    perp("x", "y"),
    moves=("T",),
)

"""REVOLUTE: I turns about the common z-axis."""

from __future__ import annotations

from mbsim.joints.catalog import joint, offset, perp

joint(
    "REVOLUTE", offset("x"), offset("y"), offset("z"), perp("z", "x"), perp("z", "y"), moves=("R",)
)

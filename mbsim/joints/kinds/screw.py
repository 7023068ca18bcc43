"""SCREW: I turns about the common z-axis and moves along it by `pitch` a turn (right-handed)."""

from __future__ import annotations

import math

from mbsim.joints.catalog import angle, joint, offset, perp

joint(
    "SCREW",
    offset("x"),
    offset("y"),
    perp("z", "x"),
    perp("z", "y"),
    (offset("z"), angle().times(lambda joint: -joint.pitch / (2.0 * math.pi))),
    needs=("pitch",),
)

"""PARALLEL_AXES: the z-axes of I and J stay parallel."""

from __future__ import annotations

from mbsim.joints.catalog import joint, perp

joint("PARALLEL_AXES", perp("z", "x"), perp("z", "y"))

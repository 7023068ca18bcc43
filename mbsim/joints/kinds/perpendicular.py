"""PERPENDICULAR: the z-axes of I and J stay at right angles."""

from __future__ import annotations

from mbsim.joints.catalog import joint, perp

joint("PERPENDICULAR", perp("z", "z"))

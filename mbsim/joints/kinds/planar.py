"""PLANAR: I's origin and xy-plane stay in the xy-plane of J."""

from __future__ import annotations

from mbsim.joints.catalog import joint, offset, perp

joint("PLANAR", offset("z"), perp("z", "x"), perp("z", "y"))

"""ORIENTATION: I does not turn against J."""

from __future__ import annotations

from mbsim.joints.catalog import joint, perp

joint("ORIENTATION", perp("z", "x"), perp("z", "y"), perp("x", "y"))

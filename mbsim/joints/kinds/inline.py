"""INLINE: I's origin stays on J's z-axis."""

from __future__ import annotations

from mbsim.joints.catalog import joint, offset

joint("INLINE", offset("x"), offset("y"))

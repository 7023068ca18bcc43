"""RACK_PINION: turning about I's z moves I along J's z by half of `pitch_diameter` a radian."""

from __future__ import annotations

from mbsim.joints.catalog import joint, offset, spin

joint(
    "RACK_PINION",
    (offset("z"), spin().times(lambda joint: -0.5 * joint.pitch_diameter)),
    needs=("pitch_diameter",),
)

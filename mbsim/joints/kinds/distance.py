"""DISTANCE: the origins keep their distance, or have that of `length`."""

from __future__ import annotations

from mbsim.joints.catalog import distance, joint

joint("DISTANCE", distance(), value=lambda joint: joint.length)

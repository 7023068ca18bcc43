"""INPLANE: I's origin stays in J's xy-plane."""

from __future__ import annotations

from mbsim.joints.catalog import joint, offset

joint("INPLANE", offset("z"))

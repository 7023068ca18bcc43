"""SPHERICAL (Adams: JPRIM ATPOINT too): the origins coincide."""

from __future__ import annotations

from mbsim.joints.catalog import joint, offset

joint("SPHERICAL", offset("x"), offset("y"), offset("z"))

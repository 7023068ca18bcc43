"""CONSTANT_VELOCITY: the origins coincide, and spin about I's z passes on as spin about J's z.

The rotation from J to I is a bend of the shafts about some axis in J's xy-plane and no twist:
for those, and only those, the xy-block of the rotation matrix is symmetric.
"""

from __future__ import annotations

from mbsim.joints.catalog import joint, offset, perp

joint(
    "CONSTANT_VELOCITY",
    offset("x"),
    offset("y"),
    offset("z"),
    (perp("x", "y"), perp("y", "x").times(-1.0)),
)

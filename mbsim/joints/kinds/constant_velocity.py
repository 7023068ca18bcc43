"""CONSTANT_VELOCITY: the origins coincide, and spin about I's z passes on as spin about J's z.

The rotation from J to I is a bend of the shafts about some axis in J's xy-plane and no twist. Its
quaternion (w, x, y, z) then has z = 0, a surface that is smooth at every bend. The difference of
the rotation matrix' entries xy and yx, 4 w z, would not do: it vanishes as well where the shafts
are folded back onto each other, w = 0, and its gradient with it.
"""

from __future__ import annotations

from mbsim.joints.catalog import joint, offset, twist

joint(
    "CONSTANT_VELOCITY",
    offset("x"),
    offset("y"),
    offset("z"),
    twist(),
)

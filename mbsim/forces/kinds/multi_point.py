"""Force_MultiPoint, Adams' NFORCE: linear forces and torques of the displacements of many markers.

With q_k = (d, theta) - length of marker k - d along J's axes, theta the rotation vector of the
marker in J - and u_k = (v, w), it exerts on marker k, at its origin,

    F_k = F0_k - (K q)_dk - (C u)_vk     T_k = T0_k - J(theta_k)^-T (K q)_thetak - (C u)_wk

with K and C of all markers, and on J's body the opposite there. Of one marker it is a Force_Field,
and what is said of its energy holds here of q of all. Each marker has a row of its own.
"""

from __future__ import annotations

from mbsim.forces.catalog import Adams, MultiPoint, force

#: The id of the force on marker k, from 1, is this many times that of the element, and k.
ROWS = 1000

force(
    "NFORCE",
    "Force_MultiPoint",
    "multi_point_forces",
    form=MultiPoint(),
    title="multi-point force",
    adams=Adams("NFORCE"),
    about="linear forces and torques between many markers",
)

"""Force_Vector_TwoBody, Adams' VFORCE, VTORQUE and GFORCE, and Force_Vector_OneBody.

Six expressions are force and torque on I along the axes of the reference marker (none and 0:
global). Of two bodies, that of the floating J marker takes the opposite at the origin of I,
wherever that marker is; of one, nothing does.
"""

from __future__ import annotations

from mbsim.forces.catalog import Adams, Components, force

force(
    "VECTORFORCE",
    "Force_Vector_TwoBody",
    "vector_forces",
    form=Components(alone=False),
    title="vector force",
    functions="VFORCE VTORQ GFORCE",
    adams=Adams("GFORCE"),
    table="vector_forces",
    spellings="VFORCE VTORQUE GFORCE",
)
force(
    "BODYFORCE",
    "Force_Vector_OneBody",
    "body_forces",
    form=Components(alone=True),
    title="body force",
    table="body_forces",
)

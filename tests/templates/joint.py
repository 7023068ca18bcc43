"""PIN_IN_SLOT: I's origin slides along J's x-axis, and I turns about the common z-axis.

Template of a joint: copy it into mbsim/joints/kinds/ and change name and equations; each is a row
of the table in `joints.catalog`, or a sum of rows.
"""

from __future__ import annotations

from mbsim.joints.catalog import joint, offset, perp

joint("PIN_IN_SLOT", offset("y"), offset("z"), perp("z", "x"), perp("z", "y"))

"""Force_Element (ours): forces along and about axes of J by a user's residual.

What it exerts are unknowns of its own, which the residual makes 0; they, their slopes and what is
kept of a step are in `dynamics.forces.force_element` and `dynamics.linearization.element_slopes`.
"""

from __future__ import annotations

from mbsim.forces.catalog import OfResidual, force

force(
    "FORCEELEMENT",
    "Force_Element",
    "force_elements",
    form=OfResidual(),
    title="force element",
    table="force_elements",
)

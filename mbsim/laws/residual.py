"""Residuals of Force_Element: what their unknowns may be, and how numbers go in and out of them.

    int64 residual(int64 id, const double *in, const double *par, double *out)

as a friction law (`laws.abi.FRICTION_SIGNATURE`); in: time, x and x' along every direction, f and
f' of every unknown; out: as many numbers as there are unknowns.
"""

from __future__ import annotations

#: What an unknown is: f follows from r = 0; f' does, and f is a state; it changes between the two.
ALGEBRAIC, DIFFERENTIAL, SWITCHING = range(3)
KINDS = ("ALGEBRAIC", "DIFFERENTIAL", "SWITCHING")

#: Unknowns of one element at most.
MOST_UNKNOWNS = 12


def inputs(axes: int, unknowns: int) -> int:
    """Return how many numbers go in."""
    return 1 + 2 * axes + 2 * unknowns

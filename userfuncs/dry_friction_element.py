"""Dry friction as an element of the user's own: what Force_DryFriction with dx > 0 is.

A spring k = F/dx in series with a slider that gives way at F. In stick the spring takes all of the
motion, f' = k x'; in slip f stays at F or -F. Both are one equation,

    f = clip(f + r (x' - f'/k), -F, F)        for any r > 0,

which holds if either abs(f) < F and x' = f'/k, or f = F and x' >= f'/k, or f = -F and x' <= f'/k.

In a deck:  <Force_Element id="7" i_marker_id="20" j_marker_id="10" direction="TX"
  script_name="dry_friction_element.py" usrsub_fnc_name="dry_friction"
  usrsub_param_string="USER(1.0, 0.02)"/>
"""

ELEMENT_UNKNOWNS = {"dry_friction": {"f": 0.0}}


def dry_friction(x, xdot, f, fdot, t, par):
    """par: the force of slip F and what the spring gives until it reaches it, dx."""
    friction, dx = par[0], par[1]
    push = f[0] + friction * (xdot[0] - fdot[0] * dx / friction)
    return [f[0] - max(-friction, min(friction, push))]

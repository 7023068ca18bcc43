"""Slip that stops for a millisecond and goes on the same way, within one step of a method."""

from __future__ import annotations

import pytest

from helpers.decks import GROUND, run_deck

#: A unit mass slides by v = C (t - T)^2 - C HOLD^2, and would turn round for a moment about T.
C, T, HOLD, END = 10.0, 0.5037, 1.6e-3, 1.0
MU, WEIGHT = 0.3, 9.81

BLOCK = f"""
<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="0.004" inertia_yy="0.004" inertia_zz="0.004"
  v_ic_x="{C * (T**2 - HOLD**2)!r}" v_ic_x_flag="TRUE"/>
<Reference_Marker id="20" body_id="2" pos_z="{0.1 - WEIGHT / 1e5!r}"/>
<Force_Vector_OneBody id="5" type="ForceOnly" marker_id="20" ref_marker_id="10"
  fx_expression="{MU * WEIGHT!r}+{2.0 * C!r}*(TIME-{T!r})" fy_expression="0" fz_expression="0"/>"""

#: It does not turn, and lies on a contact that is at rest.
LYING = """
<Post_Graphic id="200" type="Sphere" center_marker_id="20" radius="0.1"/>
<Constraint_Joint id="1" type="ORIENTATION" i_marker_id="20" j_marker_id="10"/>
<Force_Gravity grav_z="-9.81"/>
<Force_Contact id="301" num_i_graphics="1" i_graphics_id="200" num_j_graphics="1"
  j_graphics_id="100" cnf_type="IMPACT" stiffness="1e5" exponent="1" damping="30" dmax="1e-5"
  cff_type="STICTION" mu_static="0.3" mu_dynamic="0.3" tangential_stiffness="{}"/>"""
#: It floats, and a dry friction along x has the force of one that lies.
DRY = f"""
<Force_DryFriction id="1" type="TX" i_marker_id="20" j_marker_id="10"
  friction="{MU * WEIGHT!r}" dx="{{}}"/>"""

FRICTION = {
    "spring": LYING.format("1e8"),
    "rigid": LYING.format("INFINITE"),
    "dry": DRY.format("3e-8"),
    "dry_rigid": DRY.format("0"),
}


def place(t):
    """Return where it is: it stops at T - HOLD, and goes on at T, where the force is mu N again."""
    stopped = C * ((T**3 - HOLD**3) / 3.0 - HOLD**2 * (T - HOLD))
    return stopped + C * (t - T) ** 3 / 3.0


@pytest.mark.parametrize(
    ("friction", "method"),
    [(one, method) for one in ("spring", "dry") for method in ("DOPRI5", "DOP853", "RADAU5")]
    # what has no give is for implicit methods
    + [("rigid", "RADAU5"), ("dry_rigid", "RADAU5")],
)
def test_slip_that_stops_for_a_moment_within_a_step_sticks(tmp_path, friction, method):
    """A stick that is missed costs C HOLD^2 (END - T) = 1.3e-5 m."""
    for tol in (1e-6, 1e-7):
        model = GROUND + BLOCK + FRICTION[friction]
        results = run_deck(tmp_path, model, END, 0.1, integrator=method, tol=tol)
        sticks = [float(e["time"]) for e in results["events"] if str(e["kind"]) == "stick"]
        assert sticks, tol
        assert sticks[0] == pytest.approx(T - HOLD, abs=1e-4)
        if friction != "dry":
            # its spring has no damper, and swings: how it slips on depends on when
            off = results["bodies/2/position"][-1, 0] - place(END)
            assert abs(off) < max(tol, 2e-7), tol

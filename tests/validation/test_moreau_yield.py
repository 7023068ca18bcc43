"""MOREAU: friction that yields or begins to hold within a step, by the slip it does so from."""

from __future__ import annotations

import math

import pytest

import mbsim
from mbsim.core.blend import step

MU_STATIC, MU_DYNAMIC, BEGINS = 0.5, 0.3, 0.15
H, PRESSED = 0.01, 100.0
DECK = """<MotionSolve><Model><Body_Rigid id="1" isground="TRUE"/>
<Reference_Marker id="10" body_id="1"/><Post_Graphic id="10" type="Plane" rm_id="10"/>
<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="0.01" inertia_yy="0.01" inertia_zz="0.01"/>
<Reference_Marker id="20" body_id="2" pos_z="0.05"/><Reference_Marker id="21" body_id="2"/>
<Post_Graphic id="20" type="BoxDefinedFromCenter" center_marker_id="20" length_x="1" length_y="1"
  length_z="0.1"/>
<Force_Contact id="300" i_graphics_id="20" j_graphics_id="10" cnf_type="POISSON" penalty="1e6"
  restitution_coef="0" normal_trans_vel="0.01" cff_type="COULOMB_ON" mu_static="{mu_static}"
  mu_dynamic="{mu_dynamic}" stiction_trans_vel="{begins}" friction_trans_vel="{ends}"/>
<Force_Vector_OneBody id="1" type="ForceOnly" i_marker_id="21" fx_expression="{pull}"
  fz_expression="-{pressed}"/>
<Param_Transient integrator_type="MOREAU" h_max="{h}" h_min="{h}"/></Model>
<Command><Simulate analysis_type="Transient" end_time="{h}" print_interval="{h}"/></Command>
</MotionSolve>"""


@pytest.mark.parametrize("pull", [60.0, 65.0, 70.0, 80.0])
@pytest.mark.parametrize("slope", [0.5, 0.8, 0.95])
def test_friction_that_yields_is_that_of_its_slip(slope: float, pull: float) -> None:
    """A box of 1 kg at rest is pulled for one step, and comes to v = h (pull - mu(v) pressed).

    A coefficient that is lower makes it slip faster, which lowers it by `slope` of that where it is
    steepest: it takes many tries to find it. The law's first solution from rest counts.
    """
    ends = BEGINS + 1.5 * (MU_STATIC - MU_DYNAMIC) * H * PRESSED / slope
    numbers = {"mu_static": MU_STATIC, "mu_dynamic": MU_DYNAMIC, "begins": BEGINS, "ends": ends}
    deck = DECK.format(pull=pull, pressed=PRESSED, h=H, **numbers)
    results = mbsim.simulate(deck, tol=1e-6)
    v = H * (pull - MU_STATIC * PRESSED)
    for _ in range(5000):
        v = H * (pull - PRESSED * step(v, BEGINS, MU_STATIC, ends, MU_DYNAMIC))
    assert results["bodies/2/velocity"][-1, 0] == pytest.approx(v, rel=5e-4)
    assert not [said for said in results.audit.warnings if "mu N" in said]


G, TANGENT, SPEEDS = 9.81, 0.8, (0.3, 1.0)
LAWS = {
    "COULOMB_ON": 'cff_type="COULOMB_ON" stiction_trans_vel="1e-3" friction_trans_vel="1.5e-3"',
    "STICTION": 'cff_type="STICTION" tangential_stiffness="2.5e5"',
}
SLOPE = """<MotionSolve><Model><Body_Rigid id="1" isground="TRUE"/>
<Reference_Marker id="10" body_id="1"/><Post_Graphic id="10" type="Plane" rm_id="10"/>
<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="0.01" inertia_yy="0.01" inertia_zz="0.01"
  v_ic_x="{speed}" v_ic_x_flag="TRUE"/><Reference_Marker id="20" body_id="2" pos_z="0.1"/>
<Post_Graphic id="20" type="BoxDefinedFromCenter" center_marker_id="20" length_x="0.2"
  length_y="0.2" length_z="0.2"/>
<Force_Contact id="300" i_graphics_id="20" j_graphics_id="10" cnf_type="IMPACT" stiffness="1e6"
  exponent="1" damping="300" dmax="1e-5" mu_static="1" mu_dynamic="0.5" {law}/>
<Force_Gravity grav_x="{along}" grav_z="{across}"/>
<Param_Transient integrator_type="MOREAU" {steps}/></Model>
<Command><Simulate analysis_type="Transient" end_time="1" print_interval="0.01"/></Command>
</MotionSolve>"""


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("speed", SPEEDS)
def test_a_box_thrown_uphill_stays_where_it_stops(law: str, speed: float) -> None:
    """On a slope steeper than sliding friction holds, and less steep than sticking friction does.

    It stops at v^2 / 2a, a = g (sin + mu_d cos). By error that holds to a part of the tolerance, in
    steps of h to what it slows down by within one.
    """
    size = math.hypot(1.0, TANGENT)
    along, across = -G * TANGENT / size, -G / size
    slows = -along - 0.5 * across
    stops = speed * speed / (2.0 * slows)

    def found(steps: str) -> float:
        parts = {"speed": speed, "law": LAWS[law], "along": along, "across": across}
        results = mbsim.simulate(SLOPE.format(steps=steps, **parts))
        return float(results["bodies/2/position"][-1, 0])

    for tol in (1e-3, 1e-4, 1e-5, 1e-6):
        x = found(f'integr_tol="{tol}"')
        assert x == pytest.approx(stops, rel=0.0, abs=0.2 * tol), f"tol {tol}"
    for h in (0.02, 0.01, 0.003, 0.001):
        x = found(f'h_max="{h}" h_min="{h}"')
        assert x == pytest.approx(stops, rel=0.0, abs=0.5 * slows * h * h), f"h {h}"

"""MOREAU: friction that yields within a step is that of the slip it yields to."""

from __future__ import annotations

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

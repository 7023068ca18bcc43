"""Derivatives through a touch that is no deeper than sides of a difference are apart."""

from __future__ import annotations

import math

import pytest

import mbsim

GRAVITY, STIFFNESS, FALL = 9.81, 1e8, 0.9
#: A ball of 1 kg that is thrown at a plane, while gravity pulls it away: it turns just within it.
DECK = """<MotionSolve><Model>
<Param_Unit force_unit="NEWTON" mass_unit="KILOGRAM" length_unit="METER" time_unit="SECOND"/>
<Body_Rigid id="1" isground="TRUE"/>
<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="0.004" inertia_yy="0.004" inertia_zz="0.004"
  v_ic_z="{speed!r}" v_ic_z_flag="TRUE"/>
<Reference_Marker id="10" body_id="1" pos_z="1"/>
<Reference_Marker id="20" body_id="2" pos_z="2"/>
<Post_Graphic id="100" type="Plane" rm_id="10"/>
<Post_Graphic id="200" type="Sphere" center_marker_id="20" radius="0.1"/>
<Force_Contact id="301"
  num_i_graphics="1" i_graphics_id="200" num_j_graphics="1" j_graphics_id="100"
  cnf_type="IMPACT" stiffness="1e8" exponent="1.5" damping="0" dmax="1e-4" cff_type="COULOMB_OFF"/>
<Force_Gravity grav_z="9.81"/>
</Model><Command>
<Simulate analysis_type="Transient" end_time="0.9" print_interval="0.1"/>
</Command></MotionSolve>"""


@pytest.mark.parametrize("integrator", ["DOPRI5", "RADAU5"])
@pytest.mark.parametrize("deep", [3e-8, 1e-8])
def test_a_ball_that_grazes_a_plane(integrator, deep):
    # without the plane the speed grows as it begins; the plane adds the integral of
    # k (deep - g t^2 / 2)^(3/2), which is far less than gravity does
    speed = -math.sqrt(2.0 * GRAVITY * (FALL + deep))
    pushed = STIFFNESS * deep**1.5 * math.sqrt(2.0 * deep / GRAVITY) * 3.0 * math.pi / 8.0
    expected = 1.0 + 2.0 * pushed / deep * speed / GRAVITY
    name = "Body_Rigid[2].v_ic_z"
    run = mbsim.simulate(
        DECK.format(speed=speed), integrator=integrator, tol=1e-9, sensitivity=[name]
    )
    found = run.sensitivity("bodies/2/velocity/z", name)[-1]
    assert found == pytest.approx(expected, abs=0.01 * (1.0 - expected))

"""MOREAU: what sticks to a surface that a motion drives goes where that surface does."""

from __future__ import annotations

import numpy as np
import pytest

import mbsim

MU_STATIC, MU_DYNAMIC, G = 0.9, 0.3, 10.0
SHAPES = {
    "box": 'type="BoxDefinedFromCenter" center_marker_id="20" length_x="0.2" length_y="0.2" '
    'length_z="0.2"',
    "cylinder": 'type="Cylinder" center_marker_id="21" radius="0.1" length="0.2"',
}
TURNED = 'psi="1.5707963267948966" theta="1.5707963267948966"'
DECK = """<MotionSolve><Model><Body_Rigid id="1" isground="TRUE"/>
<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="0.01" inertia_yy="0.01" inertia_zz="0.01"/>
<Body_Rigid id="3" cg_id="30" mass="1" inertia_xx="0.01" inertia_yy="0.01" inertia_zz="0.01"/>
<Reference_Marker id="10" body_id="1" {turned}/>
<Reference_Marker id="20" body_id="2" pos_x="{x}" pos_z="0.1"/>
<Reference_Marker id="21" body_id="2" pos_x="{x}"/>
<Reference_Marker id="30" body_id="3"/><Reference_Marker id="31" body_id="3" {turned}/>
<Post_Graphic id="100" type="Plane" rm_id="30"/><Post_Graphic id="200" {shape}/>
<Constraint_Joint id="501" type="{joint}" i_marker_id="31" j_marker_id="10"/>
<Motion_Joint id="502" joint_id="501" val_type="{kind}" expr="{expr}"/>
<Force_Contact id="301" i_graphics_id="200" j_graphics_id="100" cnf_type="IMPACT" stiffness="1e6"
  exponent="1" damping="300" dmax="1e-5" cff_type="STICTION" mu_static="{mu_static}"
  mu_dynamic="{mu_dynamic}" tangential_stiffness="2.5e6"/>
<Force_Gravity grav_z="-10"/>
<Param_Transient integrator_type="MOREAU" {steps}/></Model>
<Command><Simulate analysis_type="Transient" end_time="{end}" print_interval="0.01"/></Command>
</MotionSolve>"""


def place(shape: str, x: float, turned: str, joint: str, motion: tuple[str, str], steps: str):
    """Return the last position of a body on the surface (x, y, z), and its run's warnings."""
    numbers = {"mu_static": MU_STATIC, "mu_dynamic": MU_DYNAMIC, "end": 3.0}
    parts = {"shape": SHAPES[shape], "turned": turned, "joint": joint, "x": x, "steps": steps}
    deck = DECK.format(kind=motion[0], expr=motion[1], **numbers, **parts)
    results = mbsim.simulate(deck)
    return results["bodies/2/position"][-1], results.audit.warnings


def steps_of(tol: float | None, h: float | None) -> str:
    """Return the attributes of a run by error, or in steps of one length."""
    return f'integr_tol="{tol}"' if h is None else f'h_max="{h}" h_min="{h}"'


def carried(amplitude: float, w: float) -> float:
    """Return x at 3 s of what begins at rest on a plate at amplitude sin(w t).

    It slides at first. Where it stops on the plate it sticks, as long as that asks for no more than
    sticking friction; between these events velocities are linear in time. Steps of 1e-5 s, each
    exact but for when an event is within one.
    """
    t = np.linspace(0.0, 3.0, 300001)
    dt, plate = t[1], amplitude * w * np.cos(w * t)
    asked = amplitude * w * w * np.abs(np.sin(w * t))
    x, v, sticks = 0.0, 0.0, False
    for k in range(len(t) - 1):
        sticks = sticks and asked[k] <= MU_STATIC * G
        if sticks:
            new = plate[k + 1]
        else:
            side = np.sign(plate[k] - v)
            new = v + side * MU_DYNAMIC * G * dt
            if (plate[k + 1] - new) * side <= 0.0 and asked[k] <= MU_STATIC * G:
                sticks, new = True, plate[k + 1]
        x += 0.5 * dt * (v + new)
        v = new
    return float(x)


@pytest.mark.parametrize(("amplitude", "w"), [(0.05, 13.0), (0.2, 6.0)])
def test_a_box_sticks_to_a_plate_that_shakes(amplitude: float, w: float) -> None:
    """As far as friction holds it, by error to a part of the tolerance, and in fixed steps."""
    x = carried(amplitude, w)
    motion = "D", f"{amplitude}*SIN({w}*TIME)"
    for tol, h, most in [
        (1e-3, None, 1e-3),
        (1e-4, None, 2e-4),
        (1e-5, None, 3e-5),
        (None, 0.01, 1e-3),
        (None, 0.003, 1e-4),
        (None, 0.001, 3e-5),
    ]:
        at, warnings = place("box", 0.0, TURNED, "TRANSLATIONAL", motion, steps_of(tol, h))
        assert at[0] == pytest.approx(x, rel=0.0, abs=most), (tol, h)
        assert warnings == ()


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("motion", [("D", "IF(TIME-1:1.5*TIME*TIME,1.5,1.5+3*(TIME-1))"),
                                    ("V", "IF(TIME-1:3*TIME,3,3)")])  # fmt: skip
def test_a_body_sticks_to_a_turntable(shape: str, motion: tuple[str, str]) -> None:
    """It goes round with the table, at its radius: order 2 in the step, by error to the tolerance.

    Sticking friction is twice what the turn asks for, sliding friction less than that.
    """
    turned = 1.5 + 3.0 * 2.0
    exact = 0.5 * np.array([np.cos(turned), np.sin(turned)])

    def off(tol: float | None, h: float | None) -> float:
        at, _ = place(shape, 0.5, "", "REVOLUTE", motion, steps_of(tol, h))
        return float(np.abs(at[:2] - exact).max())

    for tol in (1e-3, 1e-4, 1e-5):
        assert off(tol, None) < 5.0 * tol
    coarse, fine = off(None, 0.02), off(None, 0.005)
    assert coarse < 0.01
    assert fine < coarse / 10.0

"""Springs whose law is an expression, as in Project Chrono's TranSpringCB and RotSpring cases.

The folder of Adams curves has no nonlinear one; an independent integration (`mechanics`) stands in.
"""

from __future__ import annotations

import numpy as np
import pytest

from helpers import mechanics as mech
from helpers.decks import run_deck

G = (0.0, 0.0, -9.80665)
BAR = (0.04, 0.1, 0.1)
HALF = np.pi / 2
DOWN = mech.euler313(180, 90, 180)
TURNED = f'psi="{np.pi!r}" theta="{HALF!r}" phi="{np.pi!r}"'
BODY = """
<Body_Rigid id="1" isground="TRUE"/><Force_Gravity grav_z="-9.80665"/>
<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="0.04" inertia_yy="0.1" inertia_zz="0.1"/>
"""
TOLS = pytest.mark.parametrize(("tol", "allowed"), [(1e-5, 3e-4), (1e-10, 1e-8)])


def along(force):
    """Return a law of `mechanics`: `force(r, rate)` pushes I and J apart."""

    def law(I, J, t):
        d = I.p.v - J.p.v
        r = np.sqrt(d @ d)
        return force(r, (I.p.d - J.p.d) @ d / r) * d / r, np.zeros(3)

    return law


def about(torque):
    """Return a law of `mechanics`: `torque(angle, rate)` turns I about J's z."""

    def law(I, J, t):
        rate = (I.w.d - J.w.d) @ J.z.v
        return np.zeros(3), torque(mech.relative_angle(I, J).v, rate) * J.z.v

    return law


def check(results, solution, allowed):
    """Compare place, velocity and attitude at all rows."""
    reach = np.abs(solution.position(1)).max()
    assert np.abs(results["bodies/2/position"] - solution.position(1)).max() < allowed * reach
    speed = np.abs(solution.velocity(1)).max()
    assert np.abs(results["bodies/2/velocity"] - solution.velocity(1)).max() < allowed * speed
    q, exact = results["bodies/2/quaternion"], solution.quaternion(1)
    q = q * np.sign((q * exact).sum(axis=1))[:, None]
    assert np.abs(q - exact).max() < allowed
    parts = [results[f"energy/{part}"] for part in ("kinetic", "potential", "dissipated")]
    total = sum(parts)
    assert np.abs(total - total[0]).max() < 3 * allowed * parts[0].max()


@TOLS
def test_hardening_spring_with_a_square_damper(tol, allowed, tmp_path):
    # off the cg, so that the bar turns
    deck = """
<Reference_Marker id="20" body_id="2" pos_y="2"/><Reference_Marker id="10" body_id="1"/>
<Reference_Marker id="21" body_id="2" pos_x="0.3" pos_y="2"/>
<Force_Scalar_TwoBody id="1" type="Force" i_marker_id="21" j_marker_id="10"
  expr="-100*(DM(21,10)-2)-400*(DM(21,10)-2)**3-2*VR(21,10)*ABS(VR(21,10))"/>"""
    bar = mech.Body(1.0, BAR, (0, 2, 0), np.eye(3), (0, 0, 0))
    law = along(lambda r, v: -100 * (r - 2) - 400 * (r - 2) ** 3 - 2 * v * abs(v))
    force = mech.Force(mech.Marker(1, (0.3, 2, 0)), mech.Marker(0, (0, 0, 0)), law)
    results = run_deck(tmp_path, BODY + deck, 2.0, 0.01, tol=tol)
    check(results, mech.Mechanism([bar], [], [force], G).solve(results["time"]), allowed)


@TOLS
def test_torsion_spring_that_stiffens_with_the_angle(tol, allowed, tmp_path):
    # (50 + 10 |a|) a of RotSpring_Case02, and a damper that fades in
    deck = f"""
<Reference_Marker id="20" body_id="2" pos_x="2" {TURNED}/>
<Reference_Marker id="21" body_id="2" {TURNED}/><Reference_Marker id="11" body_id="1" {TURNED}/>
<Constraint_Joint id="1" type="REVOLUTE" i_marker_id="21" j_marker_id="11"/>
<Force_Scalar_TwoBody id="1" type="Torque" i_marker_id="21" j_marker_id="11"
  expr="-(50+10*ABS(AZ(21,11)))*AZ(21,11)-STEP(ABS(AZ(21,11)),0,0,0.2,4)*WZ(21,11,11)"/>"""

    def damper(a):
        s = min(abs(a) / 0.2, 1.0)
        return 4.0 * s * s * (3.0 - 2.0 * s)

    law = about(lambda a, w: -(50 + 10 * abs(a)) * a - damper(a) * w)
    bar = mech.Body(1.0, BAR, (2, 0, 0), DOWN, (0, 0, 0))
    I, J = mech.Marker(1, (0, 0, 0), DOWN), mech.Marker(0, (0, 0, 0), DOWN)
    exact = mech.Mechanism(
        [bar], [mech.Constraint(I, J, mech.revolute)], [mech.Force(I, J, law)], G
    )
    results = run_deck(tmp_path, BODY + deck, 2.0, 0.01, tol=tol)
    solution = exact.solve(results["time"])
    check(results, solution, allowed)
    reaction = solution.reaction(0)[:, :3]
    force = results["joints/1/force"]
    assert np.abs(force - reaction).max() < 10 * allowed * np.abs(reaction).max()

"""Pictures of the chapter Computation: laws through an impact, over slip, and stick-slip."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsim.manual.drawings import runs
from mbsim.manual.pictures import picture

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: 1 kg at 1 m/s, without weight; the laws are made to go some 3 mm deep.
_IMPACT = """<MotionSolve><Model>
<Body_Rigid id="1" isground="TRUE"/>
<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="1" inertia_yy="1" inertia_zz="1"
  v_ic_z="-1" v_ic_z_flag="TRUE"/>
<Reference_Marker id="10" body_id="1"/> <Reference_Marker id="20" body_id="2" pos_z="0.1001"/>
<Post_Graphic id="100" type="Plane" rm_id="10"/>
<Post_Graphic id="200" type="Sphere" center_marker_id="20" radius="0.1"/>
<Force_Contact id="1" i_graphics_id="200" j_graphics_id="100" {law}/>
</Model><Command>
<Simulate analysis_type="Transient" end_time="0.02" print_interval="2e-5"/>
</Command></MotionSolve>"""
_NORMAL = {
    "IMPACT, c = 100, dmax = 1 mm": 'cnf_type="IMPACT" stiffness="2.4e6" exponent="1.5" '
    'damping="100" dmax="1e-3"',
    "HUNT_CROSSLEY, r = 0.7": 'cnf_type="HUNT_CROSSLEY" stiffness="2.4e6" exponent="1.5" '
    'restitution_coef="0.7" ref_velocity="1"',
    "HERTZ, no damper": 'cnf_type="HERTZ" stiffness="2.4e6"',
    "POISSON, r = 0.7": 'cnf_type="POISSON" penalty="1.2e5" restitution_coef="0.7" '
    'normal_trans_vel="0.05"',
}
_MU = {"mu_static": 0.5, "mu_dynamic": 0.3, "viscous_coef": 0.0, "stribeck_exponent": 2.0}
_SMOOTH = {
    "COULOMB_ON": {"stiction_trans_vel": 2e-3, "friction_trans_vel": 1e-2},
    "TANH": {"friction_trans_vel": 2e-3},
    "STRIBECK": {"stiction_trans_vel": 1e-3, "stribeck_vel": 5e-3},
    "BROWN_MCPHEE": {"stiction_trans_vel": 2e-3},
}
_HOLDING = {
    "COULOMB_ON": {"stiction_trans_vel": 2e-3, "friction_trans_vel": 1e-2},
    "DAHL": {"bristle_stiffness": 1e4},
    "STICTION": {},
}


@picture("normal-laws.svg", height=3.4)
def normal_laws(figure: Figure) -> None:
    """Draw force over depth through one impact."""
    axes = figure.subplots()
    for name, law in _NORMAL.items():
        run = runs.of_text(_IMPACT.format(law=law))
        depth = run["contacts/1/penetration"]
        inside = depth > 0.0
        force = run["contacts/1/force/z"][inside]
        axes.plot(1e3 * depth[inside], force, label=name)
    axes.set_xlabel("depth [mm], 1 kg at 1 m/s")
    axes.set_ylabel("normal force [N]")
    axes.legend()


@picture("friction-laws.svg", height=3.2)
def friction_laws(figure: Figure) -> None:
    """Friction over slip speed of smoothed laws, and through a slip to and fro."""
    from mbsim.laws.catalog import FRICTION_LAWS
    from mbsim.laws.slip_test import Conditions, Sample, cycle, sample_of, samples, steady

    at = Conditions()
    over_speed, to_and_fro = figure.subplots(1, 2)

    def sample(name: str, own: dict[str, float]) -> Sample:
        law = FRICTION_LAWS[name]
        values = {each.name: each.default for each in law.own if each.default is not None}
        return sample_of(law, {**values, **_MU, **own}, at)

    for name, own in _SMOOTH.items():
        law = sample(name, own)
        speeds = samples(law, at)
        over_speed.plot(1e3 * np.array(speeds), steady(law, at, speeds), label=name)
    for name, own in _HOLDING.items():
        x, force = cycle(sample(name, own), at)
        to_and_fro.plot(1e3 * np.array(x), force, label=name)
    over_speed.set_xlabel("slip speed [mm/s]")
    over_speed.set_ylabel("friction over normal force")
    to_and_fro.set_xlabel("slip to and fro [mm]")
    for axes in (over_speed, to_and_fro):
        axes.legend()


@picture("stick-slip.svg", height=3.4)
def stick_slip(figure: Figure) -> None:
    """Draw the block on the belt: position and velocity."""
    run = runs.of_model("belt_stick_slip.xml")
    upper, lower = figure.subplots(2, 1, sharex=True)
    upper.plot(run["time"], run["bodies/2/position/x"])
    upper.set_ylabel("position [m]")
    lower.plot(run["time"], run["bodies/2/velocity/x"], color="C1")
    lower.set_ylabel("velocity [m/s]")
    lower.set_xlabel("time [s]")

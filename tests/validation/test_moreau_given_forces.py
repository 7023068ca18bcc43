"""MOREAU: forces without a potential across impacts, and stiff ones that turn as bodies do.

What pushes and dampers take goes along the way that bodies go, not by a velocity in the midst of a
step in which it turns round. Velocities by which stiff forces are found are those of the step.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import mbsim
from helpers import rigid_decks as decks
from helpers.folders import MODELS
from mbsim.bench import deck as text
from mbsim.results.reading import Results

#: A weight of 9.81 N that no potential is known of, in three ways.
WEIGHTS = {
    "field": '<Force_Gravity grav_z="-9.81*(1 + 0*TIME)"/>',
    "vector": '<Force_Vector_TwoBody id="1" type="ForceOnly" i_marker_id="20" j_floating_marker_id='
    '"91" ref_marker_id="90" fx_expression="0" fy_expression="0" fz_expression="-9.81"/>',
    "between": '<Force_Scalar_TwoBody id="1" type="Force" i_marker_id="20" j_marker_id="90" '
    'expr="-9.81"/>',
}
PLACES = '<Reference_Marker id="90" body_id="1"/><Reference_Marker id="91" body_id="1"/>'


def open_by(results: Results) -> float:
    """Return how far the energies of the last row are from those of the first."""
    energies = ("energy/kinetic", "energy/potential", "energy/dissipated")
    total = sum(results[name] for name in energies)
    return abs(float(total[-1] - total[0]))


def falls(folder: Path, weight: str, e: float, h: float | None) -> Results:
    parts = [
        text.sphere(2, 1.0, 0.1, (0.0, 0.0, 0.6)),
        text.contact(301, [200], [100], **decks.rubbed(0.0, e)),
        PLACES,
        weight,
    ]
    return mbsim.simulate(decks.model(folder, parts, 2.0, h), integrator="MOREAU", tol=1e-4)


@pytest.mark.parametrize("kind", WEIGHTS)
@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("h", [0.1, 0.031, None])
def test_a_weight_without_a_potential_does_the_work_of_one_with(
    tmp_path: Path, kind: str, e: float, h: float | None
) -> None:
    results = falls(tmp_path, WEIGHTS[kind], e, h)
    assert open_by(results) < 1e-9
    assert results.audit.balance < 1e-9
    assert results.audit.warnings == ()


@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_drag_takes_what_is_missing(tmp_path: Path, e: float) -> None:
    """Of order 1 across impacts: it is bounded by tol."""
    drag = (
        '<Force_Vector_TwoBody id="1" type="ForceOnly" i_marker_id="20" j_floating_marker_id="91" '
        'ref_marker_id="90" fx_expression="0" fy_expression="0" fz_expression="-0.3*VZ(20)"/>'
        '<Force_Gravity grav_z="-9.81"/>'
    )
    results = falls(tmp_path, drag, e, None)
    assert results.audit.balance < 0.01 * results.audit.of
    assert results.audit.warnings == ()


@pytest.mark.parametrize(("tol", "part"), [(1e-5, 0.02), (1e-6, 0.005)])
def test_a_mass_that_is_shaken_against_a_stop(tol: float, part: float) -> None:
    results = mbsim.simulate(MODELS / "sdnd121.xml", integrator="MOREAU", tol=tol)
    assert results.audit.balance < part * results.audit.of
    assert results.audit.warnings == ()


@pytest.mark.parametrize("deck", ["flyball_governor", "stiff/stiff_governor"])
@pytest.mark.parametrize("tol", [1e-4, 1e-5, 1e-6])
def test_stiff_rods_that_turn_give_no_energy(deck: str, tol: float) -> None:
    model = mbsim.read_model(MODELS / f"{deck}.xml")
    exact = mbsim.simulate(model, integrator="RADAU5", tol=1e-8, end_time=1.0)
    results = mbsim.simulate(model, integrator="MOREAU", tol=tol, end_time=1.0)
    assert open_by(results) < 2e-3 * results.audit.of
    assert results.audit.warnings == ()
    slider = results["bodies/3/position/z"] - exact["bodies/3/position/z"]
    assert np.abs(slider).max() < 3e-3 * (tol / 1e-4) ** 0.5


RODS = {
    "spring": '<Force_SpringDamper id="1" type="TRANSLATIONAL" i_marker_id="20" j_marker_id="30" '
    'stiffness="{k}" damping="{c}" length="1"/>',
    "bushing": '<Force_Bushing id="1" i_marker_id="21" j_marker_id="31" kx="{k}" ky="{k}" kz="{k}" '
    'cx="{c}" cy="{c}" cz="{c}" ktx="1e3" kty="1e3" ktz="1e3" ctx="1" cty="1" ctz="1"/>',
    "expression": '<Force_Scalar_TwoBody id="1" type="Force" i_marker_id="20" j_marker_id="30" '
    'expr="-{k}*(DM(20,30)-1)-{c}*VR(20,30)"/>',
}


@pytest.mark.parametrize("kind", RODS)
@pytest.mark.parametrize(("k", "c"), [(1e7, 1e3), (1e6, 1e5), (1e4, 1e5)])
def test_two_masses_on_a_stiff_rod_keep_on_turning(
    tmp_path: Path, kind: str, k: float, c: float
) -> None:
    """They turn at w = 6 rad/s; of its energy theta takes the part 0.1 w^2 h in a second."""
    bodies = [
        f'<Body_Rigid id="{id}" cg_id="{id}0" mass="2" inertia_xx="0.02" inertia_yy="0.02" '
        f'inertia_zz="0.02" v_ic_y="{v}" v_ic_y_flag="TRUE" w_ic_z="6" w_ic_z_flag="TRUE"/>'
        f'<Reference_Marker id="{id}0" body_id="{id}" pos_x="{x}"/>'
        f'<Reference_Marker id="{id}1" body_id="{id}"/>'
        for id, x, v in ((2, 0.5, 3.0), (3, -0.5, -3.0))
    ]
    deck = (
        f'<MotionSolve><Model><Body_Rigid id="1" isground="TRUE"/>{"".join(bodies)}'
        f"{RODS[kind].format(k=k, c=c)}</Model><Command>"
        '<Simulate analysis_type="Transient" end_time="1" print_interval="0.01"/>'
        "</Command></MotionSolve>"
    )
    for tol in (1e-4, 1e-5):
        results = mbsim.simulate(deck, integrator="MOREAU", tol=tol)
        energy = results["energy/kinetic"] + results["energy/potential"]
        lost = energy[0] - energy[-1] - results["energy/dissipated"][-1]
        # each step is two halves
        theta = 0.1 * 36.0 * 0.5 / results.stats["steps"]
        assert -1e-4 < lost / energy[0] < 1.2 * theta
        assert results.audit.warnings == ()

"""Sensitivities through expressions: numbers that are the same by chance, kinks, and jumps."""

from __future__ import annotations

import math

import numpy as np
import pytest

import mbsim
from helpers.tight_runs import differences

DECK = """<Deck><Model>
<Body_Rigid id="1" isground="TRUE"/>
<Body_Rigid id="2" cg_id="20" mass="2" inertia_xx="1" inertia_yy="1" inertia_zz="1"/>
<Reference_Marker id="10" body_id="1"/><Reference_Marker id="20" body_id="2"/>
<Reference_Variable id="1" expr="0.5"/>
<Force_Vector_TwoBody id="5" type="ForceOnly" i_marker_id="20" j_floating_marker_id="10"
 ref_marker_id="10" fx_expression="{force}" fy_expression="0" fz_expression="0"/>
</Model><Command>
<Simulate analysis_type="Transient" end_time="1" print_interval="0.05"/>
</Command></Deck>"""
NAME, SIGNAL = "Reference_Variable[1].expr", "bodies/2/velocity/x"


def run_of(force, integrator, **how):
    return mbsim.simulate(DECK.format(force=force), integrator=integrator, **how)


@pytest.mark.parametrize("integrator", ["DOPRI5", "RADAU5", "GALPHA"])
@pytest.mark.parametrize(
    "force",
    [
        "VARVAL(1)*IF(TIME-0.5:0,0,10)",
        "VARVAL(1)*0.5+0.5*TIME",
        "MAX(0,TIME-VARVAL(1))",
        "10*STEP(TIME,VARVAL(1),0,VARVAL(1)+0.25,1)",
        "3+20*ABS(DX(20,10)-0.1*VARVAL(1))",
    ],
)
def test_numbers_that_are_alike_by_chance_and_kinks(force, integrator):
    run = run_of(force, integrator, tol=1e-9, sensitivity=[NAME])
    deck, how = DECK.format(force=force), {"integrator": "DOP853"}
    truth = differences(deck, NAME, 0.5, 1e-4, (SIGNAL,), **how)[SIGNAL]
    assert run.parameters[NAME]["known_until"] == math.inf
    assert np.abs(run.sensitivity(SIGNAL, NAME) - truth).max() < 1e-4 * np.abs(truth).max()


@pytest.mark.parametrize("integrator", ["DOPRI5", "DOP853", "RADAU5", "GALPHA"])
@pytest.mark.parametrize("jump", ["IF(DX(20,10)-{}:3,3,10)", "6+SIGN(3,DX(20,10)-{})"])
def test_a_jump_at_a_place_that_a_parameter_moves_is_said_not_to_be_known(jump, integrator):
    force = jump.format("0.02*VARVAL(1)")
    run = run_of(force, integrator, tol=1e-8, sensitivity=[NAME])
    x, found = run["bodies/2/position/x"], run.sensitivity(SIGNAL, NAME)
    assert "jump" in run.parameters[NAME]["why"]
    assert np.isnan(found[x > 0.0101]).all()
    assert (found[x < 0.0099] == 0.0).all()


@pytest.mark.parametrize("integrator", ["DOPRI5", "RADAU5"])
def test_a_jump_that_a_parameter_does_not_move_leaves_its_derivative_known(integrator):
    # of what goes another way, across
    deck = DECK.format(force="IF(DX(20,10)-0.01:3,3,10)").replace(
        'fy_expression="0"', 'fy_expression="VARVAL(1)"'
    )
    run = mbsim.simulate(deck, integrator=integrator, tol=1e-8, sensitivity=[NAME])
    assert run.parameters[NAME]["known_until"] == math.inf
    found = run.sensitivity("bodies/2/velocity/y", NAME)
    assert found == pytest.approx(run["time"] / 2.0, rel=1e-6)

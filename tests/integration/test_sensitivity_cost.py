"""What sensitivities take beside a run: evaluations over the run's own."""

from __future__ import annotations

import pytest

import mbsim
from helpers.folders import MODELS

INERTIAS = [f"Body_Rigid[2].inertia_{axis}" for axis in ("xx", "yy", "zz")]
CONTACT = "Force_Contact[301]"


def cost(deck, integrator, names, **how):
    """Return evaluations beside a run over the run's own, and the run's own."""
    run = mbsim.simulate(
        MODELS / f"{deck}.xml", integrator=integrator, tol=1e-8, sensitivity=names, **how
    )
    own = run.stats["rhs_evaluations"]
    return run.parameters[names[0]]["evaluations"] / own, own


@pytest.mark.parametrize(
    ("deck", "integrator", "names", "most"),
    [
        ("free_top", "DOPRI5", INERTIAS[:1], 1.1),
        ("free_top", "DOP853", INERTIAS[:1], 1.3),
        ("free_top", "RADAU5", INERTIAS[:1], 0.75),
        ("bowling_ball", "DOPRI5", ["Body_Rigid[2].v_ic_x"], 1.15),
        ("bowling_ball", "RADAU5", ["Body_Rigid[2].v_ic_x"], 0.75),
        ("sdnd100", "DOPRI5", [f"{CONTACT}.mu_dynamic"], 1.5),
        ("sdnd100", "DOP853", [f"{CONTACT}.mu_dynamic"], 1.3),
        ("sdnd100", "RADAU5", [f"{CONTACT}.mu_dynamic"], 0.8),
        # what it sticks by is new to the linearisation that the run goes on with
        ("belt_stick_slip", "RADAU5", [f"{CONTACT}.mu_static"], 1.2),
        ("belt_stick_slip", "DOPRI5", [f"{CONTACT}.mu_static"], 1.45),
        ("belt_stick_slip", "DOP853", [f"{CONTACT}.mu_static"], 1.45),
        # one evaluation a step, where the run takes three
        ("free_top", "GALPHA", INERTIAS[:1], 0.4),
        ("bowling_ball", "GALPHA", ["Body_Rigid[2].v_ic_x"], 0.6),
        ("sdnd100", "GALPHA", [f"{CONTACT}.mu_dynamic"], 0.8),
        ("belt_stick_slip", "GALPHA", [f"{CONTACT}.mu_static"], 0.5),
        ("bouncing_sphere", "GALPHA", ["Reference_Marker[20].pos_z"], 0.75),
        # its force bends within every impact, where damping has brought it to zero
        ("bouncing_sphere", "RADAU5", ["Reference_Marker[20].pos_z"], 1.6),
        ("bouncing_sphere", "DOPRI5", ["Reference_Marker[20].pos_z"], 2.7),
        ("bouncing_sphere", "DOP853", ["Reference_Marker[20].pos_z"], 3.1),
    ],
)
def test_a_parameter_takes_no_more_than_the_manual_says(deck, integrator, names, most):
    assert cost(deck, integrator, names)[0] < most


@pytest.mark.parametrize(
    ("deck", "integrator", "names", "most"),
    [
        ("sdnd100", "RADAU5", [f"{CONTACT}.mu_dynamic", "Body_Rigid[2].mass"], 1.0),
        ("sdnd100", "GALPHA", [f"{CONTACT}.mu_dynamic", "Body_Rigid[2].mass"], 1.3),
        ("belt_stick_slip", "RADAU5", [f"{CONTACT}.mu_static", f"{CONTACT}.mu_dynamic"], 0.75),
        ("belt_stick_slip", "GALPHA", [f"{CONTACT}.mu_static", f"{CONTACT}.mu_dynamic"], 0.5),
        # its derivative by the mass vibrates faster than the motion
        ("bowling_ball", "GALPHA", ["Body_Rigid[2].v_ic_x", "Body_Rigid[2].mass"], 2.3),
        ("bouncing_sphere", "RADAU5", ["Reference_Marker[20].pos_z", "Body_Rigid[2].mass"], 1.0),
    ],
)
def test_a_further_parameter_takes_no_more_than_the_manual_says(deck, integrator, names, most):
    first, _ = cost(deck, integrator, names[:1])
    both, _ = cost(deck, integrator, names)
    assert both - first < most


@pytest.mark.parametrize("integrator", ["RADAU5", "GALPHA"])
def test_parameters_share_the_evaluations_of_the_run_itself(integrator):
    first, own = cost("free_top", integrator, INERTIAS[:1])
    three, _ = cost("free_top", integrator, INERTIAS)
    # of RADAU5 three stages a step are the run's own, and one iteration is enough
    assert (three - first) / 2.0 < 0.4
    assert own > 0


@pytest.mark.parametrize("integrator", ["DOPRI5", "DOP853", "RADAU5", "GALPHA"])
def test_rows_within_impacts_take_next_to_nothing(integrator):
    # steps that are cut into parts keep these parts' polynomials
    names, end = ["Reference_Marker[20].pos_z"], 0.4
    few, own = cost("bouncing_sphere", integrator, names, end_time=end, print_interval=0.1)
    many, others = cost("bouncing_sphere", integrator, names, end_time=end, print_interval=2e-4)
    # a row may take one more for s f, and polynomials of DOP853 take some for each step
    assert abs(many * others - few * own) < 0.5 * few * own + 200

"""Implicit methods under joints: orders at fixed steps, stiff forces beside joints, rounding."""

from __future__ import annotations

import math

import numpy as np
import pytest

import mbsim
from helpers.folders import DATA, MODELS
from mbsim.bench import ours, stiff
from mbsim.errors import SolverError

#: Deck, end, steps, and tol with the first of them: only Newton's iteration and no step knows it.
FIXED = {
    "slider_crank": (MODELS / "slider_crank.xml", 1.0, (1600, 3200), 1.5e-7),
    "top": (MODELS / "stiff" / "torsion_top.xml", 0.2, (800, 1600), 1e-6),
    "squeezer": (MODELS / "stiff" / "squeezer.xml", 0.01, (400, 800), 0.1),
}


def at_end(folder, path, end, method, tol, h_max=None):
    """Return {signal: numbers} at the end of a run whose steps are h_max long."""
    text = path.read_text(encoding="utf-8")
    if h_max is not None:
        text = text.replace("<Command>", f'<Command><Param_Transient h_max="{h_max!r}"/>')
    deck = folder / f"{path.stem}.xml"
    deck.write_text(text, encoding="utf-8")
    found = mbsim.simulate(
        mbsim.read_model(deck), integrator=method, tol=tol, end_time=end, print_interval=end
    )
    bodies = ("position", "velocity", "acceleration")
    kept = [k for k in found.keys() if k.startswith("joints/") and k.endswith("/force")]
    kept += [k for k in found.keys() if k.startswith("bodies/") and k.split("/")[-1] in bodies]
    return {k: np.asarray(found[k])[-1] for k in kept}


@pytest.mark.parametrize("name", list(FIXED))
def test_galpha_is_of_order_2_in_motion_and_reactions(name, tmp_path):
    path, end, counts, tol = FIXED[name]
    exact = at_end(tmp_path, path, end, "RADAU5", 1e-11)
    errors: dict[str, list[float]] = {}
    for n in counts:
        # errors of a step are of order 3
        found = at_end(tmp_path, path, end, "GALPHA", tol * (counts[0] / n) ** 3, end / n)
        for kind in ("position", "velocity", "acceleration", "force"):
            off = [np.abs(found[k] - exact[k]).max() for k in exact if k.endswith(kind)]
            errors.setdefault(kind, []).append(max(off))
    for kind, (first, last) in errors.items():
        assert math.log2(first / last) == pytest.approx(2.0, abs=0.3), (kind, first, last)


@pytest.mark.parametrize(
    ("name", "tol", "most"),
    [("stiff_governor", 1e-3, 3e-3), ("stiff_governor", 1e-5, 2e-4), ("torsion_top", 1e-5, 1e-3)],
)
def test_galpha_bears_stiff_forces_under_joints(name, tol, most):
    deck = next(deck for deck in stiff.DECKS if deck.name == name)
    found = mbsim.simulate(mbsim.read_model(stiff.deck_path(deck)), integrator="GALPHA", tol=tol)
    assert stiff.error(deck, ours.outcome(found, 0.0)) < most


@pytest.mark.parametrize("name", ["rebound", "standing_cylinder"])
def test_errors_of_galpha_fall_with_tol_where_bodies_land(name):
    # a touch behind a long flight is seen, and a body that rests is not thrown up by equations
    # that were solved with the slopes of a touch that it had left
    deck = next(deck for deck in stiff.DECKS if deck.name == name)
    model = mbsim.read_model(stiff.deck_path(deck))
    for tol, most, steps in ((1e-3, 1.5e-2, 1500), (1e-5, 5e-4, 3000), (1e-7, 5e-6, 13000)):
        found = mbsim.simulate(model, integrator="GALPHA", tol=tol)
        assert stiff.error(deck, ours.outcome(found, 0.0)) < most, tol
        # of order 2, with an error of each step that is a part of its impact
        assert found.stats["steps"] < steps


@pytest.mark.parametrize(
    ("name", "end", "most"), [("cam", 0.1, 1e-4), ("cam_roller", 0.1, 1e-4), ("geneva", 1.0, 1e-3)]
)
def test_galpha_begins_where_motions_drive_bodies_in_contact(name, end, most):
    # at the start v'' is asked for where a motion carries the bodies, not where they stood
    model = mbsim.read_model(MODELS / f"{name}.xml")
    settings = {"end_time": end, "print_interval": end / 50.0}
    exact = mbsim.simulate(model, integrator="DOPRI5", tol=1e-8, **settings)
    found = mbsim.simulate(model, integrator="GALPHA", **settings)
    for body in (2, 3):
        for kind in ("position", "quaternion", "velocity"):
            key = f"bodies/{body}/{kind}"
            np.testing.assert_allclose(found[key], exact[key], rtol=0, atol=most)


def test_what_joints_turn_is_no_news_to_newton():
    # a body that is turned back into its joint turns its velocity along: were that taken for what
    # joints ask for, Newton's iteration would undo it and end nowhere
    deck = next(deck for deck in stiff.DECKS if deck.name == "stiff_governor")
    found = mbsim.simulate(mbsim.read_model(stiff.deck_path(deck)), integrator="GALPHA", tol=1e-7)
    assert found.stats["jacobians"] < 0.3 * found.stats["steps"]
    assert found.stats["rejected"] < 0.02 * found.stats["steps"]


@pytest.mark.parametrize("name", ["incline_creep", "box_stack", "jammed_wedge"])
@pytest.mark.parametrize(("method", "most"), [("RADAU5", 1e-3), ("GALPHA", 5e-3)])
def test_steep_friction_does_not_chatter_at_a_loose_tolerance(name, method, most):
    # corrections below the tolerance of velocities are above the slip at which friction turns over
    deck = next(deck for deck in stiff.DECKS if deck.name == name)
    found = mbsim.simulate(mbsim.read_model(stiff.deck_path(deck)), integrator=method, tol=1e-3)
    assert stiff.error(deck, ours.outcome(found, 0.0)) < most
    assert found.stats["rhs_evaluations"] < 3000
    assert found.stats["rejected"] < 60


#: A rail, and a force against the motion so large that no step on the clock is short enough.
UNSOLVABLE = """<MotionSolve><Model>
  <Body_Rigid id="1" label="ground" isground="TRUE"/>
  <Reference_Marker id="10" body_id="1"/>
  <Reference_Marker id="11" body_id="1"/>
  <Body_Rigid id="2" label="slider" cg_id="20" mass="1"
    inertia_xx="1" inertia_yy="1" inertia_zz="1"/>
  <Reference_Marker id="20" body_id="2"/>
  <Constraint_Joint id="7" label="rail" type="TRANSLATIONAL" i_marker_id="20" j_marker_id="10"/>
  <Force_Vector_TwoBody id="6" type="ForceOnly" i_marker_id="20" j_floating_marker_id="11"
    ref_marker_id="10" fx_expression="0" fy_expression="0"
    fz_expression="1-1E12*SIGN(1,VZ(20))"/>
</Model><Command>
  <Simulate analysis_type="Transient" end_time="1" print_interval="0.1"/>
</Command></MotionSolve>"""


def test_a_run_that_newton_ends_says_how_far_it_came_and_where(tmp_path):
    deck = tmp_path / "rail.xml"
    deck.write_text(UNSOLVABLE, encoding="utf-8")
    said = (
        r"the step fell to \S+ at time 0 because Newton's iteration does not converge "
        r"\(its last corrections were \S+ and \S+, over the scale of tol\); "
        r"at Body_Rigid\[2\], Constraint_Joint\[7\]\. Results up to there are kept"
    )
    with pytest.raises(SolverError, match=said):
        mbsim.simulate(mbsim.read_model(deck), integrator="RADAU5")


@pytest.mark.parametrize(
    ("method", "tol", "end", "most"),
    [
        ("RADAU5", 1e-9, 720.0, 1e-6),
        # friction turns over within 1e-3 of the usual speed, and shows 1e4 times as much of the
        # rounding of velocities: steps fell to 1e-12 ms at 437 ms
        ("RADAU5", 1e-10, 440.0, 1e-7),
        pytest.param("GALPHA", 1e-9, 440.0, 2e-5, marks=pytest.mark.slow),
    ],
)
def test_corrections_that_are_rounding_end_newtons_iteration(method, tol, end, most):
    # a loop of joints in other units, at 703 ms: corrections of 1e-11 came and went, each a little
    # smaller or larger than the last, and their mean rate promised much more to come: it gave up
    loop = mbsim.read_model(DATA / "loop_of_joints.xml")
    by = {"end_time": end, "print_interval": 0.1 * end}
    found = mbsim.simulate(loop, integrator=method, tol=tol, **by)
    exact = mbsim.simulate(loop, integrator="DOP853", tol=1e-10, **by)
    worst = 0.0
    for body in found.ids("bodies"):
        # centimetres, of a mechanism of a metre
        off = found[f"bodies/{body}/position"] - exact[f"bodies/{body}/position"]
        worst = max(worst, np.abs(off).max())
    assert worst < most


@pytest.mark.slow
def test_a_loop_near_a_singular_position_is_closed_as_far_as_rounding_goes():
    # closed to 2e-14 of its unit, or left: whether a residual was just below that moved bodies by
    # 1e-10 of their distance, corrections came and went by it, and the step fell at 485 ms
    loop = mbsim.read_model(DATA / "loop_near_singular.xml")
    by = {"end_time": 490.0, "print_interval": 49.0}
    found = mbsim.simulate(loop, integrator="RADAU5", tol=1e-10, **by)
    exact = mbsim.simulate(loop, integrator="DOP853", tol=1e-10, **by)
    for body in found.ids("bodies"):
        off = found[f"bodies/{body}/position"] - exact[f"bodies/{body}/position"]
        # centimetres; a small change of the start grows 1e8 times until 490 ms
        assert np.abs(off[:6]).max() < 1e-6
        assert np.abs(off).max() < 1e-3


@pytest.mark.parametrize(("name", "tol"), [("box_stack", 1.5e-2), ("jammed_wedge", 3e-2)])
def test_what_galpha_leaves_of_friction_is_the_same_at_any_loose_tol(name, tol):
    """It was a third of what friction may be off by, faded slowly, and steps followed it for good.

    50,301 and 21,873 evaluations, 593 and 458 at 1e-3.
    """
    model = mbsim.read_model(MODELS / "stiff" / f"{name}.xml")
    loose, tight = (
        mbsim.simulate(model, integrator="GALPHA", tol=t).stats["rhs_evaluations"]
        for t in (tol, 1e-3)
    )
    assert loose < 1.3 * tight


@pytest.mark.parametrize(
    ("method", "name", "tol", "most"),
    [
        ("GALPHA", "sliding_block", 1e-2, 600),
        ("GALPHA", "sliding_block", 1e-3, 430),
        ("RADAU5", "incline_slip", 1e-2, 150),
        ("RADAU5", "stiff/jammed_wedge", 2.15e-2, 1000),
    ],
)
def test_what_was_hard_to_solve_for_is_not_tried_at_once_again(method, name, tol, most):
    """Each step that Newton's iteration could be done with was followed by one that it could not.

    Evaluations were 624, 466, 215 and 1674.
    """
    model = mbsim.read_model(MODELS / f"{name}.xml")
    stats = mbsim.simulate(model, integrator=method, tol=tol).stats
    assert stats["rhs_evaluations"] + stats["jacobians"] < most

"""Motions that jump: no step can follow them, whatever the method is."""

from __future__ import annotations

import pytest

import mbsim
from mbsim.errors import SolverError

METHODS = ("AUTO", "DOPRI5", "DOP853", "RADAU5", "GALPHA", "MOREAU")


def moved(folder, expression, kind="D"):
    """Return a body on a slide that a motion leads."""
    path = folder / "moved.xml"
    path.write_text(
        f"""<MotionSolve><Model><Body_Rigid id="1" isground="TRUE"/>
<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="0.01" inertia_yy="0.01" inertia_zz="0.01"/>
<Reference_Marker id="10" body_id="1"/><Reference_Marker id="20" body_id="2"/>
<Constraint_Joint id="501" type="TRANSLATIONAL" i_marker_id="20" j_marker_id="10"/>
<Motion_Joint id="502" joint_id="501" val_type="{kind}" expr="{expression}"/></Model>
<Command><Simulate analysis_type="Transient" end_time="1" print_interval="0.05"/></Command>
</MotionSolve>"""
    )
    return mbsim.read_model(path)


@pytest.mark.parametrize(
    ("expression", "kind"),
    [
        ("IF(TIME-0.52: 0, 0.1, 0.1)", "D"),
        ("IF(TIME-0.52: 0, 0, TIME-0.52)", "D"),
        ("IF(TIME-0.52: 0, 0.1, 0.1)", "V"),
    ],
)
def test_every_method_stops_at_a_jump_with_the_same_words(tmp_path, expression, kind):
    """RADAU5 and GALPHA ran through jumps of the position."""
    model, said = moved(tmp_path, expression, kind), set()
    for method in METHODS:
        with pytest.raises(SolverError) as caught:
            mbsim.simulate(model, integrator=method)
        said.add(str(caught.value))
    (words,) = said
    assert "at time 0.52 a position or velocity jumps" in words
    assert "Motion_Joint[502]" in words


@pytest.mark.parametrize("method", METHODS)
def test_none_stops_at_a_jump_within_the_tolerance_or_of_the_acceleration(tmp_path, method):
    jump, bend = "IF(TIME-0.52: 0, 1e-6, 1e-6)", "IF(TIME-0.52: 0, 0, (TIME-0.52)**2)"
    for expression, ends in ((jump, 1e-6), (bend, 0.48**2)):
        results = mbsim.simulate(moved(tmp_path, expression), integrator=method)
        assert results["time"][-1] == 1.0
        assert results["bodies/2/position"][-1, 2] == pytest.approx(ends, abs=1e-7)

"""What a call of a user subroutine costs."""

from __future__ import annotations

import pytest

import mbsim

BODY = """<MotionSolve><Model>
  <Body_Rigid id="1" isground="TRUE"/>
  <Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="1" inertia_yy="1" inertia_zz="1"/>
  <Reference_Marker id="10" body_id="1"/>
  <Reference_Marker id="20" body_id="2" pos_z="-1.2"/>
  <Force_Scalar_TwoBody id="1" type="Force" i_marker_id="20" j_marker_id="10" {by}/>
</Model><Command><Simulate analysis_type="Transient" end_time="100" print_interval="100"/></Command>
</MotionSolve>"""
USER = 'usrsub_param_string="USER(20, 10)" script_name="sub.py"'
HEAD = "def SFOSUB(id, time, par, npar, dflag, iflag):\n"
ASKS = 'py_sysfnc("DM", par)[0]'


def seconds_an_evaluation(folder, by, body=""):
    """Return the time of an evaluation in the best of three runs [s]."""
    (folder / "sub.py").write_text(HEAD + body)
    (folder / "deck.xml").write_text(BODY.format(by=by))
    model, spent = mbsim.read_model(folder / "deck.xml"), []
    for _ in range(3):
        stats = mbsim.simulate(model, tol=1e-10).stats
        spent.append(stats["loop_s"] / stats["rhs_evaluations"])
    return min(spent)


@pytest.mark.bench
def test_cost_of_a_call(tmp_path):
    none = seconds_an_evaluation(tmp_path, 'expr="-100*(DM(20,10)-1)"')
    same = seconds_an_evaluation(tmp_path, USER, f"    return -100.0 * ({ASKS} - 1.0)\n")
    nine = f"    return -100.0 * (({' + '.join([ASKS] * 9)}) / 9 - 1.0)\n"
    more = seconds_an_evaluation(tmp_path, USER, nine)
    asked = (more - same) / 8
    print(f"\nexpression {none * 1e6:.2f} us an evaluation")
    print(f"subroutine {(same - none - asked) * 1e6:.2f} us a call")
    print(f"py_sysfnc  {asked * 1e6:.2f} us a call")
    assert none < same < more

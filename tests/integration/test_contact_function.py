"""CONTACT() and accelerations in requests against what the result file has of the same rows."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import mbsim
from helpers.minimal_deck import deck

#: A sliding ball: force, torque about its cg and about ground's origin, acceleration of its cg.
REQUESTS = """
<Post_Request id="1" type="EXPRESSION" expr2="CONTACT(301,0,2,0)" expr3="CONTACT(301,0,3,0)"
 expr4="CONTACT(301,0,4,0)" expr5="CONTACT(301,0,5,0)" expr6="CONTACT(301,0,6,0)"
 expr7="CONTACT(301,0,7,0)" expr8="CONTACT(301,0,8,0)"/>
<Post_Request id="2" type="EXPRESSION" expr2="ACCX(20)" expr3="ACCY(20)" expr4="ACCZ(20)"
 expr6="WDTX(20)" expr7="WDTY(20)" expr8="WDTZ(20)"/>
<Post_Request id="3" type="EXPRESSION" expr2="CONTACT(301,1,2,0)" expr3="CONTACT(301,1,3,0)"
 expr4="CONTACT(301,1,4,0)" expr6="CONTACT(301,1,6,0)" expr7="CONTACT(301,1,7,0)"
 expr8="CONTACT(301,1,8,0)"/>
<Post_Request id="4" type="EXPRESSION" expr1="CONTACT(301,1,0)"/>
<Post_Request id="11" type="ELEMENTAL_FORCE" elem_type="CONTACT" elem_id="301"/>
<Post_Request id="12" type="MARKER_ACCELERATION" i_marker_id="20"/>
<Post_Request id="13" type="ELEMENTAL_FORCE" elem_type="CONTACT" elem_id="301" jflag="TRUE"/>
</Model>"""


def test_functions_at_output_rows_are_those_of_the_result_file(tmp_path: Path) -> None:
    text = deck(
        ("\n</Model>", REQUESTS),
        ('mass="5"', 'mass="5" v_ic_x="0.5" v_ic_x_flag="TRUE"'),
        ('end_time="3"', 'end_time="0.1"'),
        ('print_interval="0.01"', 'print_interval="0.001"'),
    )
    (tmp_path / "deck.xml").write_text(text)
    results = mbsim.simulate(mbsim.read_model(tmp_path / "deck.xml"))
    for id in (1, 2, 3):
        found, wanted = (results[f"requests/{k}"] for k in (id, 10 + id))
        assert np.abs(wanted).max() > 1.0
        np.testing.assert_allclose(found, wanted, rtol=1e-12, atol=1e-12)
    # the form of three arguments: its second is an index, 1 the deepest penetration
    depth = results["contacts/301/penetration"]
    assert depth.max() > 0.0
    np.testing.assert_allclose(results["requests/4"][:, 0], depth, rtol=1e-12)

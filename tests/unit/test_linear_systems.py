"""Control systems: their matrices against the polynomials, and what a deck may not say of them."""

from __future__ import annotations

import numpy as np
import pytest

import mbsim
from helpers.folders import CORPUS
from mbsim.errors import DeckError
from mbsim.reader.linear_systems import realise

DECK = """<MotionSolve><Model>
<Body_Rigid id="1" isground="TRUE"/>
<Reference_Variable id="5" expr="2"/>
<Reference_Array id="1" type="U" num_element="1">5</Reference_Array>
<Reference_Array id="2" type="Y" num_element="1"/>
<Reference_Array id="3" type="X" num_element="2"/>
<Reference_Array id="4" type="IC">0 0</Reference_Array>
<Reference_Matrix id="1" nrow="2" ncol="2">0 -9 1 -2</Reference_Matrix>
<Reference_Matrix id="2" nrow="2" ncol="1">0 1</Reference_Matrix>
<Reference_Matrix id="3" nrow="1" ncol="2">3 0</Reference_Matrix>
<Control_StateEqn id="8" x_array_id="3" y_array_id="2" u_array_id="1" ic_array_id="4"
  a_matrix_id="1" b_matrix_id="2" c_matrix_id="3"/>
<Post_Request id="1" type="EXPRESSION" expr1="ARYVAL(2,1)"/>
</Model><Command>
<Simulate analysis_type="Transient" end_time="0.1" num_steps="1"/>
</Command></MotionSolve>
"""
SISO = """<Control_SISO id="8" x_array_id="3" y_array_id="2" u_array_id="1" {}
  numerator_coef="3" denominator_coef="9 2 1"/>"""


def siso(more=""):
    """Return the deck with a transfer function in place of the matrices."""
    start = DECK.index("<Reference_Matrix")
    end = DECK.index("<Post_Request")
    return DECK[:start] + SISO.format(more) + DECK[end:]


@pytest.mark.parametrize(
    ("numerator", "denominator"),
    [
        ([2.0], [4.0]),
        ([1.0, 0.3], [2.0, 0.5]),
        ([0.0, 1.0], [0.0, 0.0, 3.0]),
        ([1e6], [1e6, 200.0, 1.0]),
        ([5.0, -1.0, 2.0, 7.0], [3.0, 1.0, 4.0, 2.0]),
    ],
)
def test_a_transfer_function_is_that_of_its_matrices(numerator, denominator):
    matrices, scales = realise(numerator, denominator)
    a, b, c, d = (matrices[name] for name in "ABCD")
    for rate in np.geomspace(0.01, 1e4, 50):
        wanted = np.polyval(numerator[::-1], 1j * rate) / np.polyval(denominator[::-1], 1j * rate)
        found = c @ np.linalg.solve(1j * rate * np.eye(len(a)) - a, b) + d
        assert found[0, 0] == pytest.approx(wanted, rel=1e-9)
    assert len(scales) == len(a)
    assert all(scale > 0.0 for scale in scales)


def test_matrices_and_transfer_function_give_the_same_output():
    one, other = mbsim.simulate(mbsim.read_model(DECK)), mbsim.simulate(mbsim.read_model(siso()))
    assert one["requests/1"][-1, 0] == pytest.approx(other["requests/1"][-1, 0], rel=1e-4)
    assert one["requests/1"][-1, 0] > 0.02


@pytest.mark.parametrize("method", ["RADAU5", "GALPHA"])
def test_methods_that_linearise_take_them(method):
    model = mbsim.read_model(CORPUS / "control_siso.xml")
    found = mbsim.simulate(model, integrator=method, tol=1e-7)["requests/1"][-1, :2]
    assert found == pytest.approx([0.000831706041, -0.409743623508], abs=1e-4)


def test_a_static_analysis_lets_states_rest():
    deck = DECK.replace(
        'analysis_type="Transient" end_time="0.1" num_steps="1"', 'analysis_type="Static"'
    )
    results = mbsim.simulate(mbsim.read_model(deck))
    assert results["requests/1"][-1, 0] == pytest.approx(3.0 * 2.0 / 9.0, abs=1e-9)
    held = deck.replace(
        '<Control_StateEqn id="8"', '<Control_StateEqn id="8" is_static_hold="TRUE"'
    )
    kept = mbsim.simulate(mbsim.read_model(held))
    assert kept["requests/1"][-1, 0] == kept["requests/1"][0, 0] == 0.0
    assert all(state.is_static_hold for state in mbsim.read_model(held).differentials.values())


def test_states_are_named_behind_those_of_the_deck():
    deck = DECK.replace(
        "<Post_Request", '<Control_Diff id="4" expr="-DIF(4)" ic="1"/><Post_Request'
    )
    model = mbsim.read_model(deck)
    assert list(model.differentials) == [4, 5, 6]
    assert model.differentials[6].label == "Control_StateEqn 8 x2"


def test_a_change_between_simulations_may_use_an_output():
    deck = DECK.replace(
        "</Command>",
        '<Reference_Variable id="6" expr="3*ARYVAL(2,1)"/>'
        '<Simulate analysis_type="Transient" end_time="0.2" num_steps="1"/></Command>',
    )
    deck = deck.replace("<Post_Request", '<Reference_Variable id="6" expr="0"/><Post_Request')
    deck = deck.replace('expr1="ARYVAL(2,1)"', 'expr1="ARYVAL(2,1)" expr2="VARVAL(6)"')
    rows = mbsim.simulate(mbsim.read_model(deck))["requests/1"]
    assert rows[-1, 1] == pytest.approx(3.0 * rows[-1, 0])
    assert rows[-1, 0] > 0.02


def test_a_loop_through_the_direct_part_is_a_circle():
    deck = siso().replace('numerator_coef="3"', 'numerator_coef="3 0 1"')
    looped = deck.replace('id="5" expr="2"', 'id="5" expr="2 - ARYVAL(2,1)"')
    with pytest.raises(DeckError, match="VARVAL leads back to the variable itself: 5 -> 5"):
        mbsim.read_model(looped)
    mbsim.read_model(siso().replace('id="5" expr="2"', 'id="5" expr="2 - ARYVAL(2,1)"'))


@pytest.mark.parametrize(
    ("old", "new", "line", "said"),
    [
        ('id="2" type="Y" num_element="1"', 'id="2" type="Y" num_element="3"', 11, "array 2 has 3"),
        ('id="2" type="Y"', 'id="2" type="X"', 11, "array 2 of its y is of type X"),
        ('y_array_id="2"', 'y_array_id="4"', 11, "array 4 of its y is of type IC"),
        ('y_array_id="2"', 'y_array_id="9"', 11, "array 9 of its y is not in the deck"),
        (">5</Ref", ">7</Ref", 11, "array 1 names Reference_Variable 7; there is none"),
        ('nrow="2" ncol="1"', 'nrow="1" ncol="2"', 11, "B is 1 x 2, must be 2 x 1"),
        ("0 0</Ref", "0 0 0</Ref", 11, "array 4 has 3 numbers for 2 states"),
        ('ic_array_id="4"', 'scale="1 2 3"', 11, "has 3 scales for 2 states"),
        ('ic_array_id="4"', 'num_state="3"', 11, "says 3 x; its matrices have 2"),
        ('a_matrix_id="1"', 'a_matrix_id="7"', 11, "A: matrix 7 is not in the deck"),
        (' u_array_id="1"', "", 12, "needs u_array_id too"),
        ('ic_array_id="4"', 'type="USERSUB"', 11, "usrsub_param_string: missing"),
        ('ncol="1">0 1<', 'ncol="1">0 1 2<', 9, "there are 3 numbers for 2 x 1"),
        ('ncol="1">0 1<', 'ncol="1" issparse="TRUE">3 1 2<', 9, "there is no row 3, column 1"),
        ("ARYVAL(2,1)", "ARYVAL(2,2)", 13, "ARYVAL(2, 2): array 2 has 1 elements"),
        ('expr1="', 'expr2="ARYVAL(9,1)" expr1="', 13, "no Reference_Array has this id"),
    ],
)
def test_what_does_not_fit_is_said_with_its_line(old, new, line, said):
    assert old in DECK
    with pytest.raises(DeckError) as caught:
        mbsim.read_model(DECK.replace(old, new))
    assert any(f".xml:{line}: " in each and said in each for each in str(caught.value).splitlines())


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('numerator_coef="3"', 'numerator_coef="1 1 1 1"', "order 3 over order 2"),
        ('"9 2 1"', '"9 2 0"', "must not be 0"),
        (" numerator_coef", ' num_numerator_coef="2" numerator_coef', "there are 1 coefficients"),
    ],
)
def test_what_is_no_transfer_function_is_refused(old, new, said):
    with pytest.raises(DeckError, match=said):
        mbsim.read_model(siso().replace(old, new))


def test_two_statements_may_not_share_an_array_of_states():
    second = SISO.format("").replace('id="8"', 'id="9"') + "<Post_Request"
    with pytest.raises(DeckError, match="array 3 belongs to another control statement"):
        mbsim.read_model(siso().replace("<Post_Request", second))


def test_an_array_that_nothing_fills_is_refused():
    deck = DECK.replace("<Control_StateEqn", "<!-- <Control_StateEqn").replace(
        'c_matrix_id="3"/>', 'c_matrix_id="3"/> -->'
    )
    with pytest.raises(DeckError, match="array 2 is of type Y and belongs to no control statement"):
        mbsim.read_model(deck)


def test_an_adams_deck_has_its_own_words(tmp_path):
    text = (CORPUS / "adams_control.adm").read_text()
    deck = tmp_path / "deck.adm"
    deck.write_text(text.replace("VARIABLES=2", "VARIABLES=8"))
    with pytest.raises(DeckError, match=r"LSE\[1\]: array 11 names VARIABLE 8"):
        mbsim.read_model(deck)
    deck.write_text(text.replace("MATRIX/2, SPARSE", "MATRIX/2"))
    with pytest.raises(DeckError, match="is of a SPARSE matrix"):
        mbsim.read_model(deck)

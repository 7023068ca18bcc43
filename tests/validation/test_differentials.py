"""States of the user's own (Control_Diff), against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

import mbsim
from helpers.decks import GRAVITY, GROUND, run_deck, sphere, write_deck
from mbsim.errors import DeckError, ModelError

ONLY_GROUND = '<Body_Rigid id="1" isground="TRUE"/>'


def diff(id, expr, ic=0.0, **more):
    attributes = " ".join(f'{name}="{value}"' for name, value in more.items())
    return (
        f'<Control_Diff id="{id}" type="EXPRESSION" expr="{expr}" ic="{ic!r}" '
        f'is_implicit="FALSE" {attributes}/>'
    )


DECAY = diff(1, "-2*DIF(1)", 1.0)
LOGISTIC = diff(2, "DIF(2)*(1-DIF(2))", 0.01)
SWING = diff(3, "DIF(4)", 1.0) + diff(4, "-9*DIF(3)")


def errors(results):
    """Return how far the three are from their closed forms."""
    t = results["time"]
    grown = 0.01 * np.exp(t) / (1.0 + 0.01 * (np.exp(t) - 1.0))
    exact = {1: np.exp(-2.0 * t), 2: grown, 3: np.cos(3.0 * t)}
    return {id: np.abs(results[f"diffs/{id}/value"] - z).max() for id, z in exact.items()}


@pytest.mark.parametrize("integrator", ["DOPRI5", "DOP853"])
def test_states_alone_follow_their_closed_forms_as_the_tolerance_asks(tmp_path, integrator):
    model = ONLY_GROUND + DECAY + LOGISTIC + SWING
    for tol in (1e-4, 1e-7, 1e-10, 1e-12):
        results = run_deck(tmp_path, model, 10.0, 0.5, tol=tol, integrator=integrator)
        assert max(errors(results).values()) < 60.0 * tol


@pytest.mark.parametrize(("integrator", "order"), [("DOPRI5", 5), ("DOP853", 8)])
def test_observed_order_is_that_of_the_method(tmp_path, integrator, order):
    path = write_deck(tmp_path, ONLY_GROUND + SWING, 8.0, 8.0)
    text = path.read_text()
    found = []
    for h in (0.2, 0.1):
        fixed = f'<Param_Transient integr_tol="10" h_max="{h}" h0_max="{h}" h_min="{h}"/>'
        path.write_text(text.replace("<Command>", f"<Command>{fixed}"))
        results = mbsim.simulate(mbsim.read_model(path), integrator=integrator)
        assert results.stats["steps"] == round(8.0 / h)
        found.append(abs(results["diffs/3/value"][-1] - np.cos(24.0)))
    assert np.log2(found[0] / found[1]) > order - 0.5


def test_slopes_stand_in_for_their_expression_and_rings_of_slopes_are_refused(tmp_path):
    request = '<Post_Request id="1" type="EXPRESSION" expr2="DIF1(1)" expr3="DIF1(2)"/>'
    results = run_deck(tmp_path, ONLY_GROUND + DECAY + diff(2, "3*DIF1(1)") + request)
    slope = -2.0 * results["diffs/1/value"]
    np.testing.assert_array_equal(results["requests/1"][:, 1], slope)
    np.testing.assert_array_equal(results["requests/1"][:, 2], 3.0 * slope)
    with pytest.raises(DeckError, match=r"Control_Diff\[1\].*DIF1 leads back .*: 1 -> 2 -> 1"):
        run_deck(tmp_path, ONLY_GROUND + diff(1, "DIF1(2)") + diff(2, "DIF1(1)"))


@pytest.mark.parametrize(
    ("statement", "said"),
    [
        (diff(1, "DIF(7)"), r"Control_Diff\[1\].*7"),
        (diff(1, "1").replace("FALSE", "TRUE"), "is_implicit.*not built"),
        (diff(1, "1", scale=0), 'scale="0".*> 0'),
        ('<Control_Diff id="1" ic="1"/>', "expr: missing"),
    ],
)
def test_what_cannot_be_is_one_clear_line(tmp_path, statement, said):
    with pytest.raises(DeckError, match=said):
        run_deck(tmp_path, ONLY_GROUND + statement)


def test_verlet_refuses_states(tmp_path):
    with pytest.raises(ModelError, match=r"Control_Diff\[1\].*VERLET"):
        run_deck(tmp_path, GROUND + sphere(1.0) + DECAY, integrator="VERLET")


def test_the_scale_says_what_is_small(tmp_path):
    tiny = diff(1, "-2*DIF(1)", 1e-9)
    loose = run_deck(tmp_path, ONLY_GROUND + tiny, 3.0, 0.5)
    tight = run_deck(tmp_path, ONLY_GROUND + tiny.replace("/>", 'scale="1e-9"/>'), 3.0, 0.5)
    off = [
        np.abs(r["diffs/1/value"] * 1e9 - np.exp(-2.0 * r["time"])).max() for r in (loose, tight)
    ]
    assert off[1] < 1e-5 < off[0]


def test_a_pid_holds_a_falling_ball_where_the_linear_theory_says(tmp_path):
    # with e = 1.2 - x: x'' = -g + kp e + ki z - kd x', z' = e
    kp, ki, kd = 60.0, 40.0, 14.0
    control = diff(1, "1.2-DZ(20)")
    law = f"{kp}*(1.2-DZ(20))+{ki}*DIF(1)-{kd}*VZ(20)"
    force = (
        '<Reference_Marker id="21" body_id="1" pos_z="0"/>'
        f'<Force_Scalar_TwoBody id="1" type="TRANSLATIONAL" i_marker_id="20" j_marker_id="21" '
        f'expr="{law}"/>'
    )
    model = GROUND + sphere(1.0) + GRAVITY + control + force
    results = run_deck(tmp_path, model, 6.0, 0.05, tol=1e-9)
    # (x - r, v, z): linear, with g as a constant
    A = np.array([[0.0, 1.0, 0.0], [-kp, -kd, ki], [-1.0, 0.0, 0.0]])
    rest = np.array([0.0, 0.0, 9.81 / ki])
    values, vectors = np.linalg.eig(A)
    part = np.linalg.solve(vectors, np.array([-0.2, 0.0, 0.0]) - rest)
    exact = (vectors @ (part[:, None] * np.exp(np.outer(values, results["time"])))).real
    np.testing.assert_allclose(
        results["bodies/2/position"][:, 2], 1.2 + exact[0] + rest[0], atol=1e-8
    )
    np.testing.assert_allclose(results["diffs/1/value"], exact[2] + rest[2], atol=1e-8)


def test_adams_diff_is_the_same_state(tmp_path):
    path = tmp_path / "deck.adm"
    path.write_text(
        "a deck\nUNITS/FORCE=NEWTON, MASS=KILOGRAM, LENGTH=METER, TIME=SECOND\nPART/1, GROUND\n"
        "DIFF/1, IC=1.0, FUNCTION=-2*DIF(1)\nEND\n"
    )
    results = mbsim.simulate(mbsim.read_model(path), end_time=2.0, print_interval=0.1)
    np.testing.assert_allclose(results["diffs/1/value"], np.exp(-2.0 * results["time"]), atol=1e-7)

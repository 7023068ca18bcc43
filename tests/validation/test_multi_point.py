"""Force_MultiPoint: of one marker a Force_Field, energy and momentum, and what is wrong with it."""

from __future__ import annotations

import numpy as np
import pytest

import mbsim
from mbsim.errors import DeckError

SEED = np.random.default_rng(1)
K, C = (part @ part.T for part in SEED.normal(size=(2, 18, 18)))
BODIES = """
  <Body_Rigid id="1" isground="TRUE"/>
  <Body_Rigid id="2" cg_id="21" mass="2" inertia_xx="0.1" inertia_yy="0.2" inertia_zz="0.3"
    w_ic_z="1" w_ic_z_flag="TRUE"/>
  <Body_Rigid id="3" cg_id="31" mass="1" inertia_xx="0.1" inertia_yy="0.1" inertia_zz="0.1"/>
  <Body_Rigid id="4" cg_id="41" mass="1" inertia_xx="0.1" inertia_yy="0.1" inertia_zz="0.1"/>
  <Reference_Marker id="10" body_id="1"/>
  <Reference_Marker id="20" body_id="2" pos_x="0.2" pos_z="0.5"/>
  <Reference_Marker id="21" body_id="2" pos_z="0.4"/>
  <Reference_Marker id="30" body_id="3" pos_y="0.3" a00="0.8" a10="0.6" a01="-0.6" a11="0.8"/>
  <Reference_Marker id="31" body_id="3" pos_y="0.1"/>
  <Reference_Marker id="40" body_id="4" pos_x="-0.3"/>
  <Reference_Marker id="41" body_id="4" pos_x="-0.2" pos_y="-0.2"/>"""


def matrix(id, values):
    """Return a Reference_Matrix."""
    rows, columns = values.shape
    text = " ".join(repr(float(x)) for x in values.ravel())
    size = f'nrow="{rows}" ncol="{columns}" isroworder="TRUE"'
    return f'<Reference_Matrix id="{id}" {size}>{text}</Reference_Matrix>'


def multi(markers, stiffness, damping, more=""):
    """Return a force between these markers and 30."""
    ids = " ".join(map(str, markers))
    return (
        f'<Force_MultiPoint id="7" ref_marker_id="30" kmtx_id="1" cmtx_id="2" {more} '
        f'n_i_marker="{len(markers)}">{ids}</Force_MultiPoint>{matrix(1, stiffness)}'
        f"{matrix(2, damping)}"
    )


def read(folder, model, command='<Simulate end_time="0.2" num_steps="4"/>'):
    deck = folder / "deck.xml"
    deck.write_text(
        f"<MotionSolve><Model>{BODIES}{model}</Model><Command>{command}</Command></MotionSolve>"
    )
    return mbsim.read_model(deck)


def test_of_one_marker_it_is_a_field(tmp_path):
    stiffness, damping = 20.0 * K[:6, :6], 0.1 * C[:6, :6]
    stiffness[0, 1] += 3.0
    entries = " ".join(
        f'K{r + 1}{c + 1}="{float(stiffness[r, c])!r}" C{r + 1}{c + 1}="{float(damping[r, c])!r}"'
        for r in range(6)
        for c in range(6)
    )
    ends = 'i_marker_id="20" j_marker_id="30"'
    field = f'<Force_Field id="1" {ends} length_x="0.1" preload_y="3" preload_tx="0.4" {entries}/>'
    columns = np.array([[0.0, 3.0, 0.0, 0.4, 0.0, 0.0], [0.1, 0.0, 0.0, 0.0, 0.0, 0.0]])
    force = multi([20], stiffness, damping, 'preload_mtx_id="3" length_mtx_id="4"')
    force += matrix(3, columns[:1].T) + matrix(4, columns[1:, :3].T)
    shown = (
        '<Post_Request id="1" type="EXPRESSION" expr1="{}" expr2="{}" expr3="{}" expr4="DX(20)"/>'
    )
    field += shown.format("FIELD(1,0,2,30)", "FIELD(1,1,5,10)", "FIELD(1,1,8)")
    force += shown.format("NFORCE(7,20,2,30)", "NFORCE(7,30,5,10)", "NFORCE(7,30,8)")
    for method in ("DOPRI5", "RADAU5"):
        expected, found = (
            mbsim.simulate(read(tmp_path, each), integrator=method) for each in (field, force)
        )
        np.testing.assert_allclose(found["requests/1"], expected["requests/1"], atol=1e-11)
        assert found.stats["rhs_evaluations"] == expected.stats["rhs_evaluations"]


@pytest.mark.parametrize("method", ["DOP853", "RADAU5"])
def test_energy_and_momentum_are_kept(method, tmp_path):
    model = read(tmp_path, multi([20, 40, 21], 20.0 * K, 0.0 * C))
    results = mbsim.simulate(model, integrator=method, tol=1e-9)
    assert not results.audit.warnings
    assert results.audit.entries["momentum"].value < 1e-12
    assert results.audit.entries["angular_momentum"].value < 1e-10
    total = results["energy/kinetic"] + results["energy/potential"]
    np.testing.assert_allclose(total, total[0], rtol=1e-7)


def test_what_is_deactivated_gives_nothing(tmp_path):
    command = """<Simulate end_time="0.1" num_steps="1"/>
  <Deactivate element_type="NFORCE" element_id="7"/><Simulate end_time="0.2" num_steps="1"/>"""
    results = mbsim.simulate(read(tmp_path, multi([20, 40, 21], K, C), command))
    for row in (7001, 7002, 7003):
        force = results[f"multi_point_forces/{row}/force"]
        assert np.abs(force[0]).max() > 1e-3
        assert not force[-1].any()


WRONG = {
    'kmtx_id="1"': ('kmtx_id="9"', 'kmtx_id="9": there is no Reference_Matrix 9'),
    'cmtx_id="2"': ('cmtx_id="3"', 'cmtx_id="3": is 6 x 1, must be 12 x 12'),
    'n_i_marker="2"': ('n_i_marker="3"', 'n_i_marker="3": 3, but there are 2 ids of markers'),
    "20 40": ("20 30", "marker 30 is ref_marker_id and an I marker"),
    ">20 40": (">20 99", 'i_marker_ids="99": there is no Reference_Marker 99'),
    'ref_marker_id="30"': ('cratio="1" ref_marker_id="30"', 'cratio="1": goes without cmtx_id'),
    "NFORCE(7,20": ("NFORCE(7,21", "marker 21 is none of its own: 20, 40, 30"),
    "NFORCE(7": ("NFORCE(8", "NFORCE(8, ...): there is no Force_MultiPoint 8"),
    'id="7"': ('id="7" length_mtx_id="1"', "is 12 x 12, must be 12 x 1 or 6 x 1"),
}


@pytest.mark.parametrize("right", WRONG)
def test_what_is_wrong_is_said(right, tmp_path):
    wrong, said = WRONG[right]
    model = multi([20, 40], K[:12, :12], C[:12, :12]) + matrix(3, np.ones((6, 1)))
    model += '<Post_Request id="1" type="EXPRESSION" expr1="NFORCE(7,20,2,0)"/>'
    assert right in model
    with pytest.raises(DeckError) as caught:
        read(tmp_path, model.replace(right, wrong, 1))
    assert said in str(caught.value)
    assert "deck.xml:" in str(caught.value)


def test_what_no_element_has_is_warned_of(tmp_path):
    uneven = K[:6, :6] + np.eye(6, k=1)
    (one, other) = read(tmp_path, multi([20], uneven, -C[:6, :6])).warnings
    assert "kmtx_id: K is not symmetric" in one
    assert "cmtx_id: damping feeds energy" in other

"""Force_Bushing and Force_Vector_... of XML decks: reading, faults, results, log, pictures."""

from __future__ import annotations

import csv

import numpy as np
import pytest
from click.testing import CliRunner

import mbsim
from helpers.decks import write_deck
from mbsim.cli.main import main
from mbsim.errors import DeckError, ModelError

BODIES = """
<Body_Rigid id="1" isground="TRUE"/>
<Body_Rigid id="2" cg_id="20" mass="2" inertia_xx="0.2" inertia_yy="0.3" inertia_zz="0.4"
  w_ic_z="1" w_ic_z_flag="TRUE"/>
<Body_Rigid id="3" cg_id="30" mass="1" inertia_xx="0.1" inertia_yy="0.1" inertia_zz="0.1"/>
<Reference_Marker id="10" body_id="1"/>
<Reference_Marker id="20" body_id="2"/>
<Reference_Marker id="21" body_id="2" pos_x="0.2" psi="0.3"/>
<Reference_Marker id="30" body_id="3" pos_x="1"/>
<Reference_Marker id="31" body_id="3" pos_x="0.7"/>
"""
BUSHING = """<Force_Bushing id="1" label="mount" i_marker_id="20" j_marker_id="10"
  kx="400" ky="500" kz="600" ktx="7" kty="8" ktz="9" cx="1" cy="2" cz="3" ctx="0.1" cty="0.2"
  ctz="0.3" preload_x="4" preload_tz="0.5"/>"""
TWO = """<Force_Vector_TwoBody id="2" label="pull" type="ForceAndTorque" i_marker_id="21"
  j_floating_marker_id="31" ref_marker_id="21" fx_expression="3*DX(31,21,21)" fz_expression="1"
  ty_expression="0.2*SIN(9*TIME)"/>"""
ONE = """<Force_Vector_OneBody id="3" type="ForceOnly" i_marker_id="31"
  fy_expression="-0.5*VY(31)-3*DY(31)" fx_expression="2*(0.7-DX(31))-0.5*VX(31)"/>"""
REQUESTS = """
<Post_Request id="1" type="ELEMENTAL_FORCE" elem_type="BUSHING" elem_id="1" ref_marker_id="10"/>
<Post_Request id="2" type="ELEMENTAL_FORCE" elem_type="VECTORFORCE" elem_id="2" jflag="TRUE"/>
<Post_Request id="3" type="ELEMENTAL_FORCE" elem_type="BODYFORCE" elem_id="3"/>
<Post_Request id="4" type="MARKER_FORCE" i_marker_id="20" j_marker_id="10"/>
<Post_Request id="5" type="EXPRESSION" expr2="BUSH(1,0,2,0)" expr3="GFORCE(2,1,3,0)"/>
"""
DECK = BODIES + BUSHING + TWO + ONE + REQUESTS


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """Return folder and results of one run."""
    folder = tmp_path_factory.mktemp("wrenches")
    path = write_deck(folder, DECK, 0.5, 0.05)
    out = folder / "out"
    result = CliRunner().invoke(main, ["run", str(path), "-o", str(out)])
    assert result.exit_code == 0, result.output
    with mbsim.open_results(next(out.glob("*.h5"))) as results:
        yield folder, path, results


def along(quaternion, a):
    """Return components along a body's axes of the global vector a, row by row."""
    w, u = quaternion[:, :1], -quaternion[:, 1:]
    return a + 2 * np.cross(u, np.cross(u, a) + w * a)


def test_forces_follow_the_formulas_at_every_row(done):
    _, _, results = done
    p, v = results["bodies/2/position"], results["bodies/2/velocity"]
    expected = np.array([4.0, 0, 0]) - p * [400, 500, 600] - v * [1, 2, 3]
    np.testing.assert_allclose(results["bushings/1/force"], expected, rtol=0, atol=1e-9)
    q, r = results["bodies/3/position"], results["bodies/3/quaternion"]
    arm = along(r * [1, -1, -1, -1], np.tile([-0.3, 0.0, 0.0], (len(r), 1)))
    spin = results["bodies/3/angular_velocity"]
    at, speed = q + arm, results["bodies/3/velocity"] + np.cross(spin, arm)
    one = results["body_forces/3/force"]
    np.testing.assert_allclose(one[:, 0], 2 * (0.7 - at[:, 0]) - 0.5 * speed[:, 0], atol=1e-9)
    np.testing.assert_allclose(one[:, 1], -0.5 * speed[:, 1] - 3 * at[:, 1], atol=1e-9)
    assert not one[:, 2].any()
    turned = np.linalg.norm(results["vector_forces/2/torque"], axis=1)
    np.testing.assert_allclose(turned, np.abs(0.2 * np.sin(9 * results["time"])), atol=1e-12)


def test_requests_are_what_the_groups_hold(done):
    folder, _, results = done
    bushing, two = results["bushings/1/force"], results["vector_forces/2/force"]
    one = results["body_forces/3/force"]
    requests = {k: np.asarray(results[f"requests/{k}"]) for k in range(1, 6)}
    np.testing.assert_allclose(requests[1][:, 1:4], bushing, atol=1e-12)
    np.testing.assert_allclose(requests[1][:, 5:], results["bushings/1/torque"], atol=1e-12)
    np.testing.assert_allclose(requests[2][:, 1:4], -two, atol=1e-12)
    np.testing.assert_allclose(requests[3][:, 1:4], one, atol=1e-12)
    np.testing.assert_allclose(requests[3][:, 0], np.linalg.norm(one, axis=1), atol=1e-12)
    np.testing.assert_allclose(requests[4][:, 1:4], bushing, atol=1e-12)
    np.testing.assert_allclose(requests[5][:, 1], bushing[:, 0], atol=1e-12)
    np.testing.assert_allclose(requests[5][:, 2], -two[:, 1], atol=1e-12)
    with next((folder / "out").glob("*.csv")).open() as file:
        rows = list(csv.reader(file))
    assert len([row for row in rows if row and row[0][:1].isdigit()]) == len(results["time"])


def test_log_names_them_with_their_largest(done):
    folder, _, results = done
    log = next((folder / "out").glob("*.log")).read_text()
    for name in ("Force_Bushing[1] mount", "Force_Vector_TwoBody[2] pull"):
        assert name in log
    (line,) = [line for line in log.splitlines() if "Force_Vector_OneBody[3]" in line]
    largest = np.linalg.norm(results["body_forces/3/force"], axis=1).max()
    assert f"{largest:.3g}"[:4] in line


def test_info_check_and_plot(done):
    folder, path, _ = done
    file = next((folder / "out").glob("*.h5"))
    call = CliRunner().invoke
    of_model = call(main, ["info", str(path)])
    assert of_model.exit_code == 0
    checked = call(main, ["check", str(path)])
    assert checked.exit_code == 0
    of_results = call(main, ["info", str(file)])
    for group in ("bushings/1/force", "vector_forces/2/torque", "body_forces/3/force"):
        assert group in of_results.output
    pytest.importorskip("matplotlib")
    picture = folder / "forces.svg"
    names = ["bushings/1/force/x", "vector_forces/2/torque/mag", "body_forces/3/force"]
    drawn = call(main, ["plot", str(file), *names, "-o", str(picture)])
    assert drawn.exit_code == 0, drawn.output
    assert picture.stat().st_size > 5000


FAULTS = {
    "no J": (BUSHING.replace('j_marker_id="10"', ""), r"Bushing\[1\]: j_marker_id: missing"),
    "no such J": (
        BUSHING.replace('j_marker_id="10"', 'j_marker_id="9"'),
        r'Bushing\[1\].*j_marker_id="9".*no Reference_Marker has this id',
    ),
    "negative": (BUSHING.replace('ky="500"', 'ky="-1"'), r'Bushing\[1\]: ky="-1": must be.*>= 0'),
    "no number": (BUSHING.replace('cx="1"', 'cx="a"'), r'cx="a".*number'),
    "unknown": (BUSHING.replace("kx=", "kxx="), r'kxx="400": unknown attribute'),
    "same body": (
        BUSHING.replace('j_marker_id="10"', 'j_marker_id="21"'),
        r"Bushing\[1\].*both on body 2",
    ),
    "twice": (BUSHING * 2, r"Bushing\[1\].*id already used"),
    "no type": (TWO.replace('type="ForceAndTorque"', ""), r"TwoBody\[2\]: type: missing"),
    "no such type": (TWO.replace("ForceAndTorque", "Both"), r'type="Both": must be one of'),
    "wrong type": (
        TWO.replace("ForceAndTorque", "ForceOnly"),
        r"ty_expression.*does not belong to type FORCEONLY",
    ),
    "no J floating": (
        TWO.replace('j_floating_marker_id="31"', ""),
        r"TwoBody\[2\]: j_floating_marker_id: missing",
    ),
    "no reference": (
        TWO.replace('ref_marker_id="21"', 'ref_marker_id="99"'),
        r'ref_marker_id="99".*no Reference_Marker has this id',
    ),
    "no expression": (
        TWO.replace('fz_expression="1"', 'fz_expression="1+"'),
        r"fz_expression.*is no expression",
    ),
    "marker in it": (
        TWO.replace("DX(31,21,21)", "DX(77)"),
        r"TwoBody\[2\].*fx_expression.*77.*no Reference_Marker has this id",
    ),
    "nothing": (
        '<Force_Vector_OneBody id="3" type="ForceOnly" i_marker_id="31"/>',
        r"OneBody\[3\].*missing; at least one must be given",
    ),
    "request": (
        BUSHING + '<Post_Request id="1" type="ELEMENTAL_FORCE" elem_type="BUSHING" elem_id="5"/>',
        r"Request\[1\].*elem_id.*5.*no Force_Bushing",
    ),
}


@pytest.mark.parametrize("name", sorted(FAULTS))
def test_every_fault_is_one_line_with_its_place(tmp_path, name):
    statements, said = FAULTS[name]
    path = write_deck(tmp_path, BODIES + statements, 0.1, 0.1)
    with pytest.raises((DeckError, ModelError), match=r"\.xml:\d+: .*" + said):
        mbsim.read_model(path)


def test_a_force_looks_at_no_acceleration(tmp_path):
    path = write_deck(tmp_path, BODIES + BUSHING + ONE.replace("3*DY(31)", "ACCY(31)"), 0.1, 0.1)
    said = r"\.xml:\d+: Force_Vector_OneBody\[3\]: .* cannot be used here"
    with pytest.raises(DeckError, match=said):
        mbsim.simulate(mbsim.read_model(path))


def test_a_bushing_that_does_nothing_is_worth_a_word(tmp_path):
    empty = '<Force_Bushing id="1" i_marker_id="20" j_marker_id="10"/>'
    path = write_deck(tmp_path, BODIES + empty, 0.1, 0.1)
    checked = CliRunner().invoke(main, ["check", str(path)])
    assert checked.exit_code == 0
    assert "the bushing does nothing" in checked.output

"""Reactions, applied forces and force requests of runs: balances that must hold at every row."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import mbsim
from helpers.decks import write_deck
from mbsim.errors import Interrupted

#: Two arms that swing in space, with a spring from the tip to ground and a drive at the hinge.
ARMS = """
<Body_Rigid id="1" isground="TRUE"/>
<Body_Rigid id="2" cg_id="20" mass="2" inertia_xx="0.02" inertia_yy="0.2" inertia_zz="0.2"/>
<Body_Rigid id="3" cg_id="30" mass="1" inertia_xx="0.01" inertia_yy="0.1" inertia_zz="0.1"/>
<Reference_Marker id="10" body_id="1"/>
<Reference_Marker id="11" body_id="1" pos_x="1.2" pos_y="-2" pos_z="0.4"/>
<Reference_Marker id="20" body_id="2" pos_x="0.5"/>
<Reference_Marker id="21" body_id="2"/>
<Reference_Marker id="22" body_id="2" pos_x="1"/>
<Reference_Marker id="30" body_id="3" pos_x="1.5" pos_y="0.1"/>
<Reference_Marker id="31" body_id="3" pos_x="1"/>
<Reference_Marker id="32" body_id="3" pos_x="2" pos_z="0.1"/>
<Constraint_Joint id="1" label="hinge" type="REVOLUTE" i_marker_id="21" j_marker_id="10"/>
<Constraint_Joint id="2" type="SPHERICAL" i_marker_id="31" j_marker_id="22"/>
<Force_SpringDamper id="5" type="TRANSLATIONAL" i_marker_id="32" j_marker_id="11"
  stiffness="40" damping="0.3" length="1.5"/>
<Force_Gravity grav_y="-9.81"/>
"""
DRIVE = """
<Motion_Joint id="4" joint_id="1" val_type="D" type="EXPRESSION" expr="0.4*SIN(3*TIME)"/>
"""
GRAVITY = np.array([0.0, -9.81, 0.0])


def of_markers(i: int, j: int, rm: int) -> str:
    """Return expr2..4 and expr6..8 of FX..TZ."""
    names = {2: "FX", 3: "FY", 4: "FZ", 6: "TX", 7: "TY", 8: "TZ"}
    return " ".join(f'expr{k}="{name}({i},{j},{rm})"' for k, name in names.items())


def of_element(name: str, id: int, jflag: int, rm: int) -> str:
    """Return expr2..4 and expr6..8 of JOINT, MOTION or SPDP."""
    return " ".join(f'expr{k}="{name}({id},{jflag},{k},{rm})"' for k in (2, 3, 4, 6, 7, 8))


REQUESTS = f"""
<Post_Request id="1" type="ELEMENTAL_FORCE" elem_type="JOINT" elem_id="1" ref_marker_id="30"/>
<Post_Request id="2" type="MARKER_FORCE" i_marker_id="21" j_marker_id="10"/>
<Post_Request id="3" type="MARKER_FORCE" i_marker_id="10" j_marker_id="21" ref_marker_id="20"/>
<Post_Request id="4" type="ELEMENTAL_FORCE" elem_type="SPRINGDAMPER" elem_id="5" jflag="TRUE"/>
<Post_Request id="5" type="ELEMENTAL_FORCE" elem_type="JOINT" elem_id="2" jflag="TRUE"/>
<Post_Request id="101" type="EXPRESSION" {of_element("JOINT", 1, 0, 30)}/>
<Post_Request id="102" type="EXPRESSION" {of_markers(21, 10, 0)}/>
<Post_Request id="103" type="EXPRESSION" {of_markers(10, 21, 20)}/>
<Post_Request id="104" type="EXPRESSION" {of_element("SPDP", 5, 1, 0)}/>
<Post_Request id="105" type="EXPRESSION" {of_element("JOINT", 2, 1, 0)}/>
"""


def run(folder: Path, model: str, **settings: object) -> mbsim.Results:
    """Run statements for a second, with 1001 rows."""
    deck = write_deck(folder, model, print_interval=0.001)
    return mbsim.simulate(mbsim.read_model(deck), tol=1e-8, **settings)


@pytest.fixture(scope="module")
def driven(tmp_path_factory: pytest.TempPathFactory) -> mbsim.Results:
    """Return a run with the drive and all requests."""
    folder = tmp_path_factory.mktemp("driven")
    return run(folder, ARMS + DRIVE + REQUESTS, output=folder)


def test_reactions_move_the_bodies(driven: mbsim.Results) -> None:
    a2, a3 = (driven[f"bodies/{id}/acceleration"] - GRAVITY for id in (2, 3))
    hinge, ball, spring = (
        driven[f"{name}/force"] for name in ("joints/1", "joints/2", "springs/5")
    )
    drive = driven["motions/4/force"]
    np.testing.assert_allclose(ball + spring, 1.0 * a3, atol=1e-9)
    np.testing.assert_allclose(hinge + drive - ball, 2.0 * a2, atol=1e-9)
    # a ball transmits no torque, a drive of a hinge no force
    np.testing.assert_allclose(driven["joints/2/torque"], 0.0, atol=1e-9)
    np.testing.assert_allclose(drive, 0.0, atol=1e-9)
    assert np.abs(driven["motions/4/torque/z"]).max() > 1.0


def test_the_work_of_a_drive_is_its_power(driven: mbsim.Results) -> None:
    power = (driven["motions/4/torque"] * driven["bodies/2/angular_velocity"]).sum(axis=1)
    t = driven["time"]
    work = np.concatenate([[0.0], np.cumsum(0.5 * (power[1:] + power[:-1]) * np.diff(t))])
    # the trapezoidal rule's own error is h^2/12 of the change of slope of the power: below 1e-4
    np.testing.assert_allclose(driven["energy/work_of_motions"], work, atol=2e-4)
    assert np.ptp(work) > 0.5


def test_energy_balances(driven: mbsim.Results) -> None:
    kinetic, potential, dissipated, work = (
        driven[f"energy/{name}"]
        for name in ("kinetic", "potential", "dissipated", "work_of_motions")
    )
    balance = kinetic + potential + dissipated - work
    np.testing.assert_allclose(balance, balance[0], atol=1e-5)
    assert driven.path is not None
    log = driven.path.with_suffix(".log").read_text(encoding="utf-8")
    said = next(line for line in log.splitlines() if "balance, change since the start" in line)
    assert float(said.split()[-1]) == pytest.approx(balance[-1] - balance[0], rel=1e-4, abs=1e-12)


@pytest.mark.parametrize("id", [1, 2, 3, 4, 5])
def test_requests_agree_with_expressions(driven: mbsim.Results, id: int) -> None:
    request, expression = driven[f"requests/{id}"], driven[f"requests/{100 + id}"]
    np.testing.assert_allclose(request, expression, atol=1e-10)
    assert np.abs(request[:, 0]).max() > 1.0


def test_the_log_names_the_largest_forces(driven: mbsim.Results) -> None:
    assert driven.path is not None
    log = driven.path.with_suffix(".log").read_text(encoding="utf-8")
    line = next(line for line in log.splitlines() if "Constraint_Joint[1] hinge  " in line)
    size = driven["joints/1/force/mag"]
    assert f"{size.max():.6g} at {driven['time'][size.argmax()]:.6g}" in line


def test_resume_keeps_forces_and_energies(tmp_path: Path) -> None:
    model = ARMS + DRIVE + REQUESTS

    def stop(time: float, step: float, end: float) -> None:
        if time > 0.2:
            raise Interrupted("enough")

    with pytest.raises(Interrupted):
        run(tmp_path, model, output=tmp_path / "a", progress=stop)
    with mbsim.open_results(tmp_path / "a/deck.h5") as results:
        assert results.status == "interrupted"
        assert 1 < len(results["joints/1/force"]) < 1001
    with (
        run(tmp_path, model, output=tmp_path / "a", resume=True) as resumed,
        run(tmp_path, model, output=tmp_path / "b") as straight,
    ):
        names = [name for name in straight.signals() if not name.startswith("bodies")]
        assert {"motions/4/torque", "energy/work_of_motions"} <= set(names)
        for name in names:
            np.testing.assert_array_equal(resumed[name], straight[name], err_msg=name)
    logs = [
        [
            line
            for line in (tmp_path / side / "deck.log").read_text(encoding="utf-8").splitlines()
            if "torque" in line or "balance" in line
        ]
        for side in "ab"
    ]
    # the interrupted part wrote a summary of its own first
    assert logs[0][-len(logs[1]) :] == logs[1]

"""Forces between markers in result files, requests, log and info, of rows made by hand."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from helpers.fake_run import SETTINGS, add_rows, checkpoint, fake_system_of
from helpers.free_bodies import spring_damper
from helpers.minimal_deck import added, read
from mbsim.cli import info
from mbsim.cli.main import main
from mbsim.core.layout import BODY_SIZE
from mbsim.errors import DeckError, ModelError
from mbsim.expressions import Expression
from mbsim.expressions.tree import Call, Node, Number, Time
from mbsim.model import elements as el
from mbsim.model.frames import rotation_313
from mbsim.model.names import element_name, statement_name
from mbsim.results.curves import Choice, collect
from mbsim.results.elements import acting, equations
from mbsim.results.identity import Identity
from mbsim.results.log import RunLog, _force_lines, counts, freedom, header
from mbsim.results.motion import matrices, motion
from mbsim.results.reading import Results
from mbsim.results.recorder import Recorder
from mbsim.results.requests import measures_of
from mbsim.results.watch import Watch

STATS = {"steps": 3}
#: A second body, and markers away from the cgs of both; 11 and 12 are on ground.
MORE = """<Body_Rigid id="3" label="rod" cg_id="30" mass="1" inertia_xx="1" inertia_yy="1"
 inertia_zz="1"/>
<Reference_Marker id="30" body_id="3" pos_x="2"/>
<Reference_Marker id="21" body_id="2" pos_x="0.5" pos_z="0.3"/>
<Reference_Marker id="31" body_id="3" pos_x="1.5" pos_y="-0.2" pos_z="0.1"/>
<Reference_Marker id="32" body_id="3" pos_x="1" a00="0" a10="1" a20="0" a01="-1" a11="0" a21="0"/>
<Reference_Marker id="11" body_id="1" pos_y="3"/>
<Reference_Marker id="12" body_id="1" pos_y="-1"/>
"""


def text(words: str) -> Expression:
    """Return an expression of which only the text matters."""
    return Expression(words, Number(0.0))


#: Joint 1 and its motion between 21 and 31, a primitive and a spring between 31 and ground, a
#: force on 21 only, and what has no markers of its own.
PARTS: dict[str, Any] = {
    "joints": {
        1: el.Joint(1, "REVOLUTE", "hinge", 21, 31),
        2: el.Joint(2, "FREE", "", 21, 12),
    },
    "primitives": {1: el.Joint(1, "INPLANE", "", 31, 11, is_primitive=True)},
    "couplers": {4: el.Coupler(4, "", (1, 2), ("R", "R"), (1.0, 2.0))},
    "motions": {6: el.Motion(6, "drive", joint_id=1, expr=text("2*TIME"))},
    "general_constraints": {8: el.GeneralConstraint(8, text("DX(21)"))},
    "marker_forces": {
        "SPRINGDAMPER": {5: spring_damper(5, "TRANSLATIONAL", 11, 31, 100.0, 0.0, 1.5)}
    },
    "scalar_forces": {
        7: el.ScalarForce(7, "TRANSLATIONAL", text("3"), "push", 21, 32, action_only=True)
    },
}
#: Rows of `Rows.joint` in the order of the fake system.
JOINT, FREE, JPRIM, COUPLER, MOTION, GCON = range(6)
SPRING, SFORCE = range(2)


def model_of(folder: Path, *requests: el.Request) -> el.Model:
    """Return two bodies with elements between them, and requests."""
    folder.mkdir(parents=True, exist_ok=True)
    model = read(folder, added(MORE.rstrip("\n")))
    return dataclasses.replace(model, requests={r.id: r for r in requests}, **PARTS)


def request(kind: str, i: int = 0, j: int | None = None, **more: Any) -> el.Request:
    """Return request 7 of MARKER_FORCE, or ELEMENTAL_FORCE where `elem_type` is given."""
    return el.Request(7, kind, i_marker_id=i, j_marker_id=j, **more)


def moved_rows(system: Any, count: int = 5) -> np.ndarray[Any, Any]:
    """Append rows in which bodies lie about and all wrenches differ; return y."""
    random = np.random.default_rng(11)
    add_rows(system, 0, count, events=False)
    rows = system.scene.rows
    for k in range(count):
        for b in range(2):
            at = BODY_SIZE * b
            rows.y[k, at : at + 3] = random.normal(size=3)
            q = random.normal(size=4)
            rows.y[k, at + 3 : at + 7] = q / np.linalg.norm(q)
        for table in (rows.joint, rows.applied, rows.contact):
            table[k] = random.normal(size=table.shape[1])
    return rows.y[:count].copy()


def run(system: Any, folder: Path | None = None) -> Results:
    """Record what is in the rows."""
    recorder = Recorder(system, SETTINGS, folder)
    recorder.take()
    return recorder.close("finished", STATS, system.scene.log.contacts)


def asked(folder: Path, wanted: el.Request) -> tuple[Any, Any, np.ndarray[Any, Any]]:
    """Return a request's table of moved rows, the system and y."""
    system = fake_system_of(model_of(folder, wanted))
    y = moved_rows(system)
    with run(system) as results:
        return results["requests/7"], system, y


def where(system: Any, y: np.ndarray[Any, Any], marker_id: int) -> Any:
    """Return a marker's origin (n, 3) and axes (n, 3, 3)."""
    place = system.placement.markers[marker_id]
    if place.body_id == 1:
        n = len(y)
        return np.tile(place.p, (n, 1)), np.tile(place.R, (n, 1, 1))
    bodies = motion(system.body_ids, y, np.zeros((len(y), 6 * len(system.body_ids))))
    b = system.body_ids.index(place.body_id)
    R = matrices(bodies.q[:, b])
    return bodies.p[:, b] + R @ place.p_B, R @ place.R_B


def wrench(table: Any, row: int, count: int = 5) -> Any:
    """Return force and torque (n, 3) of a row of `Rows.joint` or `Rows.applied`."""
    return table[:count, 6 * row : 6 * row + 3], table[:count, 6 * row + 3 : 6 * row + 6]


def check(table: Any, force: Any, torque: Any) -> None:
    """Compare F1..F8 with a force and a torque."""
    np.testing.assert_allclose(table[:, 1:4], force, atol=1e-13)
    np.testing.assert_allclose(table[:, 5:8], torque, atol=1e-13)
    np.testing.assert_allclose(table[:, 0], np.linalg.norm(force, axis=1))
    np.testing.assert_allclose(table[:, 4], np.linalg.norm(torque, axis=1))


def of_element(elem_type: str, id: int, **more: Any) -> el.Request:
    """Return an ELEMENTAL_FORCE."""
    return request("ELEMENTAL_FORCE", elem_type=elem_type, elem_id=id, **more)


# --- signals ---------------------------------------------------------------------------------


def test_signals_of_every_element(tmp_path: Path) -> None:
    system = fake_system_of(model_of(tmp_path / "deck"))
    add_rows(system, 0, 4)
    with run(system, tmp_path) as results:
        for row, path in enumerate(
            ("joints/1", "joints/2", "primitives/1", "couplers/4", "motions/6")
        ):
            first = 6 * row + 200
            np.testing.assert_array_equal(results[f"{path}/force"][2], first + np.arange(3))
            np.testing.assert_array_equal(results[f"{path}/torque"][2], first + 3 + np.arange(3))
        assert results["general_constraints/8/torque/z"][1] == 100 + 6 * GCON + 5
        assert results["springs/5/force/x"][1] == 100
        assert results["scalar_forces/7/force/x"][1] == 106
        np.testing.assert_array_equal(results["energy/work_of_motions"], [0, 4, 8, 12])
        assert results.label("joints/1") == "hinge"
        assert results.attribute("joints/1", "type") == "REVOLUTE"
        assert results.ids("joints") == [1, 2]
        assert results.find("joints/*/force/z") == ["joints/1/force/z", "joints/2/force/z"]


def test_no_motion_no_work_of_motions(tmp_path: Path) -> None:
    model = dataclasses.replace(model_of(tmp_path / "deck"), motions={})
    system = fake_system_of(model)
    add_rows(system, 0, 2)
    with run(system) as results:
        assert "energy/work_of_motions" not in results
        assert "motions" not in {name.split("/")[0] for name in results.keys()}
    # something else may drive the system too: then the rows say where they keep its work
    system.scene.world.accumulators[0] = 26
    add_rows(system, 0, 2)
    with run(system) as results:
        assert "energy/work_of_motions" in results


def test_run_without_rows_has_empty_signals(tmp_path: Path) -> None:
    wanted = [of_element("JOINT", 1), dataclasses.replace(request("MARKER_FORCE", 21), id=9)]
    system = fake_system_of(model_of(tmp_path / "deck", *wanted))
    with run(system, tmp_path) as results:
        assert results["joints/1/force"].shape == (0, 3)
        assert results["requests/7"].shape == results["requests/9"].shape == (0, 8)


# --- requests --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("elem_type", "id", "row"),
    [("JOINT", 1, JOINT), ("JPRIM", 1, JPRIM), ("MOTION", 6, MOTION), ("GCON", 8, GCON)],
)
def test_force_of_a_constraint(tmp_path: Path, elem_type: str, id: int, row: int) -> None:
    table, system, _ = asked(tmp_path, of_element(elem_type, id))
    check(table, *wrench(system.scene.rows.joint, row))


@pytest.mark.parametrize(
    ("elem_type", "id", "row"), [("SPRINGDAMPER", 5, SPRING), ("SFORCE", 7, SFORCE)]
)
def test_force_of_an_applied_element(tmp_path: Path, elem_type: str, id: int, row: int) -> None:
    table, system, _ = asked(tmp_path, of_element(elem_type, id))
    check(table, *wrench(system.scene.rows.applied, row))


@pytest.mark.parametrize(
    ("elem_type", "id", "i", "j"),
    [("JOINT", 1, 21, 31), ("MOTION", 6, 21, 31), ("SPRINGDAMPER", 5, 11, 31)],
)
def test_both_sides_balance(tmp_path: Path, elem_type: str, id: int, i: int, j: int) -> None:
    on_i, system, y = asked(tmp_path / "i", of_element(elem_type, id))
    on_j, _, _ = asked(tmp_path / "j", of_element(elem_type, id, jflag=True))
    p_i, p_j = where(system, y, i)[0], where(system, y, j)[0]
    np.testing.assert_allclose(on_i[:, 1:4], -on_j[:, 1:4])
    # about the global origin
    about = [side[:, 5:8] + np.cross(p, side[:, 1:4]) for side, p in ((on_i, p_i), (on_j, p_j))]
    np.testing.assert_allclose(about[0], -about[1], atol=1e-12)
    # and the torque on J is a torque about J's origin: it differs from the one about I's
    assert np.abs(on_i[:, 5:8] + on_j[:, 5:8]).max() > 0.1


def test_nothing_acts_on_j_of_a_one_sided_force(tmp_path: Path) -> None:
    assert not asked(tmp_path / "a", of_element("SFORCE", 7, jflag=True))[0].any()
    assert not asked(tmp_path / "b", request("MARKER_FORCE", 32))[0].any()


def test_a_joint_that_holds_nothing_has_no_force(tmp_path: Path) -> None:
    model = model_of(tmp_path, of_element("JOINT", 2))
    system = fake_system_of(model)
    moved_rows(system)
    # the dynamics need not have a row of it
    system.scene.connections.i = np.delete(system.scene.connections.i, FREE)
    system.scene.connections.j = np.delete(system.scene.connections.j, FREE)
    del system.connections[FREE]
    system.scene.rows = system.scene.rows._replace(
        joint=np.delete(system.scene.rows.joint, np.s_[6:12], axis=1)
    )
    with run(system) as results:
        assert not results["requests/7"].any()
        assert results.ids("joints") == [1, 2]
        assert "joints/2/force" not in results


def test_marker_force_adds_all_between_two_markers(tmp_path: Path) -> None:
    table, system, _ = asked(tmp_path, request("MARKER_FORCE", 21, 31))
    joint = system.scene.rows.joint
    parts = [wrench(joint, row) for row in (JOINT, MOTION)]
    check(table, sum(force for force, _ in parts), sum(torque for _, torque in parts))


def test_marker_force_in_the_other_order_is_what_acts_on_j(tmp_path: Path) -> None:
    one, system, y = asked(tmp_path / "a", request("MARKER_FORCE", 21, 31))
    other, _, _ = asked(tmp_path / "b", request("MARKER_FORCE", 31, 21))
    arm = where(system, y, 21)[0] - where(system, y, 31)[0]
    check(other, -one[:, 1:4], -one[:, 5:8] - np.cross(arm, one[:, 1:4]))


def test_marker_force_without_j_adds_all_at_i(tmp_path: Path) -> None:
    # on 31: joint 1 and its motion as J, the primitive as I, the spring as J
    table, system, y = asked(tmp_path, request("MARKER_FORCE", 31))
    rows = system.scene.rows
    p = where(system, y, 31)[0]
    force, torque = wrench(rows.joint, JPRIM)
    for values, row, i in (
        (rows.joint, JOINT, 21),
        (rows.joint, MOTION, 21),
        (rows.applied, 0, 11),
    ):
        f, m = wrench(values, row)
        force, torque = force - f, torque - m - np.cross(where(system, y, i)[0] - p, f)
    check(table, force, torque)


def test_marker_force_without_j_has_one_sided_forces(tmp_path: Path) -> None:
    # on 21: the joints 1 and 2, the motion and the force, as I of all
    table, system, _ = asked(tmp_path, request("MARKER_FORCE", 21))
    parts = [wrench(system.scene.rows.joint, row) for row in (JOINT, FREE, MOTION)]
    parts.append(wrench(system.scene.rows.applied, SFORCE))
    check(table, sum(force for force, _ in parts), sum(torque for _, torque in parts))


def test_marker_force_between_markers_that_share_nothing(tmp_path: Path) -> None:
    assert not asked(tmp_path / "a", request("MARKER_FORCE", 21, 11))[0].any()
    # the force on 21 is along a line to 32, but nothing acts on 32
    assert not asked(tmp_path / "d", request("MARKER_FORCE", 21, 32))[0].any()
    # 20 is in no element at all
    assert not asked(tmp_path / "b", request("MARKER_FORCE", 20))[0].any()
    assert not asked(tmp_path / "c", request("MARKER_FORCE", 21, 20))[0].any()


@pytest.mark.parametrize("marker_id", [32, 12])
def test_reference_marker_resolves_forces(tmp_path: Path, marker_id: int) -> None:
    plain, system, y = asked(tmp_path / "a", request("MARKER_FORCE", 21, 31))
    turned, _, _ = asked(tmp_path / "b", request("MARKER_FORCE", 21, 31, ref_marker_id=marker_id))
    R = where(system, y, marker_id)[1]
    for n in range(len(y)):
        np.testing.assert_allclose(turned[n, 1:4], R[n].T @ plain[n, 1:4], atol=1e-13)
        np.testing.assert_allclose(turned[n, 5:8], R[n].T @ plain[n, 5:8], atol=1e-13)


def test_force_of_a_contact(tmp_path: Path) -> None:
    on_i, system, y = asked(tmp_path / "i", of_element("CONTACT", 301))
    contact = system.scene.rows.contact
    force, torque = contact[:5, 0:3], contact[:5, 3:6]
    check(on_i, force, torque)
    # J is on ground, whose cg is the global origin; I is body 2
    on_j, _, _ = asked(tmp_path / "j", of_element("CONTACT", 301, jflag=True))
    check(on_j, -force, -torque - np.cross(y[:, 0:3], force))


def test_torque_on_j_of_a_contact_needs_one_body(tmp_path: Path) -> None:
    model = model_of(tmp_path, of_element("CONTACT", 301, jflag=True))
    graphics = {**model.graphics, 300: dataclasses.replace(model.graphics[200], id=300)}
    graphics[300] = dataclasses.replace(graphics[300], marker_id=30)
    contact = dataclasses.replace(model.contacts[301], i_graphics_id=(200, 300))
    model = dataclasses.replace(model, graphics=graphics, contacts={301: contact})
    with pytest.raises(DeckError, match=r'Post_Request\[7\]: jflag="TRUE": .* several bodies'):
        run(fake_system_of(model))
    # on I's side the rows have it
    model = dataclasses.replace(model, requests={7: of_element("CONTACT", 301)})
    system = fake_system_of(model)
    add_rows(system, 0, 2)
    with run(system) as results:
        assert results["requests/7"].any()


@pytest.mark.parametrize(
    ("wanted", "said"),
    [
        (of_element("JOINT", 3), r'elem_id="3": no Constraint_Joint has this id; there are 1, 2'),
        (of_element("JOIN", 1), r'elem_type="JOIN": must be one of JOINT, JPRIM'),
    ],
)
def test_force_of_what_is_not_there(tmp_path: Path, wanted: el.Request, said: str) -> None:
    source = el.Source("deck.xml", 12)
    system = fake_system_of(model_of(tmp_path, dataclasses.replace(wanted, source=source)))
    with pytest.raises(DeckError, match=rf"deck.xml:12: Post_Request\[7\]: {said}"):
        run(system, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def expressions(*exprs: str | None) -> el.Request:
    """Return an EXPRESSION."""
    return request("EXPRESSION", exprs=tuple(text(e) if e else None for e in exprs))


def test_expressions_and_magnitudes(tmp_path: Path) -> None:
    wanted = expressions(None, "JOINT(1,0,2,0)", "DX(21)", None, None, "1", "2", "TIME")
    table, system, _ = asked(tmp_path, wanted)
    assert system.values == [(7, 2), (7, 3), (7, 6), (7, 7), (7, 8)]
    # add_rows: column c of row k is 1 + c + k
    k = np.arange(5.0)
    np.testing.assert_array_equal(table[:, 1:4], np.column_stack([k + 1, k + 2, 0 * k]))
    np.testing.assert_array_equal(table[:, 5:8], np.column_stack([k + 3, k + 4, k + 5]))
    np.testing.assert_allclose(table[:, 0], np.hypot(k + 1, k + 2))
    np.testing.assert_allclose(table[:, 4], np.sqrt((k + 3) ** 2 + (k + 4) ** 2 + (k + 5) ** 2))


def test_expressions_of_the_deck_stay(tmp_path: Path) -> None:
    table, _, _ = asked(tmp_path, expressions("10", "20", None, None, "50"))
    np.testing.assert_array_equal(table[2], [3, 4, 0, 0, 5, 0, 0, 0])


def test_requests_as_csv(tmp_path: Path) -> None:
    wanted = [of_element("JOINT", 1), dataclasses.replace(expressions(None, "TIME"), id=9)]
    system = fake_system_of(model_of(tmp_path / "deck", *wanted))
    add_rows(system, 0, 3)
    with run(system, tmp_path) as results:
        lines = (tmp_path / "deck.csv").read_text().splitlines()
        assert lines[0].split(",")[9:11] == ["9.F1", "9.F2"]
        read_back = np.array([[float(n) for n in line.split(",")] for line in lines[1:]])
        both = np.hstack([results["requests/7"], results["requests/9"]])
        np.testing.assert_array_equal(read_back[:, 1:], both)
        assert list(results.attribute("requests/7", "columns")[:2]) == ["mag", "fx"]
        columns = results.attribute("requests/9", "columns")
        assert list(columns) == ["mag", "TIME", "", "", "mag", "", "", ""]


# --- pictures --------------------------------------------------------------------------------


def test_pictures_say_what_and_in_what_unit(tmp_path: Path) -> None:
    long = "JOINT(1,0,2,0)+" * 10 + "1"
    wanted = [
        of_element("JOINT", 1, label="reaction"),
        dataclasses.replace(expressions(None, "TIME", long), id=9),
    ]
    system = fake_system_of(model_of(tmp_path / "deck", *wanted))
    add_rows(system, 0, 3)
    names = (
        *("joints/1/force/z", "motions/6/torque/mag", "scalar_forces/7/force/x"),
        *("energy/work_of_motions", "requests/7/F2", "requests/7/F6"),
        *("requests/9/F2", "requests/9/F3", "requests/9/F4", "general_constraints/8/force/x"),
    )
    with run(system, tmp_path) as results:
        picture = collect([results], Choice(names))
    labels = {curve.name: curve.label for panel in picture.panels for curve in panel.curves}
    axes = {curve.name: panel.axis for panel in picture.panels for curve in panel.curves}
    assert labels["joints/1/force/z"] == "joint 1 (hinge), z"
    assert labels["motions/6/torque/mag"] == "motion 6 (drive), magnitude"
    assert labels["scalar_forces/7/force/x"] == "scalar force 7 (push), x"
    assert labels["general_constraints/8/force/x"] == "general constraint 8, x"
    assert labels["requests/7/F2"] == "request 7 (reaction), F2 = fx"
    assert labels["requests/9/F2"] == "request 9, F2 = TIME"
    assert labels["requests/9/F3"] == f"request 9, F3 = {long[:40]}..."
    assert labels["requests/9/F4"] == "request 9, F4"
    assert axes["joints/1/force/z"] == axes["requests/7/F2"] == "Force [N]"
    assert axes["motions/6/torque/mag"] == axes["requests/7/F6"] == "Torque [N·m]"
    assert axes["energy/work_of_motions"] == "Energy [J]"


def call(name: str, *args: float | Node) -> Call:
    """Return a call of a function, numbers as they are."""
    return Call(name, tuple(Number(a) if isinstance(a, (int, float)) else a for a in args))


@pytest.mark.parametrize(
    ("node", "measure"),
    [
        (call("JOINT", 1, 0, 4, 0), "force"),
        (call("JOINT", 1, 0, 5, 0), "torque"),
        (call("NEG", call("NEG", call("SFORCE", 1, 0, 8, 0))), "torque"),
        (call("FX", 21, 31), "force"),
        (call("TZ", 21, 31), "torque"),
        (call("DX", 21), "displacement"),
        (call("AZ", 21), "angle"),
        (call("VR", 21), "velocity"),
        (call("WM", 21), "angular_velocity"),
        (call("MUL", 2, call("DX", 21)), ""),
        (call("ORIENT", 27, 1, 21, 31), ""),
        (Time(), ""),
    ],
)
def test_measures_of_expressions(node: Node, measure: str) -> None:
    wanted = request("EXPRESSION", exprs=(Expression("", node),))
    assert measures_of(wanted) == (measure, *[""] * 7)


def test_magnitudes_are_of_the_kind_of_their_components() -> None:
    dx, dy, wx = (Expression("", call(name, 21)) for name in ("DX", "DY", "WX"))
    exprs = (None, dx, None, dy, None, wx, dx)
    assert measures_of(request("EXPRESSION", exprs=exprs)) == (
        *("displacement", "displacement", "", "displacement"),
        *("", "angular_velocity", "displacement", ""),
    )


def test_units_of_expressions(tmp_path: Path) -> None:
    force = Expression("JOINT(1,0,2,0)", call("JOINT", 1, 0, 2, 0))
    system = fake_system_of(
        model_of(tmp_path / "deck", request("EXPRESSION", exprs=(None, force, text("1"))))
    )
    add_rows(system, 0, 3)
    with run(system, tmp_path) as results:
        axes = [
            p.axis for p in collect([results], Choice(("requests/7/F2", "requests/7/F3"))).panels
        ]
    assert axes == ["Force [N]", "Request 7"]


# --- log -------------------------------------------------------------------------------------


def test_watch_keeps_the_largest_and_when() -> None:
    watch = Watch([("JOINT", 1), ("MOTION", 6)])
    assert np.isnan(watch.peaks).all()
    wrenches = np.zeros((3, 12))
    wrenches[:, 0] = [1.0, -5.0, 2.0]
    wrenches[:, 5] = [3.0, 0.0, 0.0]
    wrenches[2, 6] = np.nan
    energy = np.arange(12.0).reshape(3, 4)
    watch.add(np.array([0.0, 0.1, 0.2]), energy, wrenches)
    np.testing.assert_array_equal(watch.peaks[0], [5.0, 0.1, 3.0, 0.0])
    np.testing.assert_array_equal(watch.peaks[1], [0.0, 0.0, 0.0, 0.0])
    watch.add(np.array([0.3]), energy[:1], -wrenches[:1] * 2)
    np.testing.assert_array_equal(watch.peaks[0], [5.0, 0.1, 6.0, 0.3])
    watch.add(np.zeros(0), energy[:0], wrenches[:0])
    np.testing.assert_array_equal(watch.first, energy[0])
    np.testing.assert_array_equal(watch.last, energy[0])


def logged(system: Any, watch: Watch | None = None) -> list[str]:
    """Return the lines of a finished run's log, with single spaces."""
    log = RunLog(system, SETTINGS, None)
    log.close("finished", {"steps": 1}, watch)
    return [" ".join(line.split()) for line in log.lines]


def test_log_of_a_mechanism(tmp_path: Path) -> None:
    nothing = dataclasses.replace(request("MARKER_FORCE", 21, 11), id=9)
    system = fake_system_of(model_of(tmp_path / "deck", request("MARKER_FORCE", 21, 31), nothing))
    add_rows(system, 0, 4)
    recorder = Recorder(system, SETTINGS, tmp_path)
    recorder.take()
    lines = logged(system, recorder.watch)
    recorder.close("finished", STATS, system.scene.log.contacts).close()
    largest = np.linalg.norm([300.0, 301.0, 302.0])
    turning = np.linalg.norm([303.0, 304.0, 305.0])
    for said in (
        "joints 2",
        "primitives 1",
        "general_constraints 1",
        "scalar_forces 1",
        "scalar constraint equations 9",
        f"Constraint_Joint[1] hinge {largest:.6g} at 0.3, torque {turning:.6g} at 0.3",
        f"Force_SpringDamper[5] {largest:.6g} at 0.3, torque {turning:.6g} at 0.3",
        "work of motions 12",
        "balance, change since the start 6",
        "of kinetic + potential + dissipated - work of motions",
        "degrees of freedom, all bodies 1",
    ):
        assert said in lines, f"{said!r} is not in\n" + "\n".join(lines)
    zero = [line for line in lines if "no element acts" in line]
    assert zero == [
        "warning: Post_Request[9]: no element acts at Reference_Marker[21] and "
        "Reference_Marker[11]; it is 0"
    ]


def test_energy_balance_is_not_told_where_gravity_changes(tmp_path: Path) -> None:
    model = model_of(tmp_path)
    other = el.Simulation(start_time=3.0, end_time=4.0, gravity=el.Gravity())
    model = dataclasses.replace(model, simulations=(*model.simulations, other))
    watch = Watch([])
    watch.add(np.zeros(1), np.zeros((1, 4)), np.zeros((1, 0)))
    lines = logged(fake_system_of(model), watch)
    assert "kinetic 0" in lines
    assert not any(line.startswith("balance") for line in lines)


def test_nothing_of_joints_where_there_are_none(tmp_path: Path) -> None:
    system = fake_system_of(read(tmp_path, added("")))
    assert freedom(system) is None
    assert list(counts(system.model)) == ["bodies", "markers", "graphics", "contacts", "requests"]
    recorder = Recorder(system, SETTINGS, None)
    add_rows(system, 0, 1)
    recorder.take()
    lines = logged(system, recorder.watch)
    recorder.close("finished", STATS, system.scene.log.contacts).close()
    assert not any("largest force and torque" in line or "freedom" in line for line in lines)


# --- resume ----------------------------------------------------------------------------------


def interrupted(folder: Path) -> Any:
    """Record ten rows and stop; return the system."""
    system = fake_system_of(model_of(folder / "deck", of_element("JOINT", 1)))
    recorder = Recorder(system, SETTINGS, folder)
    # the largest force comes early, the least energy first
    add_rows(system, 0, 10)
    system.scene.rows.joint[2] *= 50.0
    recorder.take()
    recorder.flush(checkpoint(10))
    recorder.close("interrupted", STATS, system.scene.log.contacts).close()
    return system


def test_a_resumed_run_knows_the_rows_before(tmp_path: Path) -> None:
    system = interrupted(tmp_path)
    recorder = Recorder(system, SETTINGS, tmp_path, resume=True)
    add_rows(system, 10, 5)
    recorder.take()
    np.testing.assert_array_equal(recorder.watch.first, np.zeros(4))
    np.testing.assert_array_equal(recorder.watch.last, [14, 28, 42, 56])
    assert recorder.watch.peaks[JOINT, 1] == pytest.approx(0.2)
    with recorder.close("finished", STATS, system.scene.log.contacts) as results:
        assert results["joints/1/force"].shape == (15, 3)
        assert results["requests/7"].shape == (15, 8)
        assert results["requests/7/F2"][14] == 1400.0
        np.testing.assert_array_equal(results["energy/work_of_motions"], 4.0 * np.arange(15))


def test_many_writes_give_the_forces_of_one(tmp_path: Path) -> None:
    system = fake_system_of(model_of(tmp_path / "deck", request("MARKER_FORCE", 31)))
    recorder = Recorder(system, SETTINGS, None)
    for first in range(0, 12, 3):
        add_rows(system, first, 3)
        recorder.take()
        recorder._write()
    add_rows(system, 0, 12)
    with (
        run(system) as whole,
        recorder.close("finished", STATS, system.scene.log.contacts) as parts,
    ):
        for name in whole.signals():
            np.testing.assert_array_equal(parts[name], whole[name], err_msg=name)


@pytest.mark.parametrize(
    ("member", "change"),
    [
        ("SPRINGDAMPER", {"parameters": spring_damper(5, "ROTATIONAL", 11, 31).parameters}),
        ("motions", {"expr": text("3*TIME")}),
        ("joints", {"type": "SPHERICAL"}),
        ("requests", {"jflag": True}),
    ],
)
def test_resume_with_another_element(tmp_path: Path, member: str, change: Any) -> None:
    model = interrupted(tmp_path).model
    element = next(iter(model.table(member).values()))
    changed = model.changed((el.Change(member, dataclasses.replace(element, **change), ""),))
    other = fake_system_of(changed)
    with pytest.raises(ModelError, match="elements of the model have changed"):
        Recorder(other, SETTINGS, tmp_path, resume=True)


def test_a_deep_expression_is_part_of_the_digest(tmp_path: Path) -> None:
    node: Node = Time()
    for _ in range(2000):
        node = call("ADD", node, 1)
    motion = el.Motion(6, joint_id=1, expr=Expression("TIME" + "+1" * 2000, node))
    model = dataclasses.replace(model_of(tmp_path / "deck"), motions={6: motion})
    digests = []
    for text_of in ("TIME" + "+1" * 2000, "TIME" + "+1" * 1999):
        changed = dataclasses.replace(motion, expr=Expression(text_of, node))
        system = fake_system_of(dataclasses.replace(model, motions={6: changed}))
        digests.append(Identity(system).digests["system_sha256"])
    assert digests[0] != digests[1]


def test_resume_where_the_deck_has_another_path(tmp_path: Path) -> None:
    model = interrupted(tmp_path).model
    moved = {
        id: dataclasses.replace(joint, source=el.Source("elsewhere/deck.xml", 4))
        for id, joint in model.joints.items()
    }
    again = fake_system_of(dataclasses.replace(model, joints=moved))
    recorder = Recorder(again, SETTINGS, tmp_path, resume=True)
    assert int(recorder.checkpoint["stage"]) == 10
    recorder.abandon()


def test_resume_where_a_marker_has_moved(tmp_path: Path) -> None:
    model = interrupted(tmp_path).model
    marker = dataclasses.replace(model.markers[31], R=rotation_313(0.1, 0.0, 0.0))
    other = fake_system_of(dataclasses.replace(model, markers={**model.markers, 31: marker}))
    with pytest.raises(ModelError, match="elements of the model have changed"):
        Recorder(other, SETTINGS, tmp_path, resume=True)


# --- info ------------------------------------------------------------------------------------


def test_equations_are_counted(tmp_path: Path) -> None:
    # REVOLUTE 5, FREE 0, INPLANE 1, and one each of coupler, motion and general constraint
    assert equations(model_of(tmp_path)) == 9


def test_info_of_a_model(tmp_path: Path) -> None:
    about = info._about_model(model_of(tmp_path))
    assert json.loads(json.dumps(about))
    assert about["counts"]["joints"] == 2
    assert about["joints"]["1"] == {
        "label": "hinge",
        "type": "REVOLUTE",
        "i": "Reference_Marker[21] of Body_Rigid[2]",
        "j": "Reference_Marker[31] of Body_Rigid[3]",
    }
    assert about["motions"]["6"]["expression"] == "2*TIME"
    assert about["motions"]["6"]["joint_id"] == 1
    assert about["springs"]["5"]["stiffness"] == 100.0
    assert about["springs"]["5"]["damping"] == 0.0
    assert about["couplers"]["4"]["scales"] == [1.0, 2.0]
    assert list(about["degrees_of_freedom"].values()) == [12, 9, 3]


def test_info_of_a_model_without_joints_says_nothing_of_them(tmp_path: Path) -> None:
    about = info._about_model(read(tmp_path, added("")))
    assert not {"joints", "degrees_of_freedom"} & set(about)


def test_info_of_a_result_file(tmp_path: Path) -> None:
    system = fake_system_of(model_of(tmp_path / "deck", of_element("JOINT", 1)))
    add_rows(system, 0, 4)
    run(system, tmp_path).close()
    file = str(tmp_path / "deck.h5")
    done = CliRunner().invoke(main, ["info", "--json", file])
    about = json.loads(done.output)
    assert about["counts"]["joints"] == 2
    assert about["joints"]["1"]["largest_force"] == pytest.approx(
        np.linalg.norm([300.0, 301.0, 302.0])
    )
    assert about["joints"]["1"]["label"] == "hinge"
    assert about["springs"]["5"]["type"] == "TRANSLATIONAL"
    lines = [
        " ".join(line.split())
        for line in CliRunner().invoke(main, ["info", file]).output.splitlines()
    ]
    assert "joints/{1,2}/force /x /y /z /mag N" in lines
    assert "requests/7 /F1 /F2 /F3 /F4 /F5 /F6 /F7 /F8 N, N·m" in lines
    assert "energy/work_of_motions J" in lines


def test_info_gives_every_request_its_own_units(tmp_path: Path) -> None:
    turn = Expression("WX(21)", call("WX", 21))
    wanted = [
        of_element("JOINT", 1),
        request("MARKER_VELOCITY", 21),
        request("EXPRESSION", exprs=(None, turn)),
        request("MARKER_VELOCITY", 31),
        request("EXPRESSION", exprs=(None, text("1"))),
    ]
    wanted = [dataclasses.replace(one, id=id) for id, one in enumerate(wanted, 7)]
    system = fake_system_of(model_of(tmp_path / "deck", *wanted))
    add_rows(system, 0, 2)
    run(system, tmp_path).close()
    shown = CliRunner().invoke(main, ["info", str(tmp_path / "deck.h5")]).output
    units = {
        words[0]: " ".join(words[9:])
        for words in map(str.split, shown.splitlines())
        if words and words[0].startswith("requests/")
    }
    assert units == {
        "requests/7": "N, N·m",
        "requests/{8,10}": "m/s, rad/s",
        "requests/9": "rad/s",
        "requests/11": "",
    }


def test_the_log_of_an_adams_deck_has_its_names(tmp_path: Path) -> None:
    made = model_of(tmp_path / "deck", request("MARKER_FORCE", 30, 32))
    adams = dataclasses.replace(made, file="deck.adm")
    assert "none: the deck has no REQUEST" in "\n".join(
        header(fake_system_of(dataclasses.replace(adams, requests={})), {})
    )
    system = fake_system_of(adams)
    lines = list(header(system, {}))
    assert "  warning: REQUEST/7: no element acts at MARKER/30 and MARKER/32; it is 0" in lines
    watch = Watch(acting(system))
    lines = list(_force_lines(system, watch))
    begins = [line.split()[0] for line in lines[2:]]
    assert {"JOINT/1", "JPRIM/1", "MOTION/6", "SPRINGDAMPER/5", "SFORCE/7"} <= set(begins)
    about = info._facts(adams, adams.joints[1])
    assert about["i"] == "MARKER/21 of PART/2"


def test_names_in_the_words_of_the_deck() -> None:
    assert element_name("a.xml", "Body_Rigid", 2) == "Body_Rigid[2]"
    assert element_name("a.ADM", "Body_Rigid", 2) == "PART/2"
    assert statement_name("a.xml", "Post_Request") == "Post_Request"

"""`mbsim.Model`: every statement that the reader knows can be written, and is read as written."""

from __future__ import annotations

import inspect
import keyword
from pathlib import Path

import numpy as np
import pytest

import mbsim
from helpers.folders import PACKAGES, TESTS
from mbsim.errors import DeckError, ModelError
from mbsim.reader.builder import Model
from mbsim.reader.calls import calls, referred, required
from mbsim.reader.keywords import fold
from mbsim.reader.kinds import ID, IDS
from mbsim.reader.statements import BY_KEY, STATEMENTS
from mbsim.reader.xml import read_sections

DECKS = sorted(
    path
    for folder in (PACKAGES / "models", PACKAGES / "models" / "stiff", TESTS / "corpus")
    for path in folder.glob("*.xml")
    if "refused" not in path.name
)
#: Attributes that name an element of no certain sort, or of one that is refused.
ANY_SORT = {"elem_id", "element_id", "node_id", "i_flexbody_id", "j_flexbody_id"}


def content(node):
    """Return a statement as data: name, attributes without those flags that calls add, parts."""
    statement = BY_KEY.get(node.key)
    names = statement.spec_names if statement else {}
    attributes = {
        names.get(fold(each.name), each.name): each.value
        for each in node.attributes
        if not each.name.endswith("_flag")
    }
    return node.key, attributes, node.text.split(), [content(child) for child in node.children]


def contents(deck):
    _, sections = read_sections(deck)
    return {
        section.key: [content(node) for node in section.children]
        for section in sections
        if section.children
    }


def rebuilt(path):
    """Return the deck with every statement of its model written by a call."""
    model = Model(name=path.stem)
    named = {statement.name: name for name, statement in calls().items()}
    for section in sorted(read_sections(path)[1], key=lambda section: section.key != "model"):
        for node in section.children:
            statement = BY_KEY[node.key]
            given = {each.name: each.value for each in node.attributes}
            given |= {child.tag.lower(): child.text.split() for child in node.children}
            if statement.text and node.text:
                given[statement.text] = node.text.split()
            if section.key == "command" and not statement.in_command:
                pytest.skip("its <Command> changes elements")
            if section.key == "command" and node is section.children[0] and statement.in_model:
                pytest.skip("what stands before the first Simulate is written into <Model>")
            getattr(model, named[statement.name])(**given)
    return model


def test_each_statement_has_a_method_with_its_attributes():
    found = calls()
    assert len(found) == len(STATEMENTS)
    assert not [name for name in found if name in dir(object) or name in ("add", "change")]
    for name, statement in found.items():
        method = getattr(Model, name)
        arguments = inspect.signature(method).parameters
        for attribute, spec in statement.attributes.items():
            argument = f"{attribute}_" if keyword.iskeyword(attribute) else attribute
            assert argument in arguments
            assert spec.refused or f"{attribute}:" in method.__doc__


def test_it_is_known_what_each_id_names():
    unknown = {
        name
        for statement in STATEMENTS
        for name, spec in statement.attributes.items()
        if spec.kind in (ID, IDS) and name != "id" and not referred(statement, name)
    }
    assert unknown == ANY_SORT


@pytest.mark.parametrize("path", DECKS, ids=lambda path: path.stem)
def test_decks_are_written_by_calls(path):
    assert len(DECKS) > 40
    written, there = contents(rebuilt(path)), contents(path)
    for section in there:
        ours = [(key, parts) for key, *parts in written[section]]
        theirs = [(key, parts) for key, *parts in there[section]]
        for (key, (attributes, _, children)), (its_key, parts) in zip(ours, theirs, strict=True):
            its_attributes, its_text, its_children = parts
            text = BY_KEY[key].text
            if text and its_text:
                its_attributes = {**its_attributes, text: " ".join(its_text)}
            assert (key, attributes, children) == (its_key, its_attributes, its_children)


@pytest.mark.parametrize("path", DECKS, ids=lambda path: path.stem)
def test_a_deck_is_written_as_it_was(path):
    model = Model(path)
    assert contents(model) == contents(path)
    assert contents(Model(model.to_xml())) == contents(path)
    assert mbsim.read_model(model).bodies.keys() == mbsim.read_model(path).bodies.keys()


def ball():
    model = mbsim.Model(name="ball")
    body = model.body(
        mass=5, inertia=[0.0233] * 3, pos=(0, 0, 0.108), v_ic=(5, 0, 0), label="a <ball> & more"
    )
    model.contact(
        model.graphic("Sphere", marker=body, radius=0.108),
        model.graphic("Plane", marker=model.ground),
        "IMPACT",
        stiffness=1e8,
        exponent=1.5,
        damping=200,
        dmax=1e-4,
    )
    model.gravity(grav=(0, 0, -9.81))
    model.simulate(end_time=0.02, print_interval=0.01)
    return model


def test_a_model_runs_as_its_deck_does(tmp_path):
    model = ball()
    path = tmp_path / "ball.xml"
    path.write_text(model.to_xml())
    ours, theirs = mbsim.simulate(model), mbsim.simulate(path)
    assert (ours["bodies/1/position"] == theirs["bodies/1/position"]).all()
    assert ours["bodies/1/position/x"][-1] == pytest.approx(0.1)
    assert mbsim.read_model(model).bodies[1].label == "a <ball> & more"
    with mbsim.open(model) as sim:
        sim.step(0.01)
        assert sim.signals["bodies/1/position/x"] == pytest.approx(0.05)
    changed = mbsim.read_model(model, {"Body_Rigid[1].mass": np.float64(2.5)})
    assert changed.bodies[1].mass == 2.5


def test_markers_are_made_where_a_place_is_given_beside_bodies():
    model = mbsim.Model()
    rod = model.body(mass=1, inertia=(1, 1, 1, 0.1, 0.2, 0.3), pos=(0, 0, -1))
    model.joint("REVOLUTE", rod, model.ground, pos=(0, 0, 2), z_axis=(0, 3, 0))
    read = mbsim.read_model(model)
    joint = read.joints[1]
    assert read.bodies[1].inertia == (1, 1, 1, 0.1, 0.2, 0.3)
    for id, body in ((joint.i_marker_id, 1), (joint.j_marker_id, 2)):
        marker = read.markers[id]
        assert (marker.body_id, marker.pos) == (body, (0, 0, 2))
        assert marker.R[:, 2] == pytest.approx([0, 1, 0], abs=1e-15)
        assert marker.R.T @ marker.R == pytest.approx(np.eye(3), abs=1e-15)
        assert np.linalg.det(marker.R) == pytest.approx(1.0)


def test_a_body_given_in_place_of_a_marker_is_its_centre_of_mass():
    model = mbsim.Model()
    ball = model.body(mass=1, inertia=(1, 1, 1))
    point = model.point(mass=2, pos=(0, 0, 3))
    spring = model.spring_damper(ball, point, "TRANSLATIONAL", stiffness=3, length=2)
    model.simulate(end_time=1, num_steps=2)
    model.change(spring, stiffness=4)
    model.simulate(end_time=2, num_steps=2)
    assert (f"{spring}", repr(point)) == ("1", "Body_Point[2]")
    assert model.ground == model.ground
    read = mbsim.read_model(model)
    assert [len(each.changes) for each in read.simulations] == [0, 1]


def test_with_a_density_the_shapes_give_the_centre_of_mass():
    model = mbsim.Model()
    box = model.body(density=1000.0, pos=(0, 0, 1))
    model.graphic("BoxDefinedFromCorner", marker=box, length=(1, 2, 3))
    read = mbsim.read_model(model)
    assert read.bodies[1].cg_id is None
    assert read.graphics[1].shape == "BOX"


@pytest.mark.parametrize(
    "before", ["", "\ufeff", "\n  ", "\n<?xml version='1.0'?>", '\ufeff<?xml encoding="utf-16"?>\n']
)
def test_a_text_is_read_whatever_stands_before_it(before):
    model = mbsim.Model()
    model.body(mass=1, inertia=(1, 1, 1), label="Kugel \u00e4")
    model.simulate(end_time=1, print_interval=0.1)
    assert "Kugel \u00e4" in [
        b.label for b in mbsim.read_model(before + model.to_xml()).bodies.values()
    ]


def test_a_text_that_is_none_is_refused():
    with pytest.raises(ModelError, match="an empty text is neither a path nor XML"):
        mbsim.read_model("")
    with pytest.raises(ModelError, match=r"deck.xml:3: a character that is no text: '\\ud800'"):
        mbsim.read_model("<MotionSolve>\n\n<!-- \ud800 --></MotionSolve>")


def test_a_mesh_is_written_from_arrays():
    model = mbsim.Model()
    body = model.body(density=1.0)
    nodes = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]
    model.graphic("TriaMesh", marker=body, nodes=nodes, faces=faces)
    read = mbsim.read_model(model)
    assert len(read.graphics[1].faces) == 4


@pytest.mark.parametrize(
    ("write", "kind", "said"),
    [
        (lambda m: m.graphic("Sphere", radious=1), DeckError, "did you mean radius?"),
        (lambda m: m.body(mass=-1), DeckError, "must be a number > 0"),
        (lambda m: m.contact(m.ground, m.ground, "HERTZ"), ModelError, "is no Post_Graphic"),
        (lambda m: m.body(mass=1, inertia=(1, 2)), ModelError, "must be 3 or 6 numbers"),
        (lambda m: m.marker(1, 2, 3), ModelError, "values without a name"),
        (lambda m: m.add("Body_Rigit"), ModelError, "did you mean Body_Rigid?"),
        (lambda m: m.marker(m.ground, z_axis=(0, 0, 0)), ModelError, "not all 0"),
        (lambda m: m.joint("REVOLUTE", 1, 2, pos=(0, 0, 0)), ModelError, "give bodies"),
        (lambda m: (m.body(id=3, mass=1), m.body(id=3, mass=1)), DeckError, "already used"),
        (lambda m: m.Force_Contact, AttributeError, "Force_Contact is .contact"),
        (lambda m: m.change(m.ground, foo=1), ModelError, "Body_Rigid has no attribute foo"),
        (
            lambda m: m.body(mass=1, label="a\x07b"),
            ModelError,
            "label: '\\x07' has no place in XML",
        ),
        (lambda m: m.body(mass=1, label="\ud800"), ModelError, "has no place in XML"),
        (lambda m: m.change(3, mass=1), ModelError, "an element of this model; int given"),
        (
            lambda m: m.joint("FIXED", mbsim.Model().ground, m.ground),
            ModelError,
            "Body_Rigid[1] is of another mbsim.Model",
        ),
        (lambda m: m.contcat, AttributeError, "did you mean contact?"),
    ],
)
def test_faults_are_raised_where_they_are_written(write, kind, said):
    with pytest.raises(kind) as caught:
        write(mbsim.Model())
    assert said in str(caught.value)
    if kind is DeckError:
        fault = caught.value.faults[0]
        assert Path(fault.file) == Path(__file__)
        assert fault.line == write.__code__.co_firstlineno


def test_faults_of_the_whole_name_the_line_of_the_script():
    model = mbsim.Model()
    model.joint("REVOLUTE", 98, 99)
    line = inspect.currentframe().f_lineno - 1
    with pytest.raises(DeckError) as caught:
        mbsim.read_model(model)
    assert {(Path(f.file).name, f.line) for f in caught.value.faults} == {
        (Path(__file__).name, line)
    }


def test_what_must_be_given_may_be_given_without_names():
    assert required(calls()["joint"]) == ["type", "i_marker_id", "j_marker_id"]
    assert required(calls()["contact"]) == ["i_graphics_id", "j_graphics_id", "cnf_type"]


COMMENTED = """<?xml version="1.0"?>
<!-- who wrote it -->
<!-- and why:
     on two lines -->
<MotionSolve>
  <!-- the model -->
  <Model>
    <!-- the ground -->
    <Body_Rigid id="1" isground="TRUE"/>
    <!-- weight & all -->
    <!-- on Earth -->
    <Force_Gravity grav_z="-9.81"/> <!-- no more -->
  </Model>
  <Command>
    <Simulate analysis_type="Transient" end_time="1" print_interval="0.1"/>
    <!-- the end -->
  </Command>
</MotionSolve>
"""


def test_comments_of_a_deck_stay_where_they_are():
    model = mbsim.Model(COMMENTED)
    model.body(mass=3.5, inertia=(1.0, 1.0, 1.0))
    text = model.to_xml()
    order = [
        *("<MotionSolve>", "<!-- who wrote it -->", "<!-- and why:", "on two lines -->"),
        *("<!-- the model -->", "<Model>", "<!-- the ground -->", "<Body_Rigid"),
        *("<!-- weight & all -->", "<!-- on Earth -->", "<Force_Gravity", "3.5"),
        *("<!-- no more -->", "</Model>", "<Command>", "<Simulate", "<!-- the end -->"),
    ]
    places = [text.index(each) for each in order]
    assert places == sorted(places)
    assert text.count("<!--") == COMMENTED.count("<!--")
    # and no more come with every time
    assert mbsim.Model(text).to_xml() == text


def test_faults_below_comments_name_the_line_of_the_script():
    model = mbsim.Model(COMMENTED)
    model.motion_joint(joint_id=77, val_type="D", expr="TIME")
    with pytest.raises(DeckError, match="77") as caught:
        mbsim.read_model(model)
    assert caught.value.faults[0].file == __file__

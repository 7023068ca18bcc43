"""Attributes in the registries: each is described, and its default is what the reader takes."""

from __future__ import annotations

import re
from dataclasses import fields, replace

import pytest

from mbsim.expressions.functions import FUNCTIONS
from mbsim.laws.catalog import FRICTION_LAWS
from mbsim.laws.constants import friction_parameters
from mbsim.manual.book import pages
from mbsim.model import elements as el
from mbsim.reader.kinds import TEXT, BadValueError
from mbsim.reader.statements import STATEMENTS
from mbsim.reader.xml import read_model
from mbsim.run.settings import settle

#: A deck with every statement, without attributes that have a default.
DECK = """<MotionSolve><Model>
<Param_Unit/>
<Body_Rigid id="1" isground="TRUE"/>
<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="1" inertia_yy="1" inertia_zz="1"/>
<Body_Rigid id="3" cg_id="30" mass="1" inertia_xx="1" inertia_yy="1" inertia_zz="1"/>
<Body_Point id="4" cg_id="40" mass="1"/>
<Reference_Marker id="40" body_id="4"/>
<Reference_Marker id="10" body_id="1"/>
<Reference_Marker id="20" body_id="2"/>
<Reference_Marker id="30" body_id="3" pos_y="1"/>
<Post_Graphic id="1" type="Plane" rm_id="10"/>
<Post_Graphic id="2" type="Sphere" center_marker_id="20" radius="0.1"/>
<Post_Graphic id="3" type="Cylinder" center_marker_id="30" radius="0.1" length="1"/>
<Post_Graphic id="4" type="TriaMesh" rm_id="30"><Nodes>0 0 0 1 0 0 0 1 0 0 0 1</Nodes>
<Faces>0 2 1 0 1 3 0 3 2 1 2 3</Faces></Post_Graphic>
{contacts}
<Force_Gravity grav_x="1"/>
<Param_Transient/>
<Constraint_Joint id="1" type="REVOLUTE" i_marker_id="20" j_marker_id="10"/>
<Constraint_Joint id="2" type="CYLINDRICAL" i_marker_id="30" j_marker_id="10"/>
<Constraint_Jprim id="1" type="INPLANE" i_marker_id="30" j_marker_id="10"/>
<Constraint_Coupler id="1" joint_ids="1 2" motion_types="R R" scales="1 2"/>
<Constraint_General id="1" expr="DX(30) - 1"/>
<Motion_Joint id="1" joint_id="1" val_type="D" expr="TIME"/>
<Motion_Marker id="2" i_marker_id="30" j_marker_id="10" direction="Z" val_type="A" expr="TIME"/>
<Force_SpringDamper id="1" type="TRANSLATIONAL" i_marker_id="20" j_marker_id="10"/>
<Force_Scalar_TwoBody id="1" type="Force" i_marker_id="20" j_marker_id="10" expr="1"/>
<Force_Vector_TwoBody id="1" type="ForceOnly" i_marker_id="20" j_floating_marker_id="10"
 fx_expression="1"/>
<Force_Vector_OneBody id="1" type="ForceOnly" i_marker_id="20" fx_expression="1"/>
<Force_Bushing id="1" i_marker_id="20" j_marker_id="10"/>
<Force_Beam id="1" i_marker_id="20" j_marker_id="10" length="1" E="1" G="1" area="1" ixx="1"
 iyy="1" izz="1"/>
<Force_Field id="1" i_marker_id="20" j_marker_id="10"/>
<Force_JointFriction id="1" joint_id="1" cff_type="COULOMB_ON" pin_radius="1"/>
<Force_JointLimit id="1" joint_id="1" motion_type="R" lower="0" cnf_type="IMPACT"/>
<Force_JointLimit id="2" joint_id="2" motion_type="T" lower="0" cnf_type="POISSON"/>
<Force_DryFriction id="1" type="TX" i_marker_id="20" j_marker_id="10" friction="1"/>
<Force_Element id="1" direction="TX" i_marker_id="20" j_marker_id="10"
 usrsub_param_string="USER(1)"/>
<Reference_Variable id="1" expr="TIME"/>
<Control_Diff id="1" expr="TIME"/>
<Reference_Spline id="1" points="0 0 1 1"/>
<Reference_Array id="1" values="1 2"/>
<Sensor_Event id="1" expr="TIME"/>
<Post_Request id="1" type="DISPLACEMENT" i_marker_id="20"/>
<Post_Request id="2" type="EXPRESSION" expr1="1"/>
</Model><Command>
<Param_Static/>
<Simulate end_time="1" print_interval="0.1"/>
</Command></MotionSolve>
"""
_SHAPES = 'i_graphics_id="2" j_graphics_id="1"'
_CONTACTS = (
    'cnf_type="IMPACT" cff_type="COULOMB_ON"',
    'cnf_type="POISSON" cff_type="STICTION"',
    'cnf_type="HUNT_CROSSLEY" cff_type="LUGRE" bristle_stiffness="1" stribeck_vel="1"',
    'cnf_type="HERTZ" stiffness="1" cff_type="STRIBECK" stribeck_vel="1"',
    'cnf_type="USERCNF" cff_type="USERCFF" cpost_script_name="post.py"',
    'cnf_type="IMPACT" cff_type="COULOMB_ROLLING" rolling_arm="1"',
    'cnf_type="IMPACT"',
)


def _deck(change=lambda text: text):
    contacts = "\n".join(
        f'<Force_Contact id="{k}" {_SHAPES} {each}/>' for k, each in enumerate(_CONTACTS, 1)
    )
    return change(DECK.format(contacts=contacts))


def _elements(folder, text):
    """Return everything that a deck means, without what the reader says of it."""
    (folder / "deck.xml").write_text(text)
    (folder / "post.py").write_text("def CONTACTPOST(*args): pass\n")
    model = read_model(str(folder / "deck.xml"))
    said = {
        field.name: getattr(model, field.name)
        for field in fields(model)
        if field.metadata != el.NO_RESULT and field.name not in ("transient", "simulations")
    }
    # what is settled later: parameters of laws, methods, components that are not given
    said["contacts"] = [(replace(c, friction=()), _parameters(c)) for c in model.contacts.values()]
    for name in ("vector_forces", "body_forces", "requests"):
        said[name] = [_with_zeros(each) for each in said[name].values()]
    said["markers"] = [replace(m, R=(m.R + 0.0).tolist()) for m in model.markers.values()]
    settled = settle(model)
    said["method"] = settled.integrator
    said["stages"] = [(s.tol, s.h_max, s.h_min, s.h0_max) for s in settled.stages]
    said["simulations"] = [replace(s, transient=None) for s in model.simulations]
    return {name: repr(value) for name, value in said.items()}


def _parameters(contact):
    if contact.cff_type not in FRICTION_LAWS:
        return ()
    return friction_parameters(FRICTION_LAWS[contact.cff_type], contact).tolist()


def _with_zeros(element):
    texts = [each.text if each is not None else "0" for each in element.exprs]
    zeros = ["0"] * (8 - len(texts)) if isinstance(element, el.Request) else []
    return repr(replace(element, exprs=())), texts + zeros


def _values():
    """Yield statement, attribute and default of those defaults that a deck could say."""
    for statement in STATEMENTS:
        for name, spec in statement.attributes.items():
            if not spec.default or (spec.kind is TEXT and not re.fullmatch("[A-Z]+", spec.default)):
                continue
            try:
                spec.kind.parse(spec.default)
            except BadValueError:
                continue
            yield statement.name, name, spec.default


def _put(text, statement, name, value, shapes):
    """Return the deck with an attribute in those elements of a statement that do not have it."""

    def put(match):
        inside = match.group()
        if re.search(rf"\b{name}=", inside) or not shapes(inside):
            return inside
        return inside.replace(f"<{statement}", f'<{statement} {name}="{value}"')

    return re.sub(rf"<{statement}\b[^>]*>", put, text)


_OF_USERS = ("usrsub", "script", "interpreter")
#: Statements that an expression gives in this deck, and not a subroutine.
_BY_EITHER = (
    *("Force_Scalar_TwoBody", "Reference_Variable", "Control_Diff", "Motion_Joint"),
    *("Motion_Marker", "Sensor_Event", "Sensor_Evaluate", "Constraint_Coupler"),
)


def _takes(statement, name):
    """Return which elements of the deck may have an attribute."""
    if statement == "Post_Graphic":
        of = {"ends_type": "Cylinder", "facets": "TriaMesh", "crease_angle": "TriaMesh"}
        return lambda inside: of.get(name, "") in inside
    if statement == "Body_Rigid" and name.startswith("inertia"):
        return lambda inside: "inertia_xx" in inside
    if statement == "Post_Request":
        type = "EXPRESSION" if name.startswith("expr") else "DISPLACEMENT"
        own = name in ("jflag", "elem_type", "elem_id") or name.startswith(_OF_USERS)
        return lambda inside: not own and type in inside
    if statement.startswith("Force_Vector"):
        own = name[0] != "t" and not name.startswith(_OF_USERS)
        return lambda inside: own
    if name in ("restitution_coef", "ref_velocity"):
        return lambda inside: False
    if name in ("rotational_stiffness", "torsion_radius"):
        return lambda inside: False  # each means nothing without the other
    if statement in _BY_EITHER:
        return lambda inside: not name.startswith(_OF_USERS)
    if name.startswith(("cff_", "cpost_", "interpreter")) and name != "cff_type":
        return lambda inside: "USERCFF" in inside
    return lambda inside: True


@pytest.mark.parametrize("statement", sorted({each[0] for each in _values()}))
def test_a_default_is_what_the_reader_takes(statement, tmp_path):
    without = _elements(tmp_path, _deck())
    for name, value in [each[1:] for each in _values() if each[0] == statement]:
        takes = _takes(statement, name)
        text = _put(_deck(), statement, name, value, takes)
        assert _elements(tmp_path, text) == without, f'{name}="{value}"'


@pytest.mark.parametrize("statement", STATEMENTS, ids=lambda each: each.name)
def test_a_statement_is_described(statement):
    assert statement.about or statement.note
    for name, spec in statement.attributes.items():
        assert spec.about or spec.note or spec.refused, name
        assert not (spec.required and spec.default), name


@pytest.mark.parametrize("statement", STATEMENTS, ids=lambda each: each.name)
def test_a_statement_has_its_page(statement):
    name = f"reference/statements/{statement.name.lower()}"
    if name not in pages():  # several that set nothing have one page
        assert statement.note
        others = [p for p in pages().values() if p.name.startswith("reference/statements/")]
        own = f"<!-- table: attributes {statement.name} -->"
        named = own if statement.attributes else f"`{statement.name}`"
        assert any(named in page.text for page in others)
    elif statement.attributes:
        assert f"<!-- table: attributes {statement.name} -->" in pages()[name].text


@pytest.mark.parametrize("function", FUNCTIONS.values(), ids=lambda each: each.name)
def test_a_function_is_described(function):
    assert function.about
    assert function.call.startswith(function.name)

"""Adams decks: what each statement becomes, and that every fault is named where it stands."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from helpers.folders import ROOT, data_file
from mbsim.cli.main import main
from mbsim.errors import DeckError, ModelError
from mbsim.expressions.tree import Call, Number
from mbsim.model.elements import Model
from mbsim.model.frames import rotation_313
from mbsim.model.names import is_adams
from mbsim.model.placement import place
from mbsim.reader.adm.lexer import split_statements, unique
from mbsim.reader.xml import read_model
from mbsim.run.settings import settle

# one statement a line, so that tests can name the line
PENDULUM = """a pendulum, this line is the title
! a comment
UNITS/FORCE = NEWTON, MASS = KILOGRAM, LENGTH = METER, TIME = SECOND ! and another
PART/01, GROUND
PART/02, MASS = 1.5, CM = 0201, IP = 0.04, 0.1, 0.11
MARKER/0101, PART = 01
MARKER/0102, PART = 01, QP = 0, 0, 1, REULER = 180D, 90D, 180D
MARKER/0201, PART = 02, QP = 2, 0, 1
MARKER/0202, PART = 02, QP = 0, 0, 1, REULER = 180D, 90D, 180D
JOINT/1, REVOLUTE, I = 0102, J = 0202
ACCGRAV/KGRAV = -9.80665
REQUEST/01, D,I=0201,J=0101,C=DISPLACEMENT: X Y Z (body-fixed-3-1-3)
OUTPUT/
, REQSAVE
END
"""
PART_LINE, JOINT_LINE = 5, 10


def read(folder: Path, text: str, overrides: tuple[str, ...] = (), name: str = "deck.adm") -> Model:
    path = folder / name
    path.write_text(text)
    return read_model(path, overrides)


def changed(*replacements: tuple[str, str]) -> str:
    """Return the pendulum with pieces replaced; each must be there exactly once."""
    text = PENDULUM
    for old, new in replacements:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return text


def added(*statements: str) -> str:
    return changed(("OUTPUT/", "\n".join([*statements, "OUTPUT/"])))


def test_pendulum(tmp_path: Path) -> None:
    model = read(tmp_path, PENDULUM, name="Swing.ADM")
    assert (model.name, len(model.sha256)) == ("Swing", 64)
    assert is_adams(model.file)
    assert model.bodies[1].is_ground
    body = model.bodies[2]
    assert (body.mass, body.cg_id, body.inertia) == (1.5, 201, (0.04, 0.1, 0.11, 0, 0, 0))
    assert body.source.line == PART_LINE
    assert model.markers[201].pos == (2.0, 0.0, 1.0)
    expected = rotation_313(math.pi, math.pi / 2, math.pi)
    np.testing.assert_allclose(model.markers[202].R, expected, atol=1e-15)
    joint = model.joints[1]
    assert (joint.type, joint.i_marker_id, joint.j_marker_id) == ("REVOLUTE", 102, 202)
    assert joint.source.line == JOINT_LINE
    assert model.gravity.g == (0.0, 0.0, -9.80665)
    request = model.requests[1]
    assert (request.type, request.i_marker_id) == ("MARKER_DISPLACEMENT", 201)
    assert request.comment == "DISPLACEMENT: X Y Z (body-fixed-3-1-3)"
    assert len(model.notes) == 1
    assert "OUTPUT" in model.notes[0]
    assert model.warnings == ()
    assert model.simulations == ()


def test_part_frame_and_velocities(tmp_path: Path) -> None:
    text = changed(
        (
            "IP = 0.04, 0.1, 0.11",
            "IP=0.4,0.5,0.6,0.01,0.02,0.03,QG=1,2,3,REULER=90D,0,0,VX=4,WZ=90D,WX=0.5",
        ),
        ("QP = 2, 0, 1", "QP = 2, 0, 1, REULER = 0, 90D, 0"),
    )
    model = read(tmp_path, text)
    body = model.bodies[2]
    # Adams has xx yy zz xy xz yz, the model xx yy zz xy yz xz
    assert body.inertia == (0.4, 0.5, 0.6, 0.01, 0.03, 0.02)
    assert body.v_ic == (4.0, 0.0, 0.0)
    assert body.w_ic == pytest.approx((0.5, 0.0, math.pi / 2))
    np.testing.assert_allclose(model.markers[201].pos, (1, 4, 4), atol=1e-15)
    placed = place(model).bodies[2]
    # about the axes of the CM marker: x to global y, z to global x
    np.testing.assert_allclose(placed.w, (math.pi / 2, 0.5, 0), atol=1e-15)
    np.testing.assert_allclose(placed.v, (4, 0, 0))


@pytest.mark.parametrize(
    ("axes", "columns"),
    [
        ("ZP = 2,0,5, XP = 9,0,7", ((1, 0, 0), (0, 1, 0), (0, 0, 1))),
        ("ZP = 9,0,7, XP = 2,0,5, USEXP", ((0, 0, 1), (0, -1, 0), (1, 0, 0))),
        ("ZP = 2,3,1, XP = 4,3,1", ((1, 0, 0), (0, 0, -1), (0, 1, 0))),
    ],
)
def test_axes_by_points(tmp_path: Path, axes: str, columns: tuple[tuple[int, ...], ...]) -> None:
    model = read(tmp_path, changed(("QP = 2, 0, 1", f"QP = 2, 0, 1, {axes}")))
    np.testing.assert_allclose(model.markers[201].R, np.array(columns).T, atol=1e-15)


def test_constraints_forces_and_variables(tmp_path: Path) -> None:
    model = read(
        tmp_path,
        added(
            "JPRIM/3, PARA, I=102, J=202",
            "JPRIM/4, ATPOINT, I=102, J=202",
            "JOINT/2, SCREW, I=102, J=202, PITCH=0.5",
            "JOINT/3, RACKPIN, I=102, J=202, PD=0.25",
            "JOINT/4, CYL, I=102, J=202, ICTRAN=0,0",
            "GCON/1, I = 0102, FUNCTION = DM(0202, 0102)-2",
            "MOTION/1, JOINT=1, VEL, FUNCTION=180D*TIME, ICDISP=90D",
            "MOTION/2, JOINT=4, TRANS, FUNCTION=0.1*SIN(TIME),",
            ", ACC, ICVEL=3, ICDISP=2",
            "MOTION/3, I=102, J=202, B3, FUNCTION=TIME",
            "SPRINGDAMPER/1, TRANSLATION, I=102, J=202, C=2, K=30, LENGTH=0.4, FORCE=5",
            "SPRINGDAMPER/2, ROT, I=102, J=202, CT=2, KT=30, ANGLE=180D, TORQUE=5",
            "SFORCE/1, ROTATIONAL, I=102, J=202, ACTION",
            ", FUNCTION = - 2.0*(az(102,202)",
            ", -1.0) + ",
            ", VARVAL(1)",
            "VARIABLE/1, FUN=WZ(102,202,202)",
            "INTEGRATOR/GSTIFF, SI2, ERROR=1E-6, HMAX=0.01, KMAX=5",
            "REQUEST/2, F2=ORIENT(27,1,201,101)\\F3=JOINT(1,0,2,0)\\",
            ", F8=FX(102,202), C=EULER PARAMETERS, and more",
            "REQUEST/3, F, I=102, J=202, RM=101",
        ),
    )
    assert {id: joint.type for id, joint in model.primitives.items()} == {
        3: "PARALLEL_AXES",
        4: "SPHERICAL",
    }
    assert all(joint.is_primitive for joint in model.primitives.values())
    assert (model.joints[2].type, model.joints[2].pitch) == ("SCREW", 0.5)
    assert (model.joints[3].type, model.joints[3].pitch_diameter) == ("RACK_PINION", 0.25)
    assert model.joints[4].type == "CYLINDRICAL"
    constraint = model.general_constraints[1].expr
    assert isinstance(constraint.root, Call)
    assert constraint.text == "DM(0202, 0102)-2"
    by_joint, sliding, turning = (model.motions[id] for id in (1, 2, 3))
    assert (by_joint.direction, by_joint.val_type) == ("R", "V")
    assert (by_joint.i_marker_id, by_joint.j_marker_id) == (102, 202)
    assert by_joint.ic_disp == pytest.approx(math.pi / 2)
    assert (sliding.direction, sliding.val_type) == ("T", "A")
    assert (sliding.ic_disp, sliding.ic_vel) == (2.0, 3.0)
    assert (turning.direction, turning.joint_id, turning.val_type) == ("B3", None, "D")
    spring, torsion = model.table("SPRINGDAMPER").values()
    assert (spring.type, spring.stiffness, spring.damping) == ("TRANSLATIONAL", 30.0, 2.0)
    assert (spring.length, spring.preload) == (0.4, 5.0)
    assert (torsion.type, torsion.stiffness, torsion.preload) == ("ROTATIONAL", 30.0, 5.0)
    assert torsion.length == pytest.approx(math.pi)
    force = model.scalar_forces[1]
    assert (force.type, force.action_only) == ("ROTATIONAL", True)
    assert force.expr.text == "- 2.0*(az(102,202) -1.0) + VARVAL(1)"
    assert model.variables[1].expr.text == "WZ(102,202,202)"
    assert (model.transient.integr_tol, model.transient.h_max) == (pytest.approx(1e-11), 0.01)
    request = model.requests[2]
    assert (request.type, request.comment) == ("EXPRESSION", "EULER PARAMETERS, and more")
    given = [k for k, expr in enumerate(request.exprs, start=1) if expr is not None]
    assert given == [2, 3, 8]
    assert model.requests[3].type == "MARKER_FORCE"
    assert model.requests[3].ref_marker_id == 101


def test_constant_motion_is_a_number(tmp_path: Path) -> None:
    model = read(tmp_path, added("MOTION/1, JOINT=1, FUNCTION=2.5"))
    assert model.motions[1].expr is not None
    assert model.motions[1].expr.root == Number(2.5)


@pytest.mark.parametrize("system", ["MKS", "CGS", "FPS"])
def test_unit_systems_are_consistent(tmp_path: Path, system: str) -> None:
    old = "UNITS/FORCE = NEWTON, MASS = KILOGRAM, LENGTH = METER, TIME = SECOND"
    model = read(tmp_path, changed((old, f"UNITS/SYSTEM={system}")))
    assert model.units.mass_scale == 1.0


def test_millimetres(tmp_path: Path) -> None:
    model = read(tmp_path, changed(("LENGTH = METER", "LENGTH = MILLIMETER")))
    assert model.units.mass_scale == 1e-3


def test_statements_are_split() -> None:
    text = 'title / here\nPART/1,\n! comment\n\n, GROUND &\n MORE ! x\nA/"!b"\n'
    raws = list(split_statements(text))
    assert [raw.text for raw in raws] == ["PART/1,\n GROUND \nMORE", 'A/"!b"']
    assert raws[0].lines == [2, 5, 6]
    assert raws[0].line(len(raws[0].text)) == 6


def test_abbreviations() -> None:
    words = ("DISPLACEMENT", "DIRECTION", "D1")
    assert unique("disp", words) == ["DISPLACEMENT"]
    assert unique("d", words) == list(words)
    assert unique("D1", words) == ["D1"]
    assert unique("X", words) == []


def test_overrides(tmp_path: Path) -> None:
    model = read(tmp_path, PENDULUM, ("PART[2].mass=3", "ACCGRAV.KGRAV=-1", "JOINT[1].type=FIXED"))
    assert model.bodies[2].mass == 3.0
    assert model.gravity.g == (0.0, 0.0, -1.0)
    assert model.joints[1].type == "FIXED"
    with pytest.raises(ModelError, match=r"no PART\[5\] in the deck; it has \[1\] \[2\]"):
        read(tmp_path, PENDULUM, ("PART[5].mass=3",))
    with pytest.raises(ModelError, match="PART has no attribute weight"):
        read(tmp_path, PENDULUM, ("PART[2].weight=3",))


def test_bushings_and_vector_forces(tmp_path: Path) -> None:
    text = "\n".join(
        (
            "MARKER/301, PART=2, FLOATING",
            "BUSHING/1, I=102, J=202, K=1,2,3, C=4,5,6",
            ", KT=7,8,9, TORQUE=0,0,-1",
            "VFORCE/4, I=102, JFLOAT=301, RM=102, FX=1\\",
            ", FZ=STEP(TIME,0,0,1,",
            ", 1)+2",
            "VTORQUE/5, I=102, JFLOAT=301, TY=WZ(102)",
            "GFORCE/6, I=102, JFLOAT=301, FX=1\\FY=2\\TZ=3",
        )
    )
    model = read(tmp_path, added(text))
    values = list(model.table("BUSHING")[1].values.values())
    assert values[:6] == [1.0, 2.0, 3.0, 7.0, 8.0, 9.0]
    assert values[6:12] == [4.0, 5.0, 6.0, 0.0, 0.0, 0.0]
    assert values[12:] == [0.0] * 5 + [-1.0]
    assert [force.type for force in model.vector_forces.values()] == [
        "FORCEONLY",
        "TORQUEONLY",
        "FORCEANDTORQUE",
    ]
    first, second, third = model.vector_forces.values()
    texts = [expr.text.replace(" ", "") if expr else None for expr in first.exprs]
    assert texts == ["1", None, "STEP(TIME,0,0,1,1)+2", None, None, None]
    assert (first.i_marker_id, first.j_floating_marker_id, first.ref_marker_id) == (102, 301, 102)
    assert [expr is not None for expr in second.exprs] == [False] * 4 + [True, False]
    assert [expr.text if expr else None for expr in third.exprs] == ["1", "2", *[None] * 3, "3"]
    assert model.markers[301].floating


FAULTS = {
    "no statement": ("123 foo", ("123 foo", "NAME/id")),
    "unknown statement": ("GRAHPICS/1, BOX", ("GRAHPICS[1]", "did you mean GRAPHICS?")),
    "missing comma": (
        "MARKER/301, PART=2\nREULER = 180D, 90D, 180D",
        ("REULER", "no statement but an argument", "comma missing that continues the line before?"),
    ),
    "not built": ("TIRE/1, I=101", ("TIRE[1]", "not built yet")),
    "contact": ("CONTACT/1, JGEOM=1, IMPACT, STIFF=1, EXP=1", ("CONTACT[1]", "IGEOM: missing")),
    "second units": ("UNITS/LENGTH=METER", ("UNITS", "a second UNITS")),
    "second gravity": ("ACCGRAV/IGRAV=1", ("ACCGRAV", "the first is on line 11")),
    "bad unit": ("PART/3, MASS=x, CM=201, IP=1,1,1", ('PART[3]: MASS="x": must be a number > 0',)),
    "no mass": ("PART/3, CM=201, IP=1,1,1", ("PART[3]", "MASS: missing")),
    "no cm": ("PART/3, MASS=1, IP=1,1,1", ("PART[3]", "CM: missing")),
    "no inertia": ("PART/3, MASS=1, CM=201", ("PART[3]", "IP: missing")),
    "two inertias": ("PART/3, MASS=1, CM=201, IP=1,1", ('IP="1, 1"', "3 or 6 numbers")),
    "heavy ground": ("PART/3, GROUND, MASS=1", ('MASS="1"', "ground")),
    "lone point": ("MARKER/301, PART=2, ZP=0,0,1", ("MARKER[301]", "XP: missing")),
    "points in line": (
        "MARKER/301, PART=2, ZP=0,0,1, XP=0,0,2",
        ("MARKER[301]", "in one line with the origin"),
    ),
    "points and angles": (
        "MARKER/301, PART=2, ZP=0,0,1, XP=1,0,0, REULER=0,0,0",
        ("give REULER or ZP and XP, not both",),
    ),
    "bad angle": ("MARKER/301, PART=2, REULER=90X,0,0", ('REULER="90X, 0, 0"', "3 angles")),
    "floating": (
        "MARKER/301, PART=2, FLOATING\nREQUEST/7, DISP, I=301",
        ("REQUEST[7]", 'I="301"', "floats", "JFLOAT"),
    ),
    "vector without": ("GFORCE/1, I=102, JFLOAT=202", ("GFORCE[1]", "FX ... TZ: missing")),
    "vector of the other kind": ("VFORCE/1, I=102, JFLOAT=202, TX=1", ("TX",)),
    "vector function": (
        "VTORQUE/1, I=102, JFLOAT=202, FUNCTION=TIME",
        ('FUNCTION="TIME"', "must be USER(number"),
    ),
    "vector both": (
        "VTORQUE/1, I=102, JFLOAT=202, TX=1, FUNCTION=USER(1)",
        ('TX="1"', "give FUNCTION or components"),
    ),
    "routine alone": (
        "SFORCE/1, ROT, I=102, J=202, FUNCTION=1, ROUTINE=F",
        ('ROUTINE="F"', "belongs to FUNCTION=USER(...)"),
    ),
    "library": (
        "VARIABLE/1, FUNCTION=USER(1)\\ROUTINE=my::F",
        ('ROUTINE="my::F"', "LIBRARY.so::NAME", "FILE.py::NAME"),
    ),
    "no name": ("VARIABLE/1, FUNCTION=USER(1)\\ROUTINE=a.py::", ("FILE.py::NAME",)),
    "no script": (
        "VARIABLE/1, FUNCTION=USER(1)\\ROUTINE=a.py::F",
        ('ROUTINE="a.py::F"', "no such file"),
    ),
    "user value": ("VARIABLE/1, FUNCTION=USER(1,a)", ("'a'", "is no number")),
    "user evaluation": (
        "SENSOR/1, FUNCTION=TIME, HALT, EVALUATE=USER(1)",
        ('EVALUATE="USER(1)"', "is no expression"),
    ),
    "bushing": ("BUSHING/1, I=102, J=202, K=1,2", ("BUSHING[1]", "3 numbers")),
    "negative bushing": ("BUSHING/1, I=102, J=202, CT=1,2,-3", ("CT", "numbers >= 0")),
    "no part": ("MARKER/301", ("MARKER[301]", "PART: missing")),
    "unknown part": ("MARKER/301, PART=7", ('PART="7"', "no PART has this id; there are 1, 2")),
    "id twice": ("MARKER/101, PART=1", ("MARKER[101]", "id already used on line 6")),
    "no id": ("MARKER/, PART=1", ("MARKER", "id: missing")),
    "unknown word": ("JOINT/2, HINGE, I=102, J=202", ("JOINT[2]", "HINGE: unknown word")),
    "short word": ("JOINT/2, S, I=102, J=202", ("S: may be SPHERICAL, SCREW",)),
    "no type": ("JOINT/2, I=102, J=202", ("JOINT[2]", "type: missing", "REVOLUTE")),
    "two types": ("JOINT/2, REV, FIX, I=102, J=202", ("JOINT[2]", "given twice")),
    "no pitch": ("JOINT/2, SCREW, I=102, J=202", ("PITCH: missing",)),
    "strange pitch": ("JOINT/2, REV, I=102, J=202, PITCH=1", ("belongs to a joint of type SCREW",)),
    "initial": ("JOINT/2, REV, I=102, J=202, ICROT=10D,0", ("ICROT", "not built yet")),
    "no marker": ("JOINT/2, REV, I=102, J=9", ('J="9"', "no MARKER has this id")),
    "one body": ("JOINT/2, REV, I=102, J=101", ("JOINT[2]", "both on body 1")),
    "unknown name": ("JOINT/2, REV, I=102, J=202, QQ=3", ('QQ="3"', "unknown attribute")),
    "no primitive": ("JPRIM/2, I=102, J=202", ("JPRIM[2]", "type: missing", "ATPOINT")),
    "expression": ("GCON/1, FUNCTION=DX(102,", ("GCON[1]", "is no expression", "column")),
    "unknown in gcon": ("GCON/1, FUNCTION=DM(102,77)", ("GCON[1]", "77", "no MARKER has this id")),
    "state in motion": (
        "MOTION/1, JOINT=1, FUNCTION=VZ(102,202)",
        ("MOTION[1]", "uses VZ", "TIME and displacements"),
    ),
    "wrong direction": (
        "MOTION/1, JOINT=1, TRANSLATION, FUNCTION=TIME",
        ("MOTION[1]", "joint 1 is REVOLUTE", "may be R"),
    ),
    "motion of a ball": (
        "JOINT/2, SPH, I=102, J=202\nMOTION/1, JOINT=2, ROTATION, FUNCTION=TIME",
        ("MOTION[1]", "joint 2 is SPHERICAL, which takes no motion"),
    ),
    "marker direction": ("MOTION/1, JOINT=1, X, FUNCTION=TIME", ("MOTION[1]", "X: must be ROTA")),
    "direction": (
        "MOTION/1, I=102, J=202, ROT, FUNCTION=TIME",
        ("ROTATION: must be one of X, Y, Z, B1, B2, B3",),
    ),
    "no direction": ("MOTION/1, I=102, J=202, FUNCTION=TIME", ("direction: missing",)),
    "no J": ("MOTION/1, I=102, X, FUNCTION=TIME", ("MOTION[1]", "J: missing")),
    "joint and marker": ("MOTION/1, JOINT=1, I=102, FUNCTION=TIME", ("give JOINT, or I and J",)),
    "no joint": ("MOTION/1, JOINT=9, FUNCTION=TIME", ('JOINT="9"', "no JOINT has this id")),
    "user": (
        "GCON/1, FUNCTION=USER(1,2)",
        ("USER(1,2)", "is no expression", "where the manual has it"),
    ),
    "no kind of force": ("SFORCE/1, I=102, J=202, FUNCTION=1", ("type: missing", "ROTATIONAL")),
    "wrong stiffness": ("SPRINGDAMPER/1, ROT, I=102, J=202, K=3", ('K="3"', "other type")),
    "circle": ("VARIABLE/1, FUNCTION=2*VARVAL(1)", ("VARIABLE[1]", "leads back", "1 -> 1")),
    "no request": ("REQUEST/2", ("REQUEST[2]", "type: missing", "F1 ... F8")),
    "no I": ("REQUEST/2, D", ("REQUEST[2]", "I: missing")),
    "both kinds": ("REQUEST/2, F2=1, I=102", ("REQUEST[2]", "not both")),
    "function": ("REQUEST/2, F2=FOO(3)", ('F2="FOO(3)"', "no function FOO")),
    "user request": (
        "REQUEST/2, FUNCTION=USER(1)\\ROUTINE=a.py::F",
        ('ROUTINE="a.py::F"', "no such file"),
    ),
    "user and markers": ("REQUEST/2, D, I=102, FUNCTION=USER(1)", ("FUNCTION", "stands for all")),
    "steps": ("INTEGRATOR/HMIN=2, HMAX=1", ('HMIN="2"', "not be larger than HMAX")),
    "unknown force": ("REQUEST/2, F2=SFORCE(3,0,2,0)", ("3", "no SFORCE has this id")),
}


@pytest.mark.parametrize("name", sorted(FAULTS))
def test_names_the_fault(tmp_path: Path, name: str) -> None:
    statement, parts = FAULTS[name]
    with pytest.raises(DeckError) as caught:
        read(tmp_path, added(statement))
    lines = [str(fault) for fault in caught.value.faults]
    # the last line of the case is where the fault is
    line = f"{tmp_path / 'deck.adm'}:{13 + statement.count(chr(10))}:"
    assert lines[0].startswith(line), lines
    assert all(part in lines[0] for part in parts), lines
    assert len(lines) <= 2, lines


def test_a_name_that_only_ends_alike_is_not_suggested(tmp_path: Path) -> None:
    with pytest.raises(DeckError, match=r"unknown statement SAMPLER$"):
        read(tmp_path, added("SAMPLER/1"))


def test_the_manual_has_a_deck_that_is_read(tmp_path: Path) -> None:
    page = ROOT / "mbsim" / "manual" / "pages" / "reference" / "adams.md"
    blocks = page.read_text(encoding="utf-8").split("```")
    (text,) = [block for block in blocks if "a pendulum; the first line" in block]
    model = read(tmp_path, text.partition("\n")[2])
    assert (list(model.joints), list(model.requests)) == ([1], [1, 2])
    assert model.requests[1].comment == "where the bob is"


_PIECES = st.sampled_from(
    "PART/3, MARKER/9, JOINT/2, MOTION/1, REQUEST/7, UNITS/ ACCGRAV/ , ( ) = \\ ! & D V X I= J= "
    'QP=1,2,3 FUNCTION=TIME F2=DX(102) MASS=1 GROUND REVOLUTE 90D 1e5 0 -3 " \n, \r\n END'.split(
        " "
    )
)
_ANY = settings(
    max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


@_ANY
@given(pieces=st.lists(_PIECES | st.text(max_size=4), max_size=25))
def test_any_text_is_read_or_refused(tmp_path: Path, pieces: list[str]) -> None:
    text = PENDULUM.removesuffix("END\n") + "".join(pieces)
    path = tmp_path / "deck.adm"
    path.write_text(text, encoding="utf-8", errors="replace", newline="")
    try:
        model = read_model(path)
    except DeckError as error:
        assert error.faults
    else:
        assert model.bodies[2].mass == 1.5


def test_all_faults_at_once(tmp_path: Path) -> None:
    text = added("TIRE/1", "JOINT/2, REV, I=102, J=9", "PART/3, MASS=-1, CM=201, IP=1,1,1")
    with pytest.raises(DeckError) as caught:
        read(tmp_path, text)
    assert [fault.line for fault in caught.value.faults[:2]] == [13, 14]
    assert {fault.element for fault in caught.value.faults} == {"TIRE[1]", "JOINT[2]", "PART[3]"}


def test_warnings(tmp_path: Path) -> None:
    (title,) = read(tmp_path, PENDULUM.replace("a pendulum, this", "PART/1,")).warnings
    assert "the first line is the title" in title
    (open_end,) = read(tmp_path, PENDULUM.replace("END\n", "")).warnings
    assert "does not END" in open_end
    (after,) = read(tmp_path, PENDULUM + "PART/7\n").warnings
    assert "deck.adm:16: END: what follows END is not read" in after


def test_no_text(tmp_path: Path) -> None:
    with pytest.raises(DeckError, match="NUL"):
        read(tmp_path, "title\nPART/1\0")
    with pytest.raises(DeckError, match="nothing to simulate"):
        read(tmp_path, "title\n! only this\n")
    with pytest.raises(DeckError, match="longer than"):
        read(tmp_path, "title\nPART/1" + ", GROUND" * 20_000)


def test_times_come_from_the_command_line(tmp_path: Path) -> None:
    model = read(tmp_path, PENDULUM)
    for times in ({}, {"end_time": 1.0}, {"print_interval": 0.1}):
        with pytest.raises(ModelError, match="give --end-time and --print-interval"):
            settle(model, **times)
    (stage,) = settle(model, end_time=1.0, print_interval=0.1).stages
    assert (stage.simulation.end_time, stage.simulation.print_interval) == (1.0, 0.1)


def test_command_line(tmp_path: Path) -> None:
    path = tmp_path / "deck.adm"
    path.write_text(PENDULUM)
    result = CliRunner().invoke(main, ["run", str(path), "--end-time", "1", "-o", str(tmp_path)])
    assert result.exit_code == 2
    assert "give --end-time and --print-interval" in result.output
    assert "Traceback" not in result.output
    result = CliRunner().invoke(main, ["check", str(path)])
    assert result.exit_code == 0
    assert "a run needs --end-time and --print-interval" in result.output
    result = CliRunner().invoke(main, ["info", str(path)])
    assert result.exit_code == 0
    assert "MARKER_DISPLACEMENT" in result.output


REAL = {
    # joints, constraints, forces, and where the body's cg is
    "Cylindrical_Case01": ("CYLINDRICAL", 0, 0, (2, 0, 0)),
    "Cylindrical_Case02": ("CYLINDRICAL", 0, 0, (2, 0, 0)),
    "Distance_Case01": (None, 1, 0, (0, 2, 0)),
    "Distance_Case02": (None, 1, 0, (-1, 4, 3)),
    "Prismatic_Case01": ("TRANSLATIONAL", 0, 0, (2, 0, 0)),
    "Prismatic_Case03": ("TRANSLATIONAL", 0, 0, (3, 2, 3)),
    "Revolute_Case01": ("REVOLUTE", 0, 0, (2, 0, 0)),
    "RotSpring_Case01": ("REVOLUTE", 0, 1, (2, 0, 0)),
    "Spherical_Case01": ("SPHERICAL", 0, 0, (2, 0, 0)),
    "TransSpring_Case01": (None, 0, 1, (0, 2, 0)),
    "Universal_Case01": ("HOOKE", 0, 0, (0, 2, 0)),
}


@pytest.mark.parametrize("name", sorted(REAL))
def test_real_decks(name: str) -> None:
    model = read_model(data_file(f"adams/test_{name}.adm"))
    joint, constraints, forces, position = REAL[name]
    assert [j.type for j in model.joints.values()] == ([joint] if joint else [])
    assert len(model.general_constraints) == constraints
    assert len(model.scalar_forces) == forces
    (body,) = place(model).bodies.values()
    np.testing.assert_allclose(body.p, position)
    assert body.mass == 1.0
    smallest = (0.1, 0.1, 0.04) if name == "Universal_Case01" else (0.04, 0.1, 0.1)
    np.testing.assert_allclose(body.inertia, np.diag(smallest))
    assert model.gravity.g == (0.0, 0.0, -9.80665)
    assert (model.units.force, model.units.mass_scale) == ("NEWTON", 1.0)
    assert [r.type for r in model.requests.values()][:4] == [
        "MARKER_DISPLACEMENT",
        "MARKER_VELOCITY",
        "MARKER_ACCELERATION",
        "EXPRESSION",
    ]
    assert len(model.requests) == 5
    assert len(model.variables) == (3 if "Spring" in name else 0)
    assert model.warnings == ()

"""The deck's language: what text means, what is refused, and with which words."""

from __future__ import annotations

import math
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from helpers import free_bodies as free
from helpers.folders import ROOT
from mbsim.compile_model.markers import MarkerTable
from mbsim.compile_model.programs import ProgramTable
from mbsim.errors import DeckError
from mbsim.expressions.functions import CONSTANTS, FUNCTIONS, Kind
from mbsim.expressions.parse import ExpressionError, parse
from mbsim.expressions.tree import Call, Number, Time, references
from mbsim.model.elements import (
    ArrayOfNumbers,
    Differential,
    Request,
    ScalarForce,
    Source,
    Spline,
    Variable,
)
from mbsim.model.placement import place


def table(variables=()):
    """Return an empty table of programs for ground and bodies 2 and 3."""
    placement = place(free.model(free.body(2), free.body(3, p=(1, 2, 3))))
    markers = MarkerTable(placement, {1: 2, 2: 0, 3: 1})
    return ProgramTable(markers, {k: Variable(k, parse(text)) for k, text in variables})


def folded(text):
    """Return the value of a constant expression."""
    programs = table()
    programs.add(parse(text))
    (made,) = programs.programs
    assert len(made) == 1, f"{text} is not folded"
    return made[0].value


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1", 1.0),
        (".5", 0.5),
        ("5.E-3", 0.005),
        ("5.0E-002", 0.05),
        ("180D", math.pi),
        ("-90d", -0.5 * math.pi),
        ("180D + 1.5E0D", math.pi * 181.5 / 180),
        ("2 - 3 - 4", -5.0),
        ("12/2/3*2", 4.0),
        ("2**3**2", 512.0),
        ("-2**2", -4.0),
        ("2**-2", 0.25),
        ("2*-3", -6.0),
        ("- - 2", 2.0),
        ("+(1 + 2)*3", 9.0),
        ("\n1\n  + 1 ", 2.0),
        ("pi*RTOD", 180.0),
        ("dtor*180/Pi", 1.0),
        ("IF(-1: 10, 20, 30)", 10.0),
        ("if(0, 10, 20, 30)", 20.0),
        ("IF(2: 10, 20, 30)", 30.0),
        ("MAX(3, -1, 7, 2)", 7.0),
        ("min(3, -1)", -1.0),
    ],
)
def test_text_means(text, value):
    assert folded(text) == pytest.approx(value, rel=1e-15)


def test_tree_keeps_text_names_and_columns():
    made = parse("az(207, 208) - Time")
    assert made.text == "az(207, 208) - Time"
    assert made.root == Call("SUB", (made.root.args[0], Time()), 14)
    assert made.root.args[0] == Call("AZ", (Number(207.0), Number(208.0)), 1)


@pytest.mark.parametrize(
    ("text", "words", "column"),
    [
        ("", "empty", 1),
        ("   ", "empty", 1),
        ("1 +", "the end stands where a number", 4),
        ("1 2", "'2' stands where an operator", 3),
        ("(1", "')' for the '(' of column 1", 3),
        ("1)", "')' stands where", 2),
        ("2 ^ 3", "'^' means nothing", 3),
        ("1.2.3", "1.2.3 is not a number", 1),
        ("3TIME", "3TIME is not a number", 1),
        ("1D3", "write E for a power of ten", 1),
        ("1e999", "too large", 1),
        ("\u0663", "means nothing", 1),
        ("TIEM", "there is no function TIEM; did you mean TIME?", 1),
        ("1 + STPE(1,2,3,4,5)", "did you mean STEP?", 5),
        ("STEP(T, 0, 0, 1, 1)", "there is no function T; the time is TIME", 6),
        ("xyzzy(1)", "there is no function XYZZY", 1),
        ("SIN", "'(' after SIN", 4),
        ("SIN(1, 2)", "SIN has 2 arguments, not 1", 1),
        ("STEP(1)", "STEP has 1 argument, not 5", 1),
        ("SHF(1,2,3)", "SHF has 3 arguments, not 4 to 6", 1),
        ("ATAN2(1: 2)", "':' stands only after the first argument of IF", 8),
        ("IF(1, 2: 3, 4)", "':' stands only", 8),
        ("DM(1.5)", "the first argument of DM must be the id of a marker", 1),
        ("DM(1, TIME)", "the second argument of DM must be the id of a marker", 1),
        ("DM(-1)", "the id of a marker", 1),
        ("JOINT(1, 2, 3)", "the second argument of JOINT must be 0 to 1", 1),
        ("MOTION(1, 0, 9)", "the third argument of MOTION must be 1 to 8", 1),
        ("ORIENT(1, 1, 2, 3)", "must be 27", 1),
        ("VARVAL(1.5)", "the id of a VARIABLE", 1),
    ],
)
def test_what_is_wrong_is_said_with_its_column(text, words, column):
    with pytest.raises(ExpressionError) as caught:
        parse(text)
    assert words in caught.value.message
    assert caught.value.column == column


@pytest.mark.parametrize(
    "text",
    [
        "(" * 100_000,
        "(" * 5_000 + "1" + ")" * 5_000,
        "-" * 10_000 + "1",
        "2**" * 5_000 + "2",
        "SIN(" * 4_000,
        "+".join(["TIME"] * 3_000),
        "1" * 30_000,
    ],
)
def test_hostile_text_is_refused_and_not_a_recursion_error(text):
    with pytest.raises(ExpressionError):
        parse(text)


def test_nested_chains_cannot_go_deeper_than_walkers_can():
    inner = "TIME"
    for _ in range(20):
        inner = f"({inner}" + "+TIME" * 30 + ")"
    with pytest.raises(ExpressionError, match="operations in a row"):
        parse(inner)
    table().add(parse("+".join(["TIME"] * 400)))


@given(st.text(alphabet="0123456789.eEdD+-*/(),: \nTIMEsincoxyz_#&", max_size=60))
def test_any_text_is_a_tree_or_an_expression_error(text):
    try:
        made = parse(text)
    except ExpressionError as fault:
        assert 1 <= fault.column <= len(text) + 1
    else:
        assert made.text == text


def test_references_are_the_elements_that_are_named():
    found = list(references(parse("DX(3, 0, 5) + STEP(TIME, 0, 0, JOINT(7,0,2,9), VARVAL(4))")))
    named = sorted((r.statement, r.id) for r in found)
    assert named == [
        ("JOINT", 7),
        ("MARKER", 3),
        ("MARKER", 5),
        ("MARKER", 9),
        ("VARIABLE", 4),
    ]


def test_variables_are_put_in_place():
    programs = table([(1, "2*VARVAL(2)"), (2, "3 + 4")])
    programs.add(parse("VARVAL(1) + TIME"))
    assert programs.programs[0][0].value == 14.0


@pytest.mark.parametrize(
    ("variables", "words"),
    [
        ([(1, "VARVAL(1)")], "variables that need each other: 1 -> 1"),
        ([(1, "1 + VARVAL(2)"), (2, "VARVAL(1)")], "need each other: 1 -> 2 -> 1"),
        ([(1, "VARVAL(2)")], "there is no variable 2"),
        ([(k, f"VARVAL({k + 1})") for k in range(1, 80)], "more than 50 variables"),
        (
            [(k, f"(VARVAL({k + 1}) + VARVAL({k + 1}))") for k in range(1, 40)] + [(40, "TIME")],
            "more than 50000 operations",
        ),
    ],
)
def test_variables_that_cannot_be_put_in_place(variables, words):
    with pytest.raises(ExpressionError, match=words):
        table(variables).add(parse("VARVAL(1)"))


@pytest.mark.parametrize("text", ["1/0", "LOG(-1)", "SQRT(0 - 2)", "EXP(1000)", "0**-1"])
def test_constants_that_are_no_numbers_are_refused(text):
    with pytest.raises(ExpressionError, match="is not a finite number"):
        table().add(parse(text))


@pytest.mark.parametrize(
    ("text", "use", "words"),
    [
        ("VX(20)", {"differentiable": True}, "VX looks at how markers move"),
        ("DM(20) + JOINT(1,0,2)", {"differentiable": True}, "JOINT looks at forces"),
        ("SFORCE(1,0,2)", {}, "SFORCE looks at forces"),
        ("DM(20)", {"of_time": True}, "DM looks at where markers are"),
        ("DM(99)", {}, "DM: there is no marker 99"),
    ],
)
def test_what_may_not_be_used_is_named(text, use, words):
    with pytest.raises(ExpressionError, match=words):
        table().add(parse(text), **use)


def test_a_fault_names_the_owners_line():
    force = ScalarForce(7, "TRANSLATIONAL", parse("DM(99)"), source=Source("a.xml", 12))
    with pytest.raises(DeckError) as caught:
        table().add(force.expr, force)
    assert str(caught.value).startswith("a.xml:12: Force_Scalar_TwoBody[7]: in 'DM(99)': DM: there")


def test_velocities_and_forces_may_be_used_where_they_are_known():
    programs = table()
    programs.add(parse("VX(20) + DM(20)"))
    request = Request(1, "EXPRESSION")
    programs.add(parse("JOINT(5, 1, 4, 30) - SFORCE(2, 0, 1)"), request, forces=True)
    made = programs.arrays([("MOTION", 5), ("JOINT", 5)], [("SFORCE", 2)])
    assert made.code[3, 1:].tolist() == [0, 1, 1, 4, programs.markers.row(30)]
    assert made.code[4, 1:].tolist() == [1, 0, 0, 1, 0]


def test_programs_say_which_markers_they_look_at():
    programs = table()
    row = programs.markers.row
    first = programs.add(parse("DX(20, 30, 10) + TIME"), differentiable=True)
    second = programs.add(parse("AZ(20) * DM(30)"), differentiable=True)
    assert set(programs.looks_at(first)) == {row(20), row(30), row(10)}
    assert set(programs.looks_at(second)) == {row(20), 0, row(30)}


def test_every_function_of_the_table_can_be_used():
    variables = [(1, "TIME")]
    points = (0.0, 1.0, 2.0, 3.0)
    splines, arrays = {1: Spline(1, points, (points,))}, {1: ArrayOfNumbers(1, points)}
    numbers = {"number": "0.5", "marker": "20", "jflag": "1", "comp": "2", "parameter": "3"}
    for function in FUNCTIONS.values():
        args = [numbers.get(kind, "27" if kind == "measure" else "1") for kind in function.args]
        for count in {function.least, len(args)}:
            text = f"{function.name}({', '.join(args[:count])})"
            programs = table(variables)
            programs.splines, programs.arrays_of_numbers = splines, arrays
            programs.differentials, programs.sensors = {1: Differential(1, parse("TIME"))}, (1,)
            programs.add(parse(text), forces=True, accelerations=True)
            # a spline stands behind its x and z
            assert len(programs.programs[0]) == (3 if function.name.endswith("SPL") else 1)
            if function.kind in (Kind.DISPLACEMENT, Kind.ELEMENTARY, Kind.TABLE):
                programs.add(parse(text), differentiable=True)


def test_every_function_is_in_the_manual() -> None:
    page = ROOT / "mbsim" / "manual" / "pages" / "reference" / "expressions.md"
    named = " ".join(re.findall(r"`([^`]*)`", page.read_text(encoding="utf-8")))
    words = set(re.findall(r"[A-Z][A-Z0-9]+", named))
    named_so = {function.name for function in FUNCTIONS.values()}
    assert not {*named_so, *CONSTANTS, "TIME"} - words

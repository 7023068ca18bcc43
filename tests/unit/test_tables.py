"""Splines and arrays: values against scipy and plain polynomials, and what decks may say."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.interpolate import Akima1DInterpolator, CubicSpline

from helpers import free_bodies as free
from helpers.minimal_deck import added
from helpers.minimal_deck import read as read_xml
from mbsim.arrays.hooks import Hook
from mbsim.arrays.scene import Scene
from mbsim.compile_model.build import build
from mbsim.core import jit
from mbsim.core.address import pack, view
from mbsim.dynamics.expressions.jets import jet, value
from mbsim.dynamics.pipeline.hook_table import put
from mbsim.errors import DeckError
from mbsim.expressions.parse import parse
from mbsim.model.elements import ArrayOfNumbers, Request, Spline
from mbsim.reader.xml import read_model


def test_a_packed_group_says_what_numpy_says_of_its_arrays():
    arrays = (np.zeros((3, 4)), np.zeros(0), (np.zeros((2, 0, 3)), np.arange(5)), np.zeros((1, 1)))
    flat = (*arrays[:2], *arrays[2], arrays[3])
    words = [word for a in flat for word in (a.__array_interface__["data"][0], *a.shape)]
    assert pack(arrays).tolist() == words
    with pytest.raises(ValueError, match="C-contiguous"):
        pack((np.zeros((3, 4)).T,))


X = (0.0, 0.1, 0.25, 0.5, 0.6, 1.0)
Y = (1.0, 3.0, 2.0, 2.5, -1.0, 0.5)
HIGH = (2.0, 2.0, 1.0, 0.0, 4.0, 4.5)
SPLINES = [
    Spline(1, X, (Y,)),
    Spline(2, X, (Y,), linear_extrapolate=True),
    Spline(3, X, (Y, HIGH, Y), z=(-1.0, 1.0, 4.0)),
]


def scene_of(*texts):
    """Return a system of which program k is the k-th text."""
    model = free.model(
        free.body(2),
        requests=[Request(1, "EXPRESSION", exprs=tuple(map(parse, texts)))],
        splines=SPLINES,
        arrays=[ArrayOfNumbers(7, (2.5, -1.0, 1e-3))],
    )
    return build(model)


def evaluate(text, t):
    """Return the jet of an expression of TIME."""
    system = scene_of(text)
    found = jet(system.scene, t, system.y0, 0)
    assert value(system.scene, t, system.y0, 0) == found[0]
    return found


REFERENCES = {
    "AKISPL": Akima1DInterpolator(X, Y),
    "CUBSPL": CubicSpline(X, Y, bc_type="natural"),
}


@pytest.mark.parametrize("name", ["AKISPL", "CUBSPL"])
@pytest.mark.parametrize("order", [0, 1, 2])
def test_cubics_are_those_of_scipy_with_their_derivatives(name, order):
    for x in (0.0, 0.03, 0.1, 0.2, 0.49, 0.55, 0.6, 0.99, 1.0):
        found = evaluate(f"{name}(TIME, 0, 1, {order})", x)
        # at a knot scipy takes the piece behind it, but for the last, as is done here
        wanted = [float(REFERENCES[name](x, order + k)) if order + k < 4 else 0.0 for k in range(3)]
        assert found == pytest.approx(wanted, rel=1e-11, abs=1e-11)


def test_lines_between_points():
    for x in (0.05, 0.3, 0.97):
        assert evaluate("LINSPL(TIME, 0, 1)", x)[0] == pytest.approx(np.interp(x, X, Y), rel=1e-14)
    assert evaluate("LINSPL(TIME, 0, 1, 1)", 0.05)[0] == pytest.approx(20.0, rel=1e-14)
    # outside, whatever the spline says
    assert evaluate("LINSPL(TIME, 0, 1)", -0.1)[0] == pytest.approx(-1.0, rel=1e-14)
    assert evaluate("LINSPL(TIME, 0, 1)", 1.4)[0] == pytest.approx(2.0, rel=1e-14)


@pytest.mark.parametrize("name", ["AKISPL", "CUBSPL"])
@pytest.mark.parametrize(("x", "ends"), [(-0.3, slice(0, 3)), (1.7, slice(-3, None))])
def test_outside_go_on_a_parabola_or_a_line(name, x, ends):
    parabola = np.polyfit(X[ends], Y[ends], 2)
    two = slice(0, 2) if x < 0 else slice(-2, None)
    line = np.polyfit(X[two], Y[two], 1)
    for spline, curve in ((1, parabola), (2, line)):
        wanted = [float(np.polyval(np.polyder(curve, k), x)) for k in range(3)]
        assert evaluate(f"{name}(TIME, 0, {spline})", x) == pytest.approx(wanted, rel=1e-10)
        slope = evaluate(f"{name}(TIME, 0, {spline}, 1)", x)[0]
        assert slope == pytest.approx(wanted[1], rel=1e-10)


@pytest.mark.parametrize("z", [-2.0, -1.0, 0.3, 1.0, 2.2, 5.0])
def test_a_surface_is_linear_between_its_curves(z):
    low, high = REFERENCES["CUBSPL"], CubicSpline(X, HIGH, bc_type="natural")
    share = (z + 1.0) / 2.0 if z < 1.0 else (4.0 - z) / 3.0
    wanted = (1.0 - share) * low(0.42) + share * high(0.42)
    assert evaluate(f"CUBSPL(0.42, {z}, 3)", 0.0)[0] == pytest.approx(wanted, rel=1e-12)


def test_jets_of_both_arguments():
    f = "CUBSPL(TIME**2, 3*TIME - 1, 3, 1)"
    at, h = 0.53, 1e-4
    found = evaluate(f, at)
    around = [evaluate(f, at + k * h)[0] for k in (-2, -1, 0, 1, 2)]
    first = np.dot([1 / 12, -2 / 3, 0, 2 / 3, -1 / 12], around) / h
    second = np.dot([-1 / 12, 4 / 3, -5 / 2, 4 / 3, -1 / 12], around) / h**2
    assert found[1] == pytest.approx(first, rel=1e-8)
    assert found[2] == pytest.approx(second, rel=1e-5)


def test_numbers_of_arrays_are_constants():
    system = scene_of("ARYVAL(7, 1) + ARYVAL(7, 2)*ARYVAL(7, 3)")
    assert system.scene.programs.code[:, 0].tolist() == [0]
    assert value(system.scene, 0.0, system.y0, 0) == 2.5 - 1e-3


def _compiled(context, program, t, y, out):
    scene = view(context, Scene)
    out[0] = value(scene, t, y, program)
    out[1], out[2], out[3] = jet(scene, t, y, program)


def test_compiled_splines_are_those_of_plain_python():
    texts = ["AKISPL(TIME, 0, 1)", "CUBSPL(TIME, 2*TIME, 3, 1)", "LINSPL(SIN(9*TIME), 0, 2)"]
    system = scene_of(*texts)
    put(system.scene, Hook.VALUE)
    put(system.scene, Hook.JET)
    table, found = pack(system.scene), np.zeros(4)
    for k, text in enumerate(texts):
        for t in (-0.2, 0.3, 0.77, 1.2):
            jit.function(_compiled)(int(table.ctypes.data), k, t, system.y0, found)
            wanted = evaluate(text, t)
            assert found[1:] == pytest.approx(wanted, rel=1e-13, abs=1e-13)
            assert found[0] == found[1]


def test_a_spline_by_text_by_attributes_and_by_file(tmp_path):
    (tmp_path / "curve.csv").write_text("# x, y\n0, 1; 1, 2\n2\t5  # more\n3, 9\n")
    statements = """<Reference_Spline id="1"> 0 1  1 2  2 5  3 9 </Reference_Spline>
<Reference_Spline id="2" x="0 1 2 3" y="1, 2, 5, 9" linear_extrapolate="TRUE"/>
<Reference_Spline id="3" file="curve.csv"/>
<Reference_Spline id="4" x="0 1 2 3" y="1 2 5 9 0 0 0 1" z="-1 1"/>
<Reference_Spline id="5" z="-1 1">0 1 0  1 2 0  2 5 0  3 9 1</Reference_Spline>
<Reference_Array id="9" type="IC"> 2.5 -1
 0.4 </Reference_Array>"""
    model = read_xml(tmp_path, added(statements))
    for id in (1, 2, 3):
        assert model.splines[id].x == (0.0, 1.0, 2.0, 3.0)
        assert model.splines[id].y == ((1.0, 2.0, 5.0, 9.0),)
        assert model.splines[id].linear_extrapolate == (id == 2)
    assert model.splines[4].y == model.splines[5].y == ((1, 2, 5, 9), (0, 0, 0, 1))
    assert model.splines[4].z == (-1.0, 1.0)
    assert model.arrays[9].values == (2.5, -1.0, 0.4)


@pytest.mark.parametrize(
    ("statement", "said"),
    [
        ('<Reference_Spline id="1"/>', "needs its points once"),
        ('<Reference_Spline id="1" x="0 1">0 1 1 2</Reference_Spline>', "needs its points once"),
        ('<Reference_Spline id="1" x="0 1" y="1 2 3"/>', "must be 2 numbers, 1 for each of 2 x"),
        ('<Reference_Spline id="1" x="0 0" y="1 2"/>', "x must ascend; 0 stands behind 0"),
        ('<Reference_Spline id="1">0 1 0 2</Reference_Spline>', ": x must ascend; 0 stands behind"),
        ('<Reference_Spline id="1" x="0 1" y="1 2 3 4" z="2 1"/>', "z must ascend"),
        ('<Reference_Spline id="1" x="0 1" y="1 2" z="2"/>', "needs 2 values of z"),
        ('<Reference_Spline id="1" x="0" y="1"/>', "2 points or more"),
        ('<Reference_Spline id="1">0 1 2</Reference_Spline>', "make no whole rows"),
        ('<Reference_Spline id="1">0 one</Reference_Spline>', 'points="0 one": must be numbers'),
        ('<Reference_Spline id="1" file="none.csv"/>', "No such file"),
        ('<Reference_Array id="1"/>', "values: missing"),
        ('<Reference_Array id="1" type="X">1</Reference_Array>', "an array of type X has none"),
        ('<Reference_Array id="1" values="1">1</Reference_Array>', "given as text"),
        (
            '<Reference_Spline id="1" x="0 1 2" y="1 2 3"/>'
            '<Reference_Variable id="1" expr="AKISPL(TIME,0,1)"/>',
            "AKISPL needs 4 points or more; spline 1 has 3",
        ),
        (
            '<Reference_Array id="1">1 2</Reference_Array>'
            '<Reference_Variable id="1" expr="ARYVAL(1,3)"/>',
            "array 1 has 2 numbers, no number 3",
        ),
        ('<Reference_Variable id="1" expr="CUBSPL(1,0,7)"/>', "no Reference_Spline has this id"),
        ('<Reference_Variable id="1" expr="ARYVAL(7,1)"/>', "no Reference_Array has this id"),
        ('<Reference_Variable id="1" expr="CUBSPL(1,0,7,3)"/>', "fourth argument of CUBSPL must"),
    ],
)
def test_faults_of_tables_are_named(tmp_path, statement, said):
    with pytest.raises(DeckError) as caught:
        read_xml(tmp_path, added(statement))
    assert said in str(caught.value)
    assert "deck.xml:" in str(caught.value)


def test_a_file_with_a_word_is_named_with_its_line(tmp_path):
    (tmp_path / "bad.csv").write_text("0,1\n1,two\n")
    with pytest.raises(DeckError, match=r"bad\.csv:2: 'two' is not a number"):
        read_xml(tmp_path, added('<Reference_Spline id="1" file="bad.csv"/>'))


ADM = """splines of an Adams deck
UNITS/FORCE=NEWTON, MASS=KILOGRAM, LENGTH=METER, TIME=SECOND
PART/1, GROUND
PART/2, MASS=1, CM=20, IP=1, 1, 1
MARKER/20, PART=2
SPLINE/1, X=0, 1, 2, 3
, Y=1, 2, 5, 9, LINEAR_EXTRAPOLATE
SPLINE/2, X=0, 1, 2, 3
, Y=-1, 1, 2, 5, 9
, Y=1, 0, 0, 0, 1
ARRAY/3, IC, SIZE=2, NUMBERS=2.5, -1
REQUEST/1, F2=AKISPL(TIME,0,1,1)\\F3=ARYVAL(3,2)
END
"""


def test_splines_and_arrays_of_adams_decks(tmp_path):
    (tmp_path / "deck.adm").write_text(ADM)
    model = read_model(tmp_path / "deck.adm")
    assert model.splines[1].y == ((1.0, 2.0, 5.0, 9.0),)
    assert model.splines[1].linear_extrapolate
    assert model.splines[2].z == (-1.0, 1.0)
    assert model.splines[2].y == ((1, 2, 5, 9), (0, 0, 0, 1))
    assert model.arrays[3].values == (2.5, -1.0)
    assert math.isclose(model.splines[2].x[3], 3.0)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("SIZE=2", "SIZE=3", "there are 2 NUMBERS"),
        ("Y=1, 0, 0, 0, 1", "Y=1, 0, 0, 0", "has 3 values in a curve, and there are 4 x"),
        ("X=0, 1, 2, 3\n, Y=1", "X=0, 2, 1, 3\n, Y=1", "must ascend"),
        ("ARRAY/3, IC", "ARRAY/3, X", "an array of type X has none"),
    ],
)
def test_faults_of_adams_tables(tmp_path, old, new, said):
    (tmp_path / "deck.adm").write_text(ADM.replace(old, new))
    with pytest.raises(DeckError) as caught:
        read_model(tmp_path / "deck.adm")
    assert said in str(caught.value)


@pytest.mark.parametrize(
    "said",
    [
        'id="1"> 0 5  1 6  2 7  3 8 </Reference_Spline',
        'id="1" x="0 1 2 3" y="5 6 7 8"/',
        'id="1" file="points.csv"/',
    ],
)
def test_points_that_an_option_gives_replace_those_of_the_deck(tmp_path, said):
    (tmp_path / "points.csv").write_text("0 5\n1 6\n2 7\n3 8\n")
    (tmp_path / "other.csv").write_text("0 1\n2 3\n4 5\n6 7\n")
    deck = added(f"<Reference_Spline {said}>")
    name = "Reference_Spline[1]"
    for given in (
        (f"{name}.x=0 2 4 6", f"{name}.y=1 3 5 7"),
        (f"{name}.points=0 1 2 3 4 5 6 7",),
        (f"{name}.file=other.csv",),
    ):
        spline = read_xml(tmp_path, deck, given).splines[1]
        assert spline.x == (0.0, 2.0, 4.0, 6.0)
        assert spline.y == ((1.0, 3.0, 5.0, 7.0),)
    for given in (f"{name}.x=0 2 4 6", f"{name}.y=1 3 5"):
        with pytest.raises(DeckError):
            read_xml(tmp_path, deck, (given, f"{name}.file=other.csv"))


def test_points_of_a_curve_replace_its_matrix(tmp_path):
    curve = added('<Reference_ParamCurve id="1" is_curve_points="TRUE" matrix_id="3"/>')
    points = "0 0 0  1 0 0  2 1 0  3 0 0  4 1 0"
    found = read_xml(tmp_path, curve, (f"Reference_ParamCurve[1].points={points}",)).curves[1]
    assert found.points[2] == (2.0, 1.0, 0.0)

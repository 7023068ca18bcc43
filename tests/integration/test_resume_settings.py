"""`--resume` goes on only with the same model, settings and subroutines, and says what differs."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import mbsim
from helpers.decks import GROUND, sphere
from mbsim.compile_model.build import build
from mbsim.errors import Interrupted, ModelError
from mbsim.model import elements
from mbsim.results.identity import Identity, plain
from mbsim.run import loop
from mbsim.run.settings import Settings, Stage, settle

LAW = """
from helper import STIFFNESS

def CFFSUB(id, time, par, npar, loci, locj, x, xdot, nforce, dflag, iflag):
    return [-par[0] * STIFFNESS * xdot[0], -par[0] * STIFFNESS * xdot[1], 0.0]
"""
MODEL = (
    GROUND
    + sphere(0.0995, v=(0.5, 0.1, 0))
    + """
<Body_Rigid id="3" cg_id="30" mass="1" inertia_xx="1" inertia_yy="1" inertia_zz="1"/>
<Reference_Marker id="30" body_id="3" pos_x="5" pos_z="0.6"/>
<Post_Graphic id="300" type="TriaMesh" rm_id="30" file="part.obj"/>
<Force_Contact id="302" num_i_graphics="1" i_graphics_id="300" num_j_graphics="1"
  j_graphics_id="100" cnf_type="IMPACT" stiffness="1e4" exponent="1" damping="10" dmax="1e-4"
  cff_type="COULOMB_OFF"/>
<Force_Contact id="301" num_i_graphics="1" i_graphics_id="200" num_j_graphics="1"
  j_graphics_id="100" cnf_type="IMPACT" stiffness="1e5" exponent="1.5" damping="100" dmax="1e-4"
  cff_type="USERCFF" cff_fnc_name="CFFSUB" cff_param_string="USER(50)" script_name="law.py"/>
<Control_Diff id="7" expr="-DIF(7)" ic="1"/>
<Force_Gravity grav_z="-9.81"/>"""
)
COMMAND = (
    '<Param_Transient integr_tol="1e-3" h_max="1e-2"/>'
    '<Simulate analysis_type="Transient" end_time="0.2" print_interval="0.01"/>'
)
DECK = f"<MotionSolve><Model>{MODEL}</Model><Command>{COMMAND}</Command></MotionSolve>"


def write(folder, changes=()):
    """Write the deck and its files, texts in them replaced."""
    corners = [(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]
    faces = ["1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4"]
    triangles = [f"f {a} {b} {c}\nf {a} {c} {d}" for a, b, c, d in (face.split() for face in faces)]
    mesh = "".join(f"v {x} {y} {z}\n" for x, y, z in corners) + "\n".join(triangles)
    files = {
        "deck.xml": DECK,
        "law.py": LAW,
        "helper.py": "STIFFNESS = 1.0\n",
        "part.obj": mesh,
    }
    for name, text in files.items():
        for file, old, new in changes:
            if file == name:
                assert old in text
                text = text.replace(old, new)
        (folder / name).write_text(text, encoding="utf-8")
    return folder / "deck.xml"


@pytest.fixture(scope="module")
def begun(tmp_path_factory):
    """Return the folder of a deck whose run was interrupted."""
    folder = tmp_path_factory.mktemp("deck")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(loop, "FIRST_BUDGET", 10)
        patch.setattr(loop, "next_budget", lambda *called: 10)
        left = [10]

        def stop(time, step, until):
            left[0] -= 1
            if left[0] == 0:
                raise Interrupted("enough")

        with pytest.raises(Interrupted):
            run(folder, resume=False, progress=stop)
    return folder


def run(folder, changes=(), overrides=(), resume=True, **settings):
    """Run the deck as changed."""
    model = mbsim.read_model(write(folder, changes), list(overrides))
    settings = {"detector": "auto", "interpret_plugins": True} | settings
    return mbsim.simulate(model, output=folder / "out", resume=resume, **settings)


#: What is set or written otherwise, and what the message says.
OVERRIDES = {
    "Param_Transient.h_max=1e-4": "Simulate[1].transient.h_max was 0.01 and is 0.0001 now",
    "Param_Transient.h_min=1e-9": "Simulate[1].transient.h_min was the default and is 1e-09 now",
    "Param_Transient.h0_max=1e-6": "h0_max was the default and is 1e-06 now",
    "Param_Transient.integr_tol=1e-4": "tol was 1e-05 and is 1e-06 now",
    "Param_Transient.integrator_type=VSTIFF": "integrator was AUTO and is RADAU5 now",
    "Force_Contact[301].stiffness=2e5": "Force_Contact[301].stiffness was 100000 and is 200000",
    "Force_Contact[301].cff_param_string=USER(60)": "Force_Contact[301].cff.par[1] was 50",
    "Force_Contact[302].damping=11": "Force_Contact[302].damping was 10 and is 11 now",
    "Body_Rigid[3].mass=2": "Body_Rigid[3].mass was 1 and is 2 now",
    "Body_Rigid[2].v_ic_y=0.2": "Body_Rigid[2].v_ic[2] was 0.1 and is 0.2 now",
    "Reference_Marker[30].pos_x=6": "Reference_Marker[30].pos[1] was 5 and is 6 now",
    "Post_Graphic[200].radius=0.2": "Post_Graphic[200].size[1] was 0.1 and is 0.2 now",
    "Control_Diff[7].expr=-2*DIF(7)": "Control_Diff[7].expr was -DIF(7) and is -2*DIF(7) now",
    "Force_Gravity.grav_z=-9.8": "Force_Gravity.g[3] was -9.81 and is -9.8 now",
    "Simulate.print_interval=0.02": "print_interval was 0.01 and is 0.02 now",
}
FILES = {
    "law.py": (("law.py", "xdot[0]", "xdot[1]"), "Force_Contact[301]: CFFSUB.law.py is another"),
    "what it imports": (("helper.py", "1.0", "2.0"), "CFFSUB.helper.py is another"),
    "mesh": (("part.obj", "v 0.5 0.5 0.5", "v 0.5 0.5 0.6"), "Post_Graphic[300].vertices is anot"),
    "deck": (
        ("deck.xml", 'exponent="1.5"', 'exponent="2"'),
        "[301].exponent was the default and is 2",
    ),
}
CALLS = {
    "end_time": (0.3, "end_time was 0.2 and is 0.3 now"),
    "print_interval": (0.02, "print_interval was 0.01 and is 0.02 now"),
    "tol": (1e-6, "tol was "),
    "integrator": ("DOP853", "integrator was AUTO and is DOP853 now"),
    "detector": ("fcl", "detector was auto and is fcl now"),
    "interpret_plugins": (False, "CFFSUB.compiled was False and is True now"),
}


def refused(said, folder, **changed):
    with pytest.raises(ModelError) as error:
        run(folder, **changed)
    assert said in str(error.value)
    assert "a run goes on as it began" in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("text", OVERRIDES)
def test_another_attribute_is_refused_by_name(begun, text):
    refused(OVERRIDES[text], begun, overrides=[text])


@pytest.mark.parametrize("name", FILES)
def test_another_file_is_refused_by_name(begun, name):
    change, said = FILES[name]
    refused(said, begun, changes=[change])


@pytest.mark.parametrize("name", CALLS)
def test_another_setting_is_refused_by_name(begun, name):
    value, said = CALLS[name]
    refused(said, begun, **{name: value})


def test_what_changes_nothing_is_not_refused(begun, tmp_path):
    """A path, a comment in a neighbouring file that nobody names: the run goes on."""
    straight = run(tmp_path, resume=False)
    (begun / "other.py").write_text("raise ValueError\n", encoding="utf-8")
    copy = tmp_path / "copy"
    copy.mkdir()
    (copy / "out").symlink_to(begun / "out")
    resumed = run(copy)
    for name in straight.keys():
        np.testing.assert_array_equal(resumed[name], straight[name], err_msg=name)


# --- every field counts ------------------------------------------------------------------------

#: Fields from which no result follows.
ASIDE = {
    *(("Model", name) for name in ("name", "file", "sha256", "notes", "warnings", "overrides")),
    *(("Subroutine", "dll_name"), ("Subroutine", "script_name"), ("Graphic", "mesh_file")),
    *(("RelationSubroutine", name) for name in ("dll_name", "script_name")),
    # how pictures show it
    *(("Graphic", "color"), ("Graphic", "hidden"), ("Graphic", "bounds")),
    *(("Change", "text"), ("Settings", "notes"), ("Stage", "tol_from")),
}
CLASSES = [
    one
    for one in (*vars(elements).values(), Settings, Stage)
    if dataclasses.is_dataclass(one)
    and isinstance(one, type)
    # of an expression the text is its tree
    and one not in (elements.Source, elements.Expression)
]


@pytest.mark.parametrize("kind", CLASSES, ids=lambda kind: kind.__name__)
def test_every_field_counts(kind):
    blank = {
        field.name: None
        for field in dataclasses.fields(kind)
        if field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING
    }
    one = kind(**blank)
    for field in dataclasses.fields(kind):
        if field.name == "source":
            continue
        other = dataclasses.replace(one, **{field.name: 123.456})
        counts = plain(other) != plain(one)
        assert counts == ((kind.__name__, field.name) not in ASIDE), field.name


def test_facts_do_not_depend_on_where_they_are_made(tmp_path):
    model = mbsim.read_model(write(tmp_path))
    facts = []
    for _ in range(2):
        system = build(model, interpret=True)
        facts.append(Identity(system, settle(model)))
    assert facts[0].digests == facts[1].digests
    packed = facts[0].packed
    assert not any(facts[1].changes(packed, kind) for kind in facts[1].facts)

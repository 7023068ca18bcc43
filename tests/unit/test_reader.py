"""Good decks: what each statement becomes, and what is accepted with a note or a warning."""

from __future__ import annotations

import math
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import mbsim
from helpers.minimal_deck import MINIMAL, TETRAHEDRON, added, deck, read
from mbsim.errors import ModelError
from mbsim.model.elements import Model
from mbsim.model.frames import rotation_313
from mbsim.model.placement import place
from mbsim.reader import units
from mbsim.run.settings import settle

SAMPLE = """<Sample><Model>
 <Param_Unit force_unit="NEWTON" mass_unit="KILOGRAM" length_unit="METER" time_unit="SECOND"/>
 <Body_Rigid id="1" isground="TRUE"/>
 <Body_Rigid id="2" label="ball" cg_id="20" mass="5" inertia_xx="0.023328" inertia_yy="0.023328"
  inertia_zz="0.023328" v_ic_x="5" v_ic_x_flag="TRUE"/>
 <Reference_Marker id="10" body_id="1"/> <Reference_Marker id="20" body_id="2" pos_z="0.108"/>
 <Post_Graphic id="100" type="Plane" rm_id="10"/>
 <Post_Graphic id="200" type="Sphere" center_marker_id="20" radius="0.108"/>
 <Force_Contact id="301" num_i_graphics="1" i_graphics_id="200" num_j_graphics="1"
  j_graphics_id="100" cnf_type="Impact" stiffness="1e8" exponent="1.5" damping="200" dmax="1e-4"
  cff_type="COULOMB_ON" mu_static="0.2" mu_dynamic="0.2" stiction_trans_vel="0.02"
  friction_trans_vel="0.02"/>
 <Force_Gravity grav_z="-9.81"/>
</Model><Command><Param_Transient integr_tol="1e-5"/>
 <Simulate analysis_type="Transient" end_time="3" print_interval="0.01"/></Command></Sample>"""

MM_UNITS = ('length_unit="METER"', 'length_unit="MILLIMETER"')


def test_sample_deck(tmp_path: Path) -> None:
    model = read(tmp_path, SAMPLE)
    assert model.name == "deck"
    assert len(model.sha256) == 64
    assert model.notes == model.warnings == ()
    ball = model.bodies[2]
    assert (ball.label, ball.mass, ball.cg_id, ball.v_ic) == ("ball", 5.0, 20, (5.0, 0.0, 0.0))
    assert ball.inertia == (0.023328, 0.023328, 0.023328, 0.0, 0.0, 0.0)
    assert (ball.source.line, model.contacts[301].source.line) == (4, 9)
    contact = model.contacts[301]
    assert (contact.i_graphics_id, contact.j_graphics_id) == ((200,), (100,))
    assert (contact.cnf_type, contact.cff_type) == ("IMPACT", "COULOMB_ON")
    assert (contact.stiffness, contact.damping, contact.dmax) == (1e8, 200.0, 1e-4)
    assert model.gravity.g == (0.0, 0.0, -9.81)
    (run,) = model.simulations
    assert (run.start_time, run.end_time, run.print_interval) == (0.0, 3.0, 0.01)
    assert run.transient is not None
    assert run.transient.integr_tol == 1e-5


def test_names_and_keywords_without_case_and_underscore(tmp_path: Path) -> None:
    text = deck(
        ('Body_Rigid id="1" isground="TRUE"', 'BODYRIGID ID="1" IsGround="true"'),
        ('cnf_type="Impact"', 'CNFTYPE="impact"'),
        ('"COULOMB_ON"', '"CoulombOn"'),
        ("<Force_Gravity", "<force_gravity"),
    )
    model = read(tmp_path, text)
    assert model.bodies[1].is_ground
    assert model.contacts[301].cff_type == "COULOMB_ON"


@pytest.mark.parametrize(
    ("spelling", "canonical"),
    [
        ("Coulomb_On", "COULOMB_ON"),
        ("COULOMB_DYNAMICONLY", "COULOMB_DYNAMICONLY"),
        ("Dynamics_Only", "COULOMB_DYNAMICONLY"),
        ("DYNAMIC_ONLY", "COULOMB_DYNAMICONLY"),
        ("DynamicsOnly", "COULOMB_DYNAMICONLY"),
        ("CoulombOff", "COULOMB_OFF"),
        ("UserCFF", "USERCFF"),
    ],
)
def test_friction_spellings(tmp_path: Path, spelling: str, canonical: str) -> None:
    model = read(tmp_path, deck(('"COULOMB_ON"', f'"{spelling}"')))
    assert model.contacts[301].cff_type == canonical


def test_any_root_and_order(tmp_path: Path) -> None:
    model_part = re.search("<Model>.*</Model>", MINIMAL, re.DOTALL)
    command_part = re.search("<Command>.*</Command>", MINIMAL, re.DOTALL)
    assert model_part
    assert command_part
    bare = read(tmp_path, model_part[0])
    assert bare.simulations == ()
    turned = f"<a><b>{command_part[0]}</b><c version='2'>{model_part[0]}</c></a>"
    assert len(read(tmp_path, turned).simulations) == 1


def test_encodings(tmp_path: Path) -> None:
    text = deck(('cg_id="20"', 'cg_id="20" label="Kügelchen"'))
    for encoding in ("utf-8", "utf-8-sig", "utf-16", "iso-8859-1"):
        name = encoding.removesuffix("-sig")
        data = f'<?xml version="1.0" encoding="{name}"?>\r\n{text}'.encode(encoding)
        assert read(tmp_path, data).bodies[2].label == "Kügelchen"


def test_lines_are_those_of_the_start_of_a_tag(tmp_path: Path) -> None:
    text = deck(
        (
            "<Force_Gravity",
            "<!-- <Body_Rigid\n/> -->\n<Force_Gravity\n\n label='a > b'\n",
        )
    )
    model = read(tmp_path, text)
    assert model.gravity.source.line == 15
    assert model.contacts[301].source.line == 9


@pytest.mark.parametrize(
    ("names", "scale"),
    [
        (("NEWTON", "KILOGRAM", "METER", "SECOND"), 1.0),
        (("NEWTON", "KILOGRAM", "MILLIMETER", "SECOND"), 1e-3),
        (("NEWTON", "TONNE", "MILLIMETER", "SECOND"), 1.0),
        (("KNEWTON", "KILOGRAM", "MILLIMETER", "MILLISECOND"), 1.0),
        (("DYNE", "GRAM", "CENTIMETER", "SECOND"), 1.0),
        (("POUND_FORCE", "SLUG", "FOOT", "SECOND"), 1.0),
        (("POUND_FORCE", "SLINCH", "INCH", "SECOND"), 1.0),
        (("POUNDAL", "POUND_MASS", "FOOT", "SECOND"), 1.0),
        (("POUND_FORCE", "POUND_MASS", "INCH", "SECOND"), 0.0254 / (9.80665)),
        (("KILOGRAM_FORCE", "KILOGRAM", "METER", "SECOND"), 1.0 / 9.80665),
    ],
)
def test_mass_scale_makes_force_equal_mass_times_acceleration(
    names: tuple[str, str, str, str], scale: float
) -> None:
    assert units.make_units(*names).mass_scale == pytest.approx(scale, rel=1e-15)


def test_units_of_the_deck(tmp_path: Path) -> None:
    mm = read(tmp_path, deck(MM_UNITS)).units
    assert (mm.mass_scale, mm.length_m, mm.length) == (1e-3, 1e-3, "MILLIMETER")
    unit_line = MINIMAL.splitlines()[1]
    assert read(tmp_path, deck((unit_line, ""))).units.mass_scale == 1.0
    factor = '<Param_Unit mass_mult_factor="0.001"/>'
    assert read(tmp_path, deck((unit_line, factor))).units.mass_scale == 1e-3
    every = {**units.FORCE, **units.MASS, **units.LENGTH, **units.TIME}
    assert len(every) == 13 + 13 + 14 + 7


def test_default_transition_velocities_warn_in_mm(tmp_path: Path) -> None:
    speeds = (' stiction_trans_vel="0.01"\n friction_trans_vel="0.02"', "")
    model = read(tmp_path, deck(speeds))
    assert model.contacts[301].stiction_trans_vel == 1e-3
    assert model.warnings == ()
    warnings = read(tmp_path, deck(speeds, MM_UNITS)).warnings
    assert len(warnings) == 2
    assert "deck.xml:9: Force_Contact[301]: stiction_trans_vel" in warnings[0]
    assert "1e-06 m/s" in warnings[0]


def test_velocity_counts_only_with_its_flag(tmp_path: Path) -> None:
    velocities = 'v_ic_x="1" v_ic_x_flag="TRUE" v_ic_y="2" w_ic_z="3" w_ic_z_flag="FALSE"'
    model = read(tmp_path, deck(('cg_id="20"', f'cg_id="20" {velocities}')))
    assert model.bodies[2].v_ic == (1.0, 0.0, 0.0)
    assert model.bodies[2].w_ic == (0.0, 0.0, 0.0)
    assert len(model.warnings) == 2
    assert 'Body_Rigid[2]: v_ic_y="2": ignored, because v_ic_y_flag' in model.warnings[0]


def test_larger_dynamic_friction_warns(tmp_path: Path) -> None:
    (warning,) = read(tmp_path, deck(('mu_dynamic="0.2"', 'mu_dynamic="0.4"'))).warnings
    assert 'mu_dynamic="0.4": larger than mu_static (0.3)' in warning


def test_friction_without_a_coefficient_warns(tmp_path: Path) -> None:
    bare = deck(('mu_static="0.3" ', ""), ('mu_dynamic="0.2"', ""))
    warnings = read(tmp_path, bare).warnings
    assert any(
        "mu_dynamic: not given: 0, so that COULOMB_ON gives no friction" in w for w in warnings
    )


def test_friction_is_off_where_no_type_is_given(tmp_path: Path) -> None:
    model = read(tmp_path, deck(('cff_type="COULOMB_ON" ', "")))
    assert model.contacts[301].cff_type == "COULOMB_OFF"
    assert any("mu_static: has no effect with cff_type COULOMB_OFF" in n for n in model.notes)


def law(attributes: str) -> str:
    old = 'cnf_type="Impact" stiffness="1e8" exponent="1.5" damping="200" dmax="1e-4"'
    return deck((old, attributes))


def test_normal_laws(tmp_path: Path) -> None:
    text = law('cnf_type="huntCrossley" stiffness="1e6" restitutioncoeff="0.5" ref_velocity="2"')
    contact = read(tmp_path, text).contacts[301]
    assert (contact.cnf_type, contact.stiffness, contact.exponent) == ("HUNT_CROSSLEY", 1e6, 1.5)
    assert (contact.restitution_coef, contact.ref_velocity) == (0.5, 2.0)

    contact = read(tmp_path, law('cnf_type="poisson" penalty="1e5"')).contacts[301]
    assert (contact.cnf_type, contact.penalty, contact.normal_trans_vel) == ("POISSON", 1e5, 1e-3)
    assert contact.restitution_coef is None

    text = law('cnf_type="Hertz" i_elastic_modulus="7e10" i_poisson_ratio="0.3" i_radius="0.2"')
    model = read(tmp_path, text)
    contact = model.contacts[301]
    assert (contact.i_elastic_modulus, contact.i_poisson_ratio) == (7e10, 0.3)
    assert (contact.i_radius, contact.j_radius, contact.j_elastic_modulus) == (0.2, None, None)
    assert any("j_elastic_modulus: not given: this side is rigid" in note for note in model.notes)


@pytest.mark.parametrize(
    ("attributes", "note"),
    [
        ('cnf_type="POISSON" penalty="1" damping="3"', "damping: has no effect with cnf_type PO"),
        ('cnf_type="HERTZ" stiffness="1" exponent="2"', "exponent: has no effect with cnf_type HE"),
        ('cnf_type="HERTZ" stiffness="1" i_radius="2"', "where stiffness is given"),
        ('cnf_type="HUNT_CROSSLEY" stiffness="1" dmax="2"', "dmax: has no effect with cnf_type HU"),
        ('cnf_type="HUNT_CROSSLEY" stiffness="1" ref_velocity="2"', "without restitution_coef"),
        ('cnf_type="IMPACT" stiffness="1" penalty="2"', "penalty: has no effect with cnf_type IM"),
        ('cnf_type="IMPACT" stiffness="1" restitution_coef="1"', "restitution_coef: has no effect"),
    ],
)
def test_what_a_normal_law_does_not_read_is_noted(
    tmp_path: Path, attributes: str, note: str
) -> None:
    assert any(note in line for line in read(tmp_path, law(attributes)).notes)


@pytest.mark.parametrize(
    ("attributes", "warning"),
    [
        ('cnf_type="POISSON" restitution_coef="0.5"', "penalty: not given"),
        ('cnf_type="POISSON" penalty="0"', 'penalty="0": is 0'),
        ('cnf_type="HUNT_CROSSLEY"', "stiffness is 0"),
        ('cnf_type="HUNT_CROSSLEY" stiffness="1" exponent="0.9"', "infinite at touch"),
    ],
)
def test_a_weak_spring_warns(tmp_path: Path, attributes: str, warning: str) -> None:
    assert any(warning in line for line in read(tmp_path, law(attributes)).warnings)


def test_default_normal_trans_vel_warns_in_mm(tmp_path: Path) -> None:
    poisson = law('cnf_type="POISSON" penalty="1e5"')
    assert not read(tmp_path, poisson).warnings
    in_mm = poisson.replace('length_unit="METER"', 'length_unit="MILLIMETER"')
    warnings = read(tmp_path, in_mm).warnings
    assert any("normal_trans_vel: not given" in line and "1e-06 m/s" in line for line in warnings)


def test_user_subroutine(tmp_path: Path) -> None:
    (tmp_path / "friction.py").write_text("def CFFSUB(*a): return [0.0, 0.0, 0.0]\n")
    user = (
        'cff_type="UserCFF" cff_param_string="user( 0.05, .01,1E-1 )" cff_fnc_name="MYSUB" '
        'cff_dll_name="NULL" script_name=".\\friction.py" interpreter="Python"'
    )
    cff = read(tmp_path, deck(('cff_type="COULOMB_ON"', user))).contacts[301].cff
    assert cff.par == (0.05, 0.01, 0.1)
    assert (cff.fnc_name, cff.dll_name, cff.interpreter) == ("MYSUB", "", "PYTHON")
    assert cff.script_name == str((tmp_path / "friction.py").resolve())
    bare = read(tmp_path, deck(('"COULOMB_ON"', '"USERCFF" cff_param_string="USER()"')))
    assert bare.contacts[301].cff.par == ()
    assert bare.contacts[301].cff.script_name == ""


def test_orientation(tmp_path: Path) -> None:
    # 3-1-3 and the same axes as columns of cosines
    R = rotation_313(0.3, 1.1, -0.7)
    cosines = " ".join(f'a{i}{j}="{float(R[i, j])!r}"' for i in range(3) for j in range(3))
    by_angles = read(tmp_path, deck(("pos_z", 'psi="0.3" theta="1.1" phi="-0.7" pos_z')))
    by_cosines = read(tmp_path, deck(("pos_z", f"{cosines} pos_z")))
    for model in (by_angles, by_cosines):
        np.testing.assert_allclose(model.markers[20].R, R, rtol=0, atol=2e-16)
    # Rz(psi) Rx(theta) Rz(phi), written out
    turn = [_about(axis, angle) for axis, angle in ((2, 0.3), (0, 1.1), (2, -0.7))]
    np.testing.assert_allclose(R, turn[0] @ turn[1] @ turn[2], rtol=0, atol=2e-16)


def _about(axis: int, angle: float) -> np.ndarray:
    """Return the rotation about a coordinate axis."""
    c, s = math.cos(angle), math.sin(angle)
    R = np.eye(3)
    j, k = (axis + 1) % 3, (axis + 2) % 3
    R[j, j] = R[k, k] = c
    R[k, j], R[j, k] = s, -s
    return R


def test_rough_cosines_are_made_orthonormal(tmp_path: Path) -> None:
    c, s = 0.80001, 0.6
    rough = f'a00="{c}" a10="{s}" a01="{-s}" a11="{c}"'
    model = read(tmp_path, deck(("pos_z", f"{rough} pos_z")))
    R = model.markers[20].R
    np.testing.assert_allclose(R.T @ R, np.eye(3), rtol=0, atol=1e-15)
    np.testing.assert_allclose(R[:2, 0], (0.8, 0.6), rtol=0, atol=1e-5)
    (warning,) = model.warnings
    assert "made orthonormal" in warning


def test_angles_look_like_degrees(tmp_path: Path) -> None:
    (warning,) = read(tmp_path, deck(("pos_z", 'psi="90" pos_z'))).warnings
    assert 'psi="90": more than a full turn; angles are in radians' in warning


GRAPHICS = f"""
<Post_Graphic id="1" type="BoxDefinedFromCorner" corner_marker_id="20" length_x="1" length_y="2"
 length_z="4" color="255:0:0"/>
<Post_Graphic id="2" type="BoxDefinedFromCenter" center_marker_id="20" length_x="1" length_y="2"
 length_z="4"/>
<Post_Graphic id="3" type="Cylinder" center_marker_id="20" radius="1" length="3" ends_type="OPEN"/>
<Post_Graphic id="4" type="Ellipsoid" center_marker_id="20" x_scale="1" y_scale="2" z_scale="3"/>
<Post_Graphic id="5" type="Plane" center_marker_id="10" xmin="-1" xmax="1"/>
<Post_Graphic id="6" type="TriaMesh" rm_id="20">{TETRAHEDRON}</Post_Graphic>
<Post_Graphic id="7" type="Parasolid" center_marker_id="20" top_radius="1"/>
<Post_Graphic id="8" type="Frustum" center_marker_id="20" bottom_radius="2" top_radius="0"
 length="5"/>
"""


def test_graphics(tmp_path: Path) -> None:
    model = read(tmp_path, added(GRAPHICS))
    shapes = {id: (g.shape, g.size, g.offset) for id, g in model.graphics.items()}
    zero = (0.0, 0.0, 0.0)
    assert shapes[1] == ("BOX", (1.0, 2.0, 4.0), (0.5, 1.0, 2.0))
    assert shapes[2] == ("BOX", (1.0, 2.0, 4.0), zero)
    assert shapes[3] == ("CYLINDER", (1.0, 3.0), (0.0, 0.0, 1.5))
    assert shapes[4] == ("ELLIPSOID", (1.0, 2.0, 3.0), zero)
    assert shapes[5] == ("PLANE", (), zero)
    assert shapes[6] == ("MESH", (), zero)
    assert 7 not in shapes
    assert shapes[8] == ("FRUSTUM", (2.0, 0.0, 5.0), (0.0, 0.0, 2.5))
    mesh = model.graphics[6]
    assert mesh.vertices is not None
    assert mesh.faces is not None
    assert (mesh.vertices.shape, mesh.faces.shape) == ((4, 3), (4, 3))
    text = "\n".join(model.notes)
    for word in ("ends_type", "xmin", "Parasolid"):
        assert word in text
    assert model.graphics[1].color == (255, 0, 0)
    assert model.graphics[2].color is None


@pytest.mark.parametrize("kind", ["stl", "stl_ascii", "obj", "off", "ply"])
def test_mesh_files(tmp_path: Path, kind: str) -> None:
    import trimesh

    suffix = kind.partition("_")[0]
    cube = trimesh.creation.box((1.0, 2.0, 3.0))
    cube.export(tmp_path / f"part.{suffix}", file_type=kind)
    text = added(f'<Post_Graphic id="6" type="TriaMesh" rm_id="20" file="part.{suffix}"/>')
    mesh = read(tmp_path, text).graphics[6]
    assert mesh.vertices is not None
    assert mesh.faces is not None
    assert (mesh.vertices.shape, mesh.faces.shape) == ((8, 3), (12, 3))
    np.testing.assert_array_equal(mesh.vertices.max(axis=0), (0.5, 1.0, 1.5))


@pytest.mark.parametrize("suffix", ["stl", "obj", "off", "ply"])
@pytest.mark.parametrize("data", [b"", b"solid x\nfacet", b"\x00" * 90, b"\xff\xfe rubbish 1 2 3"])
def test_damaged_mesh_files(tmp_path: Path, suffix: str, data: bytes) -> None:
    (tmp_path / f"part.{suffix}").write_bytes(data)
    text = added(f'<Post_Graphic id="6" type="TriaMesh" rm_id="20" file="part.{suffix}"/>')
    with pytest.raises(ModelError, match=r"Post_Graphic\[6\]: file=") as caught:
        read(tmp_path, text)
    assert "\n" not in str(caught.value)


def test_commands_in_sequence(tmp_path: Path) -> None:
    text = added(
        '<Param_Transient h_max="0.1"/><Force_Gravity grav_x="1"/>\n'
        '<Simulate analysis_type="TRANSIENT" duration="2" num_step="4"/><Stop/>',
        "Command",
    )
    first, second = read(tmp_path, text).simulations
    assert first.gravity is None
    assert first.transient is not None
    assert first.transient.h_max is None
    assert (second.start_time, second.end_time, second.print_interval) == (3.0, 5.0, 0.5)
    assert second.gravity is not None
    assert second.gravity.g == (1.0, 0.0, -9.81)
    assert second.transient is not None
    assert (second.transient.integr_tol, second.transient.h_max) == (1e-3, 0.1)


def test_notes_name_what_has_no_effect_once(tmp_path: Path) -> None:
    text = deck(
        ("</Model>", '<ResOutput mrf_file="TRUE" dzero="1e-9"/></Model>'),
        ('type="Sphere"', 'type="Sphere" color="1:2:3" hidden="FALSE" refinement_level="2"'),
        ('type="Plane"', 'type="Plane" refinement_level="2"'),
        ("<Param_Transient", '<Param_Transient dae_index="3" max_order="5"'),
        ('id="301"', 'id="301" enable_node_mode="FALSE"'),
        ("</Command>", '<H3DOutput switch_on="TRUE"/><Stop/></Command>'),
    )
    notes = read(tmp_path, text).notes
    assert len(notes) == 6
    for words in ("ResOutput", "refinement_level", "dae_index", "max_order", "H3D", "Stop"):
        assert sum(words in note for note in notes) == 1
    assert any(":7 and 1 more: Post_Graphic refinement_level" in note for note in notes)


@pytest.mark.parametrize(
    "attribute",
    [
        *(f'enable_node_mode="{value}"' for value in ("FALSE", "AUTO", "auto")),
        *(f'enable_analytical="{value}"' for value in ("TRUE", "AUTO", "true")),
        'master_surface="AUTO"',
    ],
)
def test_attributes_that_ask_for_what_is_done_anyway(tmp_path: Path, attribute: str) -> None:
    plain = read(tmp_path, deck()).notes
    assert read(tmp_path, deck(('id="301"', f'id="301" {attribute}'))).notes == plain


def test_requests(tmp_path: Path) -> None:
    text = added(
        '<Post_Request id="1" type="Displacement" i_marker_id="20" comment="c"/>'
        '<Post_Request id="2" type="MARKER_VELOCITY" i_marker_id="20" j_marker_id="10"/>'
        '<Post_Request id="3" type="ACCELERATION" i_marker_id="20" ref_marker_id="20"/>'
    )
    requests = read(tmp_path, text).requests
    types = [request.type for request in requests.values()]
    assert types == ["MARKER_DISPLACEMENT", "MARKER_VELOCITY", "MARKER_ACCELERATION"]
    assert (requests[2].j_marker_id, requests[3].ref_marker_id) == (10, 20)
    assert requests[1].j_marker_id is None


def test_compatibility(tmp_path: Path) -> None:
    text = deck(("<Model>", '<Model compatibility="MotionSolve">'))
    assert read(tmp_path, text).compatibility == "MOTIONSOLVE"
    assert read(tmp_path, MINIMAL).compatibility == ""


@pytest.mark.parametrize(
    "override",
    [
        "Force_Contact[301].mu_static=0.25",
        "forcecontact[301].MuStatic = 0.25",
        " FORCE_CONTACT [ 301 ] . mu_static=0.25 ",
    ],
)
def test_override(tmp_path: Path, override: str) -> None:
    assert read(tmp_path, MINIMAL, (override,)).contacts[301].mu_static == 0.25


def test_override_adds_an_attribute_and_finds_by_place(tmp_path: Path) -> None:
    text = added('<Simulate end_time="4" num_steps="2"/>', "Command")
    overrides = ("Simulate[2].end_time=5", "Body_Rigid[2].w_ic_x=7", "bodyrigid[2].WIcXFlag=true")
    model = read(tmp_path, text, (*overrides, "Force_Gravity.grav_y=2", "Force_Gravity.grav_z=0"))
    assert model.simulations[1].end_time == 5.0
    assert model.bodies[2].w_ic == (7.0, 0.0, 0.0)
    assert model.gravity.g == (0.0, 2.0, 0.0)


def test_import_is_light() -> None:
    code = (
        "import sys, mbsim.reader.xml; "
        "heavy = {'numba', 'fcl', 'trimesh', 'scipy', 'matplotlib', 'h5py'} & set(sys.modules); "
        "assert not heavy, heavy"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


# everything between quotes that a mutation may replace
VALUES = [match.span(1) for match in re.finditer('="([^"]*)"', MINIMAL)]
RAW_VALUES = st.one_of(
    st.floats().map(repr),
    st.integers().map(str),
    st.sampled_from(
        "TRUE FALSE Sphere Plane TriaMesh Cylinder 1 2 10 20 100 200 301 0 -1 1e39 1e-300 "
        "IMPACT VOLUME USERCFF COULOMB_OFF MILLIMETER DAY 1, USER() 1e999 0x10 1_0".split()
    ),
    st.text(st.characters(blacklist_categories=("Cs",), blacklist_characters='<&"'), max_size=12),
)


@settings(
    max_examples=400,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(st.lists(st.tuples(st.integers(0, len(VALUES) - 1), RAW_VALUES), min_size=1, max_size=4))
def test_mutated_values_give_a_model_or_a_model_error(
    tmp_path: Path, mutations: list[tuple[int, str]]
) -> None:
    text = MINIMAL
    for index, value in sorted(dict(mutations).items(), reverse=True):
        start, end = VALUES[index]
        text = text[:start] + value + text[end:]
    try:
        model = read(tmp_path, text)
    except ModelError as error:
        assert str(error)
        return
    assert isinstance(model, Model)
    placement = place(model)
    assert math.isfinite(placement.L)
    assert placement.L > 0.0


@settings(max_examples=200, deadline=None)
@given(st.binary(max_size=300), st.integers(0, len(MINIMAL)))
def test_damaged_bytes_give_a_model_error(data: bytes, place_of_damage: int) -> None:
    from mbsim.reader.parse import parse

    damaged = MINIMAL.encode()[:place_of_damage] + data + MINIMAL.encode()[place_of_damage + 9 :]
    try:
        parse(damaged, "deck.xml")
    except ModelError as error:
        assert str(error)


TRANSIENT = '<Simulate analysis_type="Transient" end_time="1" print_interval="0.1"/>'


@pytest.mark.parametrize(
    ("model", "command", "asked", "tol", "said"),
    [
        ("", "", None, 1e-5, "1e-05, the default"),
        ("", "", 1e-7, 1e-7, "1e-07, as the command line says"),
        ("1e-3", "", None, 1e-5, "1e-05, 0.01 of integr_tol 0.001 in <Model> ("),
        ("1e-3", "1e-6", None, 1e-8, "1e-08, 0.01 of integr_tol 1e-06 in <Command> ("),
        ("1e-3", "1e-6", 1e-4, 1e-4, "0.0001, as the command line says"),
    ],
)
def test_tol_and_who_says_it(
    tmp_path: Path, model: str, command: str, asked: float | None, tol: float, said: str
) -> None:
    """MotionSolve's integr_tol is a hundred tol; the command line's is tol itself."""
    parts = [f'<Param_Transient integr_tol="{text}"/>' if text else "" for text in (model, command)]
    ground = '<Body_Rigid id="1" isground="TRUE"/>'
    path = tmp_path / "deck.xml"
    path.write_text(
        f"<Deck><Model>{ground}{parts[0]}</Model>\n<Command>{parts[1]}{TRANSIENT}</Command></Deck>",
        encoding="utf-8",
    )
    settings = settle(mbsim.read_model(path), tol=asked)
    assert settings.tol == pytest.approx(tol, rel=1e-15)
    assert settings.tolerances.startswith(said)
    assert f"tol {settings.tolerances}" in settings.notes
    if said.endswith("("):
        assert settings.tolerances.endswith(f"{path}:{2 if command else 1})")


def test_each_simulate_says_its_tol(tmp_path: Path) -> None:
    second = TRANSIENT.replace('end_time="1"', 'end_time="2"')
    path = tmp_path / "deck.xml"
    path.write_text(
        '<Deck><Model><Body_Rigid id="1" isground="TRUE"/></Model><Command>'
        f'{TRANSIENT}<Param_Transient integr_tol="1e-4"/>{second}</Command></Deck>',
        encoding="utf-8",
    )
    said = settle(mbsim.read_model(path)).tolerances
    assert said.startswith("1e-05, the default; from time 1 on 1e-06, 0.01 of integr_tol 0.0001 in")

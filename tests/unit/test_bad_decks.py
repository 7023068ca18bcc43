"""Broken decks: every fault names line, element, attribute and value, and what is allowed."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from helpers.minimal_deck import (
    BODY_LINE,
    CONTACT_LINE,
    FRICTION_LINE,
    GRAVITY_LINE,
    MARKER_LINE,
    MINIMAL,
    PLANE_LINE,
    SIMULATE_LINE,
    SPHERE_LINE,
    TRANSIENT_LINE,
    added,
    deck,
    read,
)
from mbsim.errors import DeckError, ModelError

END_OF_MODEL, END_OF_COMMAND = 14, 18  # lines of statements that `added` puts in

MESH = '<Post_Graphic id="400" type="TriaMesh" rm_id="20">{}</Post_Graphic>'
OPEN_MESH = MESH.format("<Nodes>0 0 0 1 0 0 0 1 0 0 0 1</Nodes><Faces>0 2 1 0 1 3 0 3 2</Faces>")
TURNED_MESH = MESH.format(
    "<Nodes>0 0 0 1 0 0 0 1 0 0 0 1</Nodes><Faces>0 1 2 0 3 1 0 2 3 1 3 2</Faces>"
)
MIXED_MESH = MESH.format(
    "<Nodes>0 0 0 1 0 0 0 1 0 0 0 1</Nodes><Faces>0 2 1 0 1 3 0 3 2 1 3 2</Faces>"
)

INERTIA = 'inertia_xx="0.02" inertia_yy="0.02" inertia_zz="0.02"'
IMPACT = 'cnf_type="Impact" stiffness="1e8" exponent="1.5" damping="200" dmax="1e-4"'


def marker(attributes: str) -> str:
    """Return the minimal deck with attributes added to marker 20."""
    return deck(('body_id="2" pos_z', f'body_id="2" {attributes} pos_z'))


def law(attributes: str) -> str:
    """Return the minimal deck with another normal law."""
    return deck((IMPACT, attributes))


def in_contact(mesh: str) -> str:
    """Return a deck whose contact has this mesh, id 400, in place of the sphere."""
    return deck(
        ("<Force_Gravity", f"{mesh}\n<Force_Gravity"),
        ('i_graphics_id="200"', 'i_graphics_id="400"'),
    )


# name: (deck, line of the fault, words that its message must hold)
BROKEN: dict[str, tuple[str, int, tuple[str, ...]]] = {
    # XML
    "mismatched tag": (deck(("</Model>", "</Modle>")), 14, ("not well-formed", "Modle")),
    "unclosed tag": (deck(("<Command>", "<Command")), 16, ("not well-formed",)),
    "empty file": ("", 1, ("not well-formed", "empty")),
    "plain text": ("ADAMS/View model\n", 1, ("not well-formed",)),
    "repeated attribute": (deck(('mass="5"', 'mass="5" mass="6"')), 4, ("mass", "redefined")),
    "undefined entity": (deck(('mass="5"', 'mass="&five;"')), 4, ("five", "not defined")),
    "too deep": ("<a>" * 60 + "</a>" * 60, 1, ("nested", "32")),
    "text between statements": (deck(("</Model>", "oops</Model>")), 1, ("Model", "'oops'")),
    "no model": ("<Deck><Command/></Deck>", 1, ("no <Model>",)),
    "statement outside": (deck(("<Deck>", "<Deck><Body_Rigid/>")), 1, ("Body_Rigid", "outside")),
    # identifiers and references
    "missing id": (
        deck(('Marker id="20"', "Marker")),
        MARKER_LINE,
        ("Reference_Marker: id: missing", "positive integer"),
    ),
    "id not an integer": (
        deck(('Body_Rigid id="2"', 'Body_Rigid id="two"')),
        BODY_LINE,
        ("Body_Rigid[two]", 'id="two"', "positive integer"),
    ),
    "id zero": (deck(('Rigid id="2"', 'Rigid id="0"')), BODY_LINE, ('id="0"', "positive integer")),
    "id too large": (deck(('Rigid id="2"', 'Rigid id="9999999999"')), BODY_LINE, ("9999999999",)),
    "duplicate marker": (
        added('<Reference_Marker id="20" body_id="1"/>'),
        END_OF_MODEL,
        ("Reference_Marker[20]", 'id="20"', "already used on line 6"),
    ),
    "dangling body": (
        deck(('body_id="2"', 'body_id="7"')),
        MARKER_LINE,
        ("Reference_Marker[20]", 'body_id="7"', "no Body_Rigid", "1, 2"),
    ),
    "dangling cg": (
        deck(('cg_id="20"', 'cg_id="21"')),
        BODY_LINE,
        ("Body_Rigid[2]", 'cg_id="21"', "no Reference_Marker", "10, 20"),
    ),
    "dangling graphic": (
        deck(('i_graphics_id="200"', 'i_graphics_id="201"')),
        CONTACT_LINE,
        ("Force_Contact[301]", 'i_graphics_id="201"', "100, 200"),
    ),
    "dangling graphic marker": (
        deck(('center_marker_id="20"', 'center_marker_id="22"')),
        SPHERE_LINE,
        ("Post_Graphic[200]", 'center_marker_id="22"', "no Reference_Marker"),
    ),
    "dangling request marker": (
        added('<Post_Request id="1" type="DISPLACEMENT" i_marker_id="99"/>'),
        END_OF_MODEL,
        ("Post_Request[1]", 'i_marker_id="99"'),
    ),
    "cg on another body": (
        deck(('cg_id="20"', 'cg_id="10"')),
        BODY_LINE,
        ("Body_Rigid[2]", 'cg_id="10"', "body 1"),
    ),
    "marker refers to itself": (
        marker('rm_id="20"'),
        MARKER_LINE,
        ("Reference_Marker[20]", "20 -> 20"),
    ),
    "ring of markers": (
        deck(
            ('"10" body_id="1"', '"10" body_id="1" rm_id="20"'),
            ('"20" body_id="2"', '"20" body_id="2" rm_id="10"'),
        ),
        5,
        ("Reference_Marker[10]", "10 -> 20 -> 10"),
    ),
    "graphic without marker": (
        deck((' rm_id="10"', "")),
        PLANE_LINE,
        ("Post_Graphic[100]", "rm_id", "missing"),
    ),
    # values
    "mass is a word": (
        deck(('mass="5"', 'mass="heavy"')),
        BODY_LINE,
        ("Body_Rigid[2]", 'mass="heavy"', "number > 0"),
    ),
    "mass with a unit": (deck(('mass="5"', 'mass="5 kg"')), BODY_LINE, ('mass="5 kg"',)),
    "Fortran exponent": (deck(('mass="5"', 'mass="5.0D0"')), BODY_LINE, ('mass="5.0D0"',)),
    "mass zero": (deck(('mass="5"', 'mass="0"')), BODY_LINE, ('mass="0"', "number > 0")),
    "mass negative": (deck(('mass="5"', 'mass="-5"')), BODY_LINE, ('mass="-5"', "number > 0")),
    "mass nan": (deck(('mass="5"', 'mass="nan"')), BODY_LINE, ('mass="nan"',)),
    "mass inf": (deck(('mass="5"', 'mass="inf"')), BODY_LINE, ('mass="inf"',)),
    "mass overflows": (deck(('mass="5"', 'mass="1e999"')), BODY_LINE, ('mass="1e999"', "limit")),
    "mass missing": (deck((' mass="5"', "")), BODY_LINE, ("Body_Rigid[2]", "mass: missing")),
    "cg missing": (deck((' cg_id="20"', "")), BODY_LINE, ("Body_Rigid[2]", "cg_id: missing")),
    "flag is a number": (
        deck(('isground="TRUE"', 'isground="1"')),
        3,
        ("Body_Rigid[1]", 'isground="1"', "TRUE or FALSE"),
    ),
    "radius negative": (
        deck(('radius="0.108"', 'radius="-1"')),
        SPHERE_LINE,
        ("Post_Graphic[200]", 'radius="-1"', "number > 0"),
    ),
    "radius missing": (deck((' radius="0.108"', "")), SPHERE_LINE, ("radius: missing",)),
    "unknown unit": (
        deck(('"METER"', '"METRES"')),
        2,
        ("Param_Unit", 'length_unit="METRES"', "MILLIMETER", "did you mean METER"),
    ),
    "units twice": (added("<Param_Unit/>"), END_OF_MODEL, ("Param_Unit", "second")),
    "units and factor": (
        deck(('time_unit="SECOND"', 'time_unit="SECOND" mass_mult_factor="1"')),
        2,
        ('mass_mult_factor="1"', "not both"),
    ),
    # inertia and orientation
    "inertia incomplete": (
        deck((' inertia_zz="0.02"', "")),
        BODY_LINE,
        ("Body_Rigid[2]", "inertia_zz: missing"),
    ),
    "inertia negative": (
        deck((INERTIA, 'inertia_xx="-1" inertia_yy="1" inertia_zz="1"')),
        BODY_LINE,
        ("Body_Rigid[2]", "inertia_xx=-1", "must be > 0"),
    ),
    "inertia zero": (
        deck((INERTIA, 'inertia_xx="0" inertia_yy="0" inertia_zz="0"')),
        BODY_LINE,
        ("inertia_xx=0", "must be > 0"),
    ),
    "inertia not positive by products": (
        deck((INERTIA, INERTIA + ' inertia_xy="0.03"')),
        BODY_LINE,
        ("inertia_xy=0.03", "must be > 0"),
    ),
    "triangle inequality": (
        deck((INERTIA, 'inertia_xx="1" inertia_yy="1" inertia_zz="2.1"')),
        BODY_LINE,
        ("Body_Rigid[2]", "inertia_zz=2.1", "sum of the others"),
    ),
    "cosines not orthonormal": (
        marker('a00="1" a10="0.1"'),
        MARKER_LINE,
        ("Reference_Marker[20]", "a10=0.1", "0.0001"),
    ),
    "cosines left-handed": (marker('a22="-1"'), MARKER_LINE, ("a22=-1", "left-handed")),
    "cosines and angles": (
        marker('a00="1" psi="0.5"'),
        MARKER_LINE,
        ("Reference_Marker[20]", "a00 and psi", "not both"),
    ),
    # unknown names
    "unknown statement": (
        added('<Body_Rigit id="3"/>'),
        END_OF_MODEL,
        ("Body_Rigit[3]", "unknown statement", "did you mean Body_Rigid"),
    ),
    "unknown attribute": (
        deck(('cg_id="20"', 'cm_id="20"')),
        BODY_LINE,
        ("Body_Rigid[2]", 'cm_id="20"', "unknown attribute", "did you mean cg_id?"),
    ),
    "beginning of an attribute": (
        deck(('mu_static="0.3"', 'mu="0.3"')),
        FRICTION_LINE,
        ("Force_Contact[301]", 'mu="0.3"', "unknown attribute", "did you mean mu_static?"),
    ),
    "attribute of another element": (
        deck(('i_graphics_id="200"', 'i_body_id="2"')),
        FRICTION_LINE - 2,
        ("Force_Contact[301]", 'i_body_id="2"', "unknown", "did you mean i_graphics_id?"),
    ),
    "angle in degrees": (
        marker('psi="25D"'),
        MARKER_LINE,
        (
            'psi="25D"',
            "must be a number; angles are in radians, 25 degrees are 0.436332313: D is for",
        ),
    ),
    "attribute in two spellings": (
        deck(('mass="5"', 'mass="5" MASS="6"')),
        BODY_LINE,
        ("Body_Rigid[2]", "given twice", "MASS"),
    ),
    "attribute of another shape": (
        deck(('radius="0.108"', 'radius="0.108" length="2"')),
        SPHERE_LINE,
        ("Post_Graphic[200]", 'length="2"', "Sphere"),
    ),
    "unknown graphic type": (
        deck(('type="Sphere"', 'type="Spere"')),
        SPHERE_LINE,
        ('type="Spere"', "did you mean Sphere"),
    ),
    "unknown child": (
        deck(('mass="5"', 'mass="5"'), ('pos_z="0.108"/>', "><Pos/></Reference_Marker>")),
        MARKER_LINE,
        ("Reference_Marker[20]", "unknown element <Pos>"),
    ),
    "unknown normal law": (
        deck(('cnf_type="Impact"', 'cnf_type="Impakt"')),
        CONTACT_LINE + 1,
        ("Force_Contact[301]", 'cnf_type="Impakt"', "IMPACT"),
    ),
    "unknown friction law": (
        deck(('"COULOMB_ON"', '"COULOMB_YES"')),
        FRICTION_LINE,
        ("Force_Contact[301]", 'cff_type="COULOMB_YES"', "COULOMB_DYNAMICONLY"),
    ),
    "unknown compatibility": (
        deck(("<Model>", '<Model compatibility="ADAMS">')),
        1,
        ('compatibility="ADAMS"', "MOTIONSOLVE"),
    ),
    # documented, not built
    "gear": (
        added('<Constraint_PTdCV id="1"/>'),
        END_OF_MODEL,
        ("Constraint_PTdCV[1]", "not built yet"),
    ),
    "spring": (added('<Force_SpringDamper id="1"/>'), END_OF_MODEL, ("Force_SpringDamper[1]",)),
    "sensor": (
        added('<Sensor_Proximity id="4"/>'),
        END_OF_MODEL,
        ("Sensor_Proximity", "not built yet"),
    ),
    "save": (added('<Save model_file="a.xml"/>', "Command"), END_OF_COMMAND, ("Save", "--resume")),
    "load model": (
        added('<Load_Model file="b.xml"/>'),
        END_OF_MODEL,
        ("Load_Model is not taken: a run is one deck",),
    ),
    "load command": (
        added('<Load_Command file="b.xml"/>', "Command"),
        END_OF_COMMAND,
        ("Load_Command is not taken", "<Command>"),
    ),
    "VOLUME without a layer": (
        law('cnf_type="VOLUME" i_elastic_modulus="1e5" i_poisson_ratio="0.3"'),
        CONTACT_LINE,
        ("Force_Contact[301]", "i_layer_depth: missing", "beside i_elastic_modulus"),
    ),
    "VOLUME without elastic sides": (
        law('cnf_type="VOLUME" i_layer_depth="1"'),
        CONTACT_LINE,
        ("Force_Contact[301]", "i_elastic_modulus: missing", "the other is rigid"),
    ),
    "VOLUME that cannot yield": (
        law('cnf_type="VOLUME" i_elastic_modulus="1e5" i_poisson_ratio="0.5" i_layer_depth="1"'),
        CONTACT_LINE + 1,
        ('i_poisson_ratio="0.5"', "must be < 0.5 with VOLUME"),
    ),
    "VOLUME by the largest depth": (
        law(
            'cnf_type="VOLUME" i_elastic_modulus="1e5" i_poisson_ratio="0.3" i_layer_depth="1" '
            'contact_depth="LARGEST"'
        ),
        CONTACT_LINE + 1,
        ('contact_depth="LARGEST"', "presses by the field of depth"),
    ),
    "incidents": (
        deck(('cff_type="C', 'contact_points="PATCH" cff_type="C')),
        FRICTION_LINE,
        ('contact_points="PATCH"', "must be one of POINTS, REGION"),
    ),
    "node mode": (
        deck(('id="301"', 'id="301" enable_node_mode="TRUE"')),
        CONTACT_LINE,
        ('enable_node_mode="TRUE"', "TRUE is not built yet: surfaces touch", "FALSE, AUTO"),
    ),
    "tessellated shapes": (
        deck(('id="301"', 'id="301" enable_analytical="false"')),
        CONTACT_LINE,
        ('enable_analytical="false"', "FALSE is not built yet: shapes are not tess", "TRUE, AUTO"),
    ),
    "master surface": (
        deck(('id="301"', 'id="301" master_surface="I_and_J"')),
        CONTACT_LINE,
        ('master_surface="I_and_J"', "I_AND_J is not built yet: no side is the master", "AUTO"),
    ),
    "flexible side": (
        deck(('id="301"', 'id="301" i_flexbody_id="5"')),
        CONTACT_LINE,
        ("Force_Contact[301]", 'i_flexbody_id="5"', "not built yet"),
    ),
    "MATLAB": (
        deck(('cff_type="COULOMB_ON"', 'cff_type="USERCFF" interpreter="COMPOSE"')),
        FRICTION_LINE,
        ('interpreter="COMPOSE"', "PYTHON, MATLAB, OCTAVE"),
    ),
    "shared library": (
        deck(('cff_type="COULOMB_ON"', 'cff_type="USERCFF" cff_dll_name="friction.so"')),
        FRICTION_LINE,
        ('cff_dll_name="friction.so"', "no such file", "relative to the deck"),
    ),
    "gravity expression": (
        deck(('grav_z="-9.81"', 'grav_z="-9.81*DZ(20)"')),
        GRAVITY_LINE,
        ("Force_Gravity", 'grav_z="-9.81*DZ(20)"', "uses DZ", "an expression of TIME"),
    ),
    "frequency analysis": (
        deck(('"Transient"', '"Frequency Response"')),
        SIMULATE_LINE,
        ("Simulate", 'analysis_type="Frequency Response"', "TRANSIENT"),
    ),
    "print_increment": (
        deck(('print_interval="0.01"', 'print_increment="5"')),
        SIMULATE_LINE,
        ('print_increment="5"', "not built yet"),
    ),
    "request of a user": (
        added('<Post_Request id="1" type="USERSUB"/>'),
        END_OF_MODEL,
        ("Post_Request[1]", "usrsub_param_string: missing"),
    ),
    "picture in contact": (
        deck(('type="Sphere" center_marker_id="20" radius="0.108"', 'type="Parasolid"')),
        CONTACT_LINE,
        ("Force_Contact[301]", 'i_graphics_id="200"', "Parasolid", "not built"),
    ),
    "frustum without bottom": (
        deck(
            (
                'type="Sphere" center_marker_id="20" radius="0.108"',
                'type="Frustum" center_marker_id="20" top_radius="1" length="1"',
            )
        ),
        SPHERE_LINE,
        ("Post_Graphic[200]", "bottom_radius: missing", ">= 0"),
    ),
    "frustum without radii": (
        deck(
            (
                'type="Sphere" center_marker_id="20" radius="0.108"',
                'type="Frustum" center_marker_id="20" bottom_radius="0" top_radius="0" length="1"',
            )
        ),
        SPHERE_LINE,
        ("Post_Graphic[200]", 'top_radius="0', "line has no volume"),
    ),
    "cavity in contact": (
        deck(('radius="0.108"', 'radius="0.108" is_material_inside="FALSE"')),
        SPHERE_LINE,
        ("Post_Graphic[200]", 'is_material_inside="FALSE"', "not built yet"),
    ),
    # contacts
    "I and J on one body": (
        deck(('rm_id="10"', 'rm_id="20"')),
        CONTACT_LINE,
        ("Force_Contact[301]", "both on body 2"),
    ),
    "a body on both sides": (
        deck(('num_i_graphics="1" i_graphics_id="200"', 'i_graphics_id="200, 100"')),
        CONTACT_LINE,
        ("Force_Contact[301]", "i_graphics_id", "both on body 1"),
    ),
    "count of graphics": (
        deck(('num_i_graphics="1"', 'num_i_graphics="2"')),
        CONTACT_LINE,
        ('num_i_graphics="2"', "names 1"),
    ),
    "a graphic twice": (
        deck(('i_graphics_id="200"', 'i_graphics_id="200 200"')),
        CONTACT_LINE,
        ('i_graphics_id="200 200"', "twice"),
    ),
    "cnf_type missing": (deck(('cnf_type="Impact" ', "")), CONTACT_LINE, ("cnf_type: missing",)),
    "damping without dmax": (
        deck((' dmax="1e-4"', "")),
        CONTACT_LINE,
        ("Force_Contact[301]", "dmax: missing", "damping > 0"),
    ),
    "restitution above 1": (
        law('cnf_type="POISSON" penalty="1e5" restitution_coef="1.1"'),
        CONTACT_LINE + 1,
        ("Force_Contact[301]", 'restitution_coef="1.1"', "from 0 to 1"),
    ),
    "normal_trans_vel zero": (
        law('cnf_type="POISSON" penalty="1e5" normal_trans_vel="0"'),
        CONTACT_LINE + 1,
        ("Force_Contact[301]", 'normal_trans_vel="0"', "number > 0"),
    ),
    "penalty negative": (
        law('cnf_type="POISSON" penalty="-1"'),
        CONTACT_LINE + 1,
        ("Force_Contact[301]", 'penalty="-1"', ">= 0"),
    ),
    "damping and restitution": (
        law(
            'cnf_type="HUNT_CROSSLEY" stiffness="1e8" damping="1" restitution_coef="0.5"'
            ' ref_velocity="1"'
        ),
        CONTACT_LINE + 1,
        ("Force_Contact[301]", 'restitution_coef="0.5"', "damping or restitution_coef, not both"),
    ),
    "restitution 0": (
        law('cnf_type="HUNT_CROSSLEY" stiffness="1" restitution_coef="0" ref_velocity="1"'),
        CONTACT_LINE + 1,
        ("Force_Contact[301]", 'restitution_coef="0"', "> 0 and <= 1"),
    ),
    "restitution without speed": (
        law('cnf_type="HERTZ" stiffness="1e8" restitution_coef="0.5"'),
        CONTACT_LINE,
        ("Force_Contact[301]", "ref_velocity: missing", "number > 0"),
    ),
    "ref_velocity negative": (
        law('cnf_type="HERTZ" stiffness="1e8" restitution_coef="0.5" ref_velocity="-1"'),
        CONTACT_LINE + 1,
        ("Force_Contact[301]", 'ref_velocity="-1"', "number > 0"),
    ),
    "HERTZ without stiffness": (
        law('cnf_type="HERTZ"'),
        CONTACT_LINE,
        ("Force_Contact[301]", "stiffness: missing", "i_elastic_modulus"),
    ),
    "HERTZ by both": (
        law('cnf_type="HERTZ" stiffness="1e8" i_elastic_modulus="7e10" i_poisson_ratio="0.3"'),
        CONTACT_LINE + 1,
        ("Force_Contact[301]", 'stiffness="1e8"', "not both"),
    ),
    "HERTZ without Poisson's ratio": (
        law('cnf_type="HERTZ" i_elastic_modulus="7e10"'),
        CONTACT_LINE,
        ("Force_Contact[301]", "i_poisson_ratio: missing", "-1", "0.5"),
    ),
    "Poisson's ratio": (
        law('cnf_type="HERTZ" i_elastic_modulus="7e10" i_poisson_ratio="0.6"'),
        CONTACT_LINE + 1,
        ("Force_Contact[301]", 'i_poisson_ratio="0.6"', "<= 0.5"),
    ),
    "modulus zero": (
        law('cnf_type="HERTZ" i_elastic_modulus="0" i_poisson_ratio="0.3"'),
        CONTACT_LINE + 1,
        ("Force_Contact[301]", 'i_elastic_modulus="0"', "number > 0"),
    ),
    "HERTZ of a shape without a radius": (
        deck(
            (IMPACT, 'cnf_type="HERTZ" i_elastic_modulus="7e10" i_poisson_ratio="0.3"'),
            (
                'type="Sphere" center_marker_id="20" radius="0.108"',
                'type="Cylinder" center_marker_id="20" radius="0.1" length="0.1"',
            ),
        ),
        CONTACT_LINE,
        ("Force_Contact[301]", "i_radius: missing", "number > 0"),
    ),
    "HERTZ of two flat sides": (
        deck(
            (IMPACT, 'cnf_type="HERTZ" i_elastic_modulus="7e10" i_poisson_ratio="0.3"'),
            (
                'type="Sphere" center_marker_id="20" radius="0.108"',
                'type="BoxDefinedFromCenter" center_marker_id="20" length_x="0.1" length_y="0.1"'
                ' length_z="0.1"',
            ),
        ),
        CONTACT_LINE,
        ("Force_Contact[301]", "both sides are flat", "i_radius"),
    ),
    "dmax zero": (deck(('dmax="1e-4"', 'dmax="0."')), CONTACT_LINE + 1, ('dmax="0."', "> 0")),
    "vd below vs": (
        deck(('friction_trans_vel="0.02"', 'friction_trans_vel="0.005"')),
        FRICTION_LINE + 1,
        ("Force_Contact[301]", "friction_trans_vel", "0.005", "stiction_trans_vel (0.01)"),
    ),
    "transition velocity zero": (
        deck(('stiction_trans_vel="0.01"', 'stiction_trans_vel="0"')),
        FRICTION_LINE,
        ('stiction_trans_vel="0"', "number > 0"),
    ),
    "mu negative": (
        deck(('mu_static="0.3"', 'mu_static="-0.3"')),
        FRICTION_LINE,
        ('mu_static="-0.3"', ">= 0"),
    ),
    "USER string": (
        deck(('cff_type="COULOMB_ON"', 'cff_type="USERCFF" cff_param_string="0.1,0.2"')),
        FRICTION_LINE,
        ('cff_param_string="0.1,0.2"', "USER(number"),
    ),
    "USER value": (
        deck(('cff_type="COULOMB_ON"', 'cff_type="USERCFF" cff_param_string="USER(1,x)"')),
        FRICTION_LINE,
        ("USER(1,x)", "'x'"),
    ),
    "script not there": (
        deck(('cff_type="COULOMB_ON"', 'cff_type="USERCFF" script_name="nowhere.py"')),
        FRICTION_LINE,
        ('script_name="nowhere.py"', "no such file"),
    ),
    # meshes
    "open mesh": (in_contact(OPEN_MESH), 13, ("Post_Graphic[400]", "open", "3 edges")),
    "mesh inside out": (in_contact(TURNED_MESH), 13, ("Post_Graphic[400]", "inside out")),
    "mesh winding": (in_contact(MIXED_MESH), 13, ("Post_Graphic[400]", "winding")),
    "mesh index": (
        added(MESH.format("<Nodes>0 0 0</Nodes><Faces>0 1 2</Faces>")),
        END_OF_MODEL,
        ("Post_Graphic[400]", "<Faces>", "1 is no index of 1 nodes"),
    ),
    "mesh numbers": (
        added(MESH.format("<Nodes>0 0 nan</Nodes><Faces>0 0 0</Faces>")),
        END_OF_MODEL,
        ("Post_Graphic[400]", "<Nodes>", "finite"),
    ),
    "mesh file not there": (
        added('<Post_Graphic id="400" type="TriaMesh" rm_id="20" file="part.stl"/>'),
        END_OF_MODEL,
        ("Post_Graphic[400]", 'file="part.stl"', "no such file"),
    ),
    "mesh format": (
        added('<Post_Graphic id="400" type="TriaMesh" rm_id="20" file="part.step"/>'),
        END_OF_MODEL,
        ('file="part.step"', "stl, obj, off, ply"),
    ),
    "mesh without anything": (added(MESH.format("")), END_OF_MODEL, ("400", "one is needed")),
    # commands
    "end before start": (
        deck(('end_time="3"', 'start_time="4" end_time="3"')),
        SIMULATE_LINE,
        ("Simulate", 'end_time="3"', "larger than the start, 4"),
    ),
    "no end": (deck((' end_time="3"', "")), SIMULATE_LINE, ("end_time or duration", "missing")),
    "two outputs": (
        deck(('end_time="3"', 'end_time="3" num_steps="5"')),
        SIMULATE_LINE,
        ("exactly one", "num_steps, print_interval"),
    ),
    "no output": (deck((' print_interval="0.01"', "")), SIMULATE_LINE, ("exactly one", "none")),
    "too many rows": (
        deck(('interval="0.01"', 'interval="1e-30"')),
        SIMULATE_LINE,
        ('"1e-30"', "output rows"),
    ),
    "second run starts elsewhere": (
        added('<Simulate start_time="1" end_time="4" num_step="3"/>', "Command"),
        END_OF_COMMAND,
        ('start_time="1"', "at 3"),
    ),
    "tolerance": (
        deck(('integr_tol="1e-3"', 'integr_tol="0"')),
        TRANSIENT_LINE,
        ("Param_Transient", 'integr_tol="0"', "> 0"),
    ),
    "h_min above h_max": (
        deck(('integr_tol="1e-3"', 'h_min="1" h_max="0.1"')),
        TRANSIENT_LINE,
        ('h_min="1"', "h_max (0.1)"),
    ),
    "simulate in model": (added('<Simulate end_time="1"/>'), END_OF_MODEL, ("in <Command>",)),
    "body in command": (
        added('<Body_Rigid id="2" mass="3"/>', "Command"),
        END_OF_COMMAND,
        ("Body_Rigid[2]", "<Model>"),
    ),
    "after Stop": (
        added('<Stop/>\n<Simulate end_time="4" num_steps="3"/>', "Command"),
        END_OF_COMMAND + 1,
        ("Simulate", "Stop on line 18"),
    ),
}


@pytest.mark.parametrize("name", BROKEN)
def test_names_the_fault(tmp_path: Path, name: str) -> None:
    text, line, words = BROKEN[name]
    with pytest.raises(DeckError) as caught:
        read(tmp_path, text)
    faults = caught.value.faults
    matching = [fault for fault in faults if all(word in str(fault) for word in words)]
    assert matching, f"{words} in none of:\n{caught.value}"
    assert line in [fault.line for fault in matching], str(caught.value)
    assert str(matching[0]).startswith(f"{tmp_path / 'deck.xml'}:")


@pytest.mark.parametrize("name", sorted(set(BROKEN) - {"statement outside"}))
def test_one_slip_gives_few_faults(tmp_path: Path, name: str) -> None:
    """A single slip must not drown its message in consequences."""
    with pytest.raises(DeckError) as caught:
        read(tmp_path, BROKEN[name][0])
    assert len(caught.value.faults) <= 3, str(caught.value)


LAUGHS = (
    '<?xml version="1.0"?>\n<!DOCTYPE lolz [<!ENTITY lol "lol">'
    + "".join(
        f'<!ENTITY lol{k} "{f"&lol{k - 1 if k > 1 else str()};" * 10}">' for k in range(1, 10)
    )
    + "]>\n<Deck><Model>&lol9;</Model></Deck>"
)


@pytest.mark.parametrize(
    "text",
    [
        LAUGHS,
        '<!DOCTYPE Deck SYSTEM "http://127.0.0.1:9/deck.dtd">\n' + MINIMAL,
        "<!-- a deck -->\n<!DOCTYPE Deck>\n" + MINIMAL,
        '<!DOCTYPE d [<!ENTITY x SYSTEM "file:///etc/passwd">]>\n<Deck><Model>&x;</Model></Deck>',
        ('<?xml version="1.0" encoding="utf-16"?><!DOCTYPE Deck>' + MINIMAL).encode("utf-16"),
    ],
    ids=["billion laughs", "external DTD", "bare DOCTYPE", "external entity", "UTF-16 DOCTYPE"],
)
def test_refuses_every_doctype(tmp_path: Path, text: str | bytes) -> None:
    with pytest.raises(DeckError, match="DOCTYPE is not accepted") as caught:
        read(tmp_path, text)
    assert len(caught.value.faults) == 1


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (MINIMAL.encode().replace(b"<Deck>", b"<!-- \xff -->\n<Deck>"), ":1: not UTF-8 text"),
        (b'<?xml version="1.0" encoding="UTF-7"?>' + MINIMAL.encode(), 'encoding="UTF-7"'),
        (MINIMAL.encode().replace(b"</Model>", b"\0</Model>"), ":14: not a text file"),
        (MINIMAL.encode("utf-16-le"), "NUL"),
        (b"\xff\xfe<", "not UTF-16 text"),
    ],
    ids=["bad UTF-8", "UTF-7", "NUL", "UTF-16 without mark", "cut UTF-16"],
)
def test_refuses_what_is_not_text(tmp_path: Path, data: bytes, message: str) -> None:
    with pytest.raises(DeckError, match=re.escape(message)):
        read(tmp_path, data)


def test_a_long_ring_is_found_in_linear_time(tmp_path: Path) -> None:
    """Quadratic work on these markers would take minutes."""
    count = 20_000
    markers = (
        f'<Reference_Marker id="{1000 + k}" body_id="1" rm_id="{1000 + (k + 1) % count}"/>'
        for k in range(count)
    )
    with pytest.raises(DeckError, match=r"leads back to itself: 1000 -> .* \.\.\. -> 1000$"):
        read(tmp_path, added("".join(markers)))


def test_reports_all_faults_at_once(tmp_path: Path) -> None:
    text = deck(
        ('mass="5"', 'mass="-1"'),
        ('pos_z="0.108"', 'pos_z="high"'),
        ('radius="0.108"', 'radius="0"'),
        ('j_graphics_id="100"', 'j_graphics_id="999"'),
        ('end_time="3"', 'end_time="-3"'),
        ("</Model>", "<Body_Flexible/></Model>"),
    )
    with pytest.raises(DeckError) as caught:
        read(tmp_path, text)
    lines = [fault.line for fault in caught.value.faults]
    assert lines == [BODY_LINE, MARKER_LINE, SPHERE_LINE, CONTACT_LINE, 14, SIMULATE_LINE]
    assert caught.value.exit_code == 2


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("mu_static=0.3", ("Element[id].attribute=value",)),
        ("Force_Contakt[301].mu_static=1", ("no Force_Contakt", "Force_Contact")),
        ("Force_Contact[302].mu_static=1", ("no Force_Contact[302]", "[301]")),
        ("Force_Contact[301].mu=1", ("no attribute mu", "mu_")),
        ("Body_Rigid.mass=1", ("2 of Body_Rigid", "[1] [2]")),
        ("Simulate[2].end_time=1", ("no Simulate[2]", "[1]")),
    ],
)
def test_override_says_what_exists(tmp_path: Path, override: str, words: tuple[str, ...]) -> None:
    with pytest.raises(ModelError) as caught:
        read(tmp_path, MINIMAL, (override,))
    assert not isinstance(caught.value, DeckError)
    assert all(word in str(caught.value) for word in (*words, f"--set {override}"))


def test_override_with_a_bad_value_is_named(tmp_path: Path) -> None:
    with pytest.raises(DeckError, match=r'deck.xml:4: Body_Rigid\[2\]: mass="-1" \(from --set'):
        read(tmp_path, MINIMAL, ("bodyrigid[2].Mass=-1",))


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("missing.xml", "No such file"),
        ("", "is a directory"),
        ("nul\0.xml", "embedded null"),
        ("/dev/null", "not a regular file"),
        ("x" * 300, "too long"),
    ],
)
def test_unreadable_file_is_one_line(tmp_path: Path, name: str, message: str) -> None:
    from mbsim.reader.xml import read_model

    with pytest.raises(ModelError, match=message) as caught:
        read_model(tmp_path / name)
    assert "\n" not in str(caught.value)


def test_refuses_a_huge_file(tmp_path: Path) -> None:
    path = tmp_path / "deck.xml"
    with path.open("wb") as file:
        file.truncate(64 * 2**20 + 1)
    with pytest.raises(ModelError, match="64 MiB"):
        read(tmp_path, path.read_bytes())

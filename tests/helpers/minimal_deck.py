"""Small decks for the reader's tests: one valid deck, and pieces of it replaced."""

from __future__ import annotations

from pathlib import Path

from mbsim.model.elements import Model
from mbsim.reader.xml import read_model

# one element a line, so that tests can name the line: the ball is on line 4
MINIMAL = """<Deck><Model>
<Param_Unit force_unit="NEWTON" mass_unit="KILOGRAM" length_unit="METER" time_unit="SECOND"/>
<Body_Rigid id="1" isground="TRUE"/>
<Body_Rigid id="2" cg_id="20" mass="5" inertia_xx="0.02" inertia_yy="0.02" inertia_zz="0.02"/>
<Reference_Marker id="10" body_id="1"/>
<Reference_Marker id="20" body_id="2" pos_z="0.108"/>
<Post_Graphic id="100" type="Plane" rm_id="10"/>
<Post_Graphic id="200" type="Sphere" center_marker_id="20" radius="0.108"/>
<Force_Contact id="301" num_i_graphics="1" i_graphics_id="200" num_j_graphics="1"
 j_graphics_id="100" cnf_type="Impact" stiffness="1e8" exponent="1.5" damping="200" dmax="1e-4"
 cff_type="COULOMB_ON" mu_static="0.3" mu_dynamic="0.2" stiction_trans_vel="0.01"
 friction_trans_vel="0.02"/>
<Force_Gravity grav_z="-9.81"/>
</Model>
<Command>
<Param_Transient integr_tol="1e-3"/>
<Simulate analysis_type="Transient" end_time="3" print_interval="0.01"/>
</Command></Deck>
"""

BODY_LINE, MARKER_LINE, PLANE_LINE, SPHERE_LINE, CONTACT_LINE = 4, 6, 7, 8, 9
FRICTION_LINE, GRAVITY_LINE, TRANSIENT_LINE, SIMULATE_LINE = 11, 13, 16, 17

# a unit tetrahedron, closed and counter-clockwise seen from outside
TETRAHEDRON = "<Nodes>0 0 0 1 0 0 0 1 0 0 0 1</Nodes><Faces>0 2 1 0 1 3 0 3 2 1 2 3</Faces>"


def deck(*replacements: tuple[str, str]) -> str:
    """Return the minimal deck with pieces replaced; each must be there exactly once."""
    text = MINIMAL
    for old, new in replacements:
        assert text.count(old) == 1, f"{old!r} is in the deck {text.count(old)} times"
        text = text.replace(old, new)
    return text


def added(statement: str, section: str = "Model") -> str:
    """Return the minimal deck with a statement as the last of a section, on a line of its own."""
    end = f"</{section}>"
    return deck((end, f"{statement}\n{end}"))


def read(folder: Path, text: str | bytes, overrides: tuple[str, ...] = ()) -> Model:
    """Write a deck and read it back as a model."""
    path = folder / "deck.xml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_model(path, overrides)

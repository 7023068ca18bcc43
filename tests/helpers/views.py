"""Result files to look at, and pages of them in a browser."""

from __future__ import annotations

import mbsim
from helpers.decks import COULOMB, GRAVITY, GROUND, contact, sphere, write_deck

#: What a browser without a graphics card says of its own drawing, and nothing of the page.
_DRIVER = "GL Driver Message"
#: A label that would be a script where it is not escaped.
HOSTILE = "</script><script>window.hostile = 1</script><img src=x onerror='window.hostile=2'>"
_ESCAPED = HOSTILE.replace("&", "&amp;").replace("<", "&lt;").replace("'", "&apos;")
LAW = {"stiffness": 1e5, "exponent": 1.5, "damping": 50.0, "dmax": 1e-3}
LAW |= {"cnf_type": "IMPACT", **COULOMB}
#: A ball and a box, thrown onto a plane; a mesh that stands still, with a colour; a hidden one.
BALLS = (
    GROUND
    + sphere(0.15, v=(0.5, 0.0, 0.0))
    + f'<Body_Rigid id="3" label="{_ESCAPED}" cg_id="30" mass="1" inertia_xx="4e-3" '
    'inertia_yy="4e-3" inertia_zz="4e-3" v_ic_y="0.4" v_ic_y_flag="TRUE"/>'
    '<Reference_Marker id="30" body_id="3" pos_x="0.6" pos_z="0.3"/>'
    '<Post_Graphic id="300" type="BoxDefinedFromCenter" center_marker_id="30" length_x="0.2" '
    f'length_y="0.1" length_z="0.1" color="10:200:30" label="{_ESCAPED}"/>'
    '<Reference_Marker id="40" body_id="1" pos_x="-0.4" pos_z="0.2"/>'
    '<Post_Graphic id="400" type="TriaMesh" rm_id="40"><Nodes>0 0 0 .1 0 0 0 .1 0 0 0 .1</Nodes>'
    "<Faces>0 2 1 0 1 3 0 3 2 1 2 3</Faces></Post_Graphic>"
    '<Post_Graphic id="401" type="TriaMesh" rm_id="30" hidden="TRUE"><Nodes>0 0 0 .1 0 0 0 .1 0 '
    "0 0 .1</Nodes><Faces>0 2 1 0 1 3 0 3 2 1 2 3</Faces></Post_Graphic>"
    + contact(id=1, **LAW)
    + contact(id=2, i=300, **LAW)
    + GRAVITY
    + '<Post_Request id="7" type="MARKER_DISPLACEMENT" i_marker_id="30"/>'
)


def run_balls(folder, **options):
    """Run the balls into a folder and return the result file."""
    deck = write_deck(folder, BALLS, end_time=0.5, print_interval=0.005, name="balls.xml")
    mbsim.simulate(mbsim.read_model(deck), output=folder, **options).close()
    return folder / "balls.h5"


def complaints(page):
    """Return what a page wrote to its console, without what the driver says of itself."""
    return [line for line in page.console if _DRIVER not in line]

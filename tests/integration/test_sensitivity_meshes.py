"""Sensitivities of models with meshes, whose triangles are somewhere in memory."""

from __future__ import annotations

import numpy as np
import pytest

import mbsim
from helpers.folders import MODELS
from helpers.tight_runs import differences
from mbsim.errors import ModelError

# an octahedron of 10 mm falls onto a plane, and beside it a box onto a mesh that stands still
DECK = f"""<Deck><Model>
<Body_Rigid id="1" isground="TRUE"/>
<Body_Rigid id="2" cg_id="20" mass="0.01" inertia_xx="0.5" inertia_yy="0.5" inertia_zz="0.5"/>
<Body_Rigid id="3" cg_id="30" mass="0.01" inertia_xx="0.5" inertia_yy="0.6" inertia_zz="0.7"/>
<Reference_Marker id="10" body_id="1"/>
<Reference_Marker id="11" body_id="1" pos_x="100"/>
<Reference_Marker id="20" body_id="2" pos_z="14" theta="0.3"/>
<Reference_Marker id="30" body_id="3" pos_x="101" pos_y="0.5" pos_z="25"/>
<Post_Graphic id="100" type="Plane" rm_id="10"/>
<Post_Graphic id="101" type="TriaMesh" rm_id="11" file="{MODELS}/pile_octahedron.stl"/>
<Post_Graphic id="200" type="TriaMesh" rm_id="20" file="{MODELS}/pile_octahedron.stl"/>
<Post_Graphic id="300" type="BoxDefinedFromCenter" center_marker_id="30" length_x="20"
 length_y="16" length_z="12"/>
<Force_Contact id="301" i_graphics_id="200" j_graphics_id="100" cnf_type="IMPACT" stiffness="1e3"
 exponent="1.5" damping="0.1" dmax="0.1"/>
<Force_Contact id="302" i_graphics_id="300" j_graphics_id="101" cnf_type="IMPACT" stiffness="1e3"
 exponent="1.5" damping="0.1" dmax="0.1"/>
<Force_Gravity grav_z="-9810"/>
</Model><Command>
<Simulate analysis_type="Transient" end_time="0.06" print_interval="0.002"/>
</Command></Deck>"""


@pytest.mark.parametrize(
    ("name", "value", "step", "body"),
    [
        ("Body_Rigid[2].mass", 0.01, 1e-6, 2),
        ("Reference_Marker[20].pos_z", 14.0, 1e-4, 2),
        ("Body_Rigid[3].mass", 0.01, 1e-6, 3),
        ("Post_Graphic[300].length_z", 12.0, 1e-4, 3),
    ],
)
def test_derivatives_of_meshes_are_those_of_runs(name, value, step, body):
    signal, how = f"bodies/{body}/velocity/z", {"integrator": "DOPRI5"}
    run = mbsim.simulate(DECK, sensitivity=[name], tol=1e-9, **how)
    assert np.count_nonzero(run["events"]["kind"] == "touch") >= 2
    truth = differences(DECK, name, value, step, (signal,), tol=1e-11, **how)[signal]
    found = run.sensitivity(signal, name)
    assert run.parameters[name]["known_until"] == np.inf
    assert np.abs(found - truth).max() < 1e-3 * np.abs(truth).max()
    other = run.sensitivity(f"bodies/{5 - body}/velocity/z", name)
    assert np.abs(other).max() < 1e-6 * np.abs(truth).max()


def test_what_a_parameter_changes_by_jumps_is_refused(monkeypatch):
    from mbsim.sensitivity import parameters

    tables = parameters._tables

    def jumpy(system):
        found = tables(system)
        mass = found["bodies/mass"]
        return found | {"bodies/mass": mass + (mass > 0.01)}

    monkeypatch.setattr(parameters, "_tables", jumpy)
    with pytest.raises(ModelError, match="does not change the model smoothly: bodies/mass"):
        mbsim.simulate(DECK, sensitivity=["Body_Rigid[2].mass"])

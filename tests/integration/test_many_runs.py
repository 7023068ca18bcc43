"""A run in a process that has run other values of its deck is that of a fresh process, exactly."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import mbsim
from helpers.folders import PACKAGES

BALL = PACKAGES / "models" / "bowling_ball.xml"
#: A body on a spring, driven by an expression, that hits a plane.
SPRING = """<Deck><Model>
<Param_Transient integr_tol="1e-6"/>
<Body_Rigid id="1" isground="TRUE"/>
<Body_Rigid id="2" cg_id="20" mass="2" inertia_xx="0.01" inertia_yy="0.02" inertia_zz="0.03"
 v_ic_x="0.3" v_ic_x_flag="TRUE"/>
<Reference_Marker id="10" body_id="1"/>
<Reference_Marker id="20" body_id="2" pos_x="1.2" pos_z="0.06"/>
<Post_Graphic id="100" type="Plane" rm_id="10"/>
<Post_Graphic id="200" type="Sphere" center_marker_id="20" radius="0.05"/>
<Force_Contact id="3" num_i_graphics="1" i_graphics_id="200" num_j_graphics="1" j_graphics_id="100"
 cnf_type="IMPACT" stiffness="1e5" exponent="1.5" damping="20" dmax="1e-3" cff_type="COULOMB_ON"
 mu_static="0.3" mu_dynamic="0.2" stiction_trans_vel="0.01" friction_trans_vel="0.02"/>
<Force_SpringDamper id="4" type="TRANSLATIONAL" i_marker_id="20" j_marker_id="10" stiffness="8"
 length="1"/>
<Reference_Variable id="6" expr="0.25*SIN(3*TIME)"/>
<Force_Vector_TwoBody id="5" type="ForceOnly" i_marker_id="20" j_floating_marker_id="10"
 ref_marker_id="10" fx_expression="VARVAL(6)" fy_expression="0" fz_expression="0"/>
<Force_Gravity grav_z="-9.81"/>
<Post_Request id="7" type="MARKER_DISPLACEMENT" i_marker_id="20" j_marker_id="10"/>
</Model><Command>
<Simulate analysis_type="Transient" end_time="0.3" print_interval="0.01"/>
</Command></Deck>"""
#: Attributes of every kind, and two values of each: of bodies, places, shapes, laws, starts,
#: expressions, users' parameters and of how it is run.
CASES = {
    "ball": (
        ("Body_Rigid[2].mass", "5.5", "4"),
        ("Body_Rigid[2].v_ic_x", "4", "-1"),
        ("Reference_Marker[20].pos_z", "0.11", "0.12"),
        ("Post_Graphic[200].radius", "0.1", "0.106"),
        ("Force_Contact[301].stiffness", "1e7", "3e6"),
        ("Force_Contact[301].cff_param_string", "USER(0.3,0.2,0.02,0.02)", "USER(0,0,0.02,0.02)"),
    ),
    "spring": (
        ("Body_Rigid[2].inertia_yy", "0.025", "0.019"),
        ("Force_Contact[3].mu_static", "0.25", "0.6"),
        ("Force_Contact[3].cnf_type", "LINEAR", "HERTZ"),
        ("Force_SpringDamper[4].length", "1.1", "0.5"),
        ("Reference_Variable[6].expr", "TIME", "2*DX(20,10)"),
        ("Force_Gravity.grav_z", "-1.6", "0"),
        ("Param_Transient.integr_tol", "1e-3", "1e-8"),
        ("Param_Transient.h_max", "1e-3", "1"),
        ("Simulate.end_time", "0.2", "0.1"),
        ("Simulate.print_interval", "0.02", "0.05"),
    ),
}
HERE = (Path(__file__).parent, Path(__file__).parents[1])
#: A process for each run, which has run nothing: forked off one that has only imported.
FRESH = """
import json, os, sys
import mbsim.run.simulation
from test_many_runs import digests_of
for each in json.loads(sys.stdin.read()):
    sys.stdout.flush()
    child = os.fork()
    if child == 0:
        print(json.dumps(digests_of(*each)), flush=True)
        os._exit(0)
    os.waitpid(child, 0)
"""


def deck_of(name, folder):
    """Return a deck of `CASES`, short ones as files too."""
    file = folder / f"{name}.xml"
    if not file.exists():
        text = BALL.read_text(encoding="utf-8") if name == "ball" else SPRING
        text = text.replace('end_time="2"', 'end_time="0.2"')
        file.write_text(text.replace("../userfuncs", str(BALL.parents[1] / "userfuncs")))
    return str(file)


def digests_of(deck, overrides):
    """Return digests of all that a run leaves, or what it says where it cannot run."""
    try:
        run = mbsim.simulate(deck, overrides=overrides)
    except mbsim.MbsimError as error:
        return {"error": str(error)}
    found = {name: hashlib.sha256(np.asarray(run[name])).hexdigest() for name in sorted(run.keys())}
    found["graphics"] = hashlib.sha256(run.tables("graphics")["shapes"]).hexdigest()
    times = ("loop_s", "wall_s", "compile_s")
    return found | {name: n for name, n in run.stats.items() if name not in times}


@pytest.mark.parametrize("name", CASES)
def test_runs_are_those_of_fresh_processes(name, tmp_path):
    deck = deck_of(name, tmp_path)
    asked = [[f"{path}={value}"] for path, *values in CASES[name] for value in values]
    plain = digests_of(deck, [])
    first = [digests_of(deck, each) for each in asked]
    # in another order, so that each follows another one, and the plain deck at the end
    again = [digests_of(deck, each) for each in reversed(asked)][::-1]
    assert digests_of(deck, []) == plain
    assert again == first
    assert sum("error" in each for each in first) < 3
    assert len({json.dumps(each) for each in [plain, *first]}) > len(asked) - 3
    done = subprocess.run(
        [sys.executable, "-c", FRESH],
        input=json.dumps([[deck, each] for each in asked]),
        text=True,
        capture_output=True,
        check=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(map(str, HERE))},
    )
    for each, found, line in zip(asked, first, done.stdout.splitlines(), strict=True):
        assert json.loads(line) == found, each


def test_a_deck_or_script_that_changes_is_read_anew(tmp_path):
    deck, script = tmp_path / "ball.xml", tmp_path / "law.py"
    text = (BALL.parents[1] / "userfuncs" / "coulomb_stribeck.py").read_text(encoding="utf-8")
    script.write_text(text)
    whole = BALL.read_text(encoding="utf-8").replace('end_time="2"', 'end_time="0.1"')
    whole = whole.replace("../userfuncs/coulomb_stribeck.py", str(script))
    deck.write_text(whole)
    before = digests_of(str(deck), [])
    deck.write_text(whole.replace('damping="200"', 'damping="300"'))
    assert digests_of(str(deck), []) != before
    deck.write_text(whole)
    assert digests_of(str(deck), []) == before
    script.write_text(text.replace("def CFFSUB", "def OTHER") + "\n\ndef CFFSUB" + TURNED)
    assert digests_of(str(deck), [])["bodies/2/position"] != before["bodies/2/position"]


#: Friction that is half of what it was.
TURNED = """(id, time, par, npar, loci, locj, x, xdot, nforce, dflag, iflag):
    found = OTHER(id, time, par, npar, loci, locj, x, xdot, nforce, dflag, iflag)
    return [0.5 * found[0], 0.5 * found[1], 0.5 * found[2]]
"""

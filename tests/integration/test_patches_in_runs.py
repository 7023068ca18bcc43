"""Patches of meshes under every depth, friction and method: resumed, asked again, judged, compared.

An L of 1 kg slides and spins on a slab that is a mesh too, and comes to rest or nearly so.
"""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import mbsim
from helpers.decks import EARTH, GRAVITY, run_in_pieces, write_deck
from helpers.folders import USERFUNCS
from helpers.surfaces import angle, mesh_graphic
from mbsim.errors import PluginError
from mbsim.run.replay import Replay

#: The footprint of the L, 0.03 m^2, bears its weight at this depth.
AREA, SAG = 0.03, 1e-4
STIFF = 9.81 / (AREA * SAG)
DEPTHS = {
    "LARGEST": f'cnf_type="IMPACT" stiffness="{9.81 / SAG}" exponent="1" damping="200" dmax="1e-5"',
    "FIELD": f'contact_depth="FIELD" cnf_type="IMPACT" stiffness="{STIFF}" exponent="1" '
    'damping="6e3" dmax="1e-5"',
    "VOLUME": f'cnf_type="VOLUME" i_elastic_modulus="{STIFF}" i_poisson_ratio="0" '
    'i_layer_depth="1" damping="2"',
}
MU = 'mu_static="0.3" mu_dynamic="0.3"'
FRICTIONS = {
    "COULOMB_ON": f'cff_type="COULOMB_ON" {MU} stiction_trans_vel="0.01" friction_trans_vel="0.02"',
    "LUGRE": f'cff_type="LUGRE" {MU} stribeck_vel="0.01" bristle_stiffness="2e4" '
    'bristle_damping="30"',
    "STICTION": f'cff_type="STICTION" {MU}',
    "INFINITE": f'cff_type="STICTION" {MU} tangential_stiffness="INFINITE"',
    "CFFSUB": 'cff_type="USERCFF" cff_fnc_name="CFFSUB" script_name="law.py" '
    'cff_param_string="USER(0.3,2e4,30)"',
}


def slab():
    """Return a slab 0.2 m thick, its upper side at z = 0, with a dent below."""
    box = trimesh.creation.box((2.0, 2.0, 0.2)).subdivide()
    box.vertices[
        (np.abs(box.vertices[:, :2]).max(axis=1) < 1e-9) & (box.vertices[:, 2] < 0.0), 2
    ] += 0.02
    return box.vertices - [0.0, 0.0, 0.1], box.faces


def deck(folder, depth, friction, v=0.2, spin=1.0, end=0.12):
    (folder / "law.py").write_text((USERFUNCS / "stiction_with_state.py").read_text())
    flags = f'v_ic_x="{v}" v_ic_x_flag="TRUE" w_ic_z="{spin}" w_ic_z_flag="TRUE"'
    text = (
        EARTH
        + mesh_graphic(100, 10, *slab())
        + '<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="0.004" inertia_yy="0.004" '
        f'inertia_zz="0.006" {flags}/><Reference_Marker id="20" body_id="2" pos_z="{0.05 - SAG}"/>'
        + mesh_graphic(200, 20, *angle())
        + '<Force_Contact id="301" i_graphics_id="200" j_graphics_id="100" '
        + f"{DEPTHS[depth]} {FRICTIONS[friction]}/>"
        + GRAVITY
    )
    return mbsim.read_model(write_deck(folder, text, end, 0.005))


#: What is held without give is for implicit methods.
EXPLICIT = [name for name in FRICTIONS if name != "INFINITE"]
EVERY = [
    *((depth, friction, "DOPRI5") for depth in DEPTHS for friction in EXPLICIT),
    # with a user's own memory the peaks of an L that rocks take 26,000 steps of RADAU5
    *(
        pytest.param(
            "LARGEST", friction, "RADAU5", marks=[pytest.mark.slow] * (friction != "LUGRE")
        )
        for friction in EXPLICIT
        if friction != "CFFSUB"
    ),
    # the L rocks from peak to peak: 70 s
    pytest.param("LARGEST", "INFINITE", "RADAU5", marks=pytest.mark.slow),
    ("FIELD", "CFFSUB", "RADAU5"),
    *(
        pytest.param(
            "FIELD", friction, "GALPHA", marks=[pytest.mark.slow] * (friction != "INFINITE")
        )
        for friction in FRICTIONS
    ),
    ("VOLUME", "INFINITE", "RADAU5"),
]


@pytest.mark.parametrize(("depth", "friction", "method"), EVERY)
def test_resumed_and_asked_again_it_is_the_same_to_the_last_bit(
    depth, friction, method, tmp_path, monkeypatch
):
    model = deck(tmp_path, depth, friction)
    whole = mbsim.simulate(model, integrator=method)
    assert whole.stats["fcl_calls"] == 0
    assert whole["contacts/301/incidents"][:].min() >= 1
    # it slides, and rubs by about mu N
    force = whole["contacts/301/force"]
    assert np.hypot(force[1, 0], force[1, 1]) == pytest.approx(0.3 * force[1, 2], rel=0.1)
    assert whole.audit.warnings == ()
    again = run_in_pieces(model, tmp_path / "out", monkeypatch, integrator=method)
    assert sorted(whole.keys()) == sorted(again.keys())
    for name in whole.keys():
        np.testing.assert_array_equal(whole[name], again[name], err_msg=name)
    rows = list(Replay(again).rows())
    assert len(rows) == len(again["time"]) > 20
    for name in ("force", "torque", "penetration", "slip_speed", "area"):
        asked = np.array([row.contacts[301][name] for row in rows])
        np.testing.assert_array_equal(asked, again[f"contacts/301/{name}"], err_msg=name)


#: LARGEST without give is left out: at this tol a step falls to nothing as the L's peaks change,
#: and the run says so.
AGREE = [
    pytest.param(
        depth,
        friction,
        # those that take longest, 10 to 22 s each
        marks=[pytest.mark.slow]
        if (depth, friction)
        in (
            *(("LARGEST", "CFFSUB"), ("LARGEST", "STICTION")),
            *(("VOLUME", "INFINITE"), ("FIELD", "INFINITE")),
            *(("FIELD", "STICTION"), ("LARGEST", "LUGRE")),
        )
        else [],
    )
    for depth in DEPTHS
    for friction in FRICTIONS
    if (depth, friction) != ("LARGEST", "INFINITE")
]


@pytest.mark.parametrize(("depth", "friction"), AGREE)
def test_methods_agree(depth, friction, tmp_path):
    model = deck(tmp_path, depth, friction)
    methods = ["RADAU5", "GALPHA", *(["DOPRI5"] if friction in EXPLICIT else [])]
    ends = {}
    for method in methods:
        run = mbsim.simulate(model, integrator=method, tol=1e-7)
        ends[method] = np.concatenate(
            [run["bodies/2/position"][-1], run["bodies/2/velocity"][-1] * 0.01]
        )
    # of 7 mm; the memory of a user's own law goes on at ends of steps alone
    most = 2e-5 if friction == "CFFSUB" else 2e-7
    for method in methods[1:]:
        np.testing.assert_allclose(ends[method], ends["RADAU5"], atol=most, err_msg=method)


def test_a_users_law_is_never_given_less_than_no_normal_force(tmp_path):
    """Nor in slopes: in this run a damper outweighs the spring while they touch."""
    model = deck(tmp_path, "LARGEST", "CFFSUB", end=0.06)
    (tmp_path / "law.py").write_text(
        "def CFFSUB(id, time, par, npar, loci, locj, x, xdot, nforce, dflag, iflag):\n"
        "    if nforce < 0.0:\n"
        "        raise ValueError('pulled')\n"
        "    mu = par[0] * nforce / max(0.01, hypot(xdot[0], xdot[1]))\n"
        "    return [-mu * xdot[0], -mu * xdot[1], 0.0]\n"
    )
    for method in ("DOPRI5", "RADAU5", "GALPHA"):
        run = mbsim.simulate(model, integrator=method)
        assert run.stats["rhs_evaluations"] > 100


def test_a_users_law_that_fails_in_slopes_is_named(tmp_path):
    model = deck(tmp_path, "FIELD", "CFFSUB")
    (tmp_path / "law.py").write_text(
        "def CFFSUB(id, time, par, npar, loci, locj, x, xdot, nforce, dflag, iflag):\n"
        "    return [0.0, 0.0, 1.0 / (1.0 - dflag)]\n"
    )
    with pytest.raises(PluginError, match=r"Force_Contact\[301\]: CFFSUB .*failed at time 0"):
        mbsim.simulate(model, integrator="RADAU5")

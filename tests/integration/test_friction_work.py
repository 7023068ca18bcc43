"""Friction that drives is told with its element and the time from which on; friction that resists,
that is carried along by what moves, or that gives back what its spring took, is not."""

from __future__ import annotations

import numpy as np
import pytest

import mbsim
from helpers.decks import COULOMB, EARTH, GRAVITY, GROUND, contact, cube, sphere, write_deck
from helpers.libraries import compiled
from mbsim.arrays.codes import SLIDER_LIMIT
from mbsim.errors import DeckError
from mbsim.run import loop

ARGUMENTS = "id, time, par, npar, loci, locj, x, xdot, nforce, dflag, iflag"
#: par: which sign, 1 resists.
PLAIN = f"""
def CFFSUB({ARGUMENTS}):
    v = hypot(xdot[0], xdot[1])
    size = par[0] * 0.2 * nforce / max(v, 1e-2)
    return [-size * xdot[0], -size * xdot[1], 0.0]
"""
#: The wrong sign along one axis alone.
ASKEW = PLAIN.replace("-size * xdot[0]", "-abs(size) * xdot[0]")
SPIN = f"""
def CFFSUB({ARGUMENTS}):
    return [0.0, 0.0, -par[0] * 4e-2 * nforce * tanh(xdot[2])]
"""
#: A spring whose stretch is kept, clipped at mu N.
KEPT = f"""
CFFSUB_STATES = 2


def CFFSUB({ARGUMENTS}, state):
    most = 0.2 * nforce / 1e4
    z = max(-most, min(most, state[0] + x[0] - state[1]))
    return [-par[0] * 1e4 * z, 0.0, 0.0], [z, x[0]]
"""
#: A spring between the surfaces gives back all that it took.
SPRING = f"""
def CFFSUB({ARGUMENTS}):
    return [-par[0] * 1e3 * x[0], -par[0] * 1e3 * x[1], 0.0]
"""
C = """
#include <math.h>
void CFFSUB(int *id, double *time, double *par, int *npar, double *loci, double *locj, double *x,
            double *xdot, double *nforce, int *dflag, int *iflag, double *result)
{
    double v = hypot(xdot[0], xdot[1]);
    double size = par[0] * 0.2 * *nforce / (v > 1e-2 ? v : 1e-2);
    result[0] = -size * xdot[0];
    result[1] = -size * xdot[1];
    result[2] = 0;
}
"""
PYTHON = {"plain": PLAIN, "askew": ASKEW, "spin": SPIN, "kept": KEPT, "spring": SPRING}


def deck_with(folder, law, sign, end_time=0.1):
    """Return a deck of a ball that slides under a user's friction."""
    if law == "c":
        file = {"cff_dll_name": compiled(folder, C)}
    else:
        (folder / "friction.py").write_text(PYTHON[law])
        file = {"script_name": "friction.py"}
    user = {"cff_type": "USERCFF", "cff_param_string": f"USER({sign})", "cff_fnc_name": "CFFSUB"}
    ball = sphere(0.0995, v=(0.2, 0.5, 0.0), w=(0.0, 0.0, 3.0))
    model = GROUND + GRAVITY + ball + contact(damping=10.0, dmax=1e-4, **user, **file)
    return write_deck(folder, model, end_time)


def drives(results):
    """Return the warnings of friction that drives."""
    return [line for line in results.audit.warnings if line.startswith("friction drives")]


@pytest.mark.parametrize("integrator", ["AUTO", "RADAU5", "GALPHA", "VERLET"])
@pytest.mark.parametrize("law", ["plain", "askew", "spin", "kept", "spring", "c"])
def test_a_users_friction_of_the_wrong_sign_is_told(law, integrator, tmp_path):
    told = []
    model = mbsim.read_model(deck_with(tmp_path, law, -1))
    with mbsim.simulate(
        model, integrator=integrator, output=tmp_path, notify=told.append
    ) as results:
        (warning,) = drives(results)
        entry, work = results.audit.entries["friction_work"], results.audit.contacts[301].friction
    assert f"warning: {warning}" in told
    creeps = any("holds by states creeps" in line for line in told)
    assert creeps == ((law, integrator) == ("kept", "VERLET"))
    assert f"warning: {warning}" in (tmp_path / "deck.log").read_text()
    assert "Force_Contact[301]" in warning
    assert entry.element in warning
    # at once, not when half of the run is over
    assert entry.time < 0.05
    assert entry.value > entry.allowed
    assert work > 0.0 or law == "askew"
    with mbsim.open_results(tmp_path / "deck.h5") as kept:
        assert kept.audit.entries["friction_work"] == entry
        assert drives(kept) == [warning]


@pytest.mark.parametrize("law", ["plain", "askew", "spin", "kept", "spring", "c"])
def test_of_the_right_sign_nothing_is_told(law, tmp_path):
    model = mbsim.read_model(deck_with(tmp_path, law, 1, 0.5))
    with mbsim.simulate(model) as results:
        assert drives(results) == []
        assert results.audit.contacts[301].friction < 0.0


def test_the_work_of_friction_is_what_was_lost(tmp_path):
    """Without a damper all that is lost, friction took."""
    ball = sphere(0.0995, v=(1.0, 0.5, 0.0))
    path = write_deck(tmp_path, GROUND + GRAVITY + ball + contact(**COULOMB), 0.1)
    with mbsim.simulate(mbsim.read_model(path), tol=1e-8) as results:
        lost = results["energy/dissipated"][-1]
        assert lost > 0.01
        assert results.audit.contacts[301].friction == pytest.approx(-lost, rel=1e-9)


def test_the_reader_takes_no_coefficient_below_0(tmp_path):
    negative = COULOMB | {"mu_static": -0.3, "mu_dynamic": -0.2}
    path = write_deck(tmp_path, GROUND + sphere(0.1) + contact(**negative))
    with pytest.raises(DeckError, match="mu_static"):
        mbsim.read_model(path)


def turned(monkeypatch, turn):
    """Let `turn(scene)` happen before the first step."""
    plain = loop.Runner.start

    def begin(runner, *given):
        turn(runner.system.scene)
        plain(runner, *given)

    monkeypatch.setattr(loop.Runner, "start", begin)


def test_a_built_in_law_that_drives_is_told(tmp_path, monkeypatch):
    def turn(scene):
        scene.contacts.friction_par[0, :2] *= -1.0

    turned(monkeypatch, turn)
    ball = sphere(0.0995, v=(1.0, 0.5, 0.0))
    path = write_deck(tmp_path, GROUND + GRAVITY + ball + contact(**COULOMB), 0.1)
    with mbsim.simulate(mbsim.read_model(path)) as results:
        assert "Force_Contact[301]" in drives(results)[0]


PIN = (
    EARTH
    + GRAVITY
    + """
<Body_Rigid id="2" cg_id="20" mass="10" inertia_xx="1" inertia_yy="1" inertia_zz="1"
  w_ic_y="-10" w_ic_y_flag="TRUE"/>
<Reference_Marker id="11" body_id="1" theta="1.5707963267948966"/>
<Reference_Marker id="20" body_id="2" theta="1.5707963267948966"/>
<Constraint_Joint id="1" type="REVOLUTE" i_marker_id="20" j_marker_id="11"/>
<Force_JointFriction id="7" joint_id="1" cff_type="COULOMB_ON" mu_static="0.3" mu_dynamic="0.3"
  pin_radius="0.1"/>
"""
)
SLIDER = (
    EARTH
    + """
<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="1" inertia_yy="1" inertia_zz="1"
  v_ic_z="1" v_ic_z_flag="TRUE"/>
<Reference_Marker id="20" body_id="2"/>
<Constraint_Joint id="1" type="TRANSLATIONAL" i_marker_id="20" j_marker_id="10"/>
<Force_DryFriction id="7" i_marker_id="20" j_marker_id="10" type="TZ" friction="1" dx="1e-4"/>
"""
)


@pytest.mark.parametrize("integrator", ["AUTO", "RADAU5"])
@pytest.mark.parametrize(
    ("name", "model"), [("Force_JointFriction", PIN), ("Force_DryFriction", SLIDER)]
)
def test_friction_between_markers_is_judged(name, model, integrator, tmp_path, monkeypatch):
    read = mbsim.read_model(write_deck(tmp_path, model, 0.5))
    with mbsim.simulate(read, integrator=integrator) as results:
        assert drives(results) == []
        assert "friction_work" in results.audit.entries

    def turn(scene):
        if name == "Force_JointFriction":
            scene.applied.law_par[0] = -np.abs(scene.applied.law_par[0])
        else:
            scene.applied.par[0, SLIDER_LIMIT] *= -1.0

    turned(monkeypatch, turn)
    with mbsim.simulate(read, integrator=integrator) as results:
        assert f"{name}[7]" in drives(results)[0]
        assert results.audit.entries["friction_work"].time < 0.25


@pytest.mark.parametrize("integrator", ["AUTO", "GALPHA"])
def test_a_belt_that_carries_along_is_not_told(integrator, tmp_path):
    """The belt does work; friction takes it from what slips."""
    belt = (
        EARTH
        + GRAVITY
        + """
    <Body_Rigid id="3" cg_id="30" mass="1" inertia_xx="1" inertia_yy="1" inertia_zz="1"/>
    <Reference_Marker id="30" body_id="3"/>
    <Reference_Marker id="11" body_id="1" a00="0" a10="0" a20="-1" a02="1" a22="0"/>
    <Reference_Marker id="31" body_id="3" a00="0" a10="0" a20="-1" a02="1" a22="0"/>
    <Constraint_Joint id="1" type="TRANSLATIONAL" i_marker_id="31" j_marker_id="11"/>
    <Motion_Joint id="1" joint_id="1" val_type="D" expr="TIME*TIME"/>
    <Post_Graphic id="100" type="Plane" rm_id="30"/>
    """
        + cube(2, (0.0, 0.0, 0.1))
        + contact(damping=10.0, dmax=1e-4, **COULOMB)
    )
    with mbsim.simulate(
        mbsim.read_model(write_deck(tmp_path, belt, 0.5)), integrator=integrator
    ) as results:
        assert results["bodies/2/velocity/x"][-1] > 0.5
        assert results.audit.warnings == ()
        assert results.audit.contacts[301].friction < 0.0

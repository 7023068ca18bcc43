"""Friction with memory, the built-in one and a user's: trial and commit, resume, turning frames."""

from __future__ import annotations

import ctypes
import math
import random

import numpy as np
import pytest

import mbsim
from helpers.folders import USERFUNCS
from mbsim.dynamics.pipeline import problem
from mbsim.errors import Interrupted, ModelError, PluginError
from mbsim.plugins import failure

KEEPS = USERFUNCS / "stiction_with_state.py"
STICTION = 'cff_type="STICTION" mu_static="0.4" mu_dynamic="0.4" tangential_stiffness="2e4"'
PLUGIN = (
    f'cff_type="USERCFF" cff_fnc_name="CFFSUB" script_name="{KEEPS}" '
    'cff_param_string="USER(0.4,2e4,30)"'
)
LUGRE = (
    'cff_type="LUGRE" mu_static="0.4" mu_dynamic="0.3" stribeck_vel="0.01" '
    'bristle_stiffness="2e4" bristle_damping="30"'
)
FRICTIONS = {"STICTION": STICTION, "plugin": PLUGIN}

DECK = """<Deck><Model>
<Body_Rigid id="1" isground="TRUE"/>
<Body_Rigid id="2" cg_id="20" mass="1"
 inertia_xx="0.0042" inertia_yy="0.0042" inertia_zz="0.0067" {motion}/>
<Body_Rigid id="3" cg_id="30" mass="1" inertia_xx="1" inertia_yy="1" inertia_zz="1"/>
<Reference_Marker id="10" body_id="1"/>
<Reference_Marker id="20" body_id="2" pos_x="{at}" pos_z="0.04997547"/>
<Reference_Marker id="30" body_id="3"/>
<Post_Graphic id="100" type="Plane" rm_id="30"/>
<Post_Graphic id="200" type="BoxDefinedFromCenter" center_marker_id="20"
 length_x="0.2" length_y="0.2" length_z="0.1"/>
<Constraint_Joint id="501" type="REVOLUTE" i_marker_id="30" j_marker_id="10"/>
<Motion_Joint id="502" joint_id="501" val_type="D" expr="{turn}"/>
<Force_Contact id="301" num_i_graphics="1" i_graphics_id="200" num_j_graphics="1"
 j_graphics_id="100" cnf_type="IMPACT" stiffness="1e5" exponent="1" damping="300" dmax="1e-6"
 {friction}/>
{force}
<Force_Gravity grav_z="-9.81"/>
</Model>
<Command><Simulate analysis_type="Transient" end_time="{end}" print_interval="0.02"/></Command>
</Deck>
"""
TO_AND_FRO = (
    '<Force_Vector_OneBody id="5" type="ForceOnly" i_marker_id="20" '
    'fx_expression="6*sin(6*time)" fy_expression="{across}" fz_expression="0"/>'
)


def pushed(folder, friction, end=1.5, across="2*sin(4*time)"):
    """Return a block that a force pushes to and fro, so that it slides, turns back and sticks."""
    text = DECK.format(
        motion="", at=0, turn="0*TIME", friction=friction,
        force=TO_AND_FRO.format(across=across), end=end,
    )  # fmt: skip
    (folder / "pushed.xml").write_text(text)
    return mbsim.read_model(folder / "pushed.xml")


@pytest.fixture
def chance():
    return random.Random(7)


@pytest.fixture
def rejections(monkeypatch, chance):
    """Let the check of steps reject some at random; return how many it did."""
    made, kept = [], []
    plain = problem.mechanism
    signature = ctypes.CFUNCTYPE(
        ctypes.c_double, ctypes.c_int64, ctypes.c_double, ctypes.c_double,
        ctypes.c_void_p, ctypes.c_void_p,
    )  # fmt: skip

    def mechanism(scene, fixed_step=False):
        problem, table = plain(scene, fixed_step)
        own = signature(problem.check)

        def check(context, t, h, a, b):
            if chance.random() < 0.3:
                made.append(t)
                return chance.uniform(0.2, 0.9)
            return own(context, t, h, a, b)

        kept.append(signature(check))
        address = ctypes.cast(kept[-1], ctypes.c_void_p).value
        return problem._replace(check=address), table

    monkeypatch.setattr(problem, "mechanism", mechanism)
    return made


@pytest.mark.parametrize("friction", FRICTIONS)
def test_rejected_steps_leave_no_trace_in_the_memory(tmp_path, friction, rejections, monkeypatch):
    model, tol = pushed(tmp_path, FRICTIONS[friction], across="0"), 1e-5
    shaken = mbsim.simulate(model, integrator="DOPRI5", tol=tol)
    count = len(rejections)
    monkeypatch.undo()
    plain = mbsim.simulate(model, integrator="DOPRI5", tol=tol)
    assert len(rejections) == count > 100
    x, there = plain["bodies/2/position"], shaken["bodies/2/position"]
    # it slides, turns back, and slides again
    assert np.ptp(x[:, 0]) > 0.05
    assert np.abs(x - there).max() < tol
    assert np.abs(plain["contacts/301/force"] - shaken["contacts/301/force"]).max() < 0.05


def test_stick_and_slip_that_take_turns_are_left_whatever_is_rejected(
    tmp_path, rejections, chance, monkeypatch
):
    # near 0.5738 s, where the block turns back, each of the two asks for the other for some 1e-5 s
    model, tol = pushed(tmp_path, STICTION, end=0.6, across="0"), 1e-5
    shaken = []
    for seed in (1, 5, 7, 9, 12):
        chance.seed(seed)
        rejections.clear()
        shaken.append(mbsim.simulate(model, integrator="DOPRI5", tol=tol))
        # a third of all steps, and the steps do not become many
        assert 100 < len(rejections) < 1000
    monkeypatch.undo()
    x = mbsim.simulate(model, integrator="DOPRI5", tol=tol)["bodies/2/position"]
    assert all(np.abs(x - run["bodies/2/position"]).max() < tol for run in shaken)


@pytest.mark.parametrize("friction", FRICTIONS)
def test_a_resumed_run_is_the_same_to_the_last_bit(tmp_path, monkeypatch, friction):
    monkeypatch.setattr("mbsim.run.divergence.RETURN_SECONDS", 1e-4)
    model = pushed(tmp_path, FRICTIONS[friction])
    straight = mbsim.simulate(model, output=tmp_path / "a", integrator="DOPRI5")

    def stop(time, h, end):
        if time > 0.6:
            raise Interrupted(f"stopped at {time}")

    with pytest.raises(Interrupted):
        mbsim.simulate(model, output=tmp_path / "b", progress=stop, integrator="DOPRI5")
    resumed = mbsim.simulate(model, output=tmp_path / "b", resume=True, integrator="DOPRI5")
    for name in ("time", "state/y", "state/incidents", "events", "contacts/301/force"):
        np.testing.assert_array_equal(straight[name], resumed[name])
    straight.close()
    resumed.close()


@pytest.mark.parametrize("friction", FRICTIONS)
def test_a_block_on_a_turntable_keeps_its_deformation_in_its_own_frame(tmp_path, friction):
    text = DECK.format(
        motion='v_ic_y="0.9" v_ic_y_flag="TRUE" w_ic_z="3" w_ic_z_flag="TRUE"', at=0.3,
        turn="3*TIME", friction=FRICTIONS[friction], force="", end=1 + 2 * math.pi / 3,
    )  # fmt: skip
    (tmp_path / "turntable.xml").write_text(text)
    model = mbsim.read_model(tmp_path / "turntable.xml")
    results = mbsim.simulate(model, integrator="DOPRI5", tol=1e-9)
    # rows of the turn after the first second, at which it has come to rest on the table
    first = int(np.searchsorted(results["time"], 1.0))
    offsets = results["state/incident_offsets"]
    assert set(np.diff(offsets)) == {4}
    kept = results["state/incidents"].reshape(len(results["time"]), 4, -1)[first:, :, 10:13]
    # springs that hold m w^2 r between them: as large as this in the axes of the table
    size = np.hypot(kept[0, :, 0], kept[0, :, 1]).mean()
    assert size == pytest.approx(9 * 0.3 / (4 * 2e4), rel=0.5)
    assert np.abs(kept - kept[0]).max() < 1e-12
    turned = np.unwrap(np.arctan2(*results["bodies/2/position"][first:, 1::-1].T))
    assert turned[-1] - turned[0] > 6.2


def test_a_compiled_and_an_interpreted_function_keep_the_same(tmp_path):
    model = pushed(tmp_path, PLUGIN, end=0.6)
    compiled = mbsim.simulate(model)
    interpreted = mbsim.simulate(model, interpret_plugins=True)
    assert compiled.stats["python_calls"] == 0 < interpreted.stats["python_calls"]
    # hypot rounds its last bit otherwise
    np.testing.assert_allclose(compiled["state/y"], interpreted["state/y"], rtol=0, atol=1e-11)
    one = pushed(tmp_path, PLUGIN, end=0.6, across="0")
    compiled, interpreted = mbsim.simulate(one), mbsim.simulate(one, interpret_plugins=True)
    for name in ("state/y", "state/incidents", "contacts/301/force"):
        np.testing.assert_array_equal(compiled[name], interpreted[name])


ONE = """CFFSUB_STATES = 1
def CFFSUB(id, time, par, npar, loci, locj, x, xdot, nforce, dflag, iflag, state):
    {body}
"""


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("return [0.0, 0.0, 0.0]", r"not \(force, new_state\) as CFFSUB_STATES = 1 asks"),
        ("return [0.0, 0.0, 0.0], [1.0, 2.0]", "not 1 finite numbers"),
        ("return [0.0, 0.0, 0.0], [state[0] / 0.0]", "ZeroDivisionError"),
        ("return [0.0, 0.0, 0.0], [inf]", r"returned \[inf\], not 1 finite"),
    ],
)
@pytest.mark.parametrize("interpret", [False, True])
def test_what_a_function_with_states_may_not_return(tmp_path, body, said, interpret):
    (tmp_path / "law.py").write_text(ONE.format(body=body))
    friction = f'cff_type="USERCFF" cff_fnc_name="CFFSUB" script_name="{tmp_path / "law.py"}"'
    with pytest.raises(PluginError, match=said):
        mbsim.simulate(pushed(tmp_path, friction, end=0.1), interpret_plugins=interpret)
    failure.clear()


def test_states_go_with_usercff_alone(tmp_path):
    friction = f'{STICTION} cff_fnc_name="CFFSUB" script_name="{KEEPS}"'
    with pytest.raises(ModelError, match="STICTION has its own memory"):
        mbsim.simulate(pushed(tmp_path, friction))


# -- why X alone cannot do it: the figures of README, "Friction with memory"


def cycle(law, way=1.0, steps=4000):
    """Return work done against a law on the way out and back, and force after the reversal."""
    x, work, after = 0.0, [0.0, 0.0], math.nan
    for leg, sign in enumerate((1.0, -1.0)):
        for k in range(steps):
            # the middle of each part of the way
            x = (k + 0.5) * way / steps if leg == 0 else way - (k + 0.5) * way / steps
            force = law(x, sign)
            work[leg] -= force * sign * way / steps
            if leg == 1 and k == steps // 4:
                after = force
    return work, after


def user_law():
    """Return the shipped function at mu N = 4 N and k = 2e4 N/m as a law of X and direction."""
    names = {"hypot": math.hypot}
    exec(compile(KEEPS.read_text(), str(KEEPS), "exec"), names)
    kept = [0.0] * names["CFFSUB_STATES"]

    def law(x, sign):
        force, kept[:] = names["CFFSUB"](
            1, 0.0, [0.4, 2e4, 0.0], 3, *[[0.0] * 3] * 2, [x, 0.0, 0.0], [sign, 0.0, 0.0],
            10.0, 0, 0, list(kept),
        )  # fmt: skip
        return force[0]

    return law


def test_x_alone_gives_back_what_it_took_and_pushes_along_the_motion():
    work, after = cycle(lambda x, sign: -max(-4.0, min(4.0, 2e4 * x)))
    assert work[0] == pytest.approx(4.0, rel=1e-3)
    assert work[1] == pytest.approx(-4.0, rel=1e-3)
    # it moves towards smaller x and is pushed there
    assert after == -4.0
    work, after = cycle(user_law(), steps=100000)
    assert work[0] == pytest.approx(4.0 - 4.0**2 / 2 / 2e4, rel=1e-6)
    # the spring's 0.4 mJ come back, then it is taken as on the way out
    assert sum(work) == pytest.approx(2 * 4.0 * (1.0 - 4.0 / 2e4), rel=1e-4)
    assert after == 4.0

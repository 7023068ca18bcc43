"""Force_Element: forces by a user's residual, against closed forms, scipy and what is built in."""

from __future__ import annotations

import math
import random

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import mbsim
from helpers.blocks import GROUND, body, spring
from helpers.decks import run_deck, run_in_pieces, write_deck
from helpers.folders import USERFUNCS
from helpers.reference import jenkins_block
from mbsim.errors import DeckError, Interrupted, ModelError, PluginError, SolverError
from mbsim.plugins.residual import load_residual
from mbsim.run import loop

DRY = USERFUNCS / "dry_friction_element.py"

SCRIPT = """
ELEMENT_UNKNOWNS = {
    "maxwell": {"f": 0.0},
    "cubic": ("f",),
    "solid": ("f", "g"),
    "implicit": {"f": {"initial": 0.0, "scale": 2.0}, "z": 0.5},
    "plane": ("fx", "fy", "torque_z"),
    "printing": {"f": 0.0},
}

def maxwell(x, xdot, f, fdot, t, par):
    k, c = par
    return [fdot[0] / k + f[0] / c - xdot[0]]

def printing(x, xdot, f, fdot, t, par):
    f"{t}"
    return maxwell(x, xdot, f, fdot, t, par)

def cubic(x, xdot, f, fdot, t, par):
    a, k, c = par
    return (f[0] + a * f[0] ** 3 - k * x[0] - c * xdot[0],)

def solid(x, xdot, f, fdot, t, par):
    k, stiff, c = par
    return [f[0] - k * x[0] - f[1], fdot[1] - stiff * xdot[0] + f[1] * stiff / c]

def implicit(x, xdot, f, fdot, t, par):
    return [f[0] - 4.0 * f[1] * x[0], fdot[1] + 0.1 * fdot[1] ** 3 + f[1] - 1.0 - 0.2 * f[0]]

def plane(x, xdot, f, fdot, t, par):
    k, across = par
    return [
        f[0] - k * x[0] - across * x[1],
        f[1] - across * x[0] - k * x[1],
        f[2] - 3.0 * x[2] - 0.1 * xdot[2],
    ]
"""


def element(name, par, script, direction="TX", i=20, j=10):
    """Return a Force_Element."""
    return f"""
<Force_Element id="7" i_marker_id="{i}" j_marker_id="{j}" direction="{direction}"
  script_name="{script}" usrsub_fnc_name="{name}" usrsub_param_string="USER({par})"/>"""


@pytest.fixture
def script(tmp_path):
    """Return a script of several residuals."""
    path = tmp_path / "residuals.py"
    path.write_text(SCRIPT, encoding="utf-8")
    return path


def energy(results):
    """Return by how much kinetic, potential and dissipated energy vary."""
    return np.ptp(sum(results[f"energy/{name}"] for name in ("kinetic", "potential", "dissipated")))


def _cubic(y, v):
    return brentq(lambda f: f + 2.0 * f**3 - 10.0 * y - 0.7 * v, -50, 50, xtol=1e-15, rtol=1e-15)


def _slope(y, z):
    miss = z - 1.0 - 0.8 * z * y
    return brentq(lambda d: d + 0.1 * d**3 + miss, -50, 50, xtol=1e-15, rtol=1e-15)


#: Parameters, the slopes of (x, x', inner states), the start, and f.
SMOOTH = {
    "maxwell": (
        "20, 3",
        lambda t, y: [y[1], -4 * y[0] - y[2], 20 * (y[1] - y[2] / 3)],
        [0.0, 1.0, 0.0],
        lambda y: y[2],
    ),
    "cubic": (
        "2, 10, 0.7",
        lambda t, y: [y[1], -4 * y[0] - _cubic(y[0], y[1])],
        [0.0, 1.0],
        lambda y: np.array([_cubic(a, b) for a, b in y.T]),
    ),
    "solid": (
        "3, 20, 3",
        lambda t, y: [y[1], -7 * y[0] - y[2], 20 * y[1] - y[2] * 20 / 3],
        [0.0, 1.0, 0.0],
        lambda y: 3 * y[0] + y[2],
    ),
    "implicit": (
        "",
        lambda t, y: [y[1], -4 * y[0] - 4 * y[2] * y[0], _slope(y[0], y[2])],
        [0.0, 1.0, 0.5],
        lambda y: 4 * y[2] * y[0],
    ),
}


@pytest.mark.parametrize("method", ["DOPRI5", "RADAU5", "GALPHA"])
@pytest.mark.parametrize("name", SMOOTH)
def test_smooth_elements_follow_their_equations(name, method, script, tmp_path):
    par, slopes, start, force = SMOOTH[name]
    model = GROUND + body(2, 1.0, v=1.0) + spring(4.0) + element(name, par, script)
    tol, close = (1e-8, 5e-6) if method == "GALPHA" else (1e-10, 1e-9)
    results = run_deck(tmp_path, model, 4.0, 0.1, integrator=method, tol=tol)
    y = solve_ivp(slopes, (0, 4), start, "DOP853", results["time"], rtol=1e-12, atol=1e-13).y
    x = results["bodies/2/position"][:, 0]
    np.testing.assert_allclose(x, y[0], rtol=0, atol=close)
    found = results["force_elements/7/f"]
    np.testing.assert_allclose(found, force(y), rtol=0, atol=50 * close)
    np.testing.assert_array_equal(results["force_elements/7/force"][:, 0], -found)
    assert energy(results) < 10 * close


def test_a_stiff_maxwell_element_costs_an_implicit_method_little(script, tmp_path):
    # k = 1e6 before c = 100: f' decays within 1e-4 s; then x'' + 100 x' + 4 x = 0
    model = GROUND + body(2, 1.0, v=1.0) + spring(4.0) + element("maxwell", "1e6, 100", script)
    results = run_deck(tmp_path, model, 2.0, 0.1, integrator="RADAU5", tol=1e-6)
    full = solve_ivp(
        lambda t, y: [y[1], -4 * y[0] - y[2], 1e6 * (y[1] - y[2] / 100)],
        (0, 2), [0.0, 1.0, 0.0], "Radau", results["time"], rtol=1e-10, atol=1e-13,
    ).y  # fmt: skip
    np.testing.assert_allclose(results["bodies/2/position"][:, 0], full[0], rtol=0, atol=1e-6)
    # an explicit method may take 3.3/1e4 s at most: 6000 steps
    assert results.stats["steps"] < 1500


def test_what_switches_is_of_first_order_where_it_looks_at_time(tmp_path):
    # the Maxwell element once more, as if it switched: backward Euler, so half the step, half the
    # error
    script = tmp_path / "kind.py"
    declared = 'ELEMENT_UNKNOWNS = {"maxwell": {"f": {"kind": "SWITCHING"}}}'
    script.write_text(SCRIPT.replace("def maxwell", declared + "\ndef maxwell", 1), "utf-8")
    _, slopes, start, _ = SMOOTH["maxwell"]
    y = solve_ivp(slopes, (0, 2), start, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    model = GROUND + body(2, 1.0, v=1.0) + spring(4.0) + element("maxwell", "20, 3", script)
    miss = []
    for h in (0.01, 0.005, 0.0025):
        path = write_deck(tmp_path, model, 2.0, 0.1)
        bound = f'<Param_Transient h_max="{h}"/><Simulate'
        path.write_text(path.read_text("utf-8").replace("<Simulate", bound), encoding="utf-8")
        results = mbsim.simulate(mbsim.read_model(path), integrator="DOPRI5", tol=1e-3)
        miss.append(abs(results["bodies/2/position"][-1, 0] - y[0]))
    assert 1.7 < miss[0] / miss[1] < 2.3
    assert 1.7 < miss[1] / miss[2] < 2.3


@pytest.mark.parametrize("method", ["DOPRI5", "RADAU5"])
def test_forces_along_and_about_turning_axes_conserve_momentum(method, script, tmp_path):
    model = GROUND + body(2, 1.0, w=2.0) + body(3, 2.0, x=0.5, v=0.1, w=0.3)
    model += element("plane", "50, 3", script, "TX TY RZ", 20, 30)
    results = run_deck(tmp_path, model, 1.0, 0.05, integrator=method, tol=1e-9)
    momentum = results["bodies/2/velocity"] + 2.0 * results["bodies/3/velocity"]
    np.testing.assert_allclose(momentum, np.tile([0.2, 0.0, 0.0], (21, 1)), rtol=0, atol=1e-13)
    assert energy(results) < 1e-8
    # along J's own axes they are less the unknowns
    q = results["bodies/3/quaternion"]
    w, x, y, z = q.T
    ex = np.column_stack([1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)])
    force = (results["force_elements/7/force"] * ex).sum(axis=1)
    np.testing.assert_allclose(force, -results["force_elements/7/fx"], rtol=0, atol=1e-12)
    torque = np.linalg.norm(results["force_elements/7/torque"], axis=1)
    wanted = np.abs(results["force_elements/7/torque_z"])
    np.testing.assert_allclose(torque, wanted, rtol=0, atol=1e-12)


@pytest.mark.parametrize("method", ["DOPRI5", "DOP853", "RADAU5", "GALPHA"])
def test_dry_friction_as_an_element_is_what_is_built_in(method, tmp_path):
    dry = '<Force_DryFriction id="7" type="TX" i_marker_id="20" j_marker_id="10" {}/>'
    model = GROUND + body(2, 1.0, v=1.0) + spring(4.0)
    settings = {"integrator": method, "tol": 1e-9}
    own = run_deck(tmp_path, model + element("dry_friction", "1, 0.02", DRY), 3.0, 0.05, **settings)
    built = dry.format('friction="1" dx="0.02"')
    other = run_deck(tmp_path, model + built, 3.0, 0.05, **settings)
    close = 5e-7 if method == "GALPHA" else 5e-9
    for name in ("position", "velocity"):
        found, wanted = own[f"bodies/2/{name}"], other[f"bodies/2/{name}"]
        np.testing.assert_allclose(found, wanted, rtol=0, atol=10 * close)
    force = own["force_elements/7/force"]
    np.testing.assert_allclose(force, other["dry_frictions/7/force"], rtol=0, atol=100 * close)
    assert np.abs(force).max() <= 1.0
    # the spring before the slider gives back what it stores, f^2/(2 k): for a user's element that
    # too counts as dissipated until it does
    assert energy(own) < 10 * close
    assert own.stats["steps"] < 1.3 * other.stats["steps"]


@pytest.mark.parametrize(("method", "close"), [("RADAU5", 1e-8), ("DOPRI5", 1e-7)])
def test_what_sticks_has_the_force_that_holds_it(method, close, tmp_path):
    # no alternating force, which the seed's own scheme shows: the block hums on the spring alone
    model = GROUND + body(2, 1.0, x=0.85) + spring(4.0)
    model += element("dry_friction", "1.0, 1e-3", DRY)
    results = run_deck(tmp_path, model, 12.0, 0.01, integrator=method, tol=1e-9)
    x, f = jenkins_block(results["time"], 4.0, 1.0, 1e-3, 0.85)
    np.testing.assert_allclose(results["bodies/2/position"][:, 0], x, rtol=0, atol=close)
    np.testing.assert_allclose(results["force_elements/7/f"], f, rtol=0, atol=1e4 * close)


def test_no_run_of_the_sweep_in_which_the_seed_cycles_fails(tmp_path):
    chance = random.Random(4)
    script = tmp_path / "driven.py"
    script.write_text(DRY.read_text("utf-8"), encoding="utf-8")
    for _ in range(12):
        friction = 10.0 ** chance.uniform(-2.0, 0.0)
        give, rate = friction * 10.0 ** chance.uniform(-1.0, 0.5), chance.uniform(0.5, 3.0)
        model = (
            GROUND
            + body(2, 3.0, v=1.0)
            + f"""
<Force_Vector_TwoBody id="1" type="ForceOnly" i_marker_id="20" j_floating_marker_id="10"
  ref_marker_id="10" fx_expression="-DX(20,10)-VX(20,10)+SIN({rate!r}*TIME)"
  fy_expression="0" fz_expression="0"/>"""
        )
        both = []
        for text in (
            element("dry_friction", f"{friction!r}, {give!r}", script),
            '<Force_DryFriction id="7" type="TX" i_marker_id="20" j_marker_id="10" '
            f'friction="{friction!r}" dx="{give!r}"/>',
        ):
            run = run_deck(tmp_path, model + text, 16.0, 0.5, integrator="RADAU5", tol=1e-7)
            both.append(run["bodies/2/position"][:, 0])
        np.testing.assert_allclose(*both, rtol=0, atol=1e-5)


def test_compiled_and_interpreted_are_the_same(tmp_path, script):
    for name, par, file in (("dry_friction", "1, 0.02", DRY), ("maxwell", "20, 3", script)):
        model = GROUND + body(2, 1.0, v=1.0) + spring(4.0) + element(name, par, file)
        deck = mbsim.read_model(write_deck(tmp_path, model, 2.0, 0.05))
        (given,) = deck.force_elements.values()
        assert load_residual(given).compiled
        compiled = mbsim.simulate(deck, integrator="DOPRI5")
        interpreted = mbsim.simulate(deck, integrator="DOPRI5", interpret_plugins=True)
        for path in ("bodies/2/position", "force_elements/7/f"):
            np.testing.assert_allclose(compiled[path], interpreted[path], rtol=0, atol=1e-12)
        assert compiled.stats["steps"] == interpreted.stats["steps"]
    model = GROUND + body(2, 1.0, v=1.0) + element("printing", "20, 3", script)
    lines = []
    mbsim.simulate(
        mbsim.read_model(write_deck(tmp_path, model, 0.1)), output=tmp_path / "out"
    ).close()
    lines = (tmp_path / "out" / "deck.log").read_text("utf-8")
    assert "Force_Element[7]: printing of" in lines
    assert "stays interpreted: line 16: " in lines


@pytest.mark.parametrize("method", ["DOPRI5", "RADAU5", "GALPHA"])
@pytest.mark.parametrize(("name", "par"), [("dry_friction", "0.4, 0.02"), ("maxwell", "20, 3")])
def test_resumed_it_is_the_same_run(name, par, method, tmp_path, script, monkeypatch):
    file = DRY if name == "dry_friction" else script
    text = GROUND + body(2, 1.0, x=0.85) + spring(4.0) + element(name, par, file)
    model = mbsim.read_model(write_deck(tmp_path, text, 6.0, 0.1))
    settings = {"integrator": method, "tol": 1e-5}
    straight = mbsim.simulate(model, **settings)
    found = run_in_pieces(model, tmp_path, monkeypatch, **settings)
    for path in straight.keys():
        np.testing.assert_array_equal(found[path], straight[path], err_msg=path)
    found.close()


def test_a_static_simulate_relaxes_a_maxwell_element(tmp_path, script):
    model = GROUND + body(2, 1.0, x=0.05) + spring(10.0) + element("maxwell", "20, 3", script)
    path = write_deck(tmp_path, model)
    text = path.read_text("utf-8")
    path.write_text(
        text.replace("<Command>", '<Command><Simulate analysis_type="Static"/>'), encoding="utf-8"
    )
    results = mbsim.simulate(mbsim.read_model(path), integrator="RADAU5", tol=1e-8)
    np.testing.assert_allclose(results["bodies/2/position"][:, 0], 0.0, rtol=0, atol=1e-9)
    np.testing.assert_allclose(results["force_elements/7/f"], 0.0, rtol=0, atol=1e-8)


WRONG = {
    "no table": ("def bad(x, xdot, f, fdot, t, par):\n    return f", "ELEMENT_UNKNOWNS is missing"),
    "no entry": ("ELEMENT_UNKNOWNS = {}\ndef bad(x, v, f, g, t, p):\n    return f", "has no 'b"),
    "no names": (
        "ELEMENT_UNKNOWNS = {'bad': 3}\ndef bad(x, v, f, g, t, p):\n    return f",
        r"ELEMENT_UNKNOWNS\['bad'\] = 3: must be names",
    ),
    "too few": (
        "ELEMENT_UNKNOWNS = {'bad': {}}\ndef bad(x, v, f, g, t, p):\n    return f",
        "has 0 unknowns: must be 1 to 12",
    ),
    "nan": (
        "ELEMENT_UNKNOWNS = {'bad': {'f': float('nan')}}\ndef bad(x, v, f, g, t, p):\n    return f",
        "must begin at a finite number",
    ),
    "kind": (
        "ELEMENT_UNKNOWNS = {'bad': {'f': {'kind': 'STATE'}}}\n"
        "def bad(x, v, f, g, t, p):\n    return f",
        "kind must be one of ALGEBRAIC, DIFFERENTIAL, SWITCHING",
    ),
    "scale": (
        "ELEMENT_UNKNOWNS = {'bad': {'f': {'scale': 0}}}\ndef bad(x, v, f, g, t, p):\n    return f",
        "scale must be a number > 0",
    ),
    "word": (
        "ELEMENT_UNKNOWNS = {'bad': {'f': {'ic': 0}}}\ndef bad(x, v, f, g, t, p):\n    return f",
        "must be a number, or have initial, scale, kind alone",
    ),
    "arguments": (
        "ELEMENT_UNKNOWNS = {'bad': ('f',)}\ndef bad(x, v, f):\n    return f",
        "cannot be called with the 6 arguments",
    ),
    "declared": (
        "ELEMENT_UNKNOWNS = {'bad': {'f': {'kind': 'ALGEBRAIC'}}}\n"
        "def bad(x, v, f, g, t, p):\n    return [g[0] + f[0] - v[0]]",
        "f is declared ALGEBRAIC, but asked at many points the residual is DIFFERENTIAL in it",
    ),
    "count": (
        "ELEMENT_UNKNOWNS = {'bad': ('f',)}\ndef bad(x, v, f, g, t, p):\n    return [1.0, 2.0]",
        "fails wherever it is asked: returned 2 values",
    ),
    "number": (
        "ELEMENT_UNKNOWNS = {'bad': ('f',)}\ndef bad(x, v, f, g, t, p):\n    return f[0]",
        "fails wherever it is asked: returned 0.0, not 1 finite numbers",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_script_is_one_clear_error(case, tmp_path):
    text, said = WRONG[case]
    script = tmp_path / "bad.py"
    script.write_text(text, encoding="utf-8")
    deck = write_deck(tmp_path, GROUND + body(2, 1.0) + element("bad", "", script))
    with pytest.raises(ModelError, match=said) as error:
        mbsim.simulate(mbsim.read_model(deck))
    assert str(error.value).startswith(f"{deck}:")
    assert "Force_Element[7]: " in str(error.value)
    assert "\n" not in str(error.value)


def test_a_residual_that_raises_on_its_way_says_where(tmp_path):
    script = tmp_path / "late.py"
    script.write_text(
        "ELEMENT_UNKNOWNS = {'late': ('f',)}\n"
        "def late(x, v, f, g, t, p):\n    return [f[0] - sqrt(0.5 - t) * x[0]]",
        encoding="utf-8",
    )
    model = GROUND + body(2, 1.0, v=1.0) + element("late", "", script)
    for interpret in (False, True):
        with pytest.raises(PluginError, match=r"Force_Element\[7\]: late failed at time 0.5.*dom"):
            mbsim.simulate(
                mbsim.read_model(write_deck(tmp_path, model)), interpret_plugins=interpret
            )


def test_a_residual_without_a_zero_ends_the_run(tmp_path):
    script = tmp_path / "never.py"
    script.write_text(
        "ELEMENT_UNKNOWNS = {'never': ('f',)}\n"
        "def never(x, v, f, g, t, p):\n    return [1.0 + f[0] ** 2 - (2.0 if t < 0.3 else 0.0)]",
        encoding="utf-8",
    )
    model = GROUND + body(2, 1.0, v=1.0) + element("never", "", script)
    with pytest.raises(SolverError, match=r"Force_Element\[7\]: no unknowns \(f: algebraic\)"):
        mbsim.simulate(mbsim.read_model(write_deck(tmp_path, model)))


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('direction="TX"', "", "direction: missing; must be one or more of TX, TY"),
        ('direction="TX"', 'direction="TX TX"', 'direction="TX TX": must be one or more of'),
        ('direction="TX"', 'direction="UX"', 'direction="UX": must be one or more of TX, TY, TZ'),
        ('j_marker_id="10"', "", "j_marker_id: missing"),
        ('j_marker_id="10"', 'j_marker_id="99"', "j_marker_id"),
        ('script_name="', 'script_name="no/', "no such file"),
        ('script_name="', 'usrsub_language="C" script_name="', 'usrsub_language="C": is of a'),
    ],
)
def test_what_a_deck_may_not_say(old, new, said, tmp_path):
    text = GROUND + body(2, 1.0) + element("dry_friction", "1, 1", DRY)
    assert text.count(old) == 1 or old.startswith("j_")
    head, tail = text.split("<Force_Element")
    path = write_deck(tmp_path, head + "<Force_Element" + tail.replace(old, new))
    with pytest.raises(DeckError) as error:
        mbsim.read_model(path)
    assert said in str(error.value)
    assert "Force_Element[7]" in str(error.value)


def test_verlet_refuses_it(tmp_path):
    path = write_deck(tmp_path, GROUND + body(2, 1.0) + element("dry_friction", "1, 1", DRY))
    with pytest.raises(ModelError, match=r"Force_Element\[7\]: integrator VERLET is for forces of"):
        mbsim.simulate(mbsim.read_model(path), integrator="VERLET")


def test_a_residual_may_come_from_a_plugin_file(tmp_path):
    text = GROUND + body(2, 1.0, v=1.0) + element("dry_friction", "1, 0.02", DRY)
    named = run_deck(tmp_path, text, 0.5)
    without = text.replace(f'script_name="{DRY}"', "")
    model = mbsim.read_model(write_deck(tmp_path, without, 0.5))
    with pytest.raises(ModelError, match='"dry_friction" names no file'):
        mbsim.simulate(model)
    found = mbsim.simulate(model, plugins=[DRY])
    np.testing.assert_array_equal(found["bodies/2/position"], named["bodies/2/position"])


def test_friction_about_an_axis_stops_a_spin(tmp_path):
    # 0.1 kg m2 under 0.2 N m
    model = GROUND + body(2, 1.0, w=3.0) + element("dry_friction", "0.2, 1e-3", DRY, "RX")
    results = run_deck(tmp_path, model, 2.0, 0.01, integrator="DOPRI5", tol=1e-8)
    t, w = results["time"], results["bodies/2/angular_velocity"][:, 0]
    slides = (t > 0.1) & (t < 1.49)
    np.testing.assert_allclose(w[slides] + 2.0 * t[slides], (w + 2.0 * t)[slides][0], atol=1e-9)
    assert np.abs(w[t > 1.51]).max() < math.sqrt(0.2 * 1e-3 / 0.1) * 1.001


def test_a_run_goes_on_with_the_script_with_which_it_began(tmp_path, monkeypatch):
    monkeypatch.setattr("mbsim.run.divergence.RETURN_SECONDS", 1e-6)
    monkeypatch.setattr(loop, "FIRST_BUDGET", 7)
    script = tmp_path / "mine.py"
    script.write_text(DRY.read_text("utf-8"), encoding="utf-8")
    text = GROUND + body(2, 1.0, v=1.0) + spring(4.0) + element("dry_friction", "1, 0.02", script)
    model = mbsim.read_model(write_deck(tmp_path, text, 6.0, 0.1))

    def stop(time, step, until):
        raise Interrupted("enough")

    with pytest.raises(Interrupted):
        mbsim.simulate(model, output=tmp_path, progress=stop)
    script.write_text(script.read_text("utf-8") + "# changed\n", encoding="utf-8")
    with pytest.raises(ModelError, match="a user subroutine has changed"):
        mbsim.simulate(model, output=tmp_path, resume=True)


MODES = """ELEMENT_UNKNOWNS = {{"law": {{"f": 0.0}}}}


def law(x, xdot, f, fdot, t, par):
    limit, soft = par[0], par[1]
    stick = xdot[0] - soft*fdot[0]
    slip = abs(f[0])/limit - 1
{body}
"""
#: Stick or slip told apart by which of the two residuals is smaller, by the size of f, by a sign.
JUMPING = {
    "smaller": "    return [slip if abs(slip) < abs(stick) else stick]",
    "size": "    return [slip if abs(f[0]) > limit else stick]",
    "product": "    return [stick if f[0]*fdot[0] < 0 else f[0] - limit]",
    "sign": "    return [f[0] - limit*copysign(1.0, fdot[0] - xdot[0])]",
}


@pytest.mark.parametrize("name", JUMPING)
@pytest.mark.parametrize("values", ["0.1,3", "2e4,1e-6", "1e-3,1"])
def test_a_residual_that_jumps_is_refused(tmp_path, name, values):
    (tmp_path / "modes.py").write_text(MODES.format(body=JUMPING[name]))
    model = GROUND + body(2, 1.0, v=1.0) + element("law", values, "modes.py")
    with pytest.raises(ModelError, match=r"jumps from .* where f'? passes .* must be continuous"):
        run_deck(tmp_path, model, 1e-3, 1e-3)


@pytest.mark.parametrize(
    "line",
    [
        "    return [f[0] - limit*copysign(1.0, xdot[0])]",
        "    return [f[0] - limit*(xdot[0]/abs(xdot[0]) if xdot[0] else 0.0)]",
        "    return [f[0] - (limit if xdot[0] > 0.5 else 0.0)]",
        "    v = xdot[0]\n    return [f[0] - limit*(v/0.1 if abs(v) < 0.1 else copysign(1.5, v))]",
    ],
)
def test_a_force_that_jumps_with_the_rate_is_refused(tmp_path, line):
    (tmp_path / "modes.py").write_text(MODES.format(body=line))
    model = GROUND + body(2, 1.0, v=1.0) + element("law", "3,1", "modes.py")
    with pytest.raises(ModelError, match=r"jumps from .* where x' passes .* F tanh"):
        run_deck(tmp_path, model, 1e-3, 1e-3)


@pytest.mark.parametrize(
    "line",
    [
        "    return [f[0] - max(-limit, min(limit, f[0] + limit*stick))]",
        "    return [sqrt(abs(f[0]))*f[0] + soft*fdot[0] - xdot[0]]",
        "    return [f[0] - limit*tanh(1e4*xdot[0])]",
        "    return [fdot[0] - 1e6*abs(xdot[0])*(1 - f[0]/limit*copysign(1.0, xdot[0]))]",
    ],
)
@pytest.mark.parametrize("values", ["0.1,3", "2e4,1e-6", "1e-3,1"])
def test_branches_and_steep_residuals_are_taken(tmp_path, line, values):
    (tmp_path / "modes.py").write_text(MODES.format(body=line))
    model = GROUND + body(2, 1.0, v=1.0) + element("law", values, "modes.py")
    deck = mbsim.read_model(write_deck(tmp_path, model))
    (given,) = deck.force_elements.values()
    assert load_residual(given, interpret=True).name == "law"

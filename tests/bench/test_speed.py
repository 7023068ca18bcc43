"""Measurements, printed and never judged: python -m pytest -m bench -s tests/bench"""

from __future__ import annotations

import statistics
import subprocess
import sys
import time

import numpy as np
import pytest

import mbsim
from helpers.decks import COULOMB, GRAVITY, GROUND, contact, sphere, write_deck
from helpers.folders import MODELS, USERFUNCS
from mbsim.core.address import call_int
from mbsim.core.jitable import jitable
from mbsim.laws.constants import normal_constants

pytestmark = pytest.mark.bench
CLI = [sys.executable, "-c", "from mbsim.cli.main import main; main()"]
LAWS = {
    "COULOMB_ON": COULOMB,
    "compiled CFFSUB": {
        "cff_type": "USERCFF",
        "cff_param_string": "USER(0.3,0.2,0.01,0.02)",
        "cff_fnc_name": "CFFSUB",
        "script_name": str(USERFUNCS / "coulomb_stribeck.py"),
    },
    "no friction": {},
}


@pytest.mark.parametrize("law", list(LAWS))
def test_cost_of_an_evaluation(tmp_path, law):
    # sliding, bouncing sphere: 2 m fall, k = 1e5
    model = (
        GROUND
        + sphere(2.1, v=(2.0, 0, 0))
        + contact(stiffness=1e5, damping=50, dmax=1e-3, **LAWS[law])
        + GRAVITY
    )
    deck = mbsim.read_model(write_deck(tmp_path, model, end_time=3.0))
    costs = []
    for _ in range(6):
        stats = mbsim.simulate(deck, tol=1e-11).stats
        count = stats["rhs_evaluations"] + stats["output_evaluations"]
        costs.append(1e9 * stats["loop_s"] / count)
    print(f"\n{law}: {statistics.median(costs[1:]):.0f} ns an evaluation, all included")
    assert np.isfinite(costs).all()


def test_whole_runs(tmp_path):
    commands = {
        "--help": ["--help"],
        "check": ["check", MODELS / "bowling_ball.xml"],
        "run bowling_ball": ["run", MODELS / "bowling_ball.xml", "-o", tmp_path / "out"],
    }
    print()
    for name, arguments in commands.items():
        times = []
        for _ in range(6):
            began = time.perf_counter()
            done = subprocess.run([*CLI, *map(str, arguments)], capture_output=True)
            times.append(time.perf_counter() - began)
            assert done.returncode == 0
        print(f"{name}: {statistics.median(times[1:]):.2f} s")


NORMAL = {
    "IMPACT": {"stiffness": 1e5, "exponent": 1.5, "damping": 50.0, "dmax": 1e-3},
    "IMPACT, exponent 2.2": {"stiffness": 1e5, "exponent": 2.2, "damping": 50.0, "dmax": 1e-3},
    "HUNT_CROSSLEY": {"stiffness": 1e5, "exponent": 1.5, "damping": 0.5},
    "HERTZ": {"stiffness": 1e5, "damping": 0.5},
    "POISSON": {"penalty": 1e5, "restitution_coef": 0.5},
}


def test_calls_of_normal_laws():
    from mbsim.core import jit
    from mbsim.laws import abi
    from mbsim.laws.catalog import NORMAL_LAWS
    from mbsim.model.elements import Contact

    def loop(address, depths, rate, par, out):
        total = 0.0
        for depth in depths:
            call_int(address, (depth, rate, par, out))
            total += out[0] + out[2]
        return total

    run = jit.function(loop)
    depths, out = np.random.default_rng(1).uniform(0.0, 2e-3, 1_000_000), np.zeros(3)
    print()
    for name, values in NORMAL.items():
        kind = name.split(",")[0]
        law = NORMAL_LAWS[kind]
        par = normal_constants(law, Contact(id=1, cnf_type=kind, **values))
        times = []
        for _ in range(6):
            began = time.perf_counter()
            total = run(abi.normal_address(law), depths, 0.3, par, out)
            times.append(1e9 * (time.perf_counter() - began) / len(depths))
        print(f"{name}: {statistics.median(times[1:]):.1f} ns a call")
        assert total > 0.0


def test_calls_of_friction_laws():
    from mbsim.core import jit
    from mbsim.core.address import call_int
    from mbsim.laws import abi
    from mbsim.laws.catalog import FRICTION_LAWS
    from mbsim.laws.slip_test import USUAL

    def loop(address, speeds, given, par, out):
        total = 0.0
        for speed in speeds:
            given[5] = speed
            call_int(address, (1, given, par, out))
            total += out[0]
        return total

    run = jit.function(loop)
    speeds, out = np.random.default_rng(1).uniform(0.0, 2e-2, 1_000_000), np.zeros(40)
    given = np.zeros(40)
    given[7], given[10], given[21], given[22], given[23] = 0.1, 10.0, 1e4, 1.0, np.nan
    print()
    for name in FRICTION_LAWS:
        law = FRICTION_LAWS[name]
        own = {each.name: each.default for each in law.own} | USUAL
        par = np.array([own[each] for each in law.parameters])
        address, times = abi.friction_address(law), []
        for _ in range(6):
            began = time.perf_counter()
            total = run(address, speeds, given, par, out)
            times.append(1e9 * (time.perf_counter() - began) / len(speeds))
        print(f"{name}: {statistics.median(times[1:]):.1f} ns a call")
        assert total < 0.0 or law.memory > 0


def test_cost_of_a_block_that_is_held(tmp_path):
    """STICTION against friction over slip velocity by STEP, on 20 degrees for 110 s."""
    text = (MODELS / "stiction_incline.xml").read_text()
    step = 'cff_type="COULOMB_ON" stiction_trans_vel="1e-3" friction_trans_vel="2e-3"'
    assert 'cff_type="STICTION"' in text
    (tmp_path / "step.xml").write_text(text.replace('cff_type="STICTION"', step))
    for tol in (1e-5, 1e-7):
        for deck in (MODELS / "stiction_incline.xml", tmp_path / "step.xml"):
            model = mbsim.read_model(deck)
            runs = [mbsim.simulate(model, tol=tol) for _ in range(6)]
            p = runs[-1]["bodies/2/position"][runs[-1]["time"] >= 10.0]
            loop = statistics.median(float(run.stats["loop_s"]) for run in runs[1:])
            print(
                f"\n{deck.stem}, tol {tol:g}: loop {1e3 * loop:.2f} ms, "
                f"moves {np.abs(p - p[0]).max():.1e} m from 10 to 110 s"
            )
            assert np.isfinite(p).all()


@jitable
def _call(address, given, par, out):
    return call_int(address, (1, given, par, out))


def _calls(address, given, par, out, count):
    for _ in range(count):
        _call(address, given, par, out)


def ns_a_call(user, count):
    """Return the median time of a call of a friction function from compiled code [ns]."""
    from mbsim.core import jit
    from mbsim.laws.abi import FRICTION_INPUTS

    run, given, out = jit.function(_calls), np.zeros(FRICTION_INPUTS), np.zeros(5)
    given[5], given[10] = 0.3, 50.0
    run(user.address, given, user.row, out, 10)
    times = []
    for _ in range(7):
        began = time.perf_counter()
        run(user.address, given, user.row, out, count)
        times.append(1e9 * (time.perf_counter() - began) / count)
    return statistics.median(times)


@pytest.mark.parametrize("source", ["cffsub.c", "cffsub.f90"])
def test_calls_of_libraries(tmp_path, source):
    from helpers.libraries import example
    from mbsim.plugins import load_friction

    deck = mbsim.read_model(MODELS / "seed_contact.xml")
    user = load_friction(deck.contacts[301001], [example(tmp_path, source)])
    cost = ns_a_call(user, 1_000_000)
    print(f"\n{user.language}: {cost:.1f} ns a call, its body included")
    assert cost > 0


def test_calls_of_user_subroutines():
    from mbsim.plugins import load_friction

    deck = mbsim.read_model(MODELS / "bowling_ball.xml")
    print()
    for interpret, count in ((False, 1_000_000), (True, 100_000)):
        user = load_friction(deck.contacts[301], (), interpret)
        cost, bodies = 1e-9 * ns_a_call(user, count), []
        zero = [0.0, 0.0, 0.0]
        for _ in range(5):
            began = time.perf_counter()
            for _ in range(20_000):
                user.function(
                    1, 0.0, [0.2, 0.2, 0.02, 0.02], 4, zero, zero, zero, [0.3, 0.0, 0.0], 50.0, 0, 0
                )
            bodies.append((time.perf_counter() - began) / 20_000)
        kind = "interpreted" if interpret else "compiled"
        body = statistics.median(bodies) if interpret else 0.0
        print(f"{kind}: {1e9 * cost:.0f} ns a call, {1e9 * (cost - body):.0f} ns above its body")
        assert cost > 0


def test_calls_by_octave():
    from helpers.libraries import need
    from mbsim.plugins import load_friction
    from mbsim.plugins.subroutine import end_run

    need("octave-cli")
    deck = mbsim.read_model(MODELS / "seed_contact.xml")
    user = load_friction(deck.contacts[301001], [USERFUNCS / "CFFSUB.m"])
    cost = ns_a_call(user, 2_000)
    end_run()
    print(f"\n{user.language}: {1e-3 * cost:.0f} us a call, its body included")
    assert cost > 0


@jitable
def _normal_calls(address, par, out, count):
    for _ in range(count):
        call_int(address, (1e-3, 0.1, par, out))


@pytest.mark.parametrize("how", ["cnfsub.c", "cnfsub.f90", "compiled", "interpreted"])
def test_calls_of_users_normal_laws(tmp_path, how):
    from helpers.libraries import example
    from mbsim.core import jit
    from mbsim.laws import user_normal
    from mbsim.model.elements import Contact, Subroutine
    from mbsim.plugins.normal import load_normal

    file = example(tmp_path, how) if "." in how else USERFUNCS / "cnfsub.py"
    par = Subroutine((1e5, 1.5, 0.4), "CNFSUB")
    user = load_normal(Contact(1, cnf=par), [file], how == "interpreted", {}, print)
    user.inputs[user_normal.MODE] = user_normal.EVALUATE
    run, out, count = jit.function(_normal_calls), np.zeros(3), 200_000
    times = []
    for _ in range(7):
        began = time.perf_counter()
        run(user.address, user.row, out, count)
        times.append(1e9 * (time.perf_counter() - began) / count)
    print(f"\nCNFSUB {user.how}: {statistics.median(times):.1f} ns a call, its body included")
    assert out[0] > 0.0

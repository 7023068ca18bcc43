"""Errors of decks of `models/` against their references, as the manual lists them.

python -m pytest -m bench -s tests/bench/test_model_errors.py
"""

from __future__ import annotations

import re

import numpy as np
import pytest

import mbsim
from helpers.decks import run_model
from helpers.folders import MODELS
from helpers.reference import (
    Governor,
    elastic_stop,
    flat_follower,
    four_bar_on_stop,
    geneva_wheel,
    hopping_follower,
    jenkins_block,
    loose_slider,
    roller_follower,
)

pytestmark = pytest.mark.bench
TOLS = (1e-5, 1e-9, 1e-12)


def about_z(results, body):
    q = results[f"bodies/{body}/quaternion"]
    return np.unwrap(2 * np.arctan2(q[:, 3], q[:, 0]))


def far(a, b):
    return float(np.abs(a - b).max())


def cam(results):
    t, w = results["time"], 20 * np.pi
    lift, rate = flat_follower(t, w, 0.01, 0.5, 2000.0, 100.0, 1e7, 900.0, 0.024987536 - 0.025)
    top = 0.01 * (1 - np.cos(w * t))
    force = 1e7 * (top - lift) + 900.0 * (0.01 * w * np.sin(w * t) - rate)
    found = results["contacts/301/force/z"]
    depth = far(results["bodies/3/position/z"] - 0.025, lift) / np.abs(top - lift).max()
    return {"force": far(found, force) / force.max(), "depth": depth}


def cam_roller(results):
    t, law, friction = results["time"], (1e9, 1.5, 900.0, 1e-7), (0.1, 0.01)
    sizes = (20 * np.pi, 0.01, 0.03, 0.01, 0.5, 5e-6, 2000.0, 2000 * (0.03 + 0.25 - 0.23))
    height, spin, forces = roller_follower(t, *sizes, law, friction, 0.0299757)
    found = results["contacts/301/force/z"]
    return {
        "height": far(results["bodies/4/position/z"], height),
        "spin": far(results["bodies/4/angular_velocity/y"], spin) / np.abs(spin).max(),
        "force": far(found, forces[:, 2]) / forces[:, 0].max(),
    }


def cam_hops(results):
    law = (1e7, 1.0, 900.0, 1e-7)
    start = 0.024987536 - 0.025
    lift, _ = hopping_follower(results["time"], 204.3, 0.01, 0.5, 2000.0, 100.0, law, start)
    return {"lift over stroke": far(results["bodies/3/position/z"] - 0.025, lift) / 0.02}


def governor(results):
    exact = Governor().solve(results["time"])
    p = results["bodies/4/position"]
    turn = np.unwrap(np.arctan2(p[:, 1], p[:, 0]))
    return {"slider": far(results["bodies/3/position/z"], exact[1]), "shaft": far(turn, exact[4])}


def four_bar_stop(results):
    spring = (np.array([-0.1, 0.15]), 400.0, 0.15, 2.0)
    wall = (np.array([0.16, 0.0]), np.array([1.0, 0.0]), 0.02)
    bars, masses, law = (0.1, 0.3, 0.2), (0.5, 1.0, 0.8), (1e6, 1.5, 200.0, 1e-4)
    t, p = results["time"], results["bodies/2/position"]
    exact, _ = four_bar_on_stop(t, np.pi / 3, bars, masses, 0.3, spring, wall, law)
    return {"crank": far(np.arctan2(p[:, 2], p[:, 0]), exact)}


def geneva(results):
    t, a, r = results["time"], 0.1, 0.1 / np.sqrt(2)
    walls, law = (0.023, r, 0.00505, 0.006), (1e8, 1.5, 300.0, 1e-5)
    angle = about_z(results, 3)
    exact = geneva_wheel(t, 2 * np.pi, a, (r, 0.005), walls, 5e-4, 0.1, law)
    crank = np.mod(2 * np.pi * t + np.pi / 2, 2 * np.pi) - np.pi
    across, along = r * np.sin(crank), a - r * np.cos(crank)
    rigid = np.arctan2(across, along) + np.pi / 4 + np.floor(t + 1e-12) * np.pi / 2
    off = np.abs(angle - rigid) * np.hypot(across, along)
    rest = np.abs(angle - (np.floor(t) + 1) * np.pi / 2)[np.mod(t, 1.0) > 0.42]
    return {
        "law": far(angle, exact),
        "closed form at the pin": float(off[np.abs(crank) < np.pi / 4].max()),
        "at rest": float(rest.max()),
    }


def sdnd101(results, bodies=(2, 3, 4, 5)):
    exact, _ = elastic_stop(results["time"], 100.0, 1e4, 1e6, 0.0, v=1.0)
    swing = np.abs(exact).max()
    return {f"body {b}": far(results[f"bodies/{b}/position/x"], exact) / swing for b in bodies}


def sdnd121(results):
    w = 2 * np.pi * 5
    exact, _ = elastic_stop(results["time"], 156.0, 2e6, 1e10, 1e-3, push=3000.0, frequency=w)
    return {"swing": far(results["bodies/2/position/x"], exact) / np.abs(exact).max()}


def clearance(results):
    *_, place = loose_slider(results["time"], (1e7, 0.4, 0.01), mu=0.01, slip=0.05)
    apart = np.abs(results["bodies/4/position"][:, :2] - place).max(axis=1)
    early = results["time"] <= 0.04
    return {"to 0.04 s": float(apart[early].max()), "to the end": float(apart.max())}


CASES = [
    ("cam.xml", cam, {}),
    ("cam_roller.xml", cam_roller, {}),
    ("cam.xml", cam_hops, {"overrides": ["Motion_Joint[1].expr=204.3*TIME"], "end_time": 0.15}),
    ("flyball_governor.xml", governor, {}),
    ("four_bar_stop.xml", four_bar_stop, {}),
    ("geneva.xml", geneva, {"end_time": 2.0}),
    ("sdnd101.xml", sdnd101, {}),
    ("sdnd121.xml", sdnd121, {}),
    ("slider_crank_clearance.xml", clearance, {}),
]


def show(name, tol, results, errors):
    text = ", ".join(f"{key} {value:.1e}" for key, value in errors.items())
    steps, wall = results.stats["steps"], results.stats["wall_s"]
    print(f"\n{name} tol {tol:.0e}: {text}; {steps} steps, {wall:.2f} s", end="")
    assert max(errors.values()) < 1.0


@pytest.mark.parametrize(("name", "errors", "settings"), CASES)
def test_errors_of_decks(name, errors, settings):
    for tol in TOLS:
        results = run_model(name, tol=tol, **settings)
        show(f"{name} {errors.__name__}", tol, results, errors(results))


def test_errors_of_each_stop_alone(tmp_path):
    head, *stops = re.split(r"(?=\n    <!-- )", (MODELS / "sdnd101.xml").read_text("utf-8"))
    tail = stops[-1][stops[-1].index("  </Model>") :]
    for body, stop in enumerate(stops, 2):
        deck = tmp_path / "stop.xml"
        deck.write_text(head + stop.split("  </Model>")[0] + tail, encoding="utf-8")
        for tol in TOLS:
            results = mbsim.simulate(mbsim.read_model(deck), tol=tol)
            show("sdnd101 alone", tol, results, sdnd101(results, [body]))


def test_errors_of_dry_friction_built_in_and_as_an_element():
    for tol in (1e-5, 1e-7):
        for method in ("AUTO", "RADAU5", "GALPHA"):
            results = run_model("dry_friction_element.xml", tol=tol, integrator=method)
            x, _ = jenkins_block(results["time"], 1e4, 1.0, 1e-6, 8.5e-4)
            built_in, own = (results[f"bodies/{id}/position"][:, 0] for id in (2, 3))
            found = {"built in": built_in - x, "own": own - x, "apart": own - built_in}
            of_swing = {name: np.abs(miss).max() / 8.5e-4 for name, miss in found.items()}
            show(f"dry_friction_element {method}", tol, results, of_swing)


def test_errors_of_friction_that_holds():
    for tol in (1e-5, 1e-7):
        results = run_model("sdnd100.xml", tol=tol)
        x = results["bodies/2/position"][-1, 0] * np.sqrt(2.0)
        show("sdnd100", tol, results, {"of the swing": abs(x - 5e-5) / 0.85e-3})
        results = run_model("stiction_rigid.xml", tol=tol)
        x = results["bodies/2/position"][-1, 0] * np.sqrt(2.0)
        show("stiction_rigid", tol, results, {"of the swing": abs(x - 5e-5) / 0.85e-3})
        results = run_model("stiction_incline.xml", tol=tol)
        x = results["bodies/2/position"][results["time"] >= 10.0]
        show("stiction_incline", tol, results, {"moves from 10 to 110 s": np.abs(x - x[0]).max()})
        results = run_model("lugre_stick_slip.xml", tol=tol)
        x = results["bodies/2/position"][results["time"] > 20.0 - 1e-9][0, 0]
        show("lugre_stick_slip", tol, results, {"at 20 s": abs(x - 1.272596)})
        belts = ("belt_stick_slip", 8.902605407814523, 1.0385164807)
        for name, period, farthest in (belts, ("belt_weakening", 12.001031295, 1.133943658)):
            results = run_model(f"{name}.xml", tol=tol)
            slips = np.array([float(row[0]) for row in results["events"] if row[1] == "slip"])
            # the last point of each slip that follows a long stick
            last = slips[np.append(np.diff(slips) > 0.1, True)]
            begins = last[np.diff(last, prepend=-10.0) > 5.0][1:]
            found = results["bodies/2/position"][:, 0].max()
            errors = {"period": np.abs(np.diff(begins) / period - 1.0).max()}
            show(name, tol, results, errors | {"farthest": abs(found / farthest - 1.0)})

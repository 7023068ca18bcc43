"""Errors against outside truth, printed.

python -m pytest -m bench -s tests/bench/test_accuracy.py
"""

from __future__ import annotations

import functools
from itertools import pairwise

import numpy as np
import pytest

from helpers.decks import GROUND, contact, run_deck, run_model, sphere
from helpers.folders import USERFUNCS
from helpers.reference import RESTITUTION, angle_between, rotation_matrices, top_attitude
from mbsim.integrators.catalog import SCHEMES, load

pytestmark = pytest.mark.bench


def test_against_closed_forms(tmp_path):
    print()
    for damping, rebound, _, _ in RESTITUTION:
        for tol in (1e-5, 1e-8):
            model = GROUND + sphere(0.2, v=(0, 0, -1.0)) + contact(damping=damping, dmax=1e-3)
            v = run_deck(tmp_path, model, end_time=0.5, tol=tol)["bodies/2/velocity/z"][-1]
            print(f"restitution, c = {damping:g}, tol {tol:g}: error {v - rebound:.1e}")
    ball = run_model("bowling_ball.xml", print_interval=1e-4)
    t, v, w = ball["time"], ball["bodies/2/velocity/x"], ball["bodies/2/angular_velocity/y"]
    rolls = t[np.argmax(np.abs(v - 0.108 * w) < 5e-3)]
    print(
        f"bowling ball: speed {v[-1] / (25 / 7) - 1:.1e}, time {rolls / 0.72812 - 1:.1e} relative"
    )
    creep = run_model("incline_creep.xml")
    t, x = creep["time"], creep["bodies/2/position/x"]
    late = t >= 2.0 - 1e-9
    speeds = np.diff(x[late]) / np.diff(t[late]) / 1e-3
    steps, rejected = creep.stats["steps"], creep.stats["rejected"]
    print(
        f"creep v/vs {speeds.min():.6f} to {speeds.max():.6f}, {steps} steps, {rejected} rejected"
    )
    pair = run_model("sphere_pair.xml")
    touch, leave = pair["events"]["time"]
    force = pair["contacts/301/peak_force"] / 10696.889 - 1
    print(f"Hertz: force {force:.1e}, duration {(leave - touch) / 4.0339456e-5 - 1:.1e} relative")
    top = run_model("free_top.xml", tol=1e-11)
    R = rotation_matrices(top["bodies/2/quaternion"])
    local = np.einsum("nji,nj->ni", R, top["bodies/2/angular_velocity"])
    L = np.einsum("nij,nj->ni", R, local @ np.diag([0.010, 0.020, 0.025]))
    drift = np.abs(L - L[0]).max() / np.linalg.norm(L[0])
    energy = np.abs(top["energy/kinetic"] / top["energy/kinetic"][0] - 1).max()
    print(f"top at tol 1e-11: angular momentum {drift:.1e}, energy {energy:.1e}")
    metres, millimetres = run_model("drop_m.xml"), run_model("drop_mm.xml")
    apart = np.abs(metres["bodies/2/position"] - millimetres["bodies/2/position"] / 1000).max()
    print(
        f"m and mm: {metres.stats['steps']} and {millimetres.stats['steps']} steps, {apart:.1e} m"
    )
    assert np.isfinite([drift, energy, apart]).all()


def _cost(results_of, error_of):
    """Print error, steps, evaluations and time of the loop, best of 5, of both methods."""
    for method in (name for name in SCHEMES if load(name).order > 0.0):
        for tol in 10.0 ** -np.arange(4, 15):
            runs = [results_of(tol=tol, integrator=method) for _ in range(6)][1:]
            error, stats = error_of(runs[0]), runs[0].stats
            time = 1e3 * min(run.stats["loop_s"] for run in runs)
            print(
                f"{method} tol {tol:.0e}: error {error:.1e}, {stats['steps']} steps, "
                f"{stats['rhs_evaluations']} evaluations, {time:.2f} ms"
            )
            assert np.isfinite(error)


def test_run_time_against_error_of_tops():
    for scene, w0, end, parts in (
        ("S1", (0.01, 10, 0.02), 10.0, 300),
        ("S10c", (1, 1000, 1), 1.0, 3000),
    ):
        exact = top_attitude((0.010, 0.020, 0.025), w0, end, parts)
        spin = [f"Body_Rigid[2].w_ic_{axis}={w}" for axis, w in zip("xyz", w0, strict=True)]
        settings = {"overrides": spin, "end_time": end, "print_interval": end}
        print(f"\n{scene}: angle [rad] of the attitude at {end:g} s")
        _cost(
            functools.partial(run_model, "free_top.xml", **settings),
            lambda run, exact=exact: angle_between(run["bodies/2/quaternion"][-1], exact),
        )


def test_run_time_against_error_of_a_bouncing_sphere():
    # the two methods agree to 1e-11; references.json is exact to 1.2e-8
    exact = run_model("bouncing_sphere.xml", tol=1e-14)["bodies/2/position/z"]
    print("\nS2a: largest error of z [m] in 301 samples of 3 s, against DOPRI5 at 1e-14")
    _cost(
        functools.partial(run_model, "bouncing_sphere.xml"),
        lambda run: np.abs(run["bodies/2/position/z"] - exact).max(),
    )


def test_error_over_tolerance():
    print()
    decks = {
        "bouncing_sphere.xml": "bodies/2/position",
        "bowling_ball.xml": "bodies/2/position",
        "drop_m.xml": "bodies/2/position",
        "drop_mm.xml": "bodies/2/position",
        "ellipsoid_on_box.xml": "bodies/2/position/z",
        "free_top.xml": "bodies/2/quaternion",
        "incline_creep.xml": "bodies/2/position",
        "incline_slip.xml": "bodies/2/position",
        "mesh_on_plane.xml": "bodies/2/position",
        "seed_contact.xml": "bodies/2/position",
        "sliding_block.xml": "bodies/2/position",
        "sphere_pair.xml": "bodies/1/velocity",
    }
    for name, signal in decks.items():
        plugins = [USERFUNCS / "seed_cffsub.py"] if name.startswith("seed") else []
        exact = run_model(name, tol=1e-12, plugins=plugins)[signal]
        errors = [
            np.abs(run_model(name, tol=tol, plugins=plugins)[signal] - exact).max()
            for tol in 10.0 ** -np.arange(3, 10)
        ]
        fall = (errors[0] / errors[-1]) ** (1 / 6)
        rise = max(b / a for a, b in pairwise(errors))
        shown = " ".join(f"{error:.1e}" for error in errors)
        print(f"{name}: {shown}; {fall:.1f} a decade, worst rise {rise:.2f}")
        assert np.isfinite(errors).all()

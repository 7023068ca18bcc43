"""VERLET: order, energy, momentum, its bound on steps, and what comes to rest."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import brentq

import mbsim
from helpers.decks import COULOMB, GRAVITY, GROUND, contact, run_deck, sphere, write_deck
from helpers.folders import MODELS
from helpers.pile_decks import balls, block, sets, shape_graphic, solid
from helpers.slopes import slope
from mbsim.errors import ModelError
from mbsim.laws.catalog import FRICTION_LAWS

SPRING = {"stiffness": 1e4, "exponent": 1.0}
OMEGA = 100.0


def pressed(depth):
    """Return a 1 kg ball that vibrates about its rest depth g / w^2 without damping."""
    return GROUND + sphere(0.1 - 9.81 / OMEGA**2 - depth) + contact(**SPRING) + GRAVITY


def test_error_falls_with_tol_by_order_two(tmp_path):
    # 0.5 mm about rest: never leaves; h goes with sqrt(tol), so the error goes with tol
    errors = []
    for tol in (1e-4, 1e-5, 1e-6, 1e-7):
        results = run_deck(tmp_path, pressed(5e-4), end_time=1.0, integrator="VERLET", tol=tol)
        exact = 0.1 - 9.81 / OMEGA**2 - 5e-4 * np.cos(OMEGA * results["time"])
        errors.append(np.abs(results["bodies/2/position"][:, 2] - exact).max())
        limit = math.sqrt(tol / 1e-3) / OMEGA
        assert 0.4 * limit < results.stats["h_largest"] <= 1.001 * limit
    ratios = np.array(errors[:-1]) / errors[1:]
    # steps are powers of two over 16, so tol is met within some 10 %
    assert np.all((ratios > 7.0) & (ratios < 14.0)), errors


def test_free_top_is_of_order_two(tmp_path):
    runs = []
    text = (MODELS / "free_top.xml").read_text(encoding="utf-8")
    assert text.count("<Command>") == 1
    for h_max in (4e-3, 2e-3, 1e-3, 1.25e-4):
        bound = f'<Command><Param_Transient h_max="{h_max!r}"/>'
        deck = tmp_path / "top.xml"
        deck.write_text(text.replace("<Command>", bound), encoding="utf-8")
        results = mbsim.simulate(
            mbsim.read_model(deck), integrator="VERLET", end_time=1.0, tol=1e-2
        )
        assert results.stats["h_largest"] <= h_max
        runs.append(results["state/y"][-1][3:7])
    errors = [np.abs(run - runs[-1]).max() for run in runs[:3]]
    assert 3.0 < errors[0] / errors[1] < 5.5
    assert 3.0 < errors[1] / errors[2] < 5.5


@pytest.mark.parametrize("tol", [1e-3, 1e-5, 1e-7])
def test_a_free_body_bounds_its_step_by_its_turning(tol):
    # nothing else does; the top turns over and over with w = 10
    top = mbsim.simulate(mbsim.read_model(MODELS / "free_top.xml"), integrator="VERLET", tol=tol)
    kinetic = top["energy/kinetic"]
    assert np.abs(kinetic / kinetic[0] - 1.0).max() < 2.0 * tol
    assert top.stats["h_largest"] * 10.0 < math.sqrt(25.0 * tol)
    reference = (-0.000070815327, -0.043836051621, 0.000133685339, -0.999038726823)
    if tol == 1e-7:
        np.testing.assert_allclose(top["bodies/2/quaternion"][-1], reference, atol=1e-3)


def test_a_free_ball_is_exact_where_it_turns(tmp_path):
    # of a ball w stays as it is: the method is exact and only rows within a step need shorter ones
    model = GROUND + sphere(0.0, w=(0.0, 0.0, 10.0))
    results = run_deck(tmp_path, model, end_time=3.0, integrator="VERLET", tol=1e-5)
    half = 5.0 * results["time"]
    exact = np.stack([np.cos(half), 0.0 * half, 0.0 * half, np.sin(half)], axis=1)
    np.testing.assert_allclose(results["bodies/2/quaternion"], exact, atol=1e-5)
    assert 0.02 < results.stats["h_largest"] < 0.05


def test_energy_of_an_undamped_vibration_stays_bounded(tmp_path):
    # near the coarse limit h w = 1 and for 1e5 steps; the shadow energy is off by (h w)^2 / 8
    results = run_deck(tmp_path, pressed(5e-4), end_time=1000.0, print_interval=1.0,
                       integrator="VERLET", tol=1e-3)  # fmt: skip
    assert results.stats["steps"] > 100_000
    z = results["bodies/2/position"][:, 2] - 0.1 + 9.81 / OMEGA**2
    v = results["bodies/2/velocity"][:, 2]
    energy = (0.5 * v**2 + 0.5 * OMEGA**2 * z**2) / (0.5 * OMEGA**2 * 5e-4**2)
    assert 0.6 < energy.min() <= energy.max() < 1.6
    first, last = energy[:250].mean(), energy[-250:].mean()
    assert last == pytest.approx(first, rel=0.02)


@pytest.mark.parametrize("law", [n for n in FRICTION_LAWS if FRICTION_LAWS[n].memory > 0])
def test_friction_that_remembers_is_refused(tmp_path, law):
    """It would be held back to a part of what stops the slip in a step: off whatever the tol."""
    more = {"DAHL": {"bristle_stiffness": 1e5}, "STICTION": {"tangential_stiffness": 1e5}}
    more["LUGRE"] = more["DAHL"] | {"stribeck_vel": 0.01}
    rough = contact(cff_type=law, mu_static=0.4, mu_dynamic=0.3, **more.get(law, {}))
    model = GROUND + sphere(0.1) + rough + GRAVITY
    with pytest.raises(ModelError, match=rf"deck.xml:\d+: Force_Contact\[301\]: .*; {law} remem"):
        run_deck(tmp_path, model, end_time=0.01, integrator="VERLET")


@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.2])
@pytest.mark.parametrize("height", [0.0, 1e-6, 0.1, 1.0])
def test_a_ball_from_rest_keeps_its_energy(tmp_path, exponent, height):
    # nothing moves at first: the bound has to know of the fall to come, also from no height
    model = GROUND + sphere(0.1 + height) + contact(stiffness=1e5, exponent=exponent) + GRAVITY
    results = run_deck(tmp_path, model, end_time=2.0, integrator="VERLET")
    z = results["bodies/2/position"][:, 2]
    deepest = ((exponent + 1) * 9.81 / 1e5) ** (1 / exponent)  # from height 0
    highest = max(height, deepest)
    assert z.max() - 0.1 <= height + 0.02 * highest
    v = results["bodies/2/velocity"][:, 2]
    free = z > 0.1
    level = 0.5 * v[free] ** 2 + 9.81 * (z[free] - 0.1 - height)
    assert np.abs(level).max() < 0.02 * 9.81 * highest


@pytest.mark.parametrize("damping", [10.0, 1e3, 1e5])
def test_dampers_bound_the_step(tmp_path, damping):
    model = GROUND + sphere(0.1) + contact(damping=damping, dmax=1e-4) + GRAVITY
    results = run_deck(tmp_path, model, end_time=1.0, integrator="VERLET", tol=1e-3)
    assert results["contacts/301/penetration"].max() < 0.005
    assert np.abs(results["bodies/2/velocity"][-20:, 2]).max() < 0.06


@pytest.mark.parametrize("shape", ["BOX", "CYLINDER"])
def test_a_solid_that_rocks_gains_no_energy(tmp_path, shape):
    # on its edge: the bound counts the turning, which is softer to move than the cg
    lean = math.radians(20)
    axes = np.array([[math.cos(lean), 0, math.sin(lean)], [0, 1, 0],
                     [-math.sin(lean), 0, math.cos(lean)]])  # fmt: skip
    text = solid(2, lambda id, m: shape_graphic(shape, id, m, 0.2), (0, 0, 0.4), axes,
                 inertia=0.004)  # fmt: skip
    model = GROUND + text + contact(stiffness=1e5, exponent=1.0) + GRAVITY
    results = run_deck(tmp_path, model, end_time=2.0, integrator="VERLET", tol=1e-5)
    energy = results["energy/kinetic"] + results["energy/potential"]
    assert (energy - energy[0]).max() < 0.05 * 9.81 * 0.4
    assert results["contacts/301/penetration"].max() > 1e-3


def test_a_user_bound_is_respected(tmp_path):
    path = write_deck(tmp_path, pressed(5e-4), end_time=0.1)
    text = path.read_text(encoding="utf-8")
    path.write_text(
        text.replace("<Command>", '<Command><Param_Transient h_max="1e-5"/>'), encoding="utf-8"
    )
    results = mbsim.simulate(mbsim.read_model(path), integrator="VERLET", tol=1e-3)
    assert results.stats["h_largest"] <= 1e-5
    assert results.stats["steps"] >= 10_000


def test_momentum_is_conserved_in_a_cloud_that_collides(tmp_path):
    random = np.random.default_rng(4)
    places = block(4, 0.25, jitter=0.02, seed=4)
    v = random.uniform(-2.0, 2.0, size=places.shape)
    ids = [100 * (2 + k) for k in range(len(places))]
    model = balls(places, v=v) + sets(ids, ids, damping=50, dmax=1e-3, stiffness=1e5,
                                      exponent=1.5, **COULOMB)  # fmt: skip
    results = run_deck(tmp_path, model, end_time=0.5, integrator="VERLET")
    assert results.stats["pair_listings"] > 1
    assert results.stats["normal_calls"] > 1000
    p = sum(results[f"bodies/{2 + k}/velocity"] for k in range(len(places)))
    np.testing.assert_allclose(p, np.broadcast_to(v.sum(axis=0), p.shape), atol=1e-11)


def wall(id, x, y, axes):
    """Return a plane of the ground whose marker has the given columns as axes."""
    cosines = " ".join(f'a{r}{c}="{axes[c][r]}"' for r in range(3) for c in range(3))
    return (
        f'<Reference_Marker id="{id}" body_id="1" pos_x="{x!r}" pos_y="{y!r}" {cosines}/>'
        f'<Post_Graphic id="{10 * id}" type="Plane" rm_id="{id}"/>'
    )


#: walls around (0, 0) to (0.85, 0.85): the plane's normal is the marker's z-axis
PIT = (
    wall(11, 0.0, 0.0, [(0, 1, 0), (0, 0, 1), (1, 0, 0)])
    + wall(12, 0.85, 0.0, [(0, 0, 1), (0, 1, 0), (-1, 0, 0)])
    + wall(13, 0.0, 0.0, [(0, 0, 1), (1, 0, 0), (0, 1, 0)])
    + wall(14, 0.0, 0.85, [(1, 0, 0), (0, 0, 1), (0, -1, 0)])
)


@pytest.mark.parametrize("spin", [20.0, 0.6])
def test_friction_of_an_impact_is_followed(tmp_path, spin):
    """A ball that spins is thrown on a plane: it slides throughout, or rolls before it leaves."""
    law = {"stiffness": 1e6, "exponent": 1.0, "damping": 50, "dmax": 1e-4}
    thrown = sphere(0.1001, v=(0.0, 0.0, -2.0), w=(0.0, spin, 0.0))
    deck = GROUND + thrown + contact(**law, **COULOMB) + GRAVITY

    def leaves(method, tol):
        run = run_deck(tmp_path, deck, 0.01, integrator=method, tol=tol)
        turning = 0.1 * run["bodies/2/angular_velocity"][-1]
        return np.concatenate([run["bodies/2/velocity"][-1], turning])

    exact = leaves("DOP853", 1e-11)
    for tol, most in ((1e-5, 7e-3), (1e-6, 4e-4), (1e-7, 5e-5)):
        assert np.abs(leaves("VERLET", tol) - exact).max() < most


def test_a_patch_creeps_as_its_law_says(tmp_path):
    """A cube mesh on a slope, on all of its side: mu(v) N is the pull of gravity along it."""
    deck = slope("FIELD", "COULOMB_ON")
    run = run_deck(tmp_path, deck, 0.3, 0.02, integrator="VERLET", tol=1e-5)
    t, x = run["time"], run["bodies/2/position"][:, 0]
    # STEP(v, -vs, -mu, vs, mu) = tan(10 degrees)
    u = brentq(lambda u: 0.3 * (1.5 * u - 0.5 * u**3) - np.tan(np.deg2rad(10.0)), 0.0, 1.0)
    late = t > 0.1
    assert np.ptp(x[late]) / np.ptp(t[late]) == pytest.approx(0.01 * u, rel=2e-3)


@pytest.mark.parametrize("tol", [1e-3, pytest.param(1e-5, marks=pytest.mark.slow)])
def test_a_heap_comes_to_rest(tmp_path, tol):
    # 64 balls dropped into a pit that is a little too wide for 4 x 4
    places = block(4, 0.205, z=0.11, jitter=0.002, seed=1) + np.array([0.11, 0.11, 0.0])
    ids = [100 * (2 + k) for k in range(len(places))]
    law = {"stiffness": 1e5, "exponent": 1.5, "damping": 300.0, "dmax": 1e-4, **COULOMB}
    model = GROUND + PIT + balls(places) + sets(ids, [100, 110, 120, 130, 140], **law)
    results = run_deck(tmp_path, model + sets(ids, ids, id=302, **law) + GRAVITY, end_time=3.0,
                       integrator="VERLET", tol=tol)  # fmt: skip
    z = np.array([results[f"bodies/{2 + k}/position"][:, 2] for k in range(len(places))])
    v = np.array([results[f"bodies/{2 + k}/velocity"][-1] for k in range(len(places))])
    assert np.isfinite(z).all()
    assert z.min() > 0.09
    assert results["contacts/302/penetration"].max() < 0.01
    total = results["energy/kinetic"] + results["energy/potential"]
    assert np.diff(total).max() < 1e-3 * total[0]
    # nothing resists rolling: it fades as friction and dampers see to it
    assert math.sqrt((v**2).sum(axis=1).mean()) < 0.02
    assert results["contacts/301/force/z"][-20:].mean() == pytest.approx(64 * 9.81, rel=0.02)


def test_a_law_that_fails_ends_the_run(tmp_path):
    # the bound must not undo the shorter step of a second try, for ever
    (tmp_path / "bad.py").write_text(
        "def CFFSUB(id, time, par, npar, loci, locj, x, xdot, nforce, dflag, iflag):\n"
        "    return [float('nan') if time > 0.05 else 0.0, 0.0, 0.0]\n",
        encoding="utf-8",
    )
    law = {"cff_type": "USERCFF", "cff_fnc_name": "CFFSUB", "script_name": "bad.py"}
    model = GROUND + sphere(0.0995) + contact(**law) + GRAVITY
    with pytest.raises(mbsim.errors.MbsimError):
        run_deck(tmp_path, model, end_time=0.1, integrator="VERLET", interpret_plugins=True)

"""The stiff decks of `models/stiff/`: their tables against what else is known, and short runs."""

from __future__ import annotations

import re

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import mbsim
from helpers import squeezer
from helpers.folders import MODELS
from helpers.reference import Governor, four_bar_on_stop
from mbsim.bench import ours, stiff
from stiff_references import CLOSED, named, planned_times, run

G = 9.81
EACH = pytest.mark.parametrize("deck", stiff.DECKS, ids=lambda deck: deck.name)


def step(u):
    """Friction's part of mu at slip over transition velocity."""
    u = np.clip(u, -1.0, 1.0)
    return u * (3.0 - u * u) / 2.0


def column(deck, name):
    times, exact = stiff.table(deck)
    return times, exact[:, deck.columns.index(name)]


def stiffly(rhs, times, start, atol, **settings):
    """Return the solution at the times, by scipy's implicit method of order 5.

    Its own differences overflow where a state has no influence.
    """

    def slopes(t, y):
        f, out = np.array(rhs(t, y)), np.empty((len(y), len(y)))
        for k in range(len(y)):
            near = np.array(y, float)
            near[k] += 1e-8 * max(abs(y[k]), 1e-6)
            out[:, k] = (np.array(rhs(t, near)) - f) / (near[k] - y[k])
        return out

    settings |= {"method": "Radau", "t_eval": times, "jac": slopes, "rtol": 1e-9, "atol": atol}
    return solve_ivp(rhs, (times[0], times[-1]), start, **settings).y


def test_all_decks_of_the_folder_are_listed():
    assert {path.stem for path in (MODELS / "stiff").glob("*.xml")} == {d.name for d in stiff.DECKS}
    assert stiff.folder() == MODELS / "stiff"


@EACH
def test_table_has_the_rows_and_columns_of_its_deck(deck):
    times, exact = stiff.table(deck)
    planned = planned_times(deck)
    np.testing.assert_allclose(times, planned, rtol=1e-9, atol=1e-12)
    assert times[-1] == pytest.approx(deck.end_time)
    assert times[1] == pytest.approx(deck.sample)
    assert exact.shape == (len(planned), len(deck.columns))
    lines = stiff.table_path(deck).read_text(encoding="utf-8").splitlines()
    assert lines[2] == ",".join(["time", *deck.columns])
    assert lines[1] == f"# python tests/stiff_references.py {deck.name}"


@pytest.mark.parametrize("name", ["overdamped", "preloaded_stop"])
def test_table_is_the_closed_form(name):
    times, exact = stiff.table(named(name))
    np.testing.assert_allclose(CLOSED[name](times), exact[:, 0], rtol=1e-13, atol=0.0)


@pytest.mark.parametrize(
    ("name", "limit"),
    [
        ("bushing_chain", 1e-6),
        ("lugre", 1e-4),
        ("preloaded_stop", 1e-3),
        ("rebound", 1e-5),
        ("squeezer", 1e-6),
        ("standing_cylinder", 1e-4),
        ("torsion_top", 1e-5),
    ],
)
def test_decks_that_an_explicit_method_runs_in_no_time_are_near_their_tables(name, limit):
    # the others: tests/bench/test_stiff.py
    deck = named(name)
    results = mbsim.simulate(mbsim.read_model(stiff.deck_path(deck)), tol=1e-7)
    assert stiff.error(deck, ours.outcome(results, 0.0)) < limit


def test_rows_at_other_times_are_refused():
    deck = named("squeezer")
    results = mbsim.simulate(mbsim.read_model(stiff.deck_path(deck)), print_interval=0.0007)
    with pytest.raises(ValueError, match=r"squeezer: rows are not at the times"):
        stiff.error(deck, ours.outcome(results, 0.0))


def test_rolling_sphere_against_its_three_equations_and_drakes_closed_form():
    m, r, k, d, vs, vd = 0.1, 0.05, 1e7, 30.0, 1e-5, 3e-5
    sine, cosine = np.sin(np.radians(15)), np.cos(np.radians(15))

    def mu(v):
        v = abs(v)
        fade = np.clip((v - vs) / (vd - vs), 0.0, 1.0)
        # 0 to mu_s by STEP up to vs, to mu_d by STEP up to vd
        return step(v / vs) if v < vs else 1.0 - 0.5 * fade**2 * (3.0 - 2.0 * fade)

    def rhs(t, y):
        _, v, w, depth, rate = y
        push = max(0.0, k * depth * (1.0 + d * rate)) if depth > 0 else 0.0
        slip = v - (r - depth / 2) * w
        drag = -np.sign(slip) * mu(slip) * push
        torque = -drag * (r - depth / 2) / (0.4 * m * r * r)
        return [v, drag / m + G * sine, torque, rate, G * cosine - push / m]

    times, x = column(named("rolling_sphere"), "2/x")
    start = [0.0, 0.0, 0.0, m * G * cosine / k, 0.0]
    own = stiffly(rhs, times, start, [1e-11, 1e-10, 1e-9, 1e-13, 1e-9])
    assert np.abs(own[0] - x).max() < 1e-6
    rolled = 5.0 / 14.0 * G * sine * times**2
    assert x[-1] == pytest.approx(rolled[-1], rel=5.5e-4)
    assert np.abs(x - rolled).max() < 1e-5


def test_creeping_block_has_the_speed_of_the_law():
    times, x = column(named("incline_creep"), "2/x")
    late = times > 0.5
    speeds = np.diff(x[late]) / np.diff(times[late])
    np.testing.assert_allclose(speeds, 0.53688e-5, rtol=2e-4)


def test_boxes_of_the_stack_creep_at_one_two_and_three_times_a_speed():
    deck = named("box_stack")
    for body, times_as_fast in ((2, 1.0), (3, 2.0), (4, 3.0)):
        times, x = column(deck, f"{body}/x")
        late = times > 0.5 * deck.end_time
        speeds = np.diff(x[late]) / np.diff(times[late])
        np.testing.assert_allclose(speeds, times_as_fast * 0.11744e-5, rtol=1e-2)


def test_governor_against_its_two_equations():
    deck = named("stiff_governor")
    times, exact = stiff.table(deck)
    governor = Governor(stiffness=8e7, damping=4e6)
    own = stiffly(governor.rhs, times, [np.pi / 6, 0.5, 0.0, 0.0, 0.0], 1e-11)
    assert np.abs(own[1] - exact[:, deck.columns.index("3/z")]).max() < 1e-8
    x, y = exact[:, 1], exact[:, 2]
    assert np.abs(np.unwrap(np.arctan2(y, x)) - own[4]).max() < 1e-7


@pytest.mark.slow
def test_four_bar_with_friction_against_its_one_equation_over_the_first_hops():
    times, exact = stiff.table(named("four_bar_stop"))
    early = times < 0.2 + 1e-9
    spring = (np.array([-0.1, 0.15]), 400.0, 0.15, 2.0)
    wall = (np.array([0.16, 0.0]), np.array([1.0, 0.0]), 0.02)
    bars, masses, law = (0.1, 0.3, 0.2), (0.5, 1.0, 0.8), (1e9, 1.0, 1e4, 1e-8)
    settings = {"friction": (0.3, 1e-5), "method": "Radau", "rtol": 1e-9, "atol": 1e-11}
    own, _ = four_bar_on_stop(
        times[early], np.pi / 3, bars, masses, 0.3, spring, wall, law, **settings
    )
    assert np.abs(own - np.arctan2(exact[early, 1], exact[early, 0])).max() < 1e-8


def test_lugre_against_its_three_equations_and_published_numbers():
    s0, s1, s2 = 1e5, np.sqrt(1e5), 0.4

    def rhs(t, y):
        x, v, z = y
        rate = v - s0 * abs(v) * z / (1.0 + 0.5 * np.exp(-((v / 1e-3) ** 2)))
        return [v, 2.0 * (0.1 * t - x) - s0 * z - s1 * rate - s2 * v, rate]

    times, x = column(named("lugre"), "2/x")
    own = stiffly(rhs, times, [0.0, 0.0, 0.0], atol=[1e-12, 1e-12, 1e-15])[0]
    assert np.abs(own - x).max() < 1e-7
    assert x[[100, 200]] == pytest.approx([0.627583, 1.272596], abs=1e-6)


def test_jammed_wedge_against_its_one_equation():
    sine, cosine = np.sin(np.radians(8)), np.cos(np.radians(8))

    def rise(t, begin, end):
        s = np.clip((t - begin) / (end - begin), 0.0, 1.0)
        return s * s * (3.0 - 2.0 * s)

    def rhs(t, y):
        depth, rate = -y[0] * sine, -y[1] * sine
        damper = 1e4 * rise(depth, 0.0, 1e-8)
        push = max(0.0, 1e8 * depth + damper * rate) if depth > 0 else 0.0
        drag = 0.3 * push * step(y[1] * cosine / 1e-4)
        press = 200.0 * rise(t, 0.0, 0.02) * (1.0 - rise(t, 0.04, 0.06))
        return [y[1], 8.0 * (push * sine - drag * cosine) - press - G]

    deck = named("jammed_wedge")
    times, z = column(deck, "2/z")
    own = stiffly(rhs, times, [0.0, 0.0], atol=1e-16, max_step=1e-3)[0]
    assert np.abs(own - z).max() < 1e-3 * deck.size
    # let go, it stays: it rises by less than the transition velocity allows
    assert z[-1] < 0.7 * z.min()
    assert 0.0 < z[-1] - z[-5] < 1e-4 * (times[-1] - times[-5])


def test_top_on_a_torsional_spring_is_the_heavy_top():
    times, exact = stiff.table(named("torsion_top"))
    known = {
        0.5: (-0.7024683, -0.02116518, -0.71140026),
        1.0: (0.17334396, 0.64008859, -0.74849079),
    }
    for when, place in known.items():
        row = exact[np.searchsorted(times, when - 1e-9)]
        np.testing.assert_allclose(row, place * 2, rtol=0, atol=2e-6)


def test_squeezer_ends_as_the_test_set_says():
    _, exact = stiff.table(named("squeezer"))
    centres = np.array(squeezer.centres(squeezer.body_angles(squeezer.END)))[:, :2]
    np.testing.assert_allclose(exact[-1], centres.ravel(), rtol=0, atol=1e-9)


def test_chain_in_stiff_bushings_is_near_one_with_spherical_joints(tmp_path):
    deck = named("bushing_chain")
    text = stiff.deck_path(deck).read_text(encoding="utf-8")

    def held(found):
        markers = found[2]
        turning = f'<Force_Bushing id="{found[1]}" {markers} ctx="0.01" cty="0.01" ctz="0.01"/>'
        joint = f'<Constraint_Joint id="{found[1]}" type="SPHERICAL" {markers}/>'
        return f"{joint}\n{turning}"

    text, count = re.subn(r'<Force_Bushing id="(\d+)" (i_m[^\n]*?)\n[^>]*/>', held, text)
    assert count == 5
    path = tmp_path / "jointed.xml"
    path.write_text(text, encoding="utf-8")
    results = mbsim.simulate(mbsim.read_model(path), tol=1e-9)
    jointed = stiff.positions(deck, ours.outcome(results, 0.0))
    assert np.abs(jointed - stiff.table(deck)[1]).max() < 1e-6


@pytest.mark.slow
@EACH
def test_table_is_what_its_command_gives(deck):
    if deck.name in CLOSED:
        exact = CLOSED[deck.name](planned_times(deck))[:, None]
    else:
        exact = run(deck, integrator="DOP853", tol=1e-10)[1]
    assert np.abs(exact - stiff.table(deck)[1]).max() < 1e-3 * deck.size


@pytest.mark.parametrize("method", ["DOPRI5", "DOP853"])
def test_boxes_that_a_loose_tol_shakes_are_met_as_they_turn(method):
    """Steps of a microsecond turn a box by 1e-8 rad: a corner that comes down by that touches."""
    model = mbsim.read_model(MODELS / "stiff" / "box_stack.xml")
    with mbsim.simulate(model, integrator=method, tol=1e-2, end_time=0.05) as results:
        assert results["time"][-1] == pytest.approx(0.05)


@pytest.mark.parametrize("method", ["RADAU5", None], ids=["RADAU5", "AUTO"])
def test_rounding_of_a_stiff_stop_does_not_shorten_steps(method):
    """A depth is rounded by 1e-17 m: at 1e10 N/m that moves velocities by 1e-10 of their scale.

    A tenth of the tolerance takes a few times the evaluations, not fifty times.
    """
    model, work = mbsim.read_model(MODELS / "stiff" / "preloaded_stop.xml"), []
    _, exact = stiff.table(named("preloaded_stop"))
    for tol in (1e-8, 1e-9):
        with mbsim.simulate(model, integrator=method, tol=tol) as results:
            work.append(results.stats["rhs_evaluations"])
            off = results["bodies/2/position"][:, 0] - exact[:, 0]
        assert np.abs(off).max() < 0.1 * tol
    assert work[1] < 8 * work[0]

"""MOREAU against closed forms: impacts, friction that holds and slides, stacks, restarts."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mbsim
from helpers import rigid_decks as decks
from helpers.folders import MODELS
from mbsim.bench import deck as text
from mbsim.bench.scenes import s13_quadruped
from mbsim.errors import Interrupted, ModelError

G = 9.81


def bouncing(t: float, height: float, e: float) -> float:
    """Return the height of a ball dropped at rest, whose rebound is e times as fast."""
    speed, first = math.sqrt(2.0 * G * height), math.sqrt(2.0 * height / G)
    if t < first:
        return height - 0.5 * G * t * t
    t -= first
    while speed > 1e-12:
        speed *= e
        if t < 2.0 * speed / G:
            return speed * t - 0.5 * G * t * t
        t -= 2.0 * speed / G
    return 0.0


@pytest.mark.parametrize("h", [0.01, 0.002])
def test_a_ball_bounces_through_its_accumulation_point(tmp_path: Path, h: float) -> None:
    """It lies still from T0 (1 + e)/(1 - e) on, T0 the time of the fall, to the step's size."""
    e, height = 0.5, 0.5
    results = mbsim.simulate(decks.ball(tmp_path, height, e, 1.5, h), integrator="MOREAU")
    t, z = results["time"], results["bodies/2/position"][:, 2] - 0.1
    rest = math.sqrt(2.0 * height / G) * (1.0 + e) / (1.0 - e)
    moving = t[np.abs(z) > 1e-9]
    assert moving[-1] == pytest.approx(rest, abs=2.0 * h + 0.01)
    exact = np.array([bouncing(x, height, e) for x in t])
    assert np.abs(z - exact).max() < 30.0 * h * h
    assert results["contacts/301/force"][-1, 2] == pytest.approx(G, rel=1e-9)
    assert results.audit.warnings == ()


@pytest.mark.parametrize("tol", [1e-4, 1e-6])
def test_the_step_follows_the_tolerance(tmp_path: Path, tol: float) -> None:
    """Impacts are met by shorter steps, as the error of positions asks for."""
    model = decks.ball(tmp_path, 0.5, 0.5, 1.5)
    results = mbsim.simulate(model, integrator="MOREAU", tol=tol)
    z = results["bodies/2/position"][:, 2] - 0.1
    exact = np.array([bouncing(x, 0.5, 0.5) for x in results["time"]])
    assert np.abs(z - exact).max() < 30.0 * tol


def test_what_sticks_does_not_creep(tmp_path: Path) -> None:
    """A box on a slope below the angle of friction stays where it is."""
    model = decks.slope(tmp_path, 0.5, 0.36, 10.0, 0.01)
    results = mbsim.simulate(model, integrator="MOREAU", tol=1e-8)
    x = results["bodies/2/position"]
    assert np.abs(x[-1] - x[0]).max() < 1e-9
    assert np.abs(results["bodies/2/velocity"][-1]).max() < 1e-12


def test_what_slides_is_of_the_closed_form(tmp_path: Path) -> None:
    """Behind the angle of friction it goes a t^2 / 2, a = g (sin - mu cos)."""
    mu, tangent, end = 0.2, 0.36, 2.0
    model = decks.slope(tmp_path, mu, tangent, end, 0.01)
    results = mbsim.simulate(model, integrator="MOREAU", tol=1e-8)
    a = G * (tangent - mu) / math.sqrt(1.0 + tangent * tangent)
    way = results["bodies/2/position"][-1, 0]
    assert way == pytest.approx(0.5 * a * end * end, rel=1e-6)


def test_a_stack_stands(tmp_path: Path) -> None:
    """Cubes on each other stay, and the floor carries them all."""
    model = decks.stack(tmp_path, [1.0] * 5, 2.0, 0.005)
    results = mbsim.simulate(model, integrator="MOREAU", tol=1e-8)
    for body in range(2, 7):
        x = results[f"bodies/{body}/position"]
        assert np.abs(x[-1] - x[0]).max() < 1e-7
    assert results["contacts/302/force"][-1, 2] == pytest.approx(5.0 * G, rel=1e-5)
    assert max(results[f"contacts/{c}/penetration"].max() for c in (301, 302)) < 1e-8


@pytest.mark.parametrize("e", [0.0, 0.9])
@pytest.mark.parametrize("h", [0.2, 0.3, 0.5])
def test_a_stack_stands_in_steps_in_which_it_would_fall_its_height(
    tmp_path: Path, h: float, e: float
) -> None:
    """What would come to the floor in free flight does not where the floor holds what is below."""
    model = decks.stack(tmp_path, [1.0] * 4, 3.0, h, h, e)
    results = mbsim.simulate(model, integrator="MOREAU", tol=1e-5)
    for body in range(2, 6):
        x = results[f"bodies/{body}/position"]
        assert np.abs(x - x[0]).max() < 1e-5
    assert results["contacts/302/force"][-1, 2] == pytest.approx(4.0 * G, rel=1e-4)


def test_a_stack_takes_no_more_steps_with_a_looser_tolerance(tmp_path: Path) -> None:
    """Its steps grow as long as rows let them, whatever may be left of a velocity."""
    model = decks.stack(tmp_path, [1.0] * 10, 10.0, None, 0.05, 0.9)
    steps = [
        mbsim.simulate(model, integrator="MOREAU", tol=tol).stats["steps"]
        for tol in (1e-2, 1e-3, 1e-4, 1e-6, 1e-8)
    ]
    assert all(steps[k] <= 1.2 * steps[k + 1] for k in range(4)), steps
    assert steps[-1] < 40


@pytest.mark.parametrize("h", [0.005, 0.001])
def test_a_rod_that_jams_gains_no_energy(tmp_path: Path, h: float) -> None:
    """Painleve's rod, pushed against its friction, has no acceleration that obeys Coulomb's law.

    It takes an impulse, turns over and comes to rest with no more energy than it had.
    """
    model = decks.rod(tmp_path, 1.6, math.radians(60.0), -3.0, 1.5, h)
    results = mbsim.simulate(model, integrator="MOREAU", tol=1e-6)
    energy = results["energy/kinetic"] + results["energy/potential"]
    assert energy.max() <= energy[0] * (1.0 + 1e-9)
    assert np.abs(results["bodies/2/velocity"][-1]).max() < 1e-9
    assert float(results["contacts/301/peak_penetration"]) < 1e-3


def test_a_heavy_cube_rests_on_a_light_one(tmp_path: Path) -> None:
    """A mass ratio of 1e4: it goes nowhere and presses as it weighs."""
    model = decks.stack(tmp_path, [1.0, 1e4], 1.0, 0.005)
    results = mbsim.simulate(model, integrator="MOREAU", tol=1e-8)
    assert float(results["contacts/301/peak_penetration"]) < 1e-6
    assert results["contacts/302/force"][-1, 2] == pytest.approx(10001.0 * G, rel=1e-6)


def test_what_moreau_cannot_run_is_refused_by_name(tmp_path: Path) -> None:
    """Rolling friction is not read as sliding friction alone."""
    law = decks.rubbed(0.3) | {"cff_type": "COULOMB_ROLLING", "rolling_arm": 1e-3}
    parts = [
        decks.cube(2, 1.0, 0.2, (0.0, 0.0, 0.1)),
        text.contact(301, [200], [100], **law),
        text.gravity(),
    ]
    model = decks.model(tmp_path, parts, 1.0, 0.01)
    with pytest.raises(ModelError, match=r"rigid.xml:\d+: Force_Contact\[301\].*MOREAU.*rolling"):
        mbsim.simulate(model, integrator="MOREAU")


@pytest.mark.parametrize("driven", [False, True])
def test_a_resumed_run_gives_the_same_bits(tmp_path: Path, driven: bool) -> None:
    """Impulses, identities of points and what implicit forces keep are in the checkpoint."""
    model: Any = decks.stack(tmp_path, [1.0, 1.0, 2.0], 2.0, 0.002)
    if driven:
        model = tmp_path / "quadruped.xml"
        model.write_text(s13_quadruped.SCENES[0].deck({}), encoding="utf-8")
    whole = mbsim.simulate(model, integrator="MOREAU", output=tmp_path / "whole")
    calls = 0

    def stop(t: float, h: float, end: float) -> None:
        nonlocal calls
        calls += 1
        if t > 0.1:
            raise KeyboardInterrupt

    folder = tmp_path / "parts"
    with pytest.raises((Interrupted, KeyboardInterrupt)):
        mbsim.simulate(model, integrator="MOREAU", output=folder, progress=stop)
    parts = mbsim.simulate(model, integrator="MOREAU", output=folder, resume=True)
    assert calls > 0
    for body in (2, 3, 4):
        name = f"bodies/{body}/position"
        assert np.array_equal(whole[name], parts[name])


@pytest.mark.parametrize("tol", [1e-3, 1e-5, 1e-7])
def test_impacts_between_walls_are_told_apart_and_rows_between_them_are_right(tol: float) -> None:
    """To and fro without gravity: nothing but impacts shortens a step, and each row is judged."""
    model = mbsim.read_model(MODELS / "poisson_walls.xml")
    results = mbsim.simulate(model, integrator="MOREAU", tol=tol)
    times, speeds = [0.0, 0.1, 0.35, 0.6625, 1.053125], [-2.0, 1.6, -1.28, 1.024, -0.8192]
    places = [0.3, 0.1, 0.5, 0.1, 0.5]
    k = np.searchsorted(times, results["time"], side="right") - 1
    exact = np.array(places)[k] + np.array(speeds)[k] * (results["time"] - np.array(times)[k])
    assert np.abs(results["bodies/2/position"][:, 2] - exact).max() < 10.0 * tol
    assert results["bodies/2/velocity"][-1, 2] == pytest.approx(-0.8192, rel=1e-12)
    assert "; contact problems are solved to" in results.audit.line


def walls(h: float, print_interval: float) -> mbsim.results.Results:
    """Return a run of a ball between two walls by steps of h."""
    fixed = f'<Param_Transient h_max="{h}" h_min="{h}"/></Model>'
    deck = (MODELS / "poisson_walls.xml").read_text().replace("</Model>", fixed)
    return mbsim.simulate(deck, integrator="MOREAU", print_interval=print_interval)


def between_walls(times: np.ndarray) -> np.ndarray:
    """Return where the ball between walls is at these times."""
    hits, speeds = [0.0, 0.1, 0.35, 0.6625, 1.053125], [-2.0, 1.6, -1.28, 1.024, -0.8192]
    places = [0.3, 0.1, 0.5, 0.1, 0.5]
    k = np.searchsorted(hits, times + 1e-9, side="right") - 1
    return np.array(places)[k] + np.array(speeds)[k] * (times - np.array(hits)[k])


@pytest.mark.parametrize("h", [0.05, 0.01, 0.0025])
def test_an_impact_at_the_begin_of_a_fixed_step_rebounds_whole(h: float) -> None:
    """The gap there is 0 but for rounding; rows at the ends of steps are exact."""
    results = walls(h, 0.05)
    exact = between_walls(results["time"])
    assert np.abs(results["bodies/2/position"][:, 2] - exact).max() < 1e-12
    assert results.audit.warnings == ()


@pytest.mark.parametrize("h", [0.0, 0.03])
@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_rows_within_a_step_of_an_impact_are_of_the_motion(
    tmp_path: Path, h: float, e: float
) -> None:
    """Some balls from some heights, a row every 1.3 ms: each is before its impact or behind it.

    So its energy is what it had, or e^2 of it where it is kinetic; nothing is in between, as it
    would be on a line through a jump of velocities.
    """
    heights = [0.3, 0.37, 0.41, 0.5]
    end = 0.48
    places = [(0.5 * k, 0.0, 0.1 + height) for k, height in enumerate(heights)]
    model = decks.balls(tmp_path, places, e, 0.0, end, h or None, dt=0.0013)
    results = mbsim.simulate(model, integrator="MOREAU", tol=1e-5)
    for k, height in enumerate(heights):
        z = results[f"bodies/{2 + k}/position"][:, 2] - 0.1
        v = results[f"bodies/{2 + k}/velocity"][:, 2]
        energy = 0.5 * v * v + G * z
        after = results["time"] > math.sqrt(2.0 * height / G) + (1e-9 if h == 0.0 else h)
        before = results["time"] < math.sqrt(2.0 * height / G) - h
        assert np.abs(energy[before] - G * height).max() < 1e-9
        assert np.abs(energy[after] - e * e * G * height).max() < 1e-4 * G * height
    assert results.audit.warnings == ()


@pytest.mark.parametrize("step", [{"tol": 1e-5}, {"h": 1e-3}, {"h": 1e-4}])
def test_elastic_balls_that_meet_in_flight_keep_their_energy(
    tmp_path: Path, step: dict[str, float]
) -> None:
    """27 balls fall and meet each other, two and three at once: none stops another one.

    SimBenchmark's elastic 666 on a smaller scale; its measure is the mean of (E - E0)^2.
    """
    random = np.random.default_rng(3)
    grid = 0.21 * np.stack(np.meshgrid(*[np.arange(3)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    places = grid + np.array([0.0, 0.0, 1.101]) + random.uniform(0.0, 1e-3, grid.shape)
    model = decks.balls(tmp_path, places.tolist(), 1.0, 0.0, 1.2, step.get("h"), dt=0.0037)
    results = mbsim.simulate(model, integrator="MOREAU", tol=step.get("tol", 1e-5))
    energy = results["energy/kinetic"] + results["energy/potential"]
    assert np.abs(energy / energy[0] - 1.0).max() < 1e-7 + 0.2 * step.get("h", 0.0)


@pytest.mark.parametrize("mu", [0.0, 0.3])
@pytest.mark.parametrize("tol", [1e-4, 1e-5, 1e-6])
def test_rows_of_balls_that_meet_lose_energy_alone(tmp_path: Path, mu: float, tol: float) -> None:
    """Restitution of 1/2, with friction and without: energy grows by less than steps may be off.

    Where positions are projected balls are lifted.
    """
    random = np.random.default_rng(4)
    places = 0.23 * np.stack(np.meshgrid(*[np.arange(2)] * 3, indexing="ij"), axis=-1).reshape(
        -1, 3
    )
    places = places + np.array([0.0, 0.0, 0.4]) + random.uniform(0.0, 1e-2, places.shape)
    model = decks.balls(tmp_path, places.tolist(), 0.5, mu, 0.8, dt=0.0017)
    results = mbsim.simulate(model, integrator="MOREAU", tol=tol)
    energy = results["energy/kinetic"] + results["energy/potential"]
    assert np.diff(energy).max() < 0.25 * tol * energy[0]


@pytest.mark.parametrize("tol", [1e-2, 1e-3])
@pytest.mark.parametrize("shape", ["sphere", "cube"])
def test_small_bodies_of_a_large_scene_are_no_deeper_in_each_other(
    tmp_path: Path, shape: str, tol: float
) -> None:
    """A heap of bodies of 2 cm beside a cube of half a metre, by steps of 2 ms."""
    r = 0.02
    random = np.random.default_rng(1)
    cells = np.stack(np.meshgrid(*[np.arange(3)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    places = 2.2 * r * cells + random.uniform(0.0, 0.1 * r, cells.shape) + [0.0, 0.0, 2.0 * r]
    ids = [100 * (2 + k) for k in range(len(places))]
    parts = [decks.cube(40, 1.0, 0.5, (2.0, 0.0, 0.25))]
    for k, place in enumerate(map(tuple, places.tolist())):
        if shape == "sphere":
            parts.append(text.sphere(2 + k, 0.1, r, place))
        else:
            parts.append(decks.cube(2 + k, 0.1, 2.0 * r / math.sqrt(3.0), place))
    law = decks.rubbed(0.3)
    parts += [text.contact(301, ids, ids, **law), text.contact(302, [*ids, 4000], [100], **law)]
    model = decks.model(tmp_path, [*parts, text.gravity()], 0.5, 2e-3)
    results = mbsim.simulate(model, integrator="MOREAU", tol=tol)
    deepest = max(float(results[f"contacts/{c}/peak_penetration"]) for c in (301, 302))
    assert deepest < tol * r


@pytest.mark.parametrize("h", [0.5, 0.45, 0.4, 0.37, 0.35])
def test_two_impacts_within_a_fixed_step_are_told(h: float) -> None:
    """Such steps have two or three of them: the audit tells what that leaves positions off.

    It is no less than they are, and at most twice that.
    """
    results = walls(h, h)
    entry = results.audit.entries["step_end"]
    exact = between_walls(results["time"])
    off = np.abs(results["bodies/2/position"][:, 2] - exact).max()
    assert entry.element == "Force_Contact[301]"
    assert off <= entry.value <= 2.001 * off
    assert any("steps of the deck's length are too long" in said for said in results.audit.warnings)


def test_rows_of_what_spins_are_right_between_steps() -> None:
    """A free ball at 33 rad/s about y: its attitude at every row is that of the angle turned."""
    ball = (
        '<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="0.004" inertia_yy="0.004" '
        'inertia_zz="0.004" w_ic_y="33" w_ic_y_flag="TRUE"/>'
        '<Reference_Marker id="20" body_id="2"/>'
    )
    deck = (
        '<MotionSolve><Model><Body_Rigid id="1" isground="TRUE"/>'
        f"{ball}</Model><Command>"
        '<Simulate analysis_type="Transient" end_time="0.5" print_interval="0.0013"/>'
        "</Command></MotionSolve>"
    )
    results = mbsim.simulate(deck, integrator="MOREAU", tol=1e-6)
    half = 0.5 * 33.0 * results["time"]
    exact = np.stack([np.cos(half), 0.0 * half, np.sin(half), 0.0 * half], axis=1)
    found = results["bodies/2/quaternion"]
    found *= np.sign((found * exact).sum(axis=1))[:, None]
    assert np.abs(found - exact).max() < 1e-5


SPRUNG = (
    '<MotionSolve><Model><Body_Rigid id="1" isground="TRUE"/>'
    '<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="1" inertia_yy="1" inertia_zz="1"/>'
    '<Reference_Marker id="10" body_id="1"/><Reference_Marker id="20" body_id="2" pos_x="1.5"/>'
    '<Force_SpringDamper id="401" type="TRANSLATIONAL" i_marker_id="20" j_marker_id="10"'
    ' stiffness="100" length="1"/>'
    '<Param_Transient h_max="{h}" h_min="{h}"/></Model><Command>'
    '<Simulate analysis_type="Transient" end_time="2" print_interval="0.05"/>'
    "</Command></MotionSolve>"
)


@pytest.mark.parametrize(("h", "told"), [(1e-3, False), (0.1, True)])
def test_the_balance_of_fixed_steps_is_audited(h: float, told: bool) -> None:
    """A spring at 10 rad/s: steps of 0.1 s leave its energy open, and nothing explains that."""
    results = mbsim.simulate(SPRUNG.format(h=h), integrator="MOREAU", tol=1e-3)
    assert results.audit.line.startswith("balance closes to ")
    assert {"energy", "energy_step"} <= set(results.audit.entries)
    assert any("energy balance" in said for said in results.audit.warnings) == told


def test_impacts_of_fixed_steps_leave_the_balance_closed(tmp_path: Path) -> None:
    """What a ball loses as it bounces is what its impulses take, to rounding in flight."""
    model = decks.ball(tmp_path, 0.5, 0.8, 1.5, 0.01)
    results = mbsim.simulate(model, integrator="MOREAU")
    assert results.audit.balance < 1e-9 * results.audit.of
    assert results.audit.entries["momentum"].excess < 1.0


WEDGE = (
    '<MotionSolve><Model><Body_Rigid id="1" isground="TRUE"/>'
    '<Reference_Marker id="10" body_id="1" psi="1.5707963267948966" theta="{a}"/>'
    '<Reference_Marker id="11" body_id="1" psi="-1.5707963267948966" theta="{a}"/>'
    '<Post_Graphic id="100" type="Plane" rm_id="10"/>'
    '<Post_Graphic id="101" type="Plane" rm_id="11"/>'
    '<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="0.001" inertia_yy="0.001"'
    ' inertia_zz="0.001" v_ic_z="-5" v_ic_z_flag="TRUE"/>'
    '<Reference_Marker id="20" body_id="2" pos_z="{z}"/>'
    '<Post_Graphic id="200" type="Sphere" center_marker_id="20" radius="0.05"/>'
    '<Force_Contact id="1" num_i_graphics="1" i_graphics_id="200" num_j_graphics="2"'
    ' j_graphics_id="100 101" cnf_type="POISSON" penalty="1e7" restitution_coef="0.6"'
    ' normal_trans_vel="0.01" cff_type="COULOMB_ON" mu_static="{mu}" mu_dynamic="{mu}"'
    ' stiction_trans_vel="0.001" friction_trans_vel="0.001"/>'
    '<Force_Gravity grav_z="-9.81"/></Model><Command>'
    '<Simulate analysis_type="Transient" end_time="0.1" print_interval="0.01"/>'
    "</Command></MotionSolve>"
)


@pytest.mark.parametrize("half", [0.02, 0.1, 0.5])
@pytest.mark.parametrize("part", [1.1, 3.0])
def test_a_ball_jams_in_a_wedge_that_is_steeper_than_its_friction(half: float, part: float) -> None:
    """No impulses within the cones let it rebound: tan half < mu. Compliant contacts jam too."""
    touches = 0.05 / math.sin(half)
    text = WEDGE.format(a=0.5 * math.pi - half, z=1.0 * touches + 0.1, mu=part * math.tan(half))
    results = mbsim.simulate(text, integrator="MOREAU", tol=1e-6)
    assert results.audit.warnings == ()
    assert results["bodies/2/position"][-1] == pytest.approx([0.0, 0.0, touches], abs=1e-5)
    assert np.abs(results["bodies/2/velocity"][-1]).max() < 1e-6
    loose = text.replace(f'mu_static="{part * math.tan(half)}"', 'mu_static="0.001"')
    loose = loose.replace(f'mu_dynamic="{part * math.tan(half)}"', 'mu_dynamic="0.001"')
    assert mbsim.simulate(loose, integrator="MOREAU")["bodies/2/velocity"][-1, 2] > 2.0

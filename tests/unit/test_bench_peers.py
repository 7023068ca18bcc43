"""Each peer engine, where it is installed, on a scene whose answer is known."""

from __future__ import annotations

import importlib.util
import subprocess
import sys

import numpy as np
import pytest

from mbsim.bench import parameters as p
from mbsim.bench import peers
from mbsim.bench.outcome import Outcome
from mbsim.bench.peers import common, exudyn_scenes, laws, ode
from mbsim.bench.scenes import all_scenes


def _angle(outcome: Outcome, quaternion: tuple[float, ...]) -> float:
    """Angle (rad) between the last row's attitude and a reference."""
    last = outcome.quaternion[-1, 0]
    return float(2 * np.arccos(min(1.0, abs(np.dot(last, quaternion)))))


def _run(engine: str, scene: str, setting: str) -> Outcome:
    if engine not in peers.available():
        pytest.skip(f"{engine} is not installed")
    return peers.load(engine).run(scene, setting, repeats=1)


@pytest.mark.parametrize(
    ("engine", "setting", "bound"),
    [
        ("mujoco", "RK4 dt=0.0001", 1e-4),
        ("exudyn", "RK44 dt=0.0001", 1e-4),
        ("exudyn", "DOPRI5 tol=1e-09 hmax=0.1", 1e-5),
    ],
)
def test_fast_spin_ends_at_the_reference_attitude(engine, setting, bound):
    outcome = _run(engine, "S10c", setting)
    assert _angle(outcome, p.S10C.end_quaternion) < bound
    # angular momentum is constant in the global frame, where the outcome's spin is given
    body = common.rotate(
        outcome.quaternion[-1, 0] * [1, -1, -1, -1], outcome.angular_velocity[-1, 0]
    )
    assert body == pytest.approx(p.S10C.end_spin, abs=5.0)
    assert outcome.time[-1] == pytest.approx(p.S10C.end_time, abs=1e-9)
    assert outcome.wall_s > 0


def test_bullet_sphere_ends_rolling():
    outcome = _run("pybullet", "S3", "default dt=0.001")
    assert outcome.position[-1, 0, 0] == pytest.approx(p.S3.end_x, abs=1e-3)
    assert outcome.velocity[-1, 0, 0] == pytest.approx(p.S3.roll_speed, rel=1e-6)
    # rolling along +x turns about +y
    assert outcome.angular_velocity[-1, 0, 1] * p.S3.radius == pytest.approx(
        p.S3.roll_speed, rel=1e-6
    )


@pytest.mark.parametrize(
    ("engine", "scene", "setting", "law", "bound"),
    [
        ("mujoco", "S2a", "mjcb_passive RK4 dt=0.0001", "impact", 1e-2),
        ("mujoco", "S2a", "mjcb_passive compiled RK4 dt=0.0001", "impact", 1e-2),
        ("mujoco", "S2b", "soft Euler dt=0.0001", "mujoco", 1e-2),
        ("exudyn", "S2a", "symbolic DOPRI5 tol=1e-09 hmax=0.01", "impact", 1e-5),
        ("exudyn", "S2a", "Python DOPRI5 tol=1e-07 hmax=0.01", "impact", 1e-3),
        ("exudyn", "S2b", "DOPRI5 tol=1e-08 hmax=0.01", "linear_noclip", 1e-4),
        ("exudyn", "S2c", "symbolic DOPRI5 tol=1e-09 hmax=0.01", "hc", 1e-5),
        ("pybullet", "S2c", "applyExternalForce dt=0.0001", "hc", 1e-2),
    ],
)
def test_drop_leaves_the_plane_at_the_speed_of_its_law(engine, scene, setting, law, bound):
    outcome = _run(engine, scene, setting)
    assert outcome.note.startswith(law)
    assert outcome.time == pytest.approx(np.arange(301) * p.SAMPLE, abs=1e-9)
    # in flight the speed at the plane follows from height and speed: v^2 + 2 g z
    row = 60
    height = outcome.position[row, 0, 2] - p.S2.radius
    speed = np.sqrt(outcome.velocity[row, 0, 2] ** 2 + 2 * p.GRAVITY * height)
    assert speed == pytest.approx(p.S2_FIRST_IMPACT[law][2], rel=bound)


CONTACT = ("S1", "S2a", "S3", "S4stick", "S4slip", "S5", "S7_125", "S10a", "S10c")
BOXES = ("S6", "S10b", "bin_50", "bin_200")
MESHES = ("S9plane",)
JOINTS = ("S8_2", "S8_10", "S8_40", "S8b")
DAILY = ("quadruped", "chain_box", "cylinder_train", "drum_300", "drum_3000")
SCENES_OF = {
    "mujoco": CONTACT + JOINTS + MESHES + BOXES + DAILY,
    "exudyn": CONTACT + JOINTS,
    "pybullet": (*CONTACT, *MESHES, "cylinder_train"),
    "drake": (*JOINTS, *MESHES, "S9torus", "quadruped"),
    "ode": (
        "S3",
        "S4stick",
        "S4slip",
        "S7_125",
        "S7_1000",
        "S9plane",
        "S9torus",
        "chain_box",
        *BOXES,
    ),
}


@pytest.mark.parametrize("engine", peers.ENGINES)
def test_every_setting_is_known_and_unknown_scenes_have_none(engine):
    module = peers.load(engine)
    for scene in SCENES_OF[engine]:
        names = module.settings(scene)
        assert names
        assert len(set(names)) == len(names)
    assert module.settings("S99") == []


@pytest.mark.parametrize("engine", ["mujoco", "pybullet", "ode"])
def test_every_setting_stores_the_rows_that_are_asked_for(engine):
    module = peers.load(engine)
    for name, scene in all_scenes().items():
        for make in module._cases(name).values():
            case = make()
            rows = common.plan(case.dt, case.end_time, case.sample)
            assert rows.dt * rows.steps_per_row == pytest.approx(scene.sample, rel=1e-9)


def test_exudyn_has_steps_short_enough_for_the_rows_in_every_scene():
    for name, scene in all_scenes().items():
        cases = [make() for make in exudyn_scenes.cases(name).values()]
        if not cases:
            # meshes, the stiff decks, boxes on boxes, daily work, SimBenchmark: it has them not
            assert name.startswith(("S9", "S11_", "sb_")) or name in BOXES + DAILY
            continue
        assert any(case.solver.step <= scene.sample for case in cases)
        assert all(case.sample == scene.sample for case in cases)


def test_laws_that_are_compiled_use_plain_numbers():
    # a field of a dataclass cannot be read in compiled code, which fails at the first run only
    _run("mujoco", "S5", "mjcb_passive compiled Euler dt=0.0001")
    assert laws.hertz(1e-4, 0.0) == p.S5.k * 1e-4**p.S5.e


def test_box_sticks_and_the_body_is_where_it_was():
    outcome = _run("mujoco", "S4stick", "elliptic impratio=10000 noslip=0 dt=0.01")
    assert abs(outcome.position[-1, 0, 0]) < 1e-4
    assert outcome.position[-1, 0, 2] == pytest.approx(p.S4.size[2] / 2, abs=2e-3)


def test_row_of_balls_keeps_its_momentum():
    outcome = _run("exudyn", "S5", "symbolic DOPRI5 tol=1e-07 hmax=0.01")
    assert outcome.velocity[-1, :, 0] == pytest.approx(p.S5.end_v, abs=1e-4)
    assert outcome.velocity[-1, :, 0].sum() == pytest.approx(p.S5.speed, abs=1e-9)


@pytest.mark.parametrize(
    ("engine", "scene", "setting", "measure", "bound"),
    [
        ("mujoco", "S8_2", "RK4 dt=0.001", "tip_max", 2e-8),
        ("mujoco", "S8_10", "RK4 dt=0.001", "tip_max", 1e-5),
        ("mujoco", "S8b", "RK4 solref=2dt,1 dt=0.001", "crank_angle_max", 5e-5),
        ("exudyn", "S8_2", "tree RK67 dt=0.005", "tip_max", 1e-8),
        ("exudyn", "S8_2", "tree DOPRI5 tol=1e-10 hmax=0.1", "tip_max", 1e-7),
        ("exudyn", "S8_10", "tree RK44 dt=0.001", "tip_max", 1e-5),
        ("exudyn", "S8_2", "joints TrapezoidalIndex2 dt=0.001", "tip_max", 5e-3),
        ("exudyn", "S8b", "slide TrapezoidalIndex2 dt=0.001", "crank_angle_max", 2e-3),
        ("exudyn", "S8b", "axis GeneralizedAlpha rho=0.9 dt=0.001", "crank_angle_max", 5e-3),
        ("drake", "S8_2", "runge_kutta5 dt=0.002", "tip_max", 1e-8),
        ("drake", "S8_10", "runge_kutta5 accuracy=1e-08", "tip_max", 1e-5),
        ("drake", "S8b", "discrete dt=0.001", "crank_angle_max", 0.5),
    ],
)
def test_linkages_end_where_minimal_coordinates_say(engine, scene, setting, measure, bound):
    outcome = _run(engine, scene, setting)
    made = all_scenes()[scene]
    assert outcome.time == pytest.approx(
        np.arange(round(made.end_time / p.SAMPLE) + 1) * p.SAMPLE, abs=1e-9
    )
    errors = made.errors(outcome, "")
    assert errors[measure] < bound
    # the bodies that the peer gave belong together, their rates included
    assert errors.get("joint_drift", errors.get("loop_gap")) < 2e-4
    rates = (outcome.position[2:50] - outcome.position[:48]) / (2 * p.SAMPLE)
    assert outcome.velocity[1:49] == pytest.approx(rates, abs=0.1)
    assert errors.get("E_rel", 0.0) < 1e-3


def test_unknown_peer_is_refused_by_name():
    with pytest.raises(
        ValueError, match="peer 'odd': must be one of mujoco, exudyn, pybullet, drake"
    ):
        peers.load("odd")


def test_nothing_imports_an_engine_before_it_runs():
    code = (
        "import sys; from mbsim.bench import peers\n"
        "found = peers.available(); [peers.load(n).settings('S1') for n in peers.ENGINES]\n"
        "print(found, [n for n in peers.PACKAGES.values() if n in sys.modules])"
    )
    out = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout.strip()
    found = [n for n, engine in peers.PACKAGES.items() if importlib.util.find_spec(engine)]
    found += ["ode"] if ode.is_installed() else []
    assert out == f"{found} []"


@pytest.mark.parametrize(
    ("scene", "setting", "measure", "bound"),
    [
        ("S3", "Step dt=0.001", "x_abs", 1e-3),
        ("S4stick", "Step dt=0.005", "creep_abs", 1e-7),
        ("S4slip", "QuickStep 20 dt=0.001", "acc_rel", 1e-2),
        ("S9plane", "QuickStep 20 dt=0.005", "z_error", 1e-6),
        ("S10b", "Step dt=0.005", "pen_max", 1e-5),
        ("bin_50", "QuickStep 20 dt=0.005", "pen_late", 2e-3),
        ("chain_box", "QuickStep 20 dt=0.001", "path_rms", 3e-2),
        ("chain_box", "QuickStep 20 dt=0.001", "joint_gap", 3e-3),
        ("cylinder_train", "Step dt=0.001", "path_rms", 3e-2),
        ("drum_300", "QuickStep 20 dt=0.002", "pen_rows_over_r", 0.2),
    ],
)
def test_ode_comes_to_what_is_known(scene, setting, measure, bound):
    outcome = _run("ode", scene, setting)
    assert all_scenes()[scene].errors(outcome, "")[measure] < bound
    assert np.linalg.norm(outcome.quaternion, axis=-1) == pytest.approx(1.0, abs=1e-9)


def test_what_the_driver_of_ode_cannot_read_is_an_error(monkeypatch):
    if "ode" not in peers.available():
        pytest.skip("ode is not installed")
    monkeypatch.setattr(ode, "_numbers", lambda case, steps: iter([1e-3, 1.0]))
    with pytest.raises(RuntimeError, match="the scene ends too soon"):
        ode.run("S3", "Step dt=0.001", 1)


def test_rows_meet_the_steps():
    assert common.plan(1e-3, 2.0) == (1e-3, 10, 200)
    assert common.plan(1 / 240, 2.0) == (1 / 240, 12, 40)  # rows every 50 ms
    with pytest.raises(ValueError, match="no row time"):
        common.plan(0.0123456789, 2.0)


def test_early_stop_scales_the_wall_time_and_says_so():
    rows = common.Rows(np.array([0.0, 0.5]), *(np.zeros((2, 1, k)) for k in (3, 4, 3, 3)))
    outcome = common.outcome(30.0, rows, "", 2.0)
    assert outcome.wall_s == pytest.approx(120.0)
    assert "stopped at t = 0.50 s" in outcome.note


def test_long_runs_of_peers_are_not_warmed_up():
    runs = iter([(0.1, "a"), (0.3, "b"), (2.5, "c")])
    assert common.measure(lambda: next(runs), 1) == (0.3, "b")
    assert common.measure(lambda: next(runs), 5) == (2.5, "c")


def test_hermite_reads_a_parabola_exactly():
    t = np.array([0.0, 0.3, 1.0])
    at = np.linspace(0.0, 1.0, 7)
    assert common.hermite(t, 1 - t * t, -2 * t, at) == pytest.approx(1 - at * at, abs=1e-15)


def test_polynomials_through_four_steps_have_degree_seven():
    path = np.polynomial.Polynomial([1.0, -2.0, 0.5, 3.0, -1.0, 0.2, 2.0, -4.0])
    t = np.array([0.0, 0.1, 0.15, 0.4, 0.5, 0.9, 1.0])
    at = np.linspace(0.0, 1.0, 31)
    both = np.stack([path(t), -path(t)], axis=1)
    slopes = np.stack([path.deriv()(t), -path.deriv()(t)], axis=1)
    x, v = common.through_four(t, both, slopes, at)
    assert x[:, 1] == pytest.approx(-path(at), abs=1e-13)
    assert v[:, 0] == pytest.approx(path.deriv()(at), abs=1e-11)


def test_quaternion_of_a_turn_about_z():
    turned = common.rotate(common.quaternion_of(np.array([0.0, 0.0, np.pi / 2])), np.eye(3)[0])
    assert turned == pytest.approx([0.0, 1.0, 0.0], abs=1e-15)


def test_grains_overlap_is_measured_between_spheres_and_walls():
    r, half = p.S7.radius, p.s7_half_width(8)
    rest = np.array([[x, y, z] for x in (-0.025, 0.025) for y in (-0.025, 0.025) for z in (r, 0.1)])
    touching = rest.copy()
    touching[1] = touching[0] + [0, 0, 1.9 * r]
    beyond = rest.copy()
    beyond[0, 0] = -half
    assert common.s7_measures(rest[None])["pen_max_over_r"] == pytest.approx(0.0, abs=1e-12)
    assert common.s7_measures(touching[None])["pen_max_over_r"] == pytest.approx(0.1)
    measures = common.s7_measures(np.stack([beyond, rest]))
    assert measures["pen_max_over_r"] == pytest.approx(1.0)
    assert measures["pen_end_over_r"] == pytest.approx(0.0, abs=1e-12)
    beyond[0, 0] = -half - 1e-6
    assert common.s7_measures(beyond[None])["escaped"] == 1.0

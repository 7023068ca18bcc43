"""Scenes of daily work: their decks, their errors, and what peers come to."""

from __future__ import annotations

import numpy as np
import pytest

from mbsim.bench import converged, daily, drum, peers
from mbsim.bench import quadruped as walking
from mbsim.bench.outcome import Outcome
from mbsim.bench.scenes import all_scenes, s13_quadruped
from mbsim.model.frames import marker_frames
from mbsim.reader.xml import read_model


def read(tmp_path, name, variation=None):
    path = tmp_path / "deck.xml"
    path.write_text(all_scenes()[name].deck(variation or {}), encoding="utf-8")
    return read_model(path)


def outcome(position, end_time):
    """Return rows of bodies (n, bodies, 3) that neither turn nor move."""
    n, bodies = position.shape[:2]
    upright = np.tile([1.0, 0.0, 0.0, 0.0], (n, bodies, 1))
    still = np.zeros_like(position)
    return Outcome(0.1, np.linspace(0.0, end_time, n), position, upright, still, still, {}, "")


def run(engine, scene, setting):
    if engine not in peers.available():
        pytest.skip(f"{engine} is not installed")
    return peers.load(engine).run(scene, setting, repeats=0)


# --- quadruped


def test_the_walker_is_put_together_and_stands_above_the_floor(tmp_path):
    model = read(tmp_path, "quadruped")
    assert model.warnings == ()
    frames = marker_frames(model)
    for number in range(3, 15):
        mine, other = frames[10 * number + 1], frames[1000 + 10 * number + 2]
        assert mine.p == pytest.approx(other.p, abs=1e-15)
        assert pytest.approx(other.R, abs=1e-15) == mine.R
        axis = (1.0, 0.0, 0.0) if number % 3 == 0 else (0.0, 1.0, 0.0)
        assert mine.R[:, 2] == pytest.approx(axis)
    w = walking.WALKER
    for number in (5, 8, 11, 14):
        foot, hip = frames[10 * number + 3].p, frames[10 * (number - 1) + 1].p
        assert foot[:2] == pytest.approx(hip[:2], abs=1e-15)
        assert w.foot < foot[2] < w.foot + 0.01  # it falls less than a centimetre
    assert len(walking.legs()) == 12
    assert walking.targets(np.array([0.0, np.pi / 2.0 / w.rate]))[1, :3] == pytest.approx(
        [0.0, 0.2, -0.4]
    )


def test_the_walker_is_held_to_its_converged_path(monkeypatch):
    exact = np.zeros((201, 3))
    monkeypatch.setattr(converged, "paths", lambda *_: (exact,))
    place = np.zeros((201, 1, 3))
    place[100, 0] = [3e-3, 0.0, 4e-3]
    place[-1, 0, 0] = 1e-3
    errors = all_scenes()["quadruped"].errors(outcome(place, 2.0), "")
    assert errors == pytest.approx({"path_max": 5e-3, "path_end": 1e-3})
    # rows that are further apart are compared where they are
    assert all_scenes()["quadruped"].errors(outcome(place[::2], 2.0), "")["path_max"] == 5e-3


@pytest.mark.parametrize(
    ("engine", "setting", "bound"),
    [
        ("drake", "sap dt=0.002", 5e-3),
        ("drake", "sap dt=0.0005", 2e-3),
        ("mujoco", "Euler elliptic default dt=0.001", 2e-2),
        ("mujoco", "Euler elliptic hard dt=0.0002", 1e-2),
    ],
)
def test_peers_walk_near_our_path(engine, setting, bound):
    found = run(engine, "quadruped", setting)
    assert all_scenes()["quadruped"].errors(found, "")["path_max"] < bound
    rates = (found.position[2:] - found.position[:-2]) / 0.02
    assert found.velocity[20:-1] == pytest.approx(rates[19:], abs=0.05)


def test_our_reference_of_the_walker_has_converged():
    deck = s13_quadruped._deck({})
    exact = converged.paths(deck, *s13_quadruped.EXACT)[0]
    looser = converged.paths(deck, "RADAU5", 1e-5)[0]
    assert np.abs(exact - looser).max() < 1e-6


# --- chain_box


def test_the_chain_is_closed_and_lies_above_the_box(tmp_path):
    model = read(tmp_path, "chain_box")
    assert model.warnings == ()
    frames, c = marker_frames(model), daily.CHAIN
    for number in range(3, 2 + c.count):
        hinge = frames[10 * number + 2]
        assert hinge.p == pytest.approx(frames[10 * number - 9].p, abs=1e-14)
        assert hinge.R[:, 2] == pytest.approx([0.0, 1.0, 0.0])
    assert frames[10].p[2] + c.box[2] / 2.0 == pytest.approx(0.0, abs=1e-15)
    assert frames[21].p[2] == c.height > c.ball
    # both ends are longer than the floor is deep
    assert c.count * c.length / 2.0 - c.box[0] / 2.0 > -c.floor


def swung():
    """Return rows of the chain that turns about its first end, its links in one line."""
    times = np.linspace(0.0, daily.CHAIN.end_time, 101)
    place = np.tile([daily.CHAIN.start, daily.CHAIN.height], (101, 1))
    hinge, rate = np.zeros((2, 101, daily.CHAIN.count))
    hinge[:, 0], rate[:, 0] = 0.3 * times, 0.3
    poses = daily.draped(place, np.zeros_like(place), hinge, rate)
    return Outcome(0.1, times, *poses, {}, "")


def test_the_chain_is_held_to_its_converged_paths(monkeypatch):
    found = swung()
    exact = tuple(np.moveaxis(found.position, 1, 0))
    monkeypatch.setattr(converged, "paths", lambda *_: exact)
    errors = all_scenes()["chain_box"].errors(found, "")
    assert errors["path_max"] == errors["path_rms"] == 0.0
    assert errors["joint_gap"] < 1e-14
    moved = found.position.copy()
    moved[50, 7] += [0.0, 3e-3, 4e-3]
    errors = all_scenes()["chain_box"].errors(found._replace(position=moved), "")
    assert errors["path_max"] == pytest.approx(5e-3)
    assert errors["path_rms"] == pytest.approx(5e-3 / np.sqrt(101 * daily.CHAIN.count))
    assert errors["joint_gap"] == pytest.approx(5e-3)


def test_rates_of_a_chain_are_those_of_its_places():
    found = swung()
    rates = (found.position[2:] - found.position[:-2]) / 0.02
    assert found.velocity[1:-1] == pytest.approx(rates, abs=1e-4)
    assert found.position[0, :, 0] == pytest.approx(daily.CHAIN.centres())


def test_the_chain_of_mujoco_falls_as_ours_and_is_closed():
    found = run("mujoco", "chain_box", "implicitfast pyramidal hard dt=0.0005")
    errors = all_scenes()["chain_box"].errors(found, "")
    assert errors["path_rms"] < 0.1
    assert errors["joint_gap"] < 1e-12
    exact = np.stack(converged.paths(all_scenes()["chain_box"].deck({}), "AUTO", 1e-7), axis=1)
    # up to the first impact, at 0.13 s, it is free fall with every engine
    assert found.position[:13] == pytest.approx(exact[:13], abs=1e-3)


# --- cylinder_train


def test_the_train_lies_on_the_slope_and_looks_at_the_wall(tmp_path):
    model = read(tmp_path, "cylinder_train")
    assert model.warnings == ()
    frames, t = marker_frames(model), daily.TRAIN
    assert frames[13].R[:, 2] == pytest.approx([-1.0, 0.0, 0.0])
    for number in range(2, 2 + t.count):
        base, centre = frames[10 * number + 1], frames[10 * number]
        assert base.R[:, 2] == pytest.approx([0.0, 1.0, 0.0])
        assert centre.p - base.p == pytest.approx([0.0, t.length / 2.0, 0.0])
        assert centre.p[2] == t.radius
    assert t.inertia == pytest.approx((0.025, 0.05))
    assert np.linalg.norm(t.pull()) == pytest.approx(9.81)


def test_the_train_is_held_to_its_converged_paths(monkeypatch):
    t = daily.TRAIN
    exact = np.zeros((301, t.count, 3))
    exact[..., 0], exact[..., 2] = t.centres(), t.radius
    monkeypatch.setattr(converged, "paths", lambda *_: tuple(np.moveaxis(exact, 1, 0)))
    errors = all_scenes()["cylinder_train"].errors(outcome(exact, 3.0), "")
    assert errors == {"path_rms": 0.0, "path_max": 0.0, "pen_end": 0.0}
    moved = exact.copy()
    moved[-1, 4, 0] += 0.06  # the gap is 0.05
    errors = all_scenes()["cylinder_train"].errors(outcome(moved, 3.0), "")
    assert errors["path_max"] == pytest.approx(0.06)
    assert errors["path_rms"] == pytest.approx(0.06 / np.sqrt(301 * t.count))
    assert errors["pen_end"] == pytest.approx(0.01)


@pytest.mark.parametrize(
    ("engine", "setting", "bound"),
    [
        ("mujoco", "pyramidal hard dt=0.001", 3e-3),
        ("pybullet", "default dt=0.001", 2e-2),
        ("ode", "Step dt=0.001", 3e-3),
    ],
)
def test_cylinders_of_peers_roll_as_rigid_ones(engine, setting, bound):
    found, t = run(engine, "cylinder_train", setting), daily.TRAIN
    # before the wall: 2/3 of the pull, for a cylinder that does not slip
    way = t.pull()[0] / 3.0 * found.time[:200] ** 2
    moved = found.position[:200, :, 0] - t.centres()
    assert moved == pytest.approx(np.tile(way[:, None], t.count), abs=bound)
    assert found.position[-1, 0, 0] == pytest.approx(t.wall - t.radius, abs=2e-2)


# --- drums


@pytest.mark.parametrize("count", [300, 3000])
def test_spheres_start_apart_inside_of_the_drum(count):
    made = drum.DRUMS[count]
    at = drum.places(made)
    upright = np.array([1.0, 0.0, 0.0, 0.0])
    assert at.shape == (count, 3)
    assert drum.deepest(made, np.zeros(3), upright, at) == 0.0
    assert at[:, 2].mean() < 0.0  # filled from below
    with pytest.raises(ValueError, match="the drum holds"):
        drum.places(drum.Drum(3000, 0.3, 8))


def test_faces_of_the_drum_look_inward_and_bound_what_is_measured(tmp_path):
    model = read(tmp_path, "drum_300", {"k": 1e5})
    assert model.warnings == ()
    frames, made = marker_frames(model), drum.DRUMS[300]
    faces = [frames[50001 + k] for k in range(drum.SIDES)]
    for face, normal in zip(faces, drum.outward(), strict=True):
        assert face.R[:, 2] == pytest.approx(-normal, abs=1e-15)
        assert face.R.T @ face.R == pytest.approx(np.eye(3), abs=1e-15)
        assert np.linalg.det(face.R) == pytest.approx(1.0)
        assert face.p == pytest.approx(made.apothem * normal, abs=1e-15)
    for face, side in ((frames[50101], -1.0), (frames[50102], 1.0)):
        assert face.R[:, 2] == pytest.approx([0.0, -side, 0.0])
        assert np.linalg.det(face.R) == pytest.approx(1.0)
        assert face.p == pytest.approx([0.0, side * made.half_length, 0.0])


def test_depth_in_a_drum_is_that_of_a_face_an_end_or_a_pair():
    made, zero = drum.DRUMS[300], np.zeros(3)
    r, upright = made.radius, np.array([1.0, 0.0, 0.0, 0.0])
    face = np.array([[made.apothem - 0.9 * r, 0.0, 0.0]])
    assert drum.deepest(made, zero, upright, face) == pytest.approx(0.1)
    # half a face on there is an edge, farther from the axis
    half = np.pi / drum.SIDES / 2.0
    turned = np.array([np.cos(half), 0.0, np.sin(half), 0.0])
    assert drum.deepest(made, zero, turned, face) == 0.0
    end = np.array([[0.0, made.half_length - 0.7 * r, 0.0]])
    assert drum.deepest(made, zero, upright, end) == pytest.approx(0.3)
    assert drum.deepest(made, end[0], upright, end) == 0.0
    pair = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.8 * r]])
    assert drum.deepest(made, zero, upright, pair) == pytest.approx(0.2)
    assert drum.deepest(made, zero, upright, np.full((1, 3), np.nan)) == np.inf


@pytest.mark.parametrize(
    ("engine", "setting"),
    [("mujoco", "CG stiff dt=0.002"), ("ode", "QuickStep 20 dt=0.002")],
)
def test_drums_of_peers_turn_and_carry_spheres(engine, setting):
    found, made = run(engine, "drum_300", setting), drum.DRUMS[300]
    half = made.spin * found.time / 2.0
    assert found.quaternion[:, 0, 2] == pytest.approx(np.sin(half), abs=1e-3)
    errors = all_scenes()["drum_300"].errors(found, "")
    assert errors["pen_rows_over_r"] < 0.2
    assert -0.12 < errors["lift"] < -0.06


def test_our_drum_turns_and_carries_spheres_as_theirs(tmp_path):
    from mbsim.bench import ours

    made = all_scenes()["drum_300"]
    setting = ours.Setting("VERLET", 1e-2, {"k": 3e5})
    found = ours.run(read(tmp_path, "drum_300", setting.variation), setting, 1, 300.0)
    assert found.position[:, 0] == pytest.approx(np.zeros((51, 3)), abs=1e-5)
    assert found.quaternion[-1, 0, 2] == pytest.approx(np.sin(1.5), abs=1e-4)
    errors = made.errors(found, "")
    assert errors["pen_max_over_r"] < 0.05
    assert -0.12 < errors["lift"] < -0.06

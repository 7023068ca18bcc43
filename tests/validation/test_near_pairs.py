"""Contacts of many graphics: near pairs against brute force, runs against listed pairs."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import mbsim
from helpers.decks import COULOMB, GRAVITY, GROUND, run_deck, write_deck
from helpers.pile_decks import (
    LAW,
    SHAPES,
    balls,
    block,
    pile,
    random_axes,
    sets,
    shape_graphic,
    solid,
    surface,
)
from mbsim.arrays.codes import ACTIVE, FREE, LISTINGS, WANTED
from mbsim.compile_model import build, contacts, pairing
from mbsim.dynamics.bodies.kinematics import place_bodies, place_graphics
from mbsim.dynamics.contact import broadphase as contact_set
from mbsim.dynamics.events import step_limits
from mbsim.errors import Interrupted, ModelError, SolverError

MOVING_PLANE = """<Body_Rigid id="9000" cg_id="90000" mass="1" inertia_xx="1" inertia_yy="1"
 inertia_zz="1"/><Reference_Marker id="90000" body_id="9000" pos_z="-1.4" a00="0.8" a20="-0.6"
 a01="0" a11="1" a21="0" a02="0.6" a22="0.8"/>
<Post_Graphic id="900000" type="Plane" rm_id="90000"/>"""


@pytest.fixture
def all_by_broadphase(monkeypatch):
    """Give every contact to the broadphase."""
    monkeypatch.setattr(pairing, "MOST_LISTED", 0)


# --- near pairs ------------------------------------------------------------------------------


def mixed(random, shapes, count, spread, giants=0, first=2):
    """Return statements of random solids and the ids of their graphics."""
    text, ids = "", []
    for body in range(first, first + count):
        shape = shapes[int(random.integers(len(shapes)))]
        size = random.uniform(0.05, 0.15) * (8.0 if body - first < giants else 1.0)
        text += solid(
            body,
            lambda id, marker, shape=shape, size=size: shape_graphic(shape, id, marker, size),
            random.uniform(-spread, spread, size=3),
            random_axes(random),
        )
        ids.append(100 * body)
    return text, ids


def listed(folder, model):
    """Return the system of a deck after its first listing."""
    system = build.build(mbsim.read_model(write_deck(folder, model)))
    place_bodies(system.scene, system.y0)
    place_graphics(system.scene, system.y0)
    contact_set.list_pairs(system.scene, system.y0)
    return system


def listed_pairs(system):
    """Return the live pairs as (contact, graphic, graphic), graphic ids ascending."""
    pairs, kinds = system.scene.pairs, system.scene.kinds
    found = []
    for pair in pairs.active[: pairs.count[ACTIVE]]:
        i, j = (system.graphic_ids[g[pair]] for g in (pairs.graphic_i, pairs.graphic_j))
        found.append((system.contact_ids[kinds.contact[pairs.kind[pair]]], min(i, j), max(i, j)))
    return found


def distances(system, random):
    """Return upper bounds of all distances of graphics by id, from points of their surfaces."""
    scene, points, planes = system.scene, {}, {}
    for row, id in enumerate(system.graphic_ids):
        graphic, frame = system.model.graphics[id], scene.work.frames[row]
        turn = np.eye(3) if graphic.shape == "SPHERE" else frame[3:].reshape(3, 3)
        if graphic.shape == "PLANE":
            planes[id] = frame[:3], turn[:, 2]
        else:
            points[id] = frame[:3] + surface(graphic, 120, random) @ turn.T
    found = {}
    ids = sorted(points)
    for k, i in enumerate(ids):
        for j in ids[k + 1 :]:
            apart = points[i][:, None, :] - points[j][None, :, :]
            found[i, j] = float(np.sqrt((apart**2).sum(axis=2).min()))
        for plane, (origin, normal) in planes.items():
            height = float(((points[i] - origin) @ normal).min())
            found[min(i, plane), max(i, plane)] = height
    return found


def commit(scene, y):
    """Let what moves next move from here."""
    scene.state.centre[:] = scene.work.frames[:, :3]
    for b in range(len(scene.bodies.mass)):
        scene.state.q[b] = y[13 * b + 3 : 13 * b + 7]


def check_against_brute_force(system, random, wanted, fewest=6):
    """Check that every pair of `wanted` nearer than the skin is listed, and none twice."""
    found, near = listed_pairs(system), 0
    assert len(found) == len(set(found))
    apart = distances(system, random)
    skin = float(system.scene.broadphase.size[0])
    for contact, i, j in wanted:
        if apart[min(i, j), max(i, j)] < skin:
            near += 1
            assert (contact, min(i, j), max(i, j)) in found, (contact, i, j)
    assert set(found) <= {(c, min(i, j), max(i, j)) for c, i, j in wanted}
    assert near >= fewest
    # a scene that lists everything would pass as well
    assert len(found) < 0.7 * len(wanted)


@pytest.mark.parametrize("shapes", [(s,) for s in SHAPES] + [SHAPES], ids=[*SHAPES, "all"])
def test_a_set_with_itself_lists_every_near_pair_once(tmp_path, all_by_broadphase, shapes):
    random = np.random.default_rng(len(shapes) + SHAPES.index(shapes[0]))
    text, ids = mixed(random, shapes, 40, 0.4)
    system = listed(tmp_path, GROUND + text + sets(ids, ids, **LAW))
    wanted = [(301, i, j) for k, i in enumerate(ids) for j in ids[k + 1 :]]
    check_against_brute_force(system, random, wanted)


@pytest.mark.parametrize("giants", [0, 3])
@pytest.mark.parametrize("seed", [1, 2])
def test_two_sets_and_several_contacts_list_every_near_pair(
    tmp_path, all_by_broadphase, seed, giants
):
    random = np.random.default_rng(seed)
    one, i = mixed(random, SHAPES, 30, 0.8, giants)
    two, j = mixed(random, SHAPES, 25, 0.8, giants, first=100)
    model = (
        GROUND + one + two + MOVING_PLANE
        + sets(i, j, id=301, **LAW) + sets(i, i, id=302, **LAW)
        + sets([100], j, id=303, **LAW) + sets(j, [900000], id=304, **LAW)
        + sets([*i[:9], 900000], j[9:], id=305, **LAW)
    )  # fmt: skip
    system = listed(tmp_path, model)
    wanted = [(301, p, q) for p in i for q in j]
    wanted += [(302, p, q) for k, p in enumerate(i) for q in i[k + 1 :]]
    wanted += [(303, 100, q) for q in j] + [(304, q, 900000) for q in j]
    wanted += [(305, p, q) for p in [*i[:9], 900000] for q in j[9:]]
    check_against_brute_force(system, random, wanted)
    # what is high above a plane that moves is left out too
    assert not {pair for pair in wanted if pair[0] == 304} <= set(listed_pairs(system))


def test_graphics_of_one_body_are_no_pair_of_a_set(tmp_path, all_by_broadphase):
    random = np.random.default_rng(0)
    text, ids = mixed(random, ("SPHERE",), 12, 0.4)
    text += '<Post_Graphic id="201" type="Sphere" center_marker_id="20" radius="0.3"/>'
    system = listed(tmp_path, GROUND + text + sets([*ids, 201], [*ids, 201], **LAW))
    found = listed_pairs(system)
    assert (301, 200, 201) not in found
    assert any(201 in pair for pair in found)


def test_near_pairs_stay_right_while_shapes_wander(tmp_path, all_by_broadphase):
    random = np.random.default_rng(3)
    text, ids = mixed(random, SHAPES, 30, 0.4)
    system = listed(tmp_path, GROUND + text + sets(ids, ids, **LAW))
    wanted = [(301, i, j) for k, i in enumerate(ids) for j in ids[k + 1 :]]
    scene, y = system.scene, system.y0.copy()
    before = set(listed_pairs(system))
    for _ in range(6):
        for b in range(len(ids)):
            y[13 * b : 13 * b + 3] += random.uniform(-0.05, 0.05, size=3)
            q = y[13 * b + 3 : 13 * b + 7] + 0.2 * random.normal(size=4)
            y[13 * b + 3 : 13 * b + 7] = q / np.linalg.norm(q)
        place_bodies(scene, y)
        assert not place_graphics(scene, y)
        contact_set.follow(scene, y)
        assert place_graphics(scene, y) or scene.state.centre.any() == 0
        check_against_brute_force(system, random, wanted)
        places = [*scene.pairs.active[: scene.pairs.count[ACTIVE]]]
        places += [*scene.pairs.free[: scene.pairs.count[FREE]]]
        assert sorted(places) == list(range(len(scene.pairs.active)))
    assert before - set(listed_pairs(system))
    assert scene.log.counters[LISTINGS] == 7


@pytest.mark.parametrize("seed", range(2))
def test_what_a_moving_plane_may_touch_is_listed_however_it_turns(
    tmp_path, all_by_broadphase, seed
):
    random = np.random.default_rng(seed)
    text, ids = mixed(random, SHAPES, 24, 1.0)
    # and one that has flown away, which does not shorten what the others' lists hold
    text += balls(np.array([[300.0, -200.0, 900.0]]), first=50)
    ids.append(5000)
    system = listed(tmp_path, GROUND + text + MOVING_PLANE + sets(ids, [900000], **LAW))
    wanted = [(301, i, 900000) for i in ids]
    scene, y, stays, near = system.scene, system.y0.copy(), 0, 0
    bodies = len(scene.bodies.mass)
    assert scene.broadphase.lever.max() < 3.0
    commit(scene, y)
    for _ in range(24):
        y[13 * bodies - 13 : 13 * bodies - 10] += random.uniform(-4e-3, 4e-3, size=3)
        for b in range(bodies):
            y[13 * b : 13 * b + 3] += random.uniform(-1e-3, 1e-3, size=3)
            q = y[13 * b + 3 : 13 * b + 7] + 2e-3 * random.normal(size=4)
            y[13 * b + 3 : 13 * b + 7] = q / np.linalg.norm(q)
        place_bodies(scene, y)
        stays += place_graphics(scene, y)
        before = scene.log.counters[LISTINGS]
        contact_set.follow(scene, y)
        commit(scene, y)
        if scene.log.counters[LISTINGS] > before:
            check_against_brute_force(system, random, wanted, fewest=0)
            near += len(listed_pairs(system))
            continue
        found, apart = set(listed_pairs(system)), distances(system, random)
        for contact, i, j in wanted:
            assert apart[i, j] > 0.0 or (contact, i, j) in found, (i, apart[i, j])
    assert stays > 12
    assert near > 0


def test_a_plane_that_spins_about_its_normal_or_slides_along_itself_stays(
    tmp_path, all_by_broadphase
):
    random = np.random.default_rng(8)
    text, ids = mixed(random, ("SPHERE",), 30, 0.5)
    system = listed(tmp_path, GROUND + text + MOVING_PLANE + sets(ids, [900000], **LAW))
    scene, y = system.scene, system.y0.copy()
    plane = 13 * (len(scene.bodies.mass) - 1)
    normal = scene.work.frames[system.graphic_ids.index(900000)][[5, 8, 11]]
    along = np.cross(normal, [0.0, 1.0, 0.0])
    commit(scene, y)
    for angle in np.linspace(0.1, 3.0, 7):
        turned = np.append(np.cos(0.5 * angle), np.sin(0.5 * angle) * normal)
        w, v = turned[0], turned[1:]
        q = system.y0[plane + 3 : plane + 7]
        y[plane + 3] = w * q[0] - v @ q[1:]
        y[plane + 4 : plane + 7] = w * q[1:] + q[0] * v + np.cross(v, q[1:])
        y[plane : plane + 3] = system.y0[plane : plane + 3] + 10.0 * angle * along
        place_bodies(scene, y)
        assert place_graphics(scene, y)


def test_the_speed_of_a_plane_is_that_of_its_way_however_it_stands(tmp_path, all_by_broadphase):
    random = np.random.default_rng(11)
    text, ids = mixed(random, ("SPHERE",), 30, 0.5)
    system = listed(tmp_path, GROUND + text + MOVING_PLANE + sets(ids, [900000], **LAW))
    scene, g = system.scene, system.graphic_ids.index(900000)
    at = 13 * (len(scene.bodies.mass) - 1)
    h, lever = 1e-6, scene.broadphase.lever[g]
    for _ in range(12):
        y, x, v, w = system.y0.copy(), *random.normal(size=(3, 3))
        stands, frames = Rotation.random(random_state=random), []
        # the spin of a state is along the body's own axes
        for t in (-0.5 * h, 0.5 * h, 0.0):
            q = (stands * Rotation.from_rotvec(t * w)).as_quat()
            y[at : at + 13] = [*(x + t * v), q[3], *q[:3], *v, *w]
            place_bodies(scene, y)
            place_graphics(scene, y)
            frames.append(scene.work.frames[g].copy())
        change = (frames[1] - frames[0]) / h
        n = [5, 8, 11]
        way = abs(frames[2][n] @ change[:3]) + lever * np.linalg.norm(change[n])
        assert step_limits.plane_speed(scene, y, g) == pytest.approx(way, rel=1e-6)


def test_too_few_places_halve_the_skin(tmp_path, all_by_broadphase, monkeypatch):
    random = np.random.default_rng(5)
    text, ids = mixed(random, ("SPHERE",), 40, 0.6)
    model = GROUND + text + sets(ids, ids, **LAW)
    system = listed(tmp_path, model)
    many, skin = len(listed_pairs(system)), float(system.scene.broadphase.size[0])
    monkeypatch.setattr(
        contacts, "_broadphase_rows", lambda plans: (many - 3, plans.broadphase[0].kinds and 1)
    )
    tight = listed(tmp_path, model)
    assert tight.scene.pairs.count[WANTED] == 0
    assert tight.scene.broadphase.size[0] in [skin * 0.5**k for k in range(1, 15)]
    wanted = [(301, i, j) for k, i in enumerate(ids) for j in ids[k + 1 :]]
    check_against_brute_force(tight, random, wanted)
    # what touches cannot be left out
    monkeypatch.setattr(contacts, "_broadphase_rows", lambda plans: (2, 1))
    assert listed(tmp_path, model).scene.pairs.count[WANTED] > 0
    with pytest.raises(SolverError, match="more pairs of graphics are near each other"):
        run_deck(tmp_path, model, end_time=0.1, allow_overlap=True)


# --- runs ------------------------------------------------------------------------------------

HEAP = block(2, 0.21, z=0.12, jitter=0.01)
VELOCITY = np.random.default_rng(1).uniform(-1.0, 1.0, size=HEAP.shape)


def short_steps(folder, model, h_max, **settings):
    """Run a deck whose steps are bounded by h_max."""
    path = write_deck(folder, model, end_time=0.15)
    text = path.read_text(encoding="utf-8")
    path.write_text(
        text.replace("<Command>", f'<Command><Param_Transient h_max="{h_max!r}"/>'),
        encoding="utf-8",
    )
    return mbsim.simulate(mbsim.read_model(path), **settings)


def places(results, count=8):
    """Return all positions, row by row."""
    return np.hstack([results[f"bodies/{2 + k}/position"] for k in range(count)])


@pytest.mark.parametrize("method", ["DOPRI5", "VERLET"])
@pytest.mark.parametrize("shape", ["SPHERE", "BOX"])
def test_a_set_runs_as_listed_pairs_do(tmp_path, monkeypatch, method, shape):
    # steps that all are h_max are the same steps: only the order of sums may differ
    random = np.random.default_rng(2)
    text = "".join(
        solid(2 + k, lambda id, marker: shape_graphic(shape, id, marker, 0.1), place,
              random_axes(random), v=VELOCITY[k], inertia=0.004)
        for k, place in enumerate(HEAP)
    )  # fmt: skip
    ids = [100 * (2 + k) for k in range(len(HEAP))]
    law = {**LAW, "stiffness": 1e4, **COULOMB}
    model = GROUND + text + sets(ids, [100], **law) + sets(ids, ids, id=302, **law) + GRAVITY
    runs = []
    for most in (300, 0):
        monkeypatch.setattr(pairing, "MOST_LISTED", most)
        runs.append(short_steps(tmp_path, model, 2e-5, integrator=method, tol=1e-3))
    assert runs[0].stats["pair_listings"] == 0
    assert runs[1].stats["pair_listings"] > 1
    assert runs[0].stats["normal_calls"] > 1000
    np.testing.assert_allclose(places(runs[1]), places(runs[0]), rtol=0, atol=1e-11)
    if method == "VERLET":
        assert runs[1].stats["h_largest"] <= 2e-5


@pytest.mark.parametrize("method", ["DOPRI5", "RADAU5"])
def test_a_plane_that_turns_into_a_set_runs_as_listed_pairs_do(tmp_path, monkeypatch, method):
    # a heavy wing, hinged at its edge, sweeps balls that hang in the air
    wing = """<Body_Rigid id="9000" cg_id="90000" mass="50" inertia_xx="9" inertia_yy="9"
     inertia_zz="9" w_ic_y="4.0" w_ic_y_flag="TRUE"/>
    <Reference_Marker id="90000" body_id="9000" pos_x="-0.5" pos_z="-0.2"/>
    <Post_Graphic id="900000" type="Plane" rm_id="90000"/>"""
    places_at = block(3, 0.25, z=0.3, jitter=0.02)
    ids = [100 * (2 + k) for k in range(len(places_at))]
    law = {**LAW, "stiffness": 1e4, **COULOMB}
    model = GROUND + balls(places_at) + wing + sets(ids, [900000], **law)
    model = model.replace('w_ic_y="4.0"', 'w_ic_y="-4.0"')
    runs = []
    for most in (300, 0):
        monkeypatch.setattr(pairing, "MOST_LISTED", most)
        runs.append(short_steps(tmp_path, model, 1e-3, integrator=method, tol=1e-8))
    assert runs[0].stats["normal_calls"] > 100
    np.testing.assert_allclose(places(runs[1], 27), places(runs[0], 27), rtol=0, atol=2e-7)
    assert runs[1].stats["narrowphase_pairs"] < 0.6 * runs[0].stats["narrowphase_pairs"]


def test_falling_apart_needs_no_narrowphase(tmp_path, all_by_broadphase):
    # 27 balls 0.5 apart: no pair is near, but for the ground at the end of the fall
    heights = block(3, 0.5, z=3.0)
    results = run_deck(tmp_path, pile(heights, **LAW) + GRAVITY, end_time=0.4)
    stats = results.stats
    assert stats["narrowphase_pairs"] == 0
    assert stats["skipped_pairs"] == 0
    # 0.8 m in lists that hold for a quarter of a skin of 0.03 at most
    assert 0.8 / 0.03 <= stats["pair_listings"] <= 0.8 / (0.25 * 0.03) + 2
    assert results["bodies/2/position"][-1, 2] == pytest.approx(3.0 - 0.5 * 9.81 * 0.16, abs=1e-9)


def test_a_moving_plane_is_measured_at_the_distance_of_usual_members(tmp_path, all_by_broadphase):
    ids = [100 * (2 + k) for k in range(729)]
    text = balls(block(9, 0.3, jitter=0.02)) + MOVING_PLANE + sets(ids, [900000], **LAW)
    system = listed(tmp_path, GROUND + text)
    commit(system.scene, system.y0)
    frames, graphics = system.scene.work.frames, system.scene.graphics
    plane, round_ones = np.isinf(graphics.radius), np.isfinite(graphics.radius)
    moving = plane & (graphics.body < len(system.scene.bodies.mass))
    away = np.linalg.norm(frames[round_ones, :3] - frames[moving, :3], axis=1) + 0.1
    lever = system.scene.broadphase.lever[moving]
    assert lever == pytest.approx(1.0 / np.mean(1.0 / away), rel=0.05)


def test_near_pairs_are_listed_before_two_more_steps_leave_their_room(tmp_path, all_by_broadphase):
    ids = [100 * (2 + k) for k in range(64)]
    system = listed(tmp_path, GROUND + balls(block(4, 0.6)) + sets(ids, ids, **LAW))
    scene, y = system.scene, system.y0.copy()
    commit(scene, y)
    room = scene.broadphase.room[np.isfinite(scene.broadphase.room)].min()
    before, step, gone = scene.log.counters[LISTINGS], 0.02 * room, 0.0
    while scene.log.counters[LISTINGS] == before:
        y[2 : 13 * 64 : 13] += step
        gone += step
        place_bodies(scene, y)
        assert place_graphics(scene, y)
        contact_set.follow(scene, y)
        commit(scene, y)
    assert room - 3.0 * step < gone <= room


@pytest.mark.parametrize("method", ["DOPRI5", "VERLET"])
def test_resume_of_a_set_is_bit_identical(tmp_path, all_by_broadphase, monkeypatch, method):
    monkeypatch.setattr("mbsim.run.divergence.RETURN_SECONDS", 1e-4)
    path = write_deck(tmp_path, pile(HEAP, v=VELOCITY, **LAW, **COULOMB) + GRAVITY, end_time=0.3)
    model = mbsim.read_model(path)
    settings = {"integrator": method, "tol": 1e-4}
    straight = mbsim.simulate(model, output=tmp_path / "a", **settings)

    def stop(time, h, end):
        if time > 0.15:
            raise Interrupted(f"stopped at {time}")

    with pytest.raises(Interrupted):
        mbsim.simulate(model, output=tmp_path / "b", progress=stop, **settings)
    resumed = mbsim.simulate(model, output=tmp_path / "b", resume=True, **settings)
    for name in ("time", "state/y", "events", "contacts/302/force"):
        np.testing.assert_array_equal(straight[name], resumed[name])
    for name in ("steps", "pair_listings", "normal_calls"):
        assert straight.stats[name] == resumed.stats[name]
    straight.close()
    resumed.close()


def test_a_subroutine_that_uses_x_works_in_a_set(tmp_path, monkeypatch):
    (tmp_path / "bristle.py").write_text(
        "def CFFSUB(id, time, par, npar, loci, locj, x, xdot, nforce, dflag, iflag):\n"
        "    return [-500.0 * x[0] - 5.0 * xdot[0], -500.0 * x[1] - 5.0 * xdot[1], 0.0]\n",
        encoding="utf-8",
    )
    law = {"cff_type": "USERCFF", "cff_fnc_name": "CFFSUB", "script_name": "bristle.py"}
    model = pile(HEAP, v=VELOCITY, **{**LAW, "stiffness": 1e4}, **law) + GRAVITY
    runs = []
    for most in (300, 0):
        monkeypatch.setattr(pairing, "MOST_LISTED", most)
        runs.append(short_steps(tmp_path, model, 5e-5, tol=1e-3, interpret_plugins=True))
    assert runs[1].stats["python_calls"] > 100
    np.testing.assert_allclose(places(runs[1]), places(runs[0]), rtol=0, atol=1e-11)


# --- decks -----------------------------------------------------------------------------------


def test_check_names_a_set_by_its_numbers(tmp_path, all_by_broadphase):
    from click.testing import CliRunner

    from mbsim.cli.main import main

    path = write_deck(tmp_path, pile(HEAP, **LAW) + GRAVITY, end_time=0.02)
    done = CliRunner().invoke(main, ["check", str(path)])
    assert done.exit_code == 0, done.output
    assert "8 graphics with each other, 28 pairs" in done.output
    assert "8 with 1 graphics, 8 pairs" in done.output
    run = CliRunner().invoke(main, ["run", str(path), "-o", str(tmp_path / "out")])
    assert run.exit_code == 0, run.output
    told = CliRunner().invoke(main, ["info", str(tmp_path / "out" / "deck.h5")])
    assert told.exit_code == 0, told.output


@pytest.mark.parametrize(
    ("i", "j", "message"),
    [([200], [200], "both on body 2"), ([200, 201], [200, 201], "both on body 2")],
    ids=["one graphic", "one body"],
)
def test_a_set_on_one_body_is_refused(tmp_path, i, j, message):
    text = balls(HEAP[:1])
    text += '<Post_Graphic id="201" type="Sphere" center_marker_id="20" radius="0.3"/>'
    path = write_deck(tmp_path, GROUND + text + sets(i, j, **LAW))
    with pytest.raises(ModelError, match=message) as caught:
        mbsim.read_model(path)
    assert "Force_Contact[301]" in str(caught.value)


def test_a_set_with_two_planes_is_refused(tmp_path, all_by_broadphase):
    text, ids = balls(HEAP[:3]), [200, 300, 400]
    planes = [*ids, 100, 900000]
    path = write_deck(tmp_path, GROUND + text + MOVING_PLANE + sets(planes, planes, **LAW))
    with pytest.raises(ModelError, match="both planes"):
        mbsim.read_model(path)

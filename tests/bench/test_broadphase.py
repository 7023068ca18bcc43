"""Finding near pairs, printed and never judged.

python -m pytest -m bench -s tests/bench/test_broadphase.py
"""

from __future__ import annotations

import math
import time

import numpy as np
import pytest
from numba import njit

import mbsim
from helpers.decks import COULOMB, GRAVITY, GROUND, write_deck
from helpers.pile_decks import LAW, block, pile, random_axes, sets, shape_graphic, solid
from mbsim.arrays.codes import ACTIVE
from mbsim.arrays.scene import Scene
from mbsim.compile_model import pairing
from mbsim.compile_model.build import build
from mbsim.core import jit
from mbsim.core.address import pack, view
from mbsim.dynamics.bodies.kinematics import place_bodies, place_graphics
from mbsim.dynamics.contact.broadphase import list_pairs

pytestmark = pytest.mark.bench
EDGES = [5, 10, 20]


def best(call, repeats=7):
    """Return the best time of a call [s]."""
    times = []
    for _ in range(repeats):
        began = time.perf_counter()
        call()
        times.append(time.perf_counter() - began)
    return min(times)


def listing(context, y):
    """List the near pairs of the scene at `context`."""
    list_pairs(view(context, Scene), y)


@njit
def sort_and_sweep(box, i_found, j_found):
    """Collect pairs of overlapping boxes (n, 6) by sorting along x; return their number."""
    order = np.argsort(box[:, 0])
    count = 0
    for p in range(len(order)):
        a = box[order[p]]
        for q in range(p + 1, len(order)):
            b = box[order[q]]
            if b[0] > a[3]:
                break
            if a[1] <= b[4] and b[1] <= a[4] and a[2] <= b[5] and b[2] <= a[5]:
                i_found[count], j_found[count] = order[p], order[q]
                count += 1
    return count


def tree_times(centres, radius):
    """Return times of FCL's tree: moving the objects, update, self-collision with a callback."""
    import fcl

    objects = [fcl.CollisionObject(fcl.Sphere(radius), fcl.Transform(c)) for c in centres]
    manager = fcl.DynamicAABBTreeCollisionManager()
    manager.registerObjects(objects)
    manager.setup()
    found = []

    def collect(a, b, data):
        found.append((a, b))
        return False

    random = np.random.default_rng(0)
    moved = [fcl.Transform(c + 0.01 * random.normal(size=3)) for c in centres]

    def move():
        for obj, at in zip(objects, moved, strict=True):
            obj.setTransform(at)

    def collide():
        found.clear()
        manager.collide(None, collect)

    times = best(move), best(manager.update), best(collide)
    return times, len(found)


@pytest.mark.parametrize("edge", EDGES)
def test_cost_of_a_listing(tmp_path, monkeypatch, edge):
    monkeypatch.setattr(pairing, "MOST_LISTED", 0)
    centres = block(edge, 0.2, z=0.1, jitter=0.01)
    system = build(mbsim.read_model(write_deck(tmp_path, pile(centres, **LAW))))
    scene = system.scene
    place_bodies(scene, system.y0)
    place_graphics(scene, system.y0)
    table = pack(scene)
    call = jit.function(listing)
    context = int(table.ctypes.data)
    call(context, system.y0)
    grid = best(lambda: call(context, system.y0))
    listed = int(scene.pairs.count[ACTIVE])
    rows = [system.graphic_ids.index(100 * (2 + k)) for k in range(len(centres))]
    box = np.ascontiguousarray(scene.broadphase.box[rows])
    room = np.zeros((2, 60 * len(centres)), dtype=np.int64)
    swept_pairs = sort_and_sweep(box, *room)
    swept = best(lambda: sort_and_sweep(box, *room))
    skin = float(scene.broadphase.size[0])
    (moved, updated, collided), tree_pairs = tree_times(centres, 0.1 + 0.5 * skin)
    print(
        f"\n{len(centres)} spheres: grid {1e3 * grid:.3f} ms ({listed} pairs near, with ground), "
        f"sort and sweep {1e3 * swept:.3f} ms ({swept_pairs} boxes meet), FCL's tree: "
        f"move {1e3 * moved:.3f} + update {1e3 * updated:.3f} + collide {1e3 * collided:.3f} ms "
        f"({tree_pairs} pairs)"
    )
    assert listed > len(centres)


def cost(path, **settings):
    """Return the best cost of an evaluation [s] of four runs, and the stats of that run."""
    model = mbsim.read_model(path)
    runs = [mbsim.simulate(model, **settings).stats for _ in range(4)]
    stats = min(runs, key=lambda stats: stats["loop_s"])
    return stats["loop_s"] / (stats["rhs_evaluations"] + stats["output_evaluations"]), stats


@pytest.mark.parametrize(("pitch", "z"), [(0.2, 0.1), (0.35, 1.0)], ids=["a heap", "falling apart"])
def test_pairs_to_list_for_good(tmp_path, monkeypatch, pitch, z):
    print()
    for count in (8, 12, 16, 20, 25, 32, 45):
        centres = block(4, pitch, z=z)[:count]
        path = write_deck(
            tmp_path, pile(centres, **LAW) + GRAVITY, end_time=0.4 if z > 0.5 else 0.05
        )
        costs, times = [], []
        for most in (10**9, 0):
            monkeypatch.setattr(pairing, "MOST_LISTED", most)
            spent, stats = cost(path)
            costs.append(1e9 * spent)
            times.append(1e3 * stats["loop_s"])
        print(
            f"{count} spheres, {count * (count - 1) // 2} pairs: listed {costs[0]:.0f} ns an "
            f"evaluation, {times[0]:.2f} ms; broadphase {costs[1]:.0f} ns, {times[1]:.2f} ms"
        )
        assert math.isfinite(sum(costs))


@pytest.mark.parametrize("edge", EDGES)
def test_cost_of_an_evaluation_of_a_heap(tmp_path, monkeypatch, edge):
    # 0.1 mm deep in each other all over, with friction
    monkeypatch.setattr(pairing, "MOST_LISTED", 0)
    centres = block(edge, 0.1999, z=0.0999)
    path = write_deck(tmp_path, pile(centres, **LAW, **COULOMB) + GRAVITY, end_time=0.03)
    spent, stats = cost(path, integrator="VERLET")
    evaluations = stats["rhs_evaluations"] + stats["output_evaluations"]
    contacts = stats["normal_calls"] / evaluations
    bodies = len(centres)
    print(
        f"\n{bodies} spheres, {contacts:.0f} contacts: {1e6 * spent:.1f} us an evaluation, "
        f"{1e9 * spent / (bodies + contacts):.0f} ns per body and contact, all included; "
        f"{stats['steps']} steps, {stats['pair_listings']} listings"
    )
    assert contacts > bodies


@pytest.mark.parametrize("shape", ["MESH", "BOX"])
def test_share_of_the_tree_where_fcl_detects(tmp_path, monkeypatch, shape):
    monkeypatch.setattr(pairing, "MOST_LISTED", 0)
    random = np.random.default_rng(0)
    centres = block(5, 0.19, z=0.09)
    text = "".join(
        solid(2 + k, lambda id, m: shape_graphic(shape, id, m, 0.1), c, random_axes(random))
        for k, c in enumerate(centres)
    )
    ids = [100 * (2 + k) for k in range(len(centres))]
    model = GROUND + text + sets(ids, [100], **LAW) + sets(ids, ids, id=302, **LAW) + GRAVITY
    path = write_deck(tmp_path, model, end_time=0.01)
    spent, stats = cost(path, detector="fcl", tol=1e-4, allow_overlap=True)
    calls = stats["fcl_calls"] / (stats["rhs_evaluations"] + stats["output_evaluations"])
    (moved, updated, collided), pairs = tree_times(centres, 0.1 + 0.015)
    print(
        f"\n{len(centres)} of {shape} by FCL: {1e6 * spent:.0f} us an evaluation, {calls:.1f} "
        f"pairs in it, {1e6 * spent / max(calls, 1e-9):.1f} us a pair; {stats['pair_listings']} "
        f"listings in {stats['steps']} steps; FCL's tree would take "
        f"{1e6 * (moved + updated + collided):.0f} us each time ({pairs} pairs)"
    )
    assert math.isfinite(spent)

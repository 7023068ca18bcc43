"""Many loops: sparse factors give what the equations alone do, and grow with the loops."""

from __future__ import annotations

import numpy as np
import pytest

import mbsim
from helpers.decks import write_deck
from helpers.folders import MODELS
from helpers.forgetful import forgetful
from helpers.known_mechanisms import four_bars, passive
from helpers.many_loops import ladder, net, prefer, separate
from helpers.mechanism_decks import residual
from mbsim.arrays.hooks import Hook
from mbsim.compile_model.build import build
from mbsim.errors import ModelError

#: The first rail is driven; the second turns against it as the third against that.
DRIVEN = """
<Motion_Joint id="900" joint_id="1" val_type="D" type="EXPRESSION" expr="0.5*TIME+0.1*TIME**2"/>
<Constraint_Coupler id="901" joint_ids="5 9" motion_types="R R" scales="1 -1"/>
"""
#: A ladder whose lower end is let down on light rungs, and one with a heavy rung at each bay.
SCENES = {
    "ladder": ladder(6),
    "light rungs": ladder(6, rung=1e-6),
    "heavy rungs": ladder(6, rung=1e3),
    "four-bars": four_bars(6),
    "net": net(3, 3),
    "separate": separate(5),
}


def of_scene(scene, folder):
    """Return the arrays of a scene's deck."""
    return build(mbsim.read_model(write_deck(folder, scene.xml(), 1.0, 0.1))).scene


def both_ways(scene, folder, **settings):
    """Return results with equations alone, then with sparse factors."""
    found = []
    for sparse in (False, True):
        with pytest.MonkeyPatch.context() as patch:
            prefer(patch, sparse)
            found.append(scene.run(folder, **settings))
    return found


def off(one, other):
    """Return by how much two arrays differ, over the largest number."""
    return np.abs(one - other).max() / max(np.abs(one).max(), 1.0)


def compare(one, other, rows, bound):
    """Compare what all bodies and joints do at some rows."""
    names = [
        name
        for name in one.keys()
        if name.startswith(("bodies/", "joints/", "motions/", "couplers/"))
    ]
    assert any(name.endswith("torque") for name in names)
    for kind in ("position", "acceleration", "force", "torque"):
        those = [name for name in names if name.rpartition("/")[2] == kind]
        a, b = (np.hstack([results[name][rows] for name in those]) for results in (one, other))
        assert off(a, b) < bound, kind


@pytest.mark.parametrize("name", SCENES)
def test_sparse_factors_give_the_same_motion_and_reactions(name, tmp_path):
    one, other = both_ways(SCENES[name], tmp_path, end_time=0.2, print_interval=0.05, tol=1e-10)
    compare(one, other, [0], 1e-9)
    compare(one, other, slice(None), 1e-6)


def test_motions_and_couplers_are_nodes_too(tmp_path):
    scene = ladder(6)
    # what is stated once more holds nothing new
    scene.joints.append(scene.joints[-1])
    scene.extra = DRIVEN
    one, other = both_ways(scene, tmp_path, end_time=0.2, print_interval=0.05, tol=1e-10)
    compare(one, other, [0], 1e-9)
    compare(one, other, slice(None), 1e-6)


@pytest.mark.parametrize("name", ["ladder", "net", "heavy rungs"])
def test_accelerations_are_those_of_an_independent_solver(name, tmp_path, monkeypatch):
    prefer(monkeypatch, True)
    scene = SCENES[name]
    results = scene.run(tmp_path, 0.01, 0.01, 1e-10)
    mechanism = scene.mechanism()
    expected = mechanism.accelerations(mechanism.y0(), 0.0)[0]
    for k in range(len(scene.bodies)):
        found = results[f"bodies/{k + 2}/acceleration"][0]
        np.testing.assert_allclose(found, expected[k, :3], rtol=0, atol=1e-8)
    assert residual(results, mechanism)[0] < 1e-9


def test_singular_positions_are_passed_as_before(tmp_path):
    # twice a turn all links lie on one line, and could fold; joints are redundant
    one, other = both_ways(four_bars(4), tmp_path, end_time=5.0, print_interval=0.5, tol=1e-10)
    for name in ("position", "quaternion"):
        tip = f"bodies/2/{name}"
        np.testing.assert_allclose(other[tip], one[tip], rtol=0, atol=1e-5)
    assert np.abs(passive(other)).max() < 1e-5


@pytest.mark.parametrize("sparse", [False, True])
def test_loops_that_cannot_close_are_told_alike(sparse, tmp_path, monkeypatch):
    prefer(monkeypatch, sparse)
    scene = ladder(6)
    # the last rung ends 0.3 m beside the plane of its rails
    joint = scene.joints[-1]
    joint.p_j, joint.p = joint.p, (0.5, joint.p[1], 0.3)
    with pytest.raises(
        ModelError, match=r"positions miss Constraint_Joint\[24\] \(offset along J's z\) by 0.049"
    ):
        scene.run(tmp_path, 0.1, 0.1)


@pytest.mark.parametrize("sparse", [False, True])
def test_no_bit_changes_where_all_but_a_checkpoint_is_forgotten(sparse, tmp_path, monkeypatch):
    prefer(monkeypatch, sparse)
    path = write_deck(tmp_path, ladder(5).xml(), 0.2, 0.1)
    one = mbsim.simulate(mbsim.read_model(path), integrator="DOPRI5")
    forgetful(monkeypatch)
    other = mbsim.simulate(mbsim.read_model(path), integrator="DOPRI5")
    for name in one.keys():
        np.testing.assert_array_equal(other[name], one[name], err_msg=name)


def sizes(graph):
    """Return blocks and updates of both factors, and products that add to them."""
    return np.array(
        [
            count
            for P in (graph.joints, graph.links)
            for count in (len(P.row), len(P.target), len(P.meets))
        ]
    )


@pytest.mark.parametrize("kind", [ladder, four_bars, separate])
def test_the_work_of_a_factor_grows_with_the_loops(kind, tmp_path):
    found = {n: sizes(of_scene(kind(n), tmp_path).graph) for n in (10, 20, 40, 80)}
    for n in (10, 20, 40):
        assert (found[2 * n] <= 2.3 * found[n]).all(), (n, found)


def test_the_work_of_a_net_grows_as_that_of_a_band(tmp_path):
    few, many = (sizes(of_scene(net(n, n), tmp_path).graph) for n in (4, 8))
    # four times as many knots, twice as many across: blocks of a band are knots times width
    assert (many <= 4.0 * 2.0**2.2 * few).all()


def test_equations_come_after_all_joints_of_their_loop(tmp_path):
    graph, tree = (scene := of_scene(ladder(8), tmp_path)).graph, scene.tree
    when = {int(k): n for n, k in enumerate(graph.tree) if k >= 0}
    for n in range(len(graph.tree)):
        if graph.several[n] == 0:
            continue
        for at in range(graph.first[n], graph.first[n + 1]):
            k = int(graph.bodies[graph.body[at]])
            while k >= 0:
                assert when[k] <= n
                k = int(tree.parent[k])


def test_few_loops_have_no_graph_and_loops_by_themselves_no_sparse_factor(tmp_path):
    scene = build(mbsim.read_model(MODELS / "four_bar.xml")).scene
    assert len(scene.graph.tree) == 0
    mbsim.simulate(mbsim.read_model(MODELS / "four_bar.xml"), end_time=0.01)
    assert scene.world.hooks[Hook.LOOPS] == 0

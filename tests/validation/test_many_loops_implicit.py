"""Implicit methods on many loops: multipliers as nodes of the elimination, or as a dense border."""

from __future__ import annotations

import numpy as np
import pytest

import mbsim
from helpers.decks import write_deck
from helpers.known_mechanisms import four_bars
from helpers.many_loops import ladder, net, separate
from mbsim.compile_model import tangent
from mbsim.compile_model.build import build
from mbsim.compile_model.program_dependence import find_depends
from mbsim.compile_model.tangent import make_tangent

#: The first rail is driven by its rate; the second turns against it as the third against that.
DRIVEN = """
<Motion_Joint id="900" joint_id="1" val_type="V" type="EXPRESSION" expr="0.5+0.2*TIME"/>
<Constraint_Coupler id="901" joint_ids="5 9" motion_types="R R" scales="1 -1"/>
"""
#: The same by its acceleration.
PUSHED = DRIVEN.replace('val_type="V"', 'val_type="A"').replace("0.5+0.2*TIME", "0.2")
SCENES = {
    "ladder": ladder(6),
    "light rungs": ladder(6, rung=1e-4),
    "four-bars": four_bars(5),
    "net": net(4, 4),
    "separate": separate(5),
}


def both_ways(scene, folder, monkeypatch, **settings):
    """Return results with a border of all equations, then with nodes."""
    found = []
    for fewest in (10**9, 1):
        monkeypatch.setattr(tangent, "_MANY_EQUATIONS", fewest)
        found.append(scene.run(folder, **settings))
    return found


def largest_difference(one, other):
    """Return by how much what bodies and joints do differs, over the largest number of a kind."""
    names = [name for name in one.keys() if name.startswith(("bodies/", "joints/", "couplers/"))]
    worst = 0.0
    for kind in ("position", "velocity", "force", "torque"):
        those = [name for name in names if name.rpartition("/")[2] == kind]
        a, b = (np.hstack([results[name] for name in those]) for results in (one, other))
        worst = max(worst, np.abs(a - b).max() / max(np.abs(a).max(), 1.0))
    return worst


@pytest.mark.parametrize("integrator", ["RADAU5", "GALPHA"])
@pytest.mark.parametrize("name", SCENES)
def test_nodes_give_what_the_border_gives(name, integrator, tmp_path, monkeypatch):
    one, other = both_ways(
        SCENES[name], tmp_path, monkeypatch,
        end_time=0.2, print_interval=0.05, tol=1e-6, integrator=integrator,
    )  # fmt: skip
    assert largest_difference(one, other) < 1e-7
    assert other.stats["steps"] == pytest.approx(one.stats["steps"], abs=2)


@pytest.mark.parametrize("extra", [DRIVEN, PUSHED])
def test_equations_of_rates_and_couplers_are_nodes_too(extra, tmp_path, monkeypatch):
    scene = ladder(6)
    # what is stated once more holds nothing new
    scene.joints.append(scene.joints[-1])
    scene.extra = extra
    one, other = both_ways(
        scene, tmp_path, monkeypatch,
        end_time=0.2, print_interval=0.05, tol=1e-6, integrator="RADAU5",
    )  # fmt: skip
    assert largest_difference(one, other) < 1e-7
    assert other.stats["jacobians"] <= one.stats["jacobians"] + 2


def test_folds_are_passed_as_with_the_border(tmp_path, monkeypatch):
    # twice a turn all links lie on one line, where no node has what its equations ask
    one, other = both_ways(
        four_bars(4), tmp_path, monkeypatch,
        end_time=5.0, print_interval=0.5, tol=1e-7, integrator="RADAU5",
    )  # fmt: skip
    np.testing.assert_allclose(
        other["bodies/2/position"], one["bodies/2/position"], rtol=0, atol=1e-5
    )
    assert other.stats["steps"] < 1.2 * one.stats["steps"]


def made(scene, folder):
    """Return the scene's arrays and those of its linearisation."""
    found = build(mbsim.read_model(write_deck(folder, scene.xml(), 1.0, 0.1))).scene
    return found, make_tangent(found, find_depends(found), pair=False)


def test_few_equations_have_no_nodes(tmp_path):
    scene, T = made(ladder(3), tmp_path)
    assert len(scene.equations.program) < 20
    assert len(T.pattern.order) == len(scene.bodies.mass)


def test_a_joint_is_one_node_of_the_bodies_that_it_holds(tmp_path):
    scene, T = made(ladder(9), tmp_path)
    P, nb = T.pattern, len(scene.bodies.mass)
    assert len(P.order) - nb == 9
    assert (P.node >= nb).all()
    # a rung's end, and the rail that it is joined to
    assert np.diff(P.first).tolist() == [2] * 9

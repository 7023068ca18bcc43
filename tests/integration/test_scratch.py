"""What is declared as scratch may be filled with NaN behind every step: no bit of a run changes.

And a checkpoint holds all the rest: state is filled with NaN as well, and put back from it.
"""

from __future__ import annotations

import numpy as np
import pytest

import mbsim
from helpers import mechanics as mech
from helpers.decks import COULOMB, GRAVITY, write_deck
from helpers.folders import MODELS
from helpers.forgetful import forgetful
from helpers.mechanism_decks import Joint, Scene
from helpers.pile_decks import pile

COUNTED = (
    *("steps", "rejected", "rhs_evaluations", "output_evaluations", "jacobians"),
    *("factorizations", "method_changes", "narrowphase_pairs", "h_smallest", "h_largest"),
)
#: Decks by method: single impacts, friction with memory, forces, sensors; time to be run [s].
QUICK = {
    ("DOPRI5", "bouncing_sphere"): 0.5,
    ("DOP853", "bouncing_sphere"): 0.5,
    ("GALPHA", "bouncing_sphere"): 0.5,
    ("RADAU5", "bouncing_sphere"): 0.5,
    ("DOPRI5", "mesh_on_plane"): 0.1,
    ("AUTO", "stiff/four_bar_stop"): 0.1,
    ("RADAU5", "stiff/four_bar_stop"): 0.1,
}
#: Meshes, joints, loops, stiction of contacts and joints, elements, changes between methods.
LONG = {
    ("VERLET", "bouncing_sphere"): 0.02,
    ("VERLET", "mesh_on_plane"): 0.1,
    ("GALPHA", "stiff/four_bar_stop"): 0.1,
    ("DOPRI5", "four_bar_stop"): 0.1,
    ("GALPHA", "four_bar_stop"): 0.1,
    ("AUTO", "slider_crank_clearance"): 0.01,
    ("AUTO", "four_bar"): 0.2,
    ("GALPHA", "slider_crank"): 0.1,
    ("AUTO", "stiff/box_stack"): 0.02,
    ("GALPHA", "stiff/box_stack"): 0.02,
    ("RADAU5", "stiff/box_stack"): 0.02,
    ("RADAU5", "stiff/lugre"): 1.0,
    ("RADAU5", "stiff/squeezer"): 0.01,
    ("AUTO", "stiff/incline_creep"): 0.5,
    ("AUTO", "stiction_rigid"): 0.5,
    ("GALPHA", "stiction_rigid"): 0.5,
    ("DOPRI5", "stiction_incline"): 0.3,
    ("GALPHA", "stiction_incline"): 0.3,
    ("DOP853", "lugre_stick_slip"): 1.0,
    ("AUTO", "sdnd100"): 0.1,
    ("AUTO", "sdnd121"): 0.1,
    ("AUTO", "cam_roller"): 0.05,
    ("DOPRI5", "dry_friction_element"): 0.3,
    ("RADAU5", "dry_friction_element"): 0.3,
    ("DOPRI5", "belt_weakening"): 0.3,
    ("RADAU5", "flyball_governor"): 0.3,
    ("DOPRI5", "poisson_walls"): 0.5,
    ("AUTO", "contensou_disc"): 0.2,
}


def unchanged(model, **settings):
    """Run a model as it is, and forgetting all behind every step; compare bit for bit."""
    one = mbsim.simulate(model, **settings)
    with pytest.MonkeyPatch.context() as patch:
        forgetful(patch)
        other = mbsim.simulate(model, **settings)
    assert one.stats["steps"] > 1
    assert sorted(one.keys()) == sorted(other.keys())
    for name in one.keys():
        np.testing.assert_array_equal(other[name], one[name], err_msg=name)
    for name in COUNTED:
        assert other.stats[name] == one.stats[name], name


@pytest.mark.parametrize(("method", "deck"), QUICK)
def test_scratch_is_scratch_and_a_checkpoint_holds_the_rest(method, deck):
    model = mbsim.read_model(MODELS / f"{deck}.xml")
    unchanged(model, integrator=method, end_time=QUICK[method, deck])


@pytest.mark.slow
@pytest.mark.parametrize(("method", "deck"), LONG)
def test_scratch_is_scratch_in_decks_of_all_kinds(method, deck):
    model = mbsim.read_model(MODELS / f"{deck}.xml")
    unchanged(model, integrator=method, end_time=LONG[method, deck])


@pytest.mark.parametrize("method", ["DOPRI5", "VERLET"])
def test_near_pairs_of_a_heap(method, tmp_path):
    # 36 balls are more pairs than are listed for good
    places = [(0.19 * (k % 6), 0.0, 0.1 + 0.21 * (k // 6)) for k in range(36)]
    law = {"damping": 50, "dmax": 1e-3, **COULOMB}
    model = mbsim.read_model(write_deck(tmp_path, pile(np.array(places), **law) + GRAVITY))
    assert mbsim.simulate(model, integrator=method, end_time=0.05).stats["pair_listings"] > 1
    unchanged(model, integrator=method, end_time=0.02 if method == "VERLET" else 0.05)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["DOPRI5", "RADAU5", "GALPHA"])
def test_a_loop_that_passes_a_fold(method, tmp_path):
    """A parallelogram with all its links on one line, and equations that are implied."""
    length, base, m = 1.0, 0.7, 1.0
    J = m * length**2 / 12.0
    rod, bar = (J, 1e-3 * J, J), (1e-3, m * base**2 / 12.0, m * base**2 / 12.0)
    turn, go = (0, 0, -4.0), (4.0 * length, 0, 0)
    half = (0.5 * go[0], 0, 0)
    bodies = [
        mech.Body(m, rod, (0, 0.5 * length, 0), v=half, w=turn),
        mech.Body(m, rod, (base, 0.5 * length, 0), v=half, w=turn),
        mech.Body(m, bar, (0.5 * base, length, 0), v=go),
    ]
    top = [(0, length, 0), (base, length, 0)]
    at = [(1, 0, (0, 0, 0)), (2, 0, (base, 0, 0)), (3, 1, top[0]), (3, 2, top[1])]
    scene = Scene(bodies, [Joint("REVOLUTE", *each) for each in at], (0, -9.81, 0))
    model = mbsim.read_model(write_deck(tmp_path, scene.xml(), 1.0, 0.05))
    unchanged(model, integrator=method, end_time=1.0, tol=1e-6)

"""Motions of velocities and accelerations with implicit methods: against DOPRI5, and their orders.

They hold neither positions (nor, of accelerations, velocities), which follow by integration.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import mbsim
from helpers.decks import write_deck
from helpers.mechanics import Body
from helpers.mechanism_decks import Joint, Scene
from mbsim.arrays import scene as arrays
from mbsim.core.address import vector_at, view
from mbsim.dynamics.pipeline import hooks
from mbsim.dynamics.pipeline.output import scaled_error
from mbsim.errors import SolverError

END = 1.0
#: Steps of two runs, and the tol of which only Newton's iteration knows: RADAU5's errors are to be
#: above what that leaves, some 1e-11, in steps that it solves.
RADAU5 = {
    "chain, rising rate": ((32, 64), 1e-9),
    "pulled, rate": ((256, 512), 1e-11),
    "pulled": ((128, 256), 1e-11),
}


def axes(x, y, z):
    """Return axes turned by angles about the global ones."""
    return Rotation.from_euler("xyz", (x, y, z)).as_matrix()


def rod(a, b):
    """Return a body of 1 kg with its cg midway between two points."""
    p = 0.5 * (np.array(a) + np.array(b))
    return Body(1.0, (0.03, 0.05, 0.04), tuple(map(float, p)), axes(0.3, 0.2, 0.1))


A, B, C, D, E = (0, 0, 0), (0.1, 0.4, 0), (1.0, 0.7, 0), (0.9, 0, 0), (0.6, 0.2, 0.3)
TIP = (1.2, 0.3, 0.4)
#: So little that a swing takes long against the steps below.
WEIGHT = (0.0, -2.0, -1.0)
#: A chain whose second body is free to swing in space; a loop with a body that hangs on it.
CHAIN = Scene(
    [rod(A, B), rod(B, TIP)],
    [Joint("REVOLUTE", 1, 0, p=A, R_i=axes(0.4, 0.5, 0)), Joint("SPHERICAL", 2, 1, p=B)],
    WEIGHT,
)
LOOP = Scene(
    [rod(A, B), rod(B, C), rod(C, D), rod(B, E)],
    [
        Joint("REVOLUTE", 1, 0, p=A),
        Joint("REVOLUTE", 2, 1, p=B),
        Joint("REVOLUTE", 3, 2, p=C),
        Joint("REVOLUTE", 3, 0, p=D),
        Joint("SPHERICAL", 4, 2, p=B),
    ],
    WEIGHT,
)
MOTIONS = {
    # it moves at the start, which only a projection knows
    "displacement": '<Motion_Joint id="1" joint_id="1" val_type="D" expr="0.75*SIN(2*TIME)"/>',
    "rate": '<Motion_Joint id="1" joint_id="1" val_type="V" expr="1.5*COS(2*TIME)"/>',
    "rising rate": '<Motion_Joint id="1" joint_id="1" val_type="A" expr="3*COS(2*TIME)"/>',
}
#: Of a point along an axis that turns with another body.
PULLS = {
    "rate": '<Motion_Marker id="1" i_marker_id="102" j_marker_id="101" direction="Y" '
    'val_type="V" expr="1.5*SIN(15*TIME)"/>',
    "rising rate": '<Motion_Marker id="1" i_marker_id="102" j_marker_id="101" direction="Y" '
    'val_type="A" expr="2*SIN(9*TIME)"/>',
}
DECKS = {f"chain, {name}": (CHAIN, text) for name, text in MOTIONS.items()}
DECKS |= {f"loop, {name}": (LOOP, text) for name, text in MOTIONS.items()}
DECKS |= {f"chain, pulled, {name}": (CHAIN, text) for name, text in PULLS.items()}


def run(folder, name, method, tol, rows=10, h_max=None):
    """Return the rows of positions and velocities of a deck's bodies, and its results."""
    scene, motion = DECKS[name]
    scene = Scene(scene.bodies, scene.joints, scene.g, motion)
    path = write_deck(folder, scene.xml(), END, END / rows)
    if h_max is not None:
        text = path.read_text(encoding="utf-8")
        path.write_text(text.replace("<Command>", f'<Command><Param_Transient h_max="{h_max}"/>'))
    found = mbsim.simulate(mbsim.read_model(path), integrator=method, tol=tol)
    bodies = range(2, 2 + len(scene.bodies))
    kept = ("position", "velocity", "angular_velocity")
    return np.hstack([found[f"bodies/{b}/{what}"] for b in bodies for what in kept]), found


@pytest.mark.parametrize("name", DECKS)
def test_implicit_methods_agree_with_dopri5(name, tmp_path):
    exact, _ = run(tmp_path, name, "DOPRI5", 1e-10)
    # it moves
    assert np.abs(np.ptp(exact, axis=0)).max() > 0.3
    for method, bound in (("RADAU5", 1e-8), ("GALPHA", 2e-4)):
        tol = 1e-10 if method == "RADAU5" else 1e-7
        found, results = run(tmp_path, name, method, tol)
        assert np.abs(found - exact).max() < bound
        assert results.stats["jacobians"] > 0
        assert results.stats["rejected"] < 0.2 * results.stats["steps"]


def _norm_of_differences(context, t, h, a, b):
    """The norm, which sees no error of a step."""
    scene = view(context, arrays.Scene)
    n = scene.rows.y.shape[1]
    if h != 0.0:
        return 0.0
    return scaled_error(scene, h, vector_at(a, n), vector_at(b, n))


def order_of(folder, name, method, tol, counts):
    """Return the order between two runs with steps of one length, against DOP853."""
    with pytest.MonkeyPatch.context() as patch:
        exact, _ = run(folder, name, "DOP853", 1e-13, rows=1)
        patch.setitem(hooks.HOOKS, "norm", _norm_of_differences)
        errors = []
        for n in counts:
            found, results = run(folder, name, method, tol, rows=1, h_max=END / n)
            # the first steps are shorter
            assert n <= results.stats["steps"] < n + 8
            errors.append(np.abs(found - exact)[-1].max())
    return math.log(errors[0] / errors[1]) / math.log(counts[1] / counts[0])


@pytest.mark.parametrize("name", DECKS)
def test_radau5_is_of_order_5(name, tmp_path):
    counts, tol = next((RADAU5[key] for key in RADAU5 if key in name), ((64, 128), 1e-10))
    assert order_of(tmp_path, name, "RADAU5", tol, counts) > 4.5


@pytest.mark.parametrize("name", DECKS)
def test_galpha_is_of_order_2(name, tmp_path):
    order = order_of(tmp_path, name, "GALPHA", 1e-9, (256, 1024))
    assert order == pytest.approx(2.0, abs=0.1)


JUMP = """
<Body_Rigid id="1" isground="TRUE"/>
<Reference_Marker id="10" body_id="1"/>
<Reference_Marker id="20" body_id="2"/>
<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="1" inertia_yy="1" inertia_zz="1"/>
<Constraint_Joint id="1" type="TRANSLATIONAL" i_marker_id="20" j_marker_id="10"/>
<Motion_Joint id="1" joint_id="1" val_type="V" expr="IF(TIME-0.503: 1, 1, -1)"/>
"""


@pytest.mark.parametrize("method", ["AUTO", "DOPRI5", "RADAU5", "GALPHA"])
def test_a_jump_of_a_velocity_stops_every_method(tmp_path, method):
    """It takes a force without bound: RADAU5, whose stages are projected, ran through it."""
    model = mbsim.read_model(write_deck(tmp_path, JUMP))
    with pytest.raises(SolverError, match=r"at time 0\.503 .*Motion_Joint\[1\]"):
        mbsim.simulate(model, integrator=method)

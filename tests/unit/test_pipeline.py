"""The compiled pipeline as a pure function of (y, committed state)."""

from __future__ import annotations

import ctypes
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from decks_io import COULOMB, GRAVITY, GROUND, MODELS, contact, sphere, write_deck

import mbsim
from mbsim.dynamics.hooks import mechanism
from mbsim.system.build import build

POINTER = ctypes.c_void_p
HOOK = ctypes.CFUNCTYPE(
    ctypes.c_double, ctypes.c_int64, ctypes.c_double, ctypes.c_double, POINTER, POINTER
)


def evaluator(path):
    """Return the scene, y0 and a function y -> y'."""
    system = build(mbsim.read_model(path), 1.0)
    problem, table = mechanism(system.scene)

    def rhs(y):
        f = np.full_like(y, np.nan)
        assert HOOK(problem.rhs)(problem.context, 0.0, 0.0, y.ctypes.data, f.ctypes.data) == 0
        return f

    rhs.table = table
    return system, rhs


@pytest.mark.parametrize("name", ["drop_m.xml", "incline_slip.xml", "sphere_pair.xml"])
def test_work_filled_with_nan_changes_nothing(name):
    system, rhs = evaluator(MODELS / name)
    y = system.y0.copy()
    if name == "drop_m.xml":
        y[2] = 0.0995
    first = rhs(y)
    keep = {"touching": 0, "fcl": 0, "trouble": 0}
    ground = len(system.scene.bodies.mass)
    for field, array in zip(system.scene.work._fields, system.scene.work, strict=True):
        if array.dtype == np.float64:
            fixed = array[ground].copy() if field in ("R", "v", "w") else None
            array[...] = np.nan
            if fixed is not None:
                array[ground] = fixed
        else:
            array[...] = keep[field] + 1 - 1
    second = rhs(y)
    assert first.tolist() == second.tolist()
    assert np.isfinite(first).all()


def test_forces_of_a_pair_are_opposite_and_conserve_momentum(tmp_path):
    model = (
        sphere(0.0, body=2, v=(0.3, 0.1, 0.5), w=(1.0, -2.0, 0.5))
        + sphere(0.19, body=3, mass=2.0, w=(0.3, 2.0, -1.0))
        + contact(300, 200, damping=5, dmax=1e-3, **COULOMB)
    )
    system, rhs = evaluator(write_deck(tmp_path, model))
    f = rhs(system.y0)
    assert np.abs(f[7:10]).max() > 0
    np.testing.assert_allclose(1.0 * f[7:10] + 2.0 * f[20:23], 0.0, atol=1e-10)
    # angular momentum about the global origin: r x m a + I alpha of both bodies
    total = np.zeros(3)
    for k, (mass, inertia) in enumerate([(1.0, 0.004), (2.0, 0.008)]):
        at = 13 * k
        total += np.cross(system.y0[at : at + 3], mass * f[at + 7 : at + 10])
        total += inertia * f[at + 10 : at + 13]
    np.testing.assert_allclose(total, 0.0, atol=1e-10)


def test_spheres_on_a_plane_need_neither_fcl_trimesh_nor_matplotlib(tmp_path):
    import subprocess

    path = write_deck(tmp_path, GROUND + sphere(0.3) + contact(**COULOMB) + GRAVITY)
    code = (
        "import sys, mbsim; "
        f"mbsim.simulate(mbsim.read_model({str(path)!r}), end_time=0.3); "
        "print(sorted({'fcl', 'trimesh', 'matplotlib', 'rich'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"

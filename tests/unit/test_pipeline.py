"""The compiled pipeline as a pure function of (y, committed state)."""

from __future__ import annotations

import ctypes
import sys

import numpy as np
import pytest

import mbsim
from helpers.decks import COULOMB, GRAVITY, GROUND, contact, sphere, write_deck
from helpers.folders import MODELS
from mbsim.compile_model.build import build
from mbsim.core.problem import EACH, RATES
from mbsim.dynamics.pipeline.problem import mechanism

POINTER = ctypes.c_void_p
HOOK = ctypes.CFUNCTYPE(
    ctypes.c_int64, ctypes.c_int64, ctypes.c_double, ctypes.c_double, POINTER, POINTER
)
MEASURE = ctypes.CFUNCTYPE(
    ctypes.c_double, ctypes.c_int64, ctypes.c_double, ctypes.c_double, POINTER, POINTER
)


def evaluator(path):
    """Return the scene, y0 and a function y -> y'."""
    system = build(mbsim.read_model(path))
    problem, table = mechanism(system.scene)

    def rhs(y):
        f = np.full_like(y, np.nan)
        assert HOOK(problem.rhs)(problem.context, 0.0, 0.0, y.ctypes.data, f.ctypes.data) == 0
        return f

    rhs.table = table
    return system, rhs


@pytest.mark.parametrize(("name", "rigid"), [("drop_m.xml", False), ("stiction_rigid.xml", True)])
def test_only_rigid_friction_has_its_arrays(name, rigid):
    work = build(mbsim.read_model(MODELS / name)).scene.work
    arrays = (work.sticking_point, work.sticking_force, work.look)
    assert {array.size > 0 for array in arrays} == {rigid}


@pytest.mark.parametrize("name", ["drop_m.xml", "incline_slip.xml", "sphere_pair.xml"])
def test_work_filled_with_nan_changes_nothing(name):
    system, rhs = evaluator(MODELS / name)
    y = system.y0.copy()
    if name == "drop_m.xml":
        y[2] = 0.0995
    first = rhs(y)
    ground = len(system.scene.bodies.mass)
    graphics = system.scene.graphics
    on_ground = graphics.body == ground
    for field, array in zip(system.scene.work._fields, system.scene.work, strict=True):
        if array.dtype == np.float64:
            before = array.copy()
            array[...] = np.nan
            if field in ("R", "v", "w"):
                array[ground] = before[ground]
            if field in ("frames", "travel", "speed"):
                array[on_ground] = before[on_ground]
            if field == "frames":
                # nobody turns a sphere
                array[graphics.turns == 0, 3:] = before[graphics.turns == 0, 3:]
        else:
            array[...] = 0
    second = rhs(y)
    assert first.tolist() == second.tolist()
    assert np.isfinite(first).all()


def test_sizes_of_many_differences_at_once_are_those_of_each(tmp_path):
    model = sphere(0.0, body=2, v=(0.3, 0.1, 0.5)) + sphere(0.19, body=3, mass=2.0)
    path = write_deck(tmp_path, model + contact(300, 200, damping=5, dmax=1e-3, **COULOMB))
    system = build(mbsim.read_model(path))
    problem, table = mechanism(system.scene)
    y, n = system.y0.copy(), len(system.y0)
    rhs, norm = HOOK(problem.rhs), MEASURE(problem.norm)
    f = np.zeros(n)
    assert rhs(problem.context, 0.0, 0.0, y.ctypes.data, f.ctypes.data) == 0
    differences = np.zeros((RATES, n))
    # of bodies alone; the last row is none
    differences[:-1, :26] = np.random.default_rng(5).standard_normal((RATES - 1, 26))
    each = [norm(problem.context, 0.0, 0.0, d.ctypes.data, y.ctypes.data) for d in differences]
    norm(problem.context, 0.0, EACH, differences.ctypes.data, y.ctypes.data)
    assert differences[:, 0].tolist() == each
    assert min(each[:-1]) > 0.0
    del table


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


def quaternion_about_z(angle):
    return np.array([np.cos(angle / 2), 0.0, 0.0, np.sin(angle / 2)])


def test_incident_marker_turns_with_a_turntable(tmp_path):
    from mbsim.dynamics.bodies.kinematics import place_bodies
    from mbsim.dynamics.contact.frames import tangent

    # a ball on a disc, both moving bodies; the frame must turn with both
    disc = """<Body_Rigid id="3" cg_id="30" mass="1" inertia_xx="1" inertia_yy="1" inertia_zz="2"/>
    <Reference_Marker id="30" body_id="3"/>
    <Post_Graphic id="300" type="BoxDefinedFromCenter" center_marker_id="30"
      length_x="2" length_y="2" length_z="0.2"/>"""
    (tmp_path / "law.py").write_text(
        "def CFFSUB(id, time, par, npar, loci, locj, x, xdot, nforce, dflag, iflag):\n"
        "    return [-x[0], -x[1], 0.0]\n"
    )
    law = {"cff_type": "USERCFF", "cff_fnc_name": "CFFSUB", "script_name": "law.py"}
    model = sphere(0.1999, x=0.4) + disc + contact(200, 300, **law)
    system, rhs = evaluator(write_deck(tmp_path, model))
    scene, y = system.scene, system.y0.copy()
    rhs(y)
    n = (0.0, 0.0, 1.0)
    place_bodies(scene, y)
    gi = int(scene.pairs.graphic_i[0])
    bodies = int(scene.graphics.body[gi]), int(scene.graphics.body[1 - gi])
    born = np.array(tangent(scene, 0.0, y, 0, 0, gi, *bodies, n))
    # at birth: I's marker x-axis projected
    np.testing.assert_allclose(born, [1.0, 0.0, 0.0], atol=1e-15)

    scene.state.touching[0] = 1
    scene.state.t[0], scene.state.n[0] = born, n
    scene.state.q[:2] = y[[3, 4, 5, 6]], y[[16, 17, 18, 19]]
    for ball, table, expected in ((0.3, 0.3, 0.3), (0.4, 0.0, 0.2), (-2.0, -2.0, -2.0)):
        turned = y.copy()
        turned[3:7], turned[16:20] = quaternion_about_z(ball), quaternion_about_z(table)
        place_bodies(scene, turned)
        t = np.array(tangent(scene, 0.0, turned, 0, 0, gi, *bodies, n))
        np.testing.assert_allclose(t, [np.cos(expected), np.sin(expected), 0.0], atol=1e-14)


def test_a_body_that_tumbles_turns_about_a_normal_by_the_integral_of_its_spin():
    from scipy.integrate import solve_ivp
    from scipy.spatial.transform import Rotation

    from mbsim.core.rotation import turn_about

    inertia, normal = np.array([1.0, 2.0, 3.0]), (0.0, 0.0, 1.0)

    def rates(t, y):
        q, w = y[:4], y[4:7]
        turn = 0.5 * np.array([-q[1:] @ w, *(q[0] * w + np.cross(q[1:], w))])
        spin = Rotation.from_quat(q, scalar_first=True).apply(w)
        return np.array([*turn, *(-np.cross(w, inertia * w) / inertia), *spin])

    off = []
    for steps in (20, 40):
        times = np.linspace(0.0, 2.0, steps + 1)
        start = [1.0, 0.0, 0.0, 0.0, 1.0, 2.0, 0.5, 0.0, 0.0, 0.0]
        y = solve_ivp(
            rates, (0.0, 2.0), start, method="DOP853", rtol=1e-12, atol=1e-13, t_eval=times
        ).y
        w = Rotation.from_quat(y[:4].T, scalar_first=True).apply(y[4:7].T)
        turned = sum(
            turn_about(y[:4, k + 1], y[:4, k], tuple(w[k + 1]), tuple(w[k]), normal, normal, h)
            for k, h in enumerate(np.diff(times))
        )
        off.append(abs(turned - y[9, -1]))
    # 4.0e-6, 2.5e-7: order 4; 0.1 of the rotation's twist alone, of order 2
    assert off[0] < 1e-5
    assert off[1] < off[0] / 12.0


def test_incident_marker_follows_the_normal_by_the_shortest_rotation():
    from mbsim.core.rotation import turn_with_normal

    tilt = 0.3
    t = turn_with_normal((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (np.sin(tilt), 0.0, np.cos(tilt)))
    np.testing.assert_allclose(t, [np.cos(tilt), 0.0, -np.sin(tilt)], atol=1e-15)
    # about the tangent itself nothing turns
    t = turn_with_normal((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, np.sin(tilt), np.cos(tilt)))
    np.testing.assert_allclose(t, [1.0, 0.0, 0.0], atol=1e-15)


def test_user_law_sees_the_surface_points_in_the_markers_axes(tmp_path):
    (tmp_path / "law.py").write_text(
        "seen = {}\n"
        "def CFFSUB(id, time, par, npar, loci, locj, x, xdot, nforce, dflag, iflag):\n"
        "    seen.update(id=id, time=time, par=par, npar=npar, loci=loci, locj=locj,\n"
        "                xdot=xdot, nforce=nforce, dflag=dflag, iflag=iflag)\n"
        "    return [0.0, 0.0, 0.0]\n"
    )
    law = {
        "cff_type": "USERCFF",
        "cff_param_string": "USER(1,2.5)",
        "cff_fnc_name": "CFFSUB",
        "script_name": "law.py",
    }
    model = """<Body_Rigid id="1" isground="TRUE"/>
    <Reference_Marker id="10" body_id="1" pos_x="1.0" psi="1.5707963267948966"/>
    <Post_Graphic id="100" type="Plane" rm_id="10"/>"""
    deck = write_deck(
        tmp_path,
        model + sphere(0.098, x=1.3, v=(0.5, 0.2, 0.0), w=(0.0, 0.0, 3.0)) + contact(**law),
    )
    system, rhs = evaluator(deck)
    rhs(system.y0)
    seen = system.user_friction[301].function.__globals__["seen"]
    assert (seen["id"], seen["npar"], seen["par"]) == (301, 2, [1.0, 2.5])
    assert (seen["dflag"], seen["iflag"]) == (0, 0)
    # the ball's lowest point, 2 mm below the plane; the plane's highest, in its turned marker
    np.testing.assert_allclose(seen["loci"], [0.0, 0.0, -0.1], atol=1e-15)
    np.testing.assert_allclose(seen["locj"], [0.0, -0.3, 0.0], atol=1e-15)
    np.testing.assert_allclose(seen["xdot"], [0.5, 0.2, 3.0], atol=1e-15)
    assert seen["nforce"] == pytest.approx(1e5 * 0.002**1.5)

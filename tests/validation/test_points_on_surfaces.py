"""Points that stay on surfaces of users' functions, against motions that are integrated apart."""

from __future__ import annotations

import re

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import mbsim
from helpers.decks import run_in_pieces
from mbsim.errors import MbsimError, SolverError

GRAVITY = 10.0
SURFACES = """
import math


def bowl(id, par, npar, u, v, iord, iflag):
    return [u, v, par[0] * (u * u + v * v)]


def ball(id, par, npar, u, v, iord, iflag):
    r = par[0]
    return [r * math.cos(v) * math.cos(u), r * math.cos(v) * math.sin(u), r * math.sin(v)]


def kink(id, par, npar, u, v, iord, iflag):
    return [u, v, abs(u - 0.3)]


def none(id, par, npar, u, v, iord, iflag):
    return [u, v]


def fails(id, par, npar, u, v, iord, iflag):
    return [u, v, 1 / 0]


def short(id, par, npar, u):
    return [u, u, u]
"""
BOWL = 'u_start="-2" u_end="2" v_start="-2" v_end="2" usrsub_param_string="USER(0.5)"'
BALL = (
    'is_u_closed="TRUE" u_start="0" u_end="6.283185307179586" v_start="-1.45" v_end="1.45" '
    'usrsub_param_string="USER(1)"'
)


def deck(name, surface, place, velocity, more="", gravity=GRAVITY, of=10):
    """Return a point on a surface in the axes of marker `of`."""
    x, y, z = place
    of_axes = zip("xyz", velocity, strict=True)
    v = " ".join(f'v_ic_{a}="{c!r}" v_ic_{a}_flag="TRUE"' for a, c in of_axes)
    return f"""<MotionSolve><Model>
<Body_Rigid id="1" isground="TRUE"/>
<Body_Rigid id="2" cg_id="20" mass="2" inertia_xx="1" inertia_yy="1" inertia_zz="1" {v}/>
<Reference_Marker id="10" body_id="1"/>
<Reference_Marker id="20" body_id="2" pos_x="{x!r}" pos_y="{y!r}" pos_z="{z!r}"/>
{more}
<Reference_ParamSurface id="5" {surface} type="USERSUB" usrsub_fnc_name="{name}"
 script_name="surfaces.py" interpreter="Python"/>
<Constraint_PTSF id="1" i_marker_id="20" j_marker_id="{of}" surface_id="5"/>
<Force_Gravity grav_z="{-gravity}"/>
</Model><Command>
<Simulate analysis_type="Transient" end_time="2" print_interval="0.1"/>
</Command></MotionSolve>"""


def written(text, path):
    (path / "surfaces.py").write_text(SURFACES)
    file = path / "deck.xml"
    file.write_text(text)
    return file


def run(text, path, **how):
    return mbsim.simulate(written(text, path), notify=lambda line: None, **how)


def in_bowl(times, a=0.5):
    """Return places of a point in z = a (x^2 + y^2), by the force along its normal."""

    def f(t, s):
        x, y, vx, vy = s
        k = (GRAVITY + 2 * a * (vx * vx + vy * vy)) / (1 + 4 * a * a * (x * x + y * y))
        return [vx, vy, -2 * a * x * k, -2 * a * y * k]

    how = {"rtol": 1e-12, "atol": 1e-13, "t_eval": times}
    x, y, *_ = solve_ivp(f, (0.0, times[-1]), [0.8, 0.0, 0.0, 1.5], **how).y
    return np.column_stack([x, y, a * (x * x + y * y)])


@pytest.mark.parametrize("method", ["DOPRI5", "DOP853", "RADAU5", "GALPHA", "MOREAU"])
def test_a_point_in_a_bowl(method, tmp_path):
    text, off = deck("bowl", BOWL, (0.8, 0.0, 0.32), (0.0, 1.5, 0.0)), []
    for tol in (1e-5, 1e-8):
        with run(text, tmp_path, integrator=method, tol=tol) as results:
            x, t = results["bodies/2/position"], results["time"]
            force = results["points_on_surfaces/1/force"]
            pull = 2.0 * (results["bodies/2/acceleration"] + [0.0, 0.0, GRAVITY])
            energy = results["energy/kinetic"] + results["energy/potential"]
        off.append(np.abs(x - in_bowl(t)).max())
        assert np.abs(force - pull).max() < 1e-6
        assert np.abs(energy - energy[0]).max() < (1e-2 if tol > 1e-6 else 1e-4)
    assert off[0] < 1e-3
    assert off[1] < (2e-5 if method == "GALPHA" else 2e-7)


@pytest.mark.parametrize("method", ["DOPRI5", "RADAU5"])
def test_a_point_on_a_sphere_is_a_spherical_pendulum(method, tmp_path):
    begin, v = np.array([0.8, 0.0, -0.6]), np.array([0.0, 2.0, 0.0])
    text = deck("ball", BALL, begin.tolist(), v.tolist())

    def f(t, s):
        x, v = s[:3], s[3:]
        free = np.array([0.0, 0.0, -GRAVITY])
        return [*v, *(free - x * (x @ free + v @ v) / (x @ x))]

    with run(text, tmp_path, integrator=method, tol=1e-8) as results:
        x, t = results["bodies/2/position"], results["time"]
    how = {"rtol": 1e-12, "atol": 1e-13, "t_eval": t}
    truth = solve_ivp(f, (0.0, t[-1]), [*begin, *v], **how).y[:3].T
    # it goes round more than once, over where u begins
    assert np.unwrap(np.arctan2(x[:, 1], x[:, 0]))[-1] > 2.0 * np.pi
    assert np.abs(x - truth).max() < 2e-7
    assert np.abs(np.linalg.norm(x, axis=1) - 1.0).max() < 1e-9


def test_a_surface_on_a_free_body_keeps_momentum_and_energy(tmp_path):
    more = """<Body_Rigid id="3" cg_id="30" mass="3" inertia_xx="1" inertia_yy="1.4"
 inertia_zz="0.8" w_ic_x="0.4" w_ic_x_flag="TRUE" w_ic_z="1" w_ic_z_flag="TRUE"/>
<Reference_Marker id="30" body_id="3"/>"""
    text = deck("bowl", BOWL, (0.8, 0.0, 0.32), (0.0, 1.5, 0.3), more, 0.0, 30)
    with run(text, tmp_path, tol=1e-9) as results:
        v = [results[f"bodies/{id}/velocity"] for id in (2, 3)]
        momentum, energy = 2.0 * v[0] + 3.0 * v[1], results["energy/kinetic"]
    assert np.abs(momentum - momentum[0]).max() < 1e-10
    assert np.abs(energy - energy[0]).max() < 1e-7


@pytest.mark.parametrize("method", ["DOPRI5", "RADAU5"])
def test_a_run_in_pieces_is_the_straight_one(method, tmp_path, monkeypatch):
    file = written(deck("bowl", BOWL, (0.8, 0.0, 0.32), (0.0, 1.5, 0.0)), tmp_path)
    how = {"integrator": method, "notify": lambda line: None}
    whole = mbsim.simulate(file, **how)
    pieces = run_in_pieces(file, tmp_path / "cut", monkeypatch, (3,), **how)
    for name in ("bodies/2/position", "points_on_surfaces/1/force"):
        assert (whole[name] == pieces[name]).all()


def test_the_edge_of_a_surface_ends_the_run(tmp_path):
    text = deck("bowl", BOWL, (0.8, 0.0, 0.32), (8.0, 0.0, 0.0))
    said = r"Constraint_PTSF\[1\] comes to an end of its surface at"
    with pytest.raises(SolverError, match=said):
        run(text, tmp_path)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (('"bowl"', '"kink"'), "Reference_ParamSurface[5]: kink is not smooth enough"),
        (('"bowl"', '"none"'), "Reference_ParamSurface[5]: none at u -2, v -2 returned 2 values"),
        (('"bowl"', '"fails"'), "fails failed at u -2, v -2: ZeroDivisionError"),
        (('"bowl"', '"short"'), "cannot be called with the 7 arguments"),
        (('"bowl"', '"other"'), "other"),
        (('u_start="-2"', 'u_start="-2" is_u_closed="TRUE"'), "bowl does not close: is_u_closed"),
        (('u_end="2"', 'u_end="-3"'), 'u_end="-3": must be more than u_start'),
        (('surface_id="5"', 'surface_id="6"'), "6"),
        (('surface_id="5"', 'surface_id="5" disp_x0="1"'), "disp_x0, disp_y0 and disp_z0"),
    ],
)
def test_what_is_no_surface_is_refused(change, said, tmp_path):
    text = deck("bowl", BOWL, (0.8, 0.0, 0.32), (0.0, 1.5, 0.0))
    assert change[0] in text
    with pytest.raises(MbsimError, match=re.escape(said)):
        run(text.replace(*change), tmp_path)

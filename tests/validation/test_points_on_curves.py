"""Points that stay on curves against motion along the curve's parameter, integrated apart."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import BSpline, make_interp_spline

import mbsim
from mbsim.errors import DeckError, SolverError

MASS, GRAVITY = 2.0, 10.0


def deck(points, *, curve="", hoop="", extra="", start=None, end_time=2.0, of_curve=10):
    """Return a bead that a curve holds; `hoop` is the body that carries the curve."""
    x, y, z = (points[0] if start is None else start).tolist()
    text = "\n".join(" ".join(f"{v!r}" for v in point) for point in points.tolist())
    return f"""<MotionSolve><Model>
<Body_Rigid id="1" isground="TRUE"/>
<Body_Rigid id="2" cg_id="20" mass="{MASS}" inertia_xx="0.01" inertia_yy="0.01" inertia_zz="0.01"/>
{hoop}
<Reference_Marker id="10" body_id="1"/>
<Reference_Marker id="20" body_id="2" pos_x="{x!r}" pos_y="{y!r}" pos_z="{z!r}"/>
<Reference_ParamCurve id="5" {curve}>{text}</Reference_ParamCurve>
<Constraint_PTCV id="1" i_marker_id="20" j_marker_id="{of_curve}" curve_id="5"/>
<Force_Gravity grav_z="{-GRAVITY}"/>
{extra}
</Model><Command>
<Simulate analysis_type="Transient" end_time="{end_time}" print_interval="0.1"/>
</Command></MotionSolve>"""


def parameters(points):
    ways = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    return -1.0 + 2.0 * ways / ways[-1]


def along(spline, u, times, omega=0.0, round=False):
    """Return places of a bead that starts at rest at u on a curve turned about z at a rate."""
    slopes, bends = spline.derivative(), spline.derivative(2)

    def f(t, state):
        at = (state[0] + 1.0) % 2.0 - 1.0 if round else state[0]
        x, dx, ddx = spline(at), slopes(at), bends(at)
        pull = np.array([omega**2 * x[0], omega**2 * x[1], -GRAVITY])
        return [state[1], (pull @ dx - dx @ ddx * state[1] ** 2) / (dx @ dx)]

    found = solve_ivp(f, (0.0, times[-1]), [u, 0.0], rtol=1e-12, atol=1e-13, t_eval=times)
    u = found.y[0]
    return spline((u + 1.0) % 2.0 - 1.0 if round else u)


def run(text, path, **how):
    file = path / "bead.xml"
    file.write_text(text)
    return mbsim.simulate(file, notify=lambda line: None, **how)


def helix(count):
    angle = np.linspace(0.0, 3.0 * np.pi, count)
    return np.column_stack([np.cos(angle), np.sin(angle), -0.2 * angle])


@pytest.mark.parametrize("method", ["DOPRI5", "DOP853", "RADAU5", "GALPHA", "MOREAU"])
@pytest.mark.parametrize("quintic", [False, True])
def test_a_bead_slides_down_a_helix(method, quintic, tmp_path):
    points = helix(40)
    spline = make_interp_spline(parameters(points), points, 5 if quintic else 3)
    curve = f'quintic="{quintic}"'.upper().replace("QUINTIC", "quintic")
    off = []
    for tol in (1e-5, 1e-8):
        with run(deck(points, curve=curve), tmp_path, integrator=method, tol=tol) as results:
            x, t = results["bodies/2/position"], results["time"]
            off.append(np.abs(x - along(spline, -1.0, t)).max())
            energy = results["energy/kinetic"] + results["energy/potential"]
            assert np.abs(energy - energy[0]).max() < (1e-2 if tol > 1e-6 else 1e-4)
    assert off[0] < 1e-3
    assert off[1] < (1e-5 if method == "GALPHA" else 2e-7)


def test_the_curve_holds_by_forces_across_it(tmp_path):
    points = helix(40)
    with run(deck(points), tmp_path, integrator="DOP853", tol=1e-9) as results:
        a, v = results["bodies/2/acceleration"], results["bodies/2/velocity"]
        force = results["points_on_curves/1/force"]
    assert np.abs(force - MASS * (a + np.array([0.0, 0.0, GRAVITY]))).max() < 1e-6
    assert np.abs((force * v).sum(axis=1)).max() < 1e-6


def test_points_of_a_matrix_are_those_of_the_curve(tmp_path):
    points = helix(40)
    numbers = " ".join(f"{v!r}" for v in points.T.ravel().tolist())
    text = deck(points).replace(
        "<Constraint_PTCV",
        f'<Reference_Matrix id="3" nrow="40" ncol="3">{numbers}</Reference_Matrix><Constraint_PTCV',
    )
    begin = text.index("<Reference_ParamCurve")
    end = text.index("</Reference_ParamCurve>") + len("</Reference_ParamCurve>")
    text = text[:begin] + '<Reference_ParamCurve id="5" matrix_id="3"/>' + text[end:]
    with run(text, tmp_path) as one, run(deck(points), tmp_path) as other:
        assert (one["bodies/2/position"] == other["bodies/2/position"]).all()


def circle(count, radius=1.0):
    angle = np.linspace(0.0, 2.0 * np.pi, count)
    angle[-1] = 0.0
    return radius * np.column_stack([np.sin(angle), 0.0 * angle, -np.cos(angle)])


@pytest.mark.parametrize("method", ["DOPRI5", "RADAU5"])
def test_a_bead_on_a_turning_hoop(method, tmp_path):
    # faster than sqrt(g/R) it swings about another place than the lowest
    omega, points = 4.0, circle(33)
    hoop = """<Body_Rigid id="3" cg_id="30" mass="1" inertia_xx="1" inertia_yy="1" inertia_zz="1"
 w_ic_z="4" w_ic_z_flag="TRUE"/>
<Reference_Marker id="30" body_id="3"/><Reference_Marker id="31" body_id="3"/>
<Constraint_Joint id="1" type="REVOLUTE" i_marker_id="31" j_marker_id="10"/>
<Motion_Joint id="1" joint_id="1" motion_type="R" val_type="D" expr="4*TIME"/>"""
    text = deck(points, curve='is_u_closed="TRUE"', hoop=hoop, start=points[3], of_curve=31)
    v = float(omega * points[3][0])
    text = text.replace(
        '<Body_Rigid id="2"', f'<Body_Rigid id="2" v_ic_y="{v!r}" v_ic_y_flag="TRUE"'
    )
    spline = make_interp_spline(parameters(points), points, 3, bc_type="periodic")
    with run(text, tmp_path, integrator=method, tol=1e-9) as results:
        t, x = results["time"], results["bodies/2/position"]
        truth = along(spline, parameters(points)[3], t, omega)
    c, s = np.cos(omega * t), np.sin(omega * t)
    back = np.column_stack([c * x[:, 0] + s * x[:, 1], c * x[:, 1] - s * x[:, 0], x[:, 2]])
    assert np.abs(back - truth).max() < 1e-7


def test_a_closed_curve_is_gone_round_and_round(tmp_path):
    points = circle(33)
    text = deck(points, curve='is_u_closed="TRUE"', start=points[0], end_time=3.0).replace(
        '<Body_Rigid id="2"', '<Body_Rigid id="2" v_ic_x="8" v_ic_x_flag="TRUE"'
    )
    with run(text, tmp_path, tol=1e-8) as results:
        x, energy = results["bodies/2/position"], results["energy/kinetic"]
        turned = np.unwrap(np.arctan2(x[:, 0], -x[:, 2]))
        assert turned[-1] > 2.0 * 2.0 * np.pi
        assert np.abs(np.linalg.norm(x, axis=1) - 1.0).max() < 1e-5
        total = energy + results["energy/potential"]
        assert np.abs(total - total[0]).max() < 1e-5 * energy[0]


def test_a_curve_on_a_free_body_keeps_the_momentum(tmp_path):
    hoop = """<Body_Rigid id="3" cg_id="30" mass="3" inertia_xx="1" inertia_yy="1.4"
 inertia_zz="0.8" w_ic_x="0.4" w_ic_x_flag="TRUE" w_ic_z="1" w_ic_z_flag="TRUE"/>
<Reference_Marker id="30" body_id="3"/><Reference_Marker id="31" body_id="3"/>"""
    points = circle(33)
    text = deck(points, curve='is_u_closed="TRUE"', hoop=hoop, start=points[0], of_curve=31)
    text = text.replace(f'grav_z="{-GRAVITY}"', 'grav_z="0"').replace(
        '<Body_Rigid id="2"', '<Body_Rigid id="2" v_ic_x="3" v_ic_x_flag="TRUE"'
    )
    with run(text, tmp_path, tol=1e-9) as results:
        v = [results[f"bodies/{id}/velocity"] for id in (2, 3)]
        momentum = MASS * v[0] + 3.0 * v[1]
        energy = results["energy/kinetic"]
    assert np.abs(momentum - momentum[0]).max() < 1e-10
    assert np.abs(energy - energy[0]).max() < 1e-7


def test_points_beside_the_curve_draw_it(tmp_path):
    points = helix(12)
    n = len(points)
    knots = np.concatenate([np.zeros(3), np.arange(n - 2), np.full(3, n - 3)]) * 2.0 / (n - 3) - 1.0
    spline = BSpline(knots, points, 3)
    text = deck(points, curve='is_curve_points="FALSE"', end_time=1.0)
    with run(text, tmp_path, tol=1e-8) as results:
        t, x = results["time"], results["bodies/2/position"]
        assert np.abs(x - along(spline, -1.0, t)).max() < 1e-6


@pytest.mark.parametrize("method", ["DOPRI5", "RADAU5"])
def test_the_end_of_a_curve_ends_the_run(method, tmp_path):
    points = helix(12)[:4]
    with pytest.raises(SolverError, match=r"Constraint_PTCV\[1\] comes to an end of its curve at"):
        run(deck(points), tmp_path, integrator=method)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (('curve_id="5"', 'curve_id="6"'), r"Reference_ParamCurve\[6\]|no Reference_ParamCurve"),
        (
            ('id="5" >', 'id="5" is_u_closed="TRUE">'),
            "last point of a closed curve must be the first",
        ),
        (('id="5" >', 'id="5" nrow="7">'), "must be 7 rows of x, y and z"),
        (('id="5" >', 'id="5" matrix_id="9">'), "needs its points once"),
        (('id="5" >', 'id="5" u_start="0">'), "CURSUB is documented but not built yet"),
        (('curve_id="5"/>', 'curve_id="5" disp_x0="1"/>'), "disp_x0, disp_y0 and disp_z0"),
    ],
)
def test_what_is_no_curve_is_refused(change, said, tmp_path):
    text = deck(helix(12))
    assert change[0] in text
    file = tmp_path / "bead.xml"
    file.write_text(text.replace(*change))
    with pytest.raises(DeckError, match=said):
        mbsim.read_model(file)


def test_points_that_are_too_few_or_one_are_refused(tmp_path):
    points = helix(12)
    for wrong, said in ((points[:3], "4 points or more"), (points[[0, 1, 1, 2]], "are one")):
        file = tmp_path / "bead.xml"
        file.write_text(deck(wrong))
        with pytest.raises(DeckError, match=said):
            mbsim.read_model(file)

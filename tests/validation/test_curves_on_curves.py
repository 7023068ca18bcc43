"""Curves that touch curves: cams and discs against closed forms, free bodies by what they keep."""

from __future__ import annotations

import re

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import mbsim
from helpers.decks import run_in_pieces
from mbsim.errors import DeckError, SolverError

GRAVITY = 10.0


def ellipse(a, b, count=65, x=0.0):
    angle = np.linspace(0.0, 2.0 * np.pi, count)
    angle[-1] = 0.0
    return np.column_stack([x + a * np.cos(angle), b * np.sin(angle), 0.0 * angle])


def curve(id, points, closed=True):
    text = " ".join(f"{v!r}" for v in np.asarray(points, dtype=float).ravel().tolist())
    closed = "TRUE" if closed else "FALSE"
    return (
        f'<Reference_ParamCurve id="{id}" is_u_closed="{closed}" quintic="TRUE">{text}'
        "</Reference_ParamCurve>"
    )


def deck(model, end_time=2.0, gravity=GRAVITY):
    return f"""<MotionSolve><Model>
<Body_Rigid id="1" isground="TRUE"/>
<Reference_Marker id="10" body_id="1"/>
{model}
<Force_Gravity grav_y="{-gravity}"/>
</Model><Command>
<Simulate analysis_type="Transient" end_time="{end_time}" print_interval="0.1"/>
</Command></MotionSolve>"""


def run(text, path, **how):
    file = path / "cam.xml"
    file.write_text(text)
    return mbsim.simulate(file, notify=lambda line: None, **how)


def disc(more="", ring=2.0, radius=0.5):
    """Return a free disc that spins and slides in a ring, begun 0.3 beside the lowest place."""
    y = -float(np.sqrt((ring - radius) ** 2 - 0.09))
    return f"""<Body_Rigid id="2" cg_id="20" mass="2" inertia_xx="0.1" inertia_yy="0.2"
 inertia_zz="0.25" w_ic_z="3" w_ic_z_flag="TRUE"/>
<Reference_Marker id="20" body_id="2" pos_x="0.3" pos_y="{y!r}"/>
{curve(5, ellipse(ring, ring))}{curve(6, ellipse(radius, radius))}
<Constraint_CVCV id="1" i_marker_id="20" i_curve_id="6" j_marker_id="10" j_curve_id="5" {more}/>"""


@pytest.mark.parametrize("method", ["DOPRI5", "DOP853", "RADAU5", "GALPHA", "MOREAU"])
def test_a_disc_slides_in_a_ring_as_a_pendulum_swings(method, tmp_path):
    arm = 1.5
    off = []
    for tol in (1e-5, 1e-8):
        with run(deck(disc()), tmp_path, integrator=method, tol=tol) as results:
            x, t, w = (
                results[n] for n in ("bodies/2/position", "time", "bodies/2/angular_velocity")
            )
            force = np.linalg.norm(results["curves_on_curves/1/force"], axis=1)
        begin = [np.arcsin(0.3 / arm), 0.0]
        truth = solve_ivp(
            lambda t, s: [s[1], -GRAVITY / arm * np.sin(s[0])],
            (0.0, t[-1]),
            begin,
            rtol=1e-12,
            atol=1e-13,
            t_eval=t,
        ).y
        off.append(np.abs(np.arctan2(x[:, 0], -x[:, 1]) - truth[0]).max())
        # nothing turns it, and its plane is kept
        assert np.abs(w - [0.0, 0.0, 3.0]).max() < 1e-6
        assert np.abs(x[:, 2]).max() < 1e-10
        pressed = 2.0 * (GRAVITY * np.cos(truth[0]) + arm * truth[1] ** 2)
        assert np.abs(force - pressed).max() < (1e-2 if tol > 1e-6 else 1e-4)
    assert off[0] < 1e-3
    assert off[1] < (1e-5 if method == "GALPHA" else 1e-7)


def cam(
    shape, begin, straight=((-3.0, 0, 0), (-1, 0, 0), (0, 0, 0), (1, 0, 0), (2, 0, 0), (3, 0, 0))
):
    """Return a cam that a motion turns by 2 rad/s beneath a flat follower at height `begin`."""
    return f"""<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="1" inertia_yy="1" inertia_zz="1"
 w_ic_z="2" w_ic_z_flag="TRUE"/>
<Body_Rigid id="3" cg_id="30" mass="3" inertia_xx="1" inertia_yy="1" inertia_zz="1"/>
<Reference_Marker id="20" body_id="2"/>
<Reference_Marker id="30" body_id="3" pos_y="{begin!r}"/>
<Reference_Marker id="31" body_id="3" pos_y="{begin!r}" theta="-1.5707963267948966"/>
<Reference_Marker id="11" body_id="1" theta="-1.5707963267948966"/>
<Constraint_Joint id="1" type="REVOLUTE" i_marker_id="20" j_marker_id="10"/>
<Constraint_Joint id="2" type="TRANSLATIONAL" i_marker_id="31" j_marker_id="11"/>
<Motion_Joint id="1" joint_id="1" motion_type="R" val_type="D" expr="2*TIME"/>
{curve(5, shape)}{curve(6, straight, closed=False)}
<Constraint_CVCV id="1" i_marker_id="30" i_curve_id="6" j_marker_id="20" j_curve_id="5"
 j_disp_x0="0" j_disp_y0="{begin!r}" j_disp_z0="0"/>"""


@pytest.mark.parametrize("method", ["DOPRI5", "RADAU5", "MOREAU"])
@pytest.mark.parametrize("a", [1.0, 1.3])
def test_a_flat_follower_on_a_cam_is_at_its_support(method, a, tmp_path):
    b, off = 1.0, 0.0 if a > 1.0 else 0.4
    shape = ellipse(a, b, 129, off)
    with run(deck(cam(shape, b)), tmp_path, integrator=method, tol=1e-8) as results:
        t, y = results["time"], results["bodies/3/position"][:, 1]
        force = results["curves_on_curves/1/force"][:, 1]
    # highest point along y of the ellipse about its centre, and of the centre
    angle = 2.0 * t
    size = np.sqrt(a**2 * np.sin(angle) ** 2 + b**2 * np.cos(angle) ** 2)
    assert np.abs(y - size - off * np.sin(angle)).max() < 1e-7
    # with s = size^2: s'' = (2 s s'' - s'^2)/(4 s^(3/2)) of it, and m (g + y'') presses
    s1, s2 = (a**2 - b**2) * np.sin(2 * angle) * 2.0, (a**2 - b**2) * np.cos(2 * angle) * 8.0
    rise = s2 / (2.0 * size) - s1**2 / (4.0 * size**3) - 4.0 * off * np.sin(angle)
    assert np.abs(force - 3.0 * (GRAVITY + rise)).max() < 1e-4


def test_tilted_free_bodies_keep_momentum_and_energy(tmp_path):
    c, s = float(np.cos(0.4)), float(np.sin(0.4))
    # the planes of both are tilted about the common tangent, which leaves them free to turn so
    model = f"""<Body_Rigid id="2" cg_id="20" mass="2" inertia_xx="0.1" inertia_yy="0.2"
 inertia_zz="0.25" w_ic_z="1" w_ic_z_flag="TRUE" w_ic_y="0.5" w_ic_y_flag="TRUE"/>
<Body_Rigid id="3" cg_id="30" mass="3" inertia_xx="0.4" inertia_yy="0.3" inertia_zz="0.5"
 w_ic_z="-0.3" w_ic_z_flag="TRUE" w_ic_x="0.2" w_ic_x_flag="TRUE"/>
<Reference_Marker id="20" body_id="2" pos_x="{1.0 + 0.5 * c!r}" pos_z="{-0.5 * s!r}"
 a00="{c!r}" a20="{-s!r}" a02="{s!r}" a22="{c!r}"/>
<Reference_Marker id="30" body_id="3"/>
{curve(5, ellipse(1.0, 0.7))}{curve(6, ellipse(0.5, 0.3))}
<Constraint_CVCV id="1" i_marker_id="20" i_curve_id="6" j_marker_id="30" j_curve_id="5"/>"""
    ends, inertia = [], {2: (0.1, 0.2, 0.25), 3: (0.4, 0.3, 0.5)}
    for tol in (1e-5, 1e-9):
        with run(deck(model, gravity=0.0), tmp_path, integrator="DOPRI5", tol=tol) as results:
            momentum, about = 0.0, 0.0
            for id, mass in ((2, 2.0), (3, 3.0)):
                x, v, w = (
                    results[f"bodies/{id}/{name}"]
                    for name in ("position", "velocity", "angular_velocity")
                )
                R = rotations(results[f"bodies/{id}/quaternion"])
                spin = np.einsum("tij,j,tkj,tk->ti", R, inertia[id], R, w)
                momentum, about = momentum + mass * v, about + mass * np.cross(x, v) + spin
            energy = results["energy/kinetic"]
            ends.append(np.abs(energy - energy[0]).max())
        assert np.abs(momentum - momentum[0]).max() < 1e-12
        assert np.abs(about - about[0]).max() < (1e-6 if tol > 1e-6 else 1e-9)
    assert ends[0] < 1e-5
    assert ends[1] < 1e-9


def rotations(q):
    w, x, y, z = q.T
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    ).transpose(2, 0, 1)


@pytest.mark.parametrize("method", ["DOPRI5", "RADAU5", "MOREAU"])
def test_a_run_in_pieces_is_the_straight_one(method, tmp_path, monkeypatch):
    file = tmp_path / "cam.xml"
    file.write_text(deck(disc(), end_time=1.0))
    how = {"integrator": method, "notify": lambda line: None}
    whole = mbsim.simulate(file, **how)
    pieces = run_in_pieces(file, tmp_path / "cut", monkeypatch, (3,), **how)
    for name in ("bodies/2/position", "curves_on_curves/1/force"):
        assert (whole[name] == pieces[name]).all()


@pytest.mark.parametrize("method", ["DOPRI5", "RADAU5"])
def test_the_end_of_a_curve_ends_the_run(method, tmp_path):
    short = ((-0.6, 0, 0), (-0.5, 0, 0), (-0.1, 0, 0), (0.1, 0, 0), (0.3, 0, 0), (0.6, 0, 0))
    model = cam(ellipse(1.0, 1.0, x=0.7), 1.0, (*short, (0.75, 0, 0), (0.8, 0, 0)))
    with pytest.raises(
        SolverError, match=r"Constraint_CVCV\[1\] comes to an end of the curve of I"
    ):
        run(deck(model), tmp_path, integrator=method)


@pytest.mark.parametrize("method", ["DOPRI5", "RADAU5"])
def test_a_disc_that_is_less_bent_than_what_it_slides_into_touches_twice(method, tmp_path):
    # down y = x^2 from x = 0.8, with radius 0.7: where the parabola is bent as much no one is left
    radius, x = 0.7, 0.8
    n = np.array([-2.0 * x, 1.0]) / np.hypot(2.0 * x, 1.0)
    at = (np.array([x, x**2]) + radius * n).tolist()
    along = np.linspace(-1.5, 1.5, 31)
    model = disc().replace(curve(5, ellipse(2.0, 2.0)), "").replace(curve(6, ellipse(0.5, 0.5)), "")
    begin = model.index('<Reference_Marker id="20"')
    model = model[:begin] + (
        f'<Reference_Marker id="20" body_id="2" pos_x="{at[0]!r}" pos_y="{at[1]!r}"/>'
        + curve(5, np.column_stack([along, along**2, 0.0 * along]), closed=False)
        + curve(6, ellipse(radius, radius))
        + model[model.index("<Constraint_CVCV") :]
    )
    said = "Constraint_CVCV[1]" + (": no one point of contact" if method == "DOPRI5" else "")
    with pytest.raises(SolverError, match=re.escape(said)):
        run(deck(model), tmp_path, integrator=method)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            ('i_curve_id="6"', 'i_curve_id="9"'),
            r"Reference_ParamCurve\[9\]|no Reference_ParamCurve",
        ),
        (('i_curve_id="6"', ""), "i_curve_id"),
        (('j_curve_id="5" ', 'j_curve_id="5" is_no_slip="TRUE"'), "without slip are not built"),
        (('j_curve_id="5" ', 'j_curve_id="5" i_disp_x0="1"'), "i_disp_x0, i_disp_y0 and i_disp_z0"),
    ],
)
def test_what_cannot_touch_is_refused(change, said, tmp_path):
    text = deck(disc())
    assert change[0] in text
    file = tmp_path / "cam.xml"
    file.write_text(text.replace(*change))
    with pytest.raises(DeckError, match=said):
        mbsim.read_model(file)


def test_curves_must_be_flat_and_one_of_them_bent(tmp_path):
    line = curve(6, [[k, 0, 0] for k in range(6)], closed=False)
    bent = curve(6, [[k, 0.1 * k**2, 0.01 * k**3] for k in range(6)], closed=False)
    text = deck(disc())
    with pytest.raises(DeckError, match=r'i_curve_id="6": must lie in a plane'):
        run(text.replace(curve(6, ellipse(0.5, 0.5)), bent), tmp_path)
    both = text.replace(curve(6, ellipse(0.5, 0.5)), line)
    both = both.replace(curve(5, ellipse(2.0, 2.0)), line.replace('id="6"', 'id="5"'))
    with pytest.raises(DeckError, match="both curves are straight"):
        run(both, tmp_path)

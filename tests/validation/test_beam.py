"""Force_Beam: cantilevers, vibrations and decay in closed form, energy, methods, both languages."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import mbsim
from helpers import free_bodies as free
from mbsim.errors import DeckError
from mbsim.forces.catalog import FORCES
from mbsim.model.elements import Marker

KINETIC, POTENTIAL, DISSIPATED = range(3)
TILTED = free.rotation((1, 2, -1), 0.7)
#: A steel bar 10 x 20 mm, 500 mm long: lengths mm, forces N, masses t.
BAR = {
    **{"length": 500.0, "E": 2.1e5, "G": 8.0e4, "area": 200.0, "ixx": 4580.0},
    **{"iyy": 6666.7, "izz": 1666.7, "ASY": 1.2, "ASZ": 1.2},
}
#: One that is soft, of SI units.
SOFT = {
    **{"length": 0.8, "E": 2e6, "G": 7e5, "area": 1e-4, "ixx": 2e-6, "iyy": 3e-6, "izz": 2e-6},
    **{"ASY": 1.2, "ASZ": 1.1},
}


def decaying(t, x0, mass, stiffness, damping):
    """Return x of the underdamped oscillation from rest at x0."""
    decay = damping / (2 * mass)
    w = math.sqrt(stiffness / mass - decay**2)
    return np.exp(-decay * t) * x0 * (np.cos(w * t) + decay / w * np.sin(w * t))


def attributes(values):
    return " ".join(f'{name}="{value}"' for name, value in values.items())


def cantilever(folder, load, bar=BAR, command='<Simulate analysis_type="Static"/>', more=""):
    """Run a body of 1 kg at the end of a bar along x; `load` are attributes of the tip's force."""
    path = Path(folder) / "deck.xml"
    path.write_text(
        f"""<Deck><Model>
<Param_Unit length_unit="MILLIMETER" mass_unit="MEGAGRAM" force_unit="NEWTON"/>
<Body_Rigid id="1" isground="TRUE"/>
<Reference_Marker id="10" body_id="1"/>
<Body_Rigid id="2" cg_id="20" mass="1e-3" inertia_xx="2" inertia_yy="2" inertia_zz="2"/>
<Reference_Marker id="20" body_id="2" pos_x="{bar["length"]}"/>
<Force_Beam id="7" label="bar" i_marker_id="20" j_marker_id="10" {attributes(bar)}/>
<Force_Vector_OneBody id="1" type="ForceAndTorque" i_marker_id="20" {load}/>{more}
</Model><Command>{command}</Command></Deck>""",
        encoding="utf-8",
    )
    return mbsim.simulate(mbsim.read_model(path))


def small_angles(results):
    """Return the rotation vector of body 2 in the last row."""
    w, *u = results["bodies/2/quaternion"][-1]
    return 2.0 * np.array(u) * np.sign(w)


def flexibility(bar, inertia, ratio):
    """Return tip deflection and rotation by force, and the same by torque (Timoshenko)."""
    L, EI = bar["length"], bar["E"] * bar[inertia]
    shear = L * bar[ratio] / (bar["G"] * bar["area"])
    return L**3 / (3 * EI) + shear, L**2 / (2 * EI), L**2 / (2 * EI), L / EI


@pytest.mark.parametrize(("inertia", "ratio", "force", "torque", "sign"), [
    ("izz", "ASY", "fy", "tz", 1.0), ("iyy", "ASZ", "fz", "ty", -1.0)])  # fmt: skip
def test_a_cantilever_bends_and_shears_as_timoshenko_says(
    tmp_path, inertia, ratio, force, torque, sign
):
    bar = BAR | {"length": 60.0}
    axis, about = "xyz".index(force[1]), "xyz".index(torque[1])
    y_f, turn_f, y_m, turn_m = flexibility(bar, inertia, ratio)
    # shear is a part that counts
    assert bar["length"] * bar[ratio] / (bar["G"] * bar["area"]) > 0.02 * y_f
    # exact to rounding: what is of second order in a turn of 4e-7 is below it
    results = cantilever(tmp_path, f'{force}_expression="0.05" {torque}_expression="0.7"', bar)
    place, turn = results["bodies/2/position"][-1], small_angles(results)
    assert place[axis] == pytest.approx(0.05 * y_f + sign * 0.7 * y_m, rel=1e-10)
    assert turn[about] == pytest.approx(sign * 0.05 * turn_f + 0.7 * turn_m, rel=1e-10)
    # it bears what loads it
    assert results["beams/7/force"][-1, axis] == pytest.approx(-0.05, rel=1e-10)
    assert results["beams/7/torque"][-1, about] == pytest.approx(-0.7, rel=1e-10)


def test_a_bar_stretches_and_twists(tmp_path):
    results = cantilever(tmp_path, 'fx_expression="300" tx_expression="20"')
    stretch = 300 * BAR["length"] / (BAR["E"] * BAR["area"])
    twist = 20 * BAR["length"] / (BAR["G"] * BAR["ixx"])
    assert results["bodies/2/position"][-1, 0] - 500 == pytest.approx(stretch, rel=1e-9)
    assert 2 * math.asin(small_angles(results)[0] / 2) == pytest.approx(twist, rel=1e-9)


def test_rest_under_weight_is_where_the_motion_comes_to_rest(tmp_path):
    gravity = '<Force_Gravity grav_z="-9810"/>'
    bar = BAR | {"cratio": 2e-3}
    load = 'fx_expression="0"'
    still = cantilever(tmp_path, load, bar, more=gravity)
    y_f, _, _, _ = flexibility(bar, "iyy", "ASZ")
    low = still["bodies/2/position"][-1, 2]
    assert low == pytest.approx(-9.81 * y_f, rel=1e-9)
    command = '<Simulate analysis_type="Transient" end_time="1.5" print_interval="0.01"/>'
    moving = cantilever(tmp_path, load, bar, command, gravity)
    assert abs(moving["bodies/2/position"][:, 2].min()) > 1.2 * abs(low)
    assert moving["bodies/2/position"][-1, 2] == pytest.approx(low, rel=1e-8)


@pytest.mark.parametrize("cratio", [0.0, 0.004])
def test_a_mass_swings_along_a_bar_and_decays_as_the_closed_form(cratio):
    k = SOFT["E"] * SOFT["area"] / SOFT["length"]
    e = TILTED[:, 0]
    ground = Marker(11, body_id=1, pos=(0, 0, 0), R=TILTED)
    body = free.body(2, 1.5, p=tuple(0.83 * e))
    turned = replace(body[1], R=TILTED)
    beam = free.force("BEAM", 1, 20, 11, **SOFT, cratio=cratio)
    model = free.model((body[0], turned), markers=[ground], marker_forces=[beam], end_time=2.0)
    rows, _ = free.run(model)
    x = 0.8 + decaying(rows["time"], 0.03, 1.5, k, cratio * k)
    np.testing.assert_allclose(rows["y"][:, :3], x[:, None] * e, atol=2e-8)
    total = rows["energy"][:, :3].sum(axis=1)
    assert np.ptp(total) < 1e-8 * rows["energy"][:, KINETIC].max()
    assert (rows["energy"][-1, DISSIPATED] > 0.01) == (cratio > 0.0)


@pytest.mark.parametrize("cratio", [0.0, 0.02])
def test_a_body_twists_a_bar_to_and_fro(cratio):
    k, turn = SOFT["G"] * SOFT["ixx"] / SOFT["length"], 0.9
    # to a place about which the bar is not bent
    body = free.body(2, inertia=(0.03, 0.05, 0.05), p=(0.8, 0, 0))
    ground = Marker(11, body_id=1, pos=(0, 0, 0), R=free.rotation((1, 0, 0), -turn))
    beam = free.force("BEAM", 1, 20, 11, **SOFT, cratio=cratio)
    rows, _ = free.run(free.model(body, markers=[ground], marker_forces=[beam], end_time=2.0))
    angle = decaying(rows["time"], turn, 0.03, k, cratio * k) - turn
    np.testing.assert_allclose(rows["y"][:, 4], np.sin(angle / 2), atol=1e-8)


def two_bodies(**values):
    """Return two free bodies and a bar, a little bent, between markers away from their cgs."""
    J = free.rotation((0, 1, 1), 0.4)
    end = np.array((0.9, 0.1, 0.1)) + J @ (0.82, 0.01, -0.02)
    first = free.body(2, 1.5, (0.1, 0.2, 0.25), (0, 0, 0.7), (0, 0, 0.2), (0.2, 0.3, 0.4))
    second = free.body(3, 1.0, (0.3, 0.2, 0.25), (1, 0, 0), (0, 0.2, 0), (0.1, -0.2, 0.2))
    markers = [
        Marker(21, body_id=2, pos=tuple(end), R=free.rotation((0, 1, 1), 0.5)),
        Marker(31, body_id=3, pos=(0.9, 0.1, 0.1), R=J),
    ]
    beam = free.force("BEAM", 1, 21, 31, **(SOFT | values))
    return free.model(first, second, markers=markers, marker_forces=[beam], end_time=1.0)


def momenta(rows, masses, inertias):
    """Return momentum and angular momentum about the origin of all bodies, (n, 6)."""
    made = np.zeros((len(rows["y"]), 6))
    for b, (mass, inertia) in enumerate(zip(masses, inertias, strict=True)):
        y = rows["y"][:, 13 * b : 13 * b + 13]
        p, q, v = y[:, :3], y[:, 3:7], y[:, 7:10]
        spin = inertia * y[:, 10:13]
        u = q[:, 1:]
        turned = spin + 2 * np.cross(u, np.cross(u, spin) + q[:, :1] * spin)
        made[:, :3] += mass * v
        made[:, 3:] += mass * np.cross(p, v) + turned
    return made


DAMPED = {"cratio": 0.01, "preload_y": 3.0, "preload_tx": 0.4}


@pytest.mark.parametrize("values", [{}, DAMPED])
def test_energy_and_momenta_are_kept_in_any_motion(values):
    rows, _ = free.run(two_bodies(**values))
    total = rows["energy"][:, :3].sum(axis=1)
    assert np.abs(total - total[0]).max() < 1e-8 * rows["energy"][:, KINETIC].max()
    if not values:
        assert np.abs(rows["energy"][:, DISSIPATED]).max() == 0.0
    kept = momenta(rows, (1.5, 1.0), np.array([(0.1, 0.2, 0.25), (0.3, 0.2, 0.25)]))
    np.testing.assert_allclose(kept, kept[:1].repeat(len(kept), 0), atol=1e-10)


@pytest.mark.parametrize("method", ["DOPRI5", "VERLET", "GALPHA", "RADAU5"])
def test_methods_agree(method):
    model = two_bodies(**DAMPED)
    exact, _ = free.run(model, tol=1e-11, integrator="DOP853")
    rows, _ = free.run(model, tol=1e-7, integrator=method)
    off = np.abs(rows["y"] - exact["y"])[:, [0, 1, 2, 13, 14, 15]]
    # 7e-8 of GALPHA, of second order; others below 1e-9
    assert off.max() < 5e-7


def test_a_damping_matrix_that_is_proportional_does_what_the_ratio_does():
    par = FORCES["BEAM"].form.constants
    ratio = dict(free.force("BEAM", 1, 0, 0, **SOFT, cratio=0.01).parameters)
    K = np.reshape(par(ratio)[1:37], (6, 6))
    columns = tuple(0.01 * K[r, k] for k in range(6) for r in range(k, 6))
    matrix = ratio | {"cratio": 0.0, "cmatrix": columns}
    np.testing.assert_allclose(par(matrix), par(ratio), rtol=1e-14)


ADAMS = """a beam
UNITS/FORCE=NEWTON, MASS=KILOGRAM, LENGTH=METER, TIME=SECOND
PART/1, GROUND
MARKER/11, PART=1
PART/2, MASS=1, CM=21, IP=1,1,1
MARKER/21, PART=2, QP=0.8,0,0
BEAM/1, I=21, J=11, LENGTH=0.8, IXX=2e-6, IYY=3e-6, IZZ=2e-6, AREA=1e-4
, ASY=1.2, ASZ=1.1, EMODULUS=2e6, GMODULUS=7e5, CRATIO=0.01
REQUEST/1, F2=BEAM(1,0,2,0)\\F4=BEAM(1,1,4,11)
END
"""
XML = f"""<Deck><Model><Body_Rigid id="1" isground="TRUE"/><Reference_Marker id="11" body_id="1"/>
<Body_Rigid id="2" cg_id="21" mass="1" inertia_xx="1" inertia_yy="1" inertia_zz="1"/>
<Reference_Marker id="21" body_id="2" pos_x="0.8"/>
<Force_Beam id="1" i_marker_id="21" j_marker_id="11" {attributes(SOFT)} cratio="0.01"/>
<Post_Request id="1" type="ELEMENTAL_FORCE" elem_type="BEAM" elem_id="1"/>
</Model></Deck>"""


def read(folder, text, name="deck.xml"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return mbsim.read_model(path)


def test_both_languages_say_the_same(tmp_path):
    (adams,) = read(tmp_path, ADAMS, "deck.adm").table("BEAM").values()
    (xml,) = read(tmp_path, XML).table("BEAM").values()
    assert adams.values == xml.values
    assert (adams.i_marker_id, adams.j_marker_id) == (xml.i_marker_id, xml.j_marker_id) == (21, 11)


CMATRIX = f'cmatrix="{"1 " * 21}"'
FAULTS = {
    "no length": ('length="0.8"', "", r"Force_Beam\[1\]: length: missing.*> 0"),
    "no area": ('area="0.', 'area="-0.', r"area=.*must be a number > 0"),
    "ratio": ('ASY="1.2"', 'ASY="-1"', r'ASY="-1": must be a number >= 0'),
    "twice": ('cratio="0.01"', f'cratio="0.01" {CMATRIX}', r"cratio.*once"),
    "few": ('cratio="0.01"', 'cmatrix="1 2"', r"cmatrix.*21 numbers"),
    "feeds": ('cratio="0.01"', f'cmatrix="{"1 2 " + "0 " * 19}"', r"cmatrix.*feeds energy"),
    "markers": ('i_marker_id="21"', 'i_marker_id="5"', r"i_marker_id"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_faults(name, tmp_path):
    old, new, said = FAULTS[name]
    assert XML.count(old) == 1
    with pytest.raises(DeckError, match=said):
        read(tmp_path, XML.replace(old, new))

"""The linearised mechanism against differences of f over states that keep to the constraints.

With dx the change of such a state and df that of f, what an implicit method solves for the
residual c1 dx - df must be dx again, for any c1. X, work and losses are sums of what bodies do and
not unknowns: their rows are left out.
"""

from __future__ import annotations

import ctypes
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

import mbsim
from helpers.decks import write_deck
from helpers.folders import MODELS
from helpers.free_bodies import Silent
from helpers.mechanics import Body
from helpers.mechanism_decks import SIDE, SKEW, Joint, Scene, marker, rotation
from helpers.pairs import turned
from helpers.surfaces import mesh_graphic
from mbsim.arrays.hooks import Joints
from mbsim.compile_model import tangent
from mbsim.compile_model.build import build
from mbsim.dynamics.pipeline.problem import implicit_hooks
from mbsim.laws.catalog import SLIP, STICK
from mbsim.run.loop import Runner
from mbsim.run.settings import settle
from mbsim.run.start import assemble_model

COEFFICIENTS = (1.0, 10.0, 1e3)
#: Half of the step of differences, and how many times f is rounded on its way from a state.
EPS, ROUNDINGS = 1e-5, 16.0


class Linearised:
    """A deck with the hooks of implicit methods, at its assembled state."""

    def __init__(self, path):
        model = mbsim.read_model(path)
        settings = settle(model)
        self.system = build(model)
        self.runner = Runner(self.system, settings, None, Silent(), lambda text: None)
        runner = self.runner
        assemble_model(self.system, runner.hooks, 0.0, runner.method.y, print, print)
        self.scene = self.system.scene
        self.problem, self.kept = implicit_hooks(self.scene, self.runner.problem, True)
        self.y = self.runner.method.y.copy()
        self.n, self.bodies = len(self.y), len(self.scene.bodies.mass)
        self.rows = np.r_[: 13 * self.bodies, self.scene.states.offset].astype(int)

    def call(self, name, t, a, b):
        pointer = ctypes.c_void_p
        form = ctypes.CFUNCTYPE(
            ctypes.c_int64, ctypes.c_int64, ctypes.c_double, ctypes.c_double, pointer, pointer
        )
        hook = form(getattr(self.problem, name))
        code = hook(self.problem.context, t, 0.0, a.ctypes.data, b.ctypes.data)
        assert code == 0, (name, code)

    def f(self, y, t):
        y, f = y.copy(), np.zeros(self.n)
        self.call("rhs", t, y, f)
        return f

    def on_manifold(self, y, t):
        y = y.copy()
        self.call("project", t, y, y.copy())
        return y

    def moved(self, t=0.0, seed=0, speed=1.0, move=0.05):
        """Return a state near the assembled one, at random."""
        rng, y = np.random.default_rng(seed), self.y.copy()
        for b in range(self.bodies):
            y[13 * b : 13 * b + 7] += move * rng.normal(size=7)
            y[13 * b + 7 : 13 * b + 13] += speed * rng.normal(size=6)
        for place in self.scene.states.offset:
            y[place] += rng.normal()
        for _ in range(5):
            y = self.on_manifold(y, t)
        return y

    def linearise(self, y, t):
        self.call("linearise", t, y.copy(), self.f(y, t))

    def factor(self, c1):
        self.call("factor", 0.0, np.array([c1, c1 * c1, c1, 0.0]), np.zeros(4))

    def solve(self, r):
        d = np.zeros(self.n)
        self.call("solve", 0.0, np.ascontiguousarray(r), d)
        return d

    def solve_pair(self, c1, r):
        """Return the solution of the residual r with complex coefficients."""
        c = np.zeros(7)
        c[0::2] = c1.real, (c1 * c1).real, c1.real, 0.0
        c[1:6:2] = c1.imag, (c1 * c1).imag, c1.imag
        self.call("factor_pair", 0.0, c, np.zeros(4))
        given, d = np.concatenate([r.real, r.imag]), np.zeros(2 * self.n)
        self.call("solve_pair", 0.0, given, d)
        return d[: self.n] + 1j * d[self.n :]

    def changes(self, y, t, eps=EPS):
        """Return dx and df for the change of every number of y, projected."""
        for k in self.rows:
            ends = []
            for sign in (1, -1):
                z = y.copy()
                z[k] += sign * eps
                ends.append(self.on_manifold(z, t))
            dx = (ends[0] - ends[1]) / (2 * eps)
            yield dx, (self.f(ends[0], t) - self.f(ends[1], t)) / (2 * eps)

    def misses(self, y, t=0.0, coefficients=COEFFICIENTS):
        """Return by how much dx is missed, over the largest dx, for every c1.

        Velocities count over c1 where that is above 1: an error of 1 in dx is one of c1 there.
        """
        weight = np.zeros(self.n, dtype=bool)
        for b in range(self.bodies):
            weight[13 * b + 7 : 13 * b + 13] = True
        changes = list(self.changes(y, t))
        self.linearise(y, t)
        worst = []
        for c1 in coefficients:
            self.factor(c1)
            misses, sizes = [], []
            for dx, df in changes:
                miss = self.solve(c1 * dx - df) - dx
                miss[weight] /= max(1.0, c1)
                misses.append(np.abs(miss[self.rows]).max())
                sizes.append(np.abs(dx[self.rows]).max())
            assert max(sizes) > 0.1
            worst.append(max(misses) / max(sizes))
        return np.array(worst)

    def rounding(self, y, t=0.0, coefficients=COEFFICIENTS):
        """Return what rounding of f may add to `misses`, for every c1, after that was called.

        A difference of f over 2 EPS is off by its rounding over EPS, and the solution of c1 dx - df
        by that times the inverse's norm: large where c1 is near an eigenvalue.
        """
        noise = ROUNDINGS * 2.0**-53 * np.abs(self.f(y, t)).max() / EPS
        found = []
        for c1 in coefficients:
            self.factor(c1)
            inverse = np.array([self.solve(np.eye(self.n)[k])[self.rows] for k in self.rows])
            found.append(noise * np.abs(inverse).sum(axis=0).max())
        return np.array(found)


def check(path, bound=2e-7, t=0.0, **moved):
    """Check a deck at two states at random; `bound`: what the differences leave out."""
    it = Linearised(path)
    for seed in range(2):
        y = it.moved(t, seed, **moved)
        worst, rounding = it.misses(y, t), it.rounding(y, t)
        print(Path(path).stem, worst, rounding)
        assert (worst < bound + rounding).all(), (worst, rounding)
    return it


@pytest.mark.parametrize("name", ["free_top", "slider_crank", "flyball_governor"])
def test_models(name):
    check(MODELS / f"{name}.xml", move=0.02)


# --- joints between moving bodies ---


ABOUT_Y = rotation((0, 1, 1), 0.4)
#: The joints that a tree or equations hold, and how marker I differs from J at the start.
JOINTS = {
    "FREE": {},
    "FIXED": {},
    "REVOLUTE": {},
    "TRANSLATIONAL": {},
    "CYLINDRICAL": {},
    "SPHERICAL": {"R_i": ABOUT_Y},
    "UNIVERSAL": {"R_i": SIDE},
    "HOOKE": {"R_i": SKEW @ rotation((1, 0, 0), 0.4)},
    "PLANAR": {},
    "INLINE": {"R_i": ABOUT_Y},
    "INPLANE": {"R_i": ABOUT_Y},
    "ORIENTATION": {},
    "PARALLEL_AXES": {},
    "PERPENDICULAR": {"R_i": SIDE},
    "CONSTANT_VELOCITY": {"R_i": SKEW @ rotation((1, 0, 0), 0.5)},
    "DISTANCE": {"p_j": (0.9, 0.3, 0.2)},
    "SCREW": {"attributes": 'pitch="0.3"'},
    "RACK_PINION": {"attributes": 'pitch_diameter="0.4"', "R_i": SIDE},
}
FIRST = Body(
    2.0, [[0.3, 0.02, 0.01], [0.02, 0.4, -0.03], [0.01, -0.03, 0.25]], (0.5, 0.1, 0.2),
    rotation((1, 1, 0), 0.3),
)  # fmt: skip
SECOND = Body(1.0, (0.08, 0.1, 0.05), (1.5, -0.2, -0.3), rotation((0, 1, 2), -0.5))
THIRD = Body(1.5, (0.2, 0.15, 0.1), (2.0, 0.5, 0.1), rotation((1, 0, 2), 0.8))
PLACE = (1.2, -0.1, -0.05)


def two(kind, hold="SPHERICAL", extra=""):
    """Return two bodies: the first held by ground, the second by the first, at PLACE."""
    values = {"p": PLACE, "R_i": SKEW, "R_j": SKEW} | JOINTS[kind]
    joints = [Joint(hold, 1, 0, R_i=SKEW)] if hold else []
    return Scene([FIRST, SECOND], [*joints, Joint(kind, 2, 1, **values)], extra=extra)


def of(scene, folder):
    """Return the path of a scene's deck."""
    return write_deck(folder, scene.xml())


@pytest.fixture(params=["border", "nodes"])
def multipliers(request, monkeypatch):
    """Let multipliers be a dense border, or nodes of the elimination however few there are."""
    fewest = 1 if request.param == "nodes" else 10**9
    monkeypatch.setattr(tangent, "_MANY_EQUATIONS", fewest)


def test_all_joints_are_here():
    from mbsim.joints.catalog import JOINTS as registered

    assert sorted(JOINTS) == sorted(registered)


@pytest.mark.parametrize("hold", ["SPHERICAL", None])
@pytest.mark.parametrize("kind", JOINTS)
def test_joint(kind, hold, tmp_path):
    check(of(two(kind, hold), tmp_path))


@pytest.mark.usefixtures("multipliers")
@pytest.mark.parametrize("kind", ["REVOLUTE", "UNIVERSAL", "CYLINDRICAL", "SPHERICAL", "PLANAR"])
def test_a_loop(kind, tmp_path):
    scene = two(kind)
    third = Joint("SPHERICAL", 3, 2, p=(1.8, 0.1, 0.2))
    last = Joint("SPHERICAL", 3, 0, p=(2.4, 0.6, 0.4))
    check(of(Scene([FIRST, SECOND, THIRD], [*scene.joints, third, last]), tmp_path), move=0.02)


def test_several_on_one_body(tmp_path):
    on = [Joint("REVOLUTE", 2, 1, p=PLACE, R_i=SKEW), Joint("HOOKE", 3, 1, p=(0.9, 0.3, 0.1))]
    check(of(Scene([FIRST, SECOND, THIRD], on), tmp_path))


#: What holds beside joint 1 (of body 1 on ground) and joint 2 (of body 2 on body 1).
def parabola(id, body, bent, tilt):
    """Return a parabola through (1.3, -0.2, -0.1) along y, tilted about it, in a body's axes."""
    along = np.linspace(-0.8, 0.8, 9)
    points = np.column_stack([bent * along**2, along, 0.0 * along]) @ rotation((0, 1, 0), tilt).T
    points = (points + np.array([1.3, -0.2, -0.1]) - np.array(body.p)) @ np.array(body.R)
    text = " ".join(f"{v!r}" for v in points.ravel().tolist())
    return f'<Reference_ParamCurve id="{id}">{text}</Reference_ParamCurve>'


EQUATIONS = {
    "turned": (
        "REVOLUTE",
        '<Motion_Joint id="1" joint_id="2" val_type="D" expr="0.3*SIN(2*TIME)"/>',
    ),
    "pulled": (
        "CYLINDRICAL",
        '<Motion_Joint id="1" joint_id="2" motion_type="T" val_type="D" expr="0.2*TIME**2"/>',
    ),
    "pulled along an axis": (
        "SPHERICAL",
        '<Motion_Marker id="1" i_marker_id="102" j_marker_id="100" direction="Z" '
        'val_type="D" expr="0.1*TIME - 0.3"/>',
    ),
    "turned about an axis": (
        "SPHERICAL",
        '<Motion_Marker id="1" i_marker_id="1002" j_marker_id="1003" direction="B3" '
        'val_type="D" expr="0.1*TIME"/>',
    ),
    "turned at a rate": (
        "REVOLUTE",
        '<Motion_Joint id="1" joint_id="2" val_type="V" expr="0.6*COS(2*TIME)"/>',
    ),
    "turned at a rising rate": (
        "REVOLUTE",
        '<Motion_Joint id="1" joint_id="2" val_type="A" expr="2*SIN(2*TIME)"/>',
    ),
    "pulled at a rate along an axis": (
        "SPHERICAL",
        '<Motion_Marker id="1" i_marker_id="102" j_marker_id="100" direction="Z" '
        'val_type="V" expr="0.1*TIME - 0.3"/>',
    ),
    "pulled at a rising rate along an axis that turns": (
        "SPHERICAL",
        '<Motion_Marker id="1" i_marker_id="102" j_marker_id="101" direction="X" '
        'val_type="A" expr="0.1*TIME"/>',
    ),
    "turned at a rate about an axis": (
        "SPHERICAL",
        '<Motion_Marker id="1" i_marker_id="1002" j_marker_id="1003" direction="B3" '
        'val_type="V" expr="0.1*TIME"/>',
    ),
    "turned at a rising rate about an axis": (
        "SPHERICAL",
        '<Motion_Marker id="1" i_marker_id="1002" j_marker_id="1003" direction="B3" '
        'val_type="A" expr="0.1*TIME"/>',
    ),
    "rates beside a displacement": (
        "CYLINDRICAL",
        '<Motion_Joint id="1" joint_id="2" motion_type="T" val_type="V" expr="0.2*TIME"/>'
        '<Motion_Joint id="2" joint_id="2" motion_type="R" val_type="A" expr="TIME"/>'
        '<Motion_Marker id="3" i_marker_id="102" j_marker_id="100" direction="Z" '
        'val_type="D" expr="0.1*TIME - 0.3"/>',
    ),
    "general": (
        "SPHERICAL",
        '<Constraint_General id="1" expr="DM(102,100) + 0.3*DX(102,100) - 1.1"/>',
    ),
    "a point on a curve": (
        "SPHERICAL",
        '<Reference_ParamCurve id="7">1 -0.6 -0.1 1.3 -0.3 -0.35 1.55 -0.15 -0.3 1.7 0.2 -0.1 '
        "1.7 0.5 0.2</Reference_ParamCurve>"
        '<Constraint_PTCV id="1" i_marker_id="102" j_marker_id="100" curve_id="7"/>',
    ),
    "a curve on a curve": (
        "SPHERICAL",
        parabola(7, FIRST, 0.4, 0.0)
        + parabola(8, SECOND, 1.3, 0.3)
        + '<Constraint_CVCV id="1" i_marker_id="102" i_curve_id="8" j_marker_id="101" '
        'j_curve_id="7"/>',
    ),
    "a point on a surface": (
        "SPHERICAL",
        '<Reference_ParamSurface id="7" u_start="-2" u_end="2" v_start="-2" v_end="2" '
        'usrsub_param_string="USER(1)" usrsub_fnc_name="saddle" script_name="saddle.py"/>'
        '<Constraint_PTSF id="1" i_marker_id="102" j_marker_id="100" surface_id="7"/>',
    ),
    "general on two": ("SPHERICAL", '<Constraint_General id="1" expr="DX(102,101,101) - 1"/>'),
}


#: A SURSUB through (1.3, -0.2, -0.1) or near it, in global axes.
SADDLE = """
def saddle(id, par, npar, u, v, iord, iflag):
    return [1.3 + u, v - 0.2, -0.1 + 0.4 * u * u - 0.3 * u * v - 0.5 * v * v]
"""


@pytest.mark.usefixtures("multipliers")
@pytest.mark.parametrize("name", EQUATIONS)
def test_equations(name, tmp_path):
    kind, text = EQUATIONS[name]
    (tmp_path / "saddle.py").write_text(SADDLE)
    check(of(two(kind, extra=text), tmp_path), t=0.3)


@pytest.mark.usefixtures("multipliers")
@pytest.mark.parametrize("motions", ["R R", "R T", "T T"])
def test_couplers(motions, tmp_path):
    scene = two("CYLINDRICAL")
    third = Joint("CYLINDRICAL", 3, 1, p=(0.9, 0.3, 0.1), R_i=SIDE)
    text = f'<Constraint_Coupler id="1" joint_ids="2 3" motion_types="{motions}" scales="1 -2"/>'
    check(of(Scene([FIRST, SECOND, THIRD], [*scene.joints, third], extra=text), tmp_path))


# --- forces between markers ---

ON_1, ON_2 = (0.7, 0.3, 0.1), (1.6, -0.5, 0.1)
MARKERS = "".join(
    (
        marker(501, 1, ON_1, rotation((0, 1, 3), 0.6)),
        marker(502, 2, ON_2, rotation((2, 1, 0), 0.3)),
        marker(500, 0, (0.3, 0.8, -0.4), rotation((1, 0, 1), 0.9)),
        # near each other, for bushings
        marker(511, 1, PLACE, rotation((0, 1, 3), 0.6)),
        marker(512, 2, PLACE, rotation((0, 1, 3), 0.61)),
    )
)


def spring(i, j, **given):
    """Return a Force_SpringDamper."""
    values = {"type": "TRANSLATIONAL", "stiffness": 300, "damping": 20, "preload": 5} | given
    more = " ".join(f'{name}="{value}"' for name, value in values.items())
    return f'<Force_SpringDamper id="1" i_marker_id="{i}" j_marker_id="{j}" {more}/>'


def scalar(i, j, expr, type="Force", **given):
    """Return a Force_Scalar_TwoBody."""
    more = " ".join(f'{name}="{value}"' for name, value in given.items())
    return (
        f'<Force_Scalar_TwoBody id="1" type="{type}" i_marker_id="{i}" j_marker_id="{j}" '
        f'expr="{expr}" {more}/>'
    )


def components(expressions):
    """Return the attributes of a vector force."""
    kinds = ("fx", "fy", "fz", "tx", "ty", "tz")
    return " ".join(f'{k}_expression="{e}"' for k, e in zip(kinds, expressions, strict=True))


VECTOR = components(
    (
        "-200*DX(502,501,500) - 10*VX(502,501,500)",
        "-100*DY(502,501) + TIME",
        "5*DZ(502)*DX(501)",
        "-3*AX(502,501)",
        "-0.4*WY(502,501,500)",
        "SIN(WZ(502))",
    )
)
FORCES = {
    "spring": spring(502, 501, length=0.3),
    "spring to ground": spring(502, 500, length=0.3),
    "spring from ground": spring(500, 501, length=0.3),
    "spring of no length": spring(502, 500),
    "torsion spring": spring(1002, 1003, type="ROTATIONAL", stiffness=3, damping=1),
    "scalar": scalar(502, 501, "-40*(DM(502,501)-0.4) - 3*VR(502,501) + 2*DX(501)*VY(502)"),
    "scalar of speeds": scalar(502, 500, "-2*VM(502,501)**1.5 + WM(501) + VX(502,501,501,501)"),
    "scalar by others": scalar(502, 500, "5*DX(501,500,500) - VX(501)"),
    "scalar on one": scalar(502, 501, "-4*VZ(502,501,501) + SIN(TIME)", action_only="true"),
    "torque": scalar(502, 501, "-4*WZ(502,501,501) - AZ(1002,1003)", type="Torque"),
    "torque on one": scalar(502, 501, "3 - WZ(502,500,500)", type="Torque", action_only="true"),
    "vector": '<Force_Vector_TwoBody id="1" type="ForceAndTorque" i_marker_id="502" '
    f'j_floating_marker_id="501" ref_marker_id="501" {VECTOR}/>',
    "vector along ground": '<Force_Vector_TwoBody id="1" type="ForceAndTorque" i_marker_id="502" '
    f'j_floating_marker_id="501" ref_marker_id="500" {VECTOR}/>',
    "vector on one": '<Force_Vector_OneBody id="1" type="ForceAndTorque" i_marker_id="502" '
    f'ref_marker_id="501" {VECTOR}/>',
    "states": '<Control_Diff id="1" expr="-3*DIF(1) + 2*DIF(2) + DX(502) + VX(501)"/>'
    '<Control_Diff id="2" expr="-DIF(2)**3 + DIF(1) + WZ(502)" ic="0.3"/>'
    + scalar(502, 501, "-20*DIF(1)*DIF(2) + 5*VR(502,501)"),
    "gravity by TIME": '<Force_Gravity grav_x="3*SIN(TIME)" grav_z="-9*TIME"/>',
}


@pytest.mark.parametrize("name", FORCES)
def test_forces(name, tmp_path):
    kind = "REVOLUTE" if name == "torsion spring" or "AZ(" in FORCES[name] else "SPHERICAL"
    if name == "gravity by TIME":
        scene = two(kind, extra=MARKERS)
        path = write_deck(tmp_path, scene.xml().rsplit("<Force_Gravity", 1)[0] + FORCES[name])
    else:
        path = of(two(kind, extra=MARKERS + FORCES[name]), tmp_path)
    check(path, t=0.3)


@pytest.mark.parametrize("hold", ["SPHERICAL", None])
@pytest.mark.parametrize("name", ["spring", "scalar", "vector", "states"])
def test_forces_between_free_bodies(name, hold, tmp_path):
    check(of(two("FREE", hold, extra=MARKERS + FORCES[name]), tmp_path), t=0.3)


BUSHING = (
    '<Force_Bushing id="1" i_marker_id="512" j_marker_id="511" kx="900" ky="500" kz="300" '
    'ktx="20" kty="30" ktz="40" cx="9" cy="5" cz="3" ctx="2" cty="3" ctz="4" '
)


@pytest.mark.parametrize("move", [1e-4, 0.1])
@pytest.mark.parametrize("hold", ["SPHERICAL", None])
def test_a_bushing(hold, move, tmp_path):
    text = MARKERS + BUSHING + 'preload_x="3" preload_z="-4" preload_ty="0.3"/>'
    check(of(two("FREE", hold, extra=text), tmp_path), 2e-6, move=move)


@pytest.mark.parametrize("ends", [(512, 500), (500, 511)])
def test_a_bushing_to_ground(ends, tmp_path):
    text = MARKERS + BUSHING.replace('"512"', f'"{ends[0]}"').replace('"511"', f'"{ends[1]}"')
    check(of(two("REVOLUTE", extra=text + "/>"), tmp_path))


#: Across from marker 511, along whose x-axis the beam is.
END = marker(
    513, 2, PLACE + 0.41 * np.array(rotation((0, 1, 3), 0.6))[:, 0], rotation((0, 1, 3), 0.61)
)
BEAM = (
    '<Force_Beam id="1" i_marker_id="513" j_marker_id="511" length="0.4" E="1e6" G="4e5" '
    'area="4e-4" ixx="3e-5" iyy="2e-6" izz="3e-6" ASY="1.2" ASZ="1.1" cratio="0.01" '
    'preload_x="3" preload_y="-4" preload_tz="0.3"/>'
)


@pytest.mark.parametrize("move", [1e-4, 0.1])
@pytest.mark.parametrize("hold", ["SPHERICAL", None])
def test_a_beam(hold, move, tmp_path):
    # 2e-6 where c1 is near an eigenvalue
    check(of(two("FREE", hold, extra=MARKERS + END + BEAM), tmp_path), 1e-5, move=move)


@pytest.mark.parametrize("move", [1e-4, 0.1])
@pytest.mark.parametrize("ends", [(512, 513, 511), (512, 500, 511), (511, 513, 500)])
def test_a_force_of_several_markers(ends, move, tmp_path):
    first, second, j = ends
    A, B = np.random.default_rng(3).normal(size=(2, 12, 12))
    K, C = 40.0 * A @ A.T, 0.4 * B @ B.T
    K[1, 8] += 9.0  # what is not symmetric has slopes too
    loads, lengths = np.arange(12.0)[:, None], 0.01 * np.arange(6.0)[:, None]
    text = (
        f'<Force_MultiPoint id="1" ref_marker_id="{j}" kmtx_id="1" cmtx_id="2" preload_mtx_id="3" '
        f'length_mtx_id="4" n_i_marker="2">{first} {second}</Force_MultiPoint>'
    )
    for id, matrix in enumerate((K, C, loads, lengths), 1):
        rows, columns = matrix.shape
        values = " ".join(repr(float(x)) for x in matrix.ravel())
        text += (
            f'<Reference_Matrix id="{id}" nrow="{rows}" ncol="{columns}" isroworder="TRUE">'
            f"{values}</Reference_Matrix>"
        )
    check(of(two("FREE", extra=MARKERS + END + text), tmp_path), 1e-5, move=move)


LIMIT = 'cnf_type="IMPACT" stiffness="900" exponent="1.5" damping="20" dmax="0.02"/>'


@pytest.mark.parametrize("bounds", ['upper="-0.3"', 'lower="0.3"'])
@pytest.mark.parametrize(("kind", "motion"), [("CYLINDRICAL", "T"), ("REVOLUTE", "R")])
def test_limits(kind, motion, bounds, tmp_path):
    text = f'<Force_JointLimit id="1" joint_id="2" motion_type="{motion}" {bounds} {LIMIT}'
    it = check(of(two(kind, extra=text), tmp_path))
    # it was in touch
    assert np.abs(it.scene.work.applied[0, :6]).max() > 1.0


@pytest.mark.parametrize("far", [0.0, 9.0])
@pytest.mark.parametrize("type", ["TX", "TY", "RZ"])
def test_dry_friction(type, far, tmp_path):
    turns = type == "RZ"
    i, j = (1002, 1003) if turns else (502, 501)
    text = (
        f'<Force_DryFriction id="1" i_marker_id="{i}" j_marker_id="{j}" type="{type}" '
        'friction="40" dx="2"/>'
    )
    it = Linearised(of(two("REVOLUTE" if turns else "SPHERICAL", extra=MARKERS + text), tmp_path))
    # the slider near, so that the spring holds, or so far that it slides
    it.scene.state.dry[0, 0] = far
    # there was no step that could have found which: each evaluation finds it for itself
    it.scene.state.frozen[0] = 0
    for seed in range(2):
        worst = it.misses(it.moved(0.0, seed))
        print(worst)
        assert worst.max() < 2e-7
    size = np.linalg.norm(it.scene.work.applied[0, :6])
    assert 0.0 < size < 40.0 if far == 0.0 else abs(size - 40.0) < 1e-9


FRICTIONS = {
    "TRANSLATIONAL": "",
    "REVOLUTE": 'pin_radius="0.3"',
    "CYLINDRICAL": 'pin_radius="0.3"',
    "SPHERICAL": 'ball_radius="0.3"',
}


@pytest.mark.parametrize("speed", [0.0, 0.01, 1.0])
@pytest.mark.parametrize("kind", FRICTIONS)
def test_friction_in_joints(kind, speed, tmp_path):
    # reactions are taken as they are: 5 N come from a preload that they do not change
    text = (
        '<Force_JointFriction id="1" joint_id="2" cff_type="COULOMB_ON" mu_static="2e-9" '
        'mu_dynamic="1e-9" stiction_trans_vel="0.5" friction_trans_vel="1.5" preload="5e9" '
        f"{FRICTIONS[kind]}/>"
    )
    it = Linearised(of(two(kind, extra=text), tmp_path))
    for seed in range(2):
        worst = it.misses(it.moved(0.0, seed, speed=speed))
        print(worst)
        assert worst.max() < 1e-6
    force = np.abs(it.scene.work.applied[0, :6]).max()
    assert force > 0.5 if speed == 1.0 else force < 0.5


SUBROUTINES = """
def SFOSUB(id, time, par, npar, dflag, iflag):
    distance, wrong = py_sysfnc("DM", [502, 501])
    rate, wrong_too = py_sysfnc("VR", [502, 501])
    py_errmes(wrong or wrong_too, "DM and VR are known", id, "STOP")
    return -40.0 * (distance - 0.4) - 3.0 * rate
"""


def test_a_subroutine(tmp_path):
    (tmp_path / "sub.py").write_text(SUBROUTINES, encoding="utf-8")
    text = (
        '<Force_Scalar_TwoBody id="1" type="Force" i_marker_id="502" j_marker_id="501" '
        'usrsub_param_string="USER(1)" usrsub_fnc_name="SFOSUB" script_name="sub.py"/>'
    )
    # its derivatives are differences to one side
    check(of(two("SPHERICAL", extra=MARKERS + text), tmp_path), 1e-5)


LATE = {
    "a scalar": scalar(502, 501, "1e-9*(JOINT(2,0,1,0) + 1e9) - 5*VR(502,501)"),
    "a torque": scalar(502, 501, "-AZ(502,501) + 1e-9*JOINT(1,0,2,0)", type="Torque"),
    "a vector": '<Force_Vector_TwoBody id="1" type="ForceAndTorque" i_marker_id="502" '
    f'j_floating_marker_id="501" ref_marker_id="501" {VECTOR}/>'.replace(
        "SIN(WZ(502))", "SIN(WZ(502)) + 1e-9*JOINT(2,0,3,0)"
    ),
}


@pytest.mark.parametrize("name", LATE)
def test_forces_by_reactions(name, tmp_path):
    # reactions are taken as they are, and have next to no part in these
    it = check(of(two("SPHERICAL", extra=MARKERS + LATE[name]), tmp_path), 1e-6, t=0.3)
    assert len(it.scene.applied.by_reactions) > 0


# --- contacts: points and normals stay where they are on the bodies ---

CONTACT = (
    '<Force_Contact id="301" num_i_graphics="1" i_graphics_id="{i}" num_j_graphics="1" '
    'j_graphics_id="{j}" cnf_type="IMPACT" stiffness="1e5" exponent="1.5" damping="50" dmax="1e-3" '
    'cff_type="COULOMB_ON" mu_static="0.4" mu_dynamic="0.3" stiction_trans_vel="0.1" '
    'friction_trans_vel="0.2"/>'
)
PLANE = '<Post_Graphic id="100" type="Plane" rm_id="100"/>'
TOUCHING = {
    # bodies, graphics, the two that touch; overlap 1 mm
    "sphere on a plane": (
        [Body(1.0, (0.004, 0.004, 0.004), (0.0, 0.0, 0.099))],
        PLANE + '<Post_Graphic id="101" type="Sphere" center_marker_id="101" radius="0.1"/>',
        (101, 100),
    ),
    "sphere on a sphere": (
        [
            Body(1.0, (0.004, 0.004, 0.004), (0.0, 0.0, 0.3)),
            Body(2.0, (0.02, 0.02, 0.02), (0.06, 0.0, 0.3 + np.sqrt(0.199**2 - 0.06**2))),
        ],
        '<Post_Graphic id="101" type="Sphere" center_marker_id="101" radius="0.1"/>'
        '<Post_Graphic id="102" type="Sphere" center_marker_id="102" radius="0.1"/>',
        (101, 102),
    ),
    "box on a plane": (
        [Body(1.0, (0.02, 0.02, 0.02), (0.0, 0.0, 0.099))],
        PLANE + '<Post_Graphic id="101" type="BoxDefinedFromCenter" center_marker_id="101" '
        'length_x="0.3" length_y="0.2" length_z="0.2"/>',
        (101, 100),
    ),
}


def touching(name, slip, folder):
    """Return the deck and a state in which bodies overlap, slip and spin."""
    bodies, graphics, (i, j) = TOUCHING[name]
    it = Linearised(of(Scene(bodies, [], extra=graphics + CONTACT.format(i=i, j=j)), folder))
    y = it.y.copy()
    y[7:13] = slip, 0.3 * slip, -0.01, 0.2, 0.3, 0.4
    return it, it.on_manifold(y, 0.0)


@pytest.mark.parametrize("slip", [0.0, 0.05, 0.15, 1.0])
@pytest.mark.parametrize("name", TOUCHING)
def test_contacts(name, slip, tmp_path):
    it, y = touching(name, slip, tmp_path)
    # what frozen points leave is as of a stiffness, and so falls with 1/c1^2; wrong slopes by
    # slip (some 20 N s/m on 1 kg) or by depth (5000 N/m) would leave 2e-2 and 5e-3 or more
    worst = it.misses(y, coefficients=(1e3, 1e4, 1e5))
    print(name, slip, worst)
    assert it.scene.work.hit[-1] > 0
    assert worst[0] < 2e-3
    assert worst[1] < 0.02 * worst[0]
    assert worst[2] < 1e-6


RIGID = CONTACT.replace('"COULOMB_ON"', '"STICTION" tangential_stiffness="INFINITE"').replace(
    'stiction_trans_vel="0.1" friction_trans_vel="0.2"', ""
)


@pytest.mark.parametrize("slip", [0.0, 0.15])
@pytest.mark.parametrize("name", TOUCHING)
def test_contacts_without_give(name, slip, tmp_path):
    # held by equations at all points, or slipping at all
    bodies, graphics, (i, j) = TOUCHING[name]
    it = Linearised(of(Scene(bodies, [], extra=graphics + RIGID.format(i=i, j=j)), tmp_path))
    y = it.y.copy()
    y[7:13] = slip, 0.3 * slip, -0.01, 0.2, 0.3, 0.4
    it.f(y, 0.0)
    hit = it.scene.work.hit[: it.scene.work.hit[-1]]
    it.scene.state.memory[hit, 0] = SLIP if slip else STICK
    it.scene.state.memory[hit, 1] = 1e-13
    it.runner.hooks.joints_at(0.0)(Joints.CHOOSE, y)
    held = int(it.scene.equations.active[-1])
    assert held == (0 if slip else 2 if len(hit) == 1 else 3)
    worst = it.misses(it.on_manifold(y, 0.0), coefficients=(1e3, 1e4, 1e5))
    print(name, slip, worst)
    # points frozen on what holds are of first order in the step
    assert worst[0] < 1e-3
    assert worst[1] < 0.3 * worst[0]
    assert worst[2] < 1e-5


# --- the systems themselves ---


@pytest.mark.usefixtures("multipliers")
@pytest.mark.parametrize("case", ["chain", "loop and states", "touching"])
def test_complex_and_real_coefficients_agree(case, tmp_path):
    if case == "touching":
        it, y = touching("box on a plane", 0.15, tmp_path)
    else:
        scene = two("REVOLUTE", extra=MARKERS + FORCES["states"])
        last = Joint("SPHERICAL", 2, 0, p=(1.8, 0.1, 0.2))
        joints = [*scene.joints, last] if case != "chain" else scene.joints
        it = Linearised(of(Scene(scene.bodies, joints, extra=scene.extra), tmp_path))
        y = it.moved(move=0.02)
    it.linearise(y, 0.0)
    rng = np.random.default_rng(2)
    a, b = rng.normal(size=(2, it.n))
    it.factor(30.0)
    one, other = it.solve(a), it.solve(b)
    both = it.solve_pair(30.0 + 0.0j, a + 1j * b)
    for ours, real in ((both.real, one), (both.imag, other)):
        np.testing.assert_allclose(ours, real, rtol=0, atol=1e-11 * np.abs(real).max())
    # with complex coefficients: conjugate ones give the conjugate
    c1 = 30.0 + 20.0j
    up, down = it.solve_pair(c1, a + 1j * b), it.solve_pair(c1.conjugate(), a - 1j * b)
    np.testing.assert_allclose(up, down.conjugate(), rtol=0, atol=1e-11 * np.abs(up).max())
    # and they are the same functions of c1: the mean over a circle is the value at its centre
    ring = [it.solve_pair(30.0 + 0.5 * np.exp(0.25j * np.pi * k), a) for k in range(8)]
    np.testing.assert_allclose(np.mean(ring, axis=0), one, rtol=0, atol=1e-9 * np.abs(one).max())


def test_what_touched_before_does_not_matter(tmp_path):
    it, y = touching("sphere on a sphere", 0.15, tmp_path)
    apart = y.copy()
    apart[13:16] += (0.0, 0.0, 0.5)
    answers = []
    r = np.random.default_rng(3).normal(size=it.n)
    for state in (apart, y, apart, y):
        it.linearise(state, 0.0)
        it.factor(1e3)
        answers.append(it.solve(r))
    assert np.abs(answers[1] - answers[0]).max() > 1e-6
    for k in (0, 1):
        np.testing.assert_allclose(answers[2 + k], answers[k], rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("name", ["sdnd100", "lugre_stick_slip"])
def test_x_and_memory_of_friction_are_unknowns(name):
    at = Linearised(MODELS / f"{name}.xml")
    slots = at.scene.slots
    x = [p + j for p in slots.x if p >= 0 for j in range(3)]
    z = [p + j for p in slots.z if p >= 0 for j in range(2)]
    assert len(x + z) > 0
    at.rows = np.array([*at.rows, *x, *z])
    y = at.y.copy()
    # LuGre's bristles bent, the block on its way: all terms count
    y[z] = 1e-6
    y[7:9] = (0.02, -0.01) if z else (0.0, 0.0)
    changes = at.changes
    at.changes = lambda y, t: changes(y, t, 1e-9)
    # depth changes the contact point too, which is frozen: what that misses falls with the step
    assert (at.misses(y, coefficients=(1e3, 1e5)) < (1e-3, 1e-5)).all()
    # complex coefficients
    c1, worst = 1e4 * (1 + 2j), 0.0
    at.linearise(y, 0.0)
    for dx, df in at.changes(y, 0.0):
        miss = at.solve_pair(c1, (c1 * dx - df).astype(complex)) - dx
        worst = max(worst, np.abs(miss[at.rows]).max() / abs(c1))
    assert worst < 1e-6


def leaning(shape, degrees, friction):
    """Return a mesh that is tilted and 0.2 mm below the ground at its lowest corner."""
    if shape == "ring":
        solid = trimesh.creation.annulus(0.05, 0.1, 0.1, sections=24)
    else:
        solid = trimesh.creation.cylinder(0.1, 0.1, sections=96)
    R = turned((1.0, 0.3, 0.0), np.radians(degrees))
    first, second, third = (float(x) for x in Rotation.from_matrix(R).as_euler("ZXZ"))
    high = -2e-4 - float((solid.vertices @ R.T)[:, 2].min())
    return f"""
<Body_Rigid id="1" isground="TRUE"/><Reference_Marker id="10" body_id="1"/>
<Post_Graphic id="100" type="Plane" rm_id="10"/>
<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="4e-3" inertia_yy="4e-3" inertia_zz="2e-3"/>
<Reference_Marker id="20" body_id="2" pos_z="{high!r}" psi="{first!r}" theta="{second!r}"
 phi="{third!r}"/>{mesh_graphic(200, 20, solid.vertices, solid.faces)}
<Force_Contact id="301" i_graphics_id="200" j_graphics_id="100" cnf_type="IMPACT" stiffness="1e6"
 exponent="1.5" damping="0" dmax="1e-5" {friction}/>"""


@pytest.mark.parametrize("friction", ["", 'cff_type="TANH" mu_dynamic="0.3"'])
@pytest.mark.parametrize("degrees", [4.0, 5.0, 8.0, 20.0])
@pytest.mark.parametrize("shape", ["ring", "cylinder"])
def test_a_flat_side_that_leans(shape, degrees, friction, tmp_path):
    """Slopes of the couples that change with the tilt; how corners turn with the body is missed."""
    extra = f'{friction} friction_trans_vel="1e-3"' if friction else ""
    it = Linearised(write_deck(tmp_path, leaning(shape, degrees, extra)))
    y = it.y.copy()
    y[7:13] += [1e-3, 2e-3, -1e-3, 0.01, 0.02, 0.03]
    changes = list(it.changes(y, 0.0, eps=1e-8))
    it.linearise(y, 0.0)
    for c1, bound in ((1e2, 0.025), (1e3, 4e-4)):
        it.factor(c1)
        for dx, df in changes:
            miss = it.solve(c1 * dx - df) - dx
            miss[7:13] /= c1
            assert np.abs(miss[it.rows]).max() < bound


@pytest.mark.parametrize("friction", ["", 'cff_type="TANH" mu_dynamic="0.3"'])
def test_a_region_that_is_tilted_slides_and_spins(friction, tmp_path):
    # one incident: the slopes of depth, of its place and of the slip there; how corners turn with
    # the block, which is left out of points too, is what is missed
    model = f"""
<Body_Rigid id="1" isground="TRUE"/>
<Reference_Marker id="10" body_id="1"/>
<Post_Graphic id="100" type="Plane" rm_id="10"/>
<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="4e-3" inertia_yy="4e-3" inertia_zz="2e-3"/>
<Reference_Marker id="20" body_id="2" pos_z="0.0998" phi="0.2" theta="5e-4"/>
<Post_Graphic id="200" type="BoxDefinedFromCenter" center_marker_id="20"
 length_x="0.1" length_y="0.1" length_z="0.2"/>
<Force_Contact id="301" contact_points="REGION" i_graphics_id="200" j_graphics_id="100"
 cnf_type="IMPACT" stiffness="1e6" exponent="1.5" damping="0" dmax="1e-5" {friction}
 {'friction_trans_vel="1e-3"' if friction else ""}/>
<Force_Gravity grav_z="-9.81"/>"""
    it = Linearised(write_deck(tmp_path, model))
    y = it.y.copy()
    y[7:13] += [1e-3, 2e-3, -1e-3, 0.01, 0.02, 0.03]
    changes = list(it.changes(y, 0.0, eps=1e-8))
    it.linearise(y, 0.0)
    worst = 0.0
    for c1 in (1e2, 1e3):
        it.factor(c1)
        for dx, df in changes:
            miss = it.solve(c1 * dx - df) - dx
            miss[7:13] /= c1
            worst = max(worst, np.abs(miss[it.rows]).max())
    assert worst < 0.03, worst

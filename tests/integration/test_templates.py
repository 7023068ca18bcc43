"""What a new part of the program touches: the templates, each dropped into a copy, and run."""

from __future__ import annotations

import json
import math
import os
import runpy
import shutil
import subprocess
import sys

import numpy as np
import pytest
from scipy.special import ellipj

from helpers.decks import EARTH, GRAVITY, GROUND, contact, sphere
from helpers.folders import MODELS, PACKAGES, TESTS
from helpers.templates import TEMPLATES

G = 9.81

#: Runs decks in the copy, whose unchanged code is in the cache by its content.
RUN = """
import json, sys
import mbsim
wanted = json.loads(sys.stdin.read())
for job in wanted:
    results = mbsim.simulate(mbsim.read_model(job["deck"]), **job["settings"])
    print(json.dumps({name: results[name].tolist() for name in job["signals"]}))
"""
CHECK = """
import runpy, sys
sys.argv[1:] = ["check", "deck0.xml"]
runpy.run_module("mbsim", run_name="__main__")
"""


def replace(file, *pairs):
    """Put lines in place of others, each of which stands once in the file."""
    text = file.read_text(encoding="utf-8")
    for old, new in zip(pairs[::2], pairs[1::2], strict=True):
        assert text.count(old) == 1, f"{file.name}: {old!r}"
        text = text.replace(old, new)
    file.write_text(text, encoding="utf-8")


def put_in(name, package):
    """Put a template into the copy of the package."""
    file, template = TESTS / "templates" / f"{name}.py", TEMPLATES[name]
    if template.place:
        assert not (package / template.place).exists()
        shutil.copy(file, package / template.place)
    else:
        for path, pairs in runpy.run_path(str(file))["LINES"].items():
            replace(package.parent / path, *pairs)
    for path, *pairs in template.lines:
        replace(package / path, *pairs)
    if template.instead_of:
        path, line = template.instead_of
        replace(package / path, line, "")


def files_of(template):
    """Return how many files it touches, with that of what it is put in place of."""
    return template.files + (template.instead_of is not None)


def touched(package):
    """Return the files that are not as they are in the package under test."""
    own = PACKAGES / "mbsim"
    return {
        file.relative_to(package).as_posix()
        for file in package.rglob("*.py")
        if not (known := own / file.relative_to(package)).is_file()
        or known.read_bytes() != file.read_bytes()
    }


def copied(folder):
    """Return a copy of the package, sources alone."""
    leave_out = shutil.ignore_patterns("__pycache__", "shipped_code")
    shutil.copytree(PACKAGES / "mbsim", folder / "mbsim", ignore=leave_out)
    return folder / "mbsim"


def in_copy(folder, script, given=""):
    """Run a script with the copy in `folder` as the package, and return what it prints."""
    done = subprocess.run(
        [sys.executable, "-c", script],
        cwd=folder,
        input=given,
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": str(folder)},
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def run_in_copy(folder, *jobs):
    """Run decks (text, signals, settings) there; return the signals of each."""
    wanted = []
    for n, (deck, signals, settings) in enumerate(jobs):
        file = folder / f"deck{n}.xml"
        file.write_text(deck, encoding="utf-8")
        wanted.append({"deck": str(file), "signals": ["time", *signals], "settings": settings})
    lines = in_copy(folder, RUN, json.dumps(wanted)).splitlines()
    return [{name: np.array(values) for name, values in json.loads(line).items()} for line in lines]


@pytest.fixture
def copy_with(tmp_path):
    """Return a function that makes the copy with one template, whose files are counted."""

    def make(name):
        package = copied(tmp_path)
        put_in(name, package)
        assert len(touched(package)) == files_of(TEMPLATES[name]), sorted(touched(package))
        return tmp_path

    return make


def alone(shape):
    """Return the statements of a body without its graphic."""
    return shape.split("<Post_Graphic")[0]


def whole(model, end, transient=""):
    """Return a deck of these statements."""
    return (
        f"<MotionSolve><Model>{model}</Model><Command>{transient}"
        f'<Simulate analysis_type="Transient" end_time="{end}" print_interval="{end / 10}"/>'
        "</Command></MotionSolve>"
    )


def body(v=(0.0, 0.0, 0.0), w=(0.0, 0.0, 0.0), z=0.0, x=0.0):
    """Return ground and a body of 1 kg, markers 10 and 20."""
    return EARTH + alone(sphere(z, v=v, w=w, x=x))


def test_every_template_is_found(tmp_path):
    """All of them in one copy, by the registries and the words that decks may say."""
    package = copied(tmp_path)
    for name in TEMPLATES:
        put_in(name, package)
    # no two of these touch one file
    assert len(touched(package)) == sum(map(files_of, TEMPLATES.values()))
    script = """
from mbsim.forces.catalog import FORCES
from mbsim.geometry.catalog import PAIRS
from mbsim.integrators import catalog
from mbsim.joints.catalog import JOINTS
from mbsim.laws.catalog import FRICTION_LAWS, NORMAL_LAWS
from mbsim.reader import keywords
from mbsim.reader.statements import BY_KEY
assert "VISCOUS" in FRICTION_LAWS and "VISCOUS" in keywords.CFF_TYPES.values()
assert "slip_coef" in BY_KEY["forcecontact"].attributes
assert "KELVIN_VOIGT" in NORMAL_LAWS and "KELVIN_VOIGT" in keywords.CNF_OF_LIMITS.values()
assert "PIN_IN_SLOT" in JOINTS
assert "TETHER" in FORCES and "forcetether" in BY_KEY
assert "CUBICSPRING" in FORCES and "forcecubicspring" in BY_KEY
assert "ELLIPSOID-MESH" in PAIRS
assert "HEUN" in catalog.METHODS and catalog.load("HEUN").stages == 3
assert "MARKER_VELOCITY_IN_J" in keywords.REQUEST_TYPES.values()
assert "preload_rate" in BY_KEY["forcejointfriction"].attributes
assert "pull" in BY_KEY["forcecontact"].attributes
assert "forcelift" in BY_KEY
from mbsim.manual.tables import made
from mbsim.manual.book import Page
page = Page("reference/x", "")
for table, word in (
    ("law VISCOUS", "slip_coef"), ("law KELVIN_VOIGT", "damping"), ("joints", "PIN_IN_SLOT"),
    ("attributes Force_Tether", "stiffness"), ("couple-of-shapes", "C"), ("methods", "HEUN"),
    ("statements", "Force_Lift"), ("requests", "MARKER_VELOCITY_IN_J"),
    ("attributes Force_JointFriction", "preload_rate"), ("attributes Force_Contact", "pull"),
):
    assert word in made(table, page), table
"""
    in_copy(tmp_path, script)


@pytest.mark.slow
def test_friction_law(copy_with):
    deck = (MODELS / "sliding_block.xml").read_text(encoding="utf-8")
    old = deck[deck.index('cff_type="COULOMB_ON"') : deck.index('friction_trans_vel="1e-3"/>')]
    deck = deck.replace(old, 'cff_type="VISCOUS" slip_coef="0.2" ')
    deck = deck.replace('friction_trans_vel="1e-3"/>', "/>")
    (found,) = run_in_copy(copy_with("friction_law"), (deck, ["bodies/2/velocity"], {}))
    t, v = found["time"], found["bodies/2/velocity"][:, 0]
    # N is the weight but for the block's pitching, which friction at its foot sets going
    np.testing.assert_allclose(v, 5.0 * np.exp(-0.2 * G * t), rtol=2e-3)


@pytest.mark.slow
def test_normal_law(copy_with):
    stands, deep = 0.1 - G / 1e4, 0.1 - 2.0 * G / 1e4  # its weight of 9.81 N on 1e4 N/m
    deck = GROUND + sphere(deep) + GRAVITY
    deck += contact(cnf_type="KELVIN_VOIGT", stiffness=1e4, damping=20)
    folder = copy_with("normal_law")
    (found,) = run_in_copy(folder, (whole(deck, 0.05), ["bodies/2/position"], {"tol": 1e-8}))
    # 1 kg: x'' = -1e4 x - 20 x', from G/1e4 below where it stands
    t, w = found["time"], math.sqrt(1e4 - 100.0)
    swing = np.exp(-10.0 * t) * (np.cos(w * t) + 10.0 / w * np.sin(w * t))
    below = (stands - found["bodies/2/position"][:, 2]) / (G / 1e4)
    np.testing.assert_allclose(below, swing, atol=1e-4)


def test_statement(copy_with):
    deck = body() + '<Force_Lift id="1" i_marker_id="20" lift="2"/>'
    (found,) = run_in_copy(copy_with("statement"), (whole(deck, 1.0), ["bodies/2/position"], {}))
    np.testing.assert_allclose(found["bodies/2/position"][:, 2], found["time"] ** 2, atol=1e-9)


@pytest.mark.slow
def test_joint(copy_with):
    deck = body(w=(0.0, 0.0, 2.0)) + (
        '<Constraint_Joint id="1" type="PIN_IN_SLOT" i_marker_id="20" j_marker_id="10"/>'
        '<Force_Gravity grav_x="3" grav_y="-9.81" grav_z="1"/>'
    )
    signals = ["bodies/2/position", "bodies/2/angular_velocity"]
    (found,) = run_in_copy(copy_with("joint"), (whole(deck, 1.0), signals, {}))
    fall = np.outer(1.5 * found["time"] ** 2, (1.0, 0.0, 0.0))
    np.testing.assert_allclose(found["bodies/2/position"], fall, atol=1e-10)
    np.testing.assert_allclose(
        found["bodies/2/angular_velocity"], np.full((11, 3), (0.0, 0.0, 2.0)), atol=1e-10
    )


def tethered(t):
    """Return where a body at x = 1 with v_y = 2 is on a tether of 16 N/m."""
    return np.stack([np.cos(4.0 * t), 0.5 * np.sin(4.0 * t), 0.0 * t], axis=1)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["DOPRI5", "RADAU5"])  # the latter asks its slopes
def test_force(copy_with, method):
    deck = body(v=(0.0, 2.0, 0.0), x=1.0) + (
        '<Force_Tether id="1" i_marker_id="20" j_marker_id="10" stiffness="16"/>'
    )
    settings = {"integrator": method, "tol": 1e-8}
    (found,) = run_in_copy(copy_with("force"), (whole(deck, 1.0), ["bodies/2/position"], settings))
    np.testing.assert_allclose(found["bodies/2/position"], tethered(found["time"]), atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["DOPRI5", "RADAU5"])
def test_scalar_force(copy_with, method):
    deck = body(x=1.0) + (
        '<Force_CubicSpring id="1" i_marker_id="20" j_marker_id="10" stiffness="1"/>'
    )
    settings = {"integrator": method, "tol": 1e-8}
    signals = ["bodies/2/position", "cubic_springs/1/force"]
    (found,) = run_in_copy(copy_with("scalar_force"), (whole(deck, 1.0), signals, settings))
    # x'' = -x^3, x(0) = 1: Jacobi's cn of modulus 1/sqrt(2)
    x = ellipj(found["time"], 0.5)[1]
    np.testing.assert_allclose(found["bodies/2/position"][:, 0], x, atol=1e-6)
    np.testing.assert_allclose(found["cubic_springs/1/force"][:, 0], -(x**3), atol=4e-6)


@pytest.mark.slow
def test_pair(copy_with):
    corners = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 0)]
    faces = "0 1 3 0 3 2 4 6 7 4 7 5 0 4 5 0 5 1 2 3 7 2 7 6 0 2 6 0 6 4 1 5 7 1 7 3"
    nodes = " ".join(str(float(c)) for corner in corners for c in corner)
    stands = 0.3 - G / 1e4  # its weight of 9.81 N on 1e4 N/m
    deck = (
        EARTH
        + f'<Post_Graphic id="100" type="TriaMesh" rm_id="10"><Nodes>{nodes}</Nodes>'
        + f"<Faces>{faces}</Faces></Post_Graphic>"
        + body(z=stands).removeprefix(EARTH)
        + '<Post_Graphic id="200" type="Ellipsoid" center_marker_id="20" x_scale="0.2" '
        + 'y_scale="0.1" z_scale="0.3"/><Force_Gravity grav_z="-9.81"/>'
        + contact(stiffness=1e4, exponent=1, damping=10, dmax=1e-5)
    )
    signals = ["bodies/2/position", "contacts/301/penetration"]
    folder = copy_with("pair")
    (found,) = run_in_copy(folder, (whole(deck, 0.05), signals, {}))
    np.testing.assert_allclose(found["bodies/2/position"][:, 2], stands, atol=1e-9)
    np.testing.assert_allclose(found["contacts/301/penetration"], G / 1e4, rtol=1e-6)
    assert "closed form ELLIPSOID-MESH" in in_copy(folder, CHECK)


@pytest.mark.slow
def test_integrator(copy_with):
    jobs = []
    for h in (0.02, 0.01):
        deck = body(v=(0.0, 2.0, 0.0), x=1.0) + (
            '<Force_Bushing id="1" i_marker_id="20" j_marker_id="10" kx="16" ky="16" kz="16"/>'
        )
        # a loose tolerance: the longest step is every step
        deck = whole(deck, 1.0, f'<Param_Transient h_max="{h}"/>')
        jobs.append((deck, ["bodies/2/position"], {"integrator": "HEUN", "tol": 0.1}))
    found = run_in_copy(copy_with("integrator"), *jobs)
    coarse, fine = (
        np.linalg.norm((each["bodies/2/position"] - tethered(each["time"]))[-1]) for each in found
    )
    # a step of w h = 0.08: h^2 w^3 t/6 = 0.0043
    assert coarse < 0.01
    assert 1.8 < np.log2(coarse / fine) < 2.2


@pytest.mark.slow
def test_request(copy_with):
    spins = alone(sphere(0.0, body=3, w=(0.0, 0.0, 2.0)))
    deck = body(v=(1.0, 0.0, 0.0), x=0.5) + spins
    deck += '<Post_Request id="7" type="MARKER_VELOCITY_IN_J" i_marker_id="20" j_marker_id="30"/>'
    (found,) = run_in_copy(copy_with("request"), (whole(deck, 1.0), ["requests/7"], {}))
    t, values = found["time"], found["requests/7"]
    # I at (1/2 + t, 0), J spins at its place: v - w x r
    expected = np.stack([1.0 + 0.0 * t, -2.0 * (0.5 + t), 0.0 * t], axis=1)
    np.testing.assert_allclose(values[:, 1:4], expected, atol=1e-9)
    np.testing.assert_allclose(values[:, 0], np.linalg.norm(expected, axis=1), atol=1e-9)
    np.testing.assert_allclose(values[:, 7], -2.0, atol=1e-12)


@pytest.mark.slow
def test_attribute(copy_with):
    deck = body(v=(0.0, 0.0, 2.0)) + (
        '<Constraint_Joint id="1" type="TRANSLATIONAL" i_marker_id="20" j_marker_id="10"/>'
        '<Force_JointFriction id="1" joint_id="1" cff_type="COULOMB_DYNAMICONLY" mu_dynamic="0.5" '
        'friction_trans_vel="1e-3" preload="1" preload_rate="2"/>'
    )
    (found,) = run_in_copy(copy_with("attribute"), (whole(deck, 1.0), ["bodies/2/velocity"], {}))
    t = found["time"]
    # 1 kg: dv/dt = -0.5 (1 + 2 t), 1 m/s left
    np.testing.assert_allclose(found["bodies/2/velocity"][:, 2], 2.0 - 0.5 * (t + t * t), atol=1e-6)


@pytest.mark.slow
def test_contact_attribute(copy_with):
    stands = 0.1 - (G + 5.0) / 1e4  # its weight of 9.81 N and the pull on 1e4 N/m
    deck = GROUND + sphere(stands) + GRAVITY + contact(stiffness=1e4, exponent=1, pull=5)
    folder, signals = copy_with("contact_attribute"), ["bodies/2/position", "contacts/301/force"]
    (found,) = run_in_copy(folder, (whole(deck, 0.05), signals, {}))
    np.testing.assert_allclose(found["bodies/2/position"][:, 2], stands, atol=1e-9)
    np.testing.assert_allclose(np.abs(found["contacts/301/force"][:, 2]), G, rtol=1e-6)

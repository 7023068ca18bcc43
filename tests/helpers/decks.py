"""Helpers for tests that run whole decks in memory."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import mbsim
from helpers.folders import MODELS
from mbsim.errors import Interrupted
from mbsim.run import loop

GROUND = """
<Body_Rigid id="1" isground="TRUE"/>
<Reference_Marker id="10" body_id="1"/>
<Post_Graphic id="100" type="Plane" rm_id="10"/>
"""


def run_model(name, **settings):
    """Run a deck of `models/`."""
    overrides = settings.pop("overrides", ())
    return mbsim.simulate(mbsim.read_model(MODELS / name, overrides), **settings)


def write_deck(folder, model, end_time=1.0, print_interval=0.01, name="deck.xml"):
    """Write a deck around the given model statements and return its path."""
    path = Path(folder) / name
    path.write_text(
        f"<MotionSolve><Model>{model}</Model><Command>"
        f'<Simulate analysis_type="Transient" end_time="{end_time}" '
        f'print_interval="{print_interval}"/></Command></MotionSolve>',
        encoding="utf-8",
    )
    return path


def run_deck(folder, model, end_time=1.0, print_interval=0.01, **settings):
    """Run model statements and return the results."""
    path = write_deck(folder, model, end_time, print_interval)
    return mbsim.simulate(mbsim.read_model(path), **settings)


def run_in_pieces(model, folder, monkeypatch, pieces=(9, 14, 6), **settings):
    """Interrupt a run after so many looks at its progress, resume it, and return the whole.

    It looks as often as it can from here on.
    """
    monkeypatch.setattr("mbsim.run.divergence.RETURN_SECONDS", 1e-6)
    monkeypatch.setattr(loop, "FIRST_BUDGET", 7)
    for k, most in enumerate(pieces):
        left = [most]

        def stop(time, step, until, left=left):
            left[0] -= 1
            if left[0] == 0:
                raise Interrupted("enough")

        resume = k > 0
        try:
            mbsim.simulate(model, output=folder, progress=stop, resume=resume, **settings)
        except Interrupted:
            continue
        raise AssertionError(f"it ended before it was interrupted, piece {k}")
    return mbsim.simulate(model, output=folder, resume=True, **settings)


def sphere(
    z, mass=1.0, radius=0.1, v=(0.0, 0.0, 0.0), w=(0.0, 0.0, 0.0), body=2, x=0.0, inertia=None
):
    """Return statements of one solid sphere."""
    value = 0.4 * mass * radius**2 if inertia is None else inertia
    flags = "".join(
        f'{kind}_ic_{axis}="{number!r}" {kind}_ic_{axis}_flag="TRUE" '
        for kind, vector in (("v", v), ("w", w))
        for axis, number in zip("xyz", vector, strict=True)
    )
    return f"""
<Body_Rigid id="{body}" cg_id="{10 * body}" mass="{mass!r}" inertia_xx="{value!r}"
  inertia_yy="{value!r}" inertia_zz="{value!r}" {flags}/>
<Reference_Marker id="{10 * body}" body_id="{body}" pos_x="{x!r}" pos_z="{z!r}"/>
<Post_Graphic id="{100 * body}" type="Sphere" center_marker_id="{10 * body}" radius="{radius!r}"/>
"""


def contact(i=200, j=100, id=301, **attributes):
    """Return a Force_Contact; IMPACT with k = 1e5, e = 1.5 unless said otherwise."""
    values = {"cnf_type": "IMPACT"}
    if "cnf_type" not in attributes:
        values |= {"stiffness": 1e5, "exponent": 1.5}
    values.update(attributes)
    text = " ".join(f'{name}="{value}"' for name, value in values.items())
    return (
        f'<Force_Contact id="{id}" num_i_graphics="1" i_graphics_id="{i}" '
        f'num_j_graphics="1" j_graphics_id="{j}" {text}/>'
    )


GRAVITY = '<Force_Gravity grav_z="-9.81"/>'
COULOMB = {
    "cff_type": "COULOMB_ON",
    "mu_static": 0.3,
    "mu_dynamic": 0.2,
    "stiction_trans_vel": 0.01,
    "friction_trans_vel": 0.02,
}


#: Ground and marker 10 at its origin, with nothing to touch.
EARTH = '<Body_Rigid id="1" isground="TRUE"/><Reference_Marker id="10" body_id="1"/>'

EDGE = 0.2
INERTIA = EDGE**2 / 6.0  # of a cube of 1 kg


def cube(body, p, angles=(0.0, 0.0, 0.0), v=(0.0, 0.0, 0.0), w=(0.0, 0.0, 0.0)):
    """Return a cube of 1 kg."""
    flags = "".join(
        f'{kind}_ic_{axis}="{float(number)!r}" {kind}_ic_{axis}_flag="TRUE" '
        for kind, given in (("v", v), ("w", w))
        for axis, number in zip("xyz", given, strict=True)
    )
    place = " ".join(f'pos_{a}="{float(x)!r}"' for a, x in zip("xyz", p, strict=True))
    turn = " ".join(
        f'{name}="{float(angle)!r}"'
        for name, angle in zip(("psi", "theta", "phi"), angles, strict=True)
    )
    return f"""<Body_Rigid id="{body}" cg_id="{10 * body}" mass="1" inertia_xx="{INERTIA!r}"
      inertia_yy="{INERTIA!r}" inertia_zz="{INERTIA!r}" {flags}/>
    <Reference_Marker id="{10 * body}" body_id="{body}" {place} {turn}/>
    <Post_Graphic id="{100 * body}" type="BoxDefinedFromCenter" center_marker_id="{10 * body}"
      length_x="{EDGE}" length_y="{EDGE}" length_z="{EDGE}"/>"""


def drift(results):
    """Return by how much kinetic, potential and dissipated energy miss a constant."""
    names = ("kinetic", "potential", "dissipated")
    total = sum(results[f"energy/{name}"] for name in names)
    return np.abs(total - total[0]).max()


def assert_same(one, other, tolerance):
    """Assert that body 2 moves alike in two runs."""
    for name in ("position", "velocity", "angular_velocity"):
        a, b = one[f"bodies/2/{name}"], other[f"bodies/2/{name}"]
        np.testing.assert_allclose(a, b, rtol=0.0, atol=tolerance * max(1.0, np.abs(a).max()))

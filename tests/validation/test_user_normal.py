"""CNFSUB: the same motion as the built-in law in every language, its arguments, its failures."""

from __future__ import annotations

import json

import numpy as np
import pytest
from click.testing import CliRunner

import mbsim
from helpers.decks import (
    COULOMB,
    GRAVITY,
    GROUND,
    assert_same,
    contact,
    run_deck,
    sphere,
    write_deck,
)
from helpers.folders import ROOT, USERFUNCS
from helpers.libraries import compiled, example
from mbsim.cli.main import main
from mbsim.errors import Interrupted, ModelError, PluginError

USER = {"cnf_type": "USERCNF", "cnf_param_string": "USER(1e5,1.5,0.4)"}
BUILT_IN = {"cnf_type": "HUNT_CROSSLEY", "stiffness": 1e5, "exponent": 1.5, "damping": 0.4}
SCRIPT = {**USER, "script_name": str(USERFUNCS / "cnfsub.py")}


def dropped(**law):
    """A ball that falls by 0.2, bounces and slides."""
    ball = sphere(0.3, v=(0.5, 0.2, 0.0), w=(0.1, 0.2, 3.0))
    return GROUND + ball + contact(**law, **COULOMB) + GRAVITY


@pytest.mark.parametrize("language", ["compiled", "interpreted", "cnfsub.c", "cnfsub.f90"])
def test_the_built_in_law_written_as_a_users_moves_alike(tmp_path, language):
    law, how = SCRIPT, {"interpret_plugins": language == "interpreted"}
    if language.startswith("cnfsub"):
        law = {**USER, "cnf_dll_name": str(example(tmp_path, language))}
    one = run_deck(tmp_path, dropped(**law), 1.0, tol=1e-11, **how)
    other = run_deck(tmp_path, dropped(**BUILT_IN), 1.0, tol=1e-11)
    assert other["contacts/301/penetration"].max() > 1e-4
    # steps differ in the last bits of what guards them
    assert_same(one, other, 1e-9)


@pytest.mark.parametrize("source", ["cnfsub.c", "cnfsub.f90"])
def test_the_same_law_gives_the_same_motion_in_every_language(tmp_path, source):
    def run(**where):
        return run_deck(tmp_path, dropped(**USER, **where), 1.0, tol=1e-11)

    script = {"script_name": str(USERFUNCS / "cnfsub.py")}
    python, library = run(**script), run(cnf_dll_name=str(example(tmp_path, source)))
    # steps differ in the last bits of the energy by which those at a touch are bounded
    assert_same(python, library, 1e-9)


@pytest.mark.parametrize("integrator", ["DOPRI5", "RADAU5", "VERLET"])
def test_every_kind_of_method_runs_with_it(tmp_path, integrator):
    one = run_deck(tmp_path, dropped(**SCRIPT), 0.5, tol=1e-6, integrator=integrator)
    other = run_deck(tmp_path, dropped(**BUILT_IN), 0.5, tol=1e-6, integrator=integrator)
    np.testing.assert_allclose(
        one["bodies/2/position"], other["bodies/2/position"], rtol=0.0, atol=2e-4
    )


def test_all_work_of_a_users_law_counts_as_dissipated(tmp_path):
    results = run_deck(tmp_path, dropped(**SCRIPT), 1.0, tol=1e-9)
    whole = sum(results[f"energy/{kind}"] for kind in ("kinetic", "potential", "dissipated"))
    np.testing.assert_allclose(whole, whole[0], rtol=0.0, atol=1e-6 * whole[0])


SEEN = """calls = []
def CNFSUB(*given):
    calls.append(given)
    if dict(enumerate(given))[12] == 0 and len(calls) == 2:
        raise RuntimeError(repr(given))
    return 0.0
"""


def test_places_and_normals_are_in_the_graphics_markers(tmp_path):
    (tmp_path / "seen.py").write_text(SEEN)
    plane = """<Body_Rigid id="1" isground="TRUE"/>
    <Reference_Marker id="10" body_id="1" pos_x="1.0" pos_z="0.5" theta="3.141592653589793"/>
    <Post_Graphic id="100" type="BoxDefinedFromCenter" center_marker_id="10"
      length_x="4" length_y="4" length_z="1"/>"""
    law = {**USER, "script_name": "seen.py", "cff_type": "COULOMB_OFF"}
    ball = sphere(1.098, x=1.3, v=(0.5, 0.2, -0.25))
    path = write_deck(tmp_path, plane + ball + contact(**law), 0.01)
    with pytest.raises(PluginError) as caught:
        mbsim.simulate(mbsim.read_model(path))
    given = eval(str(caught.value).split("RuntimeError: ")[1].splitlines()[0])
    id, time, par, npar, loci, ni, locj, nj, gap, gapdot, gapdotdot, dflag, iflag = given
    assert (id, time, par, npar, dflag, iflag) == (301, 0.0, [1e5, 1.5, 0.4], 3, 0, 0)
    assert (gap, gapdot, gapdotdot) == pytest.approx((-0.002, -0.25, 0.0))
    # the ball's lowest point; the box is turned upside down, its top is at -z of its marker
    np.testing.assert_allclose(loci, [0.0, 0.0, -0.1], atol=1e-12)
    np.testing.assert_allclose(ni, [0.0, 0.0, -1.0], atol=1e-12)
    np.testing.assert_allclose(locj, [0.3, 0.0, -0.5], atol=1e-12)
    np.testing.assert_allclose(nj, [0.0, 0.0, -1.0], atol=1e-12)


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ("return 1.0 / (gap - gap)", "ZeroDivisionError"),
        ("return [1.0, 2.0]", "returned 2 values"),
        ("return None", "no return statement"),
        ("return 1e308 * 10.0 * gap", "not one finite number"),
    ],
)
@pytest.mark.parametrize("interpret", [False, True])
def test_failures_reach_the_user(tmp_path, body, words, interpret):
    names = "id, time, par, npar, loci, ni, locj, nj, gap, gapdot, gapdotdot, dflag, iflag"
    (tmp_path / "bad.py").write_text(f"def CNFSUB({names}):\n    {body}\n")
    with pytest.raises(PluginError, match=r"Force_Contact\[301\]: CNFSUB failed at time") as caught:
        run_deck(tmp_path, dropped(**USER, script_name="bad.py"), interpret_plugins=interpret)
    assert words in str(caught.value)
    assert "bad.py" in str(caught.value)


def test_a_library_that_returns_nothing_is_found(tmp_path):
    compiled(tmp_path, "void CNFSUB(void) {}\n")
    with pytest.raises(PluginError, match="CNFSUB returned no finite number at time"):
        run_deck(tmp_path, dropped(**USER, cnf_dll_name="user.so"))


def test_check_info_and_log_name_it(tmp_path):
    compiled(tmp_path, "void other(void) {}\n")
    path = write_deck(tmp_path, dropped(**USER, cnf_dll_name="user.so"), 0.1)
    with pytest.raises(ModelError, match=r"deck.xml:.*neither CNFSUB \(C\) nor cnfsub_"):
        mbsim.simulate(mbsim.read_model(path))
    assert CliRunner().invoke(main, ["check", str(path)]).exit_code == 2
    path = write_deck(tmp_path, dropped(**SCRIPT), 0.1)
    law = mbsim.read_model(path).contacts[301].cnf.script_name
    said = CliRunner().invoke(main, ["info", str(path), "--json", "--plugin", law]).stdout
    assert json.loads(said)["subroutines"]["Force_Contact[301] cnf"]["asks_for"] == "nothing"
    mbsim.simulate(mbsim.read_model(path), output=tmp_path / "out").close()
    log = (tmp_path / "out/deck.log").read_text()
    assert "user CNFSUB, compiled" in log


def test_a_run_goes_on_with_it(tmp_path, monkeypatch):
    law = {**USER, "cnf_dll_name": str(example(tmp_path, "cnfsub.c"))}
    model = mbsim.read_model(write_deck(tmp_path, dropped(**law), 0.6))
    straight = mbsim.simulate(model)

    def stop(now, step, end):
        if now > 0.3:
            raise Interrupted("enough")

    with monkeypatch.context() as often:
        often.setattr("mbsim.run.divergence.RETURN_SECONDS", 1e-5)
        often.setattr("mbsim.run.loop.FIRST_BUDGET", 5)
        with pytest.raises(Interrupted):
            mbsim.simulate(model, output=tmp_path / "out", progress=stop)
    with mbsim.simulate(model, output=tmp_path / "out", resume=True) as resumed:
        np.testing.assert_array_equal(resumed["bodies/2/position"], straight["bodies/2/position"])


def test_the_function_of_the_manual_is_compiled(tmp_path):
    page = ROOT / "mbsim" / "manual" / "pages" / "reference" / "subroutines" / "cnfsub.md"
    text = page.read_text(encoding="utf-8")
    body = text[text.index("def CNFSUB(") :]
    (tmp_path / "manual.py").write_text(body[: body.index("```")])
    said = []
    run_deck(tmp_path, dropped(**USER, script_name="manual.py"), 0.4, notify=said.append)
    assert "Force_Contact[301]: CNFSUB of manual.py, compiled" in said

"""Laws in the MATLAB language: the same motion as in Python, one process a run, failures."""

from __future__ import annotations

import numpy as np
import pytest
from click.testing import CliRunner

import mbsim
from helpers.decks import GRAVITY, GROUND, contact, run_deck, sphere, write_deck
from helpers.folders import MODELS, USERFUNCS
from helpers.libraries import need
from mbsim.cli.main import main
from mbsim.errors import ModelError, PluginError
from mbsim.plugins import octave

USER = {"cff_type": "USERCFF", "cff_param_string": "USER(0.3)", "interpreter": "MATLAB"}
ARGUMENTS = "id, time, par, npar, loci, locj, x, xdot, nforce, dflag, iflag"


@pytest.fixture
def octave_cli():
    need("octave-cli")


def ball_on_plane(**law):
    ball = sphere(0.0985, v=(0.5, 0.2, 0.0), w=(0.1, 0.2, 3.0))
    return GROUND + ball + contact(damping=50, dmax=1e-3, **law) + GRAVITY


def write(folder, body, name="CFFSUB"):
    text = f"function vector = {name}({ARGUMENTS})\n{body}\nend\n"
    (folder / f"{name}.m").write_text(text)


def test_the_same_law_gives_the_same_motion_as_in_python(octave_cli):
    def run(name):
        model = mbsim.read_model(MODELS / "seed_contact.xml")
        return mbsim.simulate(model, end_time=1.0, tol=1e-7, plugins=[USERFUNCS / name])

    python, matlab = run("coulomb_stribeck.py"), run("CFFSUB.m")
    assert matlab.stats["python_calls"] == matlab.stats["friction_calls"] > 100
    for name in ("position", "velocity"):
        np.testing.assert_allclose(
            matlab[f"bodies/2/{name}"], python[f"bodies/2/{name}"], rtol=0.0, atol=1e-12
        )


def test_every_argument_arrives(octave_cli, tmp_path):
    body = """  total = time + 1e-3 * npar + 1e-6 * id + sum ((1:npar) .* par);
  total += sum ((1:3) .* (3 * loci + 5 * locj + 7 * x));
  vector = -total * [nforce * xdot(1), nforce * xdot(2), 0.01 * xdot(3)];"""
    write(tmp_path, body, "EVERY")
    (tmp_path / "every.py").write_text(
        "def EVERY(id, time, par, npar, loci, locj, x, xdot, nforce, dflag, iflag):\n"
        "    total = time + 1e-3 * npar + 1e-6 * id\n"
        "    total += sum((k + 1) * par[k] for k in range(npar))\n"
        "    total += sum((k + 1) * (3 * loci[k] + 5 * locj[k] + 7 * x[k]) for k in range(3))\n"
        "    force = -total * nforce\n"
        "    return [force * xdot[0], force * xdot[1], -0.01 * total * xdot[2]]\n"
    )
    law = {"cff_type": "USERCFF", "cff_fnc_name": "EVERY", "cff_param_string": "USER(0.2,0.1)"}
    one = run_deck(tmp_path, ball_on_plane(**law, script_name="EVERY.m"), 0.1)
    other = run_deck(tmp_path, ball_on_plane(**law, script_name="every.py"), 0.1)
    for name in ("position", "velocity", "angular_velocity"):
        np.testing.assert_allclose(
            one[f"bodies/2/{name}"], other[f"bodies/2/{name}"], rtol=0.0, atol=1e-12
        )


def test_a_normal_law_and_no_parameters(octave_cli, tmp_path):
    names = "id, time, par, npar, loci, ni, locj, nj, gap, gapdot, gapdotdot, dflag, iflag"
    (tmp_path / "CNFSUB.m").write_text(
        f"function force = CNFSUB({names})\n  force = 1e5 * (-gap) ^ 1.5 + numel (par);\nend\n"
    )
    law = {"cnf_type": "USERCNF", "cnf_param_string": "USER()", "script_name": "CNFSUB.m"}
    model = GROUND + sphere(0.2) + contact(**law) + GRAVITY
    one = run_deck(tmp_path, model, 0.3, tol=1e-9)
    other = run_deck(tmp_path, GROUND + sphere(0.2) + contact() + GRAVITY, 0.3, tol=1e-9)
    assert other["contacts/301/penetration"].max() > 1e-3
    np.testing.assert_allclose(
        one["bodies/2/position"], other["bodies/2/position"], rtol=0.0, atol=1e-7
    )


def test_one_process_serves_a_run_and_ends_with_it(octave_cli, tmp_path, monkeypatch):
    started = []
    begin = octave.Octave.__init__

    def counted(self, element):
        begin(self, element)
        started.append(self)

    monkeypatch.setattr(octave.Octave, "__init__", counted)
    write(tmp_path, "  vector = [0, 0, 0];")
    two = contact(damping=50, dmax=1e-3, **USER, script_name="CFFSUB.m")
    balls = sphere(0.0985) + sphere(0.0985, body=3, x=1.0)
    model = GROUND + balls + two + two.replace('"200"', '"300"').replace('"301"', '"302"') + GRAVITY
    run_deck(tmp_path, model, 0.05)
    assert len(started) == 1
    assert started[0].ended
    assert started[0]._process.returncode == 0


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ("  vector = [0, 0, 0];\n  if time > 0\n    vector = nowhere (3);\n  end", "CFFSUB.m:4"),
        ("  vector = [1, 2];", "returned 2 values"),
        ("  vector = 'abc';", "returned a char, not real numbers"),
        ("  vector = [0, 0, NaN];", "not 3 finite numbers"),
        ("  vector = [0, 0, 0];\n  exit (3);", "Octave ended, with code 3"),
    ],
)
def test_failures_reach_the_user_with_exit_code_4(octave_cli, tmp_path, body, words):
    write(tmp_path, body)
    path = write_deck(tmp_path, ball_on_plane(**USER, script_name="CFFSUB.m"), 0.1)
    with pytest.raises(PluginError, match=r"Force_Contact\[301\]: CFFSUB failed at time") as said:
        mbsim.simulate(mbsim.read_model(path))
    assert words in str(said.value)
    called = CliRunner().invoke(main, ["run", str(path), "-o", str(tmp_path / "out")])
    assert called.exit_code == 4


def test_files_that_octave_cannot_use_are_refused(octave_cli, tmp_path):
    def refused(name="CFFSUB", **words):
        law = {**USER, "script_name": f"{name}.m", **words}
        with pytest.raises(ModelError) as said:
            run_deck(tmp_path, ball_on_plane(**law), 0.1)
        return str(said.value)

    write(tmp_path, "  vector = [1 2\n  if x")
    assert "parse error near line" in refused()
    write(tmp_path, "  vector = [0, 0, 0];", "OTHER")
    assert "the function that has its name, here OTHER" in refused("OTHER")
    (tmp_path / "CFFSUB.m").write_text("function vector = CFFSUB(id)\n  vector = [0, 0, 0];\nend\n")
    assert "takes 1 arguments, not the 11 documented ones" in refused()
    (tmp_path / "law.py").write_text("CFFSUB = 1\n")
    assert "is in a .m file" in refused(script_name="law.py")


def test_a_contact_may_mix_languages(octave_cli, tmp_path):
    write(tmp_path, "  vector = [-0.3 * nforce * xdot(1), 0, 0];")
    (tmp_path / "post.py").write_text(
        "seen = []\ndef POST(*given):\n    seen.append(given)\n    assert len(seen) < 6, 'six'\n"
    )
    law = {**USER, "script_name": "CFFSUB.m", "cpost_script_name": "post.py"}
    with pytest.raises(PluginError, match=r"POST failed at time 0.04: AssertionError: six"):
        run_deck(tmp_path, ball_on_plane(**law, cpost_fnc_name="POST"), 0.1)


def test_two_files_of_one_name_are_refused(octave_cli, tmp_path):
    (tmp_path / "b").mkdir()
    write(tmp_path, "  vector = [0, 0, 0];")
    write(tmp_path / "b", "  vector = [0, 0, 0];")
    one = contact(damping=50, dmax=1e-3, **USER, script_name="CFFSUB.m")
    other = one.replace("CFFSUB.m", "b/CFFSUB.m").replace('"200"', '"300"').replace("301", "302")
    model = GROUND + sphere(0.2) + sphere(0.2, body=3, x=1.0) + one + other
    with pytest.raises(ModelError, match=r"Force_Contact\[302\].*has the same name"):
        run_deck(tmp_path, model, 0.1)


def test_without_octave_the_message_says_what_to_do(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    write(tmp_path, "  vector = [0, 0, 0];")
    with pytest.raises(ModelError, match="GNU Octave, and no octave-cli or octave is found"):
        run_deck(tmp_path, ball_on_plane(**USER, script_name="CFFSUB.m"), 0.1)

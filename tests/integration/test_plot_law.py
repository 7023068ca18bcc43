"""`mbsim plot-law`: a picture of each law, and what it says where it cannot draw one."""

from __future__ import annotations

import json

import numpy as np
import pytest
from click.testing import CliRunner

from helpers.folders import USERFUNCS
from mbsim.cli.main import main
from mbsim.errors import PluginError
from mbsim.laws.catalog import FRICTION_LAWS
from mbsim.laws.slip_test import USUAL, Conditions, cycle, sample_of, steady

pytest.importorskip("matplotlib")
WITH_STATE = USERFUNCS / "stiction_with_state.py"
_AND_PAGE = ["mbsim: error", "mbsim: see: "]


def plot_law(*arguments):
    return CliRunner().invoke(main, ["plot-law", *map(str, arguments)])


def sample(name, at=None, **values):
    at = at or Conditions()
    law = FRICTION_LAWS[name]
    own = {each.name: each.default for each in law.own}
    return sample_of(law, own | USUAL | values, at)


@pytest.mark.parametrize("law", list(FRICTION_LAWS))
def test_every_law_has_its_picture(tmp_path, law):
    picture = tmp_path / "law.png"
    done = plot_law(law, "-o", picture)
    assert done.exit_code == 0, done.output
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert picture.stat().st_size > 10000


def test_laws_and_a_users_function_in_one_picture(tmp_path):
    picture = tmp_path / "laws.svg"
    done = plot_law(
        "stiction", "CFFSUB", "--plugin", WITH_STATE, "--set", "par=0.3,8e3,0", "--set",
        "mu_dynamic=0.25", "--set", "nforce=20", "-o", picture, "--json",
    )  # fmt: skip
    assert done.exit_code == 0, done.output
    said = json.loads(done.stdout)
    assert said["laws"] == ["stiction", "CFFSUB"]
    assert said["nforce"] == 20.0
    assert said["set"]["mu_dynamic"] == 0.25
    text = picture.read_text()
    for word in ("STICTION", "CFFSUB", "mu_dynamic 0.25", "nforce 20", "slip to and fro"):
        assert word in text


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["FOO"], "FOO: no such friction law; there are BROWN_MCPHEE, CONTENSOU"),
        (["FOO", "--plugin", WITH_STATE], "stiction_with_state.py defines CFFSUB"),
        (["TANH", "--set", "mu_static=1"], "--set mu_static: no parameter of TANH; there are mu_d"),
        (["TANH", "--set", "mu_dynamic=-1"], "--set mu_dynamic=-1: must be 0 or more"),
        (["DAHL", "--set", "bristle_stiffness=0"], "bristle_stiffness=0: must be above 0"),
        (["TANH", "--set", "nforce=0"], "--set nforce=0: must be above 0"),
        (["TANH", "--set", "nforce=x"], "--set nforce=x: give NAME=VALUE with a number"),
        (["TANH", "-o", "law.pdf"], "-o law.pdf: the name must end in .png or .svg"),
    ],
)
def test_what_cannot_be_drawn_is_one_line(arguments, said):
    done = plot_law(*arguments)
    assert done.exit_code == 2
    assert said in done.output
    # the message, and the page of the manual
    assert [line[:12] for line in done.output.splitlines()] in (["mbsim: error"], _AND_PAGE)


def test_a_function_that_fails_is_one_line():
    done = plot_law("CFFSUB", "--plugin", WITH_STATE)
    assert done.exit_code == PluginError.exit_code
    assert "stiction_with_state.py failed: IndexError: " in done.output
    assert "(no --set par=1,2,...)" in done.output
    # the message, and the page of the manual
    assert [line[:12] for line in done.output.splitlines()] in (["mbsim: error"], _AND_PAGE)


def test_long_slides_end_at_the_laws_own_friction():
    speeds = [1e-4, 3e-3, 0.05]
    at = Conditions()
    # Stribeck's curve of LuGre, without the viscous part
    wanted = [0.3 + 0.2 * np.exp(-((v / 5e-3) ** 2)) for v in speeds]
    assert steady(sample("LUGRE"), at, speeds) == pytest.approx(wanted, rel=1e-5)
    assert steady(sample("DAHL"), at, speeds) == pytest.approx([0.3] * 3, rel=1e-5)
    assert steady(sample("STICTION"), at, speeds) == pytest.approx([0.3] * 3, rel=1e-9)
    assert steady(sample("TANH"), at, speeds) == pytest.approx(
        0.3 * np.tanh(np.array(speeds) / 1e-2)
    )


def test_the_loop_of_a_jenkins_element():
    # 4 mu N (A - mu N/k) a cycle, the damper aside
    at = Conditions(amplitude=2e-3, speed=1e-3)
    law = sample("STICTION", at, mu_static=0.3, tangential_stiffness=1e4, tangential_damping=0.0)
    x, force = map(np.array, cycle(law, at))
    one = slice(len(x) // 5, None)  # a whole cycle, from the largest x on
    work = -np.trapezoid(force[one], x[one]) * at.nforce
    assert work == pytest.approx(4 * 3.0 * (2e-3 - 3e-4), rel=1e-3)

"""What a run that finds its code compiled must not import: start-up is time that a user waits."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

import mbsim
from helpers.folders import DATA, MODELS
from mbsim.core import jit
from mbsim.plugins import friction

#: Needed by other scenes, by pictures, or while something is compiled.
UNNEEDED = (
    "fcl",
    "lark",
    "latex2mathml",
    "markdown_it",
    "matplotlib",
    "mbsim.core.clocked",
    "mbsim.core.compiling",
    "mbsim.dynamics.linearization.mechanism",
    "mbsim.fclib",
    "mbsim.manual",
    "mbsim.plugins.friction",
    "mbsim.plugins.guard",
    "mbsim.plugins.source",
    "mbsim.reader.adm",
    "mbsim.run.linear_model",
    "mbsim.run.statics",
    "numba",
    "rich",
    "scipy.linalg",
    "scipy.sparse",
    "trimesh",
)
#: What `check` does without as well.
OF_RUNS = (
    *("h5py", "llvmlite", "scipy", "mbsim.core.jit", "mbsim.dynamics"),
    *("mbsim.integrators.driver", "mbsim.results.store"),
)
#: Most modules of a run and of `check` of a small deck: each takes a third of a millisecond, those
#: of ours five times as much where Python keeps no bytecode.
MOST, MOST_OF_CHECK = 730, 465

CALL = """
import json, sys
from mbsim.cli.main import main
try:
    main()
finally:
    print(json.dumps(sorted(sys.modules)), file=sys.stderr)
"""


def modules(*command):
    """Return the modules that a command imports."""
    done = subprocess.run(
        [sys.executable, "-c", CALL, *map(str, command)], capture_output=True, text=True, check=True
    )
    return json.loads(done.stderr.splitlines()[-1])


def those_of(found, names):
    """Return what was imported of packages and modules."""
    return [one for one in found if any(f"{one}.".startswith(f"{name}.") for name in names)]


#: Decks with a contact; joints; both, and expressions, which one imports `lark` for; friction; a
#: user's function; boxes, which rest on each other by MOREAU.
DECKS = {
    "drop_m": (),
    "four_bar": (),
    "pendulum_wheel": ("lark",),
    "lugre_stick_slip": ("lark",),
    "bowling_ball": ("mbsim.plugins.friction", "mbsim.plugins.guard", "mbsim.plugins.source"),
    "rigid/cube_stack": ("mbsim.fclib",),
}


@pytest.mark.parametrize("deck", DECKS)
def test_a_run_that_finds_its_code_imports_nothing_else(tmp_path, deck):
    end = "0.02" if deck.startswith("rigid/") else "0.1"
    run = ("run", MODELS / f"{deck}.xml", "-o", tmp_path, "--end-time", end)
    modules(*run)  # compiles what is not there
    unneeded = [name for name in UNNEEDED if name not in DECKS[deck]]
    found = modules(*run)
    assert those_of(found, unneeded) == []
    assert DECKS[deck] or len(found) <= MOST


def test_check_needs_no_compiler():
    found = modules("check", MODELS / "drop_m.xml")
    assert those_of(found, UNNEEDED + OF_RUNS) == []
    assert len(found) <= MOST_OF_CHECK


def test_what_is_in_a_contact_problem_is_told_without_a_compiler():
    found = modules("fclib", "info", min((DATA / "fclib").glob("*.hdf5")))
    assert those_of(found, ("numba", "scipy.linalg", "trimesh")) == []


def test_a_subroutine_is_compiled_and_probed_once_a_process(monkeypatch):
    model = mbsim.read_model(MODELS / "bowling_ball.xml")
    with mbsim.simulate(model, end_time=0.05) as first:
        place = first["bodies/2/position"]

    def never(*given):
        raise AssertionError("probed once more")

    monkeypatch.setattr(friction, "_probed", never)
    compiled = jit.total
    heavier = mbsim.read_model(MODELS / "bowling_ball.xml", ("Body_Rigid[2].mass=6",))
    with mbsim.simulate(heavier, end_time=0.05), mbsim.simulate(model, end_time=0.05) as last:
        assert (last["bodies/2/position"] == place).all()
    assert jit.total == compiled

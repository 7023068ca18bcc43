"""Users' code: which commands run it, how it is forbidden, and calls that take long."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import mbsim
from helpers.decks import GRAVITY, GROUND, contact, sphere, write_deck
from mbsim.errors import ModelError, PluginError
from mbsim.plugins import permission

LAW = """
import pathlib
pathlib.Path(__file__).with_name("ran").write_text("ran")
def CFFSUB(id, time, par, npar, loci, locj, x, xdot, nforce, dflag, iflag):
    {}
    return [-5.0 * xdot[0], -5.0 * xdot[1], 0.0]
"""
USER = {"cff_type": "USERCFF", "cff_fnc_name": "CFFSUB", "script_name": "law.py"}


def deck(folder: Path, body: str = "pass") -> Path:
    """Write a sliding ball whose friction is a user's."""
    (folder / "law.py").write_text(LAW.format(body), encoding="utf-8")
    text = GROUND + sphere(0.0999, v=(0.5, 0, 0)) + contact(**USER) + GRAVITY
    return Path(write_deck(folder, text, end_time=0.05))


def cli(*arguments: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "mbsim", *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.parametrize("command", ["check", "info"])
def test_check_and_info_run_no_code_of_a_deck(tmp_path: Path, command: str) -> None:
    assert cli(command, deck(tmp_path)).returncode == 0
    assert not (tmp_path / "ran").exists()


@pytest.mark.parametrize("named", ["deck", "plugin"])
def test_code_can_be_forbidden(tmp_path: Path, named: str) -> None:
    path = deck(tmp_path)
    options = ["--no-scripts", "-o", tmp_path / "out"]
    if named == "plugin":
        path.write_text(path.read_text().replace('script_name="law.py"', ""))
        options += ["--plugin", tmp_path / "law.py"]
    done = cli("run", path, *options)
    assert done.returncode == 2
    assert "Force_Contact[301]" in done.stderr
    assert "--no-scripts forbids users' code" in done.stderr
    assert not (tmp_path / "ran").exists()


def test_request_runs_no_code_where_it_is_forbidden(tmp_path: Path) -> None:
    mbsim.simulate(mbsim.read_model(deck(tmp_path)), output=tmp_path / "out").close()
    (tmp_path / "ran").unlink()
    done = cli("request", tmp_path / "out/deck.h5", "Force_Contact[301].force", "--no-scripts")
    assert done.returncode == 2
    assert "--no-scripts" in done.stderr
    assert not (tmp_path / "ran").exists()


@pytest.mark.skipif(sys.platform == "win32", reason="no alarm")
def test_a_call_that_takes_too_long_ends_the_run(tmp_path: Path) -> None:
    # nor does it help to catch whatever comes
    body = "while time > 0.01:\n        try: len(par)\n        except Exception: pass"
    model = mbsim.read_model(deck(tmp_path, body))
    with pytest.raises(PluginError, match=r"CFFSUB failed at time 0\.01.*longer than 0\.5 s"):
        mbsim.simulate(model, interpret_plugins=True, plugin_timeout=0.5, output=tmp_path / "out")
    with mbsim.open_results(tmp_path / "out/deck.h5") as results:
        assert results.status == "failed"
        assert results["time"][-1] <= 0.01


def test_a_call_that_takes_long_is_told_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(permission, "LONG", 0.05)
    said: list[str] = []
    # waits until it was told of
    body = "global told\n    while time > 0.01 and not said():\n        pass"
    (tmp_path / "law.py").write_text("")
    path = deck(tmp_path, body)
    law = (tmp_path / "law.py").read_text()
    (tmp_path / "law.py").write_text(
        f"from {__name__} import SAID\nsaid = lambda: len(SAID)\n{law}"
    )
    SAID.clear()
    mbsim.simulate(
        mbsim.read_model(path),
        interpret_plugins=True,
        notify=lambda line: (said.append(line), SAID.append(line) if "not returned" in line else 0),
    ).close()
    told = [line for line in said if "has not returned for 0.05 s" in line]
    assert len(told) == 1
    assert "law.py" in told[0]


#: What the law above waits for.
SAID: list[str] = []


@pytest.mark.skipif(sys.platform != "linux", reason="memory of a process is bounded on Linux")
def test_memory_that_is_not_there_is_a_message(tmp_path: Path) -> None:
    model = mbsim.read_model(deck(tmp_path, "hoard = bytearray(1 << 50)"))
    with pytest.raises(PluginError, match="MemoryError"):
        mbsim.simulate(model, interpret_plugins=True)


def test_a_bound_on_memory_is_taken_back(tmp_path: Path) -> None:
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_DATA)
    with permission.limited(None, print):
        pass
    assert resource.getrlimit(resource.RLIMIT_DATA) == before


def test_permission_is_given_back(tmp_path: Path) -> None:
    with permission.no_scripts(), pytest.raises(ModelError, match="forbids"):
        permission.check(tmp_path / "a.py", "Force_Contact[1]")
    permission.check(tmp_path / "a.py", "Force_Contact[1]")

"""Runs that are killed at random instants go on as if nothing had been, bit for bit.

``MBSIM_KILLS=200 python -m pytest -m slow -s tests/integration/test_kills.py`` kills so many.
"""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from helpers.decks import COULOMB, GRAVITY, GROUND, contact, sphere, write_deck
from helpers.folders import MODELS
from mbsim.results.reading import open_results

KILLS = int(os.environ.get("MBSIM_KILLS", "24"))
SEED = int(os.environ.get("MBSIM_KILL_SEED", "1"))

#: An interpreted law with states of its own.
STATES = """
CFFSUB_STATES = 2
def CFFSUB(id, time, par, npar, loci, locj, x, xdot, nforce, dflag, iflag, state):
    pull = [-2e3 * x[0] - state[0], -2e3 * x[1] - state[1]]
    return [pull[0], pull[1], 0.0], [0.9 * state[0] + xdot[0], 0.9 * state[1] + xdot[1]]
"""
STAGES = (
    '<Simulate analysis_type="Transient" end_time="1.0" print_interval="0.0005"/>'
    '<Force_Gravity grav_x="1" grav_z="-9.81"/>'
    '<Simulate analysis_type="Transient" end_time="2.0" print_interval="0.0005"/>'
)


def _of_models(name: str, *options: str) -> tuple[str, list[str]]:
    return str(MODELS / f"{name}.xml"), list(options)


#: Decks whose runs take about a second or more, with every method and kind of state.
CASES = {
    "bowling ball, a compiled plugin": _of_models(
        "bowling_ball", "--tol", "1e-11", "--end-time", "40"
    ),
    "bowling ball, interpreted": _of_models(
        "bowling_ball", "--interpret-plugins", "--end-time", "20"
    ),
    "weakening, memory of a plugin": _of_models("belt_weakening", "--tol", "1e-9"),
    "LuGre": _of_models("lugre_stick_slip", "--integrator", "RADAU5"),
    "LuGre, explicit": _of_models("lugre_stick_slip", "--integrator", "DOP853", "--end-time", "4"),
    "SDND121": _of_models("sdnd121", "--tol", "1e-9"),
    "Force_Element": _of_models("dry_friction_element", "--tol", "1e-10"),
    "cam, AUTO": _of_models("cam", "--tol", "1e-8"),
    "stop, GALPHA": _of_models("four_bar_stop", "--integrator", "GALPHA", "--tol", "1e-7"),
    "governor": _of_models("flyball_governor", "--print-interval", "0.001"),
    "rigid stiction": _of_models("stiction_rigid", "--end-time", "2"),
    "disc": _of_models("contensou_disc", "--integrator", "DOPRI5", "--tol", "1e-9"),
    "walls": _of_models("poisson_walls", "--tol", "1e-10", "--end-time", "4"),
    "mesh": _of_models("mesh_on_plane", "--end-time", "2"),
    "stack, RADAU5": _of_models("stiff/box_stack", "--integrator", "RADAU5"),
    "bushings, GALPHA": _of_models("stiff/bushing_chain", "--integrator", "GALPHA"),
}


def _law_with_states(folder: Path) -> tuple[str, list[str]]:
    (folder / "law.py").write_text(STATES, encoding="utf-8")
    law = {"cff_type": "USERCFF", "cff_fnc_name": "CFFSUB", "script_name": "law.py"}
    text = GROUND + sphere(0.0995, v=(0.5, 0.1, 0)) + contact(**law) + GRAVITY
    return str(write_deck(folder, text, 3.0, print_interval=0.001)), ["--interpret-plugins"]


def _stages(folder: Path) -> tuple[str, list[str]]:
    text = GROUND + sphere(0.4, v=(0.5, 0, 0)) + contact(**COULOMB) + GRAVITY
    path = folder / "deck.xml"
    path.write_text(f"<MotionSolve><Model>{text}</Model><Command>{STAGES}</Command></MotionSolve>")
    return str(path), ["--tol", "1e-10"]


MADE = {"interpreted law with states": _law_with_states, "two Simulates": _stages}


def command(deck: str, options: list[str], out: Path, *more: str) -> list[str]:
    """Return the command line of a run."""
    base = [sys.executable, "-m", "mbsim", "run", deck, "-o", str(out), "--progress", "off"]
    return [*base, *options, *more]


def killed(line: list[str], after: float) -> bool:
    """Run a command, kill it after so many seconds; return whether it was still running."""
    with subprocess.Popen(line, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) as process:
        try:
            _, said = process.communicate(timeout=after)
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGKILL)
            process.communicate()
            return True
    assert process.returncode == 0, said.decode()
    return False


def seen(folder: Path) -> list[str]:
    """Return the names of the files that a user sees."""
    return sorted(path.name for path in folder.iterdir() if not path.name.startswith("."))


def same(one: Path, other: Path) -> None:
    """Compare all signals and the CSV of two results."""
    name = next(one.glob("*.h5")).name
    with open_results(one / name) as a, open_results(other / name) as b:
        assert a.status == b.status == "finished"
        assert a.keys() == b.keys()
        for key in a.keys():
            np.testing.assert_array_equal(a[key], b[key], err_msg=key)
    csvs = [sorted(folder.glob("*.csv")) for folder in (one, other)]
    assert [path.name for path in csvs[0]] == [path.name for path in csvs[1]]
    for left, right in zip(*csvs, strict=True):
        assert left.read_bytes() == right.read_bytes()


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="sends SIGKILL")
@pytest.mark.parametrize("case", [*CASES, *MADE])
def test_a_killed_run_goes_on_bit_for_bit(tmp_path: Path, case: str) -> None:
    deck, options = CASES[case] if case in CASES else MADE[case](tmp_path)
    chance = random.Random(f"{SEED} {case}")
    wanted = max(1, KILLS // (len(CASES) + len(MADE)))
    straight = tmp_path / "straight"
    assert not killed(command(deck, options, straight), 600.0)  # compiles, too
    began = time.perf_counter()
    assert not killed(command(deck, options, straight), 600.0)
    whole = time.perf_counter() - began
    kills = 0
    for round_ in range(20 * wanted):
        out, more = tmp_path / f"killed{round_}", []
        while killed(command(deck, options, out, *more), chance.uniform(0.0, whole)):
            kills += 1
            published = list(out.glob("*.h5"))
            statuses = []
            for file in published:
                with open_results(file) as results:
                    statuses.append(results.status)
                    assert len(results["state/y"]) == len(results["time"])
            if statuses == ["finished"]:  # killed while it took leave
                break
            assert statuses in ([], ["running"])
            more = ["--resume"] if published else []
        same(straight, out)
        assert seen(out) == seen(straight)
        if kills >= wanted:
            break
    print(f"{case}: {kills} kills, {round_ + 1} runs of {whole:.1f} s")
    assert kills >= wanted

"""Signals and failures between a run's steps: what is kept, and how the run goes on from there."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mbsim
from helpers.decks import COULOMB, GRAVITY, GROUND, contact, sphere, write_deck
from mbsim.errors import Interrupted, SolverError
from mbsim.results import recorder
from mbsim.results.part_file import PartFile
from mbsim.run import loop
from mbsim.run.hook_calls import HookCalls

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="sends signals")

#: Friction by a law that calls `at_half` once, in the midst of a step behind time 0.1.
LAW = """
import pathlib
fired = pathlib.Path(__file__).with_name("fired")
def CFFSUB(id, time, par, npar, loci, locj, x, xdot, nforce, dflag, iflag):
    if time > 0.1 and not fired.exists():
        fired.touch()
        import os, signal
        for number in {signals}:
            os.kill(os.getpid(), number)
    return [-5.0 * xdot[0], -5.0 * xdot[1], 0.0]
"""
STAGES = "".join(
    f'<Force_Gravity grav_x="{k}" grav_z="-9.81"/><Simulate analysis_type="Transient" '
    f'end_time="{0.1 * k!r}" print_interval="0.005"/>'
    for k in range(1, 4)
)


@pytest.fixture
def busy(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let runs come back to Python every few evaluations, and publish each time."""
    monkeypatch.setattr("mbsim.run.divergence.RETURN_SECONDS", 1e-6)
    monkeypatch.setattr(loop, "FIRST_BUDGET", 7)
    monkeypatch.setattr(recorder.Recorder, "due", lambda self: True)


def user_deck(folder: Path, signals: list[int]) -> Path:
    """Write a sliding ball whose friction law sends the process signals, once."""
    numbers = [int(number) for number in signals]
    (folder / "law.py").write_text(LAW.format(signals=numbers), encoding="utf-8")
    law = {"cff_type": "USERCFF", "cff_fnc_name": "CFFSUB", "script_name": "law.py"}
    model = GROUND + sphere(0.0999, v=(0.5, 0, 0)) + contact(**law) + GRAVITY
    return Path(write_deck(folder, model, end_time=0.2, print_interval=0.005))


def staged_deck(folder: Path) -> Path:
    """Write a ball that bounces through three Simulates, under other gravities."""
    path = folder / "deck.xml"
    model = GROUND + sphere(0.15, v=(0.5, 0, 0)) + contact(**COULOMB) + GRAVITY
    path.write_text(f"<Deck><Model>{model}</Model><Command>{STAGES}</Command></Deck>")
    return path


def goes_on(path: Path, out: Path, **settings: Any) -> None:
    """Resume a run, and compare all of it with a straight one."""
    model = mbsim.read_model(path)
    with mbsim.open_results(out / "deck.h5") as kept:
        assert kept.has_checkpoint
        assert len(kept["state/y"]) == len(kept["time"]) > 1
    straight = mbsim.simulate(model, **settings)
    with mbsim.simulate(model, output=out, resume=True, **settings) as found:
        assert found.status == "finished"
        assert found.keys() == straight.keys()
        for name in found.keys():
            np.testing.assert_array_equal(found[name], straight[name], err_msg=name)
        for name in ("steps", "rejected"):
            assert found.stats[name] == straight.stats[name]


@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.usefixtures("busy")
def test_a_second_signal_ends_a_users_call_and_the_run_goes_on(tmp_path: Path, sent: int) -> None:
    path, out = user_deck(tmp_path, [sent, sent]), tmp_path / "out"
    model = mbsim.read_model(path)
    with pytest.raises(Interrupted, match="in the midst of a step") as raised:
        mbsim.simulate(model, output=out, interpret_plugins=True)
    assert raised.value.exit_code == 128 + sent
    with mbsim.open_results(out / "deck.h5") as kept:
        assert kept.status == "interrupted"
        assert 0.09 < kept["time"][-1] < 0.11
    goes_on(path, out, interpret_plugins=True)


@pytest.mark.usefixtures("busy")
@pytest.mark.parametrize("at_end", [False, True])
def test_signals_wait_while_results_are_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, at_end: bool
) -> None:
    path, out, plain = staged_deck(tmp_path), tmp_path / "out", PartFile.publish
    sent = []

    def publish(part: PartFile, last: bool = False) -> None:
        if (last or len(sent) > 0) if at_end else len(sent) < 3:
            for _ in range(2):
                sent.append(signal.SIGTERM)
                os.kill(os.getpid(), signal.SIGTERM)
        plain(part, last)

    model = mbsim.read_model(path)
    with monkeypatch.context() as patch:
        patch.setattr(PartFile, "publish", publish)
        if at_end:
            # the run is over: it ends as if nobody had sent anything
            mbsim.simulate(model, output=out).close()
        else:
            with pytest.raises(Interrupted) as raised:
                mbsim.simulate(model, output=out)
            assert raised.value.exit_code == 128 + signal.SIGTERM
    assert len(sent) >= 2
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
    if at_end:
        with mbsim.open_results(out / "deck.h5") as kept:
            assert kept.status == "finished"
    else:
        goes_on(path, out)


def asked(runner: loop.Runner) -> None:
    """Ask for an end as a signal does."""
    os.kill(os.getpid(), signal.SIGTERM)


def failing(runner: loop.Runner) -> None:
    """Let the next Simulate fail at its first row."""
    plain, output = HookCalls.must, runner.problem.output

    def must(hooks: HookCalls, hook: int, t: float, a: Any, b: Any) -> int:
        if hook == output:
            raise SolverError("no first row")
        return plain(hooks, hook, t, a, b)

    HookCalls.must = must  # type: ignore[method-assign]


@pytest.mark.parametrize(("what", "error"), [(asked, Interrupted), (failing, SolverError)])
@pytest.mark.parametrize("after", [0, 1])
def test_an_end_between_simulates(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    what: Callable[[loop.Runner], None],
    error: type[Exception],
    after: int,
) -> None:
    path, out, plain = staged_deck(tmp_path), tmp_path / "out", loop.Runner._run_stage

    def run_stage(runner: loop.Runner, *given: Any) -> None:
        plain(runner, *given)
        if runner.stage == after:
            what(runner)

    with monkeypatch.context() as patch:
        patch.setattr(loop.Runner, "_run_stage", run_stage)
        patch.setattr(HookCalls, "must", HookCalls.must)  # put back behind
        with pytest.raises(error):
            mbsim.simulate(mbsim.read_model(path), output=out)
    with mbsim.open_results(out / "deck.h5") as kept:
        assert kept["time"][-1] < 0.1 * (after + 1)
    goes_on(path, out)

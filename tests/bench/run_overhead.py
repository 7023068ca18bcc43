"""What a run costs beside its loop, in a process that runs a deck many times with other values.

    python tests/bench/run_overhead.py [RUNS]

prints a row for each way of running: processor time of a run, of its loop, and what is beside it,
each the least of ten rounds [ms]. `simulate` is called with another mass each time; a sweep's runs
are those of a study in this process, of which a mass and a law's damping are drawn.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest import mock

import mbsim
from mbsim.integrators import binding
from mbsim.studies.study import read_study
from mbsim.studies.worker import run_one

DECK = Path(__file__).parents[2] / "models" / "bowling_ball.xml"
ROUNDS = 10
STUDY = """
[study]
model = "{deck}"
design = "latin_hypercube"
runs = {runs}

[parameters.mass]
path = "Body_Rigid[2].mass"
low = 4.9
high = 5.1

[parameters.damping]
path = "Force_Contact[301].damping"
low = 100.0
high = 300.0

[outputs.x]
signal = "bodies/2/position/x"
reduce = "last"
"""


def timed(seconds: list[float]) -> Callable[[], Callable[..., int]]:
    """Return `binding.advancing` with what its function takes of the processor noted."""
    plain = binding.advancing

    def advancing() -> Callable[..., int]:
        advance = plain()

        def advance_timed(*given: Any) -> int:
            began = time.process_time()
            outcome = advance(*given)
            seconds.append(time.process_time() - began)
            return outcome

        return advance_timed

    return advancing


def measured(run: Callable[[int], object], runs: int) -> tuple[float, float]:
    """Return processor time beside the loop of a run, and of its loop [ms]: each the least."""
    seconds: list[float] = []
    found = []
    with mock.patch.object(binding, "advancing", timed(seconds)):
        for k in range(20):
            run(k)
        for _ in range(ROUNDS):
            seconds.clear()
            began = time.process_time()
            for k in range(runs):
                run(k)
            whole, loop = time.process_time() - began, sum(seconds)
            found.append((1e3 * (whole - loop) / runs, 1e3 * loop / runs))
    return min(beside for beside, _ in found), min(loop for _, loop in found)


def main() -> None:
    """Print the table."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "study.toml"
        file.write_text(STUDY.format(deck=DECK, runs=runs), encoding="utf-8")
        study = read_study(file)
        model = mbsim.read_model(DECK)
        ways: dict[str, Callable[[int], object]] = {
            "simulate, deck": lambda k: mbsim.simulate(
                DECK, overrides={"Body_Rigid[2].mass": 5.0 + 1e-4 * k}
            ),
            "simulate, model": lambda k: mbsim.simulate(model),
            "sweep": lambda k: run_one(study, study.case(k % runs)),
        }
        print(f"{'':16} {'run':>6} {'loop':>6} {'beside':>6}")
        for name, run in ways.items():
            beside, loop = measured(run, runs)
            print(f"{name:16} {beside + loop:6.2f} {loop:6.2f} {beside:6.2f}", flush=True)


if __name__ == "__main__":
    main()

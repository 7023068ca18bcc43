"""Six tasks as scripts of three programs: lines, and seconds of processor time of a second run.

    python tests/bench/tasks/compare.py --python mujoco=PYTHON exudyn=PYTHON

PYTHON is an interpreter with that program and matplotlib; without it the program's scripts are
counted and not run. Blank lines, comments and the script's docstring are not counted.
"""

from __future__ import annotations

import argparse
import ast
import os
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).parent
TASKS = {
    "ball_friction": "ball with own friction",
    "pendulum_wheel": "pendulum on a wheel with control",
    "pile": "pile of 125 balls",
    "gripper": "gripper",
    "study": "parameter study",
    "forces": "look at contact forces",
}
PROGRAMS = ("mbsim", "mujoco", "exudyn")


def lines(task: str, program: str) -> int:
    """Return the lines of a script that do something."""
    text = (HERE / f"{task}_{program}.py").read_text(encoding="utf-8")
    head = ast.parse(text).body[0].end_lineno or 0
    rest = text.splitlines()[head:]
    return sum(1 for line in rest if line.strip() and not line.strip().startswith("#"))


def seconds(python: str, task: str, program: str) -> tuple[float, str]:
    """Return the processor time [s] of a second run, and the last line that it prints."""
    script = str(HERE / f"{task}_{program}.py")
    shown = ""
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(2):
            before = os.times()
            done = subprocess.run(
                [python, script], cwd=folder, capture_output=True, text=True, check=True
            )
            after = os.times()
            shown = done.stdout.strip().splitlines()[-1]
    used = after.children_user - before.children_user
    return used + after.children_system - before.children_system, shown


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--python", nargs="*", default=[], metavar="PROGRAM=PYTHON")
    pythons = {"mbsim": sys.executable}
    pythons |= dict(each.split("=", 1) for each in parser.parse_args().python)
    print("| task | " + " | ".join(f"{program} lines, s" for program in PROGRAMS) + " |")
    print("|---" * (1 + len(PROGRAMS)) + "|")
    for task, name in TASKS.items():
        cells, last = [], []
        for program in PROGRAMS:
            count = str(lines(task, program))
            if program in pythons:
                used, shown = seconds(pythons[program], task, program)
                count += f", {used:.1f}"
                last.append(f"{program} {shown}")
            cells.append(count)
        print(f"| {name} | " + " | ".join(cells) + " |", flush=True)
        print("   ", "; ".join(last), file=sys.stderr, flush=True)


if __name__ == "__main__":
    main()

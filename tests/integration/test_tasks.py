"""The scripts of the six tasks: mbsim's run and tell what they must, the others' are there."""

from __future__ import annotations

import ast
import subprocess
import sys

import numpy as np
import pytest

from helpers.folders import TESTS

TASKS = TESTS / "bench" / "tasks"
#: What the last line of a script must hold: numbers and how near, from closed forms.
LAST = {
    "ball_friction": ([5 / 7 * 5], 5e-3),  # it rolls
    "pendulum_wheel": ([0.0], 1e-3),
    "gripper": ([0.25], 1e-3),  # lifted by 0.2
    "study": ([0.3, 5 / 7 * 5 * 2 + (2 / 7 * 5) ** 2 / (2 * 0.3 * 9.81)], 1e-2),
    "forces": ([-0.3 * 9.81, 0.0, 9.81], 1e-2),
}


@pytest.mark.slow
@pytest.mark.parametrize("task", LAST)
def test_a_script_of_ours_tells_what_it_must(task, tmp_path):
    script = str(TASKS / f"{task}_mbsim.py")
    done = subprocess.run(
        [sys.executable, script], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    shown = done.stdout.strip().splitlines()[-1].strip("[]").split()
    wanted, near = LAST[task]
    np.testing.assert_allclose([float(each) for each in shown], wanted, atol=near)


def test_each_task_has_a_script_for_each_program():
    tasks = {path.stem.rpartition("_")[0] for path in TASKS.glob("*_mbsim.py")}
    assert len(tasks) == 6
    for task in tasks:
        heads = {
            ast.get_docstring(ast.parse((TASKS / f"{task}_{program}.py").read_text("utf-8")))
            for program in ("mbsim", "mujoco", "exudyn")
        }
        assert len(heads) == 1

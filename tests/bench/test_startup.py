"""Design notes 1 and 3, measured: python -m pytest -m bench -s tests/bench/test_startup.py

Cold compile, warm start and the start after editing one law, in a copy of the package; the
cost of a call by address that sees a group of 50 arrays.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from numba import njit

import mbsim
from mbsim.core import jit
from mbsim.core.address import call_float, pack, view
from mbsim.core.arrays import F1, F2
from mbsim.core.signature import FLOAT, INT, POINTER

pytestmark = pytest.mark.bench
PACKAGE = Path(mbsim.__file__).resolve().parent
#: Starts of a command of which the least counts.
STARTS = 5


def seconds(folder, environment, *command):
    """Return the processor time of a command of the `mbsim` in a folder."""
    before = os.times()
    subprocess.run(
        [sys.executable, "-m", "mbsim", *map(str, command)],
        cwd=folder,
        env=environment,
        capture_output=True,
        check=True,
    )
    now = os.times()
    spent = now.children_user + now.children_system
    return spent - before.children_user - before.children_system


def test_cold_warm_and_after_editing_one_law(tmp_path):
    shutil.copytree(PACKAGE, tmp_path / "mbsim")
    deck = PACKAGE.parent / "models/drop_m.xml"
    law = tmp_path / "mbsim/laws/friction/coulomb.py"
    environment = {**os.environ, "MBSIM_CACHE_DIR": str(tmp_path / "cache")}
    for name in ("PYTHONDONTWRITEBYTECODE", "PYTHONPYCACHEPREFIX"):
        environment.pop(name, None)
    # whether Python keeps the bytecode of modules counts for as much as all else
    keeps = {**environment, "PYTHONPYCACHEPREFIX": str(tmp_path / "bytecode")}
    refuses = {**environment, "PYTHONDONTWRITEBYTECODE": "1"}
    run, check = ("run", deck, "-o", tmp_path), ("check", deck)
    cold = seconds(tmp_path, keeps, *run)
    print(f"\ncold: {cold:.1f} s")
    seconds(tmp_path, keeps, *check)
    for name, command in (("run", run), ("check", check)):
        kept, unkept = (
            min(seconds(tmp_path, its, *command) for _ in range(STARTS)) for its in (keeps, refuses)
        )
        print(f"{name}, warm: {kept:.2f} s; where no bytecode is kept {unkept:.2f} s")
        assert kept < cold
    law.write_text(law.read_text() + "\n# edited\n")
    print(f"after editing one law: {seconds(tmp_path, keeps, *run):.1f} s")


class Ten(NamedTuple):
    a: F1
    b: F1
    c: F1
    d: F1
    e: F1
    f: F2
    g: F2
    h: F2
    i: F2
    j: F2


class Fifty(NamedTuple):
    a: Ten
    b: Ten
    c: Ten
    d: Ten
    e: Ten


def _by_address(context, t, h, a, b):
    group = view(context, Fifty)
    return group.a.a[0] * group.c.f[1, 1] + t


@njit
def _loop_address(address, context, x, count):
    total = 0.0
    for k in range(count):
        total += call_float(address, (context, float(k), 0.0, x, x))
    return total


def test_a_call_by_address():
    def ten():
        return Ten(*[np.ones(3) for _ in range(5)], *[np.ones((3, 3)) for _ in range(5)])

    group = Fifty(*[ten() for _ in range(5)])
    table = pack(group)
    address = jit.address(_by_address, FLOAT(INT, FLOAT, FLOAT, POINTER, POINTER))
    x, count = np.zeros(1), 2_000_000
    _loop_address(address, table.ctypes.data, x, 10)
    times = []
    for _ in range(5):
        began = time.perf_counter()
        _loop_address(address, table.ctypes.data, x, count)
        times.append((time.perf_counter() - began) / count)
    print(f"\na call by address with 50 arrays: {1e9 * sorted(times)[2]:.1f} ns")
    assert min(times) > 0.0

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
from numba import njit, types

import mbsim
from mbsim.core import jit
from mbsim.core.address import call_float, pack, view
from mbsim.core.arrays import F1, F2

pytestmark = pytest.mark.bench
PACKAGE = Path(mbsim.__file__).resolve().parent
RUN = (
    "import mbsim; r = mbsim.simulate(mbsim.read_model({deck!r})); "
    "print(r.stats['wall_s'], r.stats['compile_s'])"
)


def test_cold_warm_and_after_editing_one_law(tmp_path):
    shutil.copytree(PACKAGE, tmp_path / "mbsim")
    deck = PACKAGE.parent / "models/drop_m.xml"
    law = tmp_path / "mbsim/laws/friction/coulomb.py"
    environment = {
        **os.environ,
        "PYTHONPATH": str(tmp_path),
        "MBSIM_CACHE_DIR": str(tmp_path / "cache"),
    }
    print()
    for name in ("cold", "warm", "after editing one law", "warm"):
        if name.startswith("after"):
            law.write_text(law.read_text() + "\n# edited\n")
        began = time.perf_counter()
        done = subprocess.run(
            [sys.executable, "-c", RUN.format(deck=str(deck))],
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
            check=True,
        )
        whole = time.perf_counter() - began
        wall, compiling = map(float, done.stdout.split())
        print(
            f"{name}: {whole:.2f} s in all, {wall:.2f} s of it the run, {compiling:.2f} s compiling"
        )
        assert compiling < whole


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
    pointer = types.CPointer(types.float64)
    signature = types.float64(types.int64, types.float64, types.float64, pointer, pointer)
    address = jit.address(_by_address, signature)
    x, count = np.zeros(1), 2_000_000
    _loop_address(address, table.ctypes.data, x, 10)
    times = []
    for _ in range(5):
        began = time.perf_counter()
        _loop_address(address, table.ctypes.data, x, count)
        times.append((time.perf_counter() - began) / count)
    print(f"\na call by address with 50 arrays: {1e9 * sorted(times)[2]:.1f} ns")
    assert min(times) > 0.0

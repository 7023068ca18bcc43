"""Roots link what they call: what is emitted, recursion, exceptions, the cache, Numba's costs."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest
from numba import float64, int64, njit
from numba.core import ir, targetconfig
from numba.core.compiler import Flags, run_frontend

from helpers.folders import PACKAGES
from mbsim.core import jit, linking, numba_costs
from mbsim.core.jitable import jitable

pytestmark = pytest.mark.skipif(linking.POLICY == "all", reason="Numba's own linking")

HELPERS = """
import math

from mbsim.core.jitable import jitable
from numba import njit


@jitable
def halved(x):
    return 0.5 * x


@jitable
def shifted(x):
    return math.sin(halved(x)) + 1.0


@njit
def even(n):
    return 1 if n == 0 else odd(n - 1)


@njit
def odd(n):
    return 0 if n == 0 else even(n - 1)


@njit
def factorial(n):
    return 1 if n < 2 else n * factorial(n - 1)


@jitable
def checked(x):
    if x < 0.0:
        raise ValueError("negative")
    return shifted(x)


def root(n, x):
    return 1000.0 * factorial(n) + 100.0 * even(n) + shifted(x) + checked(x)
"""

RUN = """
import ctypes, pathlib, sys
{before}
from mbsim.core import jit, linking
from numba import float64, int64
import helpers
found = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_int64, ctypes.c_double)(
    jit.address(helpers.root, float64(int64, float64))
)
called = jit.function(helpers.checked)
try:
    called(-1.0)
except ValueError as error:
    said = str(error)
print(found(5, 0.3).hex(), found(4, 0.3).hex(), called(2.0).hex(), said, linking.POLICY,
      "root" in linking.emitted, "shifted" in linking.emitted, jit.compile_seconds > 0.0)
"""


def in_a_process(folder, before=""):
    """Return what RUN prints in a process of its own, whose cache is in `folder`."""
    (folder / "plugins").mkdir(exist_ok=True)
    (folder / "plugins" / "helpers.py").write_text(HELPERS)
    path = os.pathsep.join([str(folder / "plugins"), str(PACKAGES)])
    environment = {**os.environ, "MBSIM_CACHE_DIR": str(folder), "PYTHONPATH": path}
    done = subprocess.run(
        [sys.executable, "-c", RUN.format(before=before)],
        capture_output=True,
        text=True,
        env=environment,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


def test_same_numbers_from_linked_roots_the_cache_and_numbas_own_linking(tmp_path):
    linked, cached = in_a_process(tmp_path), in_a_process(tmp_path)
    assert linked[3:] == ["negative", linking.POLICY, "True", "False", "True"]
    assert cached[3:] == ["negative", linking.POLICY, "False", "False", "False"]
    stock = in_a_process(tmp_path, 'import numba; numba.__version__ = "0.0.1"')
    assert stock[4:6] == ["all", "False"]
    assert linked[:3] == cached[:3] == stock[:3]
    assert float.fromhex(linked[0]) == pytest.approx(120002.3, abs=0.1)  # 5! and odd
    assert float.fromhex(linked[1]) == pytest.approx(24102.3, abs=0.1)  # 4! and even


@jitable
def inner_most(x):
    return 3.0 * x


@jitable
def inner(x):
    return inner_most(x) + 1.0


def test_only_roots_are_emitted_and_an_inner_function_is_shared():
    def first(x):
        return inner(x)

    def second(x):
        return 2.0 * inner(x)

    jit.address(lambda x: x, float64(float64))  # with it the runtime's own functions
    before = list(linking.emitted)
    for function in (first, second):
        jit.address(function, float64(float64))
    new = linking.emitted[len(before) :]
    assert [name.rsplit(".", 1)[-1] for name in new] == ["first", "second"]


def test_an_inner_function_is_emitted_when_python_calls_it():
    called = njit(lambda x: x + 1.0)
    root = njit(lambda x: 2.0 * called(x))
    assert root(1.0) == 4.0
    assert called(1.0) == 2.0


def test_options_are_equal_as_numba_says():
    flags = []
    for name, value in (
        ("nrt", True),
        ("nrt", False),
        ("forceinline", True),
        ("boundscheck", None),
    ):
        one = Flags()
        setattr(one, name, value)
        flags.append(one)
    flags += [Flags(), flags[0].copy()]
    for a in flags:
        for b in flags:
            assert (a == b) == numba_costs._equal_options(a, b)
            assert hash(a) == hash(tuple(sorted(b.values())))
    assert flags[0] != 1
    assert targetconfig.TargetConfig.__eq__ is numba_costs._same_options


def by_numbas_rule(part):
    """List variables as Numba's own method does it, written down anew."""
    if isinstance(part, ir.Var):
        return [part]
    if isinstance(part, ir.Inst):
        return part.list_vars()
    if isinstance(part, list | tuple | dict):
        inner = part.values() if isinstance(part, dict) else part
        return [v for p in inner for v in by_numbas_rule(p)]
    return []


def test_variables_of_statements_are_listed_as_numba_does():
    def sample(a, n):
        total = 0.0
        for k in range(n):
            total += a[k, 0] * (a[k, 1:3].sum() if n > 2 else -1.0)
        return total, (a, n)

    listed = 0
    for block in run_frontend(sample).blocks.values():
        for statement in block.body:
            assert statement.list_vars() == by_numbas_rule(statement.__dict__)
            listed += len(statement.list_vars())
    assert listed > 30


def test_types_of_mixed_operators_are_as_before():
    @njit
    def mixed(a, x, n):
        return (a + x)[0] + (x * n) ** 2 + n // 2

    assert mixed(np.array([1.5]), 0.5, 4) == 2.0 + 4.0 + 2
    assert mixed.nopython_signatures[0].return_type == float64
    assert int64 in mixed.nopython_signatures[0].args


PAIR = """
from mbsim.core import jit
from mbsim.geometry.catalog import PAIRS
from mbsim.laws.catalog import NORMAL_LAWS
from mbsim.laws import abi
from mbsim.compile_model.contacts import pair_address, region_address
pair_address(PAIRS["SPHERE-PLANE"]), region_address("BOX-PLANE")
abi.normal_address(NORMAL_LAWS["IMPACT"])
print(jit.compile_seconds > 0.0)
"""


def test_what_is_compiled_for_a_scene_is_found_again_by_the_next_process(tmp_path):
    environment = {**os.environ, "MBSIM_CACHE_DIR": str(tmp_path)}
    said = [
        subprocess.run(
            [sys.executable, "-c", PAIR],
            capture_output=True,
            text=True,
            env=environment,
            check=True,
        ).stdout.split()
        for _ in range(2)
    ]
    assert said == [["True"], ["False"]]

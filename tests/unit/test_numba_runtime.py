"""Stored code that makes arrays and raises runs without Numba, and beside one imported later."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from helpers.folders import PACKAGES

MODULE = """
import numpy as np

def total(n):
    try:
        if n < 0:
            raise ValueError("less than nothing")
        a = np.empty(n)
        for k in range(n):
            a[k] = k
        return a.reshape(-1, 1)[:, 0].sum()
    except Exception:
        return -1.0
"""
CALL = """
import importlib.util, os, sys
from mbsim.core import jit
from mbsim.core.signature import FLOAT, INT
spec = importlib.util.spec_from_file_location("allocating", os.environ["MODULE"])
module = importlib.util.module_from_spec(spec)
sys.modules["allocating"] = module
spec.loader.exec_module(module)
{before}
total = FLOAT(INT).at(jit.address(module.total, FLOAT(INT), allocates=True))
print(*(total(n) for n in (0, 3, 5, -1)))
print(jit.total, sorted(name for name in sys.modules if f"{{name}}.".startswith("numba.")) != [])
{after}
"""
RIGHT = "0.0 3.0 10.0 -1.0"


def call(tmp_path, before="", after=""):
    """Return the lines that a process prints which loads the function, or compiles it."""
    root = tmp_path / "compiled"
    root.mkdir(mode=0o700, exist_ok=True)
    module = root / "allocating.py"
    if not module.exists():
        module.write_text(MODULE)
        os.utime(module, (1e9, 1e9))
    done = subprocess.run(
        [sys.executable, "-c", CALL.format(before=before, after=after)],
        env={
            **os.environ,
            "PYTHONPATH": str(PACKAGES),
            "MBSIM_CACHE_DIR": str(root),
            "MODULE": str(module),
        },
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder whose code is compiled."""
    found = tmp_path_factory.mktemp("stored")
    assert call(found) == [RIGHT, "1 True"]
    return found


FREED = """
import resource
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
for _ in range(2000):
    total(100_000)  # 1.6 GB if nothing were freed
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100_000)
"""


def test_it_runs_without_numba_and_frees_what_it_makes(folder):
    assert call(folder, after=FREED) == [RIGHT, "0 False", "True"]


LATER = """
import llvmlite.binding as llvm
from mbsim.core import numba_runtime
names = numba_runtime.found()
import numba, numpy as np
from mbsim.core.function_cache import name_runtime
name_runtime()
print(all(llvm.address_of_symbol(name) == address for name, address in names.items()))
from numba import _helperlib
from numba.core.runtime import _nrt_python
print(all(names["numba_" + n] == at for n, at in _helperlib.c_helpers.items()))

@numba.njit
def listed(n):
    if n > 5:
        raise ValueError("many")
    made = [np.ones(k) for k in range(n)]
    return sum([each.sum() for each in made])

print(listed(4), total(4))
try:
    listed(6)
except ValueError as error:
    print(error)
"""


def test_numba_that_is_imported_later_has_the_same_runtime(folder):
    said = call(folder, after=LATER)
    assert said == [RIGHT, "0 False", "True", "True", "6.0 6.0", "many"]


@pytest.mark.parametrize(
    "before",
    [
        "from mbsim.core import numba_runtime\nnumba_runtime.TESTED = ()",
        "from mbsim.core import numba_runtime\nnumba_runtime.LIBRARIES = {'_none': 'numba_'}",
        "import numba",
    ],
    ids=["a Numba that was not tried", "a library that is not there", "Numba is there"],
)
def test_where_it_cannot_be_named_alone_numba_names_it(folder, before):
    assert call(folder, before) == [RIGHT, "0 True"]

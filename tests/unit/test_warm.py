"""Code that was compiled ahead: for a family of processors, in a folder that is only read."""

from __future__ import annotations

import itertools
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from mbsim.cli.main import main
from mbsim.core import code_cache, jit, machine_code, processors
from mbsim.core.signature import FLOAT
from mbsim.errors import ModelError
from mbsim.geometry.catalog import PAIRS, REGIONS
from mbsim.laws.catalog import FRICTION_LAWS, NORMAL_LAWS
from mbsim.warming import tasks

PACKAGE = code_cache.PACKAGE
ROOT = Path(__file__).resolve().parents[2]
DROP = str(ROOT / "models" / "drop_m.xml")
#: Any machine that runs the tests runs the code of one of these.
FAMILY = processors.runnable()[-1] if processors.runnable() else "generic"
LAW = """
import ctypes, sys
{before}
from mbsim.core import jit
from mbsim.laws import abi
from mbsim.laws.catalog import NORMAL_LAWS
import numpy as np
hertz = ctypes.CFUNCTYPE(
    ctypes.c_int64, ctypes.c_double, ctypes.c_double, ctypes.c_void_p, ctypes.c_void_p
)(abi.normal_address(NORMAL_LAWS["HERTZ"]))
constants, out = np.array([1e5, 0.3]), np.zeros(3)
hertz(1e-3, 0.1, constants.ctypes.data, out.ctypes.data)
print(jit.total, out[0].hex())
"""
LACKS = """
from mbsim.core import processors
processors.get_host_cpu_features = lambda: ""
processors.FAMILIES["{family}"] = ("a feature of tomorrow",)
"""


def in_a_process(cache, shipped="", before="", **more):
    """Return how many functions a process compiled that calls a law, and the force."""
    done = subprocess.run(
        [sys.executable, "-c", LAW.format(before=before)],
        capture_output=True,
        text=True,
        env={
            **os.environ,
            "PYTHONPATH": str(ROOT),
            "MBSIM_CACHE_DIR": str(cache),
            "MBSIM_SHIPPED_CODE": str(shipped),
            **more,
        },
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


def stored(folder):
    """Return the files of code below a folder, with their times."""
    return {file: file.stat().st_mtime_ns for file in Path(folder).rglob("*.code")}


@pytest.fixture(scope="module")
def shipped(tmp_path_factory):
    """Return a folder of shipped code with one law in it, and the force that it gives."""
    folder = tmp_path_factory.mktemp("shipped")
    of_family = folder / processors.folder_of(FAMILY)
    compiled, force = in_a_process(of_family, **processors.settings(FAMILY))
    assert compiled == "1"
    for path in folder.rglob("*"):
        path.chmod(0o555 if path.is_dir() else 0o444)
    yield folder, force
    for path in folder.rglob("*"):
        path.chmod(0o755)


def test_shipped_code_is_read_and_not_written(shipped, tmp_path):
    folder, force = shipped
    before = stored(folder)
    assert in_a_process(tmp_path, folder) == ["0", force]
    assert stored(folder) == before
    assert not stored(tmp_path)


def test_code_for_another_processor_is_left_alone(shipped, tmp_path):
    folder, force = shipped
    lacks = LACKS.format(family=FAMILY)
    assert in_a_process(tmp_path, folder, lacks) == ["1", force]
    # what was missed is the user's own from then on
    assert stored(tmp_path)
    assert in_a_process(tmp_path, folder, lacks) == ["0", force]


def test_whoever_asks_for_code_of_a_processor_gets_no_other(shipped, tmp_path):
    folder, force = shipped
    asked = {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": "-avx"}
    assert in_a_process(tmp_path, folder, **asked) == ["1", force]


def test_the_users_own_code_comes_before_shipped_code(shipped, tmp_path):
    folder, force = shipped
    assert in_a_process(tmp_path) == ["1", force]
    spoilt = tmp_path / "spoilt"
    shutil.copytree(folder, spoilt)
    for file in stored(spoilt):
        file.chmod(0o644)
        file.write_bytes(b"")
    assert in_a_process(tmp_path, spoilt) == ["0", force]


def test_code_is_kept_nowhere_if_its_folder_cannot_be_written(tmp_path):
    nowhere = tmp_path / "a file"
    nowhere.write_text("")
    assert in_a_process(nowhere)[0] == "1"


def test_a_folder_that_keeps_no_code_is_told_before_anything_is_compiled(tmp_path):
    """By `warm` alone, which has no other purpose: a run goes on without."""
    (tmp_path / "taken").touch()
    options = [DROP, "--target", "generic", "-o", str(tmp_path / "taken")]
    found = CliRunner().invoke(main, ["warm", *options])
    assert found.exit_code == 5
    assert "taken" in found.stderr
    environment = {**os.environ, "MBSIM_CACHE_DIR": str(tmp_path / "taken")}
    line = [sys.executable, "-m", "mbsim", "warm", DROP]
    done = subprocess.run(line, env=environment, capture_output=True, text=True, timeout=600)
    assert done.returncode == 5
    assert "cannot be kept" in done.stderr
    assert "Traceback" not in done.stderr
    assert "functions compiled" not in done.stdout


def test_families_and_what_they_need():
    names = list(processors.FAMILIES)
    for better, plainer in itertools.pairwise(names):
        assert set(processors.FAMILIES[plainer]) <= set(processors.FAMILIES[better])
    with pytest.raises(ModelError, match=r"there are x86-64-v4"):
        processors.settings("x86-64-v9")


def test_what_this_machine_does_not_run_is_not_compiled(monkeypatch):
    monkeypatch.setattr(processors, "runnable", lambda: ("generic",))
    monkeypatch.setattr(processors, "get_host_cpu_features", lambda: "+sse3,-avx")
    with pytest.raises(ModelError, match=r"x86-64-v3: .* it has no cx16, popcnt, sahf, sse4"):
        processors.settings("x86-64-v3")


def test_what_a_run_lacks_is_counted_before_it_is_compiled(monkeypatch):
    made, told, asked = [], [], []
    functions = [lambda x: x + 1.0, lambda x: x + 2.0, lambda x: x + 3.0]
    monkeypatch.setattr(jit, "is_known", lambda function: True)
    monkeypatch.setattr(jit, "compiled", 0)
    monkeypatch.setattr(jit, "expected", 0)
    monkeypatch.setattr(machine_code, "Place", Nowhere)
    monkeypatch.setattr(jit, "on_plan", lambda: told.append((jit.compiled, jit.expected)))
    monkeypatch.setattr(jit, "on_compile", lambda name: made.append((jit.compiled, jit.expected)))
    jit.address(functions[0], FLOAT(FLOAT))

    def make():
        asked.append(jit.planned(lambda: [jit.address(f, FLOAT(FLOAT)) for f in functions]))
        return asked[-1]

    addresses = jit.planned(make)
    assert told == [(1, 3)]
    assert made == [(1, 1), (2, 3), (3, 3)]
    assert len(asked) == 2  # counted, then made
    assert asked[0][0] == addresses[0]
    assert min(addresses) > 0
    # what is there is made at once
    assert jit.planned(make) == addresses
    assert len(asked) == 3
    assert told == [(1, 3)]


class Nowhere(machine_code.Place):
    """A place in which nothing is ever found."""

    def find(self):
        return None

    def keep(self, code):
        pass


def test_all_that_is_registered_is_warmed():
    names = {task.name for task in tasks.tasks(True, [])}
    assert {*NORMAL_LAWS, *FRICTION_LAWS, *PAIRS, *(f"{name} region" for name in REGIONS)} <= names
    assert {"FCLIB AUTO rolling", "FCLIB NSN 2D", "broadphase RADAU5"} <= names
    assert {f"bowling_ball.xml {name}" for name in tasks.METHODS} <= names
    usual = {task.name for task in tasks.tasks(False, [])}
    assert usual <= names


def test_bytecode_is_kept_where_python_may_not_write_it(tmp_path):
    copied = tmp_path / "mbsim"
    for name in ("core", "warming"):
        shutil.copytree(PACKAGE / name, copied / name, ignore=shutil.ignore_patterns("*.pyc"))
    for file in PACKAGE.glob("*.py"):
        shutil.copy(file, copied)
    (copied / "core" / "broken.py").write_text("1 +")
    environment = {**os.environ, "PYTHONPATH": str(tmp_path), "PYTHONDONTWRITEBYTECODE": "1"}
    environment.pop("PYTHONPYCACHEPREFIX", None)
    script = "from mbsim.warming.bytecode import keep_bytecode; print(keep_bytecode())"
    line = [sys.executable, "-c", script]
    done = subprocess.run(
        line, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True
    )
    assert (done.stdout, done.stderr) == ("False\n", "")
    sources = {file.stem for file in copied.rglob("*.py")} - {"broken"}
    assert {file.name.split(".")[0] for file in copied.rglob("*.pyc")} == sources


def test_warm_runs_a_model_and_names_one_that_it_cannot(tmp_path):
    deck = str(ROOT / "models" / "drop_m.xml")
    nothing = str(tmp_path / "nothing.xml")
    done = CliRunner().invoke(main, ["warm", deck, nothing])
    assert done.exit_code == 0
    assert f"s; they are in {jit.cache_root()}" in done.stdout
    assert "nothing.xml" in done.stderr
    assert CliRunner().invoke(main, ["warm", nothing]).exit_code == 2
    assert CliRunner().invoke(main, ["warm", "--target", "x86-64-v3"]).exit_code == 2


@pytest.mark.parametrize("task", [*tasks._texts(("AUTO", "RADAU5"))], ids=lambda task: task.name)
@pytest.mark.slow
def test_every_deck_that_is_warmed_runs(task):
    assert tasks.refused(task) == ""

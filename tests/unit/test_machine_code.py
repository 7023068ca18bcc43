"""Stored code of C functions: what tells one from another, and files that are damaged."""

from __future__ import annotations

import subprocess
import sys

import pytest

from helpers.folders import PACKAGES
from mbsim.core import machine_code
from mbsim.core.machine_code import Code, Place
from mbsim.core.signature import FLOAT, INT, POINTER
from mbsim.geometry.catalog import PAIRS
from mbsim.laws import abi
from mbsim.laws.catalog import NORMAL_LAWS

CODE = Code("its name", ("hypot", "sqrt"), bytes(range(256)) * 10)


def test_a_file_holds_what_was_put_there(tmp_path):
    file = tmp_path / "some.code"
    file.write_bytes(machine_code._packed(CODE))
    assert machine_code._read(file) == CODE
    assert machine_code._read(tmp_path / "none.code") is None


@pytest.mark.parametrize("damage", ["empty", "cut", "changed", "longer", "another's"])
def test_a_damaged_file_holds_nothing(tmp_path, damage):
    whole = machine_code._packed(CODE)
    file = tmp_path / "some.code"
    made = {
        "empty": b"",
        "cut": whole[:-1],
        "changed": whole[:100] + bytes([whole[100] ^ 1]) + whole[101:],
        "longer": whole + b"\n",
        "another's": b"x" * len(whole),
    }
    file.write_bytes(made[damage])
    assert machine_code._read(file) is None


def names(places):
    """Return the names of the files of code, for some processor."""
    return [place._file(place.sources.folder, "p").name for place in places]


def adapted(count, law=None):
    return abi._adapt_normal(law or NORMAL_LAWS["HERTZ"].law, count)


def test_what_a_function_closes_over_tells_it_from_others():
    two, signature = adapted(2), abi.NORMAL_SIGNATURE
    found = names(
        [
            Place(two, signature, False),
            Place(adapted(3), signature, False),
            Place(adapted(2, NORMAL_LAWS["IMPACT"].law), signature, False),
            Place(two, FLOAT(INT, POINTER), False),
            Place(two, signature, True),
        ]
    )
    assert len(set(found)) == len(found)
    assert names([Place(adapted(2), signature, False)]) == found[:1]


def test_all_processes_have_the_same_names():
    script = """
from mbsim.core.machine_code import Place
from mbsim.compile_model import pair_adapter
from mbsim.geometry.catalog import PAIRS
pair = PAIRS["SPHERE-PLANE"]
place = Place(pair_adapter.adapt_pair(pair.points, pair.slots), pair_adapter.SIGNATURE, True)
print(place._file(place.sources.folder, "p").name)
"""
    said = {
        subprocess.run(
            [sys.executable, "-c", script],
            env={"PYTHONPATH": str(PACKAGES), "PYTHONHASHSEED": seed, "PATH": ""},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for seed in "12"
    }
    assert len(said) == 1
    assert PAIRS["SPHERE-PLANE"].slots == 1
